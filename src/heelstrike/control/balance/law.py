"""Walking by whole-body control and footstep feedback: the law, from touchdown to torques."""

from __future__ import annotations

from math import atan, atan2, cos, exp, inf, sin, sqrt

from heelstrike.compiler.compilation import kernel
from heelstrike.control.balance.constrained import constrain, point_task
from heelstrike.control.balance.footsteps import COMMITTED, make_plan
from heelstrike.control.balance.numbers import Log, Memory, Parameters
from heelstrike.control.balance.reference import (
    Reference,
    curvature_at,
    slope_at,
    value_at,
)
from heelstrike.control.balance.tasks import (
    KNEE_LEVEL,
    add_contact,
    add_motors,
    add_pressure,
    solve_torques,
)
from heelstrike.control.quadratic.tasks import add_task, clear
from heelstrike.dynamics.kernels import center_of_mass, point_position
from heelstrike.dynamics.places import place_of, velocity_at
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance_clock import STEEP, exchange_at_touchdown, has_landed

JUST_BEGUN = 0.05
"""A step has just begun up to this phase."""

TURNING = 0.15
"""How far within the sole a foot presses that touches at one end, as a part of its length."""

BUMP = 0.1
"""A slope that differs by as much from the one before may be but a bump."""

STEEPEST = 0.35
"""No slope is believed to be steeper."""


TOO_EARLY = 0.3
"""Part of the shortest step within which no touchdown is believed: the foot has just left."""

LEVEL_FEET = 0.1
"""How far feet are apart or above each other, in parts of the gait's step or of what is held, for
them to stand in one place and on one height."""

LIFTED_LEFT = 0.3
"""Part of a step that is left at least for a foot that is lifted over an obstacle."""

LATE_BEGINS = 0.2
"""Alarm that a late foot has to make good before it is one: no touchdown is on time to the call."""

SHORTENED_LEG = 0.015
"""Part of its length by which a leg stays short of its reach, when alarmed."""

DOUBTED = 0.92
"""Part of the posture's weight that is given up when alarmed."""

BEND_BEGINS, BEND_GROWS, ALARM_GROWS = 0.5, 2.5, 4.0
"""How the least bend of a swing knee grows: from this part of the gait's bend, and how fast with it
and with the alarm."""


@kernel
def begin_step(t: float, reference: Reference, memory: Memory) -> None:
    """Set the reference to the beginning of a step."""
    memory.start = t
    memory.time = t
    memory.phase = 0.0
    memory.late = 0.0
    memory.raised = 0.0
    memory.lifting = 0
    memory.rate = 1.0 / reference.duration
    memory.plan.remaining = reference.duration


@kernel
def wall_at(contacts: Contacts, robot: ControlledRobot, foot: int) -> float:
    """Direction away from a wall that a foot touches, along the ground: ±1, and 0 of none."""
    for i in range(robot.nc):
        steep = contacts.normal[i, 1] <= STEEP
        if robot.contact_foot[i] == foot and contacts.force[i, 0] > 0.0 and steep:
            return 1.0 if contacts.normal[i, 0] > 0.0 else -1.0
    return 0.0


