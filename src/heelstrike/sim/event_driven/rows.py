"""Rows of the record of an event-driven run: at events, and in between from the step about them."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.brakes import share_friction
from heelstrike.sim.contacts.dry_friction import dry_force
from heelstrike.sim.contacts.geometry import contact_velocity
from heelstrike.sim.contacts.loops import note_loops, rows_of
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.candidates import slides
from heelstrike.sim.event_driven.continuous_extension import (
    BETWEEN,
    PLACES,
    fit_correction,
    interpolate_corrected,
    move_places,
)
from heelstrike.sim.event_driven.corners import record_corner
from heelstrike.sim.event_driven.dormand_prince import SLOPES, interpolate
from heelstrike.sim.event_driven.dynamics import (
    INTERPOLATED,
    evaluate,
    explained,
    is_in_place,
    project,
)
from heelstrike.sim.event_driven.location import TOGETHER, shortest_step
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.event_driven.saddle_point import solve_accelerations
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Memory
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import note_residual, note_row

# Rows that an instant may add: one due before it, two of an event, one at the end.
ROWS_OF_AN_INSTANT = 4
# What came of writing the rows within a step.
WRITTEN, NO_ROOM, TOO_FAR = 0, 1, 2
# Part of a step from which on a row is at its end.
AT_ITS_END = 0.999
# Slopes within a step are evaluated again, so often at most, where they move it by more than so
# many tolerances: each time what is left is a sixteenth or so.
REPEATED, FAR = 3, 4.0


@kernel
def note_state(model: Model, row: int, state: Floats, record: Record) -> None:
    """Write a state to a row, where no force acts as yet."""
    for i in range(model.nv):
        record.position[row, i] = state[i]
        record.velocity[row, i] = state[model.nq + i]
        record.stop_torque[row, i] = 0.0
        record.friction_torque[row, i] = 0.0
    for contact in range(model.nc):
        record.contact_force[row, contact, 0] = 0.0
        record.contact_force[row, contact, 1] = 0.0
        record.slip_velocity[row, contact] = 0.0


@kernel
def put_right(scene: Scene, state: Floats, memory: Memory, phase: Phase) -> bool:
    """Write a state that is to become a row, put on its constraints, to ``phase.trial``.

    Returns whether the error of the dense output explains how far it is moved. If not it stays.
    """
    trial = phase.trial
    for i in range(state.shape[0]):
        trial[i] = state[i]
    _, strayed, fastest = project(scene.model, scene.ground, memory, phase, trial)
    if explained(state, trial, INTERPOLATED, phase):
        return True
    for i in range(state.shape[0]):
        trial[i] = state[i]
    return is_in_place(strayed, fastest)


@kernel
def show_who_carries(count: int, friction: Floats, phase: Phase, assembly: Assembly) -> None:
    """Let the answer be the forces that the motion follows, where others would lead to another.

    That is where equations leave open who carries what and something slides: friction hangs on it.
    """
    if not slides(count, friction, phase, assembly):
        return
    for place in range(count):
        contact = assembly.candidate[place]
        if phase.value[2 * contact] < 0.0 or phase.value[2 * contact + 1] < 0.0:
            return
    for place in range(count):
        contact = assembly.candidate[place]
        for k in range(2):
            assembly.answer.impulse[2 * place + k] = phase.force[contact, k]


@kernel
def write_row(
    scene: Scene, time: float, state: Floats, lawful: bool, control: Control, memory: Memory,
    phase: Phase, record: Record,
) -> None:  # fmt: skip
    """Append a state, put on its constraints, with the certified contact forces in it.

    Where no contact forces obey the laws there are none in the row, and none of loops.
    """
    put_right(scene, state, memory, phase)
    write_right(scene, time, lawful, control, memory, phase, record)


@kernel
def write_right(
    scene: Scene, time: float, lawful: bool, control: Control, memory: Memory, phase: Phase,
    record: Record,
) -> None:  # fmt: skip
    """Append the state in ``phase.trial``, as :func:`write_row` does."""
    model, contacts, assembly = scene.model, memory.contacts, memory.assembly
    trial, residual, impulse = phase.trial, assembly.answer.residual, assembly.answer.impulse
    evaluate(scene, time, trial, control, memory, phase, phase.slopes[SLOPES - 1])
    for k in range(3):
        residual[k] = 0.0
    count, loops = phase.closed_count, rows_of(memory.loops)
    if not lawful:
        count = 0
        for place in range(loops):
            impulse[2 * place] = 0.0
        note_loops(model, loops, impulse, memory.loops)
    elif count + loops > 0:
        solve_accelerations(count, model, trial, memory, phase)
        note_residual(residual, memory.tally)
        if loops == 0 and phase.deficient == 1:
            show_who_carries(count, memory.surface.friction, phase, assembly)
        note_loops(model, count + loops, impulse, memory.loops)
    row, friction_torque = record.rows, record.friction_torque[record.rows]
    note_row(time, memory, record)
    note_state(model, row, trial, record)
    slide = phase.slide[phase.first_dry :]
    dry_force(phase.dry_joint, slide, phase.breakaway, friction_torque)
    deepest = memory.tally.penetration
    for contact in range(model.nc):
        if phase.passing[contact] == 0:
            deepest = max(deepest, -contacts.gap[contact], -phase.seconds.gap[contact])
        phase.seconds.force[contact, 0] = 0.0
        phase.seconds.force[contact, 1] = 0.0
    memory.tally.penetration = deepest
    for place in range(count):
        contact = assembly.candidate[place]
        normal, tangent = impulse[2 * place], impulse[2 * place + 1]
        if contact >= phase.first_second:
            phase.seconds.force[contact - phase.first_second, 0] = normal
            phase.seconds.force[contact - phase.first_second, 1] = tangent
        elif contact >= phase.first_dry:
            friction_torque[phase.dry_joint[contact - phase.first_dry]] = tangent
        elif contact >= model.nc:
            stop = contact - model.nc
            record.stop_torque[row, phase.stop_joint[stop]] += phase.stop_side[stop] * normal
        else:
            record.contact_force[row, contact, 0] = normal
            record.contact_force[row, contact, 1] = tangent
            _, record.slip_velocity[row, contact] = contact_velocity(
                model, memory.equations.tree, contacts, contact
            )
    share_friction(model, phase.breakaway, friction_torque, record.brake_torque[row])
    for second in range(phase.first_second, phase.watched):
        record_corner(row, second - phase.first_second, model, memory, phase, record)
    phase.last_row = time
    period = phase.output_period * phase.row_every
    if period > 0.0 and abs(phase.next_row * period - time) <= 1e-12:
        phase.next_row += 1


@kernel
def comes_down(contact: int, phase: Phase) -> bool:
    """Whether an open contact reaches its limit at the end of the step, or is hit with others.

    What the end looked like is kept: the rows of the step may be written in parts.
    """
    near = phase.end_value[2 * contact] <= 2.0 * TOGETHER and phase.end_rate[2 * contact] < 0.0
    return bool(phase.fired[2 * contact] == 1 or near)


@kernel
def is_inside(time: float, begin: float, length: float) -> bool:
    """Whether a row within a step is at neither of its ends, so that the step could end there."""
    return bool(shortest_step(begin) <= time - begin < AT_ITS_END * length)


@kernel
def extend(scene: Scene, control: Control, memory: Memory, phase: Phase) -> None:
    """Correct the dense output of the finished step by the slopes that the motion has on it.

    Where that leads nowhere, as under a torque that switches, the dense output stays as it is.
    """
    extension, moved = phase.extension, 0.0
    for j in range(BETWEEN):
        interpolate(PLACES[j], phase.begin, phase.dense, extension.state[j])
    for _ in range(REPEATED):
        for j in range(BETWEEN):
            time = phase.time + PLACES[j] * phase.length
            state, slope = extension.state[j], extension.slope[j]
            evaluate(scene, time, state, control, memory, phase, slope)
        fit_correction(phase.length, phase.dense, extension.slope, extension.correction)
        moved = move_places(
            phase.begin, phase.end, phase.dense, phase.relative, phase.absolute, phase.trial,
            extension,
        )  # fmt: skip
        if not moved > FAR:
            break
    if not moved <= INTERPOLATED:
        for k in range(extension.correction.shape[0]):
            for i in range(phase.begin.shape[0]):
                extension.correction[k, i] = 0.0


@kernel
def write_rows_within(
    scene: Scene, control: Control, memory: Memory, phase: Phase, record: Record
) -> int:
    """Append the rows due within the finished step; return whether all, or what is in the way.

    An event at its end has rows of its own, one before it if velocities or normals may jump. Where
    the dense output is too far from the constraints, as beside a singular pose, the step has to end
    at the row: nothing but integration finds the state there. Rows before it are taken back, since
    the shorter step may meet an event that the longer one has passed.
    """
    period = phase.output_period * phase.row_every
    last = phase.time + phase.length
    first, next_row, last_row = record.rows, phase.next_row, phase.last_row
    touch, is_extended = False, False
    if phase.has_fired == 1:
        last -= 1e-12
        for contact in range(phase.watched):
            touch = touch or (phase.closed[contact] == 0 and comes_down(contact, phase))
        for corner in range(2 * phase.watched, 2 * phase.watched + scene.model.nc):
            touch = touch or phase.fired[corner] == 1
    state = phase.slopes[SLOPES - 1]
    while True:
        time = phase.next_row * period
        part = 1.0
        if period > 0.0 and time <= last:
            part = (time - phase.time) / phase.length
        else:  # the step may have no length at all
            if not touch:
                return WRITTEN
            touch = False
            time = phase.time + phase.length
            for second in range(phase.first_second, phase.watched):
                meets = phase.closed[second] == 0 and phase.fired[2 * second] == 1
                phase.meets[second - phase.first_second] = 1 if meets else 0
        if record.rows + ROWS_OF_AN_INSTANT > record.time.shape[0]:
            return NO_ROOM
        if part < 1.0:
            if not is_extended:
                extend(scene, control, memory, phase)
                is_extended = True
            correction = phase.extension.correction
            interpolate_corrected(part, phase.begin, phase.dense, correction, state)
        else:  # the end has been put on its constraints, and on the event
            for i in range(state.shape[0]):
                state[i] = phase.end[i]
        fits = put_right(scene, state, memory, phase)
        inside = is_inside(time, phase.time, phase.length)
        if not fits and inside and not last_row > phase.time:
            phase.next_length = time - phase.time
            record.rows, phase.next_row, phase.last_row = first, next_row, last_row
            return TOO_FAR
        write_right(scene, time, True, control, memory, phase, record)
