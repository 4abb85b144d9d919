"""The split that is reported is the shortest impulse with the same effect inside the cones."""

from __future__ import annotations

import numpy as np
import pytest
from contact_problems import random_problem
from scipy.optimize import nnls

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact import ContactMode, solve_contact
from heelstrike.contact.modes import OPEN, SLIP_FORWARD, SOLVED, STICK
from heelstrike.contact.sets import CONE, HALF_LINE, LINE
from heelstrike.contact.solvers import least_norm
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactWorkspace, contact_problem


def shortest(
    delassus: np.ndarray, friction: np.ndarray, impulse: np.ndarray, modes: tuple[ContactMode, ...]
) -> tuple[np.ndarray, int]:
    """Shortest impulse with the same velocities, and in how many directions there was a choice.

    A least-distance problem in the null space of G, solved by non-negative least squares (Lawson
    and Hanson, Solving Least Squares Problems, chapter 23): another road than the package's.
    """
    size = impulse.size
    columns, rooms = [], []  # orthonormal directions of the impulse; cone: room @ impulse >= 0
    for k, mode in enumerate(modes):
        normal, tangent = np.eye(size)[2 * k], np.eye(size)[2 * k + 1]
        mu = friction[k]
        if mode is ContactMode.STICK and mu > 0.0:
            columns += [normal, tangent]
            rooms += [mu * normal + tangent, mu * normal - tangent]
        elif mode is not ContactMode.OPEN:
            side = {ContactMode.SLIP_FORWARD: -mu, ContactMode.SLIP_BACKWARD: mu}.get(mode, 0.0)
            columns.append((normal + side * tangent) / np.hypot(1.0, side))
            rooms.append(normal)
    if not columns:
        return np.zeros(size), 0
    B = np.array(columns).T
    diagonal = np.diag(delassus)
    scale = np.where(diagonal > 0.0, 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 1.0)
    _, values, right = np.linalg.svd(scale[:, None] * delassus @ B)
    rank = int(np.sum(values > 1e-9 * values.max()))
    null = B @ right[rank:].T
    if null.shape[1] == 0:
        return impulse, 0
    start = impulse - null @ (null.T @ impulse)
    C = np.array(rooms)
    length = np.abs(impulse).max()
    system = np.vstack([(C @ null).T, -(C @ start) / length])
    target = np.zeros(null.shape[1] + 1)
    target[-1] = 1.0
    left = system @ nnls(system, target, maxiter=10000)[0] - target
    return start - length * null @ (left[:-1] / left[-1]), null.shape[1]


@pytest.mark.parametrize("contacts", [2, 3, 4, 6, 8])
def test_shortest_of_all(contacts: int) -> None:
    redundant = 0
    for seed in range(40):
        problem = random_problem(np.random.default_rng([21, contacts, seed]), contacts)
        if "ill-scaled" in problem.kind:
            continue  # the rank is hard to tell from outside
        solution = solve_contact(problem.delassus, problem.free, problem.friction)
        assert solution.certificate.valid
        impulse = solution.impulse.ravel()
        if not impulse.any():
            continue
        other, choice = shortest(problem.delassus, problem.friction, impulse, solution.mode)
        np.testing.assert_allclose(impulse, other, atol=1e-8 * np.abs(impulse).max())
        redundant += choice > 0
    assert redundant >= 5


def test_internal_forces_vanish() -> None:
    """Two walls in line with a body between them, at rest: no reason to press."""
    J = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 1.0]])
    solution = solve_contact(J @ J.T, [0.0, -0.2, 0.0, -0.2], 0.5)
    assert solution.certificate.valid
    assert np.all(solution.impulse == 0.0) or solution.velocity[0, 1] == pytest.approx(-0.2)


# Step by step, as plain Python.


def workspace(size: int) -> ContactWorkspace:
    """Equations of so many unknowns, with weights and a point, whose scratch is 77."""
    draw = np.random.default_rng(size)
    work = contact_workspace(4, ready=False, symmetric=False)
    equations = work.equations
    equations.size = size
    for each in (equations.basis, equations.edge, equations.step, equations.image):
        each[:] = 77.0
    equations.weight[:size] = draw.uniform(0.5, 2.0, size)
    equations.point[:size] = draw.normal(size=size)
    return work


