"""Programs made of blocks: their derivatives against those that CasADi finds by itself."""

from __future__ import annotations

import casadi
import numpy as np
import pytest

from heelstrike.gait.blocks import Block, BlockProgram, Copies


@pytest.fixture(scope="module")
def program() -> tuple[BlockProgram, casadi.MX]:
    """Two kinds of block of three variables each, affine in four unknowns."""
    y, theta = casadi.SX.sym("y", 3), casadi.SX.sym("theta", 2)
    cost = casadi.sin(y[0]) * y[1] * theta[0] + y[2] ** 4
    rows = casadi.vertcat(y[0] * y[2], casadi.exp(y[1] * theta[1]), y[2] - y[0])
    path = Block("path", y, theta, cost, rows)
    end = Block("end", y, theta, 0.0, casadi.vertcat(y[0] ** 3 * y[1]))
    x = casadi.MX.sym("x", 4)
    draw = np.random.default_rng(5)
    instants, numbers = casadi.DM(draw.normal(size=(15, 4))), np.array([0.7, -0.4])
    along = casadi.reshape(instants @ x + 0.3, 3, 5)
    landing = casadi.vertcat(x[3] + 1.0, x[0] - x[2], 2.0 * x[1])
    linear = casadi.vertcat(x[0] - 2.0 * x[3] + 1.0)
    weight = draw.uniform(size=5)
    copies = [
        Copies.of(end, np.zeros(1), x, landing, numbers),
        Copies.of(path, weight, x, along, numbers),
    ]
    return BlockProgram(x, linear, copies), x


def test_derivatives_are_those_of_the_whole(program: tuple[BlockProgram, casadi.MX]) -> None:
    blocks, x = program
    cost, rows = blocks.value(x)
    price, prices = casadi.MX.sym("price"), casadi.MX.sym("prices", rows.numel())
    whole, _ = casadi.hessian(price * cost + casadi.dot(prices, rows), x)
    pairs = [
        (blocks.gradient(x), casadi.gradient(cost, x)),
        (blocks.jacobian(x), casadi.jacobian(rows, x)),
        (blocks.hessian(x, price, prices), whole),
    ]
    numbers = [np.random.default_rng(6).normal(size=n) for n in (4, 1, rows.numel())]
    for ours, theirs in pairs:
        both = casadi.Function("both", [x, price, prices], [ours, theirs])
        found, expected = (np.array(part) for part in both(*numbers))
        assert np.abs(expected).max() > 0.1
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def test_numbers_are_those_of_the_expressions(program: tuple[BlockProgram, casadi.MX]) -> None:
    blocks, x = program
    draw = np.random.default_rng(7)
    point, price, prices = draw.normal(size=4), 0.8, draw.normal(size=17)
    bend = blocks.hessian(x, price, prices)
    given = [blocks.value(x)[0], blocks.gradient(x), blocks.value(x)[1], blocks.jacobian(x), bend]
    expected = [casadi.densify(each).full() for each in casadi.Function("given", [x], given)(point)]
    found = [blocks.cost(point), *blocks.first(point), blocks.second(point, price, prices)]
    for ours, theirs in zip(found, expected, strict=True):
        assert np.abs(theirs).max() > 0.1
        np.testing.assert_allclose(ours, theirs.squeeze(), rtol=1e-12, atol=1e-12)


def test_copies_that_are_joined_are_those_of_all() -> None:
    y = casadi.SX.sym("y", 2)
    block = Block("b", y, casadi.SX.sym("theta", 0), y[0] ** 2 * y[1], casadi.vertcat(y[0] * y[1]))
    x, draw = casadi.MX.sym("x", 3), np.random.default_rng(8)
    along, weight = casadi.reshape(draw.normal(size=(10, 3)) @ x + 0.2, 2, 5), draw.uniform(size=5)
    parts = [
        Copies.of(block, weight[part], x, along[:, part], np.zeros(0))
        for part in (slice(0, 2), slice(2, 5), slice(0, 5))
    ]
    point, prices = draw.normal(size=3), draw.normal(size=5)
    both, whole = parts[0].joined(parts[1]), parts[2]
    for ours, theirs in zip(both.first(point), whole.first(point), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(both.second(point, 0.3, prices), whole.second(point, 0.3, prices))


def test_what_is_linear_comes_first_then_block_by_block(
    program: tuple[BlockProgram, casadi.MX],
) -> None:
    blocks, _ = program
    _, rows = (np.array(part).ravel() for part in blocks.value(np.array([1.0, 2.0, 3.0, 4.0])))
    assert rows.size == 1 + 1 + 5 * 3
    assert rows[0] == 1.0 - 8.0 + 1.0
    assert rows[1] == 5.0**3 * -2.0
