"""A robot of which ground and loops hold something: one set of rows, solved once, for all uses.

Feet that stand and loops that are closed are rows C of a Jacobian with ``C v = 0`` and
``C v̇ = −Ċ v``. In general the rows' rates are a `target` t, C x = t, which may be dependent rows:
heel and toe of one flat foot hold three coordinates by four. Gauss–Jordan elimination, E C = R,
solves them for as many coordinates d as their rank, by the others i,

    x_d = E t − R x_i        that is   x = N x_i + N₀ t.

The forces λ of the rows do no work on what they let happen, Nᵀ Cᵀ = 0. So of a generalised force
f = A v̇ + H − … that motors, ground and loops must supply, Nᵀ f is left to the motors of the
independent coordinates, and Cᵀ λ = f on the others tells λ = Eᵀ f_d; of dependent rows E also holds
what C does not see, which is taken out: λ is the shortest. (Paper eq. 31-37, with every product
carried out by recursion instead of as matrices; R. Featherstone 2008, *Rigid body dynamics
algorithms*, section 8.)

Where instead the torques are given, A (x − x₀) = Cᵀ λ: x₀ is changed as little, in the metric of A,
as makes C x = t. Of a velocity that is a plastic impact, of an acceleration what the constraints
make of it (Gauss's principle). Of dependent rows those that were solved will do.

Which coordinates depend is found by value, from complete pivoting, or known: :func:`solve_row`
alone branches on nothing, and is traced by CasADi with pivots that the structure tells.
"""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.dense import solve_positive
from heelstrike.dynamics.kernels import factorize, mass_matrix, solve_factorized
from heelstrike.dynamics.loops import LoopRows, find_rows
from heelstrike.dynamics.places import bias_at, place_of, velocity_at
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.tolerances import NO_PIVOT

FREE = -1
"""What stands for the row of a coordinate that is independent, and the coordinate of no row."""


class HeldRows(Bundle):
    """What holds of the rates x of a robot, (nv,): C x = target."""

    count: int = cell(int)
    """Rows so far."""
    rows: Floats = array("held", "nv")
    """C."""
    solved: Floats = array("held", "nv")
    """R: what a dependent coordinate takes of the independent ones; zero in rows that say nothing
    new."""
    target: Floats = array("held")
    """Rates of the rows: zero of velocities, −Ċ v of accelerations."""
    mix: Floats = array("held", "held")
    """E: what of C each row of R is made of. Of rows that say nothing new, an orthonormal basis of
    forces that nothing feels."""
    coordinate: Integers = array("held", of=int)
    """The one that each row was solved for, ``FREE`` if it says nothing new."""
    row: Integers = array("nv", of=int)
    """Row of each dependent coordinate, ``FREE`` for the others."""
    loops: LoopRows = part(LoopRows)
    """Equations of closed loops and couplings."""


class Reaction(Bundle):
    """How a robot answers the forces of its :class:`HeldRows`."""

    matrix: Floats = array("nv", "nv")
    factor: Floats = array("nv", "nv")
    """matrix, factor: A, and its factorisation."""
    response: Floats = array("held", "nv")
    """A⁻¹ Cᵀ, row by row."""
    delassus: Floats = array("held", "held")
    """C A⁻¹ Cᵀ; used up."""
    force: Floats = array("held")
    """Forces, or impulses, along the rows of C, the shortest there are."""


@kernel
def add_place(
    model: Model, work: Workspace, link: int, position: Floats, components: int, held: HeldRows
) -> None:
    """Add rows of a point of a link, at rest: along x and z and, of three, the link's rotation."""
    first, rows = held.count, held.rows
    for k in range(components):
        held.target[first + k] = 0.0
        for j in range(model.nv):
            rows[first + k, j] = 0.0
    place = place_of(work, position)
    j = link
    while j >= 0:
        rows[first, j], rows[first + 1, j] = velocity_at(work.motion, j, place)
        if components == 3:
            rows[first + 2, j] = work.motion[j, 0]
        j = model.parent[j]
    held.count = first + components


@kernel
def add_row(factors: Floats, held: HeldRows) -> None:
    """Add a row of one's own, (nv,), at rest."""
    for j in range(held.row.shape[0]):
        held.rows[held.count, j] = factors[j]
    held.target[held.count] = 0.0
    held.count += 1


@kernel
def add_loops(model: Model, q: Floats, v: Floats, work: Workspace, held: HeldRows) -> None:
    """Add the rows of closed loops and couplings, at rest; what they are is in `held.loops`."""
    loops = held.loops
    count = loops.bias.shape[0]
    if count > 0:
        find_rows(model, q, v, work, loops)
    for row in range(count):
        for j in range(model.nv):
            held.rows[held.count + row, j] = loops.jacobian[row, j]
        held.target[held.count + row] = 0.0
    held.count += count


