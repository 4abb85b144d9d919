"""Rows of the record of an event-driven run: at events, and in between from the step about them."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.brakes import share_friction
from heelstrike.sim.contacts.dry_friction import add_dry_force
from heelstrike.sim.contacts.geometry import contact_velocity
from heelstrike.sim.contacts.loops import note_loops, rows_of
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, SECOND_FACE, STOP, Rows
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.continuous_extension import (
    BETWEEN,
    PLACES,
    fit_correction,
    interpolate_corrected,
    move_places,
)
from heelstrike.sim.event_driven.dormand_prince import interpolate
from heelstrike.sim.event_driven.location import EVENT_TIME, TOGETHER
from heelstrike.sim.event_driven.phase import Impact, Output, Phase, Samples, Step
from heelstrike.sim.event_driven.smooth.candidates import slides
from heelstrike.sim.event_driven.smooth.corners import record_corner
from heelstrike.sim.event_driven.smooth.dynamics import evaluate
from heelstrike.sim.event_driven.smooth.projection import (
    INTERPOLATED,
    explained,
    is_in_place,
    project,
)
from heelstrike.sim.event_driven.smooth.saddle_point import solve_accelerations
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
def note_state(model: Model, row: int, state: Floats, rows: Rows, record: Record) -> None:
    """Write a state to a row, where no force acts as yet."""
    for i in range(model.nv):
        record.position[row, i] = state[i]
        record.velocity[row, i] = state[model.nq + i]
        record.stop_torque[row, i] = 0.0
        record.friction_torque[row, i] = 0.0
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        record.constraint_force[row, rows.owner[entry], 0] = 0.0
    for contact in range(model.nc):
        record.contact_force[row, contact, 0] = 0.0
        record.contact_force[row, contact, 1] = 0.0
        record.slip_velocity[row, contact] = 0.0


@kernel
def put_right(
    scene: Scene, state: Floats, step: Step, rows: Rows, equations: Equations, contacts: Contacts,
    surface: Surface, assembly: Assembly, loops: Loops, seconds: Contacts, phase: Phase,
    output: Output,
) -> bool:  # fmt: skip
    """Write a state that is to become a row, put on its constraints, to ``output.state``.

    Returns whether the error of the dense output explains how far it is moved. If not it stays.
    """
    trial = output.state
    for i in range(state.shape[0]):
        trial[i] = state[i]
    _, strayed, fastest = project(
        scene.model, scene.ground, rows, equations, contacts, surface, assembly, loops, seconds,
        phase, trial,
    )  # fmt: skip
    if explained(state, trial, INTERPOLATED, step):
        return True
    for i in range(state.shape[0]):
        trial[i] = state[i]
    return is_in_place(strayed, fastest)


@kernel
def show_who_carries(
    count: int, friction: Floats, slide: Integers, value: Floats, force: Floats, assembly: Assembly
) -> None:
    """Let the answer be the forces that the motion follows, where others would lead to another.

    That is where equations leave open who carries what and something slides: friction hangs on it.
    """
    if not slides(count, friction, slide, assembly.candidate):
        return
    for place in range(count):
        contact = assembly.candidate[place]
        if value[2 * contact] < 0.0 or value[2 * contact + 1] < 0.0:
            return
    for place in range(count):
        contact = assembly.candidate[place]
        for k in range(2):
            assembly.answer.impulse[2 * place + k] = force[contact, k]


@kernel
def write_row(
    scene: Scene, time: float, state: Floats, lawful: bool, step: Step, impact: Impact,
    control: Control, memory: Memory, phase: Phase, output: Output, record: Record,
) -> None:  # fmt: skip
    """Append a state, put on its constraints, with the certified contact forces in it.

    Where no contact forces obey the laws there are none in the row, and none of loops.
    """
    put_right(
        scene, state, step, memory.rows, memory.equations, memory.contacts, memory.surface,
        memory.assembly, memory.loops, memory.seconds, phase, output,
    )  # fmt: skip
    write_right(scene, time, lawful, impact, control, memory, phase, output, record)


@kernel
def write_right(
    scene: Scene, time: float, lawful: bool, impact: Impact, control: Control, memory: Memory,
    phase: Phase, output: Output, record: Record,
) -> None:  # fmt: skip
    """Append the state in ``output.state``, as :func:`write_row` does."""
    modes, forces = phase.modes, phase.forces
    model, contacts, assembly = scene.model, memory.contacts, memory.assembly
    trial, residual, impulse = output.state, assembly.answer.residual, assembly.answer.impulse
    evaluate(scene, time, trial, control, memory, phase, output.slope)
    for k in range(3):
        residual[k] = 0.0
    count, loop_rows = forces.count, rows_of(memory.loops)
    if not lawful:
        count = 0
        for place in range(loop_rows):
            impulse[2 * place] = 0.0
        note_loops(memory.rows, loop_rows, 1.0, impulse, memory.loops)
    elif count + loop_rows > 0:
        solve_accelerations(count, model, trial, memory, phase)
        note_residual(residual, memory.tally)
        if loop_rows == 0 and forces.deficient == 1:
            show_who_carries(
                count, memory.surface.friction, modes.slide, phase.watch.value, forces.force,
                assembly,
            )  # fmt: skip
        note_loops(memory.rows, count + loop_rows, 1.0, impulse, memory.loops)
    row, friction_torque = record.rows, record.friction_torque[record.rows]
    note_row(time, memory, record)
    note_state(model, row, trial, memory.rows, record)
    add_dry_force(modes.slide, modes.breakaway, memory.rows, friction_torque)
    deepest = memory.tally.penetration
    for contact in range(model.nc):
        if modes.passing[contact] == 0:
            deepest = max(deepest, -contacts.gap[contact], -memory.seconds.gap[contact])
        memory.seconds.force[contact, 0] = 0.0
        memory.seconds.force[contact, 1] = 0.0
    memory.tally.penetration = deepest
    for place in range(count):
        contact = assembly.candidate[place]
        normal, tangent = impulse[2 * place], impulse[2 * place + 1]
        kind, owner = memory.rows.kind[contact], memory.rows.owner[contact]
        if kind == SECOND_FACE:
            memory.seconds.force[owner, 0] = normal
            memory.seconds.force[owner, 1] = tangent
        elif kind == DRY_JOINT:
            friction_torque[owner] = tangent
        elif kind == STOP:
            record.stop_torque[row, owner] += memory.rows.side[contact] * normal
        elif kind == CONSTRAINT:
            record.constraint_force[row, owner, 0] = normal
        else:
            record.contact_force[row, contact, 0] = normal
            record.contact_force[row, contact, 1] = tangent
            _, record.slip_velocity[row, contact] = contact_velocity(
                model, memory.equations.tree, contacts, contact
            )
    share_friction(model, modes.breakaway, friction_torque, record.brake_torque[row])
    for second in range(memory.rows.first[SECOND_FACE], modes.watched):
        record_corner(
            row, memory.rows.owner[second], model, memory.equations.tree, contacts, memory.seconds,
            impact, record,
        )  # fmt: skip
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
def extend(scene: Scene, control: Control, memory: Memory, phase: Phase, step: Step) -> None:
    """Correct the dense output of the finished step by the slopes that the motion has on it.

    Where that leads nowhere, as under a torque that switches, the dense output stays as it is.
    """
    extension, moved = step.extension, 0.0
    for j in range(BETWEEN):
        interpolate(PLACES[j], step.begin, step.dense, extension.state[j])
    for _ in range(REPEATED):
        for j in range(BETWEEN):
            time = step.time + PLACES[j] * step.length
            state, slope = extension.state[j], extension.slope[j]
            evaluate(scene, time, state, control, memory, phase, slope)
        fit_correction(step.length, step.dense, extension.slope, extension.correction)
        moved = move_places(
            step.begin, step.end, step.dense, step.relative, step.absolute, extension
        )
        if not moved > FAR:
            break
    if not moved <= INTERPOLATED:
        for k in range(extension.correction.shape[0]):
            for i in range(step.begin.shape[0]):
                extension.correction[k, i] = 0.0


@kernel
def write_rows_within(
    scene: Scene, control: Control, memory: Memory, phase: Phase, step: Step, impact: Impact,
    output: Output, record: Record,
) -> int:  # fmt: skip
    """Append the rows due within the finished step; return whether all, or what is in the way.

    An event at its end has rows of its own, one before it if velocities or normals may jump. Where
    the dense output is too far from the constraints, as beside a singular pose, the step has to end
    at the row: nothing but integration finds the state there. Rows before it are taken back, since
    the shorter step may meet an event that the longer one has passed.
    """
    modes, watch = phase.modes, phase.watch
    period = output.period * output.every
    last = step.time + step.length
    first, next_row, last_row = record.rows, output.next_row, output.last_row
    touch, is_extended = False, False
    if step.has_fired == 1:
        last -= EVENT_TIME
        for contact in range(modes.watched):
            touch = touch or (
                modes.closed[contact] == 0 and comes_down(contact, watch.fired, step.samples)
            )
        for point in range(scene.model.nc):
            touch = touch or watch.fired[2 * modes.watched + point] == 1
    state = output.dense_state
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
                meets = modes.closed[second] == 0 and watch.fired[2 * second] == 1
                impact.meets[memory.rows.owner[second]] = 1 if meets else 0
        if record.rows + ROWS_OF_AN_INSTANT > record.time.shape[0]:
            return NO_ROOM
        if part < 1.0:
            if not is_extended:
                extend(scene, control, memory, phase, step)
                is_extended = True
            interpolate_corrected(part, step.begin, step.dense, step.extension.correction, state)
        else:  # the end has been put on its constraints, and on the event
            for i in range(state.shape[0]):
                state[i] = step.end[i]
        fits = put_right(
            scene, state, step, memory.rows, memory.equations, memory.contacts, memory.surface,
            memory.assembly, memory.loops, memory.seconds, phase, output,
        )  # fmt: skip
        inside = is_inside(time, step.time, step.length)
        if not fits and inside and not last_row > step.time:
            step.next_length = time - step.time
            record.rows, output.next_row, output.last_row = first, next_row, last_row
            return TOO_FAR
        write_right(scene, time, True, impact, control, memory, phase, output, record)
