"""The derivative of a step of time stepping, by implicit differentiation of what is active in it.

A step (:mod:`heelstrike.sim.time_stepping.method`) finds v⁺ and the impulses λ from

    A' (v⁺ − v) = h (B Γ + passive − H − …) + Jᵀ λ,        J_i v⁺ + c_i = 0 of every active row i,

with A' the mass matrix and what a scheme adds to it, and c the gap over h, what restitution asks
or the turning of a loop. Contacts that stay open have no row, one that slips has no tangent row,
and its normal impulse acts along J_n ∓ μ J_t. While it stays so, these equations hold in disturbed
steps too, and with r of :mod:`heelstrike.contact.linearized.partials`, at a = (v⁺ − v)/h,

    A' dv⁺ − Pᵀ dλ = A' dv − h ∂r,        J_i dv⁺ = −∂(J_i v⁺ + c_i).

Rows may depend on each other, as those of a flat foot do: impulses are not unique then, velocities
are. An impact that is whole within a step is a second such problem beside that of the positions.
Positions are then put back on the equations of loops and brakes (:mod:`.closing`), which is
differentiated apart.
"""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.linearized.partials import (
    Balance,
    Partials,
    allocate_balance,
    find_partials,
    partial_program,
)
from heelstrike.contact.modes import OPEN, SLIP_FORWARD, STICK
from heelstrike.contact.sets import LINE, row_of
from heelstrike.dynamics.dense import triangulate
from heelstrike.dynamics.kernels import forward_kinematics
from heelstrike.dynamics.loops import LoopRows, count_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.rows import (
    BRAKE,
    DRY_JOINT,
    LOOP,
    POINT,
    STOP,
    Rows,
    lay_out_rows,
)
from heelstrike.sim.memory import Assembly, Surface
from heelstrike.sim.push import Pushes, add_push_slopes
from heelstrike.sim.time_stepping.impact import Impact
from heelstrike.sim.time_stepping.method import (
    LINEARLY_IMPLICIT,
    MOREAU_JEAN,
    PAPER_EXPLICIT,
    is_linearised,
)


class ActiveRows(Bundle):
    """The active rows of a contact problem, and what their impulses do."""

    held: Floats = array("rows", "nv")
    """Active rows J."""
    change: Floats = array("rows", "columns")
    """∂(J v⁺ + c) of them."""
    response: Floats = array("nv", "width")
    """What the impulses do to the velocity, A'⁻¹ Pᵀ, then what the velocity would do without."""
    system: Floats = array("rows", "width")
    order: Integers = array("rows", of=int)
    """system, order: Equations of the impulses."""
    rubbing: Floats = array("rows")
    """Change of the tangential impulse of a point that slips by the ground's friction."""
    point: Integers = array("rows", of=int)
    """Which point that is."""
    rank: int = cell(int)
    """How many active rows are independent."""


class StepSlopes(Bundle):
    """A step, and its derivative by (q, v), the torques, numbers of the robot and friction."""

    q: Floats = array("nq")
    v: Floats = array("nv")
    """q, v: The state before."""
    balance: Balance = part(Balance)
    partials: Partials = part(Partials)
    """balance, partials: The equations of the step."""
    pushed_by_q: Floats = array("nv", "nq")
    """What position does to the generalised force of pushes."""
    turning: float = cell(float)
    """The part of the step in which loops turn: half of it, none of one in which a brake takes
    hold."""
    bounce_by_q: Floats = array("2 nc", "nq")
    """What position does to the velocities of the points before the step."""
    loops: LoopRows = part(LoopRows)
    tree: Workspace = part(Workspace)
    """loops, tree: Scratch."""
    dated: Integers = array(1, of=int)
    """Zero: velocities are looked at, not accelerations."""
    program: int = cell(int)
    """Address of the code that finds the partial derivatives."""
    rubs: int = cell(int)
    """Whether friction of the ground is the last number by which is differentiated."""
    active: ActiveRows = part(ActiveRows)
    """What was active in the problem that was looked at last."""
    arriving: Floats = array("nv", "columns")
    after: Floats = array("nv", "columns")
    """arriving, after: Derivatives of the velocity that positions move with where there is an
    impact, and of that after the step."""
    state: Floats = array("nx", "columns")
    """Derivative of the state after by position, velocity, torques and numbers before."""


