"""Steps of the smooth motion, each to its first event at the longest."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.faces import Located
from heelstrike.sim.contacts.rows import SECOND_FACE, Rows
from heelstrike.sim.event_driven.dormand_prince import (
    NODES,
    SLOPES,
    STAGES,
    error_norm,
    fit_dense,
    stage_point,
)
from heelstrike.sim.event_driven.location import (
    NO_EVENT,
    TOGETHER,
    copy_events,
    first_event,
    is_geometric,
    noise,
)
from heelstrike.sim.event_driven.phase import Integration, Modes, Phase, Step, Watch
from heelstrike.sim.event_driven.smooth.dynamics import evaluate, look
from heelstrike.sim.event_driven.smooth.faces import has_corners, rate_corners
from heelstrike.sim.event_driven.smooth.projection import EXPLAINED, explained, project
from heelstrike.sim.memory import Assembly, Equations, Loops, Surface

# An event function that is nearer to zero than this part of its noise is zero.
NEAR_ENOUGH = 0.1
# How often a step is looked through for its first event.
ATTEMPTS = 3
# How much a step is shortened whose end does not fit its constraints.
SHORTENED = 0.25
# Angle (rad) by which links may turn in a step. What turns freely makes no error however long the
# step is, and its points would be in the ground and out of it between two samples.
TURN = 4.0
# Shortest step as a multiple of the rounding of time, relative; times near zero count as this (s).
SHORTEST_STEP, ROUNDING, EARLY = 8.0, 2.2e-16, 1e-3
# The error of a step grows with its length to the power 8. How much longer the next step may be at
# most, how much shorter at least, and with what safety: as SciPy's integrators have them; how much
# shorter where the error is no number.
ORDER, MOST, LEAST, SAFETY, NO_NUMBER = -0.125, 10.0, 0.2, 0.9, 0.1
# A step that would end this near before a stop, relative, goes on to it: no step is left over.
ALMOST = 1.0001


@kernel
def longest_good_step(length: float, stop: float, taken: Integration) -> tuple[float, float, bool]:
    """Take a step of some length or, if it is not good enough, a shorter one.

    Returns its length, zero if it would have to be too short; how much longer the next may be; and
    whether any was rejected.
    """
    rejected, begin = False, taken.step.time
    while True:
        if begin + ALMOST * length >= stop:
            length = stop - begin
        if length < shortest_step(begin):
            return 0.0, 1.0, rejected
        error = take_step(length, taken)
        factor = MOST if error == 0.0 else min(MOST, SAFETY * error**ORDER)
        if error <= 1.0:
            return length, factor, rejected
        length *= max(LEAST, factor) if error < np.inf else NO_NUMBER
        rejected = True


@kernel
def take_step(length: float, taken: Integration) -> float:
    """Try a step of the given length from ``step.begin``; return its error over the tolerance.

    ``step.slopes[0]`` must be the slope at the start. A step that is good enough gets its dense
    output; event functions and forces are left as they are at its end.
    """
    memory, phase, step = taken.memory, taken.phase, taken.step
    watch, force, samples = phase.watch, phase.forces.force, step.samples
    error = 0.0
    for stage in range(1, SLOPES):
        at_end = stage == STAGES
        state = step.end if at_end else step.point
        stage_point(stage, length, step.begin, step.slopes, state)
        time = step.time + NODES[stage] * length
        evaluate(taken.scene, time, state, taken.control, memory, phase, step.slopes[stage])
        if at_end:
            error = error_norm(
                length, step.begin, step.end, step.slopes, step.relative, step.absolute
            )
            if not error <= 1.0:
                return error
            copy_events(watch.value, watch.rate, samples.end_value, samples.end_rate)
            copy_words(force, step.end_force)
            copy_words(memory.torque, step.torque)
    fit_dense(length, step.begin, step.end, step.slopes, step.dense)
    return error


@kernel
def settle(
    model: Model, ground: GroundModel, equations: Equations, rows: Rows, surface: Surface,
    assembly: Assembly, loops: Loops, phase: Phase, step: Step,
) -> bool:  # fmt: skip
    """Put the end of the step on its constraints; return whether its error explains how far."""
    copy_words(step.end, step.unsettled)
    left, _, _ = project(model, ground, equations, rows, surface, assembly, loops, phase, step.end)
    fits = explained(step.unsettled, step.end, EXPLAINED, step.relative, step.absolute)
    return left <= max(TOGETHER, 2.0 * step.left) and fits


@kernel
def end_at_event(length: float, taken: Integration) -> tuple[float, bool, bool]:
    """Repeat the step to end at the event, and correct its length by what is left there.

    Returns the length, whether the step is good enough, and whether its end fits its constraints.
    """
    model, ground, memory = taken.scene.model, taken.scene.ground, taken.memory
    modes, watch, step = taken.phase.modes, taken.phase.watch, taken.step
    value, rate, fired, tree = watch.value, watch.rate, watch.fired, memory.equations.tree
    rows = memory.rows
    for attempt in range(4):
        if not take_step(length, taken) <= 1.0:
            return length, False, True
        if not settle(
            model, ground, memory.equations, memory.rows, memory.surface, memory.assembly,
            memory.loops, taken.phase, step,
        ):  # fmt: skip
            return length, True, False
        look(step.end, model, ground, tree, rows, modes, memory.surface, watch)
        if has_corners(ground):
            rate_corners(
                model, ground, tree, modes.watched, rows.first[SECOND_FACE],
                Located(rows.gap, rows.position, rows.normal), modes.closed, modes.face, fired,
                rate,
            )  # fmt: skip
        change = 0.0
        for i in range(fired.shape[0]):
            passes = fired[i] == 1 and is_geometric(i, modes) and rate[i] < 0.0
            least = NEAR_ENOUGH * noise(i, modes, watch.force_scale, step.samples)
            if passes and abs(value[i]) > least:
                change = -value[i] / rate[i]
        # Where it turns round rather than passes zero, its rate does not tell where zero is.
        if attempt == 3 or change == 0.0 or abs(change) > 0.5 * length:
            break
        length += change
    return length, True, True


@kernel
def missed(modes: Modes, watch: Watch) -> bool:
    """Whether a point is in the ground at the end of a step that ends with another's event.

    The step is not the one on whose dense output that was found first.
    """
    for contact in range(modes.watched):
        gap = watch.value[2 * contact]
        if modes.closed[contact] == 0 and watch.fired[2 * contact] == 0 and gap < -TOGETHER:
            return True
    return False


@kernel
def look_back(taken: Integration) -> None:
    """Evaluate the beginning of the step again."""
    step, phase = taken.step, taken.phase
    watch, samples = phase.watch, step.samples
    evaluate(taken.scene, step.time, step.begin, taken.control, taken.memory, phase, step.slopes[0])
    copy_events(watch.value, watch.rate, samples.before, samples.before_rate)


@kernel
def longest_turn(model: Model, motion: Floats, state: Floats) -> float:
    """Length (s) of a step in which no link turns by more than is looked at."""
    speed = 0.0
    for i in range(model.nv):
        speed += abs(motion[i, 0] * state[model.nq + i])
    return TURN / speed if speed > 0.0 else np.inf


@kernel
def integrate(stop: float, taken: Integration) -> bool:
    """Take one good step that ends at its first event, or at `stop` at the latest.

    ``step.slopes[0]`` must be the slope now, and the event functions those of now. Returns false
    if the step would have to be too short.
    """
    scene, memory, step = taken.scene, taken.memory, taken.step
    modes, watch = taken.phase.modes, taken.phase.watch
    copy_events(watch.value, watch.rate, step.samples.before, step.samples.before_rate)
    wish = min(step.next_length, step.longest)
    length = wish
    rejected = False
    while True:
        length, factor, shortened = longest_good_step(length, stop, taken)
        if length == 0.0:
            return False
        rejected = rejected or shortened
        if rejected:
            step.next_length = length * min(factor, 1.0)
        else:  # a step cut short by a stop says little about how long the next may be
            step.next_length = max(min(wish, MOST * length), length * factor)
        part = first_event(length, taken)
        step.has_fired = 0 if part == NO_EVENT else 1
        good, fits = True, True
        for _ in range(ATTEMPTS):
            if part == NO_EVENT:
                break
            length, good, fits = end_at_event(length * part, taken)
            if not (good and fits and missed(modes, watch)):
                break
            look_back(taken)
            part = first_event(length, taken)
            step.has_fired = 0 if part == NO_EVENT else 1
        if step.has_fired == 0:
            fits = settle(
                scene.model, scene.ground, memory.equations, memory.rows, memory.surface,
                memory.assembly, memory.loops, taken.phase, step,
            )  # fmt: skip
        if good and fits:
            break
        # Where a torque saturates the shorter step can be the worse one: take less of it.
        length *= SHORTENED if good else 0.5
        rejected = True
        look_back(taken)
    step.length = length
    step.finished = 1
    return True


@kernel
def shortest_step(time: float) -> float:
    """Length below which a step would not move time on by a meaningful number."""
    return SHORTEST_STEP * ROUNDING * max(abs(time), EARLY)
