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
"""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.linearized.partials import (
    Balance,
    Partials,
    allocate_balance,
    find_partials,
    partial_program,
)
from heelstrike.contact.modes import OPEN, SLIP_FORWARD, STICK
from heelstrike.contact.sets import LINE
from heelstrike.dynamics.dense import triangulate
from heelstrike.dynamics.loops import LoopRows, count_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.rows import (
    DRY_JOINT,
    LOOP,
    POINT,
    STOP,
    lay_out_rows,
)
from heelstrike.sim.memory import Memory
from heelstrike.sim.time_stepping.method import (
    LINEARLY_IMPLICIT,
    MOREAU_JEAN,
    PAPER_EXPLICIT,
    Stepping,
    is_linearised,
)


class StepSlopes(Bundle):
    """A step, and its derivative by (q, v), the torques, numbers of the robot and friction."""

    q: Floats = array("nq")
    v: Floats = array("nv")
    """q, v: The state before."""
    balance: Balance = part(Balance)
    partials: Partials = part(Partials)
    """balance, partials: The equations of the step."""
    bounce_by_q: Floats = array("2 nc", "nq")
    """What position does to the velocities of the points before the step."""
    loops: LoopRows = part(LoopRows)
    tree: Workspace = part(Workspace)
    """loops, tree: Scratch."""
    dated: Integers = array(1, of=int)
    """Whether loops turn."""
    program: int = cell(int)
    """Address of the code that finds the partial derivatives."""
    rubs: int = cell(int)
    """Whether friction of the ground is the last number by which is differentiated."""
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
    arriving: Floats = array("nv", "columns")
    after: Floats = array("nv", "columns")
    """arriving, after: Derivatives of the velocity that positions move with where there is an
    impact, and of that after the step."""
    state: Floats = array("nx", "columns")
    """Derivative of the state after by position, velocity, torques and numbers before."""
    rank: int = cell(int)
    """How many active rows are independent."""


def allocate_slopes(
    robot: Robot, numbers: tuple[str, ...] = (), *, friction: bool = False
) -> StepSlopes:
    """Allocate the derivative of a step, by some `numbers` of the robot and by friction."""
    model = robot.model
    balance, partials = allocate_balance(model, numbers)
    loops, rows = count_rows(model), 2 * len(lay_out_rows(model).kind)
    columns = robot.nq + robot.nv + robot.nu + partials.lacking_by_numbers.shape[1] + friction
    extents = {
        **model.extents, "components": 2, "rows": rows, "columns": columns, "loop_rows": loops,
        "width": rows + columns, "nx": robot.nq + robot.nv,
    }  # fmt: skip
    return StepSlopes.allocate(
        extents,
        balance=balance,
        partials=partials,
        loops=LoopRows.allocate(extents),
        tree=Workspace.allocate(extents),
        dated=np.array([int(loops > 0)]),
        program=partial_program(model, dated=loops > 0, numbers=numbers),
        rubs=int(friction),
    )


@kernel
def differentiate_step(model: Model, work: Stepping, memory: Memory, slopes: StepSlopes) -> None:
    """Differentiate the step that `memory` has just taken from ``slopes.q``, ``slopes.v``.

    Its contact problem is still there; where an impact fell into it, both are.
    """
    assembly, impact, surface = memory.assembly, work.impact, memory.surface
    pose_balance(model, work, memory, slopes)
    bounces = False
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        bounces = bounces or surface.restitution[assembly.candidate[place]] > 0.0
    if bounces:
        evaluate(model, slopes.v, slopes)
        for row in range(2 * model.nc):
            for j in range(model.nq):
                slopes.bounce_by_q[row, j] = slopes.partials.along_by_q[row, j]
    linearised = is_linearised(work.scheme)
    if impact.happens == 1:
        differentiate_problem(
            model, work, memory, impact.arriving, impact.arriving_impulse, impact.arriving_mode,
            True, False, slopes, slopes.arriving,
        )  # fmt: skip
    answer = assembly.answer
    gaps = linearised and impact.happens == 0
    bounces = bounces and not gaps
    differentiate_problem(
        model, work, memory, memory.next_v, answer.impulse, answer.mode, gaps, bounces, slopes,
        slopes.after,
    )  # fmt: skip
    write_state(model, work, slopes)


@kernel
def pose_balance(model: Model, work: Stepping, memory: Memory, slopes: StepSlopes) -> None:
    """Write what all equations of a step have in common."""
    balance = slopes.balance
    for j in range(model.nv):
        balance.q[j] = slopes.q[j]
        balance.v[j] = slopes.v[j]
        balance.added[j] = memory.equations.added[j]
    for contact in range(model.nc):
        for k in range(2):
            balance.normal[contact, k] = memory.contacts.normal[contact, k]
    balance.ahead[0] = 0.0
    balance.ahead[1] = 0.5 * work.step


@kernel
def evaluate(model: Model, going: Floats, slopes: StepSlopes) -> None:
    """Find the partial derivatives, with the points going at a velocity."""
    balance = slopes.balance
    for j in range(model.nv):
        balance.going[j] = going[j]
    find_partials(
        model, slopes.program, slopes.dated, slopes.tree, slopes.loops, balance, slopes.partials
    )


@kernel
def differentiate_problem(
    model: Model, work: Stepping, memory: Memory, after: Floats, impulse: Floats, mode: Integers,
    gaps: bool, bounces: bool, slopes: StepSlopes, result: Floats,
) -> None:  # fmt: skip
    """Write the derivative of a velocity that a contact problem of the step has found.

    Parameters
    ----------
    after, impulse, mode : (nv,), (2 capacity,) and (capacity,) array
        The velocity, and the answer of the problem.
    gaps, bounces : bool
        Whether gaps are in its free terms, and restitution.
    result : (nv, columns) float
        Receives the derivative.
    """
    assembly, balance, step, nv = memory.assembly, slopes.balance, work.step, model.nv
    for j in range(nv):
        balance.acceleration[j] = (after[j] - slopes.v[j]) / step
    for contact in range(model.nc):
        balance.push[contact, 0] = balance.push[contact, 1] = 0.0
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        for k in range(2):
            balance.push[assembly.candidate[place], k] = impulse[2 * place + k] / step
    for row in range(balance.pull.shape[0]):
        balance.pull[row] = impulse[2 * (assembly.begin[LOOP] + row)] / step
    evaluate(model, after, slopes)
    active = write_points(
        model, impulse, mode, 1.0 / step if gaps else 0.0, bounces, memory, slopes
    )
    active = write_joints(active, mode, 1.0 / step if gaps else 0.0, memory, slopes)
    active = write_loops(active, slopes)
    write_free(model, work, active, memory, slopes)
    solve_columns(model, active + result.shape[1], balance.factor, slopes.response)
    find_impulses(active, slopes)
    response, system = slopes.response, slopes.system
    for j in range(nv):
        for column in range(result.shape[1]):
            result[j, column] = response[j, active + column]
        result[j, model.nq + j] += 1.0
        for k in range(slopes.rank):
            by_impulse = response[j, slopes.order[k]]
            for column in range(result.shape[1]):
                result[j, column] += by_impulse * system[k, active + column]


@dissolved_kernel
def begin_row(row: int, slopes: StepSlopes) -> None:
    """Begin an active row with nothing in it."""
    for j in range(slopes.held.shape[1]):
        slopes.held[row, j] = 0.0
        slopes.response[j, row] = 0.0
    for column in range(slopes.change.shape[1]):
        slopes.change[row, column] = 0.0
    slopes.rubbing[row] = 0.0


@kernel
def write_points(
    model: Model, impulse: Floats, mode: Integers, rate: float, bounces: bool, memory: Memory,
    slopes: StepSlopes,
) -> int:  # fmt: skip
    """Write the active rows of contact points; return how many there are."""
    assembly, rows, partials = memory.assembly, slopes.balance.rows, slopes.partials
    active = 0
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        if mode[place] == OPEN:
            continue
        point = assembly.candidate[place]
        normal, tangent = 2 * point, 2 * point + 1
        friction, back = memory.surface.friction[point], memory.surface.restitution[point]
        sticks = mode[place] == STICK and friction > 0.0
        way = 0.0 if mode[place] == STICK else (-1.0 if mode[place] == SLIP_FORWARD else 1.0)
        begin_row(active, slopes)
        slopes.rubbing[active] = way * impulse[2 * place] * model.friction_scale[point]
        slopes.point[active] = point
        for j in range(model.nv):
            slopes.held[active, j] = rows[normal, j]
            slopes.response[j, active] = rows[normal, j] + way * friction * rows[tangent, j]
            slopes.change[active, j] = partials.along_by_q[normal, j] + rate * rows[normal, j]
            if bounces:
                slopes.change[active, j] += back * slopes.bounce_by_q[normal, j]
                slopes.change[active, model.nq + j] = back * rows[normal, j]
        active += 1
        if sticks:
            begin_row(active, slopes)
            for j in range(model.nv):
                slopes.held[active, j] = slopes.response[j, active] = rows[tangent, j]
                slopes.change[active, j] = partials.along_by_q[tangent, j]
            active += 1
    return active


@kernel
def write_joints(
    active: int, mode: Integers, rate: float, memory: Memory, slopes: StepSlopes
) -> int:
    """Write the active rows of stops, latches and dry joints; return how many there are with them.

    A dry joint that turns has friction that is known, and no row.
    """
    assembly, rows = memory.assembly, memory.rows
    for place in range(assembly.begin[STOP], assembly.until[STOP]):
        if mode[place] != OPEN or assembly.problem.set[place] == LINE:
            entry = assembly.candidate[place]
            begin_row(active, slopes)
            slopes.held[active, rows.owner[entry]] = rows.side[entry]
            slopes.response[rows.owner[entry], active] = rows.side[entry]
            slopes.change[active, rows.owner[entry]] = rate * rows.side[entry]
            active += 1
    for place in range(assembly.begin[DRY_JOINT], assembly.until[DRY_JOINT]):
        if mode[place] == STICK:
            entry = assembly.candidate[place]
            begin_row(active, slopes)
            slopes.held[active, rows.owner[entry]] = 1.0
            slopes.response[rows.owner[entry], active] = 1.0
            active += 1
    return active


@kernel
def write_loops(active: int, slopes: StepSlopes) -> int:
    """Write the rows of loops and couplings; return how many active rows there are with them."""
    loops, partials = slopes.loops, slopes.partials
    for row in range(loops.bias.shape[0]):
        begin_row(active, slopes)
        for j in range(slopes.held.shape[1]):
            slopes.held[active, j] = slopes.response[j, active] = loops.jacobian[row, j]
            slopes.change[active, j] = partials.loop_along_by_q[row, j]
            slopes.change[active, slopes.held.shape[1] + j] = partials.loop_along_by_v[row, j]
        active += 1
    return active


@kernel
def write_free(
    model: Model, work: Stepping, active: int, memory: Memory, slopes: StepSlopes
) -> None:
    """Write what the velocity would do without impulses, times A', but for v itself."""
    response, partials, step, nq, nv = (
        slopes.response,
        slopes.partials,
        work.step,
        model.nq,
        model.nv,
    )
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
        if work.scheme == LINEARLY_IMPLICIT:
            response[i, active + nq + i] -= step * step * memory.stiffness[i]
        elif work.scheme == MOREAU_JEAN:
            response[i, active + nq + i] -= 0.5 * step * step * model.stiffness[i]
    for j in range(model.nu):
        response[model.actuator_joint[j], by_torque + j] = step
    if slopes.rubs == 1:
        last = by_number + numbers
        for i in range(nv):
            response[i, last] = 0.0
        for row in range(active):
            if slopes.rubbing[row] != 0.0:
                tangent = 2 * slopes.point[row] + 1
                for i in range(nv):
                    response[i, last] += slopes.rubbing[row] * slopes.balance.rows[tangent, i]


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
def find_impulses(active: int, slopes: StepSlopes) -> None:
    """Solve for the changes of the impulses, in the last columns and the order of `order`."""
    held, response, system, change = slopes.held, slopes.response, slopes.system, slopes.change
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
    slopes.rank = triangulate(active, width, True, system, slopes.order)
    for k in range(slopes.rank - 1, -1, -1):
        for j in range(k + 1, slopes.rank):
            ratio = system[k, j]
            for column in range(active, width):
                system[k, column] -= ratio * system[j, column]
        for column in range(active, width):
            system[k, column] /= system[k, k]


@kernel
def write_state(model: Model, work: Stepping, slopes: StepSlopes) -> None:
    """Write the derivative of the state after the step."""
    step, nq, nv, state, after = work.step, model.nq, model.nv, slopes.state, slopes.after
    moves = slopes.arriving if work.impact.happens == 1 else after
    part_after, part_before = 1.0, 0.0
    if work.scheme == MOREAU_JEAN:
        part_after = part_before = 0.5
    elif work.scheme == PAPER_EXPLICIT:
        part_after, part_before = 0.0, 1.0
    for i in range(nv):
        for column in range(state.shape[1]):
            state[i, column] = part_after * step * moves[i, column]
            state[nq + i, column] = after[i, column]
        state[i, i] += 1.0
        state[i, nq + i] += part_before * step
