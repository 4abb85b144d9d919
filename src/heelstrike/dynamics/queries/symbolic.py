"""The kernels over CasADi symbols: one source, exact expression graphs."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from heelstrike import dynamics
from heelstrike.compiler.compilation import uncompiled
from heelstrike.dynamics.queries.evaluation import Evaluation


def traced(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel that runs over object arrays of CasADi ``SX`` instead of numbers."""
    return uncompiled(kernel, replace=_IN_SYMBOLS)


_IN_SYMBOLS: dict[Any, Any] = {
    math.sin: casadi.sin,
    math.cos: casadi.cos,
    math.sqrt: casadi.sqrt,
    math.atan2: casadi.atan2,
    math.copysign: casadi.copysign,
}
"""What kernels call, and what it is of symbols."""


def symbols(vector: casadi.SX) -> NDArray[np.object_]:
    """Spread a CasADi vector over an object array, one scalar symbol an entry."""
    array = np.empty(vector.numel(), dtype=object)
    for i in range(vector.numel()):
        array[i] = vector[i]
    return array


def expression(array: NDArray[np.object_]) -> casadi.SX:
    """Collect an object array of scalar symbols into a CasADi vector or matrix."""
    collected: Any = (
        casadi.vertcat(*array)
        if array.ndim == 1
        else casadi.vertcat(*(casadi.horzcat(*row) for row in array))
    )
    return collected


class TracedDynamics(Evaluation):
    """A robot in a symbolic state. Every query of :mod:`heelstrike.dynamics` is a method of it.

    `point_jacobian` and `point_bias_acceleration` take a world position, which may be symbolic.

    Parameters
    ----------
    robot : Robot
        The robot whose numbers enter the expressions.
    q, v : (nq,) and (nv,) object arrays of casadi.SX
        Symbolic state, for example from :func:`symbols`; at rest by default.
    """

    q: Any
    v: Any
    point_jacobian: Callable[..., Any] = Evaluation.jacobian
    point_bias_acceleration: Callable[..., Any] = Evaluation.bias_acceleration

    def __getattr__(self, name: str) -> Callable[..., Any]:
        query: Any = getattr(dynamics, name, None)
        if not hasattr(query, "at"):
            raise AttributeError(f"there is no query {name!r} in heelstrike.dynamics")
        return partial(query.at, self)
