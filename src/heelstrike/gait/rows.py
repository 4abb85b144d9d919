"""What the constraints of a program mean, and the limits of joints that every program keeps."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot


class Kind(enum.Enum):
    """What a constraint is about, and its unit; every program has kinds of its own."""

    def __init__(self, text: str, unit: str) -> None:
        self.text = text
        self.unit = unit


@dataclass(frozen=True)
class Row:
    """One scaled constraint, ``lower <= expression <= upper``."""

    kind: Any
    """What it is about, a member of a `Kind`."""
    subject: str
    """Joint, contact point or foot concerned, if any."""
    lower: float
    upper: float
    """lower, upper: Bounds in scaled units."""
    unit: float
    """Size of the scaled unit in the unit of its kind."""
    of: tuple[int, ...] = ()
    """Contact points concerned."""


class Rows:
    """Expressions and their meaning, collected one by one."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.expressions: list[Any] = []

    def add(
        self, kind: Kind, value: Any, *, subject: str = "", lower: float = 0.0,
        upper: float = np.inf, unit: float = 1.0, scale: float = 1.0,
        of: int | tuple[int, ...] = (),
    ) -> None:  # fmt: skip
        """Add ``lower <= value <= upper``, in units of `unit`; `scale` converts to the kind's."""
        of = (of,) if isinstance(of, int) else of
        self.rows.append(Row(kind, subject, lower / unit, upper / unit, scale * unit, of))
        self.expressions.append(value / unit)


class Limit(enum.Enum):
    """A limit of a joint."""

    RANGE = "range"
    SPEED = "speed"
    TORQUE = "torque"


def joint_limits(
    robot: Robot, position: Any, velocity: Any, torques: Mapping[int, Any],
    ranges: tuple[Floats, Floats], speeds: Floats,
) -> Iterator[tuple[Limit, Any, dict[str, Any]]]:  # fmt: skip
    """Yield the limits that joints have: of what, its expression, and bounds for `Rows.add`.

    Parameters
    ----------
    robot : Robot
        A floating robot, whose first three coordinates are the trunk's.
    position, velocity : (nv,) array of expressions
        Of all coordinates.
    torques : mapping of int to expression
        Torques of the motors, by coordinate.
    ranges : two (nv,) arrays
        Least and greatest positions.
    speeds : (nv,) array
        Greatest speeds.
    """
    model = robot.model
    actuators = {joint: i for i, joint in enumerate(model.actuator_joint.tolist())}
    for j in range(3, robot.nv):
        speed = speeds[j]
        limits = [(Limit.RANGE, position[j], ranges[0][j], ranges[1][j], 1.0)]
        if j in torques:
            low, high = (ends[actuators[j]] for ends in (model.torque_lower, model.torque_upper))
            largest = max((abs(limit) for limit in (low, high) if np.isfinite(limit)), default=0)
            stall, free = model.stall_torque[j], model.no_load_speed[j]
            drag = stall / free * velocity[j] if np.isfinite(stall) else 0.0  # of the winding
            limits += [
                (Limit.TORQUE, torques[j], low, high, largest or 1.0),
                (Limit.TORQUE, torques[j] + drag, -stall, stall, stall),
            ]
        limits.append((Limit.SPEED, velocity[j], -speed, speed, speed))
        for limit, value, least, most, unit in limits:
            if np.isfinite([least, most]).any():
                bounds = {"lower": float(least), "upper": float(most), "unit": float(unit)}
                yield limit, value, {"subject": robot.joint_names[j], **bounds}
