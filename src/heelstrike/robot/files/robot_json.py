"""A robot as JSON, every digit of it, as it goes from the process that reads files."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import numpy as np

from heelstrike.robot.model import Model
from heelstrike.robot.named_tree import Foot
from heelstrike.robot.robot import LockedJoint, Robot
from heelstrike.robot.shapes.outlines import Outline
from heelstrike.robot.sides.mirror import Mirror
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.spatial.solids import Solid

_PLAIN = (
    *("name", "joint_names", "link_names", "actuator_names", "contact_names"),
    *("floating", "contact_friction", "source"),
)

_IN_SPACE = tuple(name for name in _PLAIN if name != "floating")


def robot_entries(robot: Robot | SpatialRobot) -> dict[str, Any]:
    """Return a robot as what JSON holds."""
    if isinstance(robot, SpatialRobot):
        return _json(
            {name: getattr(robot, name) for name in _IN_SPACE}
            | {
                "dimension": 3,
                "model": robot.model.members(),
                "feet": [asdict(foot) for foot in robot.feet],
                "solids": [asdict(solid) for solid in robot.solids],
            }
        )
    parts = {
        "model": robot.model.members(),
        "mirror": robot.mirror and asdict(robot.mirror),
        "feet": [asdict(foot) for foot in robot.feet],
        "locked": [asdict(joint) for joint in robot.locked],
        "outlines": [asdict(outline) for outline in robot.outlines],
    }
    return _json({name: getattr(robot, name) for name in _PLAIN} | parts)


def _json(whole: dict[str, Any]) -> dict[str, Any]:
    entries: dict[str, Any] = json.loads(json.dumps(whole, default=_entry))
    return entries


def robot_of_entries(entries: dict[str, Any]) -> Robot | SpatialRobot:
    """Return the robot that :func:`robot_entries` told."""
    if entries.get("dimension") == 3:
        return SpatialRobot(
            **{name: _tuples(entries[name]) for name in _IN_SPACE},
            model=SpatialModel(**_arrays(entries["model"])),
            feet=tuple(Foot(**_each_tuple(foot)) for foot in entries["feet"]),
            solids=tuple(Solid(**_arrays(solid)) for solid in entries["solids"]),
        )
    plain = {name: _tuples(entries[name]) for name in _PLAIN}
    return Robot(
        **plain,
        model=Model(**_arrays(entries["model"])),
        mirror=entries["mirror"] and Mirror(**_arrays(entries["mirror"])),
        feet=tuple(Foot(**_each_tuple(foot)) for foot in entries["feet"]),
        locked=tuple(LockedJoint(**_each_tuple(joint)) for joint in entries["locked"]),
        outlines=tuple(Outline(**_arrays(outline)) for outline in entries["outlines"]),
    )


def _entry(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return {"kind": value.dtype.str, "shape": value.shape, "values": value.ravel().tolist()}
    return value.item()  # a number of NumPy


def _arrays(entries: dict[str, Any]) -> dict[str, Any]:
    return {
        name: _array(each) if isinstance(each, dict) else each for name, each in entries.items()
    }


def _array(entry: dict[str, Any]) -> np.ndarray[Any, Any]:
    return np.array(entry["values"], dtype=entry["kind"]).reshape(entry["shape"])


def _each_tuple(entries: dict[str, Any]) -> dict[str, Any]:
    return {name: _tuples(value) for name, value in entries.items()}


def _tuples(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
