"""Closed loops and coupled joints as contacts that never part.

Their equations (:mod:`heelstrike.dynamics.loops`) are rows of the contact problem like those of
points and stops, with the whole line as the set of their forces. They come last among the
candidates, one a row, on the normal; there is no tangent. Accelerations that solve the problem
keep ``J v̇ + J̇ v`` at zero, velocities after an impact ``J v``. Those of a time step h keep
``J v⁺ + h/2 J̇ v`` at zero: to second order that is the chord between two poses that fit the loops,
as in the method SHAKE. With the tangent of either pose in its place, loops would brake or drive
what turns in them, by h times the cube of its speed. (The first step of a motion that begins
along the tangent has therefore half of the centripetal force.)

No error of the positions is added to these: positions are put back on the equations by themselves
(:func:`close_loops`), along the way that is shortest by the masses. So nothing drifts, and the
forces are those of the motion alone.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.separate_kernel import call_at
from heelstrike.contact.modes import STICK
from heelstrike.contact.sets import LINE
from heelstrike.dynamics.dense import solve_to_rank
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities
from heelstrike.dynamics.loops import find_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.geometry import EVERYWHERE, row_product, solve_mass_matrix, weigh
from heelstrike.sim.contacts.rows import COUPLING, LOOP, TIE, Rows
from heelstrike.sim.memory import Assembly, Equations, Loops

CLOSED = 1e-14
"""A loop is closed when its ends are no further apart than this (m, rad) …"""

ROUNDING = 1e-11
"""… or no further than this, and come no nearer."""

OFF, PUT_ON, TAKES_HOLD, HOLDS = 0, 1, 2, 3
"""A brake is off; shall hold from this instant on; does, as it could not before; holds."""

BEGINS_TO_RUB, RUBS = -2, -1
"""One that slips, since this instant and since an earlier one: no row, but dry friction."""

SAME = 1e-11
"""Two rows of a loop are multiples of each other if no more of the longer is missing."""

ATTEMPTS = 20
"""Newton's method takes three steps from where a simulation is."""


@kernel
def rows_of(loops: Loops) -> int:
    """How many rows there are now: those of loops and couplings, and of brakes that hold."""
    rows = loops.unknown.shape[0]
    for brake in range(loops.braked.shape[0]):
        if loops.braked[brake] < TAKES_HOLD:
            rows -= 1
    return rows


@kernel
def row_of(entry: int, loops: Loops) -> int:
    """Which row an entry of the table is now."""
    row = 0
    while loops.entry[row] != entry:
        row += 1
    return row


@kernel
def find_loops(model: Model, q: Floats, v: Floats, tree: Workspace, loops: Loops) -> None:
    """Write displacements, Jacobian and bias of a state whose kinematics and velocities are in."""
    find_rows(model, q, v, tree, loops.rows)
    for loop in range(model.loops):
        leave_one(loop, loops)
    row = add_ties(model, q, v, tree, loops)
    for brake in range(loops.braked.shape[0]):
        if loops.braked[brake] >= TAKES_HOLD:
            loops.entry[row] = loops.brake_entry[brake]
            joint = model.brake_joint[brake]
            loops.rows.displacement[row] = q[joint] - loops.brake_position[brake]
            loops.rows.jacobian[row, joint] = 1.0
            row += 1


@kernel
def add_ties(model: Model, q: Floats, v: Floats, tree: Workspace, loops: Loops) -> int:
    """Let the constraints that never let go write their rows; return the row after them."""
    rows, row = loops.rows, 2 * model.loops + model.couplings
    for i in range(loops.tie.shape[0]):
        code, numbers, last = loops.tie[i, 0], loops.tie[i, 1], row + loops.tie[i, 2]
        displacement, bias = rows.displacement[row:last], rows.bias[row:last]
        call_at(code, (numbers, model, tree, q, v, displacement, rows.jacobian[row:last], bias))
        row = last
    return row


@kernel
def leave_one(loop: int, loops: Loops) -> None:
    """Where one row of a loop is a multiple of the other, take the shorter away.

    So it is of a loop between a link and its parent, which locks the joint. The shorter row may be
    next to nothing, and would ask for more than there are digits.
    """
    jacobian = loops.rows.jacobian
    loops.multiple[loop, 0] = loops.multiple[loop, 1] = 0.0
    along_x, along_z, product = 0.0, 0.0, 0.0
    for j in range(jacobian.shape[1]):
        x, z = jacobian[2 * loop, j], jacobian[2 * loop + 1, j]
        along_x += x * x
        along_z += z * z
        product += x * z
    shorter = 0 if along_x < along_z else 1
    row, other, square = 2 * loop + shorter, 2 * loop + 1 - shorter, max(along_x, along_z)
    part = product / square if square > 0.0 else 0.0
    away = 0.0
    for j in range(jacobian.shape[1]):
        away = max(away, abs(jacobian[row, j] - part * jacobian[other, j]))
    if away * away <= SAME * SAME * square:
        loops.multiple[loop, shorter] = part
        loops.rows.displacement[row] = 0.0
        loops.rows.bias[row] = 0.0
        for j in range(jacobian.shape[1]):
            jacobian[row, j] = 0.0


@dissolved_kernel
def append_loops(count: int, loops: Loops, assembly: Assembly) -> int:
    """Append the rows of the loops to the candidates; return how many there are with them."""
    for row in range(rows_of(loops)):
        append_loop(row, count, loops, assembly)
        count += 1
    return count


