"""Nonlinear programs made of small functions, each of a few linear combinations of the unknowns.

At one instant a robot's constraints depend on its position, velocity and acceleration there, which
are linear in the unknowns of its polynomials. So a program of unknowns x is a sum over blocks
y = S x + s of costs c(y) and a list of their constraints g(y), whose derivatives are

    ∂g/∂x = (∂g/∂y) S,        ∂²L/∂x² = Sᵀ (∂²L/∂y²) S        with L = σ Σ w c + λᵀ g.

The small ones, of y, are symbolic expressions, found once; large ones are never differentiated.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import casadi
import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats


class Block:
    """A cost and constraints of a few variables y, with their exact derivatives.

    Parameters
    ----------
    name : str
        A name for the functions.
    variables : casadi.SX
        (m,) The variables y.
    parameters : casadi.SX
        (p,) What is the same in all copies, and not sought.
    cost : casadi.SX
        The cost c(y), a number.
    rows : casadi.SX
        (r,) The constraints g(y).

    Attributes
    ----------
    value : casadi.Function
        y and parameters to c and g.
    gradient : casadi.Function
        y and parameters to ∂c/∂y, (m, 1).
    jacobian : casadi.Function
        y and parameters to ∂g/∂y, (r, m).
    hessian : casadi.Function
        y, parameters, the price of c and those of g, (r,), to the upper triangle of the Hessian of
        the priced sum, (m, m), with half of its diagonal: the Hessian is that and its transpose.
    """

    def __init__(self, name: str, variables: Any, parameters: Any, cost: Any, rows: Any) -> None:
        cost = casadi.SX(cost)
        self.size, self.count = variables.numel(), rows.numel()
        price, prices = casadi.SX.sym("price"), casadi.SX.sym("prices", self.count)
        second, _ = casadi.hessian(price * cost + casadi.dot(prices, rows), variables)
        half = casadi.triu(second) - 0.5 * casadi.diag(casadi.diag(second))
        given = [variables, parameters]
        slope, slopes = casadi.gradient(cost, variables), casadi.jacobian(rows, variables)
        self.value = casadi.Function(name, given, _shared(cost, rows))
        self.gradient = casadi.Function(f"{name}_gradient", given, _shared(slope))
        self.jacobian = casadi.Function(f"{name}_jacobian", given, _shared(slopes))
        self.hessian = casadi.Function(f"{name}_hessian", [*given, price, prices], _shared(half))


def _shared(*results: Any) -> list[Any]:
    """Let results of one function share what they have in common."""
    shapes = [result.sparsity() for result in results]
    values = casadi.cse(casadi.vertcat(*(result.nz[:] for result in results)))
    ends = np.cumsum([0, *(shape.nnz() for shape in shapes)]).tolist()
    return [
        casadi.SX(shape, values[first:end])
        for shape, first, end in zip(shapes, ends, ends[1:], strict=False)
    ]


@dataclass(frozen=True, eq=False)
class Copies:
    """Copies of a block in a program, for each of which y = S x + s."""

    block: Block
    """The block."""
    weight: Floats
    """(N,) How much each of them adds to the cost."""
    selection: Any
    """(N m, n) casadi.DM. S of all copies, one after the other."""
    offset: Any
    """(N m,) casadi.DM. s of all copies."""
    parameters: Floats
    """(p,) The numbers that the block leaves open."""

    @classmethod
    def of(cls, block: Block, weight: Floats, x: Any, variables: Any, parameters: Floats) -> Copies:
        """Copies whose variables, (m, N), are affine expressions of the unknowns x, (n,).

        Parameters
        ----------
        block : Block
            The block.
        weight : (N,) array
            How much each copy adds to the cost.
        x : casadi.MX
            The unknowns.
        variables : casadi.MX
            The variables, copy by copy.
        parameters : (p,) array
            The numbers that the block leaves open.
        """
        y = casadi.vec(variables)
        affine = casadi.Function("affine", [x], [casadi.jacobian(y, x), y])
        selection, offset = affine(0.0)
        return cls(block, weight, selection, offset, parameters)

    def joined(self, other: Copies) -> Copies:
        """Return these copies, and those of another after them."""
        return Copies(
            self.block, np.append(self.weight, other.weight),
            casadi.vertcat(self.selection, other.selection),
            casadi.vertcat(self.offset, other.offset), self.parameters,
        )  # fmt: skip

    @property
    def number(self) -> int:
        """How many copies there are."""
        return int(self.weight.size)

    def _given(self, x: Any) -> tuple[Any, Any]:
        """Variables, (m, N), and parameters, (p, N), of all copies, of unknowns x, (n,)."""
        variables = casadi.reshape(self.selection @ x + self.offset, self.block.size, self.number)
        return variables, casadi.repmat(casadi.DM(self.parameters), 1, self.number)

    def value(self, x: Any) -> tuple[Any, Any]:
        """Cost, and the constraints of all copies, (N r,), copy by copy."""
        cost, rows = self.block.value.map(self.number)(*self._given(x))
        return cost @ casadi.DM(self.weight), casadi.vec(rows)

    def gradient(self, x: Any) -> Any:
        """Gradient of the cost, (n,)."""
        slopes = self.block.gradient.map(self.number)(*self._given(x))
        weights = casadi.repmat(casadi.DM(self.weight).T, self.block.size, 1)
        return self.selection.T @ casadi.vec(casadi.densify(slopes) * weights)

    def jacobian(self, x: Any) -> Any:
        """Jacobian of the constraints, (N r, n)."""
        blocks = self.block.jacobian.map(self.number)(*self._given(x))
        return _diagonal(blocks, self.block.size) @ self.selection

    def hessian(self, x: Any, price: Any, prices: Any) -> Any:
        """Hessian of the priced cost and constraints, (n, n)."""
        blocks = self.block.hessian.map(self.number)(
            *self._given(x),
            price * casadi.DM(self.weight).T,
            casadi.reshape(prices, self.block.count, self.number),
        )
        half = self.selection.T @ (_diagonal(blocks, self.block.size) @ self.selection)
        return half + half.T

    @cached_property
    def _selections(self) -> Floats:
        """S of each copy, (N, m, n)."""
        return np.array(self.selection.full().reshape(self.number, self.block.size, -1))

    def first(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Gradient of the cost (n,), constraints (N r,) and their Jacobian (N r, n), as numbers."""
        given = self._given(casadi.DM(x))
        _, rows = self.block.value.map(self.number)(*given)
        slope = casadi.densify(self.block.gradient.map(self.number)(*given)).full()
        slopes = self.block.jacobian.map(self.number)(*given)
        by_unknowns = _stacked(slopes, self.number) @ self._selections
        along = np.einsum("mi,imn->n", slope * self.weight, self._selections)
        return along, rows.full().ravel(order="F"), by_unknowns.reshape(rows.numel(), -1)

    def second(self, x: Floats, price: float, prices: Floats) -> Floats:
        """Hessian of the priced cost and constraints, (n, n), as numbers."""
        blocks = self.block.hessian.map(self.number)(
            *self._given(casadi.DM(x)),
            casadi.DM(price * self.weight).T,
            casadi.DM(prices.reshape(self.number, self.block.count).T),
        )
        chosen = self._selections
        inner = (_stacked(blocks, self.number) @ chosen).reshape(-1, chosen.shape[2])
        half = chosen.reshape(-1, chosen.shape[2]).T @ inner
        return np.asarray(half + half.T)


