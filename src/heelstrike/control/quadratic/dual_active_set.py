"""The dual active-set method for strictly convex quadratic programmes.

After D. Goldfarb and A. Idnani, *A numerically stable dual method for solving strictly convex
quadratic programs*, Mathematical Programming 27 (1983). It begins with the least of the objective
without rows and takes up violated rows one by one; every point on its way is the answer of the
programme with the rows taken up so far, so that it needs no feasible beginning and finds out by
itself that there is none.

With H = L Lᵀ the columns of J = L⁻ᵀQ are H-orthonormal; the normals of the q rows taken up are
Jᵀ N = [R; 0]. A row's normal n moves x along z = J₂J₂ᵀn, in the null space of the others, while
their multipliers change at the rate −R⁻¹J₁ᵀn.
"""

from __future__ import annotations

from math import hypot, inf, sqrt

from heelstrike.compiler.compilation import kernel
from heelstrike.control.quadratic.program import (
    INFEASIBLE,
    NOT_CONVEX,
    SOLVED,
    TOO_MANY_ITERATIONS,
    Program,
)

VIOLATED = 1e-11
"""A row that is missed by less, relative to its own size, is kept."""

DEPENDENT = 1e-12
"""A normal whose part beside those taken up is smaller, relative to itself, depends on them."""

STRAYED = 1e-10
"""An answer whose rows or forces are farther off than this, relative to their size, is refined."""

REFINEMENTS = 3
"""How often, at most."""


NO_ROW = 1e-30
"""Size, far below that of any row, which keeps a row of zeros from being divided by."""

NO_SIZE = 1e-300
"""The same of a programme, in which rows may be as small as numbers are."""


