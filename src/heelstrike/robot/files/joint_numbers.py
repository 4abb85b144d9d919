"""Numbers of joints in MJCF: as attributes, or, where MJCF has no word for them, as custom data.

``<custom><numeric name="speed_limit:JOINT" data="…"/></custom>`` holds the speed limit of a joint,
and likewise every number of :class:`~heelstrike.robot.model.Model` without an attribute.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.model import PROPERTIES, Floats, Number
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

LARGEST_NUMBER = 1e10
"""Files that must give a number but mean none give one like this."""


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
    names = [one.name for one in file.coordinates]
    index = {joint: place for place, joint in reversed(list(enumerate(names)))}
    known = {file.given_name("joint", joint) for joint in range(file.model.njnt)}
    number = PROPERTIES[name]
    values = np.full(len(names), number.default, dtype=np.float64)
    for joint, value in written_numbers(file, name):
        if joint not in index:
            if not file.is_urdf and joint not in known:  # fixed joints may have limits too
                warn(f"{file.source}: {name}:{joint}: there is no joint of that name.")
            continue
        values[index[joint]] = told_number(file, name, number, joint, value)
    return values


def told_number(file: MujocoFile, name: str, number: Number, joint: str, value: float) -> float:
    """Return a number of a joint as its file means it, or refuse what it cannot be."""
    if not value >= number.least:
        words = name.replace("_", " ")
        raise file.error(
            f"the {words} of joint {joint!r} is {value}, not a number >= {number.least:g}."
        )
    # Exporters write 0 for the limit that nobody told them.
    none = number.infinite and not 0.0 < value < LARGEST_NUMBER
    return math.inf if none else value


def written_numbers(file: MujocoFile, name: str) -> Iterator[tuple[str, float]]:
    """Yield the joints of which a file says a number by custom data, and that number."""
    if file.is_urdf and name == "speed_limit":
        for joint in file.xml.iterfind("joint"):
            for limit in joint.iterfind("limit"):
                yield joint.get("name", ""), _number(limit.get("velocity", "0"))
    for numeric in range(file.model.nnumeric):
        held, _, joint_name = file.given_name("numeric", numeric).partition(":")
        if held == name and joint_name:
            yield joint_name, float(file.model.numeric_data[file.model.numeric_adr[numeric]])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
