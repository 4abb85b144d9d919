"""Time moves on: by a step to the next event, or by a bridge where events pile up."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.rows import (
    POINT,
    SECOND_FACE,
    Rows,
)
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.bridge import SHORTEST_BRIDGE, cross_bridge
from heelstrike.sim.event_driven.deciding import INSISTENT
from heelstrike.sim.event_driven.events import meet_event
from heelstrike.sim.event_driven.location import EVENT_TIME
from heelstrike.sim.event_driven.phase import Decision, Motion, Step
from heelstrike.sim.event_driven.rows import NO_ROOM, TOO_FAR, write_row, write_rows_within
from heelstrike.sim.event_driven.smooth.corners import show_forces
from heelstrike.sim.event_driven.smooth.dynamics import evaluate
from heelstrike.sim.event_driven.steps import ALMOST, integrate, longest_turn, shortest_step
from heelstrike.sim.frame import DONE, FORK, RECORD_FULL, SOLVER_FAILED, Scene
from heelstrike.sim.memory import Memory, Tally
from heelstrike.sim.record.record import Record
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
def next_due(next_push: float, clock: Clock) -> float:
    """Time at which something from outside is due, or the end."""
    stop = min(clock.until, next_push)
    if clock.control_period > 0.0:
        stop = min(stop, clock.calls * clock.control_period)
    return stop


@kernel
def next_stop(watched: int, accumulation: Floats, next_push: float, clock: Clock) -> float:
    """Time that the next step may not pass."""
    stop = next_due(next_push, clock)
    for contact in range(watched):
        stop = min(stop, accumulation[contact])
    return stop


@kernel
def end_bounces(
    rows: Rows, watched: int, time: float, accumulation: Floats, record: Record
) -> None:
    """Let the points rest whose accumulating impacts have come to an end by now."""
    for contact in range(watched):
        if accumulation[contact] <= time:
            if rows.kind[contact] in (POINT, SECOND_FACE):
                point = rows.owner[contact]
                log_event(accumulation[contact], ZENO, point, 0.0, 0.0, record)
            accumulation[contact] = np.inf


@kernel
def pass_time(length: float, stop: float, step: Step, decision: Decision) -> None:
    """Let time move on, to `stop` if that is the same but for rounding."""
    step.time += length
    if abs(step.time - stop) <= SAME_TIME * max(abs(stop), EARLY):
        step.time = stop
    decision.allowance = min(decision.allowance + EVENTS_A_SECOND * length, EVENTS_AT_ONCE)


@kernel
def end_step(
    clock: Clock, rows: Rows, seconds: Contacts, watched: int, meets: Integers, contacts: Contacts,
    tally: Tally, step: Step, accumulation: Floats, decision: Decision, record: Record,
) -> None:  # fmt: skip
    """Move time and state to the end of the finished step."""
    pass_time(
        step.length, next_stop(watched, accumulation, decision.next_push, clock), step, decision
    )
    for i in range(step.begin.shape[0]):
        step.begin[i] = step.end[i]
    show_forces(step.end_force, rows, seconds, watched, meets, contacts)
    end_bounces(rows, watched, step.time, accumulation, record)
    step.finished = 0
    tally.steps += 1
    if step.has_fired == 1:
        together = step.time - decision.last_event < INSTANT
        decision.burst = decision.burst + 1 if together else 0
        decision.last_event = step.time
        decision.allowance -= 1.0
    elif step.length < min(SHORT_STEP, SHORT_PART * step.longest):
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
    phase = work.phase
    watch = phase.watch
    step, bounces = work.step, work.bounces
    series, output, decision = work.series, work.output, work.decision
    end = stop
    if output.period > 0.0:  # a row is due no later than at its end
        period = output.period * output.every
        due = output.next_row * period
        end = min(stop, due if due > step.time + EVENT_TIME else due + period)
    first = record.events
    if not cross_bridge(scene, end, control, memory, work, record):
        series.reason = NO_BRIDGE
        return SOLVER_FAILED
    react(scene.model, first, step.begin[: scene.model.nq], record, memory.loops)
    pass_time(series.length, end, step, decision)
    clock.time = step.time
    series.last_end = step.time
    for contact in range(phase.modes.watched):
        if bounces.accumulation[contact] <= step.time:
            bounces.accumulation[contact] = np.inf
    memory.tally.steps += 1
    for i in range(watch.fired.shape[0]):
        watch.fired[i] = 0
    decision.burst = 0
    decision.allowance = EVENTS_A_BRIDGE
    step.next_length = AFRESH
    write_row(
        scene, step.time, step.begin, False, step, work.impact, control, memory, phase, output,
        record,
    )  # fmt: skip
    evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
    meet_event(
        False, scene.model, scene.ground, memory, phase, step, work.impact, bounces, decision,
        record,
    )  # fmt: skip
    show_state(scene.model, step.begin, memory.q, memory.v)
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
    phase = work.phase
    step, decision = work.step, work.decision
    model, ground = scene.model, scene.ground
    if step.finished == 0:
        stop = (
            next_due(decision.next_push, clock)
            if decision.bridging == 1
            else next_stop(
                phase.modes.watched, work.bounces.accumulation, decision.next_push, clock
            )
        )
        if stop - step.time < shortest_step(step.time):
            # The same time but for rounding: 0.3 for one, 3 · 0.1 for the other.
            step.time = stop
            clock.time = stop
            end_bounces(
                memory.rows, phase.modes.watched, step.time, work.bounces.accumulation, record,
            )  # fmt: skip
            return DONE
        turn = longest_turn(model, memory.equations.tree.motion, step.begin)
        step.next_length = min(step.next_length, turn)
        wish = step.longest if decision.bridging == 1 else min(step.next_length, step.longest)
        if clock.forked == 0 and stop == clock.until and step.time + ALMOST * wish >= stop:
            clock.forked = 1
            return FORK
        if decision.bridging == 1:
            return move_over(scene, stop, control, memory, work, record, clock)
        if not integrate(scene, stop, control, memory, phase, step):
            if not jam(model, phase.modes.slide, decision):
                decision.bridging = 1
            step.next_length = AFRESH
            return DONE
    written = write_rows_within(
        scene, control, memory, phase, step, work.impact, work.output, record
    )
    if written == NO_ROOM:
        return RECORD_FULL
    if written == TOO_FAR:  # the step is taken again, to end there
        step.finished = 0
        return DONE
    end_step(
        clock, memory.rows, memory.seconds, phase.modes.watched, work.impact.meets, memory.contacts,
        memory.tally, step, work.bounces.accumulation, decision, record,
    )  # fmt: skip
    clock.time = step.time
    if step.has_fired == 1:
        evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
        meet_event(
            False, model, ground, memory, phase, step, work.impact, work.bounces, decision, record
        )
    if decision.allowance < 0.0:
        if (
            step.has_fired == 0
            and step.length < EVENT_TIME
            and jam(model, phase.modes.slide, decision)
        ):
            decision.allowance = EVENTS_A_BRIDGE
        else:
            decision.bridging = 1
    show_state(model, step.begin, memory.q, memory.v)
    return DONE