@dissolved_kernel
def free_loops(count: int, loops: Loops, rate: Floats, time: float, assembly: Assembly) -> None:
    """Write the free terms J x + t J̇ v of the rows of the loops, the last of `count` candidates.

    Of accelerations x the time t is 1, of the velocities of an impact 0, of those of a time step
    half of it.
    """
    first = count - rows_of(loops)
    for place in range(first, count):
        row = place - first
        ahead = time * loops.rows.bias[row]
        problem = assembly.problem
        problem.free[problem.first[place]] = speed_along(row, loops, rate) + ahead


@kernel
def append_loop(row: int, count: int, loops: Loops, assembly: Assembly) -> None:
    """Write what a row of the loops brings to the contact problem, but for its free term."""
    jacobian, problem = assembly.directions.jacobian, assembly.problem
    first = problem.first[count]
    problem.first[count + 1] = first + 1
    for j in range(jacobian.shape[1]):
        jacobian[first, j] = loops.rows.jacobian[row, j]
    problem.set[count] = LINE
    problem.friction[count] = 0.0
    assembly.directions.leaf[count] = EVERYWHERE
    assembly.answer.mode[count] = STICK
    assembly.candidate[count] = loops.entry[row]


@kernel
def speed_along(row: int, loops: Loops, v: Floats) -> float:
    """Velocity, or acceleration, of the coordinates along a row of the loops."""
    return row_product(loops.rows.jacobian, row, v)


@dissolved_kernel
def note_loops(
    table: Rows, count: int, span: float, first: Integers, impulse: Floats, loops: Loops
) -> None:
    """Keep the forces of the loops, whose impulses over a span of time are the last of `count`."""
    rows = rows_of(loops)
    for row in range(rows):
        note_loop(table, row, impulse[first[count - rows + row]] / span, loops)


@dissolved_kernel
def note_loop(table: Rows, row: int, force: float, loops: Loops) -> None:
    """Keep the force of a row."""
    entry = loops.entry[row]
    owner, kind = table.owner[entry], table.kind[entry]
    if kind == LOOP:
        force_now, multiple = loops.loop_force[owner], loops.multiple[owner]
        last = table.axis[entry]
        force_now[last] = force
        for axis in range(2 if last == 1 else 0):  # of forces that do the same the least
            if multiple[axis] != 0.0:
                force_now[1 - axis] /= 1.0 + multiple[axis] * multiple[axis]
                force_now[axis] = multiple[axis] * force_now[1 - axis]
    elif kind == COUPLING:
        loops.coupling_force[owner] = force
    elif kind == TIE:
        loops.constraint_force[owner, table.axis[entry]] = force
    else:
        loops.brake_force[owner] = force


@kernel
def respond(
    rows: int, model: Model, jacobian: Floats, equations: Equations, response: Floats,
    system: Floats,
) -> None:  # fmt: skip
    """What unit forces of the loops do to the coordinates, A⁻¹ Jᵀ, and to the loops, J A⁻¹ Jᵀ.

    What the mass matrix is solved with is there.
    """
    for row in range(rows):
        for j in range(model.nv):
            response[row, j] = jacobian[row, j]
        solve_mass_matrix(model, equations, response[row])
    for row in range(rows):
        for other in range(rows):
            system[row, other] = row_product(jacobian, row, response[other])


@kernel
def push_loops(loops: Loops, v: Floats) -> None:
    """Solve for the forces of the loops, and add what they do to velocities or accelerations.

    The right-hand side is the last column of the system, after :func:`respond`.
    """
    rows = rows_of(loops)
    solve_to_rank(rows, loops.system, loops.order, loops.unknown)
    for row in range(rows):
        for j in range(v.shape[0]):
            v[j] += loops.unknown[row] * loops.response[row, j]


@kernel
def close_loops(model: Model, equations: Equations, loops: Loops, q: Floats) -> bool:
    """Move positions to where all loops are closed, the shortest way by the masses.

    Returns whether there is such a place nearby.
    """
    tree, displacement, rows = equations.tree, loops.rows.displacement, rows_of(loops)
    before = 0.0
    for attempt in range(ATTEMPTS):
        forward_kinematics(model, q, tree)
        find_loops(model, q, tree.zero, tree, loops)
        worst = 0.0
        for row in range(rows):
            worst = max(worst, abs(displacement[row]))
        if worst <= CLOSED or (attempt > 0 and worst > 0.5 * before):
            return worst <= ROUNDING
        before = worst
        weigh(model, equations)
        respond(rows, model, loops.rows.jacobian, equations, loops.response, loops.system)
        for row in range(rows):
            loops.system[row, rows] = -displacement[row]
        push_loops(loops, q)
    return False


@kernel
def steady_loops(model: Model, q: Floats, equations: Equations, loops: Loops, v: Floats) -> None:
    """Take from velocities what tears at the loops, as an impact would."""
    tree = equations.tree
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    find_loops(model, q, v, tree, loops)
    weigh(model, equations)
    rows = rows_of(loops)
    respond(rows, model, loops.rows.jacobian, equations, loops.response, loops.system)
    for row in range(rows):
        loops.system[row, rows] = -speed_along(row, loops, v)
    push_loops(loops, v)


@dissolved_kernel
def begin_closed(model: Model, q: Floats, equations: Equations, loops: Loops, v: Floats) -> bool:
    """Begin with closed loops, at which nothing tears; return whether they can be closed."""
    if rows_of(loops) > 0:
        if not close_loops(model, equations, loops, q):
            return False
        steady_loops(model, q, equations, loops, v)
    return True
