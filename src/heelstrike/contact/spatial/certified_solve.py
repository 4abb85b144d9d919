"""The one entry to contact in space for kernels: ways to solve in turn, each answer certified."""

from __future__ import annotations

import math
from typing import Any

from numba import types

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.separate_kernel import call_at, separate_kernel
from heelstrike.contact.sets import INTERVAL
from heelstrike.contact.spatial.certificate import certify_blocks
from heelstrike.contact.spatial.fixed_point import guess_slips
from heelstrike.contact.spatial.gauss_seidel import sweep
from heelstrike.contact.spatial.iterates import look, return_to_best
from heelstrike.contact.spatial.modes import (
    FIXED_POINT,
    GAUSS_SEIDEL,
    LAST_MODES,
    NEWTON,
    NOT_FOUND,
    PROXIMAL,
    REGULARISED,
    RESTARTS,
    SLIP,
    SOLVED,
)
from heelstrike.contact.spatial.newton import RIDGE, iterate_newton
from heelstrike.contact.spatial.proximal import approach
from heelstrike.contact.spatial.restarts import try_other_starts
from heelstrike.contact.spatial.scaling import give_impulses, scale_blocks, take_impulses
from heelstrike.contact.spatial.sticking import stick_within_cones, try_sticking
from heelstrike.contact.spatial.workspace import (
    BlockAnswer,
    BlockProblem,
    BlockTally,
    BlockWorkspace,
    Iterate,
    ScaledBlocks,
)

WAYS = 7
"""How many ways there are."""

FIRST_STEPS, NEXT_STEPS = 12, 40
"""Steps of Newton's method from the last impulses, and later."""

FIRST_SWEEPS, NEXT_SWEEPS = 6, 30
"""Sweeps before Newton's method, at first and later."""

FIRST_RIDGE, NEXT_RIDGE, LAST_RIDGE = 1e-7, 1e-5, 1e-3
"""What is added to the diagonal where Newton's method goes astray."""

FIRST_TIE, STRONGER, TURNS_OF_TIES = 1e-1, 10.0, 4
"""What the proximal-point method adds to the diagonal; how many times more at the next turn; and
how many turns there are."""

FIRST_TIES = 80
"""How many problems the first turn has at most; each has twice as many as the one before."""


def _signature() -> Any:
    return types.int64(
        BlockProblem.compiled_type(), BlockWorkspace.compiled_type(), BlockAnswer.compiled_type()
    )


@kernel
def count_solve(tally: BlockTally) -> None:
    """Count a solve, of which nothing has been tried yet."""
    tally.solves += 1
    tally.iterations = 0
    tally.last_fallbacks = 0
    tally.solver = LAST_MODES


@kernel
def count_slips(problem: BlockProblem, answer: BlockAnswer) -> tuple[int, int]:
    """How many contacts slip by the modes of the answer, and how much dry friction slides."""
    slipping = sliding = 0
    for block in range(problem.count):
        if answer.mode[block] == SLIP:
            rubs = problem.set[block] == INTERVAL
            slipping += not rubs
            sliding += rubs
    return slipping, sliding


@kernel
def begin_from(
    problem: BlockProblem, scaled: ScaledBlocks, answer: BlockAnswer, iterate: Iterate
) -> None:
    """Begin with the impulses and modes of an answer."""
    take_impulses(problem, scaled, answer.impulse, iterate)
    for block in range(problem.count):
        iterate.mode[block] = answer.mode[block]


@kernel
def try_last_modes(problem: BlockProblem, answer: BlockAnswer, work: BlockWorkspace) -> None:
    """Solve the scaled problem with the modes of an answer, from its impulses."""
    scaled, settings, tally = work.scaled, work.settings, work.tally
    iterate, newton = work.iterate, work.newton
    slipping, sliding = count_slips(problem, answer)
    if slipping == 0:
        tally.iterations += 1
        if try_sticking(problem, scaled, iterate, newton) or sliding == 0:
            return
        begin_from(problem, scaled, answer, iterate)
    iterate_newton(problem, scaled, settings, FIRST_STEPS, RIDGE, True, tally, iterate, newton)


