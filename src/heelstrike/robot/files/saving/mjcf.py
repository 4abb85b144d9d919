"""A robot as MJCF, which holds all of it."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from heelstrike.robot.assembly import link_origins
from heelstrike.robot.files.joint_numbers import ATTRIBUTES, CUSTOM
from heelstrike.robot.files.links import BRAKE, LATCH
from heelstrike.robot.files.saving.text import (
    POINT_RADIUS,
    SMALLEST_INERTIA,
    joints_with,
    number,
    numbers,
    point,
    range_of,
    unique,
)
from heelstrike.robot.files.shapes import COUNT, PREFIX
from heelstrike.robot.model import NUMBERS, PROPERTIES, SCALES, Floats
from heelstrike.robot.robot import Robot
from heelstrike.tolerances import NO_BONE


def mjcf(robot: Robot) -> Element:
    """Return a robot as an MJCF document, which MuJoCo runs as it is, with a floor."""
    model = robot.model
    root = Element("mujoco", model=robot.name)
    SubElement(root, "compiler", angle="radian", autolimits="true")
    SubElement(root, "option", gravity=numbers((model.gravity[0], 0.0, model.gravity[1])))
    custom = [(name, joint) for name in CUSTOM for joint in joints_with(robot, name)]
    holder = SubElement(root, "custom")
    for name, joint in custom:
        data = number(getattr(model, name)[joint])
        SubElement(holder, "numeric", name=f"{name}:{robot.joint_names[joint]}", data=data)
    body_name = names_of_bodies(robot)
    for joint, side, release in zip(
        model.latch_joint, model.latch_side, model.latch_release, strict=True
    ):
        name = f"{LATCH}:{robot.joint_names[joint]}"
        name += f":{body_name[release]}" if release >= 0 else ""
        SubElement(holder, "numeric", name=name, data=str(side))
    for name, limit in zip(robot.brake_names, model.brake_limit, strict=True):
        data = "1" if math.isinf(limit) else f"1 {number(limit)}"
        SubElement(holder, "numeric", name=f"{BRAKE}:{name}", data=data)
    for name in SCALES:
        for point_name, value in zip(_geom_names(robot), getattr(model, name), strict=True):
            if value != NUMBERS[name].default:
                told = f"{name}:{point_name}"
                SubElement(holder, "numeric", name=told, data=number(value))
    SubElement(holder, "numeric", name=COUNT, data=str(len(robot.outlines)))
    for count, outline in enumerate(robot.outlines):
        name = f"{PREFIX}:{count}:{robot.joint_names[outline.link]}"
        data = numbers((outline.radius, *outline.corners.ravel()))
        SubElement(holder, "numeric", name=name, data=data)
    default = SubElement(root, "default")
    SubElement(default, "geom", contype="0", conaffinity="0", rgba="0.55 0.60 0.68 1")
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos="0 -3 4", dir="0 0.6 -0.8")
    floor = {"name": "floor", "type": "plane", "size": "20 2 0.1", "conaffinity": "1"}
    SubElement(world, "geom", floor | {"rgba": "0.85 0.85 0.82 1"})
    _write_sites(robot, -1, world)
    _write_bodies(robot, world)
    if robot.nu:
        actuators = SubElement(root, "actuator")
        for i, joint in enumerate(model.actuator_joint):
            motor = {"name": robot.actuator_names[i], "joint": robot.joint_names[joint]}
            low, high = model.torque_lower[i], model.torque_upper[i]
            SubElement(actuators, "motor", motor | range_of("ctrlrange", low, high))
    if model.loops or model.couplings:
        _write_loops(robot, SubElement(root, "equality"))
    return root


def _write_bodies(robot: Robot, world: Element) -> None:
    """Write the tree. A massless link with one child is a joint more on the body of that child."""
    model = robot.model
    origin = link_origins(model)
    label = names_of_bodies(robot)
    body_of: dict[int, Element] = {}
    for link in label:
        joints = [link]
        while (above := int(model.parent[joints[0]])) >= 0 and above not in label:
            joints.insert(0, above)
        base = origin[above] if above >= 0 else np.zeros(2)
        body = SubElement(
            body_of[above] if above >= 0 else world,
            "body",
            name=label[link],
            pos=point(origin[link] - base),
        )
        body_of[link] = body
        for joint in joints:
            _write_joint(robot, joint, origin[joint] - origin[link], body)
        _write_inertia(robot, link, body)
        _write_shapes(robot, link, origin, body)
        _write_sites(robot, link, body)


def _write_loops(robot: Robot, equality: Element) -> None:
    """Write loops as connected sites, and couplings of joints."""
    model = robot.model
    for loop in range(model.loops):
        ends = {f"site{k + 1}": loop_site(loop, k) for k in range(2)}
        SubElement(equality, "connect", ends)
    for (joint, leader), factors in zip(
        model.coupling_joint, model.coupling_polynomial, strict=True
    ):
        joints = {"joint1": robot.joint_names[joint]}
        joints |= {"joint2": robot.joint_names[leader]} if leader >= 0 else {}
        SubElement(equality, "joint", joints, polycoef=numbers(factors))


def loop_site(loop: int, end: int) -> str:
    """Name of the site at an end of a loop."""
    return f"loop_{loop}_{'ab'[end]}"


def _write_sites(robot: Robot, link: int, body: Element) -> None:
    """Write the ends of loops on a link, -1 for the world."""
    model = robot.model
    for loop, end in np.argwhere(model.loop_link == link).tolist():
        place = point(model.loop_position[loop, end])
        SubElement(body, "site", name=loop_site(loop, end), pos=place)


def names_of_bodies(robot: Robot) -> dict[int, str]:
    """Names of the bodies that links become."""
    last = body_links(robot)
    return dict(zip(last, unique(robot.link_names[link] for link in last), strict=True))


def body_links(robot: Robot) -> list[int]:
    """Links that are bodies of their own, in order; the others only carry a joint more."""
    model = robot.model
    children = np.bincount(model.parent[model.parent >= 0], minlength=robot.nv)
    merged = (model.mass == 0.0) & (model.inertia == 0.0) & (children == 1)
    merged[model.contact_link] = False
    merged[model.loop_link[model.loop_link >= 0]] = False
    merged[model.latch_release[model.latch_release >= 0]] = False
    return np.flatnonzero(~merged).tolist()


def _write_joint(robot: Robot, joint: int, place: Floats, body: Element) -> None:
    model = robot.model
    turn, x, z = model.axis[joint]
    given = {
        "name": robot.joint_names[joint],
        "type": "hinge" if turn else "slide",
        "axis": numbers((0.0, turn, 0.0)) if turn else point((x, z)),
    }
    if np.any(place):
        given["pos"] = point(place)
    for name, (attribute, _, _) in ATTRIBUTES.items():
        value = getattr(model, name)[joint]
        if value != PROPERTIES[name].default:
            given[attribute] = number(value)
    SubElement(
        body,
        "joint",
        given | range_of("range", float(model.lower[joint]), float(model.upper[joint])),
    )


def _write_inertia(robot: Robot, link: int, body: Element) -> None:
    model = robot.model
    about_y = number(max(float(model.inertia[link]), SMALLEST_INERTIA))
    SubElement(
        body,
        "inertial",
        pos=point(model.center_of_mass[link]),
        mass=number(max(float(model.mass[link]), SMALLEST_INERTIA)),
        diaginertia=f"{about_y} {about_y} {about_y}",
    )


def _geom_names(robot: Robot) -> list[str]:
    """Names of the geoms that contact points become."""
    return list(unique(robot.contact_names))


def _write_shapes(robot: Robot, link: int, origin: Floats, body: Element) -> None:
    """Contact points as spheres, and bones that only show where the links are."""
    model = robot.model
    for child in np.flatnonzero(model.parent == link):
        reach = origin[child] - origin[link]
        if np.hypot(*reach) > NO_BONE:
            bone = {"type": "capsule", "size": "0.02", "fromto": "0 0 0 " + point(reach)}
            SubElement(body, "geom", bone)
    names = _geom_names(robot)
    for i in np.flatnonzero(model.contact_link == link):
        geom = {
            "name": names[i],
            "type": "sphere",
            "size": number(max(float(model.contact_radius[i]), POINT_RADIUS)),
            "pos": point(model.contact_position[i]),
            "contype": "1",
        }
        if robot.contact_friction:
            geom["friction"] = number(robot.contact_friction[i])
        SubElement(body, "geom", geom)
