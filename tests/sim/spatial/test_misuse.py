"""What a simulation in space refuses, and what becomes of controllers that do what they may not."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from spatial_robots import Maker

import heelstrike as hs
from heelstrike.errors import ControllerError, SimulationError

BALL = "<body name='ball'><freejoint/><geom type='sphere' size='0.1' mass='1'/></body>"
ARM = (
    "<body name='arm' pos='0 0 1'><joint name='shoulder' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 0.4 0 0' size='0.02' mass='1'/></body>"
)
BOX = hs.Box(center=(3.0, 0.0, 0.1), size=(1.0, 1.0, 0.2))
MOTOR = "<actuator><motor name='motor' joint='shoulder'/></actuator>"


@pytest.mark.parametrize(
    ("what", "its"),
    [
        ("method", {"method": hs.TimeStepping(step=5e-4)}),
        ("control_period", {"control_period": 0.004}),
    ],
)
def test_a_snapshot_of_another_setting_is_refused(
    made: Maker, what: str, its: dict[str, Any]
) -> None:
    robot = made(BALL)
    state = robot.reference_state()
    kept = hs.Simulation(robot, state=state, **its).snapshot()
    simulation = hs.Simulation(robot, state=state)
    with pytest.raises(SimulationError, match=f"another {what}"):
        simulation.restore(kept)
    assert simulation.message == "not begun"
    again = hs.Simulation(robot, state=state, **its)
    again.restore(kept)
    assert again.message.startswith("restored")


def test_a_snapshot_brings_ground_and_pushes_along(made: Maker) -> None:
    """As in the plane; ground whose boxes there is no room for is refused."""
    robot = made(BALL)
    state = robot.reference_state()
    push = hs.Push("ball", force=(2.0, 0.0, 0.0), start=0.0, duration=0.1, point=(0.0, 0.0, 0.0))
    low, high = hs.SpatialGround(friction=0.3), hs.SpatialGround(boxes=(BOX,))
    kept = hs.Simulation(robot, state=state, ground=low, pushes=push).snapshot()
    simulation = hs.Simulation(robot, state=state)
    simulation.restore(kept)
    assert simulation.ground.friction == 0.3
    assert simulation.record.pushes[0].force == push.force
    with pytest.raises(SimulationError, match=r"^this ground has boxes, and the simulation began"):
        simulation.restore(hs.Simulation(robot, state=state, ground=high).snapshot())
    assert simulation.ground.friction == 0.3


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_simulation_is_not_copied(made: Maker, duplicate: Any) -> None:
    robot = made(BALL)
    simulation = hs.Simulation(robot, state=robot.reference_state())
    with pytest.raises(TypeError, match="cannot be copied or pickled"):
        duplicate(simulation)


class FailsAtTheEnd:
    """Raises something when it is asked for the last time, at 0.01 s."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        if t > 0.0095:
            raise self.error
        return np.zeros(1)


def test_errors_of_the_last_instant_are_told_as_others(made: Maker) -> None:
    robot = made(ARM, MOTOR)
    begin: dict[str, Any] = {"state": robot.reference_state(), "duration": 0.01}
    with pytest.raises(ValueError, match="too late"):
        hs.simulate(robot, FailsAtTheEnd(ValueError("too late")), on_error="raise", **begin)
    with pytest.warns(hs.ControllerWarning, match="too late"):
        hs.simulate(robot, FailsAtTheEnd(ValueError("too late")), **begin)


def test_ctrl_c_at_the_last_instant_keeps_the_run(made: Maker) -> None:
    robot = made(ARM, MOTOR)
    run = hs.simulate(
        robot, FailsAtTheEnd(KeyboardInterrupt()), state=robot.reference_state(), duration=0.01
    )
    assert run.status is hs.RunStatus.INTERRUPTED
    assert len(run.time) == 10


def test_a_controller_may_not_change_the_robot(made: Maker) -> None:
    """The run ends in words, and the robot is as before."""
    robot = made(ARM, MOTOR)
    mass = robot.model.mass.copy()

    class Lightens:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            robot.model.mass[:] = 0.1
            return np.zeros(1)

    run = hs.simulate(
        robot, Lightens(), state=robot.reference_state(), duration=0.01, on_error="stop"
    )
    assert run.status is hs.RunStatus.CONTROLLER_FAILED
    assert "changed the robot: model.mass[0]" in run.message
    assert isinstance(run.error, ControllerError)
    assert np.array_equal(robot.model.mass, mass)


