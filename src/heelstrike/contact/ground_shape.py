"""Smooth ground: a curve whose height a kernel tells, perhaps one of somebody else.

The contact of a disc with it is at the place of the curve that is nearest to the disc's centre: a
zero of the way from there to the centre, along the tangent::

    (x − s) + (z − h(s)) h'(s) = 0

The distance is signed, and its gradient is the normal there, on either side of the curve. As the
disc moves on, its centre is on a parallel of the curve, whose curvature is −k / (1 − k d) at the
distance d, with k = h'' / (1 + h'²)^(3/2), positive in a valley. So the disc has to fit into it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

from numba import types

from heelstrike.compiler.bundle_type import address_of
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.kernel_objects import KernelObject
from heelstrike.compiler.separate_kernel import measure_at
from heelstrike.robot.model import Floats

DISTANCE, HEIGHT, BEND = range(3)
"""What a shape is asked for: the distance of a place, its height under it, its curvature there."""

STEPS = 60
"""Most steps of Newton's method to the nearest place: it takes four or five beside the curve. High
above hills it may not be found; the distance of the place that is gives the side and the size."""

AT_THE_FOOT = 1e-15
"""The nearest place is found when it moves by no more than this (m, or of its own x)."""

LEAST_PART = 0.5
"""Least second derivative of the squared distance that a step is made with, as a part of that to
the tangent: the steps lead to a minimum, and to no other place where the derivative vanishes."""

SURE = 1e-8
"""Steps shorter than this (m) are not looked at for whether they come nearer: rounding decides."""


class GroundShape(KernelObject):
    """The shape of a smooth ground: its height at every place.

    A subclass is a frozen dataclass of numbers with one kernel, ``height(self, x)``, which returns
    the height (m), its slope dz/dx and the rate of that, d²z/dx² (1/m), at a place x (m). They must
    belong together: the slope says where normals point, its rate how contacts accelerate. Discs
    have to fit into its valleys.
    """

    called = "ground shape"
    asked: ClassVar[dict[str, str]] = {"height": "self, x"}

    height: ClassVar[Callable[..., Any]]
    """The kernel, made by :func:`heelstrike.sim.kernel`."""

    def at(self, x: float) -> tuple[float, float, float]:
        """Height (m), slope and its rate (1/m) at a place x (m), found in Python.

        Parameters
        ----------
        x : float
            The place (m).

        Returns
        -------
        tuple of float
            What the kernel returns.
        """
        kernel: Any = type(self).height
        level, slope, bend = kernel.py_func(self, x)
        return float(level), float(slope), float(bend)

    @classmethod
    def signature(cls) -> Any:
        """Of the address of its numbers, what it is asked for, a place, and a normal to write."""
        number, normal = types.float64, types.Array(types.float64, 1, "C")
        return number(types.int64, types.int64, number, number, normal)

    @staticmethod
    def _entry(numbers_at: Any, height: Any) -> Callable[..., float]:
        """Make what loops call."""

        def ask(address: int, what: int, x: float, z: float, normal: Floats) -> float:
            numbers = numbers_at(address)
            level, slope, bend = height(numbers, x)
            if what == HEIGHT:
                return level
            if what == BEND:
                return bend / (1.0 + slope * slope) ** 1.5
            foot, above, near = x, z - level, False
            for _ in range(STEPS):
                along, down = x - foot, z - level
                flat = 1.0 + slope * slope
                change = (along + down * slope) / max(flat - down * bend, LEAST_PART * flat)
                near = abs(change) <= AT_THE_FOOT * (1.0 + abs(foot))
                if near:
                    break
                squared = along * along + down * down
                level, slope, bend = height(numbers, foot + change)
                while abs(change) > SURE and (
                    (x - foot - change) ** 2 + (z - level) ** 2 > squared
                ):
                    change *= 0.5
                    level, slope, bend = height(numbers, foot + change)
                foot += change
            length = math.sqrt(1.0 + slope * slope)
            normal[0], normal[1] = -slope / length, 1.0 / length
            if near:
                return (x - foot) * normal[0] + (z - level) * normal[1]
            distance = math.sqrt((x - foot) ** 2 + (z - level) ** 2)
            return distance if above > 0.0 else -distance

        return ask


@kernel
def distance_to_shape(code: int, shape: Any, x: float, z: float, normal: Floats) -> float:
    """Signed distance of a place from a smooth ground; writes the normal there."""
    return measure_at(code, (address_of(shape), DISTANCE, x, z, normal))


@kernel
def height_of_shape(code: int, shape: Any, x: float, normal: Floats) -> float:
    """Height of a smooth ground at x; `normal` is not written to."""
    return measure_at(code, (address_of(shape), HEIGHT, x, 0.0, normal))


@kernel
def curvature_of_shape(code: int, shape: Any, x: float, normal: Floats) -> float:
    """Curvature (1/m) of a smooth ground at x, positive in a valley; `normal` is not written to."""
    return measure_at(code, (address_of(shape), BEND, x, 0.0, normal))