def test_free_directions_are_those_without_a_pivot() -> None:
    """Of T = [inverse | −relation]: an unknown that is free moves those that depend on it."""
    work = workspace(4)
    equations = work.equations
    equations.pivot_row[:4] = [2, -1, 0, -1]
    equations.tableau[:4, :5] = np.arange(20.0).reshape(4, 5)
    assert uncompiled(least_norm.free_directions)(equations) == 2
    weight, tableau = equations.weight[:4], equations.tableau
    expected = np.zeros((2, 4))
    for found, free in enumerate((1, 3)):
        expected[found, [0, 2]] = weight[[0, 2]] * tableau[[2, 0], free + 1]
        expected[found, free] = weight[free]
    np.testing.assert_allclose(equations.basis[:2, :4], expected)


def test_directions_that_move_something_are_left_out() -> None:
    """What is kept spans those combinations that change no velocity of any row."""
    draw = np.random.default_rng(8)
    for _ in range(10):
        jacobian = draw.normal(size=(8, 3))
        problem = contact_problem(4, count=4, delassus=jacobian @ jacobian.T)
        work = workspace(5)
        equations, reduced = work.equations, work.reduced
        equations.unknown[:5] = reduced.source[:5] = [0, 1, 2, 4, 6]
        equations.unknown[:5] = np.arange(5)
        reduced.scale[:5] = draw.uniform(0.5, 2.0, 5)
        ratio = equations.friction_ratio[:5] = np.array([0.0, 0.0, -0.4, 0.3, 0.0])
        directions = draw.normal(size=(4, 5))
        equations.basis[:4, :5] = directions
        kept = uncompiled(least_norm.keep_velocity)(problem, 4, reduced, equations)
        impulse = np.zeros((8, 5))  # by numbers of the point
        for j, row in enumerate(reduced.source[:5]):
            impulse[row, j] = reduced.scale[j] / equations.weight[j]
            if ratio[j] != 0.0:
                impulse[row + 1, j] = ratio[j] * impulse[row, j]
        moved = (jacobian.T @ impulse @ directions.T).T
        assert kept == 4 - np.linalg.matrix_rank(moved, tol=1e-9) == 1
        found = equations.basis[:kept, :5]
        np.testing.assert_allclose(jacobian.T @ impulse @ found.T, 0.0, atol=1e-9)
        together = np.vstack((directions, found))
        assert np.linalg.matrix_rank(together, tol=1e-8) == 4
        assert np.linalg.norm(found) > 1e-3


def test_a_point_loses_its_part_along_the_free_directions() -> None:
    work = workspace(6)
    basis, point = work.equations.basis, work.equations.point
    directions = np.random.default_rng(3).normal(size=(3, 6))
    directions[1] = directions[0] + 1e-9 * directions[1]
    basis[:3, :6] = directions
    before = point[:6].copy()
    uncompiled(least_norm.project)(6, 3, basis, point)
    found = basis[:3, :6]
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found @ point[:6], 0.0, atol=1e-6)
    left = np.linalg.lstsq(found.T, before - point[:6], rcond=None)[1]
    assert np.all(left < 1e-12)


MODE = np.array([STICK, STICK, OPEN, SLIP_FORWARD])


def test_the_longest_impulse_is_told_of_a_point_outside_its_sets() -> None:
    """Places: normal and tangent of a cone, one of a half-line, one along an edge."""
    work = workspace(4)
    problem = contact_problem(
        4, count=4, friction=np.array([0.5, 0.0, 0.5, 0.5]),
        set=np.array([CONE, HALF_LINE, CONE, CONE]),
    )  # fmt: skip
    tangent, point = np.array([1, -1, 3, 5]), work.equations.point
    for values, longest in (
        ([2.0, 0.9, 1.0, 1.0], 0.0), ([2.0, 1.0, 0.0, 0.0], 0.0), ([2.0, 1.1, 1.0, 3.0], 3.0),
        ([2.0, 0.9, -0.1, 1.0], 2.0), ([2.0, 0.9, 1.0, -5.0], 5.0), ([-0.1, 0.0, 1.0, 1.0], 1.0),
    ):  # fmt: skip
        point[:4] = values
        found = uncompiled(least_norm.excess)(problem, MODE, tangent, work.equations)
        assert found == longest
    problem.set[1] = LINE
    point[:4] = [2.0, 0.9, -0.1, 1.0]
    assert uncompiled(least_norm.excess)(problem, MODE, tangent, work.equations) == 0.0


