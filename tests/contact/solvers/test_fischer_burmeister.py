"""The equations of Fischer and Burmeister and the Newton step that solves them."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.solvers import fischer_burmeister as fb
from heelstrike.contact.solvers.certified_solve import contact_workspace
from heelstrike.contact.workspace import ContactWorkspace

equations = uncompiled(fb.equations)
newton_step = uncompiled(fb.newton_step)

SIZE = 2.5  # what the free velocity is scaled by


def problem(seed: int, reach: float = 1.0) -> ContactWorkspace:
    """Three contacts, the second without friction, and impulses of some size."""
    draw = np.random.default_rng(seed)
    rows = draw.normal(size=(5, 6))
    work = contact_workspace(3)
    work.reduced.unknowns = 5
    work.reduced.matrix[:5, :5] = rows @ rows.T
    work.reduced.offset[:5] = draw.normal(size=5)
    work.iteration.x[:5] = reach * draw.normal(size=5)
    work.reduced.normal[:3] = [0, 2, 3]
    work.reduced.tangent[:3] = [1, -1, 4]
    work.reduced.cone[:3] = [0.6, 0.0, 1.3]
    return work


def values(work: ContactWorkspace, at: np.ndarray) -> np.ndarray:
    work.iteration.x[:5] = at
    equations(3, SIZE, work.reduced, work.iteration)
    return work.iteration.value[:5].copy()


def phi(a: float, b: float) -> float:
    return a + b - float(np.hypot(a, b))


@pytest.mark.parametrize("reach", [1e-2, 1.0, 30.0])
@pytest.mark.parametrize("seed", range(4))
def test_equations_as_they_are_written(seed: int, reach: float) -> None:
    work = problem(seed, reach)
    x = work.iteration.x[:5].copy()
    y = work.reduced.matrix[:5, :5] @ x + work.reduced.offset[:5] / SIZE
    merit = equations(3, SIZE, work.reduced, work.iteration)
    np.testing.assert_allclose(work.iteration.speed[:5], y, rtol=1e-12)

    def friction(normal: int, tangent: int, cone: float) -> float:
        edge = cone * max(x[normal], 0.0)
        return phi(edge + x[tangent], -phi(edge - x[tangent], -y[tangent]))

    expected = [
        phi(x[0], y[0]), friction(0, 1, 0.6), phi(x[2], y[2]), phi(x[3], y[3]), friction(3, 4, 1.3)
    ]  # fmt: skip
    scale = np.abs(np.concatenate([x, y])).max()
    np.testing.assert_allclose(work.iteration.value[:5], expected, atol=1e-13 * scale)
    assert merit == pytest.approx(0.5 * np.dot(expected, expected), rel=1e-10)


@pytest.mark.parametrize("reach", [1e-2, 1.0, 30.0])
@pytest.mark.parametrize("seed", range(4))
def test_their_derivatives(seed: int, reach: float) -> None:
    """Against central differences; random points are not on the kinks."""
    work = problem(seed, reach)
    at = work.iteration.x[:5].copy()
    values(work, at)
    found = work.iteration.slope[:5, :5].copy()
    h = 1e-6 * reach
    steps = h * np.eye(5)
    expected = np.array([(values(work, at + d) - values(work, at - d)) / (2.0 * h) for d in steps])
    np.testing.assert_allclose(found, expected.T, atol=1e-6 * np.abs(found).max())


@pytest.mark.parametrize("damping", [1e-12, 0.3])
def test_newton_step(damping: float) -> None:
    work = problem(1)
    equations(3, SIZE, work.reduced, work.iteration)
    slope, value = work.iteration.slope[:5, :5].copy(), work.iteration.value[:5].copy()
    newton_step(5, damping, work.iteration)
    normal = slope.T @ slope + damping * np.eye(5)
    expected = np.linalg.solve(normal, -slope.T @ value)
    np.testing.assert_allclose(work.iteration.step[:5], expected, rtol=1e-7)


def test_derivatives_at_a_kink_are_those_of_one_side() -> None:
    """Where all vanishes φ has none; 1 − 1/√2, that of equal arguments, stands in its place."""
    kink, work = 0.3, contact_workspace(1)
    work.reduced.unknowns = 2
    work.reduced.matrix[:2, :2] = [[1.0, 0.25], [0.25, 1.0]]
    work.reduced.offset[:2], work.iteration.x[:2] = 0.0, 0.0
    work.reduced.normal[0], work.reduced.tangent[0], work.reduced.cone[0] = 0, 1, 0.5
    assert equations(1, SIZE, work.reduced, work.iteration) == 0.0
    # φ(a, b): both partial derivatives are the kink's; the inner one is −φ(upper, −speed).
    by_upper, by_speed = -kink * kink, kink * kink
    first = kink * np.array([1.0, 0.25]) + [kink, 0.0]
    second = by_speed * np.array([0.25, 1.0]) + [0.0, kink - by_upper]
    np.testing.assert_allclose(work.iteration.slope[:2, :2], [first, second], rtol=1e-14)
