"""Gaits for slopes and stairs, judged by event-driven runs on the ground that they are for."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.errors import GaitError, InfeasibleGaitError
from heelstrike.gait import load_gait
from heelstrike.gait.stairs import Stairs
from heelstrike.sim import EventKind

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

LENGTH, DURATION = 0.35, 0.8
STEPS = 3


def stairs(tread: float, rise: float) -> hs.Ground:
    """Stairs with the origin in the middle of a tread."""
    treads = np.arange(-3, 6)
    x = np.column_stack([(treads - 0.5) * tread, (treads + 0.5) * tread]).ravel()
    return hs.Ground(friction=0.75, profile=np.column_stack([x, np.repeat(treads * rise, 2)]))


GROUNDS = {
    "up 8 degrees": ({"slope": np.deg2rad(8.0)}, hs.Ground(friction=0.75, slope=np.deg2rad(8.0))),
    "down 8 degrees": (
        {"slope": np.deg2rad(-8.0)},
        hs.Ground(friction=0.75, slope=np.deg2rad(-8.0)),
    ),
    "upstairs": ({"rise": 0.10, "clearance": 0.02}, stairs(LENGTH, 0.10)),
    "downstairs": ({"rise": -0.05, "clearance": 0.02}, stairs(LENGTH, -0.05)),
}


@pytest.fixture(scope="module", params=GROUNDS)
def walked(request: pytest.FixtureRequest, bravo7: hs.Robot) -> tuple[hs.Gait, hs.Run]:
    asked, ground = GROUNDS[request.param]
    gait = hs.optimize_gait(bravo7, step_length=LENGTH, step_duration=DURATION, starts=1, **asked)
    run = hs.simulate(
        bravo7, hs.ComputedTorque(bravo7, gait), state=gait.initial_state,
        duration=STEPS * DURATION + 0.05, method=hs.EventDriven(), ground=ground,
    )  # fmt: skip
    return gait, run


def test_the_steps_are_those_that_were_designed(walked: tuple[hs.Gait, hs.Run]) -> None:
    """Feet land when and where they should, flat, and touch nothing on their way."""
    gait, run = walked
    assert run.completed
    landed = [event.time for event in run.events if event.kind is EventKind.TOUCHDOWN]
    expected = np.repeat(DURATION * np.arange(1, STEPS + 1), 2)  # heel and toe
    np.testing.assert_allclose(landed, expected, atol=1e-7)
    ahead = np.array([np.cos(gait.slope), np.sin(gait.slope)])
    expected = STEPS * (LENGTH * ahead + [0.0, gait.rise])
    # The trunk 0.01 s into a step, against itself as many steps before.
    early = [np.interp(0.01, run.time, run.position[:, k]) for k in range(2)]
    late = [np.interp(STEPS * DURATION + 0.01, run.time, run.position[:, k]) for k in range(2)]
    np.testing.assert_allclose(np.subtract(late, early), expected, atol=2e-5)  # of interpolation


@pytest.mark.slow
def test_high_stairs_are_descended(bravo7: hs.Robot) -> None:
    """Here the phase at which the foot is too low moves with every instant that is added."""
    gait = hs.optimize_gait(
        bravo7, step_length=0.35, step_duration=0.80, rise=-0.10, clearance=0.02
    )
    assert gait.optimal
    assert gait.margins.clearance >= -1e-9


def test_a_file_keeps_the_ground(walked: tuple[hs.Gait, hs.Run], tmp_path) -> None:  # type: ignore[no-untyped-def]
    gait, _ = walked
    gait.save(tmp_path / "gait.json")
    read = load_gait(tmp_path / "gait.json")
    assert (read.slope, read.rise, read.spent) == (gait.slope, gait.rise, gait.spent)


def test_smooth_stairs_are_nowhere_below_the_real_ones() -> None:
    x = np.linspace(-0.6, 0.6, 2401)
    for rise in (0.1, -0.1):
        ground = stairs(0.35, rise)
        height = -np.array([float(Stairs(0.35, rise).height(place, 0.0)) for place in x])
        inside = np.abs(x) < 1.5 * 0.35  # the treads that a swing foot passes
        above = height[inside] - np.array([ground.height(place) for place in x[inside]])
        assert above.min() >= -1e-12
        middle = np.abs(np.abs(x[inside] / 0.35) % 1.0) < 0.3
        np.testing.assert_allclose(above[middle], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"slope": 8.0}, "slope must be a number between -1 and 1 rad"),
        ({"slope": np.nan}, "slope must be"),
        ({"rise": "0.1"}, "rise must be"),
        ({"slope": 0.1, "rise": 0.1}, "slope and rise are both given"),
    ],
)
def test_ground_that_makes_no_sense(bravo7: hs.Robot, asked: dict, words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(GaitError, match=words):
        hs.optimize_gait(bravo7, step_length=0.3, step_duration=0.7, **asked)


def test_a_step_beyond_reach_counts_its_rise(bravo7: hs.Robot) -> None:
    with pytest.raises(InfeasibleGaitError, match="cannot take a step"):
        hs.optimize_gait(bravo7, step_length=1.7, step_duration=0.7, rise=1.0)