def test_options_of_the_plane_are_told_from_unknown_ones(made: Maker) -> None:
    robot = made(BALL)
    for option, words in (
        ({"braked": ("knee",)}, "brakes are for robots in the plane"),
        ({"latched": ("knee",)}, "latches are for robots in the plane"),
        ({"braked": 0}, "brakes are for robots in the plane"),
        ({"latched": 0}, "latches are for robots in the plane"),
        ({"checked": True}, "checked=True looks at the indices of laws of robots in the plane"),
    ):
        with pytest.raises(SimulationError, match=words):
            hs.Simulation(robot, state=robot.reference_state(), **option)
    with pytest.raises(TypeError, match="'colour'"):
        hs.Simulation(robot, state=robot.reference_state(), colour="red")


BOUNCES = hs.SpatialGround(restitution=0.5)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"method": hs.TimeStepping(solver="gauss_seidel")}, "leave solver out"),
        ({"method": hs.TimeStepping(activation=0.1)}, "leave activation out"),
        ({"method": hs.TimeStepping(bounded_restitution=True)}, "leave bounded_restitution out"),
        ({"method": hs.TimeStepping}, r"write TimeStepping\(\)"),
        ({"method": "fast"}, "must be a simulation method such as .* got 'fast'"),
        (
            {"method": hs.TimeStepping(scheme=hs.Scheme.GAP_LINEARISED), "ground": BOUNCES},
            "has restitution; use Scheme.IMPACT_RESOLVED$",
        ),
    ],
)
def test_what_a_method_would_not_heed_is_refused(
    made: Maker, option: dict[str, Any], words: str
) -> None:
    robot = made(BALL)
    with pytest.raises(SimulationError, match=words):
        hs.Simulation(robot, state=robot.reference_state(), **option)


def test_ground_that_is_laid_again_changes_nothing(made: Maker) -> None:
    """Also where a box has friction and restitution of the ground: its numbers are NaN."""
    robot = made(BALL)
    q = robot.reference_state().q.copy()
    q[2] = 0.1
    ground = hs.SpatialGround(boxes=(BOX,))
    simulation = hs.Simulation(robot, state=hs.State(q, np.zeros(6)), ground=ground)
    simulation.advance(0.01)
    touched = simulation._memory.blocks.touching.copy()
    assert touched.max() > 0
    simulation.ground = simulation.ground
    assert np.array_equal(simulation._memory.blocks.touching, touched)


def test_what_was_in_a_wedge_is_forgotten_where_it_is_put_elsewhere(made: Maker) -> None:
    robot = made(BALL)
    q = robot.reference_state().q.copy()
    q[2] = 0.2
    simulation = hs.Simulation(robot, state=hs.State(q, np.zeros(6)))
    wedge = simulation._memory.wedge
    never = wedge.wedged
    wedge.wedged = 5
    simulation.state = hs.State(q, np.ones(6))
    assert wedge.wedged == never
    wedge.wedged = 5
    simulation.ground = hs.SpatialGround(friction=0.3)
    assert wedge.wedged == never


def test_the_count_of_solves_tells_of_relaxed_steps(made: Maker) -> None:
    robot = made(BALL)
    simulation = hs.Simulation(robot, state=robot.reference_state())
    simulation._memory.tally.relaxed = 3
    assert simulation.record.certificates.relaxed == 3
    assert simulation.record.solver.relaxed == 3


def test_advice_out_of_the_ground_is_true_in_space(made: Maker) -> None:
    """No method that there is not, no number that lowers a wall."""
    robot = made(BALL)
    q = robot.reference_state().q.copy()
    q[2] = 0.2
    simulation = hs.Simulation(
        robot, state=hs.State(q, np.zeros(6)), ground=hs.SpatialGround(boxes=(BOX,))
    )
    deep = q.copy()
    deep[2] = 0.05
    with pytest.raises(SimulationError, match=r"m in the ground; raise the robot, or move it away"):
        simulation.state = hs.State(deep, np.zeros(6))
    low = hs.SpatialGround(height=0.15, boxes=(BOX,))
    with pytest.raises(SimulationError, match=r"lower it by 0.05 m, or raise the robot first"):
        simulation.ground = low
    wall = hs.Box(center=(0.55, 0.0, 1.0), size=(1.0, 4.0, 2.0))
    with pytest.raises(SimulationError, match="in this ground, behind a wall; move the ground"):
        simulation.ground = hs.SpatialGround(boxes=(wall,))


def test_a_push_may_have_three_components_and_says_so() -> None:
    with pytest.raises(
        SimulationError, match=r"two numbers \(x, z\), or three \(x, y, z\) in space"
    ):
        hs.Push("ball", force=(1.0,), start=0.0, duration=0.1)