def allocate_slopes(
    robot: Robot, numbers: tuple[str, ...] = (), *, friction: bool = False
) -> StepSlopes:
    """Allocate the derivative of a step, by some `numbers` of the robot and by friction."""
    model = robot.model
    balance, partials = allocate_balance(model, numbers)
    rows = 2 * len(lay_out_rows(robot).kind)
    columns = robot.nq + robot.nv + robot.nu + partials.lacking_by_numbers.shape[1] + friction
    extents = {
        **model.extents, "components": 2, "rows": rows, "columns": columns,
        "loop_rows": count_rows(model), "width": rows + columns, "nx": robot.nq + robot.nv,
    }  # fmt: skip
    return StepSlopes.allocate(
        extents,
        balance=balance,
        partials=partials,
        loops=LoopRows.allocate(extents),
        tree=Workspace.allocate(extents),
        active=ActiveRows.allocate(extents),
        program=partial_program(model, dated=False, numbers=numbers),
        rubs=int(friction),
        turning=0.5,
    )


@kernel
def differentiate_step(
    model: Model, step: float, scheme: int, stiffness: Floats, next_v: Floats, added: Floats,
    normal: Floats, table: Rows, surface: Surface, assembly: Assembly, impact: Impact,
    pushes: Pushes, slopes: StepSlopes,
) -> None:  # fmt: skip
    """Differentiate the step that has just been taken from ``slopes.q``, ``slopes.v``.

    Its contact problem is still there; where an impact fell into it, both are.

    Parameters
    ----------
    stiffness, next_v, added, normal, table, surface, assembly, pushes
        As the simulation's memory has them; `added` is that of its equations, `normal` that of its
        contacts.
    impact : Impact
        Of the method.
    slopes : StepSlopes
        Receives the derivative.
    """
    pose_balance(slopes.q, slopes.v, added, normal, slopes.balance)
    if pushes.link.shape[0] > 0:
        find_pushes(model, slopes.q, pushes, slopes.tree, slopes.pushed_by_q)
    bounces = False
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        bounces = bounces or surface.restitution[assembly.candidate[place]] > 0.0
    if bounces:
        evaluate(model, slopes.v, slopes)
        copy_words(slopes.partials.along_by_q, slopes.bounce_by_q)
    linearised, pushed = is_linearised(scheme), pushes.link.shape[0] > 0
    if impact.happens == 1:
        differentiate_problem(
            model, step, scheme, stiffness, pushed, table, surface, assembly, impact.arriving,
            impact.arriving_impulse, impact.arriving_mode, True, False, slopes, slopes.arriving,
        )  # fmt: skip
    answer = assembly.answer
    gaps = linearised and impact.happens == 0
    bounces = bounces and not gaps
    differentiate_problem(
        model, step, scheme, stiffness, pushed, table, surface, assembly, next_v, answer.impulse,
        answer.mode, gaps, bounces, slopes, slopes.after,
    )  # fmt: skip
    moves = slopes.arriving if impact.happens == 1 else slopes.after
    write_state(model.nq, scheme, step, moves, slopes.after, slopes.state)


@kernel
def find_pushes(
    model: Model, q: Floats, pushes: Pushes, tree: Workspace, pushed_by_q: Floats
) -> None:
    """Write what position does to the generalised force of the pushes that act in the step."""
    for i in range(pushed_by_q.shape[0]):
        for j in range(pushed_by_q.shape[1]):
            pushed_by_q[i, j] = 0.0
    forward_kinematics(model, q, tree)
    add_push_slopes(model, tree, pushes, pushed_by_q)


@kernel
def pose_balance(q: Floats, v: Floats, added: Floats, normal: Floats, balance: Balance) -> None:
    """Write what all equations of a step have in common."""
    copy_words(q, balance.q)
    copy_words(v, balance.v)
    copy_words(added, balance.added)
    copy_words(normal, balance.normal)


