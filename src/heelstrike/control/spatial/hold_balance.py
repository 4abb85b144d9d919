"""A posture and the balance held by a quadratic programme over accelerations and foot wrenches.

The unknowns are the accelerations v̇ and, of each foot, force and moment w of the ground at the
middle of its sole. Torques follow from M v̇ + H = S Γ + Jᵀw. What no motor drives gives equations;
what ground and motors can do gives rows: soles push, within a pyramid in the friction cone, from
within their rectangles. Accelerations that serve best, by weight, are those that

- bring the centre of mass over the middle of the soles, through the forces of the ground alone:
  m c̈ = Σ f + m g,
- take the moment of momentum about it away: L̇ = Σ ((p − c) × f + n),
- leave the feet at rest, turn the trunk upright and bring the joints back to the posture.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import positive, takes
from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.control.quadratic.dual_active_set import solve_or_relax
from heelstrike.control.quadratic.program import SOLVED, Program
from heelstrike.control.quadratic.tasks import add_task, clear, keep_row, scratch_row
from heelstrike.control.spatial.hold_posture import posture_of
from heelstrike.control.spatial.soles import soles_in_space
from heelstrike.dynamics.spatial.algebra import (
    Vector,
    angular,
    cross,
    less,
    spatial,
    velocity_at,
)
from heelstrike.dynamics.spatial.configurations import turn_between
from heelstrike.dynamics.spatial.equations import bias_force, mass_matrix, passive_force
from heelstrike.dynamics.spatial.kinematics import place_of, point_bias, point_position
from heelstrike.dynamics.spatial.rotations import matrix, quaternion_at, turned
from heelstrike.dynamics.spatial.totals import center_of_mass, momentum
from heelstrike.dynamics.spatial.workspace import TreeFactor
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.motors import torque_at
from heelstrike.sim.spatial.controlled import SpatialControlledRobot, SpatialControlState

WRENCH = 6
"""Numbers of force and moment of a foot."""

ROWS_OF_A_FOOT = 11
"""Rows of what the ground can do to a foot: push, four of the cone, four of the sole, two of the
moment about its normal."""

TOUCHES = 2e-3
"""Gap (m) up to which a foot is taken to stand."""

DYNAMICS_LEVEL, MOTOR_LEVEL, CONE_LEVEL, PRESSURE_LEVEL = 0, 0, 1, 2
"""In which order rows are given up if not all can be kept; those at 0 never are."""

WEIGHTS = {"momentum": 1.0, "spin": 0.1, "foot": 10.0, "trunk": 0.1, "posture": 1e-2, "force": 1e-4}
"""How much the tasks count: accelerations by their squares, forces in parts of the weight."""

REST = 1e-2
"""What any acceleration costs, in parts of the posture's weight: so that none is left open."""

WITHIN = 0.9
"""Part of a sole that is used."""


class BalanceNumbers(Bundle):
    """Numbers of the law."""

    posture: Floats = array("nu")
    """Positions of the driven joints that it holds (rad, m)."""
    upright: Floats = array(4)
    """Quaternion of the trunk that it holds."""
    foot: Integers = array("feet", of=int)
    middle: Floats = array("feet", 3)
    axes: Floats = array("feet", 9)
    half: Floats = array("feet", 2)
    """foot, middle, axes, half: Link of each foot, and the middle, the axes and half the lengths of
    its sole (m), in those of the link."""
    free: Integers = array("free", of=int)
    """Velocities that no motor drives."""
    height: float = number(float)
    """Of the centre of mass over the soles (m)."""
    weight: float = number(float)
    """Of the robot (N)."""
    friction: float = number(float)
    """That the ground is believed to have."""
    momentum: float = number(float)
    spin: float = number(float)
    foot_weight: float = number(float)
    trunk: float = number(float)
    posture_weight: float = number(float)
    force: float = number(float)
    """momentum, spin, foot_weight, trunk, posture_weight, force: How much the tasks count."""
    kp: float = number(float)
    kd: float = number(float)
    """kp, kd: Gains of the centre of mass (1/s², 1/s)."""
    spin_kd: float = number(float)
    """Rate at which the moment of momentum fades (1/s)."""
    joint_kp: float = number(float)
    joint_kd: float = number(float)
    """joint_kp, joint_kd: Gains of posture and trunk (1/s², 1/s)."""
    foot_kd: float = number(float)
    """Rate at which the motion of a foot fades (1/s)."""


