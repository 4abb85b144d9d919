"""The impulse that goes with given contact modes, and whether it solves the problem.

Knowing which contacts are open, stick or slip to which side turns the contact problem into
linear equations: zero normal velocity at closed contacts, zero tangential velocity at sticking
ones. They are often singular (two vertices of one flat foot) and then consistent, so the
elimination reveals the rank and the free directions, along which the least-norm split is chosen.
All solvers end here: what they contribute is the modes. The certificate has the last word.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.certificate import certify
from heelstrike.contact.modes import (
    OPEN,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SOLVED,
    STICK,
    UNCERTIFIED,
)
from heelstrike.contact.sets import LINE, projected, row_of
from heelstrike.contact.solvers.least_norm import split
from heelstrike.contact.workspace import (
    ContactAnswer,
    ContactProblem,
    Equations,
    Floats,
    Integers,
    ReducedProblem,
    Scaling,
    Settings,
    Tally,
)
from heelstrike.dynamics.dense import eliminate

SHARP = 1e-13
"""Residuals above this are worth a step of iterative refinement."""

PROMISING = 1e-6
"""Residuals below this, relative to the velocities that cancel, may be due to rounding."""

EXCESS = 1e-11
"""Impulses this far outside their cones, relative to the largest, are not on its edge."""

REFINEMENTS = 5
"""Most steps of iterative refinement."""


@kernel
def assemble(
    problem: ContactProblem,
    mode: Integers,
    slope: Floats,
    reduced: ReducedProblem,
    equations: Equations,
) -> None:
    """Write the equations of some modes.

    At a slipping contact the tangential impulse follows from the normal one and has no equation.
    """
    delassus, friction = problem.delassus, problem.friction
    tangent, source, scale = reduced.tangent, reduced.source, reduced.scale
    equation, tableau = equations.unknown, equations.tableau
    ratio, weight = equations.friction_ratio, equations.weight
    size = 0
    for contact in range(problem.count):
        if mode[contact] == OPEN:
            continue
        first = reduced.normal[contact]
        equation[size] = first
        weight[size] = scale[first]
        ratio[size] = slope[contact]
        if tangent[contact] >= 0:
            if mode[contact] == STICK:
                size += 1
                equation[size] = first + 1
                weight[size] = scale[first + 1]
                ratio[size] = 0.0
            else:
                ratio[size] = friction[contact]
                if mode[contact] == SLIP_FORWARD:
                    ratio[size] = -friction[contact]
        if ratio[size] != 0.0:
            weight[size] *= math.sqrt(1.0 + ratio[size] * ratio[size])
        size += 1
    for i in range(size):
        tableau[i, 0] = reduced.offset[row_of(i, equation)]
    for j in range(size):
        unknown = row_of(j, equation)
        column, column_scale, along = row_of(unknown, source), scale[unknown], ratio[j]
        for i in range(size):
            of_row = row_of(i, equation)
            row = row_of(of_row, source)
            entry = delassus[row, column]
            if along != 0.0:
                entry += along * delassus[row, column + 1]
            tableau[i, j + 1] = scale[of_row] * entry * column_scale
    equations.size = size


@kernel
def expand(
    problem: ContactProblem, point: Floats, slope: Floats, tangent: Integers, answer: ContactAnswer
) -> None:
    """Write the point out as an impulse inside the cones, exactly.

    The point is in units of impulse; along a slipping contact it measures the whole impulse.
    """
    mode, impulse = answer.mode, answer.impulse
    place = 0
    for contact in range(problem.count):
        row = problem.first[contact]
        has_tangent = problem.first[contact + 1] > row + 1
        impulse[row] = 0.0
        if has_tangent:
            impulse[row + 1] = 0.0
        if mode[contact] == OPEN:
            continue
        along = point[place]
        place += 1
        if tangent[contact] >= 0 and mode[contact] == STICK:
            across = point[place]
            place += 1
        else:
            ratio = slope[contact]
            if tangent[contact] >= 0:
                limit = problem.friction[contact]
                ratio = -limit if mode[contact] == SLIP_FORWARD else limit
            along /= math.sqrt(1.0 + ratio * ratio)
            across = ratio * along
        impulse[row], across = projected(problem, contact, along, across)
        if has_tangent:
            impulse[row + 1] = across


@kernel
def evaluate(
    problem: ContactProblem, settings: Settings, reduced: ReducedProblem, tally: Tally,
    scaling: Scaling, equations: Equations, trial: ContactAnswer,
) -> float:  # fmt: skip
    """Find the impulse of the modes under trial and return its largest residual.

    Where rounding shows, iterative refinement sharpens the answer as long as it helps.
    """
    point, before = equations.point, equations.before
    for contact in range(problem.count):
        if problem.set[contact] == LINE:
            trial.mode[contact] = STICK
    assemble(problem, trial.mode, scaling.slope, reduced, equations)
    symmetric = settings.skewed == 0
    for j in range(equations.size):
        symmetric = symmetric and equations.friction_ratio[j] == 0.0
    singular = (
        eliminate(
            equations.size, symmetric, equations.tableau, equations.pivot_row, equations.taken
        )
        > 0
    )
    for j in range(equations.size):
        row = equations.pivot_row[j]
        point[j] = equations.weight[j] * equations.tableau[row, 0] if row >= 0 else 0.0
    held = not symmetric  # whether directions that change a velocity are held back
    if singular:
        held = split(problem, trial.mode, held, reduced, tally, equations)
    worst = prove(problem, settings, reduced.tangent, point, scaling, trial)
    if singular and held and not worst < PROMISING * (1.0 + scaling.effort):
        # The slip speed is not unique, and what the elimination left it at does not do.
        split(problem, trial.mode, False, reduced, tally, equations)
        worst = prove(problem, settings, reduced.tangent, point, scaling, trial)
    for _ in range(REFINEMENTS):
        if worst < max(SHARP, 4.0 * scaling.rounding):
            break
        if not worst < PROMISING * (1.0 + scaling.effort):
            break
        for j in range(equations.size):
            before[j] = point[j]
        refine(reduced, trial.velocity, equations)
        sharper = prove(problem, settings, reduced.tangent, point, scaling, trial)
        if not sharper < worst:
            for j in range(equations.size):
                point[j] = before[j]
            return prove(problem, settings, reduced.tangent, point, scaling, trial)
        worst = sharper
    return worst


@kernel
def prove(
    problem: ContactProblem, settings: Settings, tangent: Integers, point: Floats,
    scaling: Scaling, trial: ContactAnswer,
) -> float:  # fmt: skip
    """Write the point out as an impulse and certify it; return its largest residual."""
    expand(problem, point, scaling.slope, tangent, trial)
    return certify(problem, settings, scaling, trial)


@kernel
def refine(reduced: ReducedProblem, velocity: Floats, equations: Equations) -> None:
    """Correct the point by what the equations' velocities still lack to zero."""
    equation, pivot_row, speed = equations.unknown, equations.pivot_row, equations.step
    size = equations.size
    for j in range(size):
        speed[j] = reduced.scale[equation[j]] * velocity[reduced.source[equation[j]]]
    for j in range(size):
        if pivot_row[j] >= 0:
            correction = 0.0
            for k in range(size):
                if pivot_row[k] >= 0:
                    correction -= equations.tableau[pivot_row[j], k + 1] * speed[pivot_row[k]]
            equations.point[j] += equations.weight[j] * correction


