"""Kinds of row from outside: a cable that holds from above, a pin, a rail, a rope that rubs.

No line of the package knows of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Any

import heelstrike as hs
from heelstrike.sim import add_point_row, kernel, point_at, point_bias, point_velocity


@dataclass(frozen=True)
class Cable(hs.Constraint):
    """An inextensible cable from the origin of a link to a fixed place."""

    link: str
    x: float = 0.0
    z: float = 0.0
    length: float = 1.0
    restitution: float = 0.0

    set = hs.ImpulseSet.HALF_LINE

    def numbers(self, robot: Any) -> dict[str, float | int]:
        where = robot.link_names.index(self.link)
        return {"link": where, "x": self.x, "z": self.z, "length": self.length}

    @kernel
    def rows(
        self, model: Any, tree: Any, q: Any, v: Any, gap: Any, jacobian: Any, bias: Any
    ) -> None:
        at = point_at(tree, self.link, 0.0, 0.0)
        dx, dz = at[0] - self.x, at[1] - self.z
        long = hypot(dx, dz)
        gap[0] = self.length - long
        if long > 0.0:
            ux, uz = dx / long, dz / long
            add_point_row(model, tree, self.link, at, (-ux, -uz), jacobian[0])
            vx, vz = point_velocity(tree, self.link, at)
            ax, az = point_bias(tree, self.link, at)
            across = ux * vz - uz * vx
            bias[0] = -(ux * ax + uz * az) - across * across / long


@dataclass(frozen=True)
class Pin(hs.Constraint):
    """The origin of a link held at a fixed place."""

    link: int = 0
    x: float = 0.0
    z: float = 0.0

    components = 2

    @kernel
    def rows(
        self, model: Any, tree: Any, q: Any, v: Any, gap: Any, jacobian: Any, bias: Any
    ) -> None:
        at = point_at(tree, self.link, 0.0, 0.0)
        gap[0], gap[1] = at[0] - self.x, at[1] - self.z
        add_point_row(model, tree, self.link, at, (1.0, 0.0), jacobian[0])
        add_point_row(model, tree, self.link, at, (0.0, 1.0), jacobian[1])
        bias[0], bias[1] = point_bias(tree, self.link, at)


@dataclass(frozen=True)
class Rub(hs.Constraint):
    """A guide along x that rubs."""

    bound: float = 2.0

    set = hs.ImpulseSet.INTERVAL

    @kernel
    def rows(
        self, model: Any, tree: Any, q: Any, v: Any, gap: Any, jacobian: Any, bias: Any
    ) -> None:
        jacobian[0, 0] = 1.0


@dataclass(frozen=True)
class Table(hs.Constraint):
    """A table under the coordinate z, with friction along x."""

    height: float = 0.0
    friction: float = 0.5
    restitution: float = 0.0

    set = hs.ImpulseSet.CONE
    components = 2

    @kernel
    def rows(
        self, model: Any, tree: Any, q: Any, v: Any, gap: Any, jacobian: Any, bias: Any
    ) -> None:
        gap[0] = q[1] - self.height
        jacobian[0, 1] = 1.0
        jacobian[1, 0] = 1.0