class BalanceMemory(Bundle):
    """What the law remembers: the last programme, and what it was made of."""

    program: Program = part(Program)
    tree: TreeFactor = part(TreeFactor)
    mass: Floats = array("nv", "nv")
    bias: Floats = array("nv")
    passive: Floats = array("nv")
    """mass, bias, passive: Mass matrix, H, and the force of springs and dampers of joints."""
    jacobian: Floats = array("wrenches", "nv")
    """Of the middle of each sole, and of the rotation of its link; zero of a foot in the air."""
    stands: Integers = array("feet", of=int)
    """Whether each foot is on the ground: only there do wrenches act."""
    center: Floats = array(3)
    momentum: Floats = array(6)
    """center, momentum: Centre of mass (m), momentum (N s), and moment of it (N m s)."""
    sole: Floats = array("feet", 3)
    up: Floats = array("feet", 9)
    """sole, up: Middle of each sole (m), and its axes along, across and up."""


class BalanceLog(Bundle):
    """What the law tells of itself."""

    relaxed: int = cell(int, label="Levels of rows given up")
    """By the quadratic programme."""
    unsolved: int = cell(int, label="Programmes not solved")
    """One where it was not solved, so that the torques of the call before go on."""
    away: float = cell(float, unit="m", label="Centre of mass from the middle of the soles")
    """Along the ground."""


@kernel
def stands(
    foot: int, contacts: Contacts, robot: SpatialControlledRobot, numbers: BalanceNumbers
) -> bool:
    """Whether a foot is on the ground."""
    for contact in range(robot.nc):
        link = int(robot.model.contact_link[contact])
        if link == numbers.foot[foot] and contacts.gap[contact] < TOUCHES:
            return True
    return False


@kernel
def place_soles(
    state: SpatialControlState, contacts: Contacts, robot: SpatialControlledRobot,
    numbers: BalanceNumbers, memory: BalanceMemory,
) -> None:  # fmt: skip
    """Find where the soles are, which of them stand, and the Jacobians of these."""
    model, work = robot.model, state.kinematics
    for foot in range(numbers.foot.shape[0]):
        link, first = int(numbers.foot[foot]), WRENCH * foot
        middle, own = numbers.middle, numbers.axes
        at = point_position(work, link, (middle[foot, 0], middle[foot, 1], middle[foot, 2]))
        for k in range(3):
            memory.sole[foot, k] = at[k]
            axis = own[foot, 3 * k], own[foot, 3 * k + 1], own[foot, 3 * k + 2]
            direction = turned(matrix(work.rotation, link), axis)
            for i in range(3):
                memory.up[foot, 3 * k + i] = direction[i]
        for row in range(first, first + WRENCH):
            for k in range(model.nv):
                memory.jacobian[row, k] = 0.0
        memory.stands[foot] = stands(foot, contacts, robot, numbers)
        if memory.stands[foot] == 0:
            continue
        place = place_of(work, at)
        last = model.last_velocity[link]
        for a in range(model.depth[last] + 1):
            k = model.chain[last, a]
            motion = spatial(work.motion, k)
            moves, turns = velocity_at(motion, place), angular(motion)
            for i in range(3):
                memory.jacobian[first + i, k] = moves[i]
                memory.jacobian[first + 3 + i, k] = turns[i]


@kernel
def torque_row(
    k: int, sign: float, nv: int, memory: BalanceMemory, program: Program
) -> float:  # fmt: skip
    """Write, as a row, what must drive a velocity, times a sign; return its part without x."""
    row = scratch_row(program)
    for i in range(nv):
        program.rows[row, i] = sign * memory.mass[k, i]
    for i in range(memory.jacobian.shape[0]):
        program.rows[row, nv + i] = -sign * memory.jacobian[i, k]
    return sign * (memory.bias[k] - memory.passive[k])


