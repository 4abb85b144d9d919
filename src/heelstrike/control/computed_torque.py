"""Computed-torque control in single support (paper section 4.1, eq. 27-39).

The joints follow the gait with v̇ᵈ = q̈ᵈ + kp (qᵈ − q) + kd (q̇ᵈ − q̇) (eq. 38), and the torques are
those that do this while the ground holds the stance foot; see
:meth:`~heelstrike.control.ControlledRobot.flat_foot_torque`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import check_fields, positive
from heelstrike.compiler.bundle import array, cell, number
from heelstrike.compiler.compilation import kernel
from heelstrike.control.arguments import check_gait, gains_of, must_be
from heelstrike.control.followed_gait import FollowedGait, followed
from heelstrike.control.motion_tracking import Parameters as Tracked
from heelstrike.control.motion_tracking import motion_tracking, tracked
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities
from heelstrike.dynamics.queries.loops import loop_jacobian
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.gait.gait import Gait
from heelstrike.gait.motion.motion import Motion
from heelstrike.gait.polynomials import motion_in_piece, place_in_step
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.following import follow_positions
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import hold_still
from heelstrike.sim.controller.stance_clock import (
    StanceClock,
    exchange_at_touchdown,
    has_landed,
)

UNREACHED = 1e-9
"""Share of a joint in a motion that counts as none."""

READINGS = 4
"""Samples of an encoder that a velocity is estimated from."""


ALMOST_DUE = 1e-6
"""Part of an encoder's period by which rounding of times may make a reading early."""


class Parameters(FollowedGait):
    """Numbers of the law."""

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Gains of eq. 38 (1/s², 1/s)."""
    on_points: int = number(int)
    """Whether the feet are points."""
    encoder_period: float = number(float)
    encoder_resolution: float = number(float)
    """encoder_period, encoder_resolution: Time between encoder samples (s), negative for exact
    measurement; smallest difference of an encoder's angles (rad), zero for exact."""
    pitch: int = number(int)
    pitch_sign: float = number(float)
    """pitch, pitch_sign: Coordinate and axis sign of the trunk's pitch."""


class Memory(StanceClock):
    """What the law remembers."""

    samples: int = cell(int)
    """Encoder readings since the touchdown: velocities jump there, and no polynomial may reach
    across it."""
    sampled: float = cell(float)
    """When the newest encoder reading was taken (s)."""
    readings: Floats = array(READINGS, "nu")
    """Readings, the newest first."""
    acceleration: Floats = array("nu")
    """Wanted of the joints."""


@dataclass(frozen=True, kw_only=True)
class Encoder:
    """Joint encoders from which velocities must be estimated, as on the real robot (section 5).

    Joint positions are sampled and rounded; the velocity is the derivative, at the newest sample,
    of the cubic through the last four. A touchdown makes velocities jump: samples before it are
    forgotten, and the reference velocity stands in until there are two again. The trunk follows
    from the stance foot, taken to be flat and at rest (eq. 28, 29).
    """

    period: float = 1e-3
    """Time between samples in seconds; choose a whole number of control periods."""
    resolution: float = 2.0 * np.pi / 2**22
    """Smallest difference between two readings in rad; zero for exact readings. The default is that
    of 4096 counts a turn on a motor behind a gear of 1024. Coarser readings make noisy velocities,
    and gains that suit exact ones then tip the stance foot."""

    def __post_init__(self) -> None:
        check_fields(self, ControllerError)
        positive("the encoder period", self.period, ControllerError, "s")
        if not 0.0 <= self.resolution < np.inf:
            raise ControllerError(f"the encoder resolution must be ≥ 0, got {self.resolution}")


@kernel
def read_encoders(t: float, state: ControlState, parameters: Parameters, memory: Memory) -> None:
    """Take a sample of the rounded joint positions when one is due."""
    due = memory.sampled + parameters.encoder_period
    if memory.samples > 0 and t < due - ALMOST_DUE * parameters.encoder_period:
        return
    resolution = parameters.encoder_resolution
    readings = memory.readings
    for i in range(readings.shape[1]):
        for k in range(READINGS - 1, 0, -1):
            readings[k, i] = readings[k - 1, i]
        reading = state.joint_position[i]
        if resolution > 0.0:
            reading = resolution * np.round(reading / resolution)
        readings[0, i] = reading
    memory.sampled = t
    memory.samples = min(memory.samples + 1, READINGS)