@kernel
def begin_at_touchdown(
    t: float, contacts: Contacts, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Begin the next step when the swing foot has met the ground."""
    soon = t - memory.start < TOO_EARLY * parameters.planning.earliest
    if soon or memory.lifting == 1:
        return
    if exchange_at_touchdown(
        t, memory.phase, parameters.touchdown, contacts, robot.contact_foot, memory
    ):
        # Where it stood: by now the impact may have lifted it.
        memory.rear[0], memory.rear[1] = memory.sole[0], memory.sole[1]
        memory.steps += 1
        # Some time since the last call; half of it is wrong by no more than half of it. A walk
        # then keeps step with the calls, its touchdowns midway between two.
        begin_step(0.5 * (memory.time + t), parameters.reference, memory)


@kernel
def learn_slope(parameters: Parameters, memory: Memory) -> None:
    """Estimate the slope, from the foot that stands and the one that stood before it.

    Both lie on the ground. Where a foot is as it touches depends on how it is moved, and that on
    the slope that is believed: an error of the estimate would confirm itself.
    """
    length = memory.sole[0] - memory.rear[0]
    if abs(length) > LEVEL_FEET * parameters.reference.length:
        rise = memory.sole[1] - memory.rear[1]
        slope = min(max(rise / length, -STEEPEST), STEEPEST)
        off = slope - memory.slope
        doubt = (1.0 - parameters.believed) * min(abs(off) / BUMP, 1.0)
        memory.slope += (1.0 - doubt) * off


@kernel
def lift_over(
    t: float, contacts: Contacts, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Lift a swing foot that has hit a wall, such as the riser of a step, over it.

    It is first taken back and up: a foot that is pressed on against the wall jams, and turns.
    """
    if memory.stands == 1:
        return
    if memory.lifting == 1 and (memory.swing[1] > memory.top or t > memory.until):
        memory.lifting = 0
    away = wall_at(contacts, robot, 1 - memory.stance)
    if memory.lifting == 0:
        if away == 0.0 or memory.plan.remaining < COMMITTED * parameters.reference.duration:
            return
        memory.lifting = 1
        memory.back = memory.swing[0] + away * parameters.away
        memory.top = memory.swing[1] + parameters.lift
        memory.until = t + parameters.search
        height = memory.swing[1] - memory.sole[1]
        memory.raised = min(max(memory.raised, height) + parameters.away, parameters.most_raised)
    memory.alarm = 1.0
    memory.phase = min(memory.phase, 0.5)
    memory.late = 0.0
    memory.plan.remaining = max(memory.plan.remaining, LIFTED_LEFT * parameters.reference.duration)


@kernel
def locate(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Find soles, centre of mass and capture point."""
    work, legs, plan = state.kinematics, parameters.legs, memory.plan
    stance, swing = memory.stance, 1 - memory.stance
    point_position(work, robot.foot_link[stance], legs.point[stance], memory.sole)
    point_position(work, robot.foot_link[swing], legs.point[swing], memory.swing)
    place = place_of(work, memory.swing)
    memory.speed[0], memory.speed[1] = velocity_at(work.velocity, robot.foot_link[swing], place)
    center_of_mass(robot.model, work, memory.mass)
    robot.center_of_mass_velocity(state, robot.other)
    plan.capture = memory.mass[0] - memory.sole[0] + robot.other[0] / parameters.reference.rate
    plan.swing = memory.swing[0] - memory.sole[0]
    plan.speed = memory.speed[0]


@kernel
def stand_or_walk(t: float, parameters: Parameters, memory: Memory) -> None:
    """Begin to stand once the feet are together, and to walk if that is wanted or needed."""
    plan, hold = memory.plan, parameters.hold
    away = abs(plan.capture)
    if memory.stands == 1:
        if parameters.speed != 0.0 or away > hold:
            memory.stands = 0
            begin_step(t, parameters.reference, memory)
    elif parameters.speed == 0.0 and memory.phase < JUST_BEGUN and memory.landed == 1:
        level = abs(memory.swing[1] - memory.sole[1]) < LEVEL_FEET * hold
        if level and abs(plan.swing) < hold and away < 0.5 * hold:
            memory.stands = 1
            memory.back = memory.swing[0]


@kernel
def stay(t: float, parameters: Parameters, memory: Memory) -> None:
    """Stand: press beyond the capture point, so that it comes back to the middle of the sole."""
    plan, planning = memory.plan, parameters.planning
    memory.alarm = max(memory.alarm - max(t - memory.time, 0.0) / parameters.calming, 0.0)
    memory.time = t
    memory.rate = 0.0
    plan.foothold = plan.swing
    plan.remaining = parameters.reference.duration
    plan.pressure = min(max(2.0 * plan.capture, planning.heel), planning.toe)


@kernel
def decide(t: float, landed: bool, tilt: float, parameters: Parameters, memory: Memory) -> None:
    """Plan the landing, move the reference's clock on, and see how alarming all this is."""
    reference, plan = parameters.reference, memory.plan
    elapsed = max(t - memory.time, 0.0)
    memory.phase = min(memory.phase + memory.rate * elapsed, 1.0)
    if memory.phase >= 1.0:
        memory.late += elapsed
    memory.time = t
    plan.gone = elapsed
    plan.length = parameters.speed * reference.duration
    more = (plan.length - reference.length) / (exp(reference.rate * reference.duration) - 1.0)
    plan.offset = reference.end - reference.length + more
    plan.phase = memory.phase
    plan.elapsed = t - memory.start
    make_plan(parameters.planning, reference, parameters.adapts == 1, plan)
    rate = (1.0 - memory.phase) / plan.remaining
    memory.rate += min(elapsed / parameters.smoothing, 1.0) * (rate - memory.rate)
    memory.alarm = max(memory.alarm - elapsed / parameters.calming, 0.0)
    if landed and parameters.adapts == 1:
        # A foot that is late has found the ground lower than it should be.
        alarm = min(2.0 * memory.late / parameters.search - LATE_BEGINS, 1.0)
        # One that does not lie as the ground is believed to lies on ground that is not known.
        alarm = max(alarm, min(abs(tilt + atan(memory.slope)) / BUMP - 1.0, 1.0))
        amiss = sqrt(plan.cost)
        if plan.remaining < COMMITTED * reference.duration:
            # A foot that is as good as down cannot be placed again: the next one will be off by
            # what this one misses, not by what missing it costs.
            amiss /= sqrt(max(parameters.planning.capture_weight, 1.0))
        span = parameters.alarmed - parameters.calm
        alarm = max(alarm, min((amiss - parameters.calm) / span, 1.0))
        memory.alarm = max(memory.alarm, alarm)


@kernel
def press_where_it_touches(
    contacts: Contacts, robot: ControlledRobot, parameters: Parameters, tilt: float, memory: Memory
) -> float:
    """Want the centre of pressure near what touches of a foot that does not lie flat.

    A foot on its heel alone is turned down gently by a pressure a little before the heel; torques
    that are right for a sole that lies flat would throw it about. Returned is how far what the
    foot stands on is inclined: as its sole, or as the ground under the only end that touches, if
    that can be stood upon.
    """
    planning, plan = parameters.planning, memory.plan
    least, most, under = inf, -inf, tilt
    for i in range(robot.nc):
        if robot.contact_foot[i] == memory.stance and contacts.gap[i] < parameters.flat:
            x = contacts.position[i, 0] - memory.sole[0]
            z = contacts.position[i, 1] - memory.sole[1]
            along = x * cos(tilt) - z * sin(tilt)
            least, most = min(least, along), max(most, along)
            if contacts.normal[i, 1] > STEEP:  # else a wall beside it is nearest
                under = atan2(contacts.normal[i, 0], contacts.normal[i, 1])
    if most != least:
        return tilt
    if memory.stands == 1:
        return under
    span = TURNING * (planning.toe - planning.heel)
    plan.pressure = min(max(plan.pressure, most - span), least + span)
    plan.pressure = min(max(plan.pressure, planning.heel), planning.toe)
    return under


@kernel
def want_height(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, damping: float,
    memory: Memory,
) -> None:  # fmt: skip
    """Add the task of the hip's height, which no leg may be too short for."""
    reference, legs, plan, alarm = parameters.reference, parameters.legs, memory.plan, memory.alarm
    work, on, rate = state.kinematics, memory.on, memory.rate
    hip = work.origin[legs.hip[memory.stance]]
    ankle = work.origin[robot.foot_link[memory.stance]]
    own = value_at(reference.hip, memory.phase)
    # The plane in which the body goes: parallel to the ground.
    rise = memory.slope * (hip[0] - memory.sole[0])
    reach = (1.0 - SHORTENED_LEG * alarm) * legs.length
    across = hip[0] - ankle[0]
    under = ankle[1] - memory.sole[1]
    room = under + sqrt(max(reach * reach - across * across, 0.0)) - rise
    omega = reference.rate
    # How far the hip will be before the foot that lands, the body falling over where it presses.
    x = memory.mass[0] - memory.sole[0]
    grown, shrunk = exp(omega * plan.remaining), exp(-omega * plan.remaining)
    fallen = 0.5 * (plan.capture - plan.pressure) * (grown - 1.0)
    fallen += 0.5 * (2.0 * x - plan.capture - plan.pressure) * (shrunk - 1.0)
    across = plan.foothold - (hip[0] - memory.sole[0]) - fallen
    limit = under + sqrt(max(reach * reach - across * across, 0.25 * reach * reach))
    if memory.phase >= 1.0:
        limit += min(memory.swing[1] - memory.sole[1] - memory.slope * plan.swing, 0.0)
    low = min(min(own - parameters.crouch, room), limit)
    height = own + alarm * (low - own)
    point_task(robot, state, legs.hip[memory.stance], hip, on)
    place = place_of(work, hip)
    velocity = velocity_at(work.velocity, legs.hip[memory.stance], place)
    calm = 1.0 - alarm
    missing = calm * curvature_at(reference.hip, memory.phase) * rate * rate - on.shift[1]
    missing += parameters.kp * (height + rise - (hip[1] - memory.sole[1]))
    wanted = calm * slope_at(reference.hip, memory.phase) * rate + memory.slope * velocity[0]
    missing += damping * parameters.kd * (wanted - velocity[1])
    add_task(on.rows, 1, missing, parameters.weights.height, memory.program)


@kernel
def want_trunk(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, damping: float,
    memory: Memory,
) -> None:  # fmt: skip
    """Add the task of the trunk's rotation."""
    pitch, phase, rate, work = (
        parameters.reference.pitch,
        memory.phase,
        memory.rate,
        state.kinematics,
    )
    on, calm = memory.on, 1.0 - memory.alarm
    point_task(robot, state, 2, work.origin[2], on)
    missing = calm * curvature_at(pitch, phase) * rate * rate - on.shift[2]
    missing += parameters.kp * (calm * value_at(pitch, phase) - work.angle[2])
    wanted = calm * slope_at(pitch, phase) * rate
    missing += damping * parameters.kd * (wanted - work.velocity[2, 0])
    add_task(on.rows, 2, missing, parameters.weights.pitch, memory.program)


@kernel
def want_foothold(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, damping: float,
    memory: Memory,
) -> None:  # fmt: skip
    """Add the tasks of the swing foot: to its foothold, over the ground, parallel to it."""
    reference, weights, plan = parameters.reference, parameters.weights, memory.plan
    phase, rate, on, program = memory.phase, memory.rate, memory.on, memory.program
    swing, alarm = 1 - memory.stance, memory.alarm
    link = robot.foot_link[swing]
    point_task(robot, state, link, memory.swing, on)
    squared = rate * rate

    # Along the ground: what is wrong vanishes, in the time that is left, with the least effort.
    left = max(plan.remaining, parameters.haste)
    off = plan.swing - value_at(reference.swing_x, phase)
    drift = plan.speed - slope_at(reference.swing_x, phase) * rate
    goal = plan.foothold - reference.length
    pull = 6.0 * (goal - off) / (left * left) - damping * 4.0 * drift / left
    limit = parameters.planning.acceleration
    pull = min(max(pull, -limit), limit)
    ahead = curvature_at(reference.swing_x, phase) * squared + pull
    if memory.lifting == 1:
        haste = parameters.haste
        ahead = (6.0 * (memory.back - memory.swing[0]) / haste - 4.0 * plan.speed) / haste
    ahead = min(max(ahead, -limit), limit)
    add_task(on.rows, 0, ahead - on.shift[0], weights.swing, program)

    # Over the ground: the gait's way, higher when alarmed; a late foot looks for the ground.
    up = memory.slope * plan.swing + value_at(reference.swing_z, phase) + memory.raised
    speed = memory.slope * plan.speed + slope_at(reference.swing_z, phase) * rate
    bend = curvature_at(reference.swing_z, phase) * squared
    s, r = phase, 1.0 - phase
    up += alarm * parameters.lift * 16.0 * s * s * r * r
    speed += alarm * parameters.lift * 32.0 * s * r * (r - s) * rate
    bend += alarm * parameters.lift * 32.0 * (1.0 - 6.0 * s * r) * squared
    height = memory.swing[1] - memory.sole[1]
    if memory.phase >= 1.0:
        part = min(memory.late / parameters.search, 1.0)
        speed = -parameters.slow - part * (parameters.fast - parameters.slow)
        rise = parameters.foot_kd * damping * (speed - memory.speed[1])
    else:
        rise = bend + parameters.foot_kp * (up - height)
        rise += damping * parameters.foot_kd * (speed - memory.speed[1])
    if memory.lifting == 1:
        rise = parameters.foot_kd * (parameters.fast - memory.speed[1])
    rise = min(max(rise, -limit), limit)
    add_task(on.rows, 1, rise - on.shift[1], weights.swing, program)

    tilt = state.kinematics.angle[link] - parameters.legs.angle[swing]
    own = value_at(reference.swing_angle, phase) - atan(memory.slope)
    turn = curvature_at(reference.swing_angle, phase) * squared
    turn += parameters.foot_kp * (own - tilt)
    wanted = slope_at(reference.swing_angle, phase) * rate
    turn += damping * parameters.foot_kd * (wanted - state.kinematics.velocity[link, 0])
    add_task(on.rows, 2, turn - on.shift[2], weights.angle, program)


@kernel
def want_rest(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, memory: Memory
) -> None:
    """Add the task of the other foot as the robot stands: to lie where it came to rest."""
    weights, on, program = parameters.weights, memory.on, memory.program
    link, kp, kd = robot.foot_link[1 - memory.stance], parameters.foot_kp, parameters.foot_kd
    point_task(robot, state, link, memory.swing, on)
    ahead = kp * (memory.back - memory.swing[0]) - kd * memory.speed[0]
    add_task(on.rows, 0, ahead - on.shift[0], weights.swing, program)
    # A little below the ground, so that it goes on touching it.
    low = memory.sole[1] + memory.slope * memory.plan.swing - parameters.flat
    rise = kp * (low - memory.swing[1]) - kd * memory.speed[1]
    add_task(on.rows, 1, rise - on.shift[1], weights.swing, program)
    tilt = state.kinematics.angle[link] - parameters.legs.angle[1 - memory.stance]
    turn = -kp * (tilt + atan(memory.slope)) - kd * state.kinematics.velocity[link, 0]
    add_task(on.rows, 2, turn - on.shift[2], weights.angle, program)


@kernel
def want_posture(
    state: ControlState, robot: ControlledRobot, parameters: Parameters, damping: float,
    memory: Memory,
) -> None:  # fmt: skip
    """Add what settles what the other tasks leave open: the gait's joints, bent knees, effort."""
    reference, weights = parameters.reference, parameters.weights
    program, on, phase, rate = memory.program, memory.on, memory.phase, memory.rate
    weight = weights.posture * (1.0 - DOUBTED * memory.alarm)
    for i in range(robot.nu):
        table = reference.joints[memory.stance, :, i]
        wanted = curvature_at(table, phase) * rate * rate
        if memory.stands == 0:
            wanted += parameters.joint_kp * (value_at(table, phase) - state.joint_position[i])
        speed = slope_at(table, phase) * rate
        wanted += damping * parameters.joint_kd * (speed - state.joint_velocity[i])
        program.hessian[i, i] += weight
        program.gradient[i] -= weight * wanted
        add_task(on.torque, i, -on.hold[i], weights.torque, program)


@kernel
def keep_knees_bent(state: ControlState, parameters: Parameters, memory: Memory) -> None:
    """Add rows that let no knee pass the angle beyond which its leg could not lift the body.

    A knee that nears it is slowed down in time: a ≥ k (least − bent) − 2 √k v. A robot that stands
    keeps both bent: a knee that stood straight, or beyond, would have to pass there when alarmed,
    where bending it moves the hip hardly at all, and then throws the body off its foot.
    """
    legs, program, stiffness = parameters.legs, memory.program, parameters.knee_kp
    range_of = parameters.bent_knee - parameters.straight_knee
    for foot in range(2):
        knee, sign = legs.knee[foot], legs.bend[foot]
        bent = sign * (state.joint_position[knee] - legs.straight[foot])
        part = memory.alarm
        if memory.stands == 1:
            part = 1.0
        elif foot != memory.stance:
            # A swing leg that is bent the wrong way could not be lifted.
            table = parameters.reference.joints[memory.stance, :, knee]
            gait = sign * (value_at(table, memory.phase) - legs.straight[foot])
            part = max(min(ALARM_GROWS * part, 1.0), min(BEND_GROWS * gait - BEND_BEGINS, 1.0))
        least = parameters.straight_knee + max(part, 0.0) * range_of
        row = program.count
        for i in range(program.x.shape[0]):
            program.rows[row, i] = 0.0
        program.rows[row, knee] = sign
        speed = sign * state.joint_velocity[knee]
        program.bound[row] = stiffness * (least - bent) - 2.0 * sqrt(stiffness) * speed
        program.level[row] = KNEE_LEVEL
        program.count = row + 1


@kernel
def tell(memory: Memory, log: Log) -> None:
    """Fill in the log."""
    plan = memory.plan
    log.phase = memory.phase
    log.alarm = memory.alarm
    log.capture_point = plan.capture
    log.foothold = plan.foothold
    log.pressure = plan.pressure
    log.remaining = plan.remaining
    log.slope = memory.slope
    log.relaxed = memory.program.relaxed


@controller
def keep_balance(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, log: Log, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques that walk, by the gait or by where the next foot has to land."""
    begin_at_touchdown(t, contacts, robot, parameters, memory)
    locate(state, robot, parameters, memory)
    lift_over(t, contacts, robot, parameters, memory)
    comes_down = memory.landed == 0
    landed = has_landed(t, parameters.landing, state, contacts, robot, memory)
    if comes_down and landed:
        learn_slope(parameters, memory)
    stand_or_walk(t, parameters, memory)
    stance = memory.stance
    link = robot.foot_link[stance]
    tilt = state.kinematics.angle[link] - parameters.legs.angle[stance]
    if memory.stands == 1:
        stay(t, parameters, memory)
    else:
        decide(t, landed, tilt, parameters, memory)
    on, program = memory.on, memory.program
    under = press_where_it_touches(contacts, robot, parameters, tilt, memory)
    constrain(robot, state, stance, memory.sole, parameters.constrained, on)
    clear(program)
    weights = parameters.weights
    add_pressure(weights.pressure, tilt, memory.plan.pressure, parameters.weight, on, program)
    damping = 1.0 if landed else 0.0
    want_height(state, robot, parameters, damping, memory)
    want_trunk(state, robot, parameters, damping, memory)
    if memory.stands == 1:
        want_rest(state, robot, parameters, memory)
    else:
        want_foothold(state, robot, parameters, damping, memory)
    want_posture(state, robot, parameters, damping, memory)
    add_contact(parameters, tilt, under, on, program)
    add_motors(robot, state, on, program)
    keep_knees_bent(state, parameters, memory)
    solve_torques(robot, state, memory, torque)
    tell(memory, log)
