"""What a step decides about the impacts that fall into it: by hand, rule by rule.

Kernels run as plain Python here, some with a script in the place of the contact solver.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import OPEN, RAY, SLIP_FORWARD, SOLVED, STICK
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.workspace import ContactAnswer, ContactProblem, contact_problem
from heelstrike.sim.contacts.rows import CONSTRAINT, POINT, SECOND_FACE, STOP
from heelstrike.sim.time_stepping import corners
from heelstrike.sim.time_stepping import impact as its
from heelstrike.tolerances import CLOSED_GAP

STEP = 0.01


# What is called to take part.


def test_what_is_called_is_counted_once_and_dismissed() -> None:
    calls = SimpleNamespace(count=0, called=np.zeros(4, int))
    for entry in (2, 0, 2):
        uncompiled(its.call)(entry, calls)
    assert calls.count == 2
    assert calls.called.tolist() == [1, 0, 1, 0]
    uncompiled(its.dismiss)(calls)
    assert (calls.count, calls.called.tolist()) == (0, [0, 0, 0, 0])


# Wedges.


def test_what_a_relaxed_step_leaves_alone() -> None:
    """The deepest gap of the candidates, if any is below zero, and whether any bounces."""
    gap, candidate = np.array([-9.0, -1e-3, 2e-3, -3e-3]), np.array([2, 1, 3])
    restitution = np.array([1.0, 0.0, 0.0, 0.2])
    left = uncompiled(its.left_alone)
    assert left(1, candidate, gap, restitution) == (0.0, False)
    assert left(2, candidate, gap, restitution) == (-1e-3, False)
    assert left(3, candidate, gap, restitution) == (-3e-3, True)
    assert left(2, np.array([3, 1]), gap, restitution) == (-3e-3, True)


@pytest.mark.parametrize(
    ("bounds", "deepest", "bounces", "relaxed", "wedged", "leaves"),
    [
        (True, 0.0, False, 0, -2, False),  # nothing to leave
        (True, 0.0, True, 0, -2, True),  # no bounce
        (False, -1e-5, True, 0, -2, True),
        (False, -1e-5, False, 0, -2, False),  # gaps are none of its business
        (True, -1e-5, False, 0, -2, True),
        (True, -1e-4, False, 0, -2, True),  # as deep as turning explains
        (True, -1.1e-4, False, 0, -2, False),
        (True, -1.1e-4, True, 0, -2, False),
        (True, -1.1e-4, False, 0, 6, True),  # as in the step before
        (True, -1.1e-4, False, 0, 7, False),
        (True, -1e-5, True, 1, 6, False),  # it was asked for less already
    ],
)
def test_a_step_without_an_answer_is_asked_for_less(
    bounds: bool, deepest: float, bounces: bool, relaxed: int, wedged: int, leaves: bool
) -> None:
    impact = SimpleNamespace(relaxed=relaxed, wedged=wedged)
    assert uncompiled(its.relax)(bounds, deepest, bounces, 7, impact) == leaves
    assert impact.relaxed == (1 if leaves else relaxed)


def test_a_wedge_is_asked_again_when_it_is_twice_as_old() -> None:
    stays, note = uncompiled(its.stays_wedged), uncompiled(its.note_wedge)
    impact = SimpleNamespace(wedged=-2, since=0)
    asked_again = []
    for steps in range(5, 25):
        if not stays(steps, impact):
            asked_again.append(steps - 5)
        assert note(steps, impact) == (steps == 5)
        assert (impact.since, impact.wedged) == (5, steps)
    assert asked_again == [0, 1, 2, 4, 8, 16]
    assert not stays(26, impact)  # a step was free
    assert note(26, impact)
    assert impact.since == 26


def test_modes_change_with_those_of_any_kind_that_opens_or_slides() -> None:
    assembly = SimpleNamespace(
        begin=np.zeros(9, int), until=np.zeros(9, int), candidate=np.array([4, 0, 3, 2, 1]),
        answer=SimpleNamespace(mode=np.array([1, 2, 0, 1, 3])),
    )  # fmt: skip
    before = np.array([2, 3, 1, 0, 1])
    for place, kind in enumerate((POINT, STOP, CONSTRAINT, SECOND_FACE)):
        assembly.begin[kind], assembly.until[kind] = place, place + 1
    assert not uncompiled(its.modes_change)(assembly, before)
    for entry in (4, 0, 3, 2):
        other = before.copy()
        other[entry] += 1
        assert uncompiled(its.modes_change)(assembly, other)
    other = before.copy()
    other[1] += 1  # a dry joint or a loop
    assert not uncompiled(its.modes_change)(assembly, other)
    assembly.begin[STOP], assembly.until[STOP] = 0, 3
    other = before.copy()
    other[3] += 1
    assert uncompiled(its.changes)(STOP, assembly, other)  # the last of several


def test_negative_gaps_are_counted_as_zero() -> None:
    problem = contact_problem(3, count=3, first=np.array([0, 2, 3, 5]), free=np.arange(6.0))
    assembly = SimpleNamespace(problem=problem, candidate=np.array([2, 0, 1]))
    uncompiled(its.close_gaps)(STEP, 3, np.array([-0.02, 0.01, -0.03]), assembly)
    np.testing.assert_allclose(problem.free, [3.0, 1.0, 4.0, 3.0, 4.0, 5.0])


def test_the_deepest_and_the_hardest_point() -> None:
    deepest, hardest = uncompiled(its.deepest_point), uncompiled(its.hardest_point)
    assert deepest(np.array([0.0, -2.0, -3.0, -3.0, 1.0])) == 2
    assert deepest(np.array([-1.0, 2.0])) == 0
    assert hardest(np.array([[1.0, 9.0], [3.0, 0.0], [3.0, 5.0], [2.0, 7.0]])) == 1
    assert hardest(np.array([[4.0, 0.0], [3.0, 5.0]])) == 0


# When there is an impact, and of whom.


def test_what_arrives_and_what_would_close() -> None:
    problem = contact_problem(2, count=2, first=np.array([0, 1, 3]))
    arrives, would = uncompiled(its.arrives), uncompiled(its.would_close)
    for times, is_there, closes in ((0.5, True, True), (1.0, True, False), (1.5, False, False)):
        problem.free[:] = 9.0
        problem.free[1] = times * CLOSED_GAP / STEP * (1.0 - 1e-12 * (times == 1.0))
        answer = SimpleNamespace(velocity=np.array([9.0, problem.free[1], 9.0]))
        assert arrives(STEP, 1, problem.first, answer) == is_there
        if times != 1.0:
            assert would(STEP, 1, problem) == closes
    problem.free[1] = CLOSED_GAP
    assert arrives(1.0, 1, problem.first, SimpleNamespace(velocity=problem.free))
    assert not would(1.0, 1, problem)


def test_who_touches_at_the_end_of_a_step_is_kept() -> None:
    problem = contact_problem(3, first=np.array([0, 2, 3, 5]))
    velocity = np.array([0.0, 9.0, 1.0, -1.0, 9.0])
    assembly = SimpleNamespace(
        problem=problem, answer=SimpleNamespace(velocity=velocity), candidate=np.array([4, 0, 2])
    )
    touching = np.full(5, -2)
    uncompiled(its.note_touching)(STEP, 3, 7, assembly, touching)
    assert touching.tolist() == [-2, -2, 7, -2, 7]
    uncompiled(its.note_touching)(STEP, 1, 8, assembly, touching)
    assert touching.tolist() == [-2, -2, 7, -2, 8]


ABOVE = 1e-3
"""A gap that a step of 10 ms closes at 0.1 m/s."""


@pytest.mark.parametrize(
    ("gap", "touched", "free", "after", "falls"),
    [
        (ABOVE, 4, -1.0, 0.0, True),  # new
        (ABOVE, 5, -1.0, 0.0, False),  # it touched at the end of the last step
        (ABOVE, 4, -1.0, 1.0, False),  # it does not arrive
        (ABOVE, 4, 1.0, 0.0, False),  # it would not close if it were free: it is pulled
        (0.5 * CLOSED_GAP, 4, -1.0, 0.0, False),  # it is there already
        (CLOSED_GAP, 4, -1.0, 0.0, False),
        (-ABOVE, 5, 1.0, 0.0, True),  # it is in the ground
        (-0.5 * CLOSED_GAP, 5, 1.0, 0.0, False),
        (-CLOSED_GAP, 5, 1.0, 0.0, False),
        (np.inf, 4, -1.0, 0.0, False),  # it has no gap
    ],
)
def test_an_impact_falls_into_the_step_in_which_something_new_closes(
    gap: float, touched: int, free: float, after: float, falls: bool
) -> None:
    """Alone, and behind another that has touched and stays."""
    for others in (0, 1):
        problem = contact_problem(2, count=1 + others)
        problem.free[:] = [0.0, 9.0] * others + [free, 9.0] + [9.0, 9.0] * (1 - others)
        assembly = SimpleNamespace(
            candidate=np.array([1] * others + [2, 0]),
            answer=SimpleNamespace(velocity=np.array([0.0, 0.0] * others + [after, 0.0])),
        )
        gaps, touching = np.array([np.nan, 0.0, gap]), np.array([0, 5, touched])
        found = uncompiled(its.falls_into)(STEP, 5, gaps, touching, problem, assembly)
        assert found == falls


def test_who_takes_part_in_an_impact() -> None:
    """Who has no gap; who is there; who touched or would close, if it arrives."""
    gaps = [np.inf, 0.0, CLOSED_GAP, -ABOVE, ABOVE, ABOVE, ABOVE, ABOVE, ABOVE]
    touched = [4, 4, 4, 4, 5, 4, 4, 5, 4]
    free = [9.0, 1.0, 1.0, 1.0, 1.0, -1.0, 1.0, -1.0, -1.0]
    after = [9.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0]
    takes_part = [0, 1, 2, 3, 4, 5]
    count = len(gaps)
    problem = contact_problem(count, count=count, first=np.arange(count + 1))
    problem.free[:count] = free
    assembly = SimpleNamespace(
        candidate=np.arange(count)[::-1],
        answer=SimpleNamespace(velocity=np.array(after)),
    )
    member = np.full(count, 77)
    found = uncompiled(its.find_members)(
        STEP, 5, np.array(gaps)[::-1], np.array(touched)[::-1], problem, assembly, member
    )
    assert found == 6
    assert member[:6].tolist() == takes_part


def test_the_speed_with_which_something_comes() -> None:
    rows = SimpleNamespace(
        kind=np.array([POINT, SECOND_FACE, CONSTRAINT]), owner=np.array([3, 4, 5]), outside="its"
    )
    asked: list[Any] = []

    def of_point(model: Any, tree: Any, contacts: Any, point: int) -> tuple[float, float]:
        asked.append((contacts, point))
        return -1.0, 9.0

    def of_constraint(own: int, component: int, v: Any, outside: Any) -> float:
        asked.append((outside, own, component))
        return -2.0

    speed = uncompiled(
        its.speed_before, replace={its.contact_velocity: of_point, its.rate_of: of_constraint}
    )
    found = [speed(None, entry, None, rows, None, "first", "second") for entry in range(3)]
    assert found == [-1.0, -1.0, -2.0]
    assert asked == [("first", 3), ("second", 4), ("its", 5, 0)]


def mixed() -> ContactProblem:
    """A cone, a half-line, an interval and a line."""
    draw = np.random.default_rng(6)
    rows = draw.normal(size=(6, 8))
    problem = contact_problem(
        4, count=4, first=np.array([0, 2, 3, 5, 6]),
        set=np.array([CONE, HALF_LINE, INTERVAL, LINE]),
        friction=np.array([0.5, 0.0, 1.0, 0.0]), bound=np.array([0.0, 0.0, 0.7, 0.0]),
    )  # fmt: skip
    problem.delassus[:], problem.free[:] = np.nan, np.nan
    problem.delassus[:6, :6], problem.free[:6] = rows @ rows.T, draw.normal(size=6)
    return problem


def test_the_problem_of_some_members_has_their_rows_in_their_order() -> None:
    problem = mixed()
    impact = SimpleNamespace(member=np.array([1, 2, 3, 77]), problem=contact_problem(4))
    uncompiled(its.leave_others_out)(3, problem, impact)
    part, rows = impact.problem, [2, 3, 4, 5]
    assert part.count == 3
    assert part.first[:4].tolist() == [0, 1, 3, 4]
    np.testing.assert_array_equal(part.delassus[:4, :4], problem.delassus[np.ix_(rows, rows)])
    np.testing.assert_array_equal(part.free[:4], problem.free[rows])
    assert part.set[:3].tolist() == [HALF_LINE, INTERVAL, LINE]
    assert part.friction[:3].tolist() == [0.0, 1.0, 0.0]
    assert part.bound[:3].tolist() == [0.0, 0.7, 0.0]


@pytest.mark.parametrize("relaxed", [0, 1])
def test_an_impact_asks_for_bounces_instead_of_gaps(relaxed: int) -> None:
    """Of a relaxed step gaps below zero were left out of the free terms before."""
    problem = mixed()
    free = problem.free.copy()
    impact = SimpleNamespace(
        member=np.arange(4), bounce=np.array([0.1, 0.2, 0.0, 0.4]), relaxed=relaxed,
        answer=SimpleNamespace(mode=np.zeros(4, int)),
    )  # fmt: skip
    candidate, gap = np.array([3, 2, 1, 0]), np.array([np.inf, np.inf, -0.02, 0.03])
    uncompiled(its.pose_impact)(STEP, candidate, gap, np.array([4, 3, 2, 1]), impact, problem)
    deep = 0.0 if relaxed else -0.02
    expected = free[:6] + np.array([0.1 - 0.03 / STEP, 0.0, 0.2 - deep / STEP, 0.0, 0.0, 0.4])
    np.testing.assert_allclose(problem.free[:6], expected)
    assert impact.answer.mode.tolist() == [4, 3, 2, 1]


def test_energy_that_an_impact_makes() -> None:
    """½ p (w⁻ + w⁺) of every row but the normal one of what rubs; of a line what moves it is not.

    What is no more than rounding explains, 1e-9 of what went through, is none.
    """
    problem, share = mixed(), 0.3
    bounce = np.array([0.1, 0.2, 0.0, 0.4])
    impulse = np.array([3.0, -1.0, 2.0, 0.9, 0.5, -0.2])
    G, first = problem.delassus[:6, :6], problem.first
    before = problem.free[:6].copy()
    before[first[:4]] -= share * bounce
    pushed = impulse.copy()
    after = before + G @ pushed
    made = 0.0
    for row in (0, 1, 2, 4):
        made += 0.5 * impulse[row] * (before[row] + after[row])
    made += 0.5 * impulse[5] * (before[5] - after[5])
    answer = SimpleNamespace(impulse=impulse)
    assert made > 0.0
    found = uncompiled(its.energy_made)(problem, bounce, share, answer)
    assert found == pytest.approx(made, rel=1e-12)
    one = contact_problem(1, count=1, set=np.array([CONE]))
    for off, told in ((1e-6, True), (1e-13, False), (-1e-3, False)):
        one.delassus[:], one.free[:] = np.eye(2), [-1.0, 0.0]
        answer = SimpleNamespace(impulse=np.array([2.0 + off, 0.0]))
        found = uncompiled(its.energy_made)(one, np.zeros(1), 1.0, answer)
        assert (found > 0.0) == told
        if told:
            assert found == pytest.approx(0.5 * (2.0 + off) * off, rel=1e-6)


def bounced(
    bounded: int, gains: Any, bounce: tuple[float, float] = (1.0, -0.5),
    ends: Any = lambda share: SOLVED,
) -> tuple[int, Any, list[float], list[list[int]], float]:  # fmt: skip
    """What `solve_restitution` does if shares of restitution make such energy.

    Returns how it ended, the impact, the shares tried, the modes tried, and the free velocity left.
    """
    problem = contact_problem(2, count=2, free=np.array([0.3, 9.0, 0.7, 9.0]))
    problem.free[[0, 2]] += bounce
    impact = SimpleNamespace(
        bounce=np.array(bounce), kept=np.zeros(2, int), gain=9.0, gains=9, bounded=bounded
    )
    shares, modes = [], []

    def share_now() -> float:
        place, base = (1, 0.7) if bounce[1] else (0, 0.3)
        return float((problem.free[2 * place] - base) / bounce[place]) if any(bounce) else 0.0

    def solve(order: Any, posed: Any, solver: Any, answer: Any) -> int:
        if bounce[1]:
            assert posed.free[0] == pytest.approx(0.3 + share_now() * bounce[0])
        shares.append(share_now())
        modes.append(answer.mode.tolist())
        answer.mode[:] = [len(shares), 1]
        return int(ends(share_now()))

    def made(posed: Any, asked: Any, share: float, answer: Any) -> float:
        assert share == pytest.approx(share_now())
        return float(gains(share))

    solve_it = uncompiled(
        its.solve_restitution,
        replace={its.solve_contact_kernel: solve, its.energy_made: made},
    )
    answer = ContactAnswer.allocate(capacity=2, mode=np.array([STICK, SLIP_FORWARD]))
    status = solve_it(None, problem, None, impact, answer)
    return status, impact, shares, modes, share_now()


def test_restitution_that_makes_energy_is_told_and_scaled_back_if_asked() -> None:
    """Halved in ten times between what makes none and what makes some; the last of all makes none.

    Each try begins with the modes of the last that made none.
    """
    status, impact, shares, _, _ = bounced(0, lambda share: 0.0)
    assert (status, impact.gain, impact.gains, shares) == (SOLVED, 0.0, 0, [1.0])
    status, impact, shares, _, _ = bounced(0, lambda share: 0.4)
    assert (status, impact.gain, impact.gains, shares) == (SOLVED, 0.4, 1, [1.0])
    status, impact, shares, _, _ = bounced(1, lambda share: 0.0)
    assert (impact.gains, shares) == (0, [1.0])
    status, impact, shares, modes, left = bounced(1, lambda share: max(share - 0.3, 0.0))
    assert (status, impact.gains, impact.gain) == (SOLVED, 1, 0.0)
    assert len(shares) == 12
    assert shares[:5] == pytest.approx([1.0, 0.5, 0.25, 0.375, 0.3125])
    assert left == pytest.approx(0.3, abs=2.0**-10)
    assert left <= 0.3
    assert modes[:5] == [[STICK, SLIP_FORWARD]] * 3 + [[3, 1]] * 2
    assert shares[-1] == pytest.approx(max(s for s in shares if s <= 0.3))
    # What has no answer with a share has none that is kept.
    status, impact, shares, _, left = bounced(
        1, lambda share: float(share > 0.9), ends=lambda share: RAY if share > 0.3 else SOLVED
    )
    assert shares == pytest.approx([1.0], abs=1e-12)
    assert (status, impact.gains, impact.gain) == (RAY, 0, 0.0)
    status, impact, shares, _, left = bounced(
        1, lambda share: float(share > 0.9),
        ends=lambda share: SOLVED if share > 0.9 or share < 0.3 else RAY,
    )  # fmt: skip
    assert (status, impact.gains, impact.gain) == (SOLVED, 1, 0.0)
    assert left == pytest.approx(0.3, abs=2.0**-10)


def test_without_restitution_nothing_is_measured() -> None:
    status, impact, shares, _, _ = bounced(1, lambda _: pytest.fail("measured"), (0.0, 0.0))
    assert (status, len(shares), impact.gain, impact.gains) == (SOLVED, 1, 9.0, 9)
    assert len(bounced(1, lambda share: 0.0, (-1.0, 0.0))[2]) == 1


def test_a_way_out_of_a_wedge_is_without_friction() -> None:
    """What is to be added to velocities; negative gaps are in it, lines stay, dry joints do not."""
    problem = mixed()
    problem.set[:] = CONE, HALF_LINE, INTERVAL, LINE
    velocity = np.array([0.1, 9.0, 0.2, 9.0, 9.0, 9.0])
    impact = SimpleNamespace(
        problem=contact_problem(4, free=np.full(8, 5.0)),
        answer=SimpleNamespace(mode=np.full(4, 9)),
    )
    impact.problem.friction[:] = impact.problem.bound[:] = 5.0
    candidate, gap = np.array([3, 2, 1, 0]), np.array([np.inf, np.inf, 0.03, -0.02])
    uncompiled(its.pose_way_out)(STEP, candidate, gap, velocity, problem, impact)
    way = impact.problem
    assert way.count == 4
    assert way.first[:5].tolist() == [0, 2, 3, 5, 6]
    np.testing.assert_array_equal(way.delassus[:6, :6], problem.delassus[:6, :6])
    np.testing.assert_allclose(way.free[:6], [0.1 - 0.02 / STEP, 0.0, 0.2, 0.0, 0.0, 0.0])
    assert way.set[:4].tolist() == [HALF_LINE, HALF_LINE, HALF_LINE, LINE]
    assert not way.friction[:4].any()
    assert not way.bound[:4].any()
    assert impact.answer.mode.tolist() == [STICK, OPEN, OPEN, STICK]


def test_the_answer_of_an_impact_takes_the_place_of_that_of_the_positions() -> None:
    """Of members alone; the others have no part in it, but slip. The worse residuals are kept."""
    problem = mixed()
    posed = contact_problem(4, count=2, first=np.array([0, 2, 3, 77, 77]))
    impact = SimpleNamespace(
        member=np.array([2, 3, 0, 0]), arriving_mode=np.zeros(4, int),
        arriving_impulse=np.full(8, 9.0),
        answer=ContactAnswer.allocate(capacity=4, residual=np.array([3.0, 1.0, 2.0])),
    )  # fmt: skip
    answer = ContactAnswer.allocate(
        capacity=4, mode=np.array([1, 2, 3, 1]), impulse=np.arange(8.0), velocity=np.full(8, 7.0),
        residual=np.array([1.0, 2.0, 2.5]),
    )  # fmt: skip
    ends = [SOLVED, RAY]

    def solve(order: Any, its_problem: Any, solver: Any, _: Any, own: Any) -> int:
        assert its_problem is posed
        own.mode[:2], own.impulse[:3], own.velocity[:3] = [2, 1], [1.0, -0.5, 2.0], [0.1, 0.2, 0.3]
        return ends.pop(0)

    run = uncompiled(its.solve_impact, replace={its.solve_restitution: solve})
    assembly = SimpleNamespace(answer=answer)
    assert run(None, problem, posed, None, impact, assembly)
    assert impact.arriving_mode.tolist() == [1, 2, 3, 1]
    assert impact.arriving_impulse[:6].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert answer.mode.tolist() == [OPEN, OPEN, 2, 1]
    assert answer.impulse[:6].tolist() == [0.0, 0.0, 0.0, 1.0, -0.5, 2.0]
    slips = problem.free[:6] + problem.delassus[:6, :6] @ answer.impulse[:6]
    np.testing.assert_allclose(answer.velocity[:6], [7.0, slips[1], 7.0, 7.0, 0.2, 7.0])
    assert answer.residual.tolist() == [3.0, 2.0, 2.5]
    assert not run(None, problem, posed, None, impact, assembly)


# Corners of two faces.


def test_forces_of_both_faces_are_one_force_where_it_acts() -> None:
    """About the disc's centre the moments of both are that of their resultant, at the rim."""
    draw, radius, seen = np.random.default_rng(9), 0.2, 0

    def crossed(arm: np.ndarray, push: np.ndarray) -> float:
        return float(arm[0] * push[1] - arm[1] * push[0])

    for _ in range(20):
        normal = draw.normal(size=(2, 2, 2))
        normal /= np.linalg.norm(normal, axis=2)[..., None]
        force = draw.uniform(0.1, 1.0, (2, 2, 2)) * [1.0, 0.3]
        force[1, 1] = 0.0  # the second point has one face
        position = draw.normal(size=(2, 2))
        model = SimpleNamespace(nc=2, contact_radius=np.array([radius, 0.1]))
        contacts = SimpleNamespace(
            normal=normal[0], force=force[0].copy(), position=position.copy()
        )
        second = SimpleNamespace(normal=normal[1], force=force[1])
        center = position[0] + radius * normal[0, 0]

        def world(face: int, pair: np.ndarray, normals: np.ndarray = normal) -> np.ndarray:
            n = normals[face, 0]
            return pair[0] * n + pair[1] * np.array([n[1], -n[0]])

        both = world(0, force[0, 0]) + world(1, force[1, 0])
        uncompiled(corners.join_forces)(model, second, contacts)
        np.testing.assert_allclose(world(0, contacts.force[0]), both, rtol=1e-12)
        arm = contacts.position[0] - center
        turned = sum(
            crossed(-radius * normal[face, 0], world(face, force[face, 0])) for face in range(2)
        )
        if abs(turned) > 0.99 * radius * np.linalg.norm(both):
            continue  # it acts off the disc
        assert crossed(arm, both) == pytest.approx(turned, rel=1e-9)
        assert np.linalg.norm(arm) == pytest.approx(radius)
        assert arm @ both < 0.0  # it presses from where it is towards the centre
        seen += 1
        np.testing.assert_array_equal(contacts.position[1], position[1])
        np.testing.assert_array_equal(contacts.force[1], force[0, 1])
    assert seen >= 10


