"""A state put back on its contact constraints, along the shortest way that the masses allow."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.kernels import mass_matrix
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.candidates import place_candidate
from heelstrike.sim.contacts.faces import CURVE
from heelstrike.sim.contacts.geometry import add_impulse, assemble_delassus, row_product, weigh
from heelstrike.sim.contacts.loops import append_loops
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, Rows
from heelstrike.sim.event_driven.phase import HeldRows, Modes, Phase, SaddlePoint
from heelstrike.sim.event_driven.smooth.dynamics import (
    list_closed,
    list_unknowns,
    observe_rows,
    solve_constraints,
)
from heelstrike.sim.event_driven.smooth.gaps import write_candidates
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
    entry: int, model: Model, angle: Floats, q: Floats, rows: Rows, face: Integers
) -> float:
    """Where a contact point is along the ground, less the length that its disc has rolled.

    Of a joint with dry friction it is the position. On smooth ground nobody knows: there what
    sticks is held by its velocity alone.
    """
    owner, position, normal = rows.owner[entry], rows.position[entry], rows.normal[entry]
    if rows.kind[entry] == DRY_JOINT:
        return q[owner]
    if face[entry] == CURVE:
        return 0.0
    radius = model.contact_radius[owner]
    rolled = radius * angle[model.contact_link[owner]]
    if face[entry] >= 0 and face[entry] % 2 == 1:
        # The way of the contact point round the disc that pivots on a corner.
        return radius * math.atan2(normal[0], normal[1]) - rolled
    return normal[1] * position[0] - normal[0] * position[1] - rolled


@kernel
def displacement(
    component: int, entry: int, model: Model, angle: Floats, q: Floats, rows: Rows, modes: Modes
) -> float:
    """How far a contact is along one of its rows from where its constraint wants it."""
    if component == 0:
        return rows.gap[entry]
    if modes.stuck[entry] == 1:
        place = tangential_place(entry, model, angle, q, rows, modes.face)
        return -modes.anchor[entry] + place
    return 0.0


@kernel
def move_by_saddle_point(
    size: int, model: Model, jacobian: Floats, tree: Workspace, matrix: Floats, held: HeldRows,
    saddle: SaddlePoint, along: Floats,
) -> None:  # fmt: skip
    """Change positions, or velocities, by as little as the masses allow for the rows to come right.

    What each row is wrong by is in ``saddle.bias``.
    """
    mass_matrix(model, tree, matrix)
    for k in range(size):
        held.friction_ratio[k] = 0.0
    write_equations(size, model.nv, matrix, jacobian, held, saddle.system)
    for i in range(model.nv):
        saddle.system[i, model.nv + size] = 0.0
    for k in range(size):
        saddle.system[model.nv + k, model.nv + size] = -saddle.bias[k]
    solve_saddle_point(model.nv + size, saddle)
    for i in range(model.nv):
        along[i] += saddle.unknown[i]


@kernel
def list_sunk(
    count: int, rows: Rows, modes: Modes, fired: Integers, candidate: Integers, first: Integers
) -> int:
    """Append the open contacts that are beyond the ground, or their range, by rounding.

    What reaches the ground in this instant is none of them: it is the instant that is corrected.
    Returns how many candidates there are then.
    """
    for contact in range(rows.end[CONSTRAINT]):
        if modes.closed[contact] == 1 or fired[2 * contact] == 1 or modes.passing[contact] == 1:
            continue
        if -DEEP < rows.gap[contact] < -SHALLOW:
            place_candidate(contact, count, rows.components[contact], candidate, first)
            count += 1
    return count


@kernel
def project(
    model: Model, ground: GroundModel, equations: Equations, rows: Rows, surface: Surface,
    assembly: Assembly, loops: Loops, phase: Phase, state: Floats,
) -> tuple[float, float, float]:  # fmt: skip
    """Put a state back on its contact constraints, along the shortest way that the masses allow.

    Closed points return to the ground, sticking ones (and joints) to where they began to stick,
    ends of loops to each other, and their velocities along these directions vanish. What is open
    and a little beyond its limit is put there, too.

    Returns how far (m) the worst is left from its place - constraints that say the same twice need
    not agree - and how far it was off, and how fast (m/s), to begin with.
    """
    modes, held = phase.modes, phase.held
    candidate, problem, directions = assembly.candidate, assembly.problem, assembly.directions
    jacobian, impulse, first = directions.jacobian, assembly.answer.impulse, problem.first
    tree, q, v = equations.tree, state[: model.nq], state[model.nq :]
    system, row = held.system, held.row
    strayed, fastest = 0.0, 0.0
    for attempt in range(5):
        observe_rows(state, model, ground, tree, rows, modes, surface, loops)
        weigh(model, equations)
        count = list_closed(rows, modes, candidate, first, problem.bound)
        if attempt < 4:
            count = list_sunk(count, rows, modes, phase.watch.fired, candidate, first)
        write_candidates(count, candidate, model, tree, rows, first, directions.leaf, jacobian)
        total = append_loops(count, loops, assembly)
        if total == 0:
            return 0.0, strayed, 0.0
        assemble_delassus(model, total, equations, directions, problem)
        size = list_unknowns(count, total, candidate, first, surface.friction, modes, held)
        worst = 0.0
        for i in range(size):
            place = held.place[i]
            component, entry = row[i] - first[place], candidate[place]
            if place < count:
                error = displacement(component, entry, model, tree.angle, q, rows, modes)
            else:
                error = loops.rows.displacement[place - count]
            system[i, size] = -error
            worst = max(worst, abs(error))
        if attempt == 0:
            strayed = worst
        positions = worst > IN_PLACE and attempt < 4
        if not positions:
            for i in range(size):
                speed = row_product(jacobian, row[i], v)
                system[i, size] = -speed
                fastest = max(fastest, abs(speed))
        for i in range(size):
            phase.saddle.bias[i] = -system[i, size]
        rank = solve_constraints(size, 0.0, problem.delassus, held)
        along = q if positions else v
        if is_delicate(size, rank, system):
            move_by_saddle_point(
                size, model, jacobian, tree, equations.mass_matrix, held, phase.saddle, along
            )
        else:
            for i in range(first[total]):
                impulse[i] = 0.0
            for i in range(size):
                impulse[row[i]] = held.unknown[i]
            add_impulse(model, first[total], impulse, directions, equations, along)
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
def explained(
    before: Floats, after: Floats, times: float, relative: float, absolute: float
) -> bool:
    """Whether some multiple of the error that a step may make explains how far a state moved."""
    size = before.shape[0]
    total = 0.0
    for i in range(size):
        scale = absolute + relative * max(abs(before[i]), abs(after[i]))
        total += ((after[i] - before[i]) / scale) ** 2
    return bool(total <= size * times**2)
