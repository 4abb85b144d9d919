"""What follows from contact modes, step by step, by hand: equations, impulses, names, corrections.

Kernels run as plain Python here.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.modes import (
    OPEN,
    SLIDING_FORWARD,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SOLVED,
    STICK,
    UNCERTIFIED,
)
from heelstrike.contact.sets import CONE, HALF_LINE, INTERVAL, LINE
from heelstrike.contact.solvers import active_set
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.solvers.reduction import reduce_problem
from heelstrike.contact.workspace import (
    ContactAnswer,
    ContactProblem,
    ContactWorkspace,
    Equations,
    contact_problem,
)

Floats = NDArray[np.float64]

assemble, expand, refine = (
    uncompiled(each) for each in (active_set.assemble, active_set.expand, active_set.refine)
)
label, correct_modes = uncompiled(active_set.label), uncompiled(active_set.correct_modes)
mode_of_slip, slip_of = uncompiled(active_set.mode_of_slip), uncompiled(active_set.slip_of)

FRICTION = [0.5, 0.0, 0.8, 0.3]
"""Of a cone with friction, a half-line, two cones."""
ROWS = [0, 2, 3, 5]


def posed(
    mode: list[int], sets: list[int] | None = None, friction: list[float] | None = None
) -> tuple[ContactProblem, ContactWorkspace]:
    """Four contacts whose data are random, reduced with some of them prescribed to slide."""
    draw = np.random.default_rng(11)
    rows = draw.normal(size=(7, 9)) * 10.0 ** draw.uniform(-1.0, 1.0, (7, 1))
    problem = contact_problem(
        4, count=4, first=np.array([*ROWS, 7]), friction=np.array(friction or FRICTION),
        set=np.array(sets or [CONE, HALF_LINE, CONE, CONE]), bound=np.full(4, 1.5),
    )  # fmt: skip
    problem.delassus[:], problem.free[:] = np.nan, np.nan
    problem.delassus[:7, :7], problem.free[:7] = rows @ rows.T, draw.normal(size=7)
    work = contact_workspace(4, ready=False, symmetric=False)
    uncompiled(reduce_problem)(problem, np.array(mode), work.scaling.slope, work.reduced)
    return problem, work


MODES = [
    [STICK, STICK, SLIP_FORWARD, SLIP_BACKWARD], [OPEN, STICK, STICK, STICK],
    [SLIP_BACKWARD, OPEN, STICK, OPEN], [SLIDING_FORWARD, STICK, SLIDING_FORWARD + 1, STICK],
]  # fmt: skip


def directions(mode: list[int]) -> Floats:
    """Columns along which impulses of these modes lie: normals, tangents, and edges of cones."""
    columns = []
    for k, (name, mu) in enumerate(zip(mode, FRICTION, strict=True)):
        normal = np.eye(7)[ROWS[k]]
        if name == OPEN:
            continue
        if mu == 0.0:
            columns.append(normal)
            continue
        tangent = np.eye(7)[ROWS[k] + 1]
        if name == STICK:
            columns += [normal, tangent]
        else:
            forward = name in (SLIP_FORWARD, SLIDING_FORWARD)
            columns.append(normal + (-mu if forward else mu) * tangent)
    return np.array(columns).T


@pytest.mark.parametrize("mode", MODES)
def test_equations_are_those_of_the_velocities_that_vanish(mode: list[int]) -> None:
    """Scaled rows and columns of a unit diagonal each; impulses in their own length."""
    problem, work = posed(mode)
    uncompiled(assemble)(problem, np.array(mode), work.scaling.slope, work.reduced, work.equations)
    along, equations = directions(mode), work.equations
    size = along.shape[1]
    assert equations.size == size
    rows = [int(np.flatnonzero(column)[0]) for column in along.T]
    scale = 1.0 / np.sqrt(np.diag(problem.delassus)[rows])
    matrix = problem.delassus[:7, :7]
    np.testing.assert_allclose(equations.tableau[:size, 0], scale * problem.free[rows], rtol=1e-13)
    expected = scale[:, None] * (matrix @ along)[rows] * scale
    np.testing.assert_allclose(equations.tableau[:size, 1 : size + 1], expected, rtol=1e-12)
    length = np.linalg.norm(along, axis=0)
    np.testing.assert_allclose(equations.weight[:size], scale * length, rtol=1e-13)
    ratio = [column[row + 1] if length[k] > 1.0 else 0.0 for k, (column, row) in
             enumerate(zip(along.T, rows, strict=True))]  # fmt: skip
    np.testing.assert_allclose(equations.friction_ratio[:size], ratio, rtol=1e-14)


@pytest.mark.parametrize("mode", MODES)
def test_a_point_is_written_out_as_the_impulses_of_its_modes(mode: list[int]) -> None:
    """Each number of the point measures the whole impulse along its direction."""
    problem, work = posed(mode)
    along = directions(mode)
    presses = np.any(along[ROWS] != 0.0, axis=0)
    share = np.arange(1, along.shape[1] + 1)
    point = np.where(presses, 1.0 + 0.1 * share, 0.02 * share)
    answer = ContactAnswer.allocate(capacity=4, mode=np.array(mode), impulse=np.full(8, 9.0))
    expand(problem, point, work.scaling.slope, work.reduced.tangent, answer)
    expected = along / np.linalg.norm(along, axis=0) @ point
    np.testing.assert_allclose(answer.impulse[:7], expected, rtol=1e-14)


def test_a_point_outside_its_sets_is_moved_into_them() -> None:
    """Pull becomes nothing, friction the edge; a line may pull, an interval has its bound."""
    problem, work = posed([STICK] * 4)
    answer = ContactAnswer.allocate(capacity=4, mode=np.full(4, STICK))
    point = np.array([-1.0, 0.4, -2.0, 2.0, -1.9, 1.0, 0.2])
    expand(problem, point, work.scaling.slope, work.reduced.tangent, answer)
    assert answer.impulse[:7].tolist() == [0.0, 0.0, 0.0, 2.0, -1.6, 1.0, 0.2]
    problem.set[1], problem.set[3] = LINE, INTERVAL
    expand(problem, point, work.scaling.slope, work.reduced.tangent, answer)
    assert answer.impulse[:7].tolist() == [0.0, 0.0, -2.0, 2.0, -1.6, 1.5, 0.2]


def test_refinement_takes_out_what_is_left_of_the_velocities() -> None:
    """With the inverse of the equations in the tableau, one step is Newton's: nothing is left."""
    mode = [STICK, STICK, SLIP_FORWARD, OPEN]
    problem, work = posed(mode)
    equations, along = work.equations, directions(mode)
    assemble(problem, np.array(mode), work.scaling.slope, work.reduced, equations)
    size = equations.size
    matrix = equations.tableau[:size, 1 : size + 1].copy()
    order = np.array([2, 0, 3, 1])  # rows that pivots were taken from
    inverse = np.linalg.inv(matrix)
    equations.pivot_row[:size] = order
    for j in range(size):
        equations.tableau[order[j], 1 : size + 1] = inverse[j][order]
    equations.point[:size] = [1.0, 2.0, 3.0, 4.0]
    unit = along / np.linalg.norm(along, axis=0)
    velocity = problem.free[:7] + problem.delassus[:7, :7] @ unit @ equations.point[:size]
    # speed[pivot_row[k]] goes with column k + 1: a permutation of rows alone when it is square.
    refine(work.reduced, velocity, equations)
    after = problem.free[:7] + problem.delassus[:7, :7] @ unit @ equations.point[:size]
    rows = [int(np.flatnonzero(column)[0]) for column in along.T]
    np.testing.assert_allclose(after[rows], 0.0, atol=1e-11 * np.abs(velocity).max())


