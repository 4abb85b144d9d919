"""Contacts that stick and share a load in many ways: one within all cones is found."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL
from heelstrike.contact.spatial.certified_solve import block_workspace
from heelstrike.contact.spatial.iterates import look
from heelstrike.contact.spatial.scaling import give_impulses, scale_blocks
from heelstrike.contact.spatial.sticking import stick_within_cones
from heelstrike.contact.spatial.workspace import (
    BlockProblem,
    BlockWorkspace,
    block_answer,
    block_problem,
)

FIRST = np.array([0, 3, 6, 7, 8])
"""Rows of two points, a stop, and dry friction of a joint of its own."""

SLIDES = 0.5
"""Impulse of the dry friction, which is at its bound."""


def wedged(seed: int, *, held: bool) -> tuple[BlockProblem, float]:
    """A body of three freedoms on two points and a stop, and by how much the split of least norm
    leaves a cone.

    Impulses within the cones hold it, or, if not `held`, it slides off in any case: seven rows of
    rank three and the dry friction, whose joint they do not move.
    """
    rng = np.random.default_rng([5, seed])
    jacobian = np.zeros((8, 4))
    jacobian[:7, :3] = rng.normal(size=(7, 3))
    jacobian[7, 3] = 1.0
    impulse = np.zeros(8)
    for point in (0, 3):
        angle = rng.uniform(0.0, 2.0 * math.pi)
        impulse[point] = rng.uniform(0.2, 1.0)
        share = 0.3 * impulse[point] * rng.uniform(0.6, 1.0)  # of 0.5
        impulse[point + 1 : point + 3] = share * np.array([math.cos(angle), math.sin(angle)])
    impulse[6], impulse[7] = rng.uniform(0.2, 1.0), SLIDES
    velocity = np.zeros(8)
    velocity[7] = -0.3
    if not held:
        velocity[:7] = jacobian[:7, :3] @ rng.normal(size=3)
    delassus = jacobian @ jacobian.T
    free = velocity - delassus @ impulse
    least = -np.linalg.pinv(jacobian[:7, :3].T) @ np.linalg.pinv(jacobian[:7, :3]) @ free[:7]
    beyond = max(np.hypot(*least[p + 1 : p + 3]) - 0.5 * least[p] for p in (0, 3))
    problem = block_problem(
        4, 8, count=4, first=FIRST, set=np.array([CONE, CONE, HALF_LINE, INTERVAL]),
        friction=np.array([0.5, 0.5, 0.0, 0.0]), bound=np.array([0.0, 0.0, 0.0, SLIDES]),
        delassus=delassus, free=free,
    )  # fmt: skip
    return problem, float(max(beyond, -least[6]))


def begun(problem: BlockProblem) -> BlockWorkspace:
    """Memory of the solvers with a bad iterate, in which all presses and the joint slides."""
    work = block_workspace(4, 8)
    scale_blocks(problem, work.settings, work.scaled)
    work.iterate.least = math.inf
    work.iterate.x[:] = 0.1
    work.iterate.x[7] = work.scaled.bound[3]
    look(problem, work.scaled, work.iterate)
    return work


@pytest.mark.parametrize("seed", range(12))
def test_a_split_within_the_cones_is_found(seed: int) -> None:
    problem, _ = wedged(seed, held=True)
    work = begun(problem)
    assert stick_within_cones(
        problem, work.scaled, work.settings.tolerance, work.iterate, work.newton
    )
    answer = block_answer(4, 8)
    give_impulses(problem, work.scaled, work.iterate.best, answer)
    impulse = answer.impulse
    left = problem.delassus @ impulse + problem.free
    size = np.abs(problem.free).max()
    assert np.abs(left[:7]).max() <= 1e-8 * size
    for point in (0, 3):
        assert np.hypot(*impulse[point + 1 : point + 3]) <= 0.5 * impulse[point] + 1e-8 * size
    assert impulse[6] >= -1e-8 * size
    assert impulse[7] == pytest.approx(SLIDES)


def test_some_of_them_need_it() -> None:
    assert sum(wedged(seed, held=True)[1] > 1e-3 for seed in range(12)) >= 3


def test_what_cannot_stick_stays_as_it_was() -> None:
    problem, _ = wedged(3, held=False)
    problem.friction[:2] = 1e-3
    work = begun(problem)
    before = work.iterate.x.copy()
    found = stick_within_cones(
        problem, work.scaled, work.settings.tolerance, work.iterate, work.newton
    )
    assert not found
    assert np.array_equal(work.iterate.x, before)