@kernel
def evaluate(model: Model, going: Floats, slopes: StepSlopes) -> None:
    """Find the partial derivatives, with the points going at a velocity."""
    copy_words(going, slopes.balance.going)
    find_partials(
        model, slopes.program, slopes.dated, slopes.tree, slopes.loops, slopes.balance,
        slopes.partials,
    )  # fmt: skip


@kernel
def differentiate_problem(
    model: Model, step: float, scheme: int, stiffness: Floats, pushed: bool, table: Rows,
    surface: Surface, assembly: Assembly, after: Floats, impulse: Floats, mode: Integers,
    gaps: bool, bounces: bool, slopes: StepSlopes, result: Floats,
) -> None:  # fmt: skip
    """Write the derivative of a velocity that a contact problem of the step has found.

    Parameters
    ----------
    pushed : bool
        Whether there are pushes.
    after, impulse, mode : (nv,), (2 capacity,) and (capacity,) array
        The velocity, and the answer of the problem.
    gaps, bounces : bool
        Whether gaps are in its free terms, and restitution.
    result : (nv, columns) float
        Receives the derivative.
    """
    balance = slopes.balance
    for j in range(model.nv):
        balance.acceleration[j] = (after[j] - slopes.v[j]) / step
    for contact in range(model.nc):
        balance.push[contact, 0] = balance.push[contact, 1] = 0.0
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        for k in range(2):
            balance.push[assembly.candidate[place], k] = impulse[2 * place + k] / step
    balance.ahead[1] = slopes.turning * step
    pulling = 0  # rows of loops come first among those that always hold, brakes after them
    for place in range(assembly.begin[LOOP], assembly.until[LOOP]):
        if pulling < balance.pull.shape[0]:
            balance.pull[pulling] = impulse[row_of(place, assembly.problem.first)] / step
            pulling += 1
    evaluate(model, after, slopes)
    rows, partials = slopes.active, slopes.partials
    rate = 1.0 / step if gaps else 0.0
    bounce = slopes.bounce_by_q
    candidate = assembly.candidate
    active = write_points(
        model, assembly.until[POINT], candidate, impulse, mode, rate, bounces, bounce,
        surface.friction, surface.restitution, balance.rows, partials.along_by_q, rows,
    )  # fmt: skip
    active = write_joints(active, mode, rate, assembly, table.owner, table.side, rows)
    active = write_loops(
        active, assembly.begin[LOOP], assembly.until[LOOP], candidate, model.brake_joint,
        table.kind, table.owner, slopes.loops.jacobian, partials, rows,
    )  # fmt: skip
    write_free(model, step, active, partials, rows)
    if pushed:
        push_free(step, active, slopes.pushed_by_q, rows.response)
    if scheme == LINEARLY_IMPLICIT:
        stiffen(step, 1.0, active + model.nq, stiffness, rows.response)
    elif scheme == MOREAU_JEAN:
        stiffen(step, 0.5, active + model.nq, model.stiffness, rows.response)
    if slopes.rubs == 1:
        rub(active, result.shape[1], balance.rows, rows)
    solve_columns(model, active + result.shape[1], balance.factor, rows.response)
    find_impulses(active, rows)
    add_impulses(model.nq, active, rows, result)


@kernel
def add_impulses(nq: int, active: int, rows: ActiveRows, result: Floats) -> None:
    """Write the derivative of the velocity: free, by the velocity itself, and by the impulses."""
    columns = result.shape[1]
    for j in range(result.shape[0]):
        for column in range(columns):
            result[j, column] = rows.response[j, active + column]
        result[j, nq + j] += 1.0
        for k in range(rows.rank):
            by_impulse = rows.response[j, rows.order[k]]
            for column in range(columns):
                result[j, column] += by_impulse * rows.system[k, active + column]


@dissolved_kernel
def begin_row(row: int, active: ActiveRows) -> None:
    """Begin an active row with nothing in it."""
    for j in range(active.held.shape[1]):
        active.held[row, j] = 0.0
        active.response[j, row] = 0.0
    for column in range(active.change.shape[1]):
        active.change[row, column] = 0.0
    active.rubbing[row] = 0.0


