"""Steps of the smooth motion, and where in them an event function changes its sign.

The event functions of a contact point are positive while it keeps its mode: the gap of an open
point; the normal force of a closed one; the speed of a sliding one; what is left to the friction
limit of a sticking one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.dormand_prince import (
    NODES,
    SLOPES,
    STAGES,
    error_norm,
    fit_dense,
    interpolate,
    stage_point,
)
from heelstrike.sim.event_driven.dynamics import evaluate
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Memory

NO_EVENT = 2.0
"""A fraction of a step beyond its end."""

SAMPLES = 4
"""Places in a step, evenly spaced, at which the event functions are looked at."""

EVENT_TIME = 1e-12
"""Seconds to which events are located."""

# How far an event function must be below zero to count: m, m/s, and a fraction of the weight.
GAP_NOISE = 1e-13
SPEED_NOISE = 1e-12
FORCE_NOISE = 1e-10


# Shortest step as a multiple of the rounding of time.
SHORTEST_STEP = 8.0


@kernel
def shortest_step(time: float) -> float:
    """Length below which a step would not move time on by a meaningful number."""
    return SHORTEST_STEP * 2.2e-16 * max(abs(time), 1e-3)


@kernel
def take_step(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    memory: Memory,
    phase: Phase,
    length: float,
) -> float:
    """Try a step of the given length from ``phase.begin``; return its error over the tolerance.

    ``phase.slopes[0]`` must be the slope at the start. A step that is good enough gets its dense
    output; event functions and forces are left as they are at its end.
    """
    time = phase.time
    error = 0.0
    for stage in range(1, SLOPES):
        at_end = stage == STAGES
        state = phase.end if at_end else phase.trial
        stage_point(stage, length, phase.begin, phase.slopes, state)
        evaluate(
            controller, control, model, ground, memory, phase,
            time + NODES[stage] * length, state, phase.slopes[stage], True,
        )  # fmt: skip
        if at_end:
            error = error_norm(
                length, phase.begin, phase.end, phase.slopes, phase.relative,
                phase.absolute,
            )  # fmt: skip
            if not error <= 1.0:
                return error
            for i in range(phase.value.shape[0]):
                phase.end_value[i] = phase.value[i]
                phase.end_rate[i] = phase.rate[i]
            for contact in range(phase.closed.shape[0]):
                phase.end_force[contact, 0] = phase.force[contact, 0]
                phase.end_force[contact, 1] = phase.force[contact, 1]
            for i in range(memory.torque.shape[0]):
                phase.torque[i] = memory.torque[i]
    fit_dense(length, phase.begin, phase.end, phase.slopes, phase.dense)
    return error


@kernel
def noise(closed: int, slide: int, function: int, weight: float) -> float:
    """How far an event function may be below zero without meaning it."""
    if closed == 0:
        return GAP_NOISE
    if function % 2 == 1 and slide != 0:
        return SPEED_NOISE
    return FORCE_NOISE * weight


@kernel
def find_root(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    memory: Memory,
    phase: Phase,
    length: float,
    function: int,
    low: float,
    low_value: float,
    high: float,
    high_value: float,
    of_rate: bool,
) -> float:
    """Fraction of the step at which an event function, or its rate, first changes sign.

    It is positive (its rate negative) at `low` and the other way round at `high`. Regula falsi
    that halves the interval every third time. An event function that is zero at `low`, where its
    phase begins, is first followed back from `high` to where it is positive.
    """
    contact = function // 2
    geometric = phase.closed[contact] == 0 or (function % 2 == 1 and phase.slide[contact] != 0)
    width = EVENT_TIME / length
    going_back = low_value <= 0.0
    for attempt in range(200):
        if high - low <= (0.1 * width if going_back else width):
            break
        part = low + 0.5 * (high - low)
        if attempt % 3 != 2 and not going_back:
            part = high - high_value * (high - low) / (high_value - low_value)
            part = min(max(part, low + 0.4 * width), high - 0.4 * width)
        interpolate(part, phase.begin, phase.dense, phase.trial)
        evaluate(
            controller, control, model, ground, memory, phase,
            phase.time + part * length, phase.trial, phase.slopes[SLOPES - 1],
            not geometric,
        )  # fmt: skip
        value = -phase.rate[function] if of_rate else phase.value[function]
        if value > 0.0:
            low = part
            low_value = value
            going_back = False
        else:
            high = part
            high_value = value
    return low if going_back else high


@kernel
def first_event(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    memory: Memory,
    phase: Phase,
    length: float,
    weight: float,
) -> float:
    """Fraction of the step just taken at which the first event happens, or ``NO_EVENT``.

    The event functions that vanish there are marked in ``phase.fired``. ``phase.before`` and
    ``phase.before_rate`` must hold the event functions at the start of the step.
    """
    functions = phase.value.shape[0]
    for i in range(functions):
        phase.fired[i] = 0
    low = 0.0
    for k in range(1, SAMPLES + 1):
        high = k / SAMPLES
        if k < SAMPLES:
            interpolate(high, phase.begin, phase.dense, phase.trial)
            evaluate(
                controller, control, model, ground, memory, phase,
                phase.time + high * length, phase.trial, phase.slopes[SLOPES - 1], True,
            )  # fmt: skip
            for i in range(functions):
                phase.sample[i] = phase.value[i]
                phase.sample_rate[i] = phase.rate[i]
        else:
            for i in range(functions):
                phase.sample[i] = phase.end_value[i]
                phase.sample_rate[i] = phase.end_rate[i]
        first = NO_EVENT
        for i in range(functions):
            contact = i // 2
            end = high
            value = phase.sample[i]
            if (
                i % 2 == 0
                and phase.closed[contact] == 0
                and phase.before_rate[i] < 0.0
                and phase.sample_rate[i] > 0.0
                and value >= 0.0
            ):
                # An open point came down and went up again: how close was it?
                end = find_root(
                    controller, control, model, ground, memory, phase, length, i,
                    low, -phase.before_rate[i], high, -phase.sample_rate[i], True,
                )  # fmt: skip
                value = phase.value[i]
            if value < -noise(phase.closed[contact], phase.slide[contact], i, weight):
                root = find_root(
                    controller, control, model, ground, memory, phase, length, i,
                    low, phase.before[i], end, value, False,
                )  # fmt: skip
                if root < first - EVENT_TIME / length:
                    for j in range(i):
                        phase.fired[j] = 0
                    first = root
                if root <= first + EVENT_TIME / length:
                    phase.fired[i] = 1
        if first < NO_EVENT:
            return first
        for i in range(functions):
            phase.before[i] = phase.sample[i]
            phase.before_rate[i] = phase.sample_rate[i]
        low = high
    return NO_EVENT


@kernel
def integrate(
    controller: Any,
    control: Control,
    model: Model,
    ground: GroundModel,
    memory: Memory,
    phase: Phase,
    stop: float,
) -> bool:
    """Take one good step that ends at its first event, or at `stop` at the latest.

    ``phase.slopes[0]`` must be the slope now, and the event functions those of now. Returns false
    if the step would have to be too short.
    """
    time = phase.time
    weight = total_weight(model.mass, model.gravity)
    for i in range(phase.value.shape[0]):
        phase.before[i] = phase.value[i]
        phase.before_rate[i] = phase.rate[i]
    wish = min(phase.next_length, phase.longest)
    length = wish
    rejected = False
    factor = 1.0
    repeated = False
    while not repeated:
        while True:
            if time + 1.0001 * length >= stop:
                length = stop - time
            if length < shortest_step(time):
                return False
            error = take_step(controller, control, model, ground, memory, phase, length)
            factor = 10.0 if error == 0.0 else min(10.0, 0.9 * error**-0.125)
            if error <= 1.0:
                break
            length *= max(0.2, factor) if error < np.inf else 0.1
            rejected = True
        if rejected:
            phase.next_length = length * min(factor, 1.0)
        else:  # a step cut short by a stop says little about how long the next may be
            phase.next_length = max(min(wish, 10.0 * length), length * factor)
        part = first_event(controller, control, model, ground, memory, phase, length, weight)
        phase.has_fired = 0
        if part == NO_EVENT:
            break
        phase.has_fired = 1
        length *= part
        # Repeat the step to end at the event, and correct its length by what is left there.
        for attempt in range(4):
            error = take_step(controller, control, model, ground, memory, phase, length)
            repeated = error <= 1.0
            if not repeated:
                break
            change = 0.0
            for i in range(phase.fired.shape[0]):
                contact = i // 2
                geometric = phase.closed[contact] == 0 or (i % 2 == 1 and phase.slide[contact] != 0)
                if phase.fired[i] == 1 and geometric and phase.end_rate[i] < 0.0:
                    change = -phase.end_value[i] / phase.end_rate[i]
            change = max(change, -length)
            if attempt == 3 or not 1e-15 < abs(change) < 1e-6:
                break
            length += change
        if not repeated:
            # Where a torque saturates the shorter step can be the worse one: take less of it.
            length *= 0.5
            rejected = True
            evaluate(
                controller, control, model, ground, memory, phase, time,
                phase.begin, phase.slopes[0], True,
            )  # fmt: skip
            for i in range(phase.value.shape[0]):
                phase.before[i] = phase.value[i]
                phase.before_rate[i] = phase.rate[i]
    phase.length = length
    phase.finished = 1
    return True


@kernel
def total_weight(mass: Floats, gravity: Floats) -> float:
    """Weight of the robot, or its mass where there is no gravity."""
    total = 0.0
    for i in range(mass.shape[0]):
        total += mass[i]
    size = np.sqrt(gravity[0] ** 2 + gravity[1] ** 2)
    return total * size if size > 0.0 else total