@kernel
def keep_place(
    work: Workspace, link: int, center: Floats, components: int, first: int, held: HeldRows
) -> None:
    """Let the rows of a point, from `first` on, be of accelerations: their targets are −Ċ v.

    It is that of the centre of a disc: a disc that rolls neither leaves the ground nor slides.
    """
    x, z = bias_at(work, link, place_of(work, center))
    held.target[first], held.target[first + 1] = -x, -z
    if components == 3:
        held.target[first + 2] = -work.bias_acceleration[link, 0]


@kernel
def keep_loops(first: int, held: HeldRows) -> None:
    """Let the rows of the loops, from `first` on, be of accelerations."""
    for row in range(held.loops.bias.shape[0]):
        held.target[first + row] = -held.loops.bias[row]


@kernel
def begin_solving(held: HeldRows) -> None:
    """Let no row be solved."""
    for j in range(held.row.shape[0]):
        held.row[j] = FREE
    for i in range(held.count):
        held.coordinate[i] = FREE
        for j in range(held.row.shape[0]):
            held.solved[i, j] = held.rows[i, j]
        for k in range(held.count):
            held.mix[i, k] = 1.0 if i == k else 0.0


@kernel
def take_out(row: int, coordinate: int, other: int, held: HeldRows) -> None:
    """Take a row that is solved for a coordinate out of another."""
    rows, mix = held.solved, held.mix
    ratio = rows[other, coordinate]
    for j in range(held.row.shape[0]):
        rows[other, j] -= ratio * rows[row, j]
    for k in range(held.count):
        mix[other, k] -= ratio * mix[row, k]
    rows[other, coordinate] = 0.0


@kernel
def solve_row(row: int, coordinate: int, held: HeldRows) -> None:
    """Solve a row for a coordinate, and take it out of the other rows."""
    rows, mix, count = held.solved, held.mix, held.count
    inverse = 1.0 / rows[row, coordinate]
    for j in range(held.row.shape[0]):
        rows[row, j] = inverse * rows[row, j]
    for k in range(count):
        mix[row, k] = inverse * mix[row, k]
    rows[row, coordinate] = 1.0
    for i in range(count):
        if i != row:
            take_out(row, coordinate, i, held)
    held.coordinate[row] = coordinate
    held.row[coordinate] = row


@kernel
def solve_unit_rows(preferred: Integers, held: HeldRows) -> int:
    """Solve rows for preferred coordinates that they have as they are; return how many.

    So the trunk's x, z and rotation are in the rows of a place: these pivots need no search, and
    most of the other rows have nothing to take out.
    """
    rows, mix, count = held.solved, held.mix, held.count
    solved = 0
    for i in range(count):
        for k in range(preferred.shape[0]):
            coordinate = preferred[k]
            entry = rows[i, coordinate]
            if abs(entry) != 1.0:
                continue
            if entry < 0.0:
                for j in range(held.row.shape[0]):
                    rows[i, j] = -rows[i, j]
                for j in range(count):
                    mix[i, j] = -mix[i, j]
            for other in range(count):
                if other != i and rows[other, coordinate] != 0.0:
                    take_out(i, coordinate, other, held)
            held.coordinate[i] = coordinate
            held.row[coordinate] = i
            solved += 1
            break
    return solved


@kernel
def largest_left(coordinate: int, held: HeldRows) -> tuple[float, int]:
    """Largest entry of a coordinate in the rows that are not solved yet, and its row."""
    best = 0.0
    row = FREE
    for i in range(held.count):
        if held.coordinate[i] == FREE and abs(held.solved[i, coordinate]) > best:
            best = abs(held.solved[i, coordinate])
            row = i
    return best, row


@kernel
def solve_rows(preferred: Integers, held: HeldRows) -> int:
    """Solve the rows by their largest entries, or by entries of one; return their rank.

    Coordinates that are preferred, those without a motor, are solved for before others.
    """
    count, size = held.count, held.row.shape[0]
    begin_solving(held)
    rank = solve_unit_rows(preferred, held)
    if rank == count:
        return rank
    largest = 0.0
    for i in range(count):
        for j in range(size):
            largest = max(largest, abs(held.rows[i, j]))
    for others in range(2):
        while rank < count:
            best = NO_PIVOT * largest
            row = FREE
            coordinate = FREE
            for k in range(size if others == 1 else preferred.shape[0]):
                j = k if others == 1 else preferred[k]
                if held.row[j] == FREE:
                    entry, place = largest_left(j, held)
                    if entry > best:
                        best = entry
                        row = place
                        coordinate = j
            if row == FREE:
                break
            solve_row(row, coordinate, held)
            rank += 1
    if rank < count:
        find_unfelt(held)
    return rank


