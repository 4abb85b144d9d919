"""Tasks as costs of a quadratic programme."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.control.quadratic.program import Program
from heelstrike.robot.model import Floats


@kernel
def clear(program: Program) -> None:
    """Begin a new programme: no cost, no rows."""
    n = program.x.shape[0]
    for i in range(n):
        program.gradient[i] = 0.0
        for j in range(n):
            program.hessian[i, j] = 0.0
    program.count = 0
    program.equalities = 0


@kernel
def scratch_row(program: Program) -> int:
    """Return a row of zeros behind those that count."""
    row = program.count
    for i in range(program.x.shape[0]):
        program.rows[row, i] = 0.0
    return row


@kernel
def keep_row(bound: float, level: int, program: Program) -> int:
    """Let the row behind those that count be one of them; return which it is."""
    row = program.count
    program.bound[row] = bound
    program.level[row] = level
    program.count = row + 1
    return row


@kernel
def add_row(bound: float, level: int, program: Program) -> int:
    """Add a row of zeros; return which it is."""
    scratch_row(program)
    return keep_row(bound, level, program)


@kernel
def add_task(rows: Floats, row: int, missing: float, weight: float, program: Program) -> None:
    """Add ½ weight (row a − missing)² to the cost."""
    n = program.x.shape[0]
    for i in range(n):
        share = weight * rows[row, i]
        program.gradient[i] -= share * missing
        for j in range(n):
            program.hessian[i, j] += share * rows[row, j]
