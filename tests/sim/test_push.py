"""Pushes: what a force over a window of time does, under every simulation method."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking
from mechanisms import block
from synthetic_runs import box, pendulum

import heelstrike as hs
from heelstrike.analysis.energy import energy_balance

METHODS = [hs.TimeStepping(step=1e-3), hs.EventDriven(), hs.Compliant()]
NAMES = [type(method).__name__ for method in METHODS]


def in_the_air(**options: Any) -> hs.Run:
    """A block of 2 kg and 0.3 kg m², at rest 5 m above the ground, no gravity, for 0.5 s."""
    robot = block(width=1.0, height=0.2, mass=2.0, inertia=0.3, gravity=0.0)
    q = robot.reference_state().q
    q[1] += 5.0
    return hs.simulate(robot, state=hs.State(q, np.zeros(3)), duration=0.5, **options)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_the_impulse_is_force_times_duration(method: Any) -> None:
    """m Δv = F T, wherever the window lies between the steps: exact but for round-off."""
    push = hs.Push("block", force=(30.0, -12.0), start=0.10037, duration=0.05511)
    run = in_the_air(method=method, pushes=[push])
    expected = np.array([30.0, -12.0]) * 0.05511 / 2.0
    np.testing.assert_allclose(run.velocity[-1, :2], expected, rtol=1e-12)
    assert abs(run.velocity[-1, 2]) < 1e-12
    before = run.time < 0.1
    assert not np.any(run.velocity[before])


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_a_force_away_from_the_centre_turns(method: Any) -> None:
    """A push up of 1 N, 0.4 m ahead of the centre: the moment about +y is −0.4 N m.

    Over 0.1 s that is −0.04 N m s, a turn of −0.04 / 0.3 rad/s. The block turns by less than
    0.007 rad meanwhile, which changes the lever by 3e-5 of itself.
    """
    push = hs.Push("block", force=(0.0, 1.0), start=0.1, duration=0.1, point=(0.4, 0.0))
    run = in_the_air(method=method, pushes=[push])
    assert run.velocity[-1, 2] == pytest.approx(-0.04 / 0.3, rel=1e-4)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_pushes_add_up(method: Any) -> None:
    right = hs.Push(0, force=(5.0, 0.0), start=0.1, duration=0.2)
    left = hs.Push("block", force=(-5.0, 0.0), start=0.2, duration=0.2)
    run = in_the_air(method=method, pushes=[right, left])
    assert abs(run.velocity[-1, 0]) < 1e-12
    assert run.position[-1, 0] == pytest.approx(0.1 * 5.0 / 2.0 * 0.2, rel=1e-2)


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
def test_friction_holds_a_block_up_to_its_limit(method: Any) -> None:
    """A block of 2 kg under μ = 0.5 stands a push of 9.8 N at its foot: μ m g is 9.81 N.

    At 20 N it slides: (20 − 9.81) N × 0.1 s / 2 kg = 0.5095 m/s at the end of the push, and
    stops again v / (μ g) = 0.104 s later.
    """
    robot, ground = box(), hs.Ground(friction=0.5)
    state = robot.reference_state()
    runs = [
        hs.simulate(
            robot,
            state=state,
            duration=0.4,
            ground=ground,
            method=method,
            pushes=[hs.Push("box", force=(f, 0.0), start=0.1, duration=0.1, point=(0.0, -0.05))],
        )
        for f in (9.8, 20.0)
    ]
    tolerance = 1e-4 if isinstance(method, hs.Compliant) else 1e-9
    assert abs(runs[0].position[-1, 0]) <= tolerance
    at_the_end = int(np.argmin(np.abs(runs[1].time - 0.2)))
    fast = 0.02 if isinstance(method, hs.Compliant) else 1e-9
    assert runs[1].velocity[at_the_end, 0] == pytest.approx((20.0 - 9.81) * 0.05, abs=fast)
    assert abs(runs[1].velocity[-1, 0]) <= 1e-3


def test_the_work_of_pushes_is_in_the_balance() -> None:
    """Event driven, at rtol 1e-8: the pendulum gains what the push does, to the rows' 1e-6."""
    push = hs.Push("rod", force=(40.0, 0.0), start=0.1003, duration=0.25, point=(0.0, -1.0))
    run = hs.simulate(
        pendulum(),
        state=hs.State([0.2], [0.0]),
        duration=0.6,
        method=hs.EventDriven(output_period=1e-4),
        pushes=[push],
    )
    balance = energy_balance(run)
    assert abs(balance.pushes[-1]) > 1.0
    # Rows do not fall on the ends of the window: there the mean over an interval of 1e-4 s stands
    # for a part of it.
    assert np.max(np.abs(balance.residual)) < 1e-3
    stepped = hs.simulate(pendulum(), state=hs.State([0.2], [0.0]), duration=0.6, pushes=[push])
    assert energy_balance(stepped).pushes[-1] == pytest.approx(balance.pushes[-1], rel=0.02)


