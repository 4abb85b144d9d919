"""Impacts: the velocity-level problem with restitution (paper eq. 20-22), and where bounces end."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import SOLVED
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.candidates import part_of, place_candidate
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    evaluate_equations,
    row_product,
)
from heelstrike.sim.contacts.loops import append_loops, find_loops, free_loops, note_loops, rows_of
from heelstrike.sim.contacts.rows import DRY_JOINT, SECOND_FACE, Rows, second_of
from heelstrike.sim.event_driven.phase import Modes, Motion
from heelstrike.sim.event_driven.smooth.candidates import free_acceleration, tell_parts
from heelstrike.sim.event_driven.smooth.corners import (
    IMPACT,
    log_impulse,
    report_joints,
    report_points,
)
from heelstrike.sim.event_driven.smooth.dynamics import list_closed
from heelstrike.sim.event_driven.smooth.faces import locate
from heelstrike.sim.event_driven.smooth.gaps import (
    free_gap_acceleration,
    free_gap_accelerations,
    gap_rows,
    gap_velocity,
    write_candidates,
)
from heelstrike.sim.event_driven.smooth.saddle_point import solve_contacts
from heelstrike.sim.memory import Memory, Reported
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import note_residual
from heelstrike.tolerances import NOTICEABLE_ENERGY

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
    for row in range(first, end):
        if abs(free[row]) <= ROUNDING:
            free[row] = 0.0


@kernel
def list_hit(rows: Rows, modes: Modes, hit: Integers, candidate: Integers, first: Integers) -> int:
    """List the contacts of an impact, closed or hit, as candidates; return their number.

    Dry friction of the joints is a finite force, and takes no part.
    """
    count = 0
    for contact in range(modes.watched):
        takes_part = modes.closed[contact] == 1 or hit[contact] != 0
        if takes_part and rows.kind[contact] != DRY_JOINT:
            place_candidate(contact, count, rows.components[contact], candidate, first)
            count += 1
    return count


@kernel
def collide(model: Model, nudge: float, memory: Memory, work: Motion) -> tuple[bool, float, float]:
    """Let the points on the ground, and those that reach it now, change the velocities now.

    The equations of now have been evaluated. Normal velocities w and impulses p obey
    ``w⁺ + e w⁻ ≥ 0 ⟂ p ≥ 0``, tangential ones Coulomb's law. All points are taken to approach the
    ground faster by `nudge`: where zero impulse is one solution of several, that singles out
    another.

    Returns whether it was solved, the energy it made (J), and what went through the contacts. The
    impulses go to ``impact.impulse``; ``modes.closed`` and ``modes.slide`` become
    those after the impact.
    """
    phase, impact, plastic, begin = work.phase, work.impact, work.bounces.plastic, work.step.begin
    modes, saddle, v, rows = phase.modes, phase.saddle, begin[model.nq :], memory.rows
    equations, assembly, loops = memory.equations, memory.assembly, memory.loops
    candidate, problem, directions = assembly.candidate, assembly.problem, assembly.directions
    jacobian, free, impulse = directions.jacobian, problem.free, assembly.answer.impulse
    first, speed = problem.first, assembly.answer.velocity
    count = list_hit(rows, modes, impact.hit, candidate, first)
    tell_parts(0, modes.watched, assembly, impulse, impact.impulse)
    if count + rows_of(loops) == 0:
        return True, 0.0, 0.0
    write_candidates(
        count, candidate, model, equations.tree, rows, first, directions.leaf, jacobian
    )
    for row in range(first[count]):
        free[row] = row_product(jacobian, row, v)
    for place in range(count):
        contact, row = candidate[place], first[place]
        if free[row] < 0.0 and plastic[contact] == 0:
            free[row] += memory.surface.restitution[contact] * free[row]
        free[row] -= nudge
    find_loops(model, begin[: model.nq], v, equations.tree, loops)
    total = append_loops(count, loops, assembly)
    free_loops(total, loops, v, 0.0, assembly)
    clear_rounding(first[count], first[total], free)
    assemble_delassus(model, total, equations, directions, problem)
    status = solve_contacts(count, False, model, memory, phase)
    note_residual(assembly.answer.residual, memory.tally)
    made = 0.0
    through = 0.0
    for row in range(first[total]):
        added = impulse[row] * row_product(jacobian, row, v)
        made += added
        through += abs(added)
    note_loops(rows, total, 1.0, first, impulse, loops)
    if saddle.used == 1:
        for j in range(model.nv):
            v[j] += saddle.unknown[j]
    else:
        add_impulse(model, first[total], impulse, directions, equations, v)
    for row in range(first[total]):  # with what brakes take, which contacts at rest do not make
        speed[row] = row_product(jacobian, row, v)
        made += impulse[row] * speed[row]
        through += abs(impulse[row] * speed[row])
    tell_parts(count, modes.watched, assembly, impulse, impact.impulse)
    for place in range(count):
        contact = candidate[place]
        normal, tangent = part_of(place, first, speed)
        rests = normal <= max(REST, 2.0 * nudge) or plastic[contact] == AT_REST
        modes.closed[contact] = 1 if rests else 0
        modes.slide[contact] = heading(tangent) if rests else 0
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        modes.slide[dry] = modes.closed[dry] * heading(v[rows.owner[dry]])
    return status == SOLVED, 0.5 * made, 0.5 * through


@kernel
def short_bounces(model: Model, ground: GroundModel, memory: Memory, work: Motion) -> bool:
    """Mark the points that would come down again too soon to follow; return whether there are any.

    Their bounces are taken to go on shrinking in the ratio of the next to the last; the geometric
    series gives the time at which they end.
    """
    phase, bounces, hit = work.phase, work.bounces, work.impact.hit
    time, state = work.step.time, work.step.begin
    modes, saddle, q, v = phase.modes, phase.saddle, state[: model.nq], state[model.nq :]
    was_closed, rows, loops = memory.reported.closed, memory.rows, memory.loops
    equations, assembly = memory.equations, memory.assembly
    candidate, problem, directions = assembly.candidate, assembly.problem, assembly.directions
    jacobian, free, first = directions.jacobian, problem.free, problem.first
    tree, rate, face, curvature = equations.tree, equations.rate, modes.face, modes.curvature
    evaluate_equations(model, q, v, equations)
    locate(q, v, model, ground, tree, rows, modes, memory.surface)
    free_acceleration(
        model, state, memory.torque, rows, modes.slide, modes.breakaway, memory.pushes, equations,
        saddle.force,
    )  # fmt: skip
    find_loops(model, q, v, tree, loops)
    count = list_closed(rows, modes, candidate, first, problem.bound)
    write_candidates(count, candidate, model, tree, rows, first, directions.leaf, jacobian)
    free_gap_accelerations(
        count, candidate, first, model, tree, rows, face, curvature, rate, jacobian, free
    )
    total = append_loops(count, loops, assembly)
    free_loops(total, loops, rate, 1.0, assembly)
    if total > 0:  # the forces of what is closed act on the rest
        assemble_delassus(model, total, equations, directions, problem)
        solve_contacts(count, True, model, memory, phase)
        if saddle.used == 0:
            add_impulse(model, first[total], assembly.answer.impulse, directions, equations, rate)
        for i in range(model.nv if saddle.used == 1 else 0):
            rate[i] = saddle.unknown[i]
    found = False
    for contact in range(modes.watched):
        touched = hit[contact] == 1 or was_closed[contact] == 1
        if modes.closed[contact] == 1 or not touched:
            continue
        row = place_candidate(contact, total, rows.components[contact], candidate, first)
        gap_rows(contact, total, model, tree, rows, first, directions.leaf, jacobian)
        free_gap_acceleration(
            contact, row, model, tree, rows, face, curvature, rate, jacobian, free
        )
        normal, _ = gap_velocity(contact, model, tree, rows, v)
        pull = -free[row]
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
    copy_words(before, begin)
    for contact in range(modes.watched):
        if rows.kind[contact] != DRY_JOINT:
            modes.closed[contact] = reported.closed[contact]
            modes.slide[contact] = reported.slipping[contact]


@kernel
def strike(model: Model, ground: GroundModel, memory: Memory, work: Motion, record: Record) -> bool:
    """Let the points in ``impact.hit`` meet the ground now, and report it; return success.

    The equations of now have been evaluated. ``memory.reported`` still holds the modes from before.
    """
    modes, impact, bounces = work.phase.modes, work.impact, work.bounces
    rows, hit, reported = memory.rows, impact.hit, memory.reported
    state, before, time = work.step.begin, impact.before, work.step.time
    copy_words(state, before)
    made = through = 0.0
    for attempt in range(2):
        solved, made, through = collide(model, 0.0, memory, work)
        if not solved:
            restore(before, reported, rows, modes, state)
            return False
        if attempt == 1 or not short_bounces(model, ground, memory, work):
            break
        restore(before, reported, rows, modes, state)
    bounces.last_blow = time
    for contact in range(modes.watched):
        if bounces.plastic[contact] != 0 and modes.closed[contact] == 0:
            # Others throw it up again, and it is followed.
            bounces.accumulation[contact] = np.inf
        bounces.plastic[contact] = 0
        if hit[contact] == 1:
            bounces.last_impact[contact] = time
    made_at = report_points(
        IMPACT, time, rows.first[SECOND_FACE], rows.normal, impact, reported.closed,
        reported.slipping, record,
    )  # fmt: skip
    report_joints(time, rows, impact.impulse, reported.closed, record.told)
    if made > NOTICEABLE_ENERGY * through:
        memory.tally.energy_gain += made
        second = second_of(made_at, rows)
        log_impulse(ENERGY_GAIN, made_at, second, time, rows.normal, impact, record)
    return True