def test_refinement_leaves_what_no_pivot_was_taken_for() -> None:
    problem, work = posed([STICK, STICK, OPEN, OPEN])
    equations = work.equations
    assemble(
        problem, np.array([STICK, STICK, OPEN, OPEN]), work.scaling.slope, work.reduced, equations
    )
    equations.pivot_row[:3], equations.point[:3] = [0, -1, 2], [1.0, 2.0, 3.0]
    equations.tableau[:] = np.nan
    equations.tableau[np.ix_([0, 2], [1, 3])] = [[0.5, 0.1], [0.2, 0.7]]
    velocity = np.array([0.3, np.nan, -0.4, 0.0, 0.0, 0.0, 0.0])
    refine(work.reduced, velocity, equations)
    scale = work.reduced.scale[:3]
    speed = scale * [0.3, 0.0, -0.4]
    moved = [
        1.0 - equations.weight[0] * (0.5 * speed[0] + 0.1 * speed[2]), 2.0,
        3.0 - equations.weight[2] * (0.2 * speed[0] + 0.7 * speed[2]),
    ]  # fmt: skip
    np.testing.assert_allclose(equations.point[:3], moved, rtol=1e-14)


def test_slip_is_named_by_its_velocity() -> None:
    """Beyond what counts as rest; at it, it sticks."""
    assert [mode_of_slip(each, 0.1) for each in (0.11, 0.1, 0.0, -0.1, -0.11)] == [
        SLIP_FORWARD, STICK, STICK, STICK, SLIP_BACKWARD
    ]  # fmt: skip
    problem, _ = posed([STICK] * 4)
    answer = ContactAnswer.allocate(capacity=4, rest=0.1)
    answer.velocity[:7] = [9.0, 0.3, 9.0, 9.0, -0.3, 9.0, 0.3]
    root = np.array([9.0, 2.0, 9.0, 9.0, 2.0, 9.0, 4.0])
    found = [slip_of(problem, contact, root, answer) for contact in range(4)]
    assert found == [SLIP_FORWARD, STICK, SLIP_BACKWARD, STICK]