@kernel
def write_points(
    model: Model, points: int, candidate: Integers, impulse: Floats, mode: Integers, rate: float,
    bounces: bool, bounce: Floats, frictions: Floats, restitutions: Floats, jacobian: Floats,
    along_by_q: Floats, rows: ActiveRows,
) -> int:  # fmt: skip
    """Write the active rows of contact points, the first candidates; return how many there are."""
    active = 0
    for place in range(points):
        if mode[place] == OPEN:
            continue
        point = candidate[place]
        normal, tangent = 2 * point, 2 * point + 1
        friction, back = frictions[point], restitutions[point]
        sticks = mode[place] == STICK and friction > 0.0
        way = 0.0 if mode[place] == STICK else (-1.0 if mode[place] == SLIP_FORWARD else 1.0)
        begin_row(active, rows)
        rows.rubbing[active] = way * impulse[2 * place] * model.friction_scale[point]
        rows.point[active] = point
        for j in range(model.nv):
            rows.held[active, j] = jacobian[normal, j]
            rows.response[j, active] = jacobian[normal, j] + way * friction * jacobian[tangent, j]
            rows.change[active, j] = along_by_q[normal, j] + rate * jacobian[normal, j]
            if bounces:
                rows.change[active, j] += back * bounce[normal, j]
                rows.change[active, model.nq + j] = back * jacobian[normal, j]
        active += 1
        if sticks:
            begin_row(active, rows)
            for j in range(model.nv):
                rows.held[active, j] = rows.response[j, active] = jacobian[tangent, j]
                rows.change[active, j] = along_by_q[tangent, j]
            active += 1
    return active


@kernel
def write_joints(
    active: int, mode: Integers, rate: float, assembly: Assembly, owner: Integers, side: Floats,
    rows: ActiveRows,
) -> int:  # fmt: skip
    """Write the active rows of stops, latches and dry joints; return how many there are with them.

    A dry joint that turns has friction that is known, and no row.
    """
    for place in range(assembly.begin[STOP], assembly.until[STOP]):
        if mode[place] != OPEN or assembly.problem.set[place] == LINE:
            entry = assembly.candidate[place]
            begin_row(active, rows)
            rows.held[active, owner[entry]] = side[entry]
            rows.response[owner[entry], active] = side[entry]
            rows.change[active, owner[entry]] = rate * side[entry]
            active += 1
    for place in range(assembly.begin[DRY_JOINT], assembly.until[DRY_JOINT]):
        if mode[place] == STICK:
            entry = assembly.candidate[place]
            begin_row(active, rows)
            rows.held[active, owner[entry]] = 1.0
            rows.response[owner[entry], active] = 1.0
            active += 1
    return active


@kernel
def write_loops(
    active: int, first: int, last: int, candidate: Integers, brake_joint: Integers, kind: Integers,
    owner: Integers, jacobian: Floats, partials: Partials, rows: ActiveRows,
) -> int:  # fmt: skip
    """Write the active rows of loops, couplings and brakes; return how many there are with them."""
    nv = rows.held.shape[1]
    for place in range(first, last):
        entry, row = candidate[place], place - first
        begin_row(active, rows)
        if kind[entry] == BRAKE:
            joint = brake_joint[owner[entry]]
            rows.held[active, joint] = rows.response[joint, active] = 1.0
        else:
            for j in range(nv):
                rows.held[active, j] = rows.response[j, active] = jacobian[row, j]
                rows.change[active, j] = partials.loop_along_by_q[row, j]
                rows.change[active, nv + j] = partials.loop_along_by_v[row, j]
        active += 1
    return active


