"""Time moves on: by a step to the next event, or by a bridge where events pile up."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.rows import POINT, SECOND_FACE, Rows
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.bridge import SHORTEST_BRIDGE, cross_bridge
from heelstrike.sim.event_driven.deciding import INSISTENT
from heelstrike.sim.event_driven.events import meet_event
from heelstrike.sim.event_driven.location import EVENT_TIME
from heelstrike.sim.event_driven.phase import Decision, Integration, Motion
from heelstrike.sim.event_driven.rows import NO_ROOM, TOO_FAR, write_row, write_rows_within
from heelstrike.sim.event_driven.smooth.corners import show_forces
from heelstrike.sim.event_driven.smooth.dynamics import evaluate
from heelstrike.sim.event_driven.steps import ALMOST, integrate, longest_turn, shortest_step
from heelstrike.sim.frame import DONE, FORK, RECORD_FULL, SOLVER_FAILED, Scene
from heelstrike.sim.memory import Memory
from heelstrike.sim.record.record import Record, Told
from heelstrike.sim.record.recording import log_event

ZENO = int(EventKind.ZENO)
# An event is followed by another in the same instant when less than this (s) lies between.
INSTANT = 1e-10
# Events that may follow each other at once, and at once behind a bridge; how many more as time goes
# on, 1/s; steps too short to see count as a part of an event. What is more calls for a bridge.
EVENTS_AT_ONCE, EVENTS_A_BRIDGE = 200.0, 50.0
EVENTS_A_SECOND = 1e5
SHORT_STEP = 1e-6
SHORT_PART = 0.01  # of the longest
SHARE_OF_A_STEP = 0.2
# Length (s) of the first step that is tried behind a bridge, or where none could be taken: that of
# the shortest bridge.
AFRESH = SHORTEST_BRIDGE
# Two times are one when they differ by the rounding of an addition (nearly twice 2⁻⁵²), relative,
# or relative to this (s) of those near zero.
SAME_TIME, EARLY = 4e-16, 1e-3
# Why the loop gave up.
NO_BRIDGE = 1


@kernel
def next_stop(watched: int, accumulation: Floats, next_push: float, clock: Clock) -> float:
    """Time that the next step may not pass: the end, or when something is due.

    That is from outside, or the end of the bounces of what is `watched`.
    """
    stop = min(clock.until, next_push)
    if clock.control_period > 0.0:
        stop = min(stop, clock.calls * clock.control_period)
    for contact in range(watched):
        stop = min(stop, accumulation[contact])
    return stop


@kernel
def end_bounces(rows: Rows, watched: int, time: float, accumulation: Floats, told: Told) -> None:
    """Let the points rest whose accumulating impacts have come to an end by now."""
    for contact in range(watched):
        if accumulation[contact] <= time:
            if rows.kind[contact] in (POINT, SECOND_FACE):
                point = rows.owner[contact]
                log_event(accumulation[contact], ZENO, point, 0.0, 0.0, told)
            accumulation[contact] = np.inf


@kernel
def pass_time(time: float, length: float, stop: float, allowance: float) -> tuple[float, float]:
    """Let time move on, to `stop` if that is the same but for rounding; events are allowed for."""
    time += length
    if abs(time - stop) <= SAME_TIME * max(abs(stop), EARLY):
        time = stop
    return time, min(allowance + EVENTS_A_SECOND * length, EVENTS_AT_ONCE)


@kernel
def count_event(
    length: float, longest: float, time: float, fired: bool, decision: Decision
) -> None:
    """Count an event at the end of a step, or a step too short to see."""
    if fired:
        together = time - decision.last_event < INSTANT
        decision.burst = decision.burst + 1 if together else 0
        decision.last_event = time
        decision.allowance -= 1.0
    elif length < min(SHORT_STEP, SHORT_PART * longest):
        decision.allowance -= SHARE_OF_A_STEP


@kernel
def show_state(model: Model, begin: Floats, q: Floats, v: Floats) -> None:
    """Let the frame see the state now."""
    for i in range(model.nv):
        q[i] = begin[i]
        v[i] = begin[model.nq + i]


@kernel
def move_over(
    scene: Scene, stop: float, control: Control, memory: Memory, work: Motion, record: Record,
    clock: Clock,
) -> int:  # fmt: skip
    """Leave an instant by a bridge, behind which it is looked for what there is to be met."""
    phase, step, bounces, series = work.phase, work.step, work.bounces, work.series
    output, decision, fired = work.output, work.decision, work.phase.watch.fired
    model, begin = scene.model, step.begin
    end = stop
    if output.period > 0.0:  # a row is due no later than at its end
        period = output.period * output.every
        due = output.next_row * period
        end = min(stop, due if due > step.time + EVENT_TIME else due + period)
    first = record.told.events
    if not cross_bridge(scene, end, control, memory, work, record):
        series.reason = NO_BRIDGE
        return SOLVER_FAILED
    react(model, first, begin[: model.nq], record.told, memory.loops.held)
    step.time, _ = pass_time(step.time, series.length, end, decision.allowance)
    clock.time = series.last_end = time = step.time
    for contact in range(phase.modes.watched):
        if bounces.accumulation[contact] <= time:
            bounces.accumulation[contact] = np.inf
    memory.tally.steps += 1
    for i in range(fired.shape[0]):
        fired[i] = 0
    decision.burst = 0
    decision.allowance = EVENTS_A_BRIDGE
    step.next_length = AFRESH
    write_row(scene, False, control, memory, work, record)
    evaluate(scene, time, begin, control, memory, phase, step.slopes[0])
    meet_event(False, model, scene.ground, memory, work, record)
    show_state(model, begin, memory.q, memory.v)
    return DONE


@kernel
def jam(model: Model, slide: Integers, decision: Decision) -> bool:
    """Leave it to a jump of the velocity to end forces that grow without bound before a pole.

    Only a sliding point has such; returns whether there is one. Where steps are as short for
    another reason, as under a torque that switches, no jump ends it however often it is tried.
    """
    for contact in range(model.nc):
        if slide[contact] != 0:
            decision.jammed = 1
            decision.undecided = 1
    decision.burst += 1
    return decision.jammed == 1 and decision.burst <= INSISTENT


@kernel
def move(
    scene: Scene, control: Control, memory: Memory, work: Motion, record: Record, clock: Clock
) -> int:
    """Take a step to the next event, at the longest to where something is due."""
    phase, step, decision, impact = work.phase, work.step, work.decision, work.impact
    model, rows, watched = scene.model, memory.rows, phase.modes.watched
    accumulation, output = work.bounces.accumulation, work.output
    taken = Integration(scene, control, memory, phase, step)
    if step.finished == 0:
        bridging = decision.bridging == 1
        stop = next_stop(0 if bridging else watched, accumulation, decision.next_push, clock)
        if stop - step.time < shortest_step(step.time):
            # The same time but for rounding: 0.3 for one, 3 · 0.1 for the other.
            step.time = clock.time = stop
            end_bounces(rows, watched, step.time, accumulation, record.told)
            return DONE
        turn = longest_turn(model, memory.equations.tree.motion, step.begin)
        step.next_length = min(step.next_length, turn)
        wish = step.longest if bridging else min(step.next_length, step.longest)
        if clock.forked == 0 and stop == clock.until and step.time + ALMOST * wish >= stop:
            clock.forked = 1
            return FORK
        if bridging:
            return move_over(scene, stop, control, memory, work, record, clock)
        if not integrate(stop, taken):
            if not jam(model, phase.modes.slide, decision):
                decision.bridging = 1
            step.next_length = AFRESH
            return DONE
    written = write_rows_within(impact.meets, output, record, taken)
    if written == NO_ROOM:
        return RECORD_FULL
    if written == TOO_FAR:  # the step is taken again, to end there
        step.finished = 0
        return DONE
    stop = next_stop(watched, accumulation, decision.next_push, clock)
    step.time, decision.allowance = pass_time(step.time, step.length, stop, decision.allowance)
    copy_words(step.end, step.begin)
    show_forces(step.end_force, rows, impact.meets, memory.contacts.force)
    end_bounces(rows, watched, step.time, accumulation, record.told)
    step.finished = 0
    memory.tally.steps += 1
    count_event(step.length, step.longest, step.time, step.has_fired == 1, decision)
    clock.time = step.time
    if step.has_fired == 1:
        evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
        meet_event(False, model, scene.ground, memory, work, record)
    if decision.allowance < 0.0:
        stuck = step.has_fired == 0 and step.length < EVENT_TIME
        if stuck and jam(model, phase.modes.slide, decision):
            decision.allowance = EVENTS_A_BRIDGE
        else:
            decision.bridging = 1
    show_state(model, step.begin, memory.q, memory.v)
    return DONE