@kernel
def motor_limit(
    actuator: int, limit: float, state: SpatialControlState, robot: SpatialControlledRobot
) -> float:
    """Return what a limit of a motor's torque comes to on its speed-torque line."""
    joint = int(robot.model.actuator_velocity[actuator])
    return torque_at(robot.model, actuator, joint, 0, limit, state.v)


@kernel
def add_dynamics(
    state: SpatialControlState, robot: SpatialControlledRobot, numbers: BalanceNumbers,
    memory: BalanceMemory,
) -> None:  # fmt: skip
    """Add the equations of what no motor drives; then what the motors can do."""
    program, model = memory.program, robot.model
    for i in range(numbers.free.shape[0]):
        keep_row(
            -torque_row(int(numbers.free[i]), 1.0, robot.nv, memory, program),
            DYNAMICS_LEVEL, program,
        )  # fmt: skip
    program.equalities = program.count
    for actuator in range(robot.nu):
        k = int(model.actuator_velocity[actuator])
        lower = motor_limit(actuator, model.torque_lower[actuator], state, robot)
        upper = motor_limit(actuator, model.torque_upper[actuator], state, robot)
        if lower > -inf:
            rest = torque_row(k, 1.0, robot.nv, memory, program)
            keep_row(lower - rest, MOTOR_LEVEL, program)
        if upper < inf:
            rest = torque_row(k, -1.0, robot.nv, memory, program)
            keep_row(-upper - rest, MOTOR_LEVEL, program)


@kernel
def sole_row(
    first: int, foot: int, force: Vector, moment: Vector, level: int, memory: BalanceMemory
) -> None:
    """Add a row: a wrench, in the axes of its sole, has no negative part along this direction."""
    program = memory.program
    row = scratch_row(program)
    for axis in range(3):
        for i in range(3):
            direction = memory.up[foot, 3 * axis + i]
            program.rows[row, first + i] += force[axis] * direction
            program.rows[row, first + 3 + i] += moment[axis] * direction
    keep_row(0.0, level, program)


@kernel
def add_ground(first: int, foot: int, numbers: BalanceNumbers, memory: BalanceMemory) -> None:
    """Add what the ground can do to a foot: push, within the cone, from within the sole."""
    cone = numbers.friction / sqrt(2.0)
    ahead, aside = WITHIN * numbers.half[foot, 0], WITHIN * numbers.half[foot, 1]
    grip = 0.5 * numbers.friction * min(ahead, aside)
    still: Vector = (0.0, 0.0, 0.0)
    sole_row(first, foot, (0.0, 0.0, 1.0), still, CONE_LEVEL, memory)
    for side in range(2):
        sign = 1.0 - 2.0 * side
        sole_row(first, foot, (sign, 0.0, cone), still, CONE_LEVEL, memory)
        sole_row(first, foot, (0.0, sign, cone), still, CONE_LEVEL, memory)
        sole_row(first, foot, (0.0, 0.0, ahead), (0.0, sign, 0.0), PRESSURE_LEVEL, memory)
        sole_row(first, foot, (0.0, 0.0, aside), (sign, 0.0, 0.0), PRESSURE_LEVEL, memory)
        sole_row(first, foot, (0.0, 0.0, grip), (0.0, 0.0, sign), PRESSURE_LEVEL, memory)


@kernel
def want_rest(
    first: int, foot: int, state: SpatialControlState, robot: SpatialControlledRobot,
    numbers: BalanceNumbers, memory: BalanceMemory,
) -> None:  # fmt: skip
    """Add the task of a foot: to come to rest."""
    program, work = memory.program, state.kinematics
    link = int(numbers.foot[foot])
    at = memory.sole[foot, 0], memory.sole[foot, 1], memory.sole[foot, 2]
    moves, turns = point_bias(work, link, at), angular(spatial(work.bias_acceleration, link))
    for i in range(WRENCH):
        row = scratch_row(program)
        speed = 0.0
        for k in range(robot.nv):
            entry = memory.jacobian[first + i, k]
            program.rows[row, k] = entry
            speed += entry * state.v[k]
        bias = moves[i] if i < 3 else turns[i - 3]
        add_task(program.rows, row, -numbers.foot_kd * speed - bias, numbers.foot_weight, program)