@kernel
def estimated_velocity(readings: Floats, count: int, period: float, i: int) -> float:
    """Slope at the newest reading of the polynomial through all of them, at most a cubic."""
    newest, second = readings[0, i], readings[1, i]
    third, oldest = readings[2, i], readings[3, i]
    if count >= 4:
        return (11.0 * newest - 18.0 * second + 9.0 * third - 2.0 * oldest) / (6.0 * period)
    if count == 3:
        return (3.0 * newest - 4.0 * second + third) / (2.0 * period)
    return (newest - second) / period


@kernel
def estimate_pose(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Fill in `robot.estimate`: joints as read, the trunk so that the stance foot is flat (28)."""
    seen, model = robot.estimate, robot.model
    for j in range(robot.nq):
        seen.q[j] = state.q[j]
    for j in range(robot.nv):
        seen.v[j] = state.v[j]
    for i in range(robot.nu):
        seen.joint_position[i] = memory.readings[0, i]
        seen.q[model.actuator_joint[i]] = memory.readings[0, i]
    follow_positions(robot, seen)
    forward_kinematics(model, seen.q, seen.kinematics)
    link = robot.foot_link[memory.stance]
    seen.q[parameters.pitch] -= parameters.pitch_sign * seen.kinematics.angle[link]
    forward_kinematics(model, seen.q, seen.kinematics)


@kernel
def estimate_velocity(robot: ControlledRobot, foot: int) -> None:
    """Complete `robot.estimate`, whose joint velocities are known, with the foot at rest (29)."""
    hold_still(robot, robot.estimate, foot)
    link_velocities(robot.model, robot.estimate.v, robot.estimate.kinematics)


@controller
def computed_torque(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques that make the joints follow the gait (eq. 39)."""
    if exchange_at_touchdown(
        t, t - memory.start, parameters.earliest, contacts, robot.contact_foot, memory
    ):
        memory.samples = 0
    landed = has_landed(t, parameters.landing, state, contacts, robot, memory)
    foot = memory.stance
    encoders = parameters.encoder_period >= 0.0
    seen = state
    if encoders:
        read_encoders(t, state, parameters, memory)
        estimate_pose(state, robot, parameters, memory)
        seen = robot.estimate

    # Reference of this instant (eq. 41); past the end of a late step it goes on, then rests.
    piece, inside, moves = place_in_step(
        t - memory.start, parameters.latest, parameters.breakpoints
    )
    terms = parameters.coefficients[foot, piece]
    acceleration, kp, kd = memory.acceleration, parameters.kp, parameters.kd
    for i in range(robot.nu):
        position, velocity, feedforward = motion_in_piece(terms, i, inside, moves)
        if encoders:
            seen.joint_velocity[i] = velocity
            if memory.samples >= 2:
                seen.joint_velocity[i] = estimated_velocity(
                    memory.readings, memory.samples, parameters.encoder_period, i
                )
        acceleration[i] = feedforward + kp[i] * (position - seen.joint_position[i])
        if landed:
            acceleration[i] += kd[i] * (velocity - seen.joint_velocity[i])

    if encoders:
        estimate_velocity(robot, foot)
    if parameters.on_points == 1:
        robot.point_foot_torque(seen, contacts, foot, acceleration, torque)
    else:
        robot.flat_foot_torque(seen, foot, acceleration, torque)


class ComputedTorque(Law):
    """Follow a gait by computed torque, on either foot, step after step.

    On point feet the joints follow the gait and the trunk's pitch, which no motor reaches, follows
    from them. Nothing then brings the pitch back to the gait: a disturbance of it lasts, and most
    gaits are unstable under this law.

    The phase of the gait restarts, and left and right change places, when the swing foot meets the
    ground in the second half of a step; until that foot has stopped, velocities are not fed back. A
    step that lasts longer than planned goes on along its
    polynomials for a tenth of its duration and then holds still.

    Parameters
    ----------
    robot : Robot
        A floating robot with two feet, mirror symmetric, all joints but the trunk's actuated, or
        driven by such through closed loops and couplings.
    gait : Gait or Motion
        The gait to follow; or a motion of any phases, which is followed as by
        :class:`~heelstrike.MotionTracking`.
    kp, kd : float or (nu,) array
        Gains of eq. 38, in 1/s² and 1/s.
    encoder : Encoder, optional
        Estimate velocities from sampled, rounded joint positions instead of taking the exact ones.

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, or gait or gains do not fit it.
    GaitError
        If a motion was designed for another robot.
    """

    def __init__(
        self,
        robot: Robot,
        gait: Gait | Motion,
        *,
        kp: ArrayLike = 400.0,
        kd: ArrayLike = 40.0,
        encoder: Encoder | None = None,
    ) -> None:
        must_be(Robot, "robot", robot)
        self.gait = None if isinstance(gait, Motion) else gait
        self.encoder = encoder
        if isinstance(gait, Motion):
            self.motion = gait
            if encoder is not None:
                raise ControllerError(
                    "joint encoders tell where the robot is only while a foot lies flat, which a "
                    "motion of any phases need not let it do; leave encoder out"
                )
            numbers, sizes = tracked(robot, gait, kp, kd)
            tracks = Tracked(**numbers)
            super().__init__(motion_tracking, tracks, memory=sizes, robot=robot)
            return
        refuse_loops(robot, "computed torque", ControllerError, loops=False)
        pitch = pitch_of(robot)
        check_gait(robot, gait)
        if encoder is not None:
            must_be(Encoder, "encoder", encoder)
        if gait.point_feet:
            _check_points(robot, encoder)
        parameters = Parameters(
            kp=gains_of("kp", kp, robot),
            kd=gains_of("kd", kd, robot),
            **followed(gait),
            on_points=gait.point_feet,
            encoder_period=-1.0 if encoder is None else encoder.period,
            encoder_resolution=0.0 if encoder is None else encoder.resolution,
            pitch=pitch,
            pitch_sign=robot.model.axis[pitch, 0],
        )
        start = {"stance": gait.stance_foot, "landed": 1}
        super().__init__(computed_torque, parameters, memory=start, robot=robot)


def pitch_of(robot: Robot) -> int:
    """Return the coordinate of the trunk's pitch, or refuse what the law cannot control."""
    model = robot.model
    actuated = set(model.actuator_joint.tolist())
    unactuated = [j for j in range(robot.nv) if j not in actuated]
    lacks = (
        (not robot.floating, "its base is fixed"),
        (len(robot.feet) != 2, f"it has {len(robot.feet)} feet"),
        (robot.mirror is None, "its sides do not mirror each other"),
    )
    found = [reason for missing, reason in lacks if missing]
    if found:
        raise ControllerError(
            "computed torque needs a robot with a free base and two feet that mirror each other. "
            f"Robot {robot.name!r} is not one: {found[0]}"
        )
    if model.loops + model.couplings:
        _check_reach(robot)
    elif len(unactuated) != 3:
        names = ", ".join(robot.joint_names[j] for j in unactuated)
        raise ControllerError(
            f"computed torque on a flat foot needs every joint but the trunk's x, z and pitch "
            f"actuated; robot {robot.name!r} leaves {names} without a motor"
        )
    return next(j for j in unactuated if model.axis[j, 0])


def _check_reach(robot: Robot) -> None:
    """Refuse a robot of which closed loops and motors leave joints free."""
    from scipy.linalg import null_space  # robots without loops begin sooner without

    joints = np.arange(3, robot.nv)
    at = robot.closed(robot.reference_state())
    motors = np.eye(robot.nv)[robot.model.actuator_joint]
    told = np.concatenate([loop_jacobian(robot, at.q), motors])[:, joints]
    free = null_space(told, rcond=UNREACHED)
    if free.size:
        names = ", ".join(
            robot.joint_names[j] for j in joints[np.abs(free).max(axis=1) > UNREACHED]
        )
        raise ControllerError(
            "computed torque needs every joint driven, by a motor of its own or through "
            f"closed loops and couplings; in robot {robot.name!r} nothing drives {names}"
        )


def _check_points(robot: Robot, encoder: Encoder | None) -> None:
    """Refuse what cannot be done on point feet."""
    if any(len(foot.contacts) != 1 for foot in robot.feet):
        raise ControllerError(
            f"the gait is one on point feet; the feet of robot {robot.name!r} have several "
            "contact points"
        )
    if encoder is not None:
        raise ControllerError(
            "on point feet the trunk's pitch does not follow from the joints, so joint "
            "encoders alone cannot measure the state; leave encoder out"
        )
