"""From the data of a problem to the units that solvers work in, and back."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.spatial.certificate import weigh_blocks
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockSettings,
    Floats,
    Iterate,
    ScaledBlocks,
)


@kernel
def sign(value: float) -> float:
    """Return 1 above zero and -1 below."""
    return 1.0 if value > 0.0 else (-1.0 if value < 0.0 else 0.0)


@kernel
def scale_blocks(problem: BlockProblem, settings: BlockSettings, scaled: ScaledBlocks) -> None:
    """Write the problem in units of its own; what no impulse moves counts fully."""
    weigh_blocks(problem, settings, scaled)
    scale_data(problem, scaled)
    rows = problem.first[problem.count]
    for row in range(rows):
        scale = scaled.weight[row]
        for column in range(rows):
            both = scale * scaled.weight[column]
            scaled.matrix[row, column] = problem.delassus[row, column] * both


@kernel
def scale_data(problem: BlockProblem, scaled: ScaledBlocks) -> None:
    """Write weights, bounds and free velocities in units of the problem that has been weighed."""
    first, unit = problem.first, scaled.unit
    for block in range(problem.count):
        scale = scaled.scale[block]
        forces = unit * scale
        scaled.bound[block] = problem.bound[block] / forces if forces > 0.0 else 0.0
        for row in range(first[block], first[block + 1]):
            scaled.weight[row] = scale
            if forces > 0.0:
                scaled.offset[row] = problem.free[row] * scale / unit
            else:
                scaled.offset[row] = sign(problem.free[row])


@kernel
def take_impulses(
    problem: BlockProblem, scaled: ScaledBlocks, impulse: Floats, iterate: Iterate
) -> None:
    """Begin with given impulses, in units of the solvers."""
    for block in range(problem.count):
        forces = scaled.unit * scaled.scale[block]
        for row in range(problem.first[block], problem.first[block + 1]):
            iterate.x[row] = impulse[row] / forces if forces > 0.0 else 0.0


@kernel
def give_impulses(
    problem: BlockProblem, scaled: ScaledBlocks, x: Floats, answer: BlockAnswer
) -> None:
    """Write scaled impulses to the answer, in units of the data."""
    for block in range(problem.count):
        forces = scaled.unit * scaled.scale[block]
        for row in range(problem.first[block], problem.first[block + 1]):
            answer.impulse[row] = x[row] * forces
