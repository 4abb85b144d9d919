"""A state put back on its contact constraints, along the shortest way that the masses allow."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.faces import CURVE
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    row_product,
    weigh,
)
from heelstrike.sim.contacts.loops import append_loops, find_loops, row_of, rows_of
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, LOOP, POINT, SECOND_FACE, Rows
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import HeldRows, Modes, Phase, SaddlePoint, Step
from heelstrike.sim.event_driven.smooth.dynamics import (
    gather_closed,
    list_unknowns,
    observe_faces,
    solve_constraints,
)
from heelstrike.sim.event_driven.smooth.gaps import gap_now, gap_rows
from heelstrike.sim.event_driven.smooth.saddle_point import (
    is_delicate,
    solve_saddle_point,
    write_equations,
)
from heelstrike.sim.memory import Assembly, Equations, Loops, Surface

# How far a projection may move a state, as a multiple of the error that a step may make: the end of
# a step, beyond which the motion has not kept its constraints, and a place on its dense output.
EXPLAINED, INTERPOLATED = 100.0, 1e4
# How far (m, rad) what is open may be beyond its limit to be put back on it: less is nothing, more
# is no rounding.
SHALLOW, DEEP = 2e-11, 1e-8
# Positions that are no further off (m, rad) than this are right but for rounding of a metre.
IN_PLACE = 1e-14
# How far (m, rad) and how fast (m/s, rad/s) a state may be off its constraints as it is.
PLACED, STILL = 5e-11, 1e-9


@kernel
def tangential_place(
    model: Model, angle: Floats, contacts: Contacts, contact: int, rows: Rows, seconds: Contacts,
    face: Integers,
) -> float:  # fmt: skip
    """Where a contact point is along the ground, less the length that its disc has rolled.

    On smooth ground nobody knows: there what sticks is held by its velocity alone.
    """
    if face[contact] == CURVE:
        return 0.0
    point = rows.owner[contact]
    its = seconds if rows.kind[contact] == SECOND_FACE else contacts
    position, normal, radius = its.position[point], its.normal[point], model.contact_radius[point]
    rolled = radius * angle[model.contact_link[point]]
    if face[contact] >= 0 and face[contact] % 2 == 1:
        # The way of the contact point round the disc that pivots on a corner.
        return radius * math.atan2(normal[0], normal[1]) - rolled
    return normal[1] * position[0] - normal[0] * position[1] - rolled


@kernel
def displacement(
    row: int, model: Model, angle: Floats, contacts: Contacts, candidate: Integers, loops: Loops,
    rows: Rows, seconds: Contacts, modes: Modes, face: Integers, state: Floats,
) -> float:  # fmt: skip
    """How far a candidate is along its row from where its constraint wants it."""
    contact = candidate[row // 2]
    if rows.kind[contact] >= LOOP:
        return loops.rows.displacement[row_of(contact, loops)]
    if row % 2 == 0:
        return gap_now(contact, rows, state)
    if rows.kind[contact] == DRY_JOINT:
        return state[rows.owner[contact]] - modes.anchor[contact]
    if modes.stuck[contact] == 1:
        return -modes.anchor[contact] + tangential_place(
            model, angle, contacts, contact, rows, seconds, face
        )
    return 0.0


@kernel
def move_by_saddle_point(
    size: int, model: Model, jacobian: Floats, equations: Equations, held: HeldRows,
    saddle: SaddlePoint, along: Floats,
) -> None:  # fmt: skip
    """Change positions, or velocities, by as little as the masses allow for the rows to come right.

    What each row is wrong by is in ``saddle.bias``.
    """
    for k in range(size):
        held.lean[k] = 0.0
    write_equations(size, model, jacobian, held, equations, saddle.system)
    for i in range(model.nv):
        saddle.system[i, model.nv + size] = 0.0
    for k in range(size):
        saddle.system[model.nv + k, model.nv + size] = -saddle.bias[k]
    solve_saddle_point(model.nv + size, saddle)
    for i in range(model.nv):
        along[i] += saddle.unknown[i]


@kernel
def gather_sunk(
    count: int, model: Model, contacts: Contacts, state: Floats, rows: Rows, seconds: Contacts,
    modes: Modes, fired: Integers, loops: Loops, equations: Equations, assembly: Assembly,
) -> int:  # fmt: skip
    """Append the open contacts that are beyond the ground, or their range, by rounding.

    After those that are closed, and before the loops. What reaches the ground in this instant is
    none of them: it is the instant that is corrected. Returns how many there are.
    """
    sunk = 0
    for contact in range(rows.end[CONSTRAINT]):
        if modes.closed[contact] == 1 or fired[2 * contact] == 1:
            continue
        if rows.kind[contact] == POINT and modes.passing[contact] == 1:
            continue
        if -DEEP < gap_now(contact, rows, state) < -SHALLOW:
            place = count + sunk
            gap_rows(model, equations.tree, contacts, rows, seconds, contact, place, assembly)
            assembly.candidate[place] = contact
            sunk += 1
    if sunk > 0:
        total = append_loops(count + sunk, loops, assembly)
        assemble_delassus(model, total, equations, assembly)
    return sunk


@kernel
def list_sunk(size: int, count: int, sunk: int, loop_rows: int, held: HeldRows) -> int:
    """List the rows of what :func:`gather_sunk` found after the `size` others; return how many."""
    for k in range(size - loop_rows, size):  # those of the loops have been listed in their place
        held.row[k] += 2 * sunk
    for place in range(count, count + sunk):
        held.row[size] = 2 * place
        held.lean[size] = 0.0
        size += 1
    return size


@kernel
def project(
    model: Model, ground: GroundModel, rows: Rows, equations: Equations, contacts: Contacts,
    surface: Surface, assembly: Assembly, loops: Loops, seconds: Contacts, phase: Phase,
    state: Floats,
) -> tuple[float, float, float]:  # fmt: skip
    """Put a state back on its contact constraints, along the shortest way that the masses allow.

    Closed points return to the ground, sticking ones (and joints) to where they began to stick,
    ends of loops to each other, and their velocities along these directions vanish. What is open
    and a little beyond its limit is put there, too.

    Returns how far (m) the worst is left from its place - constraints that say the same twice need
    not agree - and how far it was off, and how fast (m/s), to begin with.
    """
    held = phase.held
    q, v = state[: model.nq], state[model.nq :]
    system, row, loop_rows = held.system, held.row, rows_of(loops)
    strayed, fastest = 0.0, 0.0
    for attempt in range(5):
        observe_faces(
            model, ground, state, phase.modes, rows, seconds, phase.faces, equations.tree, contacts,
            surface,
        )  # fmt: skip
        weigh(model, equations)
        if loop_rows > 0:
            find_loops(model, q, v, equations.tree, loops)
        count = gather_closed(
            model, contacts, rows, seconds, phase.modes, loops, equations, assembly
        )
        sunk = 0
        if attempt < 4:
            sunk = gather_sunk(
                count, model, contacts, state, rows, seconds, phase.modes, phase.watch.fired, loops,
                equations, assembly,
            )  # fmt: skip
        total = count + sunk + loop_rows
        if total == 0:
            return 0.0, strayed, 0.0
        size = list_unknowns(
            count, loop_rows, assembly.candidate, surface.friction, phase.modes, held
        )
        if sunk > 0:
            size = list_sunk(size, count, sunk, loop_rows, held)
        worst = 0.0
        for i in range(size):
            error = displacement(
                row[i], model, equations.tree.angle, contacts, assembly.candidate, loops, rows,
                seconds, phase.modes, phase.faces.face, state,
            )  # fmt: skip
            system[i, size] = -error
            worst = max(worst, abs(error))
        if attempt == 0:
            strayed = worst
        positions = worst > IN_PLACE and attempt < 4
        if not positions:
            for i in range(size):
                speed = row_product(assembly.jacobian, row[i], v)
                system[i, size] = -speed
                fastest = max(fastest, abs(speed))
        for i in range(size):
            phase.saddle.bias[i] = -system[i, size]
        rank = solve_constraints(size, 0.0, assembly.problem.delassus, held)
        if is_delicate(size, rank, system):
            move_by_saddle_point(
                size, model, assembly.jacobian, equations, held, phase.saddle, q if positions else v
            )
        else:
            for i in range(2 * total):
                assembly.answer.impulse[i] = 0.0
            for i in range(size):
                assembly.answer.impulse[row[i]] = held.unknown[i]
            add_impulse(model, assembly, total, equations, q if positions else v)
        if not positions:
            return worst, strayed, fastest
    return math.inf, strayed, fastest


@kernel
def is_in_place(strayed: float, fastest: float) -> bool:
    """Whether a state off its constraints by so much (m, m/s) need not be put there.

    Beside a singular pose, as of straight legs that coincide, the rounding of a gap is worth a
    large move of the joints, which nothing asks for.
    """
    return strayed <= PLACED and fastest <= STILL


@kernel
def explained(before: Floats, after: Floats, times: float, step: Step) -> bool:
    """Whether some multiple of the error that a step may make explains how far a state moved."""
    size = before.shape[0]
    total = 0.0
    for i in range(size):
        scale = step.absolute + step.relative * max(abs(before[i]), abs(after[i]))
        total += ((after[i] - before[i]) / scale) ** 2
    return bool(total <= size * times**2)
