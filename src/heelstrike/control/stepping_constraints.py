"""Virtual constraints on point feet with footstep feedback: every step may be another one.

What virtual constraints leave free has an energy σ²/2, σ the angular momentum about the stance
foot. On the walk that repeats it is a function of the phase, and how far it is from there stays
the same over a step, whatever the speed. That difference says how far the hips are to be held back
behind the feet when the next foot lands, so that the step after loses, or gains, what is too much
or missing. The slope is that of the line between the last two footholds.

Where a foot lands otherwise than planned, the joints are off the gait. A polynomial takes up what
is missing, in place and slope, and has faded before the step ends, so that they are on the
constraints after every impact (B. Morris and J. W. Grizzle 2009, *Hybrid invariant manifolds in
systems with impulse effects with application to periodic locomotion in bipedal robots*, IEEE
Transactions on Automatic Control 54(8)).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial.chebyshev import chebval
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.compiler.compilation import kernel
from heelstrike.control.arguments import gains_of, must_be, number_of, positive
from heelstrike.control.feasible import (
    GROUND_ROWS,
    JOINT_ROWS,
    Bounds,
    Feasible,
    find_feasible_force,
    prepare,
)
from heelstrike.control.virtual_constraints import series
from heelstrike.errors import ControllerError
from heelstrike.gait.phased.family import StepFamily
from heelstrike.robot.model import Floats
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.law import Law, controller
from heelstrike.sim.controller.robot import ControlledRobot, ControlState
from heelstrike.sim.controller.stance import joint_torques
from heelstrike.sim.controller.stance_clock import StanceClock, exchange_at_touchdown, has_landed

# Phases, in parts of half a step from its middle, between which one shift goes over to the next.
BEGINS, ENDS = -0.8, 0.5
# Part of a step in which the polynomial fades.
FADES = 0.8
# The rate of the phase is taken to be no less than this part of the usual one.
LEAST_RATE = 0.3
# Part of the robot's weight that the stance foot is pressed with at least.
PRESSED = 0.1
# Joints keep within the range that they have in the family, and this much beyond (rad).
BEYOND_FAMILY = 0.5
# A foot that is less than this above the ground (m) has just stood there.
STOOD = 0.01


class Parameters(Bundle):
    """Numbers of the law; the first extent of 2 is that of the stance foot."""

    kp: Floats = array("nu")
    kd: Floats = array("nu")
    """kp, kd: Gains of ÿ = −kp y − kd ẏ (1/s², 1/s)."""
    response: float = number(float)
    """Shift, in largest ones, for an energy that is twice the usual one."""
    trust: float = number(float)
    """Part of the difference to the slope of the last step that is believed."""
    bounds: Bounds = part(Bounds)
    """What ground and joints are counted on to bear."""
    steepest: float = number(float)
    """Largest slope of the family (tangent)."""
    rate: float = number(float)
    """Usual rate of the phase just after touchdown (rad/s)."""
    level: float = number(float)
    """Usual energy at touchdown ((kg m²/s)²)."""
    phase: Floats = array(2, "nv")
    """Factors of the coordinates in θ."""
    middle: Floats = array(2, 3, 3)
    """Middle of the range of θ less what is constant in θ, by powers of slope and shift (rad)."""
    half: Floats = array(3, 3)
    """Half its width, likewise (rad)."""
    coefficients: Floats = array(2, 3, 3, "terms", "nu")
    """Chebyshev series of the joints, likewise (rad)."""
    energy: Floats = array(3, "levels")
    """Chebyshev series of the usual energy, by powers of the slope."""


class Memory(StanceClock):
    """What the law remembers; what is not named is scratch."""

    begun: int = cell(int)
    """Whether the step has begun."""
    slope: float = cell(float)
    """Slope that is believed, in steepest ones."""
    before: float = cell(float)
    shift: float = cell(float)
    """before, shift: Shift as the step began, and now, in largest ones."""
    first_phase: float = cell(float)
    """Phase at which the step began (rad)."""
    missing: Floats = array("nu")
    bend: Floats = array("nu")
    """missing, bend: What the joints, and their derivatives by θ times FADES of the width, were off
    the gait."""
    middle: Floats = array(3)
    half: Floats = array(3)
    """middle, half: Range of the phase on that slope, by powers of the shift (rad)."""
    coefficients: Floats = array(3, "terms", "nu")
    """Series of the joints on that slope, likewise (rad)."""
    energy: Floats = array("levels", 1)
    """Series of the usual energy on that slope."""
    value: Floats = array("nu")
    gradient: Floats = array("nu")
    curvature: Floats = array("nu")
    feasible: Feasible = part(Feasible)
    momentum: Floats = array(3)
    center: Floats = array("axes")


@kernel
def phase_and_rate(state: ControlState, phase: Floats, foot: int) -> tuple[float, float]:
    """θ without what is constant in it, and its rate."""
    theta, rate = 0.0, 0.0
    for j in range(phase.shape[1]):
        theta += phase[foot, j] * state.q[j]
        rate += phase[foot, j] * state.v[j]
    return theta, rate


@kernel
def take_slope(parameters: Parameters, memory: Memory) -> None:
    """Write the gaits for the slope that is believed, by powers of the shift."""
    foot, b = memory.stance, memory.slope
    for k in range(3):
        middle, half = parameters.middle[foot], parameters.half
        memory.middle[k] = middle[0, k] + b * (middle[1, k] + b * middle[2, k])
        memory.half[k] = half[0, k] + b * (half[1, k] + b * half[2, k])
        series_of = parameters.coefficients[foot]
        for m in range(series_of.shape[2]):
            for i in range(series_of.shape[3]):
                memory.coefficients[k, m, i] = series_of[0, k, m, i] + b * (
                    series_of[1, k, m, i] + b * series_of[2, k, m, i]
                )
    for m in range(parameters.energy.shape[1]):
        memory.energy[m, 0] = parameters.energy[0, m] + b * (
            parameters.energy[1, m] + b * parameters.energy[2, m]
        )


@kernel
def excess(
    state: ControlState, contacts: Contacts, robot: ControlledRobot, parameters: Parameters,
    memory: Memory, x: float,
) -> float:  # fmt: skip
    """How much energy is too much at a phase, as a part of what is usual at touchdown."""
    robot.momentum(state, memory.momentum)
    robot.center_of_mass(state, memory.center)
    place = contacts.position[robot.foot_contact[memory.stance]]
    turning = memory.momentum[2]
    turning += (memory.center[1] - place[1]) * memory.momentum[0]
    turning -= (memory.center[0] - place[0]) * memory.momentum[1]
    usual, _, _ = series(memory.energy, 0, x)
    return (0.5 * turning * abs(turning) - usual) / parameters.level


@kernel
def blend(x: float) -> tuple[float, float, float]:
    """Part of the way from one shift to the next at a phase, with its derivatives."""
    width = ENDS - BEGINS
    s = min(max((x - BEGINS) / width, 0.0), 1.0)
    left = s * (1.0 - s)
    return (
        s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * left * left / width,
        60.0 * left * (1.0 - 2.0 * s) / (width * width),
    )


@kernel
def place_in_gait(
    memory: Memory, theta: float, t: float, t1: float, t2: float
) -> tuple[float, float, float]:
    """Where in the step a phase is with the shift t, from −1 to 1, with derivatives by θ."""
    m, h = memory.middle, memory.half
    half = h[0] + t * (h[1] + t * h[2])
    m1, h1 = (m[1] + 2.0 * t * m[2]) * t1, (h[1] + 2.0 * t * h[2]) * t1
    m2 = (m[1] + 2.0 * t * m[2]) * t2 + 2.0 * m[2] * t1 * t1
    h2 = (h[1] + 2.0 * t * h[2]) * t2 + 2.0 * h[2] * t1 * t1
    x = (theta - m[0] - t * (m[1] + t * m[2])) / half
    x1 = (1.0 - m1 - x * h1) / half
    return x, x1, -(m2 + 2.0 * x1 * h1 + x * h2) / half


@kernel
def follow(memory: Memory, theta: float, t: float, t1: float, t2: float) -> None:
    """Write the joints of the gait at a phase, with the shift t there, and derivatives by θ."""
    x, x1, x2 = place_in_gait(memory, theta, t, t1, t2)
    for i in range(memory.value.shape[0]):
        value, gradient, curvature = 0.0, 0.0, 0.0
        power, power1, power2 = 1.0, 0.0, 0.0
        for k in range(3):
            s, s1, s2 = series(memory.coefficients[k], i, x)
            value += power * s
            gradient += power1 * s + power * s1 * x1
            curvature += power2 * s + 2.0 * power1 * s1 * x1
            curvature += power * (s2 * x1 * x1 + s1 * x2)
            power, power1, power2 = (
                power * t, power1 * t + power * t1, power2 * t + 2.0 * power1 * t1 + power * t2
            )  # fmt: skip
        memory.value[i], memory.gradient[i], memory.curvature[i] = value, gradient, curvature


@kernel
def ahead_of_swing(state: ControlState, parameters: Parameters, memory: Memory) -> float:
    """How far (rad) the swing foot is on the side to which the robot goes."""
    _, rate = phase_and_rate(state, parameters.phase, memory.stance)
    swing = 1 - memory.stance
    theta, _ = phase_and_rate(state, parameters.phase, swing)
    middle = parameters.middle[swing, 0, 0]
    return middle - theta if rate >= 0.0 else theta - middle


@kernel
def shift_at_end(memory: Memory, theta: float) -> float:
    """Shift with which a phase is where a step begins or, of the rear foot, ends."""
    side = -1.0 if theta < memory.middle[0] else 1.0
    a = memory.middle[2] + side * memory.half[2]
    b = memory.middle[1] + side * memory.half[1]
    c = memory.middle[0] + side * memory.half[0] - theta
    t = 0.0
    for _ in range(4):  # it is all but linear
        t -= (c + t * (b + t * a)) / (b + 2.0 * a * t)
        t = min(max(t, -1.0), 1.0)
    return t


@kernel
def begin_step(
    state: ControlState, contacts: Contacts, robot: ControlledRobot, parameters: Parameters,
    memory: Memory,
) -> None:  # fmt: skip
    """Look at the footholds: which gait of the family begins here."""
    here = robot.foot_contact[memory.stance]
    there = robot.foot_contact[1 - memory.stance]
    length = contacts.position[here, 0] - contacts.position[there, 0]
    landed = contacts.gap[there] < STOOD and abs(length) > STOOD
    if landed:
        found = (contacts.position[here, 1] - contacts.position[there, 1]) / length
        found = min(max(found / parameters.steepest, -1.0), 1.0)
        memory.slope += parameters.trust * (found - memory.slope)
    take_slope(parameters, memory)
    theta, _ = phase_and_rate(state, parameters.phase, memory.stance)
    memory.before = shift_at_end(memory, theta) if landed else 0.0
    memory.begun = 1
    memory.landed = 0


@kernel
def note_missing(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory,
) -> None:  # fmt: skip
    """Note how far the joints are from the gait, until the impact that began the step is over.

    Where the ground gives way, velocities before it are seen, and between.
    """
    theta, rate = phase_and_rate(state, parameters.phase, memory.stance)
    rate = max(rate, LEAST_RATE * parameters.rate)
    memory.first_phase = theta
    follow(memory, theta, memory.before, 0.0, 0.0)
    for i in range(robot.nu):
        memory.missing[i] = state.joint_position[i] - memory.value[i]
        memory.bend[i] = state.joint_velocity[i] / rate - memory.gradient[i]
        memory.bend[i] *= 2.0 * FADES * memory.half[0]
    has_landed(t, math.inf, state, contacts, robot, memory)


@kernel
def take_up(memory: Memory, theta: float) -> None:
    """Add what the joints were off the gait as the step began, faded, and its derivatives."""
    width = 2.0 * FADES * memory.half[0]
    u = (theta - memory.first_phase) / width
    if u >= 1.0:
        return
    left = 1.0 - u
    for i in range(memory.value.shape[0]):
        missing, bend = memory.missing[i], memory.bend[i]
        if u < 0.0:
            memory.value[i] += missing + bend * u
            memory.gradient[i] += bend / width
            continue
        # (1 − u)³ (missing + (bend + 3 missing) u): it ends without slope and curvature.
        along = bend + 3.0 * missing
        inner = missing + along * u
        memory.value[i] += left * left * left * inner
        memory.gradient[i] += left * left * (left * along - 3.0 * inner) / width
        memory.curvature[i] += 6.0 * left * (inner - left * along) / (width * width)


@controller
def stepping_constraints(
    t: float, state: ControlState, contacts: Contacts, robot: ControlledRobot,
    parameters: Parameters, memory: Memory, torque: Floats,
) -> None:  # fmt: skip
    """Joint torques that follow the gait of a family which brings the energy back."""
    ahead = ahead_of_swing(state, parameters, memory)
    if memory.begun == 0:
        prepare(memory.feasible.program)
        begin_step(state, contacts, robot, parameters, memory)
    elif exchange_at_touchdown(t, ahead, 0.0, contacts, robot.contact_foot, memory):
        begin_step(state, contacts, robot, parameters, memory)
    if memory.landed == 0:
        note_missing(t, state, contacts, robot, parameters, memory)
    theta, rate = phase_and_rate(state, parameters.phase, memory.stance)
    half = memory.half[0]
    x = (theta - memory.middle[0]) / half
    share, share1, share2 = blend(x)
    aim = math.tanh(parameters.response * excess(state, contacts, robot, parameters, memory, x))
    change = aim - memory.before
    memory.shift = memory.before + share * change
    follow(memory, theta, memory.shift, share1 * change / half, share2 * change / (half * half))
    if memory.landed == 1:
        take_up(memory, theta)
    feasible = memory.feasible
    for i in range(robot.nu):
        error = state.joint_position[i] - memory.value[i]
        error_rate = state.joint_velocity[i] - memory.gradient[i] * rate
        feasible.slope[i] = memory.gradient[i]
        feasible.wanted[i] = memory.curvature[i] * rate * rate
        # An impact that takes a while is not fought: no motor is a match for it.
        if memory.landed == 1:
            feasible.wanted[i] -= parameters.kp[i] * error + parameters.kd[i] * error_rate
    find_feasible_force(
        state, contacts, robot, parameters.phase, memory.stance, parameters.bounds, memory.feasible
    )
    joint_torques(robot, torque)


class SteppingConstraints(Law):
    """Walk on point feet by virtual constraints, with footstep feedback.

    Parameters
    ----------
    family : StepFamily
        The gaits, with the robot they are for.
    kp, kd : float or (nu,) float
        Gains of ÿ = −kp y − kd ẏ, in 1/s² and 1/s.
    response : float
        How far the hips are held back, in the family's largest shifts, for an energy σ²/2 that is
        twice the usual one; much more is answered by no more than the largest shift.
    trust : float
        Part of the difference between the slope of the last step and the one believed that is
        believed, from 0 to 1.
    friction : float
        Friction that the law counts on. Where the constraints ask for more of the stance foot, for
        less than a tenth of the weight, for more than a motor has, or drive a joint beyond what the
        family does with it, joints are accelerated otherwise, by as little as that takes.

    Raises
    ------
    ControllerError
        If gains do not fit the robot, or a number is out of its range.

    Notes
    -----
    Joints near the ends of those ranges at up to 100/s. Called less often than every 5 ms they do
    by no more than half of what is left from call to call, since torques are held meanwhile.
    """

    def __init__(
        self,
        family: StepFamily,
        *,
        kp: ArrayLike = 900.0,
        kd: ArrayLike = 60.0,
        response: float = 0.45,
        trust: float = 0.5,
        friction: float = 0.6,
    ) -> None:
        must_be(StepFamily, "family", family)
        gait = family.gait
        robot = gait.robot
        for name, value in (("response", response), ("trust", trust)):
            number_of(name, value)
        friction = positive("friction", friction)
        if not (0.0 <= response < np.inf and 0.0 <= trust <= 1.0):
            raise ControllerError(
                "response must not be negative and trust lies from 0 to 1; got "
                f"response={response!r}, trust={trust!r}"
            )
        phase, constant = gait.on_both_feet()
        middle = np.stack([family.middle, family.middle])
        middle[:, 0, 0] -= constant
        parameters = Parameters(
            kp=gains_of("kp", kp, robot),
            kd=gains_of("kd", kd, robot),
            response=float(response),
            trust=float(trust),
            bounds=_bounds(family, friction),
            steepest=family.slope,
            rate=family.rate,
            level=float(family.energy[0].sum()),
            phase=phase,
            middle=middle,
            half=family.half,
            coefficients=family.coefficients_on_both_feet(),
            energy=family.energy,
        )
        memory = {
            "stance": gait.stance_foot,
            "terms": len(gait.coefficients),
            "levels": family.energy.shape[1],
            "n": robot.nu,
            "m": GROUND_ROWS + JOINT_ROWS * robot.nu,
        }
        super().__init__(stepping_constraints, parameters, memory=memory, robot=robot)
        self.family = family


def _bounds(family: StepFamily, friction: float) -> Bounds:
    """Bounds of the law: joints go where they do in one of the nine gaits."""
    series_of, places = family.coefficients_on_both_feet(), np.linspace(-1.0, 1.0, 65)
    lower, upper = np.inf, -np.inf
    for b in (-1.0, 0.0, 1.0):
        for t in (-1.0, 0.0, 1.0):
            powers = np.outer([1.0, b, b * b], [1.0, t, t * t])
            own = np.tensordot(series_of, powers, ((1, 2), (0, 1)))
            joints = chebval(places, np.moveaxis(own, 1, 0))
            lower = np.minimum(lower, joints.min(axis=(0, 2)))
            upper = np.maximum(upper, joints.max(axis=(0, 2)))
    return Bounds(
        friction=friction,
        press=PRESSED * family.gait.robot.weight,
        lower=lower - BEYOND_FAMILY,
        upper=upper + BEYOND_FAMILY,
    )
