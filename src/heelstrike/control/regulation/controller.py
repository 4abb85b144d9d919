"""The controller that regulates the zero moment point, as a user makes it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.control.arguments import check_gait, gains_of, number_of, positive
from heelstrike.control.computed_torque import pitch_of
from heelstrike.control.followed_gait import followed
from heelstrike.control.regulation.law import regulate_zero_moment_point
from heelstrike.control.regulation.numbers import PERIOD, Parameters
from heelstrike.dynamics.inverse_kinematics import leg_joints
from heelstrike.errors import ControllerError
from heelstrike.gait.gait import Footing, Gait
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.named_tree import Foot
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import sole
from heelstrike.sim.controller.law import Law


class ZeroMomentPointRegulation(Law):
    """Follow a gait by a clock that the zero moment point regulates.

    Computed torque towards q_d(s); s̈ is as near to the gait's own time law as the zero moment
    point, the normal force and friction allow, and the stance ankle gives way to what the clock
    cannot do. See ``docs/zmp-regulation.md`` for the theory and what it cannot do.

    Parameters
    ----------
    robot : Robot
        A floating robot with two mirrored flat feet on ankles, all joints but the trunk's actuated.
    gait : Gait
        The gait to follow, which stands on one flat foot at a time.
    margin : float
        How far the zero moment point stays from either end of the sole (m).
    kp, kd : float or (nu,) array
        Gains of the joints, in 1/s² and 1/s.
    friction : float, optional
        Coefficient of friction that it reckons with; by default that of the gait.
    least_force : float
        Least normal force on the stance foot, in parts of the weight.
    returning : float
        Time (s) in which the clock comes back to the pace of time, where it may.
    hurry : float
        Greatest change |s̈| of the clock's rate (1/s).
    slowest, fastest : float
        Bounds of the clock's rate, from 0 to 1 and from 1 on.
    bandwidth : float or None
        Frequency (Hz) up to which the law feels what pushes the robot, by velocities, torques and
        contact forces; None for not at all.
    period : float
        Seconds between two calls.

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, or the gait or a number does not fit it.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("bravo7")
    >>> gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, starts=1)
    >>> law = hs.ZeroMomentPointRegulation(robot, gait)
    >>> push = hs.Push("trunk", force=(100.0, 0.0), start=0.3, duration=0.1)  # 10 N s
    >>> run = hs.simulate(robot, law, state=gait.initial_state, duration=1.4, pushes=push)
    >>> run.completed, bool(run.log["rate"].values.max() > 1.1)
    (True, True)
    """

    # More arguments than eight: what may be chosen of the law is a user's to say.
    def __init__(
        self,
        robot: Robot,
        gait: Gait,
        *,
        margin: float = 0.02,
        kp: ArrayLike = 400.0,
        kd: ArrayLike = 40.0,
        friction: float | None = None,
        least_force: float = 0.1,
        returning: float = 0.3,
        hurry: float = 50.0,
        slowest: float = 0.0,
        fastest: float = 3.0,
        bandwidth: float | None = 30.0,
        period: float = PERIOD,
    ) -> None:
        _check(robot, gait)
        friction = gait.friction if friction is None else friction
        chosen = {"friction": friction, "returning": returning, "hurry": hurry}
        _check_numbers(robot, margin, least_force, (slowest, fastest), chosen, bandwidth)
        parameters = Parameters(
            kp=gains_of("kp", kp, robot),
            kd=gains_of("kd", kd, robot),
            ankle=np.array(_ankles(robot)),
            margin=float(margin),
            least_force=float(least_force) * robot.weight,
            slowest=float(slowest),
            fastest=float(fastest),
            bandwidth=-1.0 if bandwidth is None else float(bandwidth),
            **followed(gait),
            **{name: float(value) for name, value in chosen.items()},
        )
        begin = {"stance": gait.stance_foot, "landed": 1, "rate": 1.0}
        super().__init__(
            regulate_zero_moment_point, parameters, memory=begin, robot=robot, period=period
        )
        self.gait = gait


def _check(robot: Robot, gait: Gait) -> None:
    """Refuse what the law cannot control."""
    check_gait(robot, gait)
    refuse_loops(robot, "regulation of the zero moment point", ControllerError)
    pitch_of(robot)
    flat = [phase.contacts == {gait.stance_foot: Footing.FLAT} for phase in gait.phases]
    if not all(flat) or min(_length(robot, foot) for foot in robot.feet) == 0.0:
        raise ControllerError(
            "regulation of the zero moment point needs a gait that stands on one flat foot at a "
            "time; for a gait on point feet use VirtualConstraints"
        )
    for foot, leg in zip(robot.feet, leg_joints(robot), strict=True):
        if not leg or leg[-1] != foot.link or robot.model.axis[foot.link, 0] == 0.0:
            raise ControllerError(
                f"regulation of the zero moment point needs feet on ankles that turn; foot "
                f"{foot.name!r} of robot {robot.name!r} has none"
            )


def _check_numbers(
    robot: Robot, margin: float, least_force: float, rates: tuple[float, float],
    chosen: Mapping[str, float], bandwidth: float | None,
) -> None:  # fmt: skip
    """Refuse numbers that make no law."""
    given = {"margin": margin, "least_force": least_force}
    given |= {"slowest": rates[0], "fastest": rates[1]}
    for name, value in given.items():
        number_of(name, value)
    half = 0.5 * min(_length(robot, foot) for foot in robot.feet)
    if not 0.0 <= margin < half:
        raise ControllerError(
            f"margin must be from 0 to less than half the sole of robot {robot.name!r}, "
            f"{half:.4g} m, got {margin!r}"
        )
    if not 0.0 <= rates[0] <= 1.0 <= rates[1]:
        raise ControllerError(
            f"slowest must be from 0 to 1 and fastest at least 1, since the clock starts at rate 1 "
            f"and never goes back; got {rates[0]!r} and {rates[1]!r}"
        )
    for name, value in chosen.items():
        positive(name, value)
    if not 0.0 <= least_force < 1.0:
        raise ControllerError(
            f"least_force must be a part of the weight from 0 to less than 1, got {least_force!r}"
        )
    if bandwidth is not None and not number_of("bandwidth", bandwidth) > 0.0:
        raise ControllerError(f"bandwidth must be a positive frequency in Hz, got {bandwidth}")


def _length(robot: Robot, foot: Foot) -> float:
    if not foot.contacts:
        return 0.0
    found = sole(robot, foot)
    return found.toe - found.heel


def _ankles(robot: Robot) -> list[int]:
    actuators = robot.model.actuator_joint.tolist()
    return [actuators.index(foot.link) for foot in robot.feet]
