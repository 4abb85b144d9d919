"""The contact problem in space, its answer, and the memory of the solvers.

A problem is a list of blocks: points with their friction (three rows, two in a plane), joint stops,
dry friction and closed loops. The normal row of a block comes first. Solvers work on the problem in
units of its own, with one scale for each block: rows that are scaled each by itself would turn the
round cone into one of another shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, cell, part

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class BlockProblem(Bundle):
    """A contact problem of blocks of rows."""

    count: int = cell(int)
    """Number of blocks; the leading parts of the arrays are used."""
    first: Integers = array("blocks + 1", of=int)
    """Row that each block begins with; after the last, how many rows there are."""
    set: Integers = array("blocks", of=int)
    """Where its impulses may lie; see :mod:`heelstrike.contact.sets`."""
    friction: Floats = array("blocks")
    """Friction coefficient of each cone."""
    bound: Floats = array("blocks")
    """Largest impulse of each interval."""
    delassus: Floats = array("rows", "rows")
    """Delassus matrix, symmetric; a row says what the impulse of one does to all velocities."""
    free: Floats = array("rows")
    """Free velocity (or acceleration), the free term b."""


class BlockAnswer(Bundle):
    """What the blocks do, and the impulses that make them."""

    mode: Integers = array("blocks", of=int)
    impulse: Floats = array("rows")
    velocity: Floats = array("rows")
    residual: float = cell(float)
    """Natural map, rounding left out; see :mod:`heelstrike.contact.spatial.certificate`."""
    rounding: float = cell(float)
    """How far the true residual may exceed this."""


class BlockSettings(Bundle):
    """What the caller may choose."""

    tolerance: float = cell(float)
    """Largest residual that is certified."""
    floor: float = cell(float)
    """Smallest size of the data that residuals are set against."""
    effort: int = cell(int)
    """Most iterations of a solve, of all ways together."""
    ways: int = cell(int)
    """How many of the ways may be tried."""


class BlockTally(Bundle):
    """Counts: the first three of the last solve, the others of all until the caller clears them."""

    iterations: int = cell(int)
    solver: int = cell(int)
    last_fallbacks: int = cell(int)
    """iterations, solver, last_fallbacks: Iterations of all ways; code of the one whose answer it
    is; how many failed before it."""
    solves: int = cell(int)
    shortcuts: int = cell(int)
    fallbacks: int = cell(int)
    failures: int = cell(int)
    """solves, shortcuts, fallbacks, failures: ``shortcuts`` are the solves answered by the modes
    of the one before, ``fallbacks`` all ways that failed where there was another."""


class ScaledBlocks(Bundle):
    """A problem in units of its own: ``u = matrix x + offset`` with data of size one."""

    unit: float = cell(float)
    """Size of the data."""
    rounding: float = cell(float)
    """What rounding may hide from the certificate."""
    scale: Floats = array("blocks")
    """Inverse root of the largest diagonal entry of each block; zero where nothing moves."""
    weight: Floats = array("rows")
    """The same for each row."""
    size: Floats = array("rows")
    """Sum of the sizes of all that a velocity is summed of."""
    bound: Floats = array("blocks")
    matrix: Floats = array("rows", "rows")
    offset: Floats = array("rows")


class Iterate(Bundle):
    """Scaled impulses and the velocities they give."""

    x: Floats = array("rows")
    u: Floats = array("rows")
    mode: Integers = array("blocks", of=int)
    worst: float = cell(float)
    """Largest natural map of a block."""
    square: float = cell(float)
    """Sum of the squares of all."""
    best: Floats = array("rows")
    """The impulses of the smallest residual so far."""
    least: float = cell(float)
    """That residual."""


class NewtonSystem(Bundle):
    """The equations of one step of Newton's method, in the unknowns that the modes leave."""

    size: int = cell(int)
    """Number of unknowns."""
    block: Integers = array("rows", of=int)
    """The block that each unknown belongs to."""
    direction: Floats = array("rows", "components")
    """The impulse of its block per unit of each unknown."""
    equation: Floats = array("rows", "components")
    """The velocities of its block that each equation adds up."""
    extra: Floats = array("rows")
    """What is added to the diagonal."""
    across: Integers = array("rows", of=int)
    """Whether each equation is that of the friction across the slip."""
    known: Floats = array("rows")
    """Change of the impulses that the modes say by themselves."""
    moved: Floats = array("rows")
    """What that does to the velocities; and later what the whole step does."""
    spread: Floats = array("rows", "rows")
    """Velocity of each row per unit of each unknown."""
    system: Floats = array("rows", "rows")
    right: Floats = array("rows")
    """system, right: Matrix and right side, then factors and solution."""
    step: Floats = array("rows")
    """Change of the impulses."""
    trial_x: Floats = array("rows")
    trial_u: Floats = array("rows")
    """trial_x, trial_u: A point on the way."""
    row: Integers = array("rows", of=int)
    """Rows of a system of sticking contacts."""


class Anchor(Bundle):
    """What a problem with a larger diagonal, or with guessed slip speeds, is tied to."""

    center: Floats = array("rows")
    """The best impulses so far."""
    path: Floats = array("rows")
    """Impulses that it would keep."""
    diagonal: Floats = array("rows")
    offset: Floats = array("rows")
    """diagonal, offset: Of the problem itself."""
    slip: Floats = array("blocks")
    """Slip speed of each block that is guessed."""


class BlockWorkspace(Bundle):
    """Memory of the solvers."""

    settings: BlockSettings = part(BlockSettings)
    tally: BlockTally = part(BlockTally)
    scaled: ScaledBlocks = part(ScaledBlocks)
    iterate: Iterate = part(Iterate)
    newton: NewtonSystem = part(NewtonSystem)
    anchor: Anchor = part(Anchor)
    solver: Integers = array(1, of=int, address=True)
    """Address of the machine code of the solver, shared by all workspaces."""


def block_problem(blocks: int, rows: int, **given: Any) -> BlockProblem:
    """Allocate a problem of so many blocks and rows."""
    return BlockProblem.allocate({"blocks": blocks, "rows": rows}, **given)


def block_answer(blocks: int, rows: int, **given: Any) -> BlockAnswer:
    """Allocate an answer."""
    return BlockAnswer.allocate({"blocks": blocks, "rows": rows}, **given)
