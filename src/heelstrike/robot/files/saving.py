"""Robot files written: MJCF, which holds everything, and URDF, which does not."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from heelstrike.errors import RobotError, WriteError
from heelstrike.robot.assembly import LARGEST_NUMBER, link_origins
from heelstrike.robot.files.joint_numbers import ATTRIBUTES, CUSTOM
from heelstrike.robot.files.shapes import COUNT, PREFIX
from heelstrike.robot.model import PROPERTIES, Floats, Integers, label
from heelstrike.robot.robot import Robot
from heelstrike.robot.warning import warn
from heelstrike.whole_file import write_whole

# What the formats want to be positive, where ours is zero.
POINT_RADIUS = 1e-12
SMALLEST_INERTIA = 2e-15

SAME_PLACE = 1e-6  # metres; nearer joints need no line between them
STANDARD_GRAVITY = (0.0, -9.81)


def save_robot(robot: Robot, path: str | os.PathLike[str]) -> Path:
    """Write a robot as MJCF (.xml, .mjcf) or URDF (.urdf); see :meth:`Robot.save`."""
    file = Path(path)
    kind = file.suffix.lower()
    if kind in (".xml", ".mjcf"):
        root = mjcf(robot)
    elif kind == ".urdf":
        root = urdf(robot)
    else:
        raise RobotError(
            f"{file}: a robot is saved as MJCF (.xml) or URDF (.urdf), "
            f"not as {kind or 'nothing'!r}."
        )
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode") + "\n"
    try:
        ElementTree.fromstring(text)  # written by ourselves
    except ElementTree.ParseError:
        raise RobotError(
            f"{file}: a name of robot {robot.name!r} has a character that XML cannot hold."
        ) from None
    try:
        return write_whole(file, text)
    except WriteError as error:
        raise RobotError(str(error)) from error


def mjcf(robot: Robot) -> Element:
    """Return a robot as an MJCF document, which MuJoCo runs as it is, with a floor."""
    model = robot.model
    root = Element("mujoco", model=robot.name)
    SubElement(root, "compiler", angle="radian", autolimits="true")
    SubElement(root, "option", gravity=_numbers((model.gravity[0], 0.0, model.gravity[1])))
    custom = [(name, joint) for name in CUSTOM for joint in _given(robot, name)]
    holder = SubElement(root, "custom")
    for name, joint in custom:
        data = _number(getattr(model, name)[joint])
        SubElement(holder, "numeric", name=f"{name}:{robot.joint_names[joint]}", data=data)
    SubElement(holder, "numeric", name=COUNT, data=str(len(robot.outlines)))
    for count, outline in enumerate(robot.outlines):
        name = f"{PREFIX}:{count}:{robot.joint_names[outline.link]}"
        data = _numbers((outline.radius, *outline.corners.ravel()))
        SubElement(holder, "numeric", name=name, data=data)
    default = SubElement(root, "default")
    SubElement(default, "geom", contype="0", conaffinity="0", rgba="0.55 0.60 0.68 1")
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos="0 -3 4", dir="0 0.6 -0.8")
    floor = {"name": "floor", "type": "plane", "size": "20 2 0.1", "conaffinity": "1"}
    SubElement(world, "geom", floor | {"rgba": "0.85 0.85 0.82 1"})
    _write_bodies(robot, world)
    if robot.nu:
        actuators = SubElement(root, "actuator")
        for i, joint in enumerate(model.actuator_joint):
            motor = {"name": robot.actuator_names[i], "joint": robot.joint_names[joint]}
            low, high = model.torque_lower[i], model.torque_upper[i]
            SubElement(actuators, "motor", motor | _range("ctrlrange", low, high))
    return root


def _write_bodies(robot: Robot, world: Element) -> None:
    """Write the tree. A massless link with one child is a joint more on the body of that child."""
    model = robot.model
    origin = link_origins(model)
    last = body_links(robot)
    body_of: dict[int, Element] = {}
    names = _unique(robot.link_names[link] for link in last)
    label = dict(zip(last, names, strict=True))
    for link in last:
        joints = [link]
        while (above := int(model.parent[joints[0]])) >= 0 and above not in label:
            joints.insert(0, above)
        base = origin[above] if above >= 0 else np.zeros(2)
        body = SubElement(
            body_of[above] if above >= 0 else world,
            "body",
            name=label[link],
            pos=_place(origin[link] - base),
        )
        body_of[link] = body
        for joint in joints:
            _write_joint(robot, joint, origin[joint] - origin[link], body)
        _write_inertia(robot, link, body)
        _write_shapes(robot, link, origin, body)


def body_links(robot: Robot) -> list[int]:
    """Links that are bodies of their own, in order; the others only carry a joint more."""
    model = robot.model
    children = np.bincount(model.parent[model.parent >= 0], minlength=robot.nv)
    merged = (model.mass == 0.0) & (model.inertia == 0.0) & (children == 1)
    merged[model.contact_link] = False
    return np.flatnonzero(~merged).tolist()


def _write_joint(robot: Robot, joint: int, place: Floats, body: Element) -> None:
    model = robot.model
    turn, x, z = model.axis[joint]
    given = {
        "name": robot.joint_names[joint],
        "type": "hinge" if turn else "slide",
        "axis": _numbers((0.0, turn, 0.0)) if turn else _place((x, z)),
    }
    if np.any(place):
        given["pos"] = _place(place)
    for name, (attribute, _, _) in ATTRIBUTES.items():
        value = getattr(model, name)[joint]
        if value != PROPERTIES[name].default:
            given[attribute] = _number(value)
    SubElement(
        body, "joint", given | _range("range", float(model.lower[joint]), float(model.upper[joint]))
    )


def _write_inertia(robot: Robot, link: int, body: Element) -> None:
    model = robot.model
    about_y = _number(max(float(model.inertia[link]), SMALLEST_INERTIA))
    SubElement(
        body,
        "inertial",
        pos=_place(model.center_of_mass[link]),
        mass=_number(max(float(model.mass[link]), SMALLEST_INERTIA)),
        diaginertia=f"{about_y} {about_y} {about_y}",
    )


def _write_shapes(robot: Robot, link: int, origin: Floats, body: Element) -> None:
    """Contact points as spheres, and bones that only show where the links are."""
    model = robot.model
    for child in np.flatnonzero(model.parent == link):
        reach = origin[child] - origin[link]
        if np.hypot(*reach) > SAME_PLACE:
            bone = {"type": "capsule", "size": "0.02", "fromto": "0 0 0 " + _place(reach)}
            SubElement(body, "geom", bone)
    named = len(set(robot.contact_names)) == robot.nc
    for i in np.flatnonzero(model.contact_link == link):
        geom = {"name": robot.contact_names[i]} if named else {}
        geom |= {
            "type": "sphere",
            "size": _number(max(float(model.contact_radius[i]), POINT_RADIUS)),
            "pos": _place(model.contact_position[i]),
            "contype": "1",
        }
        if robot.contact_friction:
            geom["friction"] = _number(robot.contact_friction[i])
        SubElement(body, "geom", geom)


def urdf(robot: Robot) -> Element:
    """Return a robot as a URDF document; warn of what the format cannot hold.

    A link frame is that of the model; the zero of a coordinate is URDF's own. A floating base
    hangs on the link ``world`` by its three joints, with massless links between them.
    """
    model = robot.model
    _warn_of_what_urdf_cannot_hold(robot)
    root = Element("robot", name=robot.name)
    if tuple(model.gravity) != STANDARD_GRAVITY:  # URDF has none; MuJoCo's extension does
        option = SubElement(SubElement(root, "mujoco"), "option")
        option.set("gravity", _numbers((model.gravity[0], 0.0, model.gravity[1])))
    last = set(body_links(robot))
    names = _unique(
        [
            "world",
            *(
                name if link in last else f"{name}_{robot.joint_names[link]}"
                for link, name in enumerate(robot.link_names)
            ),
        ]
    )
    SubElement(root, "link", name=names[0])
    for link, name in enumerate(names[1:]):
        _write_urdf_link(robot, link, SubElement(root, "link", name=name))
    for joint in range(robot.nv):
        parent, child = names[model.parent[joint] + 1], names[joint + 1]
        _write_urdf_joint(robot, joint, parent, child, root)
    return root


def _write_urdf_link(robot: Robot, link: int, element: Element) -> None:
    model = robot.model
    contacts = np.flatnonzero(model.contact_link == link)
    # Without <inertial>, parsers may weigh the shapes.
    if model.mass[link] or model.inertia[link] or len(contacts):
        inertial = SubElement(element, "inertial")
        SubElement(inertial, "origin", xyz=_place(model.center_of_mass[link]), rpy="0 0 0")
        SubElement(inertial, "mass", value=_number(model.mass[link]))
        about = _number(max(float(model.inertia[link]), SMALLEST_INERTIA))
        none = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        SubElement(inertial, "inertia", none | dict.fromkeys(("ixx", "iyy", "izz"), about))
    for contact in contacts:
        for tag in ("visual", "collision"):
            shape = SubElement(element, tag)
            SubElement(shape, "origin", xyz=_place(model.contact_position[contact]), rpy="0 0 0")
            radius = max(float(model.contact_radius[contact]), POINT_RADIUS)
            SubElement(SubElement(shape, "geometry"), "sphere", radius=_number(radius))


def _write_urdf_joint(robot: Robot, joint: int, parent: str, child: str, root: Element) -> None:
    model = robot.model
    turn, *along = model.axis[joint]
    back = -float(model.reference[joint])
    low, high = float(model.lower[joint]), float(model.upper[joint])
    endless = np.isinf(low) and np.isinf(high)
    kind = ("continuous" if endless else "revolute") if turn else "prismatic"
    element = SubElement(root, "joint", name=robot.joint_names[joint], type=kind)
    SubElement(element, "parent", link=parent)
    SubElement(element, "child", link=child)
    place = model.offset[joint] + np.array(along) * back
    SubElement(element, "origin", xyz=_place(place), rpy=_numbers((0.0, turn * back, 0.0)))
    SubElement(element, "axis", xyz=_numbers((0.0, turn, 0.0)) if turn else _place(along))
    driven = np.flatnonzero(model.actuator_joint == joint)
    effort = 0.0
    if len(driven):
        sides = (model.torque_lower[driven[0]], model.torque_upper[driven[0]])
        effort = min(max(abs(float(side)) for side in sides), LARGEST_NUMBER)
    limit = {
        "effort": _number(effort),
        "velocity": _number(min(float(model.speed_limit[joint]), LARGEST_NUMBER)),
    }
    if kind != "continuous":
        limit["lower"] = _number(max(low, -LARGEST_NUMBER))
        limit["upper"] = _number(min(high, LARGEST_NUMBER))
    SubElement(element, "limit", limit)
    SubElement(
        element,
        "dynamics",
        damping=_number(model.damping[joint]),
        friction=_number(model.dry_friction[joint]),
    )


_URDF = (
    "mass", "center_of_mass", "inertia", "reference", "damping", "dry_friction", "speed_limit",
    "rest",  # of a spring, which is named
)  # fmt: skip
"""Numbers that URDF has."""
_WITHOUT = {"stiffness": "springs", "armature": "armature (motor inertia)"}


def _warn_of_what_urdf_cannot_hold(robot: Robot) -> None:
    model = robot.model
    one_sided = np.flatnonzero(model.torque_lower != -model.torque_upper)
    lost = {
        _WITHOUT.get(name, label(name)): _given(robot, name)
        for name in PROPERTIES
        if name not in _URDF
    } | {
        "different torque limits of the two senses (the larger stays)": model.actuator_joint[
            one_sided
        ],
    }
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
    if said:
        warn(
            f"{robot.name}: a URDF file cannot hold everything this robot has. Left out: "
            f"{'; '.join(said)}. MJCF (.xml) holds all of it."
        )


def _unique(names: Iterable[str]) -> list[str]:
    """Names with numbers added to those that were there before."""
    taken: set[str] = set()
    result = []
    for name in names:
        new, count = name, 1
        while new in taken:
            count += 1
            new = f"{name}_{count}"
        taken.add(new)
        result.append(new)
    return result


def _range(name: str, low: float, high: float) -> dict[str, str]:
    """Range as an attribute, nothing if it has no ends; a huge number stands for one missing."""
    if np.isinf(low) and np.isinf(high):
        return {}
    return {name: _numbers((max(low, -LARGEST_NUMBER), min(high, LARGEST_NUMBER)))}


def _number(value: float) -> str:
    """All digits of a number."""
    return repr(float(value) + 0.0)  # without the sign of zero


def _given(robot: Robot, name: str) -> Integers:
    """Return the joints that have a number which is not the default."""
    return np.flatnonzero(getattr(robot.model, name) != PROPERTIES[name].default)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(_number(value) for value in values)


def _place(xz: Iterable[float]) -> str:
    x, z = xz
    return _numbers((x, 0.0, z))
