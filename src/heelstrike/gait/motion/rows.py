"""What the constraints of a motion mean."""

from __future__ import annotations

import enum
from typing import Any

import numpy as np

from heelstrike.field_texts import dataclass


class Kind(enum.Enum):
    """What a constraint is about, and its unit."""

    MOTION = ("equation of motion", "N or N m")
    NORMAL_REST = ("contact point that stays on the ground", "m/s²")
    TANGENT_REST = ("contact point that does not slide", "m/s²")
    NORMAL_STILL = ("contact point that stays on the ground", "m/s")
    TANGENT_STILL = ("contact point that does not slide", "m/s")
    PLACE = ("contact point that stays in its place", "m")
    PUSH = ("contact point that pushes", "N")
    FRICTION = ("friction cone", "N")
    HEIGHT = ("contact point above the ground", "m")
    TORQUE = ("torque limit", "N m")
    RANGE = ("joint range", "rad")
    SPEED = ("joint speed limit", "rad/s")
    MOMENTUM = ("momentum through the impact", "N s or N m s")
    TOUCH = ("contact point on the ground at touchdown", "m")
    ARRIVE = ("contact point not rising at touchdown", "m/s")
    NORMAL_STOP = ("contact point that stops", "m/s")
    TANGENT_STOP = ("contact point that stops sliding", "m/s")
    LEAVE = ("contact point free to leave", "m/s")
    IMPULSE = ("impulse that pushes", "N s")
    IMPULSE_FRICTION = ("friction cone of the impulse", "N s")

    def __init__(self, text: str, unit: str) -> None:
        self.text = text
        self.unit = unit


@dataclass(frozen=True)
class Row:
    """One scaled constraint, ``lower <= expression <= upper``."""

    kind: Kind
    """What it is about."""
    subject: str
    """Joint, contact point or foot concerned."""
    lower: float
    upper: float
    """lower, upper: Bounds in scaled units."""
    unit: float
    """Size of the scaled unit in the unit of its kind."""
    of: tuple[int, ...]
    """Contact points concerned."""


class Rows:
    """Expressions and their meaning, collected one by one."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.expressions: list[Any] = []

    def add(
        self, kind: Kind, value: Any, *, subject: str, lower: float = 0.0, upper: float = np.inf,
        unit: float = 1.0, of: int | tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        """Add ``lower <= value <= upper``, in units of `unit`."""
        of = (of,) if isinstance(of, int) else of
        self.rows.append(Row(kind, subject, lower / unit, upper / unit, unit, of))
        self.expressions.append(value / unit)
