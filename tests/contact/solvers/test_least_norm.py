"""The split that is reported is the shortest impulse with the same effect inside the cones."""

from __future__ import annotations

import numpy as np
import pytest
from contact_problems import random_problem
from scipy.optimize import nnls

from heelstrike.contact import ContactMode, solve_contact


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
