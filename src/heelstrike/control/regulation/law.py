"""Regulation of the zero moment point by the clock of a gait.

The joints follow q_d(s), a gait whose clock s is a state of the law. With ṡ known and s̈ free,

    v̇ᵈ = q_d′ s̈ + q_d″ ṡ² + kp (q_d − q) + kd (q_d′ ṡ − q̇) + e w,

e the stance ankle: what it accelerates besides. While the ground holds the stance foot, what it
exerts is affine in s̈ and w: inverse dynamics is linear in accelerations. So each of

    moment about the toe less a margin ≥ 0 ≥ moment about the heel less a margin,
    f_n ≥ least,   |f_t| ≤ μ f_n

is a half-line of s̈, and together they are an interval. s̈ is the number in it that is nearest to
the gait's own time law, s̈ = (1 − ṡ)/T_r. If no s̈ that the clock may have brings the zero moment
point within its bounds, w does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.control.computed_torque import Landing, Stance, has_landed, pitch_of
from heelstrike.control.regulation.disturbance import Disturbance, observe, remember
from heelstrike.control.regulation.interval import narrowed
from heelstrike.dynamics.inverse_kinematics import leg_joints
from heelstrike.dynamics.kernels import point_bias_acceleration
from heelstrike.dynamics.places import point_columns
from heelstrike.dynamics.spatial import spatial
from heelstrike.errors import ControllerError, GaitError
from heelstrike.gait.gait import Footing, Gait
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import sole
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller, per_actuator
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import (
    complete,
    joint_torques,
    solve_three_transposed,
)

MOMENTS, CONDITIONS = 2, 5
"""Conditions on the ground's wrench: toe and heel, then normal force and both ends of friction."""

PERIOD = 1e-3
"""Seconds between two calls."""


class Parameters(Landing):
    """Numbers of the law.

    Attributes
    ----------
    kp, kd : (nu,) float
        Gains (1/s², 1/s).
    breakpoints : (pieces + 1,) float
        Times in a step between which one polynomial holds (s).
    coefficients : (2, pieces, terms, nu) float
        For either stance foot the joints' polynomials, lowest power first.
    ankle : (2,) int
        Actuator of the ankle of each foot.
    earliest, latest : float
        A touchdown counts only after this time of the gait; the reference ends at this (s).
    margin : float
        How far the zero moment point stays inside the sole (m).
    friction : float
        Coefficient of friction that is reckoned with.
    least_force : float
        Least normal force (N).
    returning : float
        T_r, in which the clock comes back to the pace of time (s).
    hurry : float
        Greatest |s̈| (1/s).
    slowest, fastest : float
        Bounds of ṡ.
    bandwidth : float
        Frequency (Hz) up to which disturbances are felt; negative for not at all.
    """

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    breakpoints: Floats = array("pieces + 1")
    coefficients: Floats = array(2, "pieces", "terms", "nu")
    ankle: Integers = array(2, of=int)
    earliest: float = number(float)
    latest: float = number(float)
    margin: float = number(float)
    friction: float = number(float)
    least_force: float = number(float)
    returning: float = number(float)
    hurry: float = number(float)
    slowest: float = number(float)
    fastest: float = number(float)
    bandwidth: float = number(float)


class Choice(Bundle):
    """What the ground exerts on the stance foot, and the motion, for numbers to be chosen.

    Attributes
    ----------
    position, slope, curvature : (nu,) float
        q_d, q_d′ and q_d″.
    joints : (3, nu) float
        Accelerations of the joints as nothing is chosen, and what s̈ and w add to them.
    force : (3, nv) float
        Generalised forces of motors and ground for these.
    conditions : (5, 3) float
        Numbers that must not be negative, likewise.
    """

    position: Floats = array("nu")
    slope: Floats = array("nu")
    curvature: Floats = array("nu")
    joints: Floats = array(3, "nu")
    force: Floats = array(3, "nv")
    conditions: Floats = array(CONDITIONS, 3)


