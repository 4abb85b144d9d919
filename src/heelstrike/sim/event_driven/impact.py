"""Impacts: the velocity-level problem with restitution (paper eq. 20-22), and where bounces end."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import SOLVED
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.candidates import find_constraints
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    evaluate_equations,
    row_product,
)
from heelstrike.sim.contacts.loops import append_loops, find_loops, free_loops, note_loops, rows_of
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, POINT, STOP, Rows
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Bounces, Impact, Modes, Phase, Step
from heelstrike.sim.event_driven.smooth.candidates import free_acceleration
from heelstrike.sim.event_driven.smooth.corners import is_struck, log_impulse
from heelstrike.sim.event_driven.smooth.dynamics import gather_closed
from heelstrike.sim.event_driven.smooth.faces import locate
from heelstrike.sim.event_driven.smooth.gaps import free_gap_acceleration, gap_rows, gap_velocity
from heelstrike.sim.event_driven.smooth.saddle_point import (
    add_impulses,
    solve_accelerations,
    solve_velocities,
)
from heelstrike.sim.memory import Memory, Reported
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import (
    CONSTRAINT_HOLDS,
    JOINT_STOP,
    TOUCHDOWN,
    log_event,
    note_residual,
)
from heelstrike.tolerances import NOTICEABLE_ENERGY

IMPACT = int(EventKind.IMPACT)
ENERGY_GAIN = int(EventKind.ENERGY_GAIN)

# Velocities (m/s) up to which a point on the ground is at rest: what a contact problem is certified
# to, where robots have some m/s.
REST = 1e-9
# Velocities (m/s, rad/s) along a loop up to which it has none: rounding of some hundred operations.
ROUNDING = 1e-13
# Bounces shorter than this (s) lose what restitution gave them, and of those shorter than this the
# rest: what speed is left of them is less than anyone could see. Under gravity the first rises by
# 1e-12 m, a gap to which events are located, the second by rounding.
SHORTEST_BOUNCE = 1e-6
NO_BOUNCE = 1e-8
PLASTIC, AT_REST = 1, 2
# Ratio of successive bounces beyond which there is no limit in sight.
PERPETUAL = 0.999999


@kernel
def heading(speed: float) -> int:
    """Whether something slides, and where to: -1, 0 or 1."""
    if speed > REST:
        return 1
    return -1 if speed < -REST else 0


@kernel
def clear_rounding(first: int, end: int, free: Floats) -> None:
    """Let rows of loops be at rest that are but for rounding.

    Loops that say the same twice would not agree on it.
    """
    for place in range(first, end):
        if abs(free[2 * place]) <= ROUNDING:
            free[2 * place] = 0.0


@kernel
def collide(
    model: Model, nudge: float, plastic: Integers, memory: Memory, phase: Phase, impact: Impact,
    state: Floats,
) -> tuple[bool, float, float]:  # fmt: skip
    """Let the points on the ground, and those that reach it now, change the velocities of `state`.

    The equations of `state` have been evaluated. Normal velocities w and impulses p obey
    ``w⁺ + e w⁻ ≥ 0 ⟂ p ≥ 0``, tangential ones Coulomb's law. All points are taken to approach the
    ground faster by `nudge`: where zero impulse is one solution of several, that singles out
    another. Dry friction of the joints is a finite force, and takes no part.

    Returns whether it was solved, the energy it made (J), and what went through the contacts. The
    impulses go to ``impact.impulse``; ``modes.closed`` and ``modes.slide`` become
    those after the impact.
    """
    modes = phase.modes
    v = state[model.nq :]
    equations, assembly = memory.equations, memory.assembly
    jacobian, free, impulse = assembly.jacobian, assembly.problem.free, assembly.answer.impulse
    count = 0
    for contact in range(modes.watched):
        impact.impulse[contact, 0] = 0.0
        impact.impulse[contact, 1] = 0.0
        if memory.rows.kind[contact] == DRY_JOINT:
            continue
        if modes.closed[contact] == 0 and impact.hit[contact] == 0:
            continue
        gap_rows(
            model, equations.tree, memory.contacts, memory.rows, memory.seconds, contact, count,
            assembly,
        )  # fmt: skip
        normal = row_product(jacobian, 2 * count, v)
        if normal < 0.0 and plastic[contact] == 0:
            normal += memory.surface.restitution[contact] * normal
        free[2 * count] = normal - nudge
        free[2 * count + 1] = row_product(jacobian, 2 * count + 1, v)
        assembly.candidate[count] = contact
        count += 1
    if count + rows_of(memory.loops) == 0:
        return True, 0.0, 0.0
    find_loops(model, state[: model.nq], v, equations.tree, memory.loops)
    total = append_loops(count, memory.loops, assembly)
    free_loops(total, memory.loops, v, 0.0, assembly)
    clear_rounding(count, total, free)
    assemble_delassus(model, total, equations, assembly)
    status = solve_velocities(count, model, memory, phase)
    note_residual(assembly.answer.residual, memory.tally)
    made = 0.0
    through = 0.0
    for row in range(2 * total):
        work = impulse[row] * row_product(jacobian, row, v)
        made += work
        through += abs(work)
    note_loops(memory.rows, total, 1.0, impulse, memory.loops)
    add_impulses(model, assembly, phase.saddle, equations, v)
    for place in range(count):
        contact = assembly.candidate[place]
        normal = row_product(jacobian, 2 * place, v)
        tangent = row_product(jacobian, 2 * place + 1, v)
        pressing, rubbing = impulse[2 * place] * normal, impulse[2 * place + 1] * tangent
        made += pressing + rubbing
        through += abs(pressing) + abs(rubbing)
        impact.impulse[contact, 0] = impulse[2 * place]
        impact.impulse[contact, 1] = impulse[2 * place + 1]
        rests = normal <= max(REST, 2.0 * nudge) or plastic[contact] == AT_REST
        modes.closed[contact] = 1 if rests else 0
        modes.slide[contact] = heading(tangent) if rests else 0
    for row in range(2 * count, 2 * total):  # what brakes take is not made by contacts at rest
        work = impulse[row] * row_product(jacobian, row, v)
        made += work
        through += abs(work)
    for contact in range(memory.rows.first[DRY_JOINT], memory.rows.end[DRY_JOINT]):
        modes.slide[contact] = modes.closed[contact] * heading(v[memory.rows.owner[contact]])
    return status == SOLVED, 0.5 * made, 0.5 * through


@kernel
def adopt_accelerations(
    count: int, model: Model, state: Floats, memory: Memory, phase: Phase
) -> None:
    """Let the forces of the closed contacts act on the accelerations, which are free ones."""
    saddle = phase.saddle
    assembly, equations, rate = memory.assembly, memory.equations, memory.equations.rate
    solve_accelerations(count, model, state, memory, phase)
    if saddle.used == 0:
        add_impulse(model, assembly, assembly.problem.count, equations, rate)
        return
    for i in range(model.nv):
        rate[i] = saddle.unknown[i]


@kernel
def short_bounces(
    model: Model, ground: GroundModel, state: Floats, time: float, hit: Integers, memory: Memory,
    phase: Phase, bounces: Bounces,
) -> bool:  # fmt: skip
    """Mark the points that would come down again too soon to follow; return whether there are any.

    Their bounces are taken to go on shrinking in the ratio of the next to the last; the geometric
    series gives the time at which they end.
    """
    modes = phase.modes
    was_closed = memory.reported.closed
    contacts, equations, assembly = memory.contacts, memory.equations, memory.assembly
    evaluate_equations(model, state[: model.nq], state[model.nq :], equations)
    if memory.rows.outside.kernel.shape[0] > 0:
        find_constraints(model, state[: model.nq], state[model.nq :], equations.tree, memory.rows)
    locate(
        model, ground, equations.tree, memory.rows, modes, memory.seconds, phase.faces, contacts,
        memory.surface,
    )  # fmt: skip
    free_acceleration(model, state, memory.torque, memory.rows, modes, memory.pushes, equations)
    loop_rows = rows_of(memory.loops)
    find_loops(model, state[: model.nq], state[model.nq :], equations.tree, memory.loops)
    count = gather_closed(
        model, contacts, memory.rows, memory.seconds, modes, memory.loops, equations, assembly
    )
    for place in range(count):
        contact = assembly.candidate[place]
        free_gap_acceleration(
            model, contacts, equations, contact, place, memory.rows, memory.seconds,
            modes.breakaway, phase.faces, assembly,
        )  # fmt: skip
    total = count + loop_rows
    free_loops(total, memory.loops, equations.rate, 1.0, assembly)
    if total > 0:
        adopt_accelerations(count, model, state, memory, phase)
    found = False
    for contact in range(modes.watched):
        touched = hit[contact] == 1 or was_closed[contact] == 1
        if modes.closed[contact] == 1 or not touched:
            continue
        gap_rows(
            model, equations.tree, contacts, memory.rows, memory.seconds, contact, total, assembly
        )
        free_gap_acceleration(
            model, contacts, equations, contact, total, memory.rows, memory.seconds,
            modes.breakaway, phase.faces, assembly,
        )  # fmt: skip
        normal, _ = gap_velocity(
            contact, model, contacts, equations.tree, memory.rows, memory.seconds, state
        )
        pull = -assembly.problem.free[2 * total]
        if not (pull > 0.0 and 0.0 < 2.0 * normal <= SHORTEST_BOUNCE * pull):
            continue
        bounce = 2.0 * normal / pull
        last = time - bounces.last_blow
        if was_closed[contact] == 0:
            last = time - bounces.last_impact[contact]
        ratio = bounce / last
        if not ratio < PERPETUAL:
            ratio = min(memory.surface.restitution[contact], PERPETUAL)
        bounces.plastic[contact] = AT_REST if bounce <= NO_BOUNCE else PLASTIC
        bounces.accumulation[contact] = time + bounce / (1.0 - ratio)
        found = True
    return found


@kernel
def restore(before: Floats, reported: Reported, rows: Rows, modes: Modes, begin: Floats) -> None:
    """Go back to the state and the modes before an impact."""
    for i in range(before.shape[0]):
        begin[i] = before[i]
    for contact in range(modes.watched):
        if rows.kind[contact] != DRY_JOINT:
            modes.closed[contact] = reported.closed[contact]
            modes.slide[contact] = reported.slipping[contact]


@kernel
def strike(
    model: Model, ground: GroundModel, memory: Memory, phase: Phase, step: Step, impact: Impact,
    bounces: Bounces, record: Record,
) -> bool:  # fmt: skip
    """Let the points in ``impact.hit`` meet the ground now, and report it; return success.

    The equations of now have been evaluated. ``memory.reported`` still holds the modes from before.
    """
    modes = phase.modes
    state, before, reported = step.begin, impact.before, memory.reported
    time, contacts = step.time, memory.contacts
    for i in range(state.shape[0]):
        before[i] = state[i]
    made = through = 0.0
    for attempt in range(2):
        solved, made, through = collide(model, 0.0, bounces.plastic, memory, phase, impact, state)
        if not solved:
            restore(before, reported, memory.rows, modes, step.begin)
            return False
        if attempt == 1 or not short_bounces(
            model, ground, state, step.time, impact.hit, memory, phase, bounces
        ):
            break
        restore(before, reported, memory.rows, modes, step.begin)
    bounces.last_blow = time
    for contact in range(modes.watched):
        if bounces.plastic[contact] != 0 and modes.closed[contact] == 0:
            # Others throw it up again, and it is followed.
            bounces.accumulation[contact] = np.inf
        bounces.plastic[contact] = 0
        if impact.hit[contact] == 1:
            bounces.last_impact[contact] = time
    made_at = report_impacts(
        time, contacts, memory.rows, memory.seconds, phase.faces.paired, step, impact, reported,
        record,
    )  # fmt: skip
    if made > NOTICEABLE_ENERGY * through:
        memory.tally.energy_gain += made
        log_impulse(
            ENERGY_GAIN, made_at, contacts, memory.rows, memory.seconds, phase.faces.paired,
            step.time, impact, record,
        )  # fmt: skip
    return True


@kernel
def report_impacts(
    time: float, contacts: Contacts, rows: Rows, seconds: Contacts, paired: int, step: Step,
    impact: Impact, reported: Reported, record: Record,
) -> int:  # fmt: skip
    """Append the impulses of an impact to the events; return the point with the largest."""
    impulse = impact.impulse
    largest = 0
    for contact in range(rows.end[CONSTRAINT]):
        normal = impulse[contact, 0]
        struck = (
            is_struck(contact, rows, paired, impact.impulse)
            if rows.kind[contact] == POINT
            else normal != 0.0
        )
        if rows.kind[contact] == POINT and normal > impulse[largest, 0]:
            largest = contact
        if not struck:  # a stop may pull, as a latch does
            continue
        landed = reported.closed[contact] == 0
        reported.closed[contact] = 1
        if rows.kind[contact] == CONSTRAINT:
            number = rows.owner[contact]
            log_event(time, CONSTRAINT_HOLDS, number, normal, 0.0, record)
            continue
        if rows.kind[contact] == STOP:
            joint = rows.owner[contact]
            log_event(time, JOINT_STOP, joint, normal, 0.0, record)
            continue
        if landed:
            reported.slipping[contact] = 0
        log_impulse(
            TOUCHDOWN if landed else IMPACT, contact, contacts, rows, seconds, paired, step.time,
            impact, record,
        )  # fmt: skip
    return largest
