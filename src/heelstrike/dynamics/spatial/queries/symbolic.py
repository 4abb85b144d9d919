"""The kernels of space over CasADi symbols: one source, exact expression graphs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import casadi

from heelstrike.compiler.compilation import uncompiled


def traced(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel that runs over object arrays of CasADi ``SX`` instead of numbers."""
    return uncompiled(kernel, replace=IN_SYMBOLS)


IN_SYMBOLS: dict[Any, Any] = {
    math.sin: casadi.sin,
    math.cos: casadi.cos,
    math.sqrt: casadi.sqrt,
    math.atan2: casadi.atan2,
    math.copysign: casadi.copysign,
}
"""What kernels call, and what it is of symbols."""
