"""A robot as SDF, which holds most of it."""

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
    STANDARD_GRAVITY,
    number,
    numbers,
    point,
    unique,
)
from heelstrike.robot.model import PROPERTIES
from heelstrike.robot.robot import Robot

LOST = ("stall_torque", "no_load_speed", "winding_resistance")
"""Numbers that SDF has not."""

VERSION = "1.7"
DRAKE = "xmlns:drake"
"""Prefix of the one number that SDF has no word for: the inertia of a motor."""


def sdf(robot: Robot) -> Element:
    """Return a robot as an SDF document; warn of what the format cannot hold.

    A link frame is that of the model; the zero of a coordinate is where the links are drawn. A
    floating base is attached to the world by its three joints, with massless links between them.
    """
    model = robot.model
    held = tuple(name for name in PROPERTIES if name not in LOST)
    warn_of_loss(robot, "an SDF file", held, {"couplings": model.coupling_joint[:, 0]})
    root = Element("sdf", {"version": VERSION, DRAKE: "drake.mit.edu"})
    holder = root
    if tuple(model.gravity) != STANDARD_GRAVITY:  # which is the world's
        holder = SubElement(root, "world", name="world")
        SubElement(holder, "gravity").text = numbers((model.gravity[0], 0.0, model.gravity[1]))
    element = SubElement(holder, "model", name=robot.name)
    # Links are not called as joints are.
    names = unique([*robot.joint_names, *names_of_links(robot)])[robot.nv :]
    for link, name in enumerate(names[1:]):
        parent = names[model.parent[link] + 1]
        _write_link(robot, link, parent, SubElement(element, "link", name=name))
    for joint in range(robot.nv):
        parent, child = names[model.parent[joint] + 1], names[joint + 1]
        _write_joint(robot, joint, parent, child, element)
    return root


def _write_link(robot: Robot, link: int, parent: str, element: Element) -> None:
    model = robot.model
    (x, z), pitch = zero_pose(robot, link)
    base = {} if parent == "world" else {"relative_to": parent}
    SubElement(element, "pose", base).text = numbers((x, 0.0, z, 0.0, pitch, 0.0))
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "pose").text = point(model.center_of_mass[link]) + " 0 0 0"
    SubElement(inertial, "mass").text = number(model.mass[link])
    tensor = SubElement(inertial, "inertia")
    for moment in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
        about = model.inertia[link] if moment in ("ixx", "iyy", "izz") else 0.0
        SubElement(tensor, moment).text = number(about)
    points = unique(robot.contact_names)
    for contact in np.flatnonzero(model.contact_link == link):
        for tag in ("visual", "collision"):
            shape = SubElement(element, tag, name=points[contact])
            SubElement(shape, "pose").text = point(model.contact_position[contact]) + " 0 0 0"
            sphere = SubElement(SubElement(shape, "geometry"), "sphere")
            radius = max(float(model.contact_radius[contact]), POINT_RADIUS)
            SubElement(sphere, "radius").text = number(radius)
        if robot.contact_friction:
            ode = SubElement(SubElement(SubElement(shape, "surface"), "friction"), "ode")
            SubElement(ode, "mu").text = number(robot.contact_friction[contact])


def _write_joint(robot: Robot, joint: int, parent: str, child: str, root: Element) -> None:
    model = robot.model
    name, kind = robot.joint_names[joint], kind_of_joint(robot, joint)
    element = SubElement(root, "joint", name=name, type=kind)
    SubElement(element, "parent").text = parent
    SubElement(element, "child").text = child
    axis = SubElement(element, "axis")
    turn, *along = model.axis[joint]
    SubElement(axis, "xyz").text = numbers((0.0, turn, 0.0)) if turn else point(along)
    limit = {"effort": effort(robot, joint)}
    if kind != "continuous":
        limit["lower"] = max(float(model.lower[joint]), -LARGEST_NUMBER)
        limit["upper"] = min(float(model.upper[joint]), LARGEST_NUMBER)
    if np.isfinite(model.speed_limit[joint]):
        limit["velocity"] = float(model.speed_limit[joint])
    dynamics = {
        "damping": model.damping[joint],
        "friction": model.dry_friction[joint],
        "spring_reference": model.rest[joint],
        "spring_stiffness": model.stiffness[joint],
    }
    for tag, values in (("limit", limit), ("dynamics", dynamics)):
        holder = SubElement(axis, tag)
        for each, value in values.items():
            SubElement(holder, each).text = number(value)
    if model.armature[joint]:
        SubElement(element, "drake:rotor_inertia").text = number(model.armature[joint])
        SubElement(element, "drake:gear_ratio").text = "1"