@pytest.mark.parametrize(
    ("mode", "changed"),
    [
        ([OPEN, STICK, SLIP_BACKWARD, STICK], False),
        ([STICK, STICK, SLIP_BACKWARD, STICK], True),  # it lifts off
        ([OPEN, OPEN, SLIP_BACKWARD, STICK], True),  # it rests
        ([OPEN, STICK, SLIP_FORWARD, STICK], True),  # it slips the other way
        ([OPEN, STICK, SLIP_BACKWARD, SLIP_FORWARD], True),  # it sticks
        # Without friction a closed contact has one mode, whatever it is called.
        ([OPEN, SLIP_FORWARD, SLIP_BACKWARD, STICK], False),
    ],
)
def test_modes_are_named_by_velocities_and_told_if_others(mode: list[int], changed: bool) -> None:
    """What is faster than rest, 0.1 of each row's weight, moves."""
    problem, work = posed([STICK] * 4)
    answer = ContactAnswer.allocate(capacity=4, mode=np.array(mode), rest=0.1)
    work.scaling.root[:7] = [2.0, 2.0, 2.0, 2.0, 2.0, 3.0, 2.0]
    answer.velocity[:7] = [0.3, 0.3, 0.1, 0.1, -0.3, 0.3, 0.1]
    assert label(problem, work.reduced.tangent, work.scaling, answer) == changed
    assert answer.mode.tolist() == [OPEN, STICK, SLIP_BACKWARD, STICK]


def test_a_line_never_opens() -> None:
    problem, work = posed([STICK] * 4, [CONE, LINE, CONE, CONE])
    answer = ContactAnswer.allocate(capacity=4, mode=np.full(4, STICK), rest=0.1)
    work.scaling.root[:7], answer.velocity[:7] = 1.0, [0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 0.0]
    assert not label(problem, work.reduced.tangent, work.scaling, answer)
    assert answer.mode.tolist() == [STICK] * 4


def corrected(
    mode: list[int], velocity: list[float], point: list[float], sets: list[int] | None = None,
    friction: list[float] | None = None, root: list[float] | None = None,
) -> tuple[int, list[int]]:  # fmt: skip
    """Modes after one correction, where velocities of 0.1 of a row's weight, 2, are rest."""
    problem, work = posed([STICK] * 4, sets, friction)
    equations: Equations = work.equations
    equations.size = len(point)
    equations.point[: len(point)] = point
    trial = ContactAnswer.allocate(capacity=4, mode=np.array(mode), rest=0.1)
    trial.velocity[:7] = velocity
    weight = np.array(root or [2.0] * 7)
    found = correct_modes(problem, work.reduced.tangent, weight, equations, trial)
    return found, trial.mode.tolist()


