"""Motions that walkers are to follow: gaits of a robot over a range of speeds."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.control.computed_torque import ComputedTorque
from heelstrike.control.policy.reference import Reference
from heelstrike.dynamics import mass_matrix
from heelstrike.errors import GaitError, SimulationError
from heelstrike.experiments.walk import FRICTION_RESERVE, typical_step
from heelstrike.gait import Gait, gait_family, load_gait
from heelstrike.robot.library import load_planar_robot
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim import Run, RunStatus, TimeStepping, simulate

SPACING = 0.02
"""Seconds between two phases of a motion that are kept, about."""

WHOLE_STRIDES = 2
"""Strides that are simulated; the last one is kept."""

SWING_STIFFNESS, SWING_DAMPING = 0.2, 0.4
"""Greatest stiffness and damping of a joint's spring and damper, over inertia by the square of the
period and inertia by the period: half of what a free link bears that is told once a period."""


@cache
def motion_of(
    file: str, reference: str, speeds: tuple[float, float], gaits: int, friction: float,
    stiffness: float, period: float,
) -> Reference:  # fmt: skip
    """Return the motion that a robot is to follow.

    Parameters
    ----------
    file : str
        The robot.
    reference : str
        ``"gait"`` for gaits that are designed, ``"posture"`` for the robot as it stands in its
        file; otherwise the file of a gait.
    speeds : (float, float)
        The lowest and the greatest speed (m/s).
    gaits : int
        Gaits that are designed, evenly over the speeds.
    friction : float
        Of the ground.
    stiffness : float
        Stiffness of all joints, over weight by height of the trunk.
    period : float
        Seconds from one reading of the joints to the next.

    Returns
    -------
    Reference
        The motion, which must not be written to.

    Raises
    ------
    SimulationError, GaitError, RobotError
        If there is no such robot or gait, or the robot cannot walk so.
    """
    robot = load_planar_robot(file)
    if not robot.floating or not robot.nu:
        raise SimulationError(
            f"robot {robot.name!r} cannot learn to walk: its trunk does not move freely, or it has "
            "no actuators"
        )
    if reference == "posture":
        strides, found = [1.0], [_posture(robot)]
        values = [speeds[0]]
    else:
        if reference == "gait":
            designed = _designed(robot, speeds, gaits, friction)
        else:
            designed = [load_gait(Path(reference), robot)]
        strides = [2.0 * gait.step_duration for gait in designed]
        values = [gait.step_length / gait.step_duration for gait in designed]
        found = [_walked(robot, gait, friction, period) for gait in designed]
    springs, dampers = _gains(robot, stiffness, period)
    return Reference(
        np.array(values), np.array(strides), np.array(found), springs, dampers, period
    )  # fmt: skip


def _designed(robot: Robot, speeds: tuple[float, float], gaits: int, friction: float) -> list[Gait]:
    size = typical_step(robot)
    asked = np.linspace(*speeds, gaits) if speeds[1] > speeds[0] else np.array(speeds[:1])
    family = gait_family(
        robot, step_duration=size.duration, speed=asked.tolist(), clearance=size.clearance,
        friction=(1.0 - FRICTION_RESERVE) * friction,
    )  # fmt: skip
    found = [family.gaits[place] for place in sorted(family.gaits)]
    if not found:
        raise GaitError(
            f"robot {robot.name!r} has no gait at {speeds[0]:g} to {speeds[1]:g} m/s: ask for "
            f"other speeds, or reference='posture'. {next(iter(family.gaps.values()), '')}"
        )
    return found


def _walked(robot: Robot, gait: Gait, friction: float, period: float) -> Floats:
    """Return positions, velocities and torques over a stride of a gait, as it is walked."""
    stride = 2.0 * gait.step_duration
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = simulate(
            robot, ComputedTorque(robot, gait), state=gait.initial_state,
            duration=WHOLE_STRIDES * stride + 2.0 * period, method=TimeStepping(step=period),
            ground=Ground(friction=friction), stop_when_fallen=True,
        )  # fmt: skip
    if run.status is not RunStatus.COMPLETED:
        raise GaitError(f"the gait of {robot.name!r} cannot be walked: {run.message}")
    return _sampled(run, (WHOLE_STRIDES - 1) * stride, stride, period)


def _sampled(run: Run, begin: float, stride: float, period: float) -> Floats:
    count = max(round(stride / SPACING), 1)
    times = begin + np.arange(count) * stride / count
    rows = np.rint(times / period).astype(int)
    return np.hstack((run.position[rows], run.velocity[rows], run.torque[rows]))


def _posture(robot: Robot) -> Floats:
    return np.concatenate((robot.reference_state().vector, np.zeros(robot.nu)))[None]


def _gains(robot: Robot, stiffness: float, period: float) -> tuple[Floats, Floats]:
    """Return stiffness and damping of each joint: no more than a free link bears."""
    state = robot.reference_state()
    joints = robot.model.actuator_joint
    inertia = np.diag(mass_matrix(robot, state.q))[joints]
    wanted = stiffness * robot.weight * max(float(state.q[1]), 0.1)
    springs = np.minimum(wanted, SWING_STIFFNESS * inertia / period**2)
    dampers = np.minimum(2.0 * np.sqrt(springs * inertia), SWING_DAMPING * inertia / period)
    return springs, dampers
