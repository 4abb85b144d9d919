"""What drives the joints of a URDF: effort limits, ``<transmission>`` and ``<ros2_control>``.

URDF itself has no motors. A joint with an effort limit is driven; where a file says by
transmissions or ``ros2_control`` which joints are, these are, and no others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import field
from xml.etree.ElementTree import Element

from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass

REDUCTION = ("mechanicalReduction", "mechanical_reduction", "drake:gear_ratio")
INERTIA = ("motorInertia", "rotorInertia", "motor_inertia", "rotor_inertia", "drake:rotor_inertia")
EFFORT = "effort"
LARGEST = 1e10  # an effort limit that stands for none


@dataclass
class Drive:
    """The motor of a joint."""

    commands: set[str] = field(default_factory=set)
    """What it is commanded in: effort, position, velocity; empty if the file does not say."""
    armature: float = 0.0
    """Inertia of its motors as the joint feels it, ``reduction**2 * inertia`` (kg m²)."""
    motors: int = 0
    """How many transmissions drive the joint."""
    lower: float = -math.inf
    upper: float = math.inf
    """lower, upper: Limits of its torque at the joint (N m, N) by ``ros2_control``."""


def drives_of(robot: Element, label: str) -> dict[str, Drive]:
    """Return the drives that a URDF names, by joint; nothing if it names none.

    Parameters
    ----------
    robot : Element
        The root of the file, with its texts.
    label : str
        What to call it in messages.

    Raises
    ------
    RobotError
        If a reduction, inertia or limit is no number, or no possible one.
    """
    drives: dict[str, Drive] = {}
    for control in robot.iterfind("ros2_control"):
        for joint in control.iterfind("joint"):
            _add_commands(drives, joint, label)
    gears = [*robot.iterfind("transmission"), *robot.iterfind("ros2_control/transmission")]
    for gear in gears:
        joints = [joint.get("name", "") for joint in gear.iterfind("joint")]
        for name in joints:
            drive = drives.setdefault(name, Drive())
            drive.commands |= set(_interfaces(gear))
            if len(joints) == 1:  # several joints and motors share what they reflect
                _add_gear(drive, gear, label)
    return drives


def _add_commands(drives: dict[str, Drive], joint: Element, label: str) -> None:
    for command in joint.iterfind("command_interface"):
        name = joint.get("name", "")
        drive = drives.setdefault(name, Drive())
        kind = command.get("name", "")
        drive.commands.add(kind)
        for limit in command.iterfind("param"):
            if kind == EFFORT and limit.get("name") in ("min", "max"):
                value = _number(limit, label)
                if limit.get("name") == "min":
                    drive.lower = value
                else:
                    drive.upper = value


def _add_gear(drive: Drive, gear: Element, label: str) -> None:
    reductions = {_number(each, label) for each in gear.iter() if each.tag in REDUCTION}
    inertias = {_number(each, label) for each in gear.iter() if each.tag in INERTIA}
    for values, what in ((reductions, "reductions"), (inertias, "motor inertias")):
        if len(values) > 1:
            raise RobotError(f"{_where(gear, label)} has several {what}. Keep one.")
    reduction, inertia = next(iter(reductions), 1.0), next(iter(inertias), 0.0)
    if reduction == 0.0:
        raise RobotError(f"{_where(gear, label)} has the reduction 0, with which nothing moves.")
    if inertia < 0.0:
        raise RobotError(f"{_where(gear, label)} has a negative motor inertia.")
    drive.armature += reduction**2 * inertia
    drive.motors += 1


def _interfaces(gear: Element) -> Iterator[str]:
    """What a transmission is commanded in, by words like EffortJointInterface."""
    for each in gear.iter("hardwareInterface"):
        for kind in (EFFORT, "position", "velocity"):
            if kind in (each.text or "").lower():
                yield kind


def _number(element: Element, label: str) -> float:
    text = (element.get("value") or element.text or "").strip()
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in text or not text.isascii():
        raise RobotError(
            f"{label}: line {getattr(element, 'line', 0)}: <{element.tag}> is {text[:60]!r}, where "
            "a finite number must be."
        )
    return value


def _where(gear: Element, label: str) -> str:
    return f"{label}: line {getattr(gear, 'line', 0)}: transmission {gear.get('name', '')!r}"