def test_no_pushes_change_nothing() -> None:
    controller = hs.ComputedTorque(walking.bravo7(), walking.gait())
    start = walking.gait().initial_state
    never = hs.Push("trunk", force=(100.0, 0.0), start=9.0, duration=0.1)
    plain, idle = (
        hs.simulate(walking.bravo7(), controller, state=start, duration=1.0, pushes=pushes)
        for pushes in ([], [never])
    )
    np.testing.assert_array_equal(plain.position, idle.position)


def test_pushes_are_saved_with_the_run(tmp_path: Path) -> None:
    push = hs.Push("trunk", force=(10.0, -3.0), start=0.01, duration=0.02)
    run = hs.simulate(
        walking.bravo7(),
        None,
        state=walking.gait().initial_state,
        duration=0.05,
        pushes=[push],
    )
    assert run.pushes == (push,)
    (again,) = hs.load_run(run.save(tmp_path / "run.nc")).pushes
    assert (again.force, again.start, again.duration) == (push.force, push.start, push.duration)
    assert again.place(run.robot) == push.place(run.robot)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"force": (1.0,)}, "two numbers"),
        ({"force": (np.nan, 0.0)}, "finite"),
        ({"start": np.inf}, "start"),
        ({"start": "0"}, "start"),
        ({"duration": -0.1}, "duration"),
        ({"point": 3.0}, "point"),
    ],
)
def test_pushes_are_checked(options: dict[str, Any], words: str) -> None:
    arguments = {"force": (1.0, 0.0), "start": 0.0, "duration": 0.1} | options
    with pytest.raises(hs.SimulationError, match=words):
        hs.Push("trunk", **arguments)


@pytest.mark.parametrize(("link", "words"), [("head", "trunk"), (99, "0 to"), (-1, "0 to")])
def test_a_push_needs_a_link(link: Any, words: str) -> None:
    push = hs.Push(link, force=(1.0, 0.0), start=0.0, duration=0.1)
    with pytest.raises(hs.SimulationError, match=words):
        hs.simulate(
            walking.bravo7(),
            None,
            state=walking.bravo7().reference_state(),
            duration=0.1,
            pushes=[push],
        )


@pytest.mark.parametrize("link", [None, 1.9, True])
def test_a_link_has_a_name_or_an_index(link: Any) -> None:
    with pytest.raises(hs.SimulationError, match="link must be a text or a whole number"):
        hs.Push(link, force=(1.0, 0.0), start=0.0, duration=0.1)


def test_something_that_is_no_push() -> None:
    robot = walking.bravo7()
    with pytest.raises(hs.SimulationError, match=r"Push\(\.\.\.\)"):
        hs.simulate(robot, None, state=robot.reference_state(), duration=0.1, pushes=[3.0])  # type: ignore[list-item]