@pytest.mark.parametrize("second", [HALF_LINE, LINE])
def test_edges_of_cones_are_listed_by_the_free_directions(second: int) -> None:
    """μ λ_n ∓ λ_t ≥ 0 and λ_n ≥ 0, of unit length; lines have none; margins are of the largest."""
    work = workspace(4)
    equations = work.equations
    problem = contact_problem(
        4,
        count=4,
        friction=np.array([0.5, 0.0, 0.5, 0.3]),
        set=np.array([CONE, second, CONE, CONE]),
    )  # fmt: skip
    basis = np.random.default_rng(4).normal(size=(2, 4))
    basis[:, 3] = 0.0  # nothing moves the edge of what slips
    equations.basis[:2, :4] = basis
    found = uncompiled(least_norm.list_edges)(
        problem, MODE, np.array([1, -1, 3, 5]), 2, 7.0, equations
    )
    sides = [np.array([0.5, -1.0, 0.0, 0.0]), np.array([0.5, 1.0, 0.0, 0.0])]
    places = [0, 0]
    if second == HALF_LINE:
        sides.append(np.array([0.0, 0.0, 1.0, 0.0]))
        places.append(2)
    assert found == len(sides)
    point, weight = equations.point[:4], equations.weight[:4]
    largest = np.max(np.abs(point) / weight)
    for row, (side, place) in enumerate(zip(sides, places, strict=True)):
        length = np.linalg.norm(basis @ side)
        edge = equations.edge[row, :4]
        np.testing.assert_allclose(edge[:2], basis @ side / length)
        assert edge[2] == pytest.approx(side @ point / (7.0 * length))
        assert edge[3] == pytest.approx(largest * weight[place] / (7.0 * length))


def test_the_shortest_step_meets_all_edges() -> None:
    """A least-distance problem, against non-negative least squares; the point moves by it."""
    draw = np.random.default_rng(5)
    for _ in range(10):
        work = workspace(5)
        equations, edges = work.equations, draw.normal(size=(3, 2))
        edges /= np.linalg.norm(edges, axis=1)[:, None]
        room = draw.uniform(0.0, 0.5, 3) - edges @ draw.normal(size=2)  # there is a way
        equations.edge[:3, :2], equations.edge[:3, 2], equations.edge[:3, 3] = edges, room, 0.0
        basis = np.linalg.qr(draw.normal(size=(5, 2)))[0].T
        equations.basis[:2, :5] = basis
        before = equations.point[:5].copy()
        uncompiled(least_norm.step_inside)(3, 2, 7.0, work.tally, equations)
        step = basis @ (equations.point[:5] - before) / 7.0
        system, target = np.vstack((edges.T, -room)), np.array([0.0, 0.0, 1.0])
        left = system @ nnls(system, target)[0] - target
        shortest = -left[:2] / left[2] if np.any(room < 0.0) else np.zeros(2)
        np.testing.assert_allclose(step, shortest, atol=1e-7)
        assert np.all(edges @ step + room >= -1e-9)


def test_cones_are_opened_further_each_time_and_the_point_left_if_that_does_not_help() -> None:
    work = workspace(3)
    margins: list[float] = []

    def fails(number: int, tie: float, tally: object, dual: object) -> int:
        assert (number, tie) == (1, 1e-13)
        margins.append(float(work.equations.dual.tableau[0, 0]))
        assert work.equations.dual.tableau[0, 1:3].tolist() == [0.25, 1.0]
        return SOLVED + 1

    run = uncompiled(least_norm.step_inside, replace={least_norm.pivot_to_solution: fails})
    before = work.equations.point[:3].copy()
    work.equations.edge[0, :3] = [0.5, 2.0, 1e10]
    run(1, 1, 7.0, work.tally, work.equations)
    np.testing.assert_allclose(margins, [2.0, 2.0 + 1e-4, 2.01, 3.0])
    np.testing.assert_array_equal(work.equations.point[:3], before)