@kernel
def want_momentum(
    robot: SpatialControlledRobot, numbers: BalanceNumbers, memory: BalanceMemory, log: BalanceLog
) -> None:
    """Add the tasks of centre of mass and moment of momentum, of which only wrenches are part."""
    program, center, mass = memory.program, memory.center, robot.mass
    goal_x = goal_y = goal_z = 0.0
    feet, standing = numbers.foot.shape[0], 0
    for foot in range(feet):
        standing += memory.stands[foot]
        goal_x += memory.sole[foot, 0] / feet
        goal_y += memory.sole[foot, 1] / feet
        goal_z += memory.sole[foot, 2] / feet
    off = less((goal_x, goal_y, goal_z + numbers.height), (center[0], center[1], center[2]))
    log.away = sqrt(off[0] * off[0] + off[1] * off[1])
    if standing == 0:
        return
    size = mass * numbers.height * numbers.height
    for axis in range(3):
        row = scratch_row(program)
        for foot in range(feet):
            program.rows[row, robot.nv + WRENCH * foot + axis] = memory.stands[foot] / mass
        wanted = numbers.kp * off[axis] - numbers.kd * memory.momentum[axis] / mass
        missing = wanted - robot.model.gravity[axis]
        add_task(program.rows, row, missing, numbers.momentum, program)
        row = scratch_row(program)
        for foot in range(feet):
            first = robot.nv + WRENCH * foot
            if memory.stands[foot] == 0:
                continue
            arm = less(
                (memory.sole[foot, 0], memory.sole[foot, 1], memory.sole[foot, 2]),
                (center[0], center[1], center[2]),
            )  # fmt: skip
            for i in range(3):
                unit: Vector = (1.0 * (i == 0), 1.0 * (i == 1), 1.0 * (i == 2))
                program.rows[row, first + i] = cross(arm, unit)[axis] / size
            program.rows[row, first + 3 + axis] = 1.0 / size
        fades = -numbers.spin_kd * memory.momentum[3 + axis] / size
        add_task(program.rows, row, fades, numbers.spin, program)


@kernel
def want_posture(
    state: SpatialControlState, robot: SpatialControlledRobot, numbers: BalanceNumbers,
    memory: BalanceMemory,
) -> None:  # fmt: skip
    """Add the tasks of joints and trunk, and a small price on all else."""
    program = memory.program
    for i in range(robot.nu):
        k = int(robot.model.actuator_velocity[i])
        wanted = numbers.joint_kp * (numbers.posture[i] - state.joint_position[i])
        wanted -= numbers.joint_kd * state.joint_velocity[i]
        program.hessian[k, k] += numbers.posture_weight
        program.gradient[k] -= numbers.posture_weight * wanted
    turn = turn_between(quaternion_at(state.q, 3), quaternion_at(numbers.upright, 0))
    for i in range(3):
        wanted = numbers.joint_kp * turn[i] - numbers.joint_kd * state.v[3 + i]
        program.hessian[3 + i, 3 + i] += numbers.trunk
        program.gradient[3 + i] -= numbers.trunk * wanted
    for k in range(robot.nv):
        program.hessian[k, k] += REST * numbers.posture_weight


@kernel
def want_little_force(first: int, numbers: BalanceNumbers, program: Program) -> None:
    """Add a price on the wrench of a foot."""
    for i in range(WRENCH):
        unit = numbers.weight if i < 3 else numbers.weight * numbers.height
        program.hessian[first + i, first + i] += numbers.force / (unit * unit)