@kernel
def write_free(
    model: Model, step: float, active: int, partials: Partials, rows: ActiveRows
) -> None:
    """Write what the velocity would do without impulses, times A', but for v itself."""
    response, nq, nv = rows.response, model.nq, model.nv
    numbers = partials.lacking_by_numbers.shape[1]
    by_torque = active + nq + nv
    by_number = by_torque + model.nu
    for i in range(nv):
        for j in range(nq):
            response[i, active + j] = -step * partials.lacking_by_q[i, j]
        for j in range(nv):
            response[i, active + nq + j] = -step * partials.lacking_by_v[i, j]
        for j in range(model.nu):
            response[i, by_torque + j] = 0.0
        for j in range(numbers):
            response[i, by_number + j] = -step * partials.lacking_by_numbers[i, j]
    for j in range(model.nu):
        response[model.actuator_joint[j], by_torque + j] = step


@kernel
def push_free(step: float, active: int, pushed_by_q: Floats, response: Floats) -> None:
    """Add what position does to pushes."""
    for i in range(pushed_by_q.shape[0]):
        for j in range(pushed_by_q.shape[1]):
            response[i, active + j] += step * pushed_by_q[i, j]


@kernel
def stiffen(step: float, part_ahead: float, by_v: int, stiffness: Floats, response: Floats) -> None:
    """Add what springs do that act at a part of the step ahead."""
    for i in range(stiffness.shape[0]):
        response[i, by_v + i] -= part_ahead * step * step * stiffness[i]


@kernel
def rub(active: int, columns: int, jacobian: Floats, rows: ActiveRows) -> None:
    """Write what the ground's friction, the last number, does to points that slip."""
    last = active + columns - 1
    for i in range(jacobian.shape[1]):
        rows.response[i, last] = 0.0
    for row in range(active):
        if rows.rubbing[row] != 0.0:
            tangent = 2 * rows.point[row] + 1
            for i in range(jacobian.shape[1]):
                rows.response[i, last] += rows.rubbing[row] * jacobian[tangent, i]


@kernel
def solve_columns(model: Model, width: int, factor: Floats, x: Floats) -> None:
    """Replace the first columns of x by A⁻¹ x."""
    for i in range(model.nv - 1, -1, -1):
        j = model.parent[i]
        while j >= 0:
            ratio = factor[i, j]
            for column in range(width):
                x[j, column] -= ratio * x[i, column]
            j = model.parent[j]
    for i in range(model.nv):
        inverse = factor[i, i]
        for column in range(width):
            x[i, column] *= inverse
        j = model.parent[i]
        while j >= 0:
            ratio = factor[i, j]
            for column in range(width):
                x[i, column] -= ratio * x[j, column]
            j = model.parent[j]


@kernel
def find_impulses(active: int, rows: ActiveRows) -> None:
    """Solve for the changes of the impulses, in the last columns and the order of `order`."""
    held, response, system, change = rows.held, rows.response, rows.system, rows.change
    columns, nv = change.shape[1], held.shape[1]
    width = active + columns
    for row in range(active):
        for column in range(width):
            system[row, column] = 0.0
        for j in range(nv):
            entry = held[row, j]
            if entry != 0.0:
                for column in range(width):
                    system[row, column] += entry * response[j, column]
        for column in range(columns):
            system[row, active + column] = -system[row, active + column] - change[row, column]
        for j in range(nv):
            system[row, active + nv + j] -= held[row, j]
    rows.rank = triangulate(active, width, True, system, rows.order)
    for k in range(rows.rank - 1, -1, -1):
        for j in range(k + 1, rows.rank):
            ratio = system[k, j]
            for column in range(active, width):
                system[k, column] -= ratio * system[j, column]
        for column in range(active, width):
            system[k, column] /= system[k, k]


@kernel
def write_state(
    nq: int, scheme: int, step: float, moves: Floats, after: Floats, state: Floats
) -> None:
    """Write the derivative of the state after the step, from that of the velocity it moves with."""
    part_after, part_before = 1.0, 0.0
    if scheme == MOREAU_JEAN:
        part_after = part_before = 0.5
    elif scheme == PAPER_EXPLICIT:
        part_after, part_before = 0.0, 1.0
    for i in range(after.shape[0]):
        for column in range(state.shape[1]):
            state[i, column] = part_after * step * moves[i, column]
            state[nq + i, column] = after[i, column]
        state[i, i] += 1.0
        state[i, nq + i] += part_before * step
