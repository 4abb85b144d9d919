"""Numbers of joints in MJCF: as attributes, or, where MJCF has no word for them, as custom data.

``<custom><numeric name="speed_limit:JOINT" data="…"/></custom>`` holds the speed limit of a joint,
and likewise every number of :class:`~heelstrike.robot.model.Model` without an attribute.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from heelstrike.robot.assembly import LARGEST_NUMBER
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.model import PROPERTIES, Floats
from heelstrike.robot.warning import warn

ATTRIBUTES = {
    "reference": ("ref", "qpos0", ""),
    "armature": ("armature", "dof_armature", ""),
    "damping": ("damping", "dof_damping", "damper"),
    "stiffness": ("stiffness", "jnt_stiffness", "spring"),
    "rest": ("springref", "qpos_spring", ""),
    "dry_friction": ("frictionloss", "dof_frictionloss", "frictionloss"),
}
"""Attribute of ``<joint>``, array of MuJoCo's model, and the flag that switches it off."""

CUSTOM = [
    name
    for name, number in PROPERTIES.items()
    if number.shape in (("nq",), ("nv",)) and name not in ATTRIBUTES
]
"""Numbers of joints that MJCF has no word for."""


def read_joint_numbers(file: MujocoFile) -> dict[str, Floats]:
    """Return the numbers of all joints that a file gives by attributes or custom data.

    URDF gives the speed limit as ``<limit velocity="…">``.

    Raises
    ------
    RobotError
        If custom data are no number, or one too small.
    """
    sense = np.array([one.sense for one in file.coordinates])
    model = file.model
    hinged = np.isin(model.jnt_type, (2, 3))  # slides and hinges, which have one position
    rest = np.where(hinged, model.qpos_spring[model.jnt_qposadr], 0.0)
    numbers = {
        "reference": np.array([one.reference for one in file.coordinates]),
        "rest": sense * file.of_joints(rest, 0.0),
        "stiffness": file.of_joints(model.jnt_stiffness, 0.0),
    }
    for name, (_, field, flag) in ATTRIBUTES.items():
        if name not in numbers:
            numbers[name] = file.of_velocities(getattr(model, field))
        numbers[name] = numbers[name] * float(not file.disabled(flag))
    return numbers | {name: _custom(file, name) for name in CUSTOM}


def _custom(file: MujocoFile, name: str) -> Floats:
    places = {one.name: [i] for i, one in reversed(list(enumerate(file.coordinates)))}
    return custom_numbers(file, name, len(file.coordinates), places)


def custom_numbers(file: MujocoFile, name: str, count: int, places: dict[str, list[int]]) -> Floats:
    """Return a number that MJCF has no word for, of so many velocities.

    Parameters
    ----------
    file : MujocoFile
        The file.
    name : str
        What the number is called.
    count : int
        How many velocities there are.
    places : dict of str to list of int
        Velocities of the joints that move, by name.

    Raises
    ------
    RobotError
        If what the file tells is no number, or one too small.

    Warns
    -----
    RobotWarning
        Of numbers of joints that the file does not have.
    """
    known = {file.given_name("joint", joint) for joint in range(file.model.njnt)}
    number = PROPERTIES[name]
    values = np.full(count, number.default, dtype=np.float64)
    for joint, value in _written_numbers(file, name):
        if joint not in places:
            if not file.is_urdf and joint not in known:  # fixed joints may have limits too
                warn(f"{file.source}: {name}:{joint}: there is no joint of that name.")
            continue
        if not value >= number.least:
            words = name.replace("_", " ")
            raise file.error(
                f"the {words} of joint {joint!r} is {value}, not a number >= {number.least:g}."
            )
        # Exporters write 0 for the limit that nobody told them.
        none = number.infinite and not 0.0 < value < LARGEST_NUMBER
        values[places[joint]] = math.inf if none else value
    return values


def limits(values: Floats) -> Floats:
    """Limits, of which a huge one is none: formats want numbers for both sides of a range."""
    return np.where(np.abs(values) >= LARGEST_NUMBER, np.copysign(np.inf, values), values)


def _written_numbers(file: MujocoFile, name: str) -> Iterator[tuple[str, float]]:
    """Yield the joints of which a file says a number by custom data, and that number."""
    if file.is_urdf and name == "speed_limit":
        for joint in file.xml.iterfind("joint"):
            for limit in joint.iterfind("limit"):
                yield joint.get("name", ""), _number(limit.get("velocity", "0"))
    for joint_name, (value, *_) in file.custom(name):
        if joint_name:
            yield joint_name, float(value)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
