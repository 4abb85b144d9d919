"""What formats of links and joints share: names, zero configuration, limits, what they lose."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.assembly import LARGEST_NUMBER
from heelstrike.robot.files.saving.mjcf import body_links
from heelstrike.robot.files.saving.text import joints_with, unique
from heelstrike.robot.model import NUMBERS, PROPERTIES, SCALES, Floats, Integers, label
from heelstrike.robot.robot import Robot
from heelstrike.robot.warning import warn

_CALLED = {"stiffness": "springs", "armature": "armature (motor inertia)"}


def names_of_links(robot: Robot) -> list[str]:
    """Return names that differ, for the world and every link."""
    last = set(body_links(robot))
    names = [
        name if link in last else f"{name}_{robot.joint_names[link]}"
        for link, name in enumerate(robot.link_names)
    ]
    return unique(["world", *names])


def zero_pose(robot: Robot, joint: int) -> tuple[Floats, float]:
    """Return where a link is in its parent where its coordinate is 0: place and turn about y."""
    model = robot.model
    turn, *along = model.axis[joint]
    back = -float(model.reference[joint])
    return model.offset[joint] + np.array(along) * back, float(turn) * back


def kind_of_joint(robot: Robot, joint: int) -> str:
    """Return what both formats call a joint."""
    model = robot.model
    if not model.axis[joint, 0]:
        return "prismatic"
    endless = np.isinf(model.lower[joint]) and np.isinf(model.upper[joint])
    return "continuous" if endless else "revolute"


def effort(robot: Robot, joint: int) -> float:
    """Return the larger torque limit of a motor, 0 where there is no motor."""
    model = robot.model
    sides = [
        max(abs(float(model.torque_lower[motor])), abs(float(model.torque_upper[motor])))
        for motor in np.flatnonzero(model.actuator_joint == joint)
    ]
    return min(max(sides, default=0.0), LARGEST_NUMBER)


def warn_of_loss(
    robot: Robot, kind: str, held: tuple[str, ...], more: dict[str, Integers] | None = None
) -> None:
    """Warn of the numbers of a robot that a format has no word for, joint by joint."""
    model = robot.model
    one_sided = np.flatnonzero(model.torque_lower != -model.torque_upper)
    lost = {
        _CALLED.get(name, label(name)): joints_with(robot, name)
        for name in PROPERTIES
        if name not in held
    }
    lost |= more or {}
    lost["different torque limits of the two senses (the larger stays)"] = model.actuator_joint[
        one_sided
    ]
    said = [
        f"{what} of {', '.join(robot.joint_names[joint] for joint in joints)}"
        for what, joints in lost.items()
        if len(joints)
    ]
    seen = zip(
        model.contact_link, map(tuple, model.contact_position), model.contact_radius, strict=True
    )
    discs = set(seen)  # which are spheres there
    if any((o.link, *map(tuple, o.corners), o.radius) not in discs for o in robot.outlines):
        said.append("outlines, for pictures")
    for name in SCALES:
        scaled = np.flatnonzero(getattr(model, name) != NUMBERS[name].default)
        if scaled.size:
            said.append(f"{label(name)} of {', '.join(robot.contact_names[i] for i in scaled)}")
    if model.latches:
        said.append(f"latches of {', '.join(robot.latch_names)}")
    if model.brakes:
        said.append(f"brakes of {', '.join(robot.brake_names)}")
    if model.loops:
        said.append(f"closed loops ({', '.join(robot.loop_names)})")
    if said:
        warn(
            f"{robot.name}: {kind} cannot hold everything this robot has. Left out: "
            f"{'; '.join(said)}. MJCF (.xml) holds all of it."
        )