@controller
def hold_balance(
    state: SpatialControlState, contacts: Contacts, robot: SpatialControlledRobot,
    parameters: BalanceNumbers, memory: BalanceMemory, log: BalanceLog, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques that hold posture and balance."""
    model, work, program = robot.model, state.kinematics, memory.program
    mass_matrix(model, work, memory.tree, memory.mass)
    bias_force(model, work, memory.bias)
    passive_force(model, state.q, state.v, memory.passive)
    center_of_mass(model, work, memory.center)
    momentum(model, work, memory.momentum)
    place_soles(state, contacts, robot, parameters, memory)
    clear(program)
    add_dynamics(state, robot, parameters, memory)
    for foot in range(parameters.foot.shape[0]):
        first = robot.nv + WRENCH * foot
        want_little_force(first, parameters, program)
        if memory.stands[foot] == 1:
            want_rest(WRENCH * foot, foot, state, robot, parameters, memory)
            add_ground(first, foot, parameters, memory)
    want_momentum(robot, parameters, memory, log)
    want_posture(state, robot, parameters, memory)
    solve_or_relax(program)
    log.relaxed = program.relaxed
    log.unsolved = int(program.status != SOLVED)
    if log.unsolved == 1:
        return  # with the torques of before
    for i in range(robot.nu):
        k = int(model.actuator_velocity[i])
        total = torque_row(k, 1.0, robot.nv, memory, program)
        for j in range(program.x.shape[0]):
            total += program.rows[program.count, j] * program.x[j]
        possible = min(max(total, model.torque_lower[i]), model.torque_upper[i])
        torque[i] = motor_limit(i, possible, state, robot)


class HoldBalance(Law):
    """Hold a posture of a robot in space and keep its balance on its feet.

    At every call a quadratic programme chooses accelerations and ground forces: the centre of mass
    goes over the middle of the soles, moment of momentum fades, feet stay, trunk and joints return
    to the posture. Ground and motors limit all of it: soles push, within the friction cone, from
    within their rectangles, and torques have ends. The robot does not step: a push that takes the
    capture point out of the support polygon makes it fall.

    Parameters
    ----------
    robot : SpatialRobot
        A floating robot whose feet have soles; its actuators drive hinges and slides.
    posture : (nq,) array, optional
        Position that is held, in which the soles lie flat; that of the file by default.
    friction : float
        Coefficient of friction that it reckons with.
    joint_kp, joint_kd : float
        How fast trunk and joints return to the posture (1/s², 1/s).

    Raises
    ------
    ControllerError
        If the robot cannot be controlled this way, or a number does not fit it.

    Notes
    -----
    One call takes a third of a millisecond for 29 joints: call it every few milliseconds, by
    ``control_period=5e-3`` of the simulation.
    """

    @takes(ControllerError)
    def __init__(
        self,
        robot: SpatialRobot,
        *,
        posture: ArrayLike | None = None,
        friction: float = 0.6,
        joint_kp: float = 100.0,
        joint_kd: float = 20.0,
    ) -> None:
        whole, places = posture_of(robot, posture)
        if not robot.floating:
            raise ControllerError(f"robot {robot.name!r} does not float: it cannot fall over")
        for name, value in (("friction", friction), ("joint_kp", joint_kp), ("joint_kd", joint_kd)):
            positive(name, value, ControllerError)
        soles = soles_in_space(robot, whole)
        feet, nu = len(soles.link), robot.nu
        free = np.setdiff1d(np.arange(robot.nv), robot.model.actuator_velocity)
        rate = np.linalg.norm(robot.model.gravity) / soles.height  # of a pendulum that falls
        parameters = BalanceNumbers(
            posture=whole[places].copy(), upright=whole[3:7].copy(),
            foot=np.array(soles.link, dtype=np.int64), middle=soles.middle,
            axes=soles.axes.reshape(feet, 9), half=soles.half, free=free, height=soles.height,
            weight=robot.weight, friction=float(friction), momentum=WEIGHTS["momentum"],
            spin=WEIGHTS["spin"], foot_weight=WEIGHTS["foot"], trunk=WEIGHTS["trunk"],
            posture_weight=WEIGHTS["posture"], force=WEIGHTS["force"], kp=2.0 * rate,
            kd=3.0 * float(np.sqrt(rate)), spin_kd=float(np.sqrt(rate)), joint_kp=float(joint_kp),
            joint_kd=float(joint_kd), foot_kd=float(joint_kd),
        )  # fmt: skip
        wrenches = WRENCH * feet
        rows = len(free) + 2 * nu + ROWS_OF_A_FOOT * feet + 1  # and one to scribble on
        begin = {"feet": feet, "wrenches": wrenches, "n": robot.nv + wrenches, "m": rows}
        super().__init__(hold_balance, parameters, memory=begin)
