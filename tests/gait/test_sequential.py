"""Sequential quadratic programming: published optima, and what it must not take for one."""

from __future__ import annotations

from collections.abc import Callable

import casadi
import numpy as np
import pytest

from heelstrike.gait.sequential import optimum_near
from heelstrike.robot.model import Floats

Problem = Callable[[casadi.SX], tuple[casadi.SX, casadi.SX]]


def solved(
    problem: Problem, start: list[float], lower: list[float], upper: list[float]
) -> tuple[Floats, Floats] | None:
    """Solve a problem that is told as expressions."""
    x = casadi.SX.sym("x", len(start))
    cost, rows = problem(x)
    prices = casadi.SX.sym("prices", len(lower))
    bend, _ = casadi.hessian(cost + casadi.dot(prices, rows), x)
    first = casadi.Function(
        "first", [x], [casadi.gradient(cost, x), rows, casadi.jacobian(rows, x)]
    )
    second = casadi.Function("second", [x, prices], [bend])

    def slopes(at: Floats) -> tuple[Floats, Floats, Floats]:
        gradient, values, jacobian = (casadi.densify(each).full() for each in first(at))
        return gradient.ravel(), values.ravel(), jacobian

    return optimum_near(
        np.array(start), np.zeros(len(lower)),
        lambda at: float(casadi.Function("cost", [x], [cost])(at)), slopes,
        lambda at, given: casadi.densify(second(at, given)).full(),
        (np.array(lower), np.array(upper)),
    )  # fmt: skip