class BlockProgram:
    """Cost and constraints of a program, and their derivatives.

    Parameters
    ----------
    x : casadi.MX
        (n,) The unknowns.
    linear : casadi.MX
        (l,) Constraints that are affine in the unknowns; they come first.
    copies : sequence of Copies
        All others, and the cost.

    Most methods take expressions, and are made functions of. Those of a program that is solved but
    once are faster evaluated as numbers, by `first` and `second`.
    """

    def __init__(self, x: Any, linear: Any, copies: Sequence[Copies]) -> None:
        self._copies = tuple(copies)
        self._linear = casadi.evalf(casadi.jacobian(linear, x))
        self._given = x, linear

    @cached_property
    def value(self) -> Any:
        """Function of x: the cost, and all constraints."""
        x, linear = self._given
        cost, rows = zip(*(each.value(x) for each in self._copies), strict=True)
        return casadi.Function("value", [x], [sum(cost), casadi.vertcat(linear, *rows)])

    def cost(self, x: Floats) -> float:
        """Cost, as a number."""
        return float(sum(each.value(casadi.DM(x))[0] for each in self._copies))

    @cached_property
    def _affine(self) -> tuple[Floats, Floats]:
        """Derivatives of the affine constraints, and their values where all unknowns are zero."""
        x, linear = self._given
        constant = casadi.Function("linear", [x], [linear])(0.0)
        return self._linear.full(), constant.full().ravel()

    def first(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Gradient of the cost (n,), all constraints, and their Jacobian, as numbers."""
        slopes, constant = self._affine
        parts = [each.first(x) for each in self._copies]
        return (
            np.sum([slope for slope, _, _ in parts], axis=0),
            np.concatenate([slopes @ x + constant, *(rows for _, rows, _ in parts)]),
            np.vstack([slopes, *(own for _, _, own in parts)]),
        )

    def second(self, x: Floats, price: float, prices: Floats) -> Floats:
        """Hessian of the cost times its price and the constraints times theirs, as numbers."""
        ends = np.cumsum([len(self._affine[1]), *(each.number * each.block.count
                                                  for each in self._copies)]).tolist()  # fmt: skip
        parts = [
            each.second(x, price, prices[first:end])
            for each, first, end in zip(self._copies, ends, ends[1:], strict=False)
        ]
        return np.asarray(np.sum(parts, axis=0))

    def gradient(self, x: Any) -> Any:
        """Gradient of the cost, (n,)."""
        return sum(each.gradient(x) for each in self._copies)

    def jacobian(self, x: Any) -> Any:
        """Jacobian of all constraints."""
        return casadi.vertcat(self._linear, *(each.jacobian(x) for each in self._copies))

    def hessian(self, x: Any, price: Any, prices: Any) -> Any:
        """Hessian of the cost times its price and the constraints times theirs, (n, n)."""
        total, first = casadi.MX(x.numel(), x.numel()), self._linear.shape[0]
        for each in self._copies:
            end = first + each.number * each.block.count
            total += each.hessian(x, price, prices[first:end])
            first = end
        return total


def _stacked(blocks: Any, number: int) -> Floats:
    """Blocks that stand side by side, one after the other along a first axis."""
    dense = casadi.densify(blocks).full()
    return np.array(dense.reshape(len(dense), number, -1).transpose(1, 0, 2))


def _diagonal(blocks: Any, width: int) -> Any:
    """Blocks that stand side by side, one after the other along a diagonal."""
    return casadi.diagcat(*casadi.horzsplit(blocks, width))
