"""A robot as URDF, which holds most of it."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from heelstrike.robot.assembly import LARGEST_NUMBER
from heelstrike.robot.files.saving.links import (
    effort,
    kind_of_joint,
    names_of_links,
    warn_of_loss,
    zero_pose,
)
from heelstrike.robot.files.saving.text import (
    POINT_RADIUS,
    SMALLEST_INERTIA,
    STANDARD_GRAVITY,
    joints_with,
    number,
    numbers,
    point,
)
from heelstrike.robot.robot import Robot

HELD = (
    *("mass", "center_of_mass", "inertia", "reference", "damping", "dry_friction", "speed_limit"),
    "rest",  # of a spring, which is named
    "armature",  # of motors
)
"""Numbers that URDF has."""


def urdf(robot: Robot) -> Element:
    """Return a robot as a URDF document; warn of what the format cannot hold.

    A link frame is that of the model; the zero of a coordinate is URDF's own. A floating base
    depends on the link ``world`` by its three joints, with massless links between them.
    """
    model = robot.model
    idle = np.setdiff1d(joints_with(robot, "armature"), model.actuator_joint)
    curved = np.any(model.coupling_polynomial[:, 2:], axis=1) | (model.coupling_joint[:, 1] < 0)
    lost = {
        "armature (motor inertia)": idle,
        "couplings that are not straight": model.coupling_joint[curved, 0],
    }
    warn_of_loss(robot, "a URDF file", HELD, lost)
    root = Element("robot", name=robot.name)
    if tuple(model.gravity) != STANDARD_GRAVITY:  # URDF has none; MuJoCo's extension does
        option = SubElement(SubElement(root, "mujoco"), "option")
        option.set("gravity", numbers((model.gravity[0], 0.0, model.gravity[1])))
    names = names_of_links(robot)
    SubElement(root, "link", name=names[0])
    for link, name in enumerate(names[1:]):
        _write_urdf_link(robot, link, SubElement(root, "link", name=name))
    for joint in range(robot.nv):
        parent, child = names[model.parent[joint] + 1], names[joint + 1]
        _write_urdf_joint(robot, joint, parent, child, root)
    _write_transmissions(robot, root)
    return root


def _write_urdf_link(robot: Robot, link: int, element: Element) -> None:
    model = robot.model
    contacts = np.flatnonzero(model.contact_link == link)
    # Without <inertial>, parsers may weigh the shapes.
    if model.mass[link] or model.inertia[link] or len(contacts):
        inertial = SubElement(element, "inertial")
        SubElement(inertial, "origin", xyz=point(model.center_of_mass[link]), rpy="0 0 0")
        SubElement(inertial, "mass", value=number(model.mass[link]))
        about = number(max(float(model.inertia[link]), SMALLEST_INERTIA))
        none = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        SubElement(inertial, "inertia", none | dict.fromkeys(("ixx", "iyy", "izz"), about))
    for contact in contacts:
        for tag in ("visual", "collision"):
            shape = SubElement(element, tag)
            SubElement(shape, "origin", xyz=point(model.contact_position[contact]), rpy="0 0 0")
            radius = max(float(model.contact_radius[contact]), POINT_RADIUS)
            SubElement(SubElement(shape, "geometry"), "sphere", radius=number(radius))


def _write_urdf_joint(robot: Robot, joint: int, parent: str, child: str, root: Element) -> None:
    model = robot.model
    turn, *along = model.axis[joint]
    kind = kind_of_joint(robot, joint)
    element = SubElement(root, "joint", name=robot.joint_names[joint], type=kind)
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)
    place, pitch = zero_pose(robot, joint)
    SubElement(element, "origin", xyz=point(place), rpy=numbers((0.0, pitch, 0.0)))
    SubElement(element, "axis", xyz=numbers((0.0, turn, 0.0)) if turn else point(along))
    limit = {
        "effort": number(effort(robot, joint)),
        "velocity": number(min(float(model.speed_limit[joint]), LARGEST_NUMBER)),
    }
    if kind != "continuous":
        limit["lower"] = number(max(float(model.lower[joint]), -LARGEST_NUMBER))
        limit["upper"] = number(min(float(model.upper[joint]), LARGEST_NUMBER))
    SubElement(element, "limit", limit)
    SubElement(
        element,
        "dynamics",
        damping=number(model.damping[joint]),
        friction=number(model.dry_friction[joint]),
    )
    for coupling in np.flatnonzero(model.coupling_joint[:, 0] == joint):
        leader = model.coupling_joint[coupling, 1]
        offset, slope, *curved = model.coupling_polynomial[coupling]
        if leader >= 0 and not any(curved):
            # URDF couples the coordinates themselves, not their ways from the reference.
            offset += model.reference[joint] - slope * model.reference[leader]
            SubElement(
                element,
                "mimic",
                joint=robot.joint_names[leader],
                multiplier=number(slope),
                offset=number(offset),
            )


def _write_transmissions(robot: Robot, root: Element) -> None:
    """Write the inertia of motors, behind a gear of 1; who gives one motor so gives all."""
    model = robot.model
    if not model.armature[model.actuator_joint].any():
        return
    for actuator, joint in enumerate(model.actuator_joint):
        name = robot.actuator_names[actuator]
        gear = SubElement(root, "transmission", name=name)
        SubElement(gear, "type").text = "transmission_interface/SimpleTransmission"
        driven = SubElement(gear, "joint", name=robot.joint_names[joint])
        SubElement(driven, "hardwareInterface").text = "hardware_interface/EffortJointInterface"
        motor = SubElement(gear, "actuator", name=name)
        SubElement(motor, "mechanicalReduction").text = "1"
        SubElement(motor, "motorInertia").text = number(model.armature[joint])