def test_problem_71_of_hock_and_schittkowski() -> None:
    """W. Hock and K. Schittkowski, *Test Examples for Nonlinear Programming Codes*, 1981, no. 71.

    Bounds of the unknowns are constraints here. The optimum and the multipliers of the product and
    of the sum of squares are those that IPOPT's documentation prints.
    """

    def problem(x: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
        cost = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
        return cost, casadi.vertcat(x[0] * x[1] * x[2] * x[3], casadi.sumsqr(x), x)

    found = solved(
        problem, [1.0, 5.0, 5.0, 1.0], [25.0, 40.0, *[1.0] * 4], [np.inf, 40.0, *[5.0] * 4]
    )
    assert found is not None
    unknowns, prices = found
    np.testing.assert_allclose(
        unknowns, [1.0, 4.74299964, 3.82114998, 1.37940829], rtol=0, atol=5e-9
    )
    np.testing.assert_allclose(prices[:2], [-0.55229366, 0.16146857], rtol=0, atol=5e-8)
    assert prices[2] < 0.0  # the first unknown is at its lower bound
    assert not prices[3:].any()


def test_bounds_on_both_sides_have_prices_of_both_signs() -> None:
    """Least distance from (3, -2) in a box: its corner, with prices of minus the slopes."""
    found = solved(
        lambda x: ((x[0] - 3.0) ** 2 + (x[1] + 2.0) ** 2, x), [0.0, 0.0], [-1.0] * 2, [1.0] * 2
    )
    assert found is not None
    np.testing.assert_allclose(found[0], [1.0, -1.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[1], [4.0, -2.0], rtol=0, atol=1e-12)


def test_what_is_held_at_first_is_let_go() -> None:
    """From far away both bounds look violated; at the optimum the parabola alone is held."""
    found = solved(
        lambda x: (casadi.sumsqr(x), casadi.vertcat(x[1] - x[0] ** 2 + 4.0 * x[0] - 2.0, x[0])),
        [4.0, -4.0], [0.0, -1.0], [np.inf, 1.0],
    )  # fmt: skip
    assert found is not None
    x, y = found[0]
    assert y == pytest.approx(x**2 - 4.0 * x + 2.0, abs=1e-9)
    assert 2.0 * x + 2.0 * y * (2.0 * x - 4.0) == pytest.approx(0.0, abs=1e-8)
    assert found[1][1] == 0.0


@pytest.mark.parametrize("start", [0.3, 1.0])
def test_a_maximum_is_none(start: float) -> None:
    """Newton's method leads to the maximum of the cosine, which is stationary."""
    found = solved(lambda x: (casadi.cos(x[0]), x), [start], [-np.inf], [np.inf])
    assert found is None


@pytest.mark.parametrize("held", [False, True])
def test_a_minimum_beyond_a_hill_is_none(held: bool) -> None:
    """The curve bends down at the start, so that Newton's step goes up, into the dearer valley.

    Alone, and with an equation y = x.
    """
    count, bound = (2, 0.0) if held else (1, np.inf)

    def problem(x: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
        return (x[0] ** 2 - 1.0) ** 2 + 0.6 * x[-1], x[-1] - x[0] if held else x

    assert solved(problem, [-0.5] * count, [-bound], [bound]) is None
    found = solved(problem, [-0.9] * count, [-bound], [bound])
    assert found is not None
    assert found[0] == pytest.approx(np.roots([4.0, 0.0, -4.0, 0.6]).real.min(), abs=1e-8)


def test_what_the_start_breaks_counts() -> None:
    """The start is cheaper than the optimum, since it breaks the equation: that has its price."""
    found = solved(lambda x: (casadi.sumsqr(x), casadi.sum1(x)), [0.1, 0.2], [2.0], [2.0])
    assert found is not None
    np.testing.assert_allclose(found[0], 1.0, rtol=0, atol=1e-9)


def test_a_cost_that_is_not_a_number_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """The derivatives lead to the optimum, at which the cost has no value."""

    def found(cost: float) -> object:
        return optimum_near(
            np.array([0.5]), np.zeros(1), lambda at: cost if at[0] > 0.9 else 1.0,
            lambda at: (2.0 * (at - 1.0), np.zeros(1), np.zeros((1, 1))),
            lambda _, __: np.full((1, 1), 2.0), (np.array([-1.0]), np.array([1.0])),
        )  # fmt: skip

    assert found(0.0) is not None
    assert found(np.nan) is None


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
def test_how_much_dearer_is_relative_to_the_cost(unit: float) -> None:
    def found(more: float) -> object:
        return optimum_near(
            np.array([0.5]), np.zeros(1), lambda at: unit * (1.0 + more * (at[0] > 0.9)),
            lambda at: (2.0 * (at - 1.0), np.zeros(1), np.zeros((1, 1))),
            lambda _, __: np.full((1, 1), 2.0), (np.array([-1.0]), np.array([1.0])),
        )  # fmt: skip

    assert found(1e-9) is not None
    assert found(1e-7) is None


def test_a_maximum_along_a_constraint_is_none() -> None:
    """On the circle, (1, 0) is stationary, and the most."""
    found = solved(lambda x: (x[0], casadi.sumsqr(x)), [0.98, 0.05], [1.0], [1.0])
    assert found is None or found[0][0] == pytest.approx(-1.0)


def test_a_price_of_the_wrong_sign_is_no_optimum() -> None:
    """At (1, 7) the slopes balance, and y is at its best; but cost falls as x leaves its bound."""
    found = solved(
        lambda x: (x[0] ** 2 + 6.0 * x[0] * x[1] + x[1] ** 2 - 20.0 * (x[0] + x[1]), x[0]),
        [0.0, 0.0], [-np.inf], [1.0],
    )  # fmt: skip
    assert found is None


@pytest.mark.parametrize(
    ("rows", "lower", "upper"),
    [
        (lambda x: casadi.vertcat(x[0], -x[0]), [1.0, 1.0], [np.inf] * 2),  # contradict each other
        (lambda x: casadi.vertcat(x[0], 2.0 * x[0]), [1.0, 2.0], [1.0, 2.0]),  # the same twice
        (lambda x: casadi.vertcat(*[x] * 3), [1.0] * 6, [1.0] * 6),  # more than unknowns
        (lambda x: casadi.log(x[0]), [0.0], [0.0]),  # beyond where there are values
    ],
)
def test_nothing_is_found_where_there_is_nothing_to_find(
    rows: Callable[[casadi.SX], casadi.SX], lower: list[float], upper: list[float]
) -> None:
    assert solved(lambda x: (casadi.sumsqr(x), rows(x)), [-1.0, 0.5], lower, upper) is None