@kernel
def find_unfelt(held: HeldRows) -> None:
    """Make what rows that say nothing new are mixed of orthonormal: forces that nothing feels."""
    mix, count = held.mix, held.count
    for i in range(count):
        if held.coordinate[i] != FREE:
            continue
        for j in range(held.row.shape[0]):
            held.solved[i, j] = 0.0
        for before in range(i):
            if held.coordinate[before] == FREE:
                along = 0.0
                for k in range(count):
                    along += mix[before, k] * mix[i, k]
                for k in range(count):
                    mix[i, k] -= along * mix[before, k]
        square = 0.0
        for k in range(count):
            square += mix[i, k] * mix[i, k]
        for k in range(count):
            mix[i, k] /= square**0.5


@kernel
def given(row: int, held: HeldRows) -> float:
    """What the targets give to the coordinate of a solved row: an entry of E t."""
    total = 0.0
    for k in range(held.count):
        total += held.mix[row, k] * held.target[k]
    return total


@kernel
def complete(held: HeldRows, x: Floats) -> None:
    """Write the dependent of the rates x, (nv,), by the independent ones: C x is then the target.

    `x` may be an array of the bundle's user only.
    """
    for i in range(held.count):
        if held.coordinate[i] != FREE:
            total = given(i, held)
            for j in range(held.row.shape[0]):
                if held.row[j] == FREE:
                    total -= held.solved[i, j] * x[j]
            x[held.coordinate[i]] = total


@kernel
def left_to_motors(coordinate: int, force: Floats, held: HeldRows) -> float:
    """An entry of Nᵀ f: what of a generalised force (nv,) an independent coordinate must supply."""
    total = force[coordinate]
    for i in range(held.count):
        if held.coordinate[i] != FREE:
            total -= held.solved[i, coordinate] * force[held.coordinate[i]]
    return total


@kernel
def find_left(force: Floats, held: HeldRows, rest: Floats) -> None:
    """Write Nᵀ f, (nv,), zero at dependent coordinates."""
    for j in range(rest.shape[0]):
        rest[j] = left_to_motors(j, force, held) if held.row[j] == FREE else 0.0


@kernel
def force_of_row(row: int, force: Floats, held: HeldRows) -> float:
    """An entry of Eᵀ f_d: what a row of C exerts of a generalised force (nv,).

    Of dependent rows, one of many solutions; see :func:`forces_of_rows`.
    """
    total = 0.0
    for i in range(held.count):
        if held.coordinate[i] != FREE:
            total += held.mix[i, row] * force[held.coordinate[i]]
    return total


@kernel
def shorten(held: HeldRows, force: Floats) -> None:
    """Take out of forces of the rows of C, (held,), what nothing feels."""
    for i in range(held.count):
        if held.coordinate[i] == FREE:
            along = 0.0
            for k in range(held.count):
                along += held.mix[i, k] * force[k]
            for k in range(held.count):
                force[k] -= along * held.mix[i, k]


@kernel
def forces_of_rows(force: Floats, held: HeldRows, exerted: Floats) -> None:
    """Forces λ (held,) of the rows of C in a generalised force (nv,), the shortest there are."""
    for row in range(held.count):
        exerted[row] = force_of_row(row, force, held)
    shorten(held, exerted)


@kernel
def find_response(model: Model, held: HeldRows, work: Workspace, reaction: Reaction) -> None:
    """Find how the robot answers forces along the rows."""
    mass_matrix(model, work, reaction.matrix)
    factorize(model, reaction.matrix, reaction.factor)
    for i in range(held.count):
        for j in range(model.nv):
            reaction.response[i, j] = held.rows[i, j]
        solve_factorized(model, reaction.factor, reaction.response[i])


@kernel
def change_least(held: HeldRows, reaction: Reaction, x: Floats) -> None:
    """Change rates (nv,) as little as makes C x the target, in the metric of the mass matrix."""
    count, size, force, delassus = held.count, x.shape[0], reaction.force, reaction.delassus
    for i in range(count):
        force[i] = 0.0
        for k in range(i + 1):
            delassus[i, k] = 1.0 if i == k else 0.0
        if held.coordinate[i] == FREE:
            continue
        force[i] = held.target[i]
        for j in range(size):
            force[i] -= held.rows[i, j] * x[j]
        for k in range(i + 1):
            if held.coordinate[k] != FREE:
                entry = 0.0
                for j in range(size):
                    entry += held.rows[i, j] * reaction.response[k, j]
                delassus[i, k] = entry
    solve_positive(count, delassus, force)
    for i in range(count):
        for j in range(size):
            x[j] += force[i] * reaction.response[i, j]
    shorten(held, force)
