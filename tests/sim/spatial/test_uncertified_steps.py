"""Steps that no solve certifies: halved, gone on with and told, or the end of the run in words."""

from __future__ import annotations

import re

import numpy as np
import pytest
from spatial_robots import Maker

import heelstrike as hs
from heelstrike.contact.spatial.modes import NOT_FOUND, SOLVED
from heelstrike.contact.spatial.workspace import block_answer
from heelstrike.sim.spatial.record import SpatialEventKind
from heelstrike.sim.spatial.stepping import left_by

BLOCK = (
    "<body name='block' pos='0 0 0.1'><freejoint/><geom type='box' size='0.2 0.15 0.1' mass='2'/>"
    "</body>"
)


def sliding(made: Maker) -> hs.Simulation:
    robot = made(BLOCK)
    state = hs.State(robot.reference_state().q, np.array([1.0, 0.7, 0.0, 0.0, 0.0, 0.3]))
    return hs.Simulation(robot, state=state)


def test_a_step_that_is_nearly_solved_is_halved_and_then_goes_on_and_is_told(made: Maker) -> None:
    """With a tolerance that no rounding meets nothing is certified; the motion is as ever."""
    strict, usual = sliding(made), sliding(made)
    strict._memory.solver.settings.tolerance = 1e-25
    strict.advance(0.01)
    usual.advance(0.01)
    record = strict.record
    told = [event for event in record.events if event.kind is SpatialEventKind.UNCERTIFIED]
    assert strict.status is hs.RunStatus.COMPLETED
    assert 0 < len(told) == record.certificates.uncertified <= 10
    assert record.certificates.halved >= len(told)
    assert record.steps >= 8 * len(told)  # eighths of each step
    assert 0.0 < record.certificates.residual <= 1e-6
    assert np.max(np.abs(strict.state.q - usual.state.q)) <= 1e-4


def test_a_step_that_nothing_solves_ends_the_run_in_words(made: Maker) -> None:
    simulation = sliding(made)
    simulation.advance(0.005)
    before = simulation.state
    simulation._memory.solver.settings.ways = 0
    assert simulation.advance(0.01) is hs.RunStatus.SOLVER_FAILED
    assert "no contact impulses could be certified at t = 0.005 s" in simulation.message
    assert np.array_equal(simulation.state.q, before.q)
    assert simulation.record.certificates.uncertified == 0


def test_stairs_are_as_high_and_deep_as_they_say(made: Maker) -> None:
    """A ball dropped on each tread comes to rest on it."""
    robot = made("<body name='ball'><freejoint/><geom type='sphere' size='0.05' mass='1'/></body>")
    ground = hs.SpatialGround.stairs(rise=0.15, tread=0.3, count=3, start=0.2)
    for x, height in ((0.0, 0.0), (0.35, 0.15), (0.65, 0.3), (0.95, 0.45)):
        q = np.array([x, 0.1, height + 0.2, 1.0, 0.0, 0.0, 0.0])
        run = hs.simulate(robot, state=hs.State(q, np.zeros(6)), duration=0.5, ground=ground)
        assert abs(run.position[-1, 2] - height - 0.05) <= 1e-9
        assert np.max(np.abs(run.position[-1, :2] - q[:2])) <= 1e-9


@pytest.mark.parametrize(
    ("residual", "rounding", "least"),
    [(0.0, 0.0, 1e-17), (0.0, 1e-3, 1e-3), (0.25, 0.25, 0.5), (np.nan, 0.0, np.inf)],
)
def test_what_is_not_solved_leaves_something(
    residual: float, rounding: float, least: float
) -> None:
    """A solve that rounding alone refused is not taken for one that is certified."""
    answer = block_answer(1, 3)
    answer.residual, answer.rounding = residual, rounding
    assert left_by(NOT_FOUND, answer) >= least
    assert left_by(SOLVED, answer) == 0.0


def test_a_ball_at_rest_is_not_certified_beyond_its_rounding(made: Maker) -> None:
    """Its natural map is exactly zero: all that is left is rounding."""
    robot = made(
        "<body name='ball' pos='0 0 0.1'><freejoint/><geom type='sphere' size='0.1' mass='1'/>"
        "</body>"
    )
    simulation = hs.Simulation(robot, state=robot.reference_state())
    simulation._memory.solver.settings.tolerance = 1e-25
    simulation.advance(0.01)
    assert simulation.record.certificates.uncertified == 10


def test_the_message_names_the_residual_that_ended_the_run(made: Maker) -> None:
    simulation = sliding(made)
    simulation.advance(0.005)
    simulation._memory.solver.settings.ways = 0
    simulation.advance(0.01)
    told = re.search(r"residual (\S+)\. A", simulation.message)
    assert told is not None
    assert float(told.group(1)) == pytest.approx(simulation._memory.tally.unsolved, rel=1e-2)
    assert float(told.group(1)) > 1e-6


def test_steps_that_are_not_asked_out_of_the_ground_count_once(made: Maker) -> None:
    """Not once for each of the parts that they are taken in."""
    robot = made(BLOCK)
    q = robot.reference_state().q.copy()
    q[2] -= 5e-5
    simulation = hs.Simulation(robot, state=hs.State(q, np.zeros(6)))
    simulation._memory.solver.settings.tolerance = 1e-25
    simulation.advance(0.01)
    record = simulation.record
    assert record.steps >= 80
    assert 1 <= record.certificates.relaxed <= 10


ROD = """<body name='rod' pos='0 0 0.9'><joint name='hinge' axis='0 1 0'/>
<inertial pos='0.25 0 -0.44' mass='1' diaginertia='0.1 0.1 0.1'/>
<geom type='sphere' pos='0.43 0 -0.88' size='0.01' mass='0'/></body>"""
"""A rod that hangs from a hinge and is longer than that is high: it swings into the ground."""


@pytest.mark.parametrize(
    ("friction", "restitution", "left"), [(0.75, 0.5, 1), (0.3, 0.5, 0), (0.75, 0.0, 0)]
)
def test_an_impact_that_no_impulse_solves_is_left_to_the_next_step(
    friction: float, restitution: float, left: int, made: Maker
) -> None:
    """A push λ up, at arm x, and the friction against the way back, at height H, turn the rod by
    λ (x − μ H): beyond μ = x / H = 0.43 / 0.89 no push makes it bounce.

    It jams instead, as one of no restitution does.
    """
    method = hs.TimeStepping(step=1e-3)
    run = hs.simulate(
        made(ROD), state=hs.State(np.array([-0.1]), np.zeros(1)), duration=0.3, method=method,
        ground=hs.SpatialGround(friction=friction, restitution=restitution),
    )  # fmt: skip
    assert run.completed
    assert run.certificates.relaxed == left
    assert (run.certificates.halved > 0) == bool(left)
    assert run.certificates.uncertified == 0
    assert run.certificates.penetration < 1e-12
    assert ("1 steps with a wedged point or an impact left as it was" in str(run.solver)) == left
    bounces = run.velocity.min() < -0.1
    assert bounces == (restitution > 0.0 and not left)
    if not bounces:
        assert abs(run.velocity[-1, 0]) < 1e-9
