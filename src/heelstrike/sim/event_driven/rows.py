"""Rows of the record of an event-driven run: at events, and in between from the step about them."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.brakes import share_friction
from heelstrike.sim.contacts.dry_friction import add_dry_force
from heelstrike.sim.contacts.loops import note_loops, rows_of
from heelstrike.sim.contacts.rows import (
    CONSTRAINT,
    DRY_JOINT,
    POINT,
    SECOND_FACE,
    STOP,
    Rows,
    second_of,
)
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.continuous_extension import (
    BETWEEN,
    PLACES,
    fit_correction,
    interpolate_corrected,
    move_places,
)
from heelstrike.sim.event_driven.dormand_prince import interpolate
from heelstrike.sim.event_driven.location import EVENT_TIME, TOGETHER
from heelstrike.sim.event_driven.phase import Integration, Motion, Output, Phase, Samples, Step
from heelstrike.sim.event_driven.smooth.candidates import slides, tell_parts
from heelstrike.sim.event_driven.smooth.corners import record_corner
from heelstrike.sim.event_driven.smooth.dynamics import evaluate
from heelstrike.sim.event_driven.smooth.gaps import gap_velocity
from heelstrike.sim.event_driven.smooth.projection import (
    INTERPOLATED,
    explained,
    is_in_place,
    project,
)
from heelstrike.sim.event_driven.smooth.saddle_point import solve_contacts
from heelstrike.sim.event_driven.steps import shortest_step
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Equations, Loops, Memory, Surface
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
def put_right(
    state: Floats, model: Model, ground: GroundModel, step: Step, equations: Equations, rows: Rows,
    surface: Surface, assembly: Assembly, loops: Loops, phase: Phase, trial: Floats,
) -> bool:  # fmt: skip
    """Write a state that is to become a row, put on its constraints, to `trial`.

    Returns whether the error of the dense output explains how far it is moved. If not it stays.
    """
    copy_words(state, trial)
    _, strayed, fastest = project(
        model, ground, equations, rows, surface, assembly, loops, phase, trial
    )
    if explained(state, trial, INTERPOLATED, step.relative, step.absolute):
        return True
    copy_words(state, trial)
    return is_in_place(strayed, fastest)


@kernel
def show_who_carries(
    count: int, friction: Floats, slide: Integers, value: Floats, force: Floats, assembly: Assembly
) -> None:
    """Let the answer be the forces that the motion follows, where others would lead to another.

    That is where equations leave open who carries what and something slides: friction needs it.
    """
    if not slides(count, friction, slide, assembly.candidate):
        return
    for place in range(count):
        contact = assembly.candidate[place]
        if value[2 * contact] < 0.0 or value[2 * contact + 1] < 0.0:
            return
    for place in range(count):
        contact = assembly.candidate[place]
        row, end = assembly.problem.first[place], assembly.problem.first[place + 1]
        for k in range(end - row):
            assembly.answer.impulse[row + k] = force[contact, k]


@kernel
def write_row(
    scene: Scene, lawful: bool, control: Control, memory: Memory, work: Motion, record: Record
) -> None:
    """Append the state now, put on its constraints, with the certified contact forces in it.

    Where no contact forces obey the laws there are none in the row, and none of loops.
    """
    step, output, phase, meets = work.step, work.output, work.phase, work.impact.meets
    put_right(
        step.begin, scene.model, scene.ground, step, memory.equations, memory.rows, memory.surface,
        memory.assembly, memory.loops, phase, output.state,
    )  # fmt: skip
    write_right(scene, step.time, lawful, meets, control, memory, phase, output, record)


@kernel
def write_right(
    scene: Scene, time: float, lawful: bool, meets: Integers, control: Control, memory: Memory,
    phase: Phase, output: Output, record: Record,
) -> None:  # fmt: skip
    """Append the state in ``output.state``, as :func:`write_row` does."""
    modes, force, model, rows = phase.modes, phase.forces.force, scene.model, memory.rows
    assembly, loops, tree = memory.assembly, memory.loops, memory.equations.tree
    trial, residual, impulse = output.state, assembly.answer.residual, assembly.answer.impulse
    q, v = trial[: model.nq], trial[model.nq :]
    evaluate(scene, time, trial, control, memory, phase, output.slope)
    for k in range(3):
        residual[k] = 0.0
    count, loop_rows, first = phase.forces.count, rows_of(loops), assembly.problem.first
    if not lawful:
        count = 0
        for place in range(loop_rows):
            impulse[first[place]] = 0.0
    elif count + loop_rows > 0:
        solve_contacts(count, True, model, memory, phase)
        note_residual(residual, memory.tally)
        if loop_rows == 0 and phase.forces.deficient == 1:
            show_who_carries(
                count, memory.surface.friction, modes.slide, phase.watch.value, force, assembly
            )
    if loop_rows > 0:
        note_loops(rows, count + loop_rows, 1.0, first, impulse, loops)
    tell_parts(count, modes.watched, assembly, impulse, force)
    row = record.rows
    note_row(time, memory, record)
    stop_torque, friction_torque = record.stop_torque[row], record.friction_torque[row]
    for i in range(model.nv):
        record.position[row, i], record.velocity[row, i] = q[i], v[i]
        stop_torque[i] = friction_torque[i] = 0.0
    add_dry_force(modes.slide, modes.breakaway, rows, friction_torque)
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        if modes.slide[dry] == 0:
            friction_torque[rows.owner[dry]] = force[dry, 1]
    share_friction(model, modes.breakaway, friction_torque, record.brake_torque[row])
    for stop in range(rows.first[STOP], rows.end[STOP]):
        stop_torque[rows.owner[stop]] += rows.side[stop] * force[stop, 0]
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        record.constraint_force[row, rows.owner[entry], 0] = force[entry, 0]
    for point in range(rows.first[POINT], rows.end[POINT]):
        slip, deepest = 0.0, -rows.gap[point]
        record.contact_force[row, point, 0] = force[point, 0]
        record.contact_force[row, point, 1] = force[point, 1]
        if lawful and modes.closed[point] == 1:
            _, slip = gap_velocity(point, model, tree, rows, v)
        if scene.ground.concave == 1:
            second = second_of(point, rows)
            deepest = max(deepest, -rows.gap[second])
            if meets[point] == 1:
                record.gap[row, point] = rows.gap[second]
                _, slip = gap_velocity(second, model, tree, rows, v)
            record_corner(
                row, point, second, model, rows.normal, rows.position, force, meets, record
            )
        record.slip_velocity[row, point] = slip
        if modes.passing[point] == 0:
            memory.tally.penetration = max(memory.tally.penetration, deepest)
    output.last_row = time
    period = output.period * output.every
    if period > 0.0 and abs(output.next_row * period - time) <= EVENT_TIME:
        output.next_row += 1


@kernel
def comes_down(contact: int, fired: Integers, samples: Samples) -> bool:
    """Whether an open contact reaches its limit at the end of the step, or is hit with others.

    What the end looked like is kept: the rows of the step may be written in parts.
    """
    near = samples.end_value[2 * contact] <= 2.0 * TOGETHER and samples.end_rate[2 * contact] < 0.0
    return bool(fired[2 * contact] == 1 or near)


@kernel
def is_inside(time: float, begin: float, length: float) -> bool:
    """Whether a row within a step is at neither of its ends, so that the step could end there."""
    return bool(shortest_step(begin) <= time - begin < AT_ITS_END * length)


@kernel
def extend(within: Integration) -> None:
    """Correct the dense output of the finished step by the slopes that the motion has on it.

    Where that leads nowhere, as under a torque that switches, the dense output stays as it is.
    """
    step, moved = within.step, 0.0
    extension, begin, dense = step.extension, step.begin, step.dense
    for j in range(BETWEEN):
        interpolate(PLACES[j], begin, dense, extension.state[j])
    for _ in range(REPEATED):
        for j in range(BETWEEN):
            evaluate(
                within.scene, step.time + PLACES[j] * step.length, extension.state[j],
                within.control, within.memory, within.phase, extension.slope[j],
            )  # fmt: skip
        fit_correction(step.length, dense, extension.slope, extension.correction)
        moved = move_places(begin, step.end, dense, step.relative, step.absolute, extension)
        if not moved > FAR:
            break
    if not moved <= INTERPOLATED:
        for k in range(extension.correction.shape[0]):
            for i in range(begin.shape[0]):
                extension.correction[k, i] = 0.0


@kernel
def write_rows_within(meets: Integers, output: Output, record: Record, within: Integration) -> int:
    """Append the rows due within the finished step; return whether all, or what is in the way.

    An event at its end has rows of its own, one before it if velocities or normals may jump. Where
    the dense output is too far from the constraints, as beside a singular pose, the step has to end
    at the row: nothing but integration finds the state there. Rows before it are taken back, since
    the shorter step may meet an event that the longer one has passed.
    """
    scene, memory, phase, step = within.scene, within.memory, within.phase, within.step
    modes, fired, state = phase.modes, phase.watch.fired, output.dense_state
    period = output.period * output.every
    last = step.time + step.length
    first, next_row, last_row = record.rows, output.next_row, output.last_row
    touch, is_extended = False, False
    if step.has_fired == 1:
        last -= EVENT_TIME
        for contact in range(modes.watched):
            open_one = modes.closed[contact] == 0
            touch = touch or (open_one and comes_down(contact, fired, step.samples))
        for point in range(scene.model.nc):
            touch = touch or fired[2 * modes.watched + point] == 1
    while True:
        time = output.next_row * period
        part = 1.0
        if period > 0.0 and time <= last:
            part = (time - step.time) / step.length
        else:  # the step may have no length at all
            if not touch:
                return WRITTEN
            touch = False
            time = step.time + step.length
            for second in range(memory.rows.first[SECOND_FACE], modes.watched):
                met = modes.closed[second] == 0 and fired[2 * second] == 1
                meets[memory.rows.owner[second]] = 1 if met else 0
        if record.rows + ROWS_OF_AN_INSTANT > record.time.shape[0]:
            return NO_ROOM
        if part < 1.0:
            if not is_extended:
                extend(within)
                is_extended = True
            interpolate_corrected(part, step.begin, step.dense, step.extension.correction, state)
        else:  # the end has been put on its constraints, and on the event
            copy_words(step.end, state)
        fits = put_right(
            state, scene.model, scene.ground, step, memory.equations, memory.rows, memory.surface,
            memory.assembly, memory.loops, phase, output.state,
        )  # fmt: skip
        inside = is_inside(time, step.time, step.length)
        if not fits and inside and not last_row > step.time:
            step.next_length = time - step.time
            record.rows, output.next_row, output.last_row = first, next_row, last_row
            return TOO_FAR
        write_right(scene, time, True, meets, within.control, memory, phase, output, record)
