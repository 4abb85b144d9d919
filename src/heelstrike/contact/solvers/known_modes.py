"""The usual case, fast: contacts go on sticking or slipping, or stay open, as in the solve before.

Sticking contacts make one symmetric system. Vertices of one flat foot share their tangential row,
so that only the sum of their friction is determined; among all splits the equal one has the least
norm. Where a vertex cannot hold its share, the others hold what is left, as far as their cones
reach. Rows may depend on each other otherwise, as those of two feet under straight legs do.
Where something slips, the system is not symmetric, and rows may not depend on each other.
Whatever is less usual is left to the general way, and the certificate decides as always.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel, rare_kernel
from heelstrike.compiler.straight_line import play
from heelstrike.contact.certificate import REST_TOLERANCE, certify, certify_at_once, cones_of
from heelstrike.contact.cone_certificate import FASTEST
from heelstrike.contact.modes import OPEN, SLIDING_FORWARD, SLIP_BACKWARD, SLIP_FORWARD, STICK
from heelstrike.contact.sets import EVERY_ROW, INTERVAL, LINE, projected, row_of
from heelstrike.contact.solvers.elimination import POOR_PIVOT
from heelstrike.contact.solvers.standing import EARLY_PIVOT, MOST_STANDING, SHARED_ROW, code_of
from heelstrike.contact.workspace import (
    ContactAnswer,
    ContactProblem,
    Floats,
    Integers,
    Scaling,
    Settings,
    StickingRows,
)
from heelstrike.dynamics.dense import solve_positive
from heelstrike.tolerances import NO_PIVOT

COSTLY_PIVOT = 1e-5
"""Pivots that keep less than this of their diagonal leave no clean answer: rounding of the numbers,
1e-16, is more than ``CLEAN`` of them."""

CLEAN = 1e-11
"""Modes with smaller residuals are taken at once; others may be nearly right, and better follow."""

BARELY = 1e-13
"""Velocities above this, relative to the data, are there, though they count as rest."""

AS_GOOD = 2.0 * REST_TOLERANCE
"""Residual up to which contacts at rest are left to carry impulses, though a smaller residual may
be had without."""

TRIES = 4
"""How often modes are tried, and those that are found wrong changed, before the general way."""

FAILS, HOLDS, MAY_DRIFT = range(3)
"""How the elimination of few equations ended."""


@dissolved_kernel
def edge_of(mode: int, friction: float) -> float:
    """Tangential over normal impulse of a contact that slips, zero of others."""
    if mode == SLIP_FORWARD:
        return -friction
    return friction if mode == SLIP_BACKWARD else 0.0


@dissolved_kernel
def list_equations(
    first_try: bool, problem: ContactProblem, mode: Integers, rows: StickingRows
) -> tuple[int, bool]:
    """List the rows that shall have no velocity; return how many differ, or -1 to give up.

    In the first try nothing has been found to pull. Whether anything slips is returned, too.
    """
    delassus, first, friction = problem.delassus, problem.first, problem.friction
    source, equation, sharers = rows.row, rows.equation, rows.sharers
    size, end, slips = 0, 0, False
    for contact in range(problem.count):
        row, end = end, row_of(contact + 1, first)
        tangent = row + 1
        equation[row] = equation[end - 1] = -1
        if first_try:
            rows.pulled[contact] = 0
        if mode[contact] == OPEN and problem.set[contact] != LINE:
            continue
        if mode[contact] >= SLIDING_FORWARD:
            return -1, slips
        equation[row] = size
        source[size] = row
        sharers[size] = 1.0
        edge = rows.edge[size] = edge_of(mode[contact], friction[contact])
        size = (size + 1) & EVERY_ROW
        slips = slips or edge != 0.0
        if edge != 0.0 or not friction[contact] > 0.0:
            continue
        diagonal = delassus[tangent, tangent]
        for earlier in range(contact - 1, -1, -1):  # neighbours of a sole are next to each other
            other = row_of(earlier, first) + 1
            if friction[earlier] > 0.0 and equation[other] >= 0:
                both = diagonal + delassus[other, other]
                if abs(both - 2.0 * delassus[tangent, other]) <= SHARED_ROW * both:
                    shared = row_of(other, equation)
                    equation[tangent] = shared
                    sharers[shared] += 1.0
                    break
        if equation[tangent] < 0:
            equation[tangent] = size
            source[size] = tangent
            sharers[size] = 1.0
            rows.edge[size] = 0.0
            size = (size + 1) & EVERY_ROW
    return size, slips


@rare_kernel
def solve_slipping(size: int, problem: ContactProblem, rows: StickingRows) -> int:
    """Solve ``(G_n + G_t r) x = -b`` over the listed rows; return the rank, or -1 to give up.

    What slips rubs with r times what it presses with. No rows change places: pivots are held
    against their diagonals, whatever the units of the rows. Of rows that depend on others the
    solution is the one of least norm, as where both feet of parallel legs slip.
    """
    delassus, source, edge = problem.delassus, rows.row, rows.edge
    matrix, x, inverse, rank = rows.factor, rows.x, rows.pivot, 0
    for i in range(size):
        row = row_of(i, source)
        for j in range(size):
            column = row_of(j, source)
            matrix[i, j] = delassus[row, column]
            if edge[j] != 0.0:
                matrix[i, j] += edge[j] * delassus[row, column + 1]
        x[i] = -problem.free[row]
        for k in range(i):
            ratio = matrix[i, k] * inverse[k]
            x[i] -= ratio * x[k]
            for j in range(k + 1, size):
                matrix[i, j] -= ratio * matrix[k, j]
        pivot, diagonal = matrix[i, i], delassus[row, row]
        if pivot > EARLY_PIVOT * diagonal:
            inverse[i] = 1.0 / pivot
            rank += 1
        elif abs(pivot) <= NO_PIVOT * diagonal:
            inverse[i] = 0.0
        else:
            return -1
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            x[i] -= matrix[i, j] * x[j]
        x[i] *= inverse[i]
    if rank < size and not leave_out_idle_slips(size, problem, rows):
        return -1
    return rank


@kernel
def leave_out_idle_slips(size: int, problem: ContactProblem, rows: StickingRows) -> bool:
    """Take from a solution what lies along directions that change no velocity; return success.

    The norm is that of the impulses, friction included. A direction that changes no velocity of the
    equations, U n = 0, may change how fast something slips, where friction differs: then there are
    many motions.
    """
    matrix, x, basis, inverse, share = rows.factor, rows.x, rows.square, rows.pivot, rows.spare
    for i in range(size):
        share[i] = rows.sharers[i] / (1.0 + rows.edge[i] * rows.edge[i])
    found = 0
    for row in range(size):
        if inverse[row] != 0.0:
            continue
        direction = basis[found]
        for i in range(size):
            direction[i] = 0.0
        direction[row] = 1.0
        for i in range(row - 1, -1, -1):
            for j in range(i + 1, row + 1):
                direction[i] -= matrix[i, j] * direction[j]
            direction[i] *= inverse[i]
        if changes_slips(size, direction, problem, rows):
            return False
        for earlier in range(found):
            remove_part(size, basis[earlier], share, direction)
        remove_part(size, direction, share, x)
        found += 1
    return True


@kernel
def changes_slips(
    size: int, direction: Floats, problem: ContactProblem, rows: StickingRows
) -> bool:
    """Whether impulses along a direction change how fast anything slips."""
    delassus, source, edge = problem.delassus, rows.row, rows.edge
    for i in range(size):
        if edge[i] == 0.0:
            continue
        tangent = row_of(i, source) + 1
        change, terms = 0.0, 0.0
        for j in range(size):
            column = row_of(j, source)
            felt = delassus[tangent, column]
            if edge[j] != 0.0:
                felt += edge[j] * delassus[tangent, column + 1]
            change += felt * direction[j]
            terms += abs(felt * direction[j])
        if abs(change) > NO_PIVOT * terms:
            return True
    return False


@dissolved_kernel
def solve_at_once(size: int, problem: ContactProblem, rows: StickingRows) -> tuple[int, int]:
    """Like :func:`solve_equations` for few equations, as they are listed, by straight-line code.

    Returns ``FAILS``, ``HOLDS``, or ``MAY_DRIFT`` where a poor pivot may have cost digits: the
    other elimination leaves it for the end; and the rank. A row that nearly depends on those before
    it is tried once more as the last: the toe under a straight leg, whose heel tells as much, and
    better.
    """
    if size >= rows.programs.shape[0] or rows.programs[size] == 0:
        return FAILS, 0
    delassus, free, source, matrix = problem.delassus, problem.free, rows.row, rows.lower_half
    x, pivot, diagonals = rows.x, rows.pivot, rows.spare
    outcome, rank = FAILS, 0
    for attempt in range(2):
        place = 0
        for i in range(size):
            row = row_of(i, source)
            x[i] = -free[row]
            diagonals[i] = delassus[row, row]
            for j in range(i + 1):
                matrix[place + j] = delassus[row, row_of(j, source)]
            place = (place + i + 1) & EVERY_ROW
        play(rows.programs[size], (matrix, x, pivot))
        outcome, late, rank = HOLDS, -1, 0
        for i in range(size):
            diagonal = diagonals[i]
            if pivot[i] > EARLY_PIVOT * diagonal:
                rank += 1
                continue
            rank += pivot[i] > POOR_PIVOT * diagonal
            if abs(pivot[i]) <= NO_PIVOT * diagonal:
                continue
            if late < 0 and pivot[i] <= COSTLY_PIVOT * diagonal:
                late = i
            if pivot[i] <= POOR_PIVOT * diagonal:
                outcome = FAILS
            elif outcome == HOLDS:
                outcome = MAY_DRIFT
        if late < 0 or attempt == 1:
            break
        list_last(late, size, problem.first[problem.count], rows)
    if outcome != FAILS and rank < size:
        leave_out_idle(size, rows)
    return outcome, rank


@kernel
def list_last(place: int, size: int, count: int, rows: StickingRows) -> None:
    """Let an equation change places with the last."""
    source, sharers, last = rows.row, rows.sharers, size - 1
    source[place], source[last] = source[last], source[place]
    sharers[place], sharers[last] = sharers[last], sharers[place]
    for row in range(count):
        if rows.equation[row] == place:
            rows.equation[row] = last
        elif rows.equation[row] == last:
            rows.equation[row] = place


@kernel
def leave_out_idle(size: int, rows: StickingRows) -> None:
    """Take from the solution what lies along directions that change no velocity.

    For few equations it is quicker than :func:`shorten`, which needs them in another order. There
    is one such direction n for every row that depends on others, Lᵀ n = e. They are made
    orthogonal one after the other, in the norm of the impulses: what m rows share in equal parts
    counts 1/m.
    """
    matrix, x, basis, sharers = rows.lower_half, rows.x, rows.square, rows.sharers
    found, diagonal = 0, 0
    for row in range(size):
        diagonal = (diagonal + row) & EVERY_ROW
        if matrix[diagonal + row] != 0.0:
            continue
        direction = basis[found]
        for i in range(size):
            direction[i] = 0.0
        direction[row] = 1.0
        begin = diagonal
        for i in range(row, 0, -1):
            part = direction[i]
            for j in range(i):
                direction[j] -= matrix[begin + j] * part
            begin = (begin - i) & EVERY_ROW
        for earlier in range(found):
            remove_part(size, basis[earlier], sharers, direction)
        remove_part(size, direction, sharers, x)
        found += 1


@kernel
def remove_part(size: int, direction: Floats, sharers: Floats, vector: Floats) -> None:
    """Make a vector orthogonal to a direction."""
    part = 0.0
    length = 0.0
    for i in range(size):
        weighted = direction[i] if sharers[i] == 1.0 else direction[i] / sharers[i]
        part += weighted * vector[i]
        length += weighted * direction[i]
    ratio = part / length
    for i in range(size):
        vector[i] -= ratio * direction[i]


@dissolved_kernel
def solve_equations(size: int, problem: ContactProblem, rows: StickingRows) -> int:
    """Solve ``G x = -b`` over the listed rows, of least norm; return the rank, or -1 to give up.

    Elimination, G = L D Lᵀ with 1/D on the diagonal. Rows that depend on others are put off to the
    end of the list and bring no column to L: their number costs little. Neighbours among many
    points of a sole nearly do, and are tried again after the others.
    """
    delassus, source, order = problem.delassus, rows.row, rows.order
    matrix, x = rows.factor, rows.spare
    for i in range(size):
        order[i] = i
    rank = 0
    rest = size
    least = EARLY_PIVOT
    poor = False
    while rank < rest:
        row = source[order[rank]]
        total = -problem.free[row]
        for j in range(rank):
            entry = delassus[row, source[order[j]]]
            for k in range(j):
                entry -= matrix[rank, k] * matrix[j, k]
            # Until the row is finished, its entries still carry their D.
            matrix[rank, j] = entry
        pivot = delassus[row, row]
        diagonal = pivot
        for j in range(rank):
            ratio = matrix[rank, j] * matrix[j, j]
            pivot -= ratio * matrix[rank, j]
            total -= ratio * x[j]
            matrix[rank, j] = ratio
        x[rank] = total
        if pivot > least * diagonal:
            matrix[rank, rank] = 1.0 / pivot
            rank += 1
        elif pivot > POOR_PIVOT * diagonal or abs(pivot) <= NO_PIVOT * diagonal:
            poor = poor or pivot > POOR_PIVOT * diagonal
            rest -= 1
            rows.span[rest] = rank
            order[rank], order[rest] = order[rest], order[rank]
            for i in range(rank):
                matrix[rest, i] = matrix[rank, i]
        else:
            return -1
        if poor and rank == rest:
            poor = False
            least = POOR_PIVOT
            rest = size
    for i in range(rank):
        x[i] *= matrix[i, i]
    for i in range(rank - 1, -1, -1):
        for j in range(i):
            x[j] -= matrix[i, j] * x[i]
    if rank < size:
        shorten(rank, size, rows)
    for place in range(size):
        rows.x[order[place]] = x[place]
    return rank


@kernel
def shorten(rank: int, size: int, rows: StickingRows) -> None:
    """Spread the solution from the independent rows over all, to the least norm.

    The other rows are combinations of these, C = L₂ L₁⁻¹. Where y solves for these alone, every x
    with ``x₁ + Cᵀ x₂ = y`` is a solution. In the norm of the impulses, where what m rows share in
    equal parts counts 1/m (they make the diagonal M), the shortest has::

        x₂ = M₂ C (M₁ + Cᵀ M₂ C)⁻¹ y
    """
    matrix, x, sharers, order = rows.factor, rows.spare, rows.sharers, rows.order
    y, system = rows.pivot, rows.square
    for place in range(rank, size):
        part = matrix[place]
        for j in range(rows.span[place], rank):
            part[j] = 0.0
        for j in range(rank - 2, -1, -1):
            entry = part[j]
            for i in range(j + 1, rank):
                entry -= part[i] * matrix[i, j]
            part[j] = entry
    for i in range(rank):
        y[i] = x[i]
        for j in range(i):
            system[i, j] = 0.0
        system[i, i] = sharers[order[i]]
    for place in range(rank, size):
        part = matrix[place]
        for i in range(rank):
            weighted = sharers[order[place]] * part[i]
            for j in range(i + 1):
                system[i, j] += weighted * part[j]
    solve_positive(rank, system, y)
    for place in range(rank, size):
        part = matrix[place]
        entry = 0.0
        for i in range(rank):
            entry += part[i] * y[i]
        entry *= sharers[order[place]]
        x[place] = entry
        for i in range(rank):
            x[i] -= part[i] * entry


@dissolved_kernel
def share_of(row: int, rows: StickingRows) -> float:
    """What a row has of the solution if all that share its equation have equal parts."""
    place = rows.equation[row]
    if place < 0:
        return 0.0
    place = place & EVERY_ROW
    sharers = rows.sharers[place]
    return float(rows.x[place] if sharers == 1.0 else rows.x[place] / sharers)


@dissolved_kernel
def share_impulses(
    problem: ContactProblem, alone: bool, rows: StickingRows, answer: ContactAnswer
) -> int:
    """Write the solution out to all rows in equal shares; return how many contacts would pull.

    Their modes become open. What pulls no more than rounding may explain is cut off, and the
    certificate decides. Where one of those that share friction cannot hold its part, others may;
    `alone` tells that no other solution has the same effect. -1 is returned where friction is not
    held.
    """
    impulse, first, friction = answer.impulse, problem.first, problem.friction
    largest, end, inside = 0.0, 0, True
    for contact in range(problem.count):
        row, end = end, row_of(contact + 1, first)
        normal = tangent = share_of(row, rows)
        if end > row + 1:
            edge = edge_of(answer.mode[contact], friction[contact])
            tangent = edge * normal if edge != 0.0 else share_of(row + 1, rows)
            inside = inside and abs(tangent) <= friction[contact] * normal
            impulse[row + 1] = tangent
        impulse[row] = normal
        kind = problem.set[contact]
        inside = inside and kind != INTERVAL and (normal >= 0.0 or kind == LINE)
        largest = max(largest, max(abs(normal), abs(tangent)))
    if inside:
        return 0
    pulling = 0
    for contact in range(problem.count):
        if impulse[row_of(contact, first)] < -CLEAN * largest and problem.set[contact] != LINE:
            answer.mode[contact] = OPEN
            rows.pulled[contact] = 1
            pulling += 1
    if pulling == 0:
        end = 0
        for contact in range(problem.count):
            row, end = end, row_of(contact + 1, first)
            if end == row + 1:
                impulse[row], _ = projected(problem, contact, impulse[row], 0.0)
                continue
            impulse[row], across = projected(problem, contact, impulse[row], impulse[row + 1])
            if across != impulse[row + 1]:
                place = rows.equation[row + 1]
                if edge_of(answer.mode[contact], friction[contact]) != 0.0:
                    impulse[row + 1] = across
                elif not alone or place < 0 or not share_within_cones(problem, place, rows, answer):
                    return -1
    return pulling


@kernel
def share_within_cones(
    problem: ContactProblem, place: int, rows: StickingRows, answer: ContactAnswer
) -> bool:
    """Share friction among the rows of one equation as evenly as cones allow; return success.

    Where the normal impulses are given, the shares of least norm are all at one level, but for
    those whose cones do not reach it: these are at their edges. The level rises until it brings no
    other cone to its edge.
    """
    impulse, first, total = answer.impulse, problem.first, abs(rows.x[place])
    edge, tangent, count, end = rows.spare, rows.order, 0, 0
    for contact in range(problem.count):
        row, end = end, row_of(contact + 1, first)
        if end > row + 1 and rows.equation[row + 1] == place:
            _, edge[count] = projected(problem, contact, impulse[row], total)
            tangent[count] = row + 1
            count = (count + 1) & EVERY_ROW
    level, higher = 0.0, total / rows.sharers[place]
    while higher > level:
        level = higher
        rest, sharers = total, 0.0
        for member in range(count):
            rest -= edge[member] if edge[member] < level else 0.0
            sharers += edge[member] >= level
        if sharers == 0.0:
            return False
        higher = rest / sharers
    for member in range(count):
        share = min(edge[member], level)
        impulse[row_of(member, tangent)] = share if rows.x[place] > 0.0 else -share
    return True


@dissolved_kernel
def name_by_velocity(
    problem: ContactProblem, pulled: Integers, scaling: Scaling, answer: ContactAnswer
) -> int:
    """Name what contacts do; return how many were not at rest but are, or -1 if one slips.

    One may slip that was to do so. Contacts at rest may carry impulses, and only with all of these
    admitted is the least norm unique. One that would pull need not be admitted, if it is not quite
    at rest: neither where it parts, nor where it comes nearer by so little that the answer is
    clean.
    """
    mode, velocity = answer.mode, answer.velocity
    root, rest, first = scaling.root, answer.rest, problem.first
    pressed, end = 0, 0
    for contact in range(problem.count):
        normal, end = end, row_of(contact + 1, first)
        tangent = normal + 1
        if velocity[normal] > rest * root[normal] and problem.set[contact] != LINE:
            if mode[contact] != OPEN:
                return -1
            continue
        if mode[contact] == OPEN and problem.set[contact] != LINE:
            size = scaling.unit * root[normal]
            moves = velocity[normal] >= -CLEAN * size and abs(velocity[normal]) > BARELY * size
            pressed += not (moves and pulled[contact] == 1)
        asked, mode[contact] = mode[contact], STICK
        if end > tangent and abs(velocity[tangent]) > rest * root[tangent]:
            mode[contact] = SLIP_FORWARD if velocity[tangent] > 0.0 else SLIP_BACKWARD
            if problem.friction[contact] > 0.0 and mode[contact] != asked:
                return -1
        elif edge_of(asked, problem.friction[contact]) != 0.0:
            pressed += 1
    return pressed


@dissolved_kernel
def stand(
    problem: ContactProblem, settings: Settings, rows: StickingRows, scaling: Scaling,
    answer: ContactAnswer,
) -> bool:  # fmt: skip
    """Solve the contact problem at once if few contacts make it, and all stick; return success.

    None pulls or slides in the answer. Beside them there may be stops, pressed or not; those that
    would pull are let go. After a failure the modes are what they were.
    """
    mode, count = answer.mode, problem.count
    cones = cones_of(problem, settings, scaling)
    stops = count - cones
    code = code_of(cones, problem, mode) if 0 < cones <= MOST_STANDING else 0
    program = rows.standing[code, stops] if code > 0 else 0
    if program == 0:
        return False
    if stops > 0:
        if not hold_stops(code, cones, program, problem, scaling, rows, answer):
            return False
    elif not play_standing(code, cones, program, problem, scaling, rows, answer):
        return False
    worst = certify_at_once(cones, problem, settings, scaling, answer)
    still = answer.residual[1] == 0.0 and scaling.size[FASTEST] <= answer.rest
    if not still or not worst <= min(settings.tolerance, AS_GOOD):
        return False
    return stops == 0 or name_stops(cones, problem, scaling, answer)


@dissolved_kernel
def play_standing(
    code: int, cones: int, program: int, problem: ContactProblem, scaling: Scaling,
    rows: StickingRows, answer: ContactAnswer,
) -> bool:  # fmt: skip
    """Find the impulses of contacts that stick and of the stops that are held; return success."""
    play(  # which rows share equations is part of the program, the first three are not read
        program,
        (
            rows.row, rows.equation, rows.order, problem.delassus, problem.free, scaling.held,
            rows.lower_half, rows.x, rows.pivot, rows.margin, answer.impulse,
        ),
    )  # fmt: skip
    good = rows.margin[0] > 0.0
    return good or share_standing(code, cones, problem, scaling, rows, answer)


@rare_kernel
def hold_stops(
    code: int, cones: int, program: int, problem: ContactProblem, scaling: Scaling,
    rows: StickingRows, answer: ContactAnswer,
) -> bool:  # fmt: skip
    """The same, where none of the stops that are held in the end pulls."""
    stops = problem.count - cones
    for stop in range(stops):
        scaling.held[stop] = 0.0 if answer.mode[cones + stop] == OPEN else 1.0
    pulling = 1
    while pulling > 0:  # each time fewer are held
        if not play_standing(code, cones, program, problem, scaling, rows, answer):
            return False
        pulling = let_go(2 * cones, stops, scaling.held, answer.impulse)
    return True


@rare_kernel
def name_stops(
    cones: int, problem: ContactProblem, scaling: Scaling, answer: ContactAnswer
) -> bool:
    """Name what stops do; return whether all that are not held part.

    What parts, however slowly, would pull if it were held.
    """
    stops, first = problem.count - cones, 2 * cones
    for stop in range(stops):
        speed = answer.velocity[first + stop]
        parts = speed > BARELY * scaling.unit * scaling.root[first + stop]
        if scaling.held[stop] == 0.0 and not parts:
            return False
    for stop in range(stops):
        answer.mode[cones + stop] = STICK if scaling.held[stop] == 1.0 else OPEN
    return True


@kernel
def let_go(first: int, stops: int, held: Floats, impulse: Floats) -> int:
    """Hold the stops no longer that pull; return how many.

    What pulls no more than rounding may explain is left without an impulse. Stops begin in a row.
    """
    largest, pulling = 0.0, 0
    for row in range(first + stops):
        largest = max(largest, abs(impulse[row]))
    for stop in range(stops):
        if impulse[first + stop] < 0.0:
            if impulse[first + stop] < -CLEAN * largest:
                held[stop] = 0.0
                pulling += 1
            impulse[first + stop] = 0.0
    return pulling


@kernel
def share_standing(
    code: int, cones: int, problem: ContactProblem, scaling: Scaling, rows: StickingRows,
    answer: ContactAnswer,
) -> bool:  # fmt: skip
    """Share impulses to the least norm where rows depend on others, as under straight legs.

    False is returned where it is not clear whether one does, or where a pivot has cost digits.
    """
    x, sharers, edge = rows.x, rows.sharers, 2 * cones
    stops = problem.count - cones
    size = stops
    for row in range(edge):
        if row > 1 and row % 2 == 1 and (code >> (cones - 1 - row // 2)) & 1 == 1:
            rows.equation[row] = rows.equation[row - 2]
            sharers[rows.equation[row]] += 1.0
        else:
            rows.equation[row] = size
            rows.row[size] = row
            sharers[size] = 1.0
            size += 1
    for stop in range(stops):
        rows.equation[edge + stop] = stop
        rows.row[stop] = edge + stop
        sharers[stop] = 1.0
    for i in range(size):
        row, pivot = rows.row[i], rows.pivot[i]
        diagonal = 1.0 if i < stops and scaling.held[i] == 0.0 else problem.delassus[row, row]
        if not pivot > COSTLY_PIVOT * diagonal and not abs(pivot) <= NO_PIVOT * diagonal:
            return False
    leave_out_idle(size, rows)
    for row in range(edge + stops):
        place = row_of(row, rows.equation)
        answer.impulse[row] = x[place] / sharers[place]
    return True


@dissolved_kernel
def repeat(
    problem: ContactProblem,
    settings: Settings,
    rows: StickingRows,
    scaling: Scaling,
    answer: ContactAnswer,
) -> bool:
    """Solve the contact problem if its contacts do nearly what their modes say; return success.

    After a success the answer is the one of least norm, certified as :data:`AS_GOOD`. Of contacts
    that pull or press although they should not, the modes are changed.
    """
    if stand(problem, settings, rows, scaling, answer):
        return True
    drifts = False
    for attempt in range(TRIES):
        size, slips = list_equations(attempt == 0, problem, answer.mode, rows)
        if size < 0:
            return False
        solved, rank = FAILS, 0
        if slips:
            rank = solve_slipping(size, problem, rows)
        elif not drifts:
            solved, rank = solve_at_once(size, problem, rows)
        if solved == FAILS and not slips:
            rank = solve_equations(size, problem, rows)
        if rank < 0:
            return False
        changed = share_impulses(problem, rank == size, rows, answer)
        if changed < 0:
            return False
        if changed == 0:
            worst = certify(problem, settings, scaling, answer)
            changed = name_by_velocity(problem, rows.pulled, scaling, answer)
            if changed == 0 and worst <= min(settings.tolerance, AS_GOOD):
                return True
            if changed <= 0 and solved != MAY_DRIFT:
                return False
            if changed <= 0:
                drifts = True
                take_back_slips(problem, answer.mode)
    return False


@kernel
def take_back_slips(problem: ContactProblem, mode: Integers) -> None:
    """Let contacts that were named slipping stick again, as they were asked to."""
    for contact in range(problem.count):
        if mode[contact] != OPEN:
            mode[contact] = STICK