class Memory(Stance):
    """What the law remembers.

    Attributes
    ----------
    time : float
        Of the last call (s).
    clock, rate, hurry : float
        s, ṡ and s̈ (s, 1, 1/s).
    choice : Choice
    disturbance : Disturbance
    """

    time: float = cell(float)
    clock: float = cell(float)
    rate: float = cell(float)
    hurry: float = cell(float)
    choice: Choice = part(Choice)
    disturbance: Disturbance = part(Disturbance)


class Log(Bundle):
    """What the law tells of itself.

    Attributes
    ----------
    clock, rate, hurry : float
        s, ṡ and s̈.
    slowest_hurry, fastest_hurry : float
        The interval of s̈; both the same if it is empty.
    ankle : float
        w, what the stance ankle accelerates besides (rad/s²).
    pressure : float
        Zero moment point that is expected, from the middle of the sole towards the toe (m).
    given_up : int
        0: all conditions are met. 1: normal force or friction are not. 2: s̈ alone would not keep
        the zero moment point, the ankle does. 3: neither does.
    """

    clock: float = cell(float, unit="s", label="Clock of the gait")
    rate: float = cell(float, label="Rate of the clock")
    hurry: float = cell(float, unit="1/s", label="Change of the clock's rate")
    slowest_hurry: float = cell(float, unit="1/s", label="Least change of the clock's rate")
    fastest_hurry: float = cell(float, unit="1/s", label="Greatest change of the clock's rate")
    ankle: float = cell(float, unit="rad/s²", label="Acceleration that the ankle gives up")
    pressure: float = cell(float, unit="m", label="Expected zero moment point")
    given_up: int = cell(int, label="Conditions given up")


@kernel
def advance(t: float, memory: Memory) -> float:
    """Let the clock go on since the last call; return the time that has gone by."""
    elapsed = t - memory.time
    memory.clock += elapsed * (memory.rate + 0.5 * elapsed * memory.hurry)
    memory.rate += elapsed * memory.hurry
    memory.time = t
    return elapsed


