"""The impact of some candidates, or of all: which problem it is, and what it leaves to the step."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, STICK
from heelstrike.contact.problem import solve_contact, solve_contact_kernel, solver_order
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactAnswer, contact_problem
from heelstrike.sim.time_stepping.impact import (
    leave_others_out,
    pose_impact,
    solve_impact,
    solve_restitution,
)

STEP, FRICTION = 1e-3, 0.6


@pytest.mark.parametrize("members", [(0, 1, 2), (0, 2), (1,)])
def test_an_impact_is_that_of_its_members_without_gaps_and_with_bounces(
    members: tuple[int, ...],
) -> None:
    """Three points of a body; the free velocities of their positions hold the gaps over the step.

    Impulses are those of a problem written down anew, slips those of all points under these.
    """
    draw = np.random.default_rng(5)
    jacobian = draw.normal(size=(6, 9))
    delassus = jacobian @ jacobian.T
    gap, bounce = draw.uniform(0.0, 1e-4, 3), draw.uniform(0.0, 0.1, 3)
    speed = draw.normal(size=6) - np.tile([2.0, 0.0], 3)
    free = speed.copy()
    free[::2] += gap / STEP
    problem = contact_problem(
        3, count=3, delassus=delassus.copy(), free=free.copy(), friction=np.full(3, FRICTION)
    )
    before = draw.normal(size=6)
    answer = ContactAnswer.allocate(capacity=3, mode=np.full(3, STICK), impulse=before.copy())
    place = np.array(members)
    impact = SimpleNamespace(
        member=np.concatenate((place, np.zeros(3, np.int64)))[:3], bounce=bounce[place],
        relaxed=0, arriving_mode=np.zeros(3, np.int64), arriving_impulse=np.zeros(6),
        problem=contact_problem(3), answer=ContactAnswer.allocate(capacity=3),
    )  # fmt: skip
    posed = problem
    if len(members) < 3:
        uncompiled(leave_others_out)(len(members), problem, impact)
        posed = impact.problem
    uncompiled(pose_impact)(STEP, np.arange(3), gap, answer.mode, impact, posed)
    work = contact_workspace(3)

    def solve(order, its, solver, _, its_answer):  # type: ignore[no-untyped-def]
        return solve_contact_kernel(order, its, solver, its_answer)

    assert uncompiled(solve_impact, {solve_restitution: solve})(
        solver_order("lemke"), problem, posed, work, impact, SimpleNamespace(answer=answer)
    )
    rows = np.concatenate([[2 * each, 2 * each + 1] for each in members])
    wanted, asked = np.zeros(6), speed[rows]
    asked[::2] += bounce[place]
    wanted[rows] = solve_contact(delassus[np.ix_(rows, rows)], asked, FRICTION).impulse.ravel()
    assert wanted.any()
    np.testing.assert_allclose(answer.impulse, wanted, atol=1e-9)
    np.testing.assert_allclose(answer.velocity[1::2], (delassus @ wanted + speed)[1::2], atol=1e-9)
    assert all(answer.mode[each] == OPEN for each in range(3) if each not in members)
    np.testing.assert_array_equal(impact.arriving_impulse, before)
    assert np.all(impact.arriving_mode == STICK)