@kernel
def try_way(way: int, problem: BlockProblem, answer: BlockAnswer, work: BlockWorkspace) -> None:
    """Try one way to solve the scaled problem; the iterate keeps the best impulses."""
    scaled, settings, tally = work.scaled, work.settings, work.tally
    iterate, newton = work.iterate, work.newton
    if way == LAST_MODES:
        try_last_modes(problem, answer, work)
    elif way == NEWTON:
        return_to_best(problem, scaled, iterate)
        iterate_newton(
            problem, scaled, settings, NEXT_STEPS, RIDGE, False, tally, iterate, newton
        )  # fmt: skip
    elif way == GAUSS_SEIDEL:
        return_to_best(problem, scaled, iterate)
        sweep(problem, scaled, FIRST_SWEEPS, tally, iterate)
        iterate_newton(
            problem, scaled, settings, NEXT_STEPS, RIDGE, False, tally, iterate, newton
        )  # fmt: skip
    elif way == REGULARISED:
        tally.iterations += 1
        if stick_within_cones(problem, scaled, settings.tolerance, iterate, newton):
            return
        for turn in range(3):
            ridge = FIRST_RIDGE if turn == 0 else (NEXT_RIDGE if turn == 1 else LAST_RIDGE)
            sweep(problem, scaled, NEXT_SWEEPS, tally, iterate)
            iterate_newton(
                problem, scaled, settings, NEXT_STEPS, ridge, False, tally, iterate, newton
            )  # fmt: skip
            if iterate.least <= settings.tolerance:
                break
    elif way == PROXIMAL:
        return_to_best(problem, scaled, iterate)
        strength, ties = FIRST_TIE, FIRST_TIES
        for _ in range(TURNS_OF_TIES):
            if approach(
                problem, settings, strength, ties, scaled, tally, iterate, newton, work.anchor
            ):  # fmt: skip
                break
            strength *= STRONGER
            ties *= 2
    elif way == RESTARTS:
        try_other_starts(problem, settings, scaled, tally, iterate, newton)
    elif way == FIXED_POINT:
        guess_slips(problem, settings, scaled, tally, iterate, newton, work.anchor)


@separate_kernel(_signature)
def try_ways(problem: BlockProblem, work: BlockWorkspace, answer: BlockAnswer) -> int:
    """Solve a problem; see :func:`solve_block_problem`, whose arguments these are."""
    scaled, settings, tally, iterate = work.scaled, work.settings, work.tally, work.iterate
    count_solve(tally)
    scale_blocks(problem, settings, scaled)
    begin_from(problem, scaled, answer, iterate)
    iterate.least = math.inf
    status = NOT_FOUND
    for way in range(settings.ways):
        if way > 0:
            tally.fallbacks += way > NEWTON
            tally.last_fallbacks += 1
        before = iterate.least
        try_way(way, problem, answer, work)
        if iterate.least < before:
            tally.solver = way
        if not iterate.least < math.inf:
            for row in range(problem.first[problem.count]):
                iterate.x[row] = 0.0
            look(problem, scaled, iterate)
        if iterate.least > settings.tolerance:
            continue
        give_impulses(problem, scaled, iterate.best, answer)
        if certify_blocks(problem, settings, scaled, answer) <= settings.tolerance:
            status = SOLVED
            tally.shortcuts += way == LAST_MODES
            break
    if status != SOLVED:
        tally.failures += 1
        give_impulses(problem, scaled, iterate.best, answer)
        certify_blocks(problem, settings, scaled, answer)
    return status


@kernel
def solve_block_problem(problem: BlockProblem, work: BlockWorkspace, answer: BlockAnswer) -> int:
    """Solve one contact problem in space inside compiled code; return how it ended.

    Parameters
    ----------
    problem : BlockProblem
        The problem.
    work : BlockWorkspace
        Buffers; the tally is updated, the settings are read.
    answer : BlockAnswer
        In: guessed modes, and impulses to begin with. Out: the solution, or after a failure the
        impulses of the smallest residual; modes are named by the velocity.

    Returns
    -------
    int
        ``SOLVED`` or ``NOT_FOUND`` (:class:`~heelstrike.contact.spatial.modes.SpatialStatus`).
    """
    return int(call_at(work.solver[0], (problem, work, answer)))


def block_workspace(blocks: int, rows: int, *, ready: bool = True) -> BlockWorkspace:
    """Allocate the memory to solve problems of up to so many blocks and rows.

    Parameters
    ----------
    blocks, rows : int
        Most blocks and rows of a problem.
    ready : bool
        Whether to see to it that the solver is compiled. Those who say no call
        ``try_ways.finish()`` before they solve.
    """
    if ready:
        try_ways.finish()
    extents = {"blocks": max(blocks, 1), "rows": max(rows, 1), "components": 3}
    work = BlockWorkspace.allocate(extents, solver=try_ways.address)
    work.settings.tolerance = 1e-9
    work.settings.effort = 20000
    work.settings.ways = WAYS
    return work