@kernel
def begin(program: Program) -> bool:
    """Find the least without rows, and J = L⁻ᵀ; tell whether H is positive definite."""
    hessian, lower, inverse = program.hessian, program.triangle, program.inverse
    gradient, x = program.gradient, program.x
    n = x.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = hessian[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i != j:
                lower[i, j] = total / lower[j, j]
            elif total > 0.0:
                lower[i, i] = sqrt(total)
            else:
                return False
    for j in range(n):  # row j of J is column j of L⁻¹
        for i in range(n):
            total = 1.0 if i == j else 0.0
            if i < j:
                inverse[j, i] = 0.0
                continue
            for k in range(j, i):
                total -= lower[i, k] * inverse[j, k]
            inverse[j, i] = total / lower[i, i]
    for k in range(n):
        total = 0.0
        for j in range(k + 1):
            total -= inverse[j, k] * gradient[j]
        program.along[k] = total
    for i in range(n):
        total = 0.0
        for k in range(i, n):
            total += inverse[i, k] * program.along[k]
        x[i] = total
    return True


@kernel
def slack(program: Program, row: int) -> float:
    """By how much a row is kept."""
    total = -program.bound[row]
    for i in range(program.x.shape[0]):
        total += program.rows[row, i] * program.x[i]
    return total


@kernel
def size_of(program: Program, row: int) -> float:
    """Size of the terms of a row, for its rounding."""
    total = abs(program.bound[row])
    for i in range(program.x.shape[0]):
        total += abs(program.rows[row, i] * program.x[i])
    return total


@kernel
def most_violated(program: Program, taken: int) -> int:
    """Return the row that is missed by most in its own units, or -1; equalities come first."""
    worst, found = 0.0, -1
    for row in range(program.count):
        if program.given_up[row] != 0:
            continue
        missed = slack(program, row)
        if row < program.equalities:
            missed = -abs(missed)
        if missed >= -VIOLATED * (NO_ROW + size_of(program, row)):
            continue
        held = False
        for k in range(taken):
            held = held or program.active[k] == row
        if held:
            continue
        if row < program.equalities:
            return row
        length = 0.0
        for i in range(program.x.shape[0]):
            length += program.rows[row, i] * program.rows[row, i]
        missed /= sqrt(length) + NO_ROW
        if missed < worst:
            worst, found = missed, row
    return found


@kernel
def directions(program: Program, row: int, sign: float, taken: int) -> tuple[float, float]:
    """Find Jᵀn, the step z and the rates R⁻¹J₁ᵀn; return |J₂ᵀn|² and |Jᵀn|²."""
    n = program.x.shape[0]
    inverse, along = program.inverse, program.along
    free, whole = 0.0, 0.0
    for k in range(n):
        total = 0.0
        for i in range(n):
            total += inverse[i, k] * program.rows[row, i]
        along[k] = sign * total
        whole += total * total
        if k >= taken:
            free += total * total
    for i in range(n):
        total = 0.0
        for k in range(taken, n):
            total += inverse[i, k] * along[k]
        program.step[i] = total
    for k in range(taken - 1, -1, -1):
        total = along[k]
        for j in range(k + 1, taken):
            total -= program.triangle[k, j] * program.turned[j]
        program.turned[k] = total / program.triangle[k, k]
    return free, whole


@kernel
def rotate(program: Program, first: int, cosine: float, sine: float) -> None:
    """Turn two neighbouring columns of J."""
    inverse = program.inverse
    for i in range(program.x.shape[0]):
        a, b = inverse[i, first], inverse[i, first + 1]
        inverse[i, first] = cosine * a + sine * b
        inverse[i, first + 1] = cosine * b - sine * a


@kernel
def take_up(program: Program, row: int, taken: int) -> None:
    """Add a row, whose Jᵀn is in `along`, to those taken up."""
    along = program.along
    for k in range(program.x.shape[0] - 2, taken - 1, -1):
        length = hypot(along[k], along[k + 1])
        if along[k + 1] != 0.0:
            rotate(program, k, along[k] / length, along[k + 1] / length)
            along[k] = length
            along[k + 1] = 0.0
    for k in range(taken + 1):
        program.triangle[k, taken] = along[k]
    program.active[taken] = row


@kernel
def drop(program: Program, place: int, taken: int) -> None:
    """Remove one of the rows taken up; the dual numbers move up with those behind it."""
    triangle = program.triangle
    for j in range(place, taken - 1):
        program.active[j] = program.active[j + 1]
        for k in range(j + 2):
            triangle[k, j] = triangle[k, j + 1]
    for j in range(place, taken):
        program.dual[j] = program.dual[j + 1]
    for k in range(place, taken - 1):
        length = hypot(triangle[k, k], triangle[k + 1, k])
        if triangle[k + 1, k] == 0.0:
            continue
        cosine, sine = triangle[k, k] / length, triangle[k + 1, k] / length
        for j in range(k, taken - 1):
            a, b = triangle[k, j], triangle[k + 1, j]
            triangle[k, j] = cosine * a + sine * b
            triangle[k + 1, j] = cosine * b - sine * a
        rotate(program, k, cosine, sine)


@kernel
def blocking(program: Program, taken: int) -> int:
    """Return the place of the row whose multiplier first becomes zero along the way, or -1."""
    least, place = inf, -1
    for k in range(taken):
        if program.active[k] >= program.equalities and program.turned[k] > 0.0:
            length = program.dual[k] / program.turned[k]
            if length < least:
                least, place = length, k
    return place


@kernel
def satisfy(program: Program, row: int, taken: int) -> int:
    """Take a violated row up, dropping those in its way; return how many there are, or -1."""
    n = program.x.shape[0]
    sign = 1.0
    if row < program.equalities and slack(program, row) > 0.0:
        sign = -1.0
    program.dual[taken] = 0.0
    while True:
        free, whole = directions(program, row, sign, taken)
        place = blocking(program, taken)
        until = program.dual[place] / program.turned[place] if place >= 0 else inf
        full = inf
        if taken < n and free > DEPENDENT * whole:
            full = -sign * slack(program, row) / free
        length = min(until, full)
        if length == inf:
            return -1
        if full < inf:
            for i in range(n):
                program.x[i] += length * program.step[i]
        for k in range(taken):
            program.dual[k] -= length * program.turned[k]
        program.dual[taken] += length
        program.iterations += 1
        if full <= until:
            take_up(program, row, taken)
            return taken + 1
        drop(program, place, taken)
        taken -= 1


@kernel
def sign_of(program: Program, row: int, signs: int) -> float:
    """Return the sense in which a row was taken up: equalities may be, from either side."""
    return -1.0 if row < program.equalities and (signs >> row) & 1 else 1.0


@kernel
def strayed(program: Program, taken: int, signs: int) -> bool:
    """Whether x is off the rows taken up, or forces off balance; write Nu − H x − g into `step`."""
    n = program.x.shape[0]
    worst, force = 0.0, 0.0
    for i in range(n):
        total, size = -program.gradient[i], abs(program.gradient[i])
        for j in range(n):
            share = program.hessian[i, j] * program.x[j]
            total -= share
            size += abs(share)
        for k in range(taken):
            row = program.active[k]
            share = sign_of(program, row, signs) * program.rows[row, i] * program.dual[k]
            total += share
            size += abs(share)
        program.step[i] = total
        worst, force = max(worst, abs(total)), max(force, size)
    off = worst > STRAYED * force
    for k in range(taken):
        row = program.active[k]
        off = off or abs(slack(program, row)) > STRAYED * (NO_ROW + size_of(program, row))
    return off


@kernel
def refine(program: Program, taken: int, signs: int) -> None:
    """Solve once more for what is missing, which is in `step` and in the rows taken up.

    H δx − N δu = ρ and Nᵀδx = r are, with δx = J z: z₁ = R⁻ᵀr, z₂ = J₂ᵀρ, R δu = z₁ − J₁ᵀρ.
    """
    n = program.x.shape[0]
    along, turned, triangle = program.along, program.turned, program.triangle
    for k in range(n):
        total = 0.0
        for i in range(n):
            total += program.inverse[i, k] * program.step[i]
        along[k] = total
    for k in range(taken):
        row = program.active[k]
        total = -sign_of(program, row, signs) * slack(program, row)
        for j in range(k):
            total -= triangle[j, k] * turned[j]
        turned[k] = total / triangle[k, k]
    for k in range(taken):
        along[k], turned[k] = turned[k], turned[k] - along[k]
    for k in range(taken - 1, -1, -1):
        total = turned[k]
        for j in range(k + 1, taken):
            total -= triangle[k, j] * turned[j]
        turned[k] = total / triangle[k, k]
        program.dual[k] += turned[k]
    for i in range(n):
        for k in range(n):
            program.x[i] += program.inverse[i, k] * along[k]


@kernel
def solve(program: Program) -> None:
    """Solve a programme: write `x`, `multiplier`, `status` and `iterations`.

    Rows of which `given_up` says so are left out. :func:`certify` says how good the answer is.
    """
    n = program.x.shape[0]
    for row in range(program.multiplier.shape[0]):
        program.multiplier[row] = 0.0
    program.iterations = 0
    if not begin(program):
        program.status = NOT_CONVEX
        return
    taken, signs, refinements = 0, 0, 0
    while True:
        row = most_violated(program, taken)
        if row < 0:
            if refinements < REFINEMENTS and strayed(program, taken, signs):
                refine(program, taken, signs)
                refinements += 1
                continue
            program.status = SOLVED
            break
        if program.iterations > 10 * (n + program.count):
            program.status = TOO_MANY_ITERATIONS
            break
        turned = row < program.equalities and slack(program, row) > 0.0
        taken = satisfy(program, row, taken)
        if taken < 0:
            program.status = INFEASIBLE
            return
        if turned:
            signs |= 1 << row
    for k in range(taken):
        row = program.active[k]
        program.multiplier[row] = sign_of(program, row, signs) * program.dual[k]


@kernel
def certify(program: Program) -> None:
    """Measure how far `x` and `multiplier` are from solving the programme, by its data alone.

    Every residual is relative to the sum of the sizes of what it is made of. Rows that were given
    up are not looked at.
    """
    n = program.x.shape[0]
    stationarity, violation, complementarity, force = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        total, size = program.gradient[i], abs(program.gradient[i])
        for j in range(n):
            total += program.hessian[i, j] * program.x[j]
            size += abs(program.hessian[i, j] * program.x[j])
        for row in range(program.count):
            share = program.rows[row, i] * program.multiplier[row]
            total -= share
            size += abs(share)
        stationarity = max(stationarity, abs(total))
        force = max(force, size)
    for row in range(program.count):
        if program.given_up[row] != 0:
            continue
        size = size_of(program, row) + NO_SIZE
        missed = slack(program, row) / size
        pull = 0.0
        for i in range(n):
            pull = max(pull, abs(program.rows[row, i] * program.multiplier[row]))
        if row < program.equalities:
            violation = max(violation, abs(missed))
        else:
            violation = max(violation, -missed)
            wrong = pull if program.multiplier[row] < 0.0 else min(1.0, abs(missed)) * pull
            complementarity = max(complementarity, wrong)
    scale = 1.0 / (force + NO_SIZE)
    program.stationarity = scale * stationarity
    program.violation = violation
    program.complementarity = scale * complementarity


@kernel
def solve_or_relax(program: Program) -> None:
    """Solve and certify; while not all rows can be kept, give up those of the greatest level.

    `relaxed` is then how many levels were given up. Rows of level zero are never given up: if they
    contradict each other the status says INFEASIBLE, and `x` is not to be used.
    """
    program.relaxed = 0
    for row in range(program.given_up.shape[0]):
        program.given_up[row] = 0
    solve(program)
    while program.status == INFEASIBLE:
        greatest = 0
        for row in range(program.count):
            if program.given_up[row] == 0:
                greatest = max(greatest, program.level[row])
        if greatest == 0:
            return
        for row in range(program.count):
            if program.level[row] == greatest:
                program.given_up[row] = 1
        program.relaxed += 1
        solve(program)
    certify(program)
