"""Responses to disturbances, against simulations and against the linearisation of a step."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.analysis.stability.loop import ClosedLoop, steps_of
from heelstrike.analysis.stability.response import step_duration
from heelstrike.dynamics import contact_positions
from heelstrike.experiments.passive import METHOD, passive_walk
from heelstrike.sim.closed_sets import EventKind

SLOPE = -0.05
RAMP = hs.Ground(friction=3.0, slope=SLOPE)


@cache
def compass() -> tuple[hs.Robot, hs.LimitCycle]:
    robot = hs.load_robot("compass_gait")
    return robot, passive_walk(robot, RAMP)


def pushed(simulation: hs.Simulation, size: float) -> None:
    """An impulse of a size (N s) at the hip."""
    force, now = (size / 0.05, 0.0), simulation.time
    simulation.apply(hs.Push(2, force=force, start=now, duration=0.05))


def raised(simulation: hs.Simulation, size: float) -> None:
    """A ramp that is higher from the next foothold on, along the normal."""
    _, cycle = compass()
    edge, slope = 1.93 * cycle.step_length, np.tan(SLOPE)
    x = np.array([-5.0, edge, edge + 1e-3, edge + 60.0])
    z = slope * x + size / np.cos(SLOPE) * np.array([0.0, 0.0, 1.0, 1.0])
    simulation.ground = hs.Ground(friction=3.0, profile=np.column_stack((x, z)))


@cache
def measured() -> hs.DisturbanceResponse:
    robot, cycle = compass()
    return hs.disturbance_response(
        robot, cycle.state, disturbances={"push": (pushed, 1e-4), "height": (raised, 1e-5)},
        ground=RAMP, method=METHOD, settling=0, returns=1,
    )  # fmt: skip


def durations(push: float, returns: int) -> np.ndarray:
    """Durations of every other step, a walk being pushed in the middle of its second."""
    robot, cycle = compass()
    simulation = hs.Simulation(robot, state=cycle.state, ground=RAMP, method=METHOD)
    simulation.advance(1.5 * cycle.period)
    pushed(simulation, push)
    simulation.advance((2 * returns + 1.5) * cycle.period)
    down = [e.time for e in simulation.record.events if e.kind.name == "TOUCHDOWN" and e.time > 0.0]
    return np.diff(down)[1::2][:returns]


def test_durations_after_a_push_are_what_is_predicted() -> None:
    """By both ways, of 1e-4 N s: errors of differences are its square, and 1e-12 s over it."""
    size, returns = 1e-4, 5
    change = (durations(size, returns) - durations(-size, returns)) / (2.0 * size)
    np.testing.assert_allclose(measured().after("push", returns)[:, 0], change, atol=2e-5)
    assert np.abs(change).max() > 1e-3


def test_norms_are_those_of_their_parts() -> None:
    found = measured()
    assert found.norms.keys() == {"push", "height"}
    assert found.norm == pytest.approx(np.hypot(*found.norms.values()))
    assert found.norms["push"] == pytest.approx(np.linalg.norm(found.after("push", 60)), rel=1e-9)


def test_a_higher_foothold_is_that_of_the_linearised_step() -> None:
    """Of two steps the first ends on it; the second's duration follows from errors it began with.

    Seen without a difference of simulations: saltation matrices.
    """
    robot, cycle = compass()
    step = hs.monodromy(robot, cycle.state, ground=RAMP, method=METHOD)
    height = step.step_height
    wanted = [height.duration_state @ height.state]
    error = step.matrix @ step.matrix @ height.state
    for _ in range(3):
        wanted.append(height.duration_state @ error)
        error = step.matrix @ step.matrix @ error
    found = measured().after("height", 4)[:, 0]
    np.testing.assert_allclose(found, wanted, atol=2e-4)
    assert np.abs(wanted).max() > 1e-2


def test_doubts_are_what_numbers_are_wrong_by() -> None:
    """Of central differences of size h the error is c h², of half that size c h²/4: 3/4 of it.

    By pushes that are simulated and by heights from saltation matrices, neither of which knows of
    these sizes; they are so large that differences are wrong by more than simulations are.
    """
    robot, cycle = compass()
    coarse = hs.disturbance_response(
        robot, cycle.state, disturbances={"push": (pushed, 2e-2), "height": (raised, 1e-3)},
        ground=RAMP, method=METHOD, settling=0, returns=1, disturbance=1e-3,
    )  # fmt: skip
    change = (durations(1e-4, 30) - durations(-1e-4, 30)) / 2e-4
    step = hs.monodromy(robot, cycle.state, ground=RAMP, method=METHOD)
    height, error = step.step_height, step.step_height.state
    seen = []
    for _ in range(30):
        seen.append(height.duration_state @ error)
        error = step.matrix @ step.matrix @ error
    for name, wanted in (("push", np.linalg.norm(change)), ("height", np.linalg.norm(seen))):
        wrong, doubt = abs(coarse.norms[name] - wanted), coarse.doubts[name]
        assert wrong == pytest.approx(4.0 / 3.0 * doubt, rel=0.2)
        assert measured().doubts[name] < 0.05 * doubt
    assert "push 0.1313 ±" in repr(coarse)


def test_what_there_is_to_doubt() -> None:
    """One return has no others to differ from; a push one way may do what its opposite does not."""
    robot, cycle = compass()
    found = measured()
    assert found.repeats
    assert found.residual <= found.disturbance == 1e-5
    assert found.along == pytest.approx(1.0, abs=1e-5)
    assert found.one_sided == found.switched == ()
    assert np.isnan(found.error)

    def kicked(simulation: hs.Simulation, size: float) -> None:
        pushed(simulation, abs(size))

    twice = hs.disturbance_response(
        robot, cycle.state, disturbances={"kick": (kicked, 1e-3)}, ground=RAMP, method=METHOD,
        settling=0, returns=2,
    )  # fmt: skip
    assert twice.one_sided == ("kick",)
    assert twice.error < 1e-5


@pytest.mark.parametrize(("name", "returns"), [("shove", 2), ("push", 0)])
def test_what_it_tells_nothing_of(name: str, returns: int) -> None:
    with pytest.raises(hs.SimulationError, match=r"push, height.*; got"):
        measured().after(name, returns)


def test_multipliers_are_those_of_the_walk() -> None:
    _, cycle = compass()
    values = np.sort_complex(np.linalg.eigvals(measured().A))
    np.testing.assert_allclose(values, np.sort_complex(cycle.multipliers**2), atol=1e-6)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "given by name"),
        ([pushed], "disturbances must be a mapping"),
        ({"push": pushed}, "'push' must be a function"),
        ({"push": (pushed, 0.0)}, "a positive size"),
        ({"push": (1.0, pushed)}, "'push' must be a function"),
        ({"push": (pushed, 1e4)}, "disturbance 'push' of size 1e"),
    ],
)
def test_disturbances_that_are_none(given: Any, said: str) -> None:
    robot, cycle = compass()
    with pytest.raises(hs.HeelstrikeError, match=said):
        hs.disturbance_response(
            robot, cycle.state, disturbances=given, ground=RAMP, method=METHOD, settling=0,
            returns=1,
        )  # fmt: skip


def test_a_fixed_step_does_not_tell_durations() -> None:
    """Touchdowns fall on its steps: any small disturbance would seem to do nothing to them."""
    robot, cycle = compass()
    with pytest.raises(hs.SimulationError, match="touchdown times are rounded to steps"):
        hs.disturbance_response(
            robot, cycle.state, disturbances={"push": (pushed, 1e-4)}, ground=RAMP,
            method=hs.TimeStepping(),
        )  # fmt: skip


def test_a_step_is_from_foot_to_foot() -> None:
    """Both ends of soles come down, the rear foot rocks at an impact, and one late in its step."""
    robot = hs.load_robot("bravo7")
    (right, left), kind = robot.feet, EventKind.TOUCHDOWN
    down = [
        (0.15, right.contacts[1]), (0.35, left.contacts[0]), (0.351, right.contacts[1]),
        (0.36, left.contacts[1]), (0.75, left.contacts[1]), (1.05, right.contacts[1]),
        (1.06, right.contacts[0]), (1.0601, left.contacts[0]),
    ]  # fmt: skip
    events = [SimpleNamespace(time=time, contact=contact, kind=kind) for time, contact in down]
    run: Any = SimpleNamespace(robot=robot, events=events, time=np.array([0.0, 1.4]))
    assert step_duration(run) == pytest.approx(0.7)
    assert [foot for _, foot in steps_of(robot, events, 0.0)] == [0, 1, 0]
    run.events = events[3:5]
    with pytest.raises(hs.LimitCycleError, match="two steps"):
        step_duration(run)


def test_a_foot_that_rocks_as_a_walk_is_taken_up_takes_no_step() -> None:
    """In the middle of a step one foot stands: that it touches again is no touchdown of a step."""
    robot = hs.load_robot("bravo7")
    state = robot.reference_state()
    loop = ClosedLoop(robot, None, state, method=None, ground=None, control_period=None)
    assert loop._stands(state) is None  # both do
    for lifted, foot in enumerate(robot.feet):
        q = state.q.copy()
        q[foot.link - 2] += 0.3  # its hip: it is lifted by a centimetre
        assert contact_positions(robot, q)[list(foot.contacts), 1].min() > 0.01
        assert loop._stands(hs.State(q, state.v)) == 1 - lifted
    kind = EventKind.TOUCHDOWN
    down = [(0.25, robot.feet[1]), (0.35, robot.feet[0]), (1.05, robot.feet[1])]
    events: Any = [
        SimpleNamespace(time=time, contact=foot.contacts[0], kind=kind) for time, foot in down
    ]
    assert steps_of(robot, events, 0.0, 1) == [(0.35, 0), (1.05, 1)]