STILL = [0.0] * 7


def test_what_its_answer_does_not_contradict_stays() -> None:
    slips = [STICK, STICK, SLIP_FORWARD, SLIP_BACKWARD]
    velocity = [0.0, 0.0, 0.0, 0.0, 0.5, 0.0, -0.5]
    assert corrected(slips, velocity, [1.0, 0.4, 1.0, 1.0, 1.0]) == (UNCERTIFIED, slips)
    # At the edges: rest of exactly 0.2, friction of exactly μ λ_n.
    velocity = [0.0, 0.0, 0.0, 0.0, -0.2, 0.0, 0.2]
    assert corrected(slips, velocity, [1.0, -0.5, 1.0, 1.0, 1.0]) == (UNCERTIFIED, slips)
    assert corrected([OPEN] * 4, [-0.2, 0, -0.2, -0.2, 0, -0.2, 0], []) == (UNCERTIFIED, [OPEN] * 4)


def test_what_penetrates_closes_and_slips_as_it_did() -> None:
    velocity = [-0.3, 0.3, -0.3, -0.3, -0.3, -0.3, 0.1]
    closes = [SLIP_FORWARD, STICK, SLIP_BACKWARD, STICK]
    assert corrected([OPEN] * 4, velocity, []) == (SOLVED, closes)


def test_what_pulls_opens_but_for_lines() -> None:
    mode, opens = [STICK, STICK, SLIP_FORWARD, SLIP_BACKWARD], [OPEN, OPEN, OPEN, OPEN]
    velocity = [0.0, 0.0, 0.0, 0.0, 0.5, 0.0, -0.5]
    pulls = [-1.0, 0.0, -1.0, -1.0, -1.0]
    assert corrected(mode, velocity, pulls) == (SOLVED, opens)
    sets = [CONE, LINE, CONE, CONE]
    assert corrected(mode, velocity, pulls, sets) == (SOLVED, [OPEN, STICK, OPEN, OPEN])
    # By no more than rounding of the largest, 1e-11 of it, nothing does.
    barely = [-1e-12, 0.0, -1e-12, -1e-12, 1.0]
    assert corrected(mode, velocity, barely) == (UNCERTIFIED, mode)


def test_friction_beyond_its_cone_slips_against_it() -> None:
    mode = [STICK, STICK, STICK, STICK]
    for side, slip in ((1.0, SLIP_BACKWARD), (-1.0, SLIP_FORWARD)):
        point = [1.0, side * 0.51, 1.0, 1.0, side * 0.79, 1.0, side * 0.31]
        assert corrected(mode, STILL, point) == (SOLVED, [slip, STICK, STICK, slip])
        # Within rounding, 1e-11 of the largest impulse, it is on the edge.
        point = [1.0, side * (0.5 + 5e-12), 1.0, 1.0, side * 0.79, 1.0, side * 0.29]
        assert corrected(mode, STILL, point) == (UNCERTIFIED, mode)
        point = [1.0, side * (0.5 + 1.5e-11), 1.0, 1.0, side * 0.79, 1.0, side * 0.29]
        assert corrected(mode, STILL, point)[1] == [slip, STICK, STICK, STICK]


def test_slip_against_its_friction_sticks() -> None:
    mode, velocity = [OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD], [0, 0, 0, 0, -0.3, 0, 0.3]
    point = [1.0, 1.0, 1.0]
    assert corrected(mode, velocity, point) == (SOLVED, [OPEN, STICK, STICK, STICK])
    root = [9.0, 9.0, 9.0, 9.0, 2.0, 9.0, 2.0]  # those of the tangents count
    found = corrected(mode, velocity, point, root=root)
    assert found == (SOLVED, [OPEN, STICK, STICK, STICK])
    velocity = [0, 0, 0, 0, 0.3, 0, -0.3]
    assert corrected(mode, velocity, point) == (UNCERTIFIED, mode)
