"""Why no gait was found: the constraints in conflict, and by how much."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np

from heelstrike.errors import GaitNotFoundError
from heelstrike.gait.program import FEASIBLE, Program, Solution
from heelstrike.gait.starts import starts
from heelstrike.gait.transcription import Group
from heelstrike.robot.model import Floats
from heelstrike.wording import some_of

TAKES_PART = 0.05
"""Multiplier from which a constraint takes part in a conflict; 1 for those that are violated."""
ATTEMPTS = 2
"""Starting points from which the violations are minimised."""
NAMED = 4
"""Groups of constraints that a message names before it only counts."""


def nearest_to_feasible(program: Program, attempts: int = ATTEMPTS) -> Floats:
    """Minimise the sum of all violations, and return a point that has none.

    Parameters
    ----------
    program : Program
        The program.
    attempts : int
        Starting points.

    Raises
    ------
    GaitNotFoundError
        If some violation remains; the message names the constraints in conflict.
    """
    elastic = replace(program, elastic=True, near=False)
    found = []
    for start in islice(starts(program.request), attempts):
        found.append(elastic.solve(program.sampled(start)))
        if np.abs(program.violations(found[-1].unknowns)).max() <= FEASIBLE:
            return found[-1].unknowns
    nearest = min(found, key=lambda solution: solution.objective)
    raise GaitNotFoundError(_message(program, nearest))


def _message(program: Program, nearest: Solution) -> str:
    request = program.request
    violated = _worst_violations(program, nearest.unknowns)
    binding = _binding_groups(program, nearest, set(violated))
    against = f" They are in conflict with: {some_of(binding, NAMED, '; ')}." if binding else ""
    step = ""
    if request.free_step:
        duration, length = nearest.unknowns[-2:]
        step = f", with steps of {length:.3g} m in {duration:.3g} s,"
    return (
        f"robot {request.robot.name!r}: no gait with {request} was found, which does not prove "
        f"that there is none. The nearest to one{step} violates: "
        f"{some_of(list(violated.values()), NAMED, '; ')}.{against} Ask for a shorter or slower "
        "step, or relax one of these constraints."
    )


def _worst_violations(program: Program, unknowns: Floats) -> dict[Group, str]:
    """What is violated most in each group of constraints, in words, the worst group first."""
    violations = np.abs(program.violations(unknowns))
    worst: dict[Group, tuple[float, str]] = {}
    for (row, phase), violation in zip(program.labelled_rows(), violations, strict=True):
        if violation <= FEASIBLE or violation <= worst.get(row.kind, (0.0, ""))[0]:
            continue
        subject = f" ({row.subject})" if row.subject else ""
        when = "" if phase is None else f" at {100.0 * phase:.0f} % of the step"
        amount = f"{violation * row.unit:.3g} {row.kind.unit}"
        worst[row.kind] = (violation, f"{row.kind.text}{subject} by {amount}{when}")
    ordered = sorted(worst.items(), key=lambda item: -item[1][0])
    return {group: text for group, (_, text) in ordered}


def _binding_groups(program: Program, nearest: Solution, violated: set[Group]) -> list[str]:
    """Inequalities that hold, but only just, and keep the violated ones from holding."""
    strength: dict[Group, float] = {}
    rows = program.labelled_rows()
    for (row, _), multiplier in zip(rows, nearest.multipliers[-len(rows) :], strict=True):
        if row.lower < row.upper:
            strength[row.kind] = max(strength.get(row.kind, 0.0), abs(float(multiplier)))
    ordered = sorted(strength, key=lambda group: -strength[group])
    return [
        group.text for group in ordered if strength[group] > TAKES_PART and group not in violated
    ]