def test_forces_that_cancel_stay_where_they_are() -> None:
    contacts = SimpleNamespace(
        normal=np.array([[1.0, 0.0]]), force=np.array([[1.0, 0.0]]), position=np.array([[0.3, 0.4]])
    )
    second = SimpleNamespace(normal=np.array([[-1.0, 0.0]]), force=np.array([[1.0, 0.0]]))
    model = SimpleNamespace(nc=1, contact_radius=np.array([0.2]))
    uncompiled(corners.join_forces)(model, second, contacts)
    np.testing.assert_allclose(contacts.force, 0.0)
    assert contacts.position.tolist() == [[0.3, 0.4]]


def test_second_faces_are_located_and_counted() -> None:
    """The point of a disc on its second face; coefficients of face and point; no force yet."""
    model = SimpleNamespace(
        nc=3, contact_radius=np.array([0.1, 0.2, 0.0]), contact_link=[4, 5, 6],
        contact_position=["a", "b", "c"], friction_scale=[1.0, 2.0, 1.0],
        restitution_scale=[1.0, 3.0, 1.0],
    )  # fmt: skip
    contacts = SimpleNamespace(
        gap=np.zeros(3), position=np.zeros((3, 2)), normal=np.zeros((3, 2)), force=np.ones((3, 2))
    )
    surface = SimpleNamespace(friction=np.zeros(9), restitution=np.zeros(9))
    corner = SimpleNamespace(near=7)

    def point_position(_: Any, link: int, place: str, at: Any) -> None:
        at[:] = link, ord(place)

    def second_contact(_: Any, x: float, z: float, radius: float, normal: Any) -> Any:
        normal[:] = 0.6, 0.8
        return (np.inf if x == 5 else x - radius), 0.1 * x, 0.01 * z

    uncompiled(
        corners.locate_corners,
        replace={corners.point_position: point_position, corners.second_contact: second_contact},
    )(model, None, None, 4, contacts, surface, corner)
    assert contacts.gap.tolist() == [3.9, np.inf, 6.0]
    assert corner.near == 2
    np.testing.assert_allclose(surface.friction, [0, 0, 0, 0, 0.4, 1.0, 0.6, 0, 0])
    np.testing.assert_allclose(surface.restitution, [0, 0, 0, 0, 0.97, 2.94, 0.99, 0, 0])
    np.testing.assert_allclose(contacts.position[0], [4 - 0.06, 97 - 0.08])
    assert not contacts.force.any()