@kernel
def exchange_at_touchdown(
    t: float, contacts: Contacts, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Begin the next step, at the pace of this one, when the swing foot has met the ground."""
    if memory.clock < parameters.earliest:
        return
    swing = 1 - memory.stance
    for i in range(robot.nc):
        if robot.contact_foot[i] == swing and contacts.force[i, 0] > 0.0:
            memory.stance = swing
            memory.start = t
            memory.landed = 0
            memory.clock = 0.0
            memory.disturbance.known = 0
            return


@kernel
def look_up(parameters: Parameters, foot: int, clock: float, choice: Choice) -> None:
    """Find the gait and its derivatives by the clock; beyond its end it is still."""
    late = clock > parameters.latest
    inside = min(clock, parameters.latest)
    breakpoints, coefficients = parameters.breakpoints, parameters.coefficients
    piece = 0
    while piece < coefficients.shape[1] - 1 and inside >= breakpoints[piece + 1]:
        piece += 1
    inside -= breakpoints[piece]
    for i in range(coefficients.shape[3]):
        position, slope, curvature = 0.0, 0.0, 0.0
        for k in range(coefficients.shape[2] - 1, -1, -1):
            curvature = curvature * inside + 2.0 * slope
            slope = slope * inside + position
            position = position * inside + coefficients[foot, piece, k, i]
        choice.position[i] = position
        choice.slope[i] = 0.0 if late else slope
        choice.curvature[i] = 0.0 if late else curvature


@kernel
def find_forces(
    state: ControlState, robot: ControlledRobot, foot: int, disturbance: Floats, choice: Choice
) -> None:
    """Find what motors and ground must supply, as nothing is chosen, and for s̈ = 1 and w = 1."""
    link, drift = robot.foot_link[foot], robot.other
    origin = state.kinematics.origin[link]
    point_columns(robot.model, state.kinematics, link, origin, robot.columns)
    point_bias_acceleration(state.kinematics, link, origin, drift)
    target = (-drift[0], -drift[1], -drift[2])
    for case in range(3):
        complete(robot, target, choice.joints[case], robot.acceleration)
        robot.inverse_dynamics(state, robot.acceleration, choice.force[case])
        target = (0.0, 0.0, 0.0)
    robot.passive_force(state, robot.passive)
    robot.bias_force(state, robot.force)
    for j in range(robot.nv):
        choice.force[0, j] -= robot.passive[j] + disturbance[j]
        choice.force[1, j] -= robot.force[j]
        choice.force[2, j] -= robot.force[j]


@kernel
def find_conditions(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, foot: int, choice: Choice
) -> None:
    """Find what must not be negative of the ground's wrench, `robot.columns` being the foot's."""
    link, rest, columns = robot.foot_link[foot], robot.unactuated, robot.columns
    ends, angle = robot.foot_sole[foot], state.kinematics.angle[link]
    cosine, sine = np.cos(angle), np.sin(angle)
    along_x, along_z = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
    length = np.hypot(along_x, along_z)
    # World axes; positive rotations take z to x.
    ahead = (
        (cosine * along_x + sine * along_z) / length,
        (cosine * along_z - sine * along_x) / length,
    )
    a, b, c = rest[0], rest[1], rest[2]
    for case in range(3):
        force, rows = choice.force[case], choice.conditions
        fx, fz, moment = solve_three_transposed(
            spatial(columns, a), spatial(columns, b), spatial(columns, c),
            (force[a], force[b], force[c]),
        )  # fmt: skip
        for end in range(2):
            inwards = parameters.margin if end == 0 else -parameters.margin
            x = cosine * ends[end, 0] + sine * ends[end, 1] + inwards * ahead[0]
            z = cosine * ends[end, 1] - sine * ends[end, 0] + inwards * ahead[1]
            about = moment - z * fx + x * fz
            rows[end, case] = -about if end == 0 else about
        normal = ahead[0] * fz - ahead[1] * fx
        tangent = ahead[0] * fx + ahead[1] * fz
        rows[2, case] = normal
        rows[3, case] = parameters.friction * normal - tangent
        rows[4, case] = parameters.friction * normal + tangent
    choice.conditions[2, 0] -= parameters.least_force


@kernel
def choose(
    parameters: Parameters, elapsed: float, memory: Memory, log: Log
) -> tuple[float, float]:
    """Choose s̈, nearest to the gait's own time law, and w, nearest to nothing."""
    rows, rate = memory.choice.conditions, memory.rate
    soon = max(elapsed, PERIOD)
    lower = max(-parameters.hurry, min((parameters.slowest - rate) / soon, parameters.hurry))
    upper = min(parameters.hurry, max((parameters.fastest - rate) / soon, -parameters.hurry))
    log.given_up = 0
    for i in range(CONDITIONS):
        lower, upper, kept = narrowed(lower, upper, rows[i, 0], rows[i, 1])
        if not kept:
            log.given_up = 2 if i < MOMENTS else max(log.given_up, 1)
    log.slowest_hurry, log.fastest_hurry = lower, upper
    hurry = min(max((1.0 - rate) / parameters.returning, lower), upper)
    lowest, highest = -np.inf, np.inf
    for i in range(MOMENTS):
        left = rows[i, 0] + rows[i, 1] * hurry
        # Bounds that the clock has just met are met: rounding moves no ankle.
        left += 1e-9 * (abs(rows[i, 0]) + abs(rows[i, 1] * hurry))
        lowest, highest, kept = narrowed(lowest, highest, left, rows[i, 2])
        if not kept:
            log.given_up = 3
    return hurry, min(max(0.0, lowest), highest)


@controller
def regulate_zero_moment_point(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques of the law above."""
    choice, disturbance = memory.choice, memory.disturbance
    elapsed = advance(t, memory)
    exchange_at_touchdown(t, contacts, robot, parameters, memory)
    landed = has_landed(t, state, contacts, robot, parameters, memory)
    if parameters.bandwidth >= 0.0 and landed and disturbance.known == 1 and elapsed > 0.0:
        observe(elapsed, parameters.bandwidth, state, contacts, robot, disturbance)
    foot = memory.stance
    look_up(parameters, foot, memory.clock, choice)
    for i in range(robot.nu):
        error = choice.position[i] - state.joint_position[i]
        joint = choice.curvature[i] * memory.rate**2 + parameters.kp[i] * error
        if landed:
            error_rate = choice.slope[i] * memory.rate - state.joint_velocity[i]
            joint += parameters.kd[i] * error_rate
        choice.joints[0, i] = joint
        choice.joints[1, i] = choice.slope[i]
        choice.joints[2, i] = 1.0 if i == parameters.ankle[foot] else 0.0
    find_forces(state, robot, foot, disturbance.force, choice)
    find_conditions(state, robot, parameters, foot, choice)
    hurry, ankle = choose(parameters, elapsed, memory, log)
    memory.hurry = hurry
    for j in range(robot.nv):
        robot.force[j] = (
            choice.force[0, j] + hurry * choice.force[1, j] + ankle * choice.force[2, j]
        )
    joint_torques(robot, torque)
    if landed:
        remember(state, robot, torque, disturbance)
    tell(robot, parameters, memory, ankle, log)


@kernel
def tell(
    robot: ControlledRobot, parameters: Parameters, memory: Memory, ankle: float, log: Log
) -> None:
    """Write what was chosen into the log."""
    rows, hurry = memory.choice.conditions, memory.hurry
    log.clock, log.rate, log.hurry, log.ankle = memory.clock, memory.rate, hurry, ankle
    heel = rows[0, 0] + rows[0, 1] * hurry + rows[0, 2] * ankle
    toe = rows[1, 0] + rows[1, 1] * hurry + rows[1, 2] * ankle
    ends = robot.foot_sole[memory.stance]
    # Together the two moments are the force times the length between the margins.
    log.pressure = 0.0
    if heel + toe > 0.0:
        length = np.hypot(ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1])
        within = length - 2.0 * parameters.margin
        log.pressure = 0.5 * within * (heel - toe) / (heel + toe)


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
        Bounds of the clock's rate.
    bandwidth : float or None
        Frequency (Hz) up to which the law feels what pushes the robot, by velocities, torques and
        contact forces; infinite for all that there is between two calls, None for nothing.
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
        bandwidth: float | None = np.inf,
        period: float = PERIOD,
    ) -> None:
        _check(robot, gait)
        sides = [gait.pieces, gait.mirrored_pieces()]
        if gait.stance_foot:
            sides.reverse()
        duration = gait.step_duration
        parameters = Parameters(
            kp=per_actuator("kp", kp, robot),
            kd=per_actuator("kd", kd, robot),
            breakpoints=gait.breakpoints,
            coefficients=np.array(sides),
            ankle=np.array(_ankles(robot)),
            earliest=0.5 * duration,
            latest=1.1 * duration,
            landing=0.02 * duration,
            margin=float(margin),
            friction=float(gait.friction if friction is None else friction),
            least_force=float(least_force) * robot.weight,
            returning=float(returning),
            hurry=float(hurry),
            slowest=float(slowest),
            fastest=float(fastest),
            bandwidth=-1.0 if bandwidth is None else float(bandwidth),
        )
        begin = {"stance": gait.stance_foot, "landed": 1, "rate": 1.0}
        super().__init__(
            regulate_zero_moment_point, parameters, memory=begin, robot=robot, period=period
        )
        self.gait = gait


def _check(robot: Robot, gait: Gait) -> None:
    refuse_loops(robot, "regulation of the zero moment point", ControllerError)
    pitch_of(robot)
    try:
        gait.check_joints(robot)
    except GaitError as error:
        raise ControllerError(str(error)) from None


def _ankles(robot: Robot) -> list[int]:
    actuators = robot.model.actuator_joint.tolist()
    return [actuators.index(leg[-1]) for leg in leg_joints(robot)]