@kernel
def mode_of_slip(velocity: float, rest: float) -> int:
    """Name what a closed contact does by its tangential velocity."""
    if velocity > rest:
        return SLIP_FORWARD
    return SLIP_BACKWARD if velocity < -rest else STICK


@kernel
def slip_of(problem: ContactProblem, contact: int, root: Floats, answer: ContactAnswer) -> int:
    """Name what a contact does, if it is closed, by its tangential velocity, if it has one."""
    tangent = problem.first[contact] + 1
    if problem.first[contact + 1] == tangent:
        return STICK
    return mode_of_slip(answer.velocity[tangent], answer.rest * root[tangent])


@kernel
def label(
    problem: ContactProblem, tangent: Integers, scaling: Scaling, answer: ContactAnswer
) -> bool:
    """Name every contact's mode from its velocity; return whether that is another problem.

    A contact that a solver calls open or slipping, but whose velocity is zero, may carry any
    impulse in its cone. Only with all of these admitted is the least-norm split unique.
    """
    mode, velocity, root, rest = answer.mode, answer.velocity, scaling.root, answer.rest
    changed = False
    for contact in range(problem.count):
        row = problem.first[contact]
        name = slip_of(problem, contact, root, answer)
        if velocity[row] > rest * root[row] and problem.set[contact] != LINE:
            name = OPEN
        if tangent[contact] >= 0:
            changed = changed or name != mode[contact]
        else:
            changed = changed or (name == OPEN) != (mode[contact] == OPEN)
        mode[contact] = name
    return changed


@kernel
def correct_modes(
    problem: ContactProblem, tangent: Integers, root: Floats, equations: Equations,
    trial: ContactAnswer,
) -> int:  # fmt: skip
    """Change the modes under trial that their own answer contradicts.

    What penetrates closes, and slips as it did; what pulls opens. Friction beyond its cone slips,
    and slip against its friction sticks. Returns ``SOLVED``, or ``UNCERTIFIED`` if nothing is
    changed.
    """
    mode, velocity, point, rest = trial.mode, trial.velocity, equations.point, trial.rest
    slack = 0.0
    for place in range(equations.size):
        slack = max(slack, EXCESS * abs(point[place]))
    changed = False
    place = 0
    for contact in range(problem.count):
        row = problem.first[contact]
        before = mode[contact]
        if before == OPEN:
            if velocity[row] < -rest * root[row]:
                mode[contact] = slip_of(problem, contact, root, trial)
        else:
            along = point[place]
            place += 1
            frictional = tangent[contact] >= 0
            if frictional and before == STICK:
                across = point[place]
                place += 1
                limit = problem.friction[contact] * along + slack
                if across > limit:
                    mode[contact] = SLIP_BACKWARD
                elif -across > limit:
                    mode[contact] = SLIP_FORWARD
            elif frictional:
                slip = velocity[row + 1] if before == SLIP_FORWARD else -velocity[row + 1]
                if slip < -rest * root[row + 1]:
                    mode[contact] = STICK
            if along < -slack and problem.set[contact] != LINE:
                mode[contact] = OPEN
        changed = changed or mode[contact] != before
    return SOLVED if changed else UNCERTIFIED
