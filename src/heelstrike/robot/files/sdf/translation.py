"""An SDF model as an MJCF tree: every element keeps its line, every link is a body.

Both formats mean the same by inertia, limits, damping and springs; they differ in frames, which
SDF gives freely and MJCF nests, and in what is meant where nothing is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.files.packages import find_file
from heelstrike.robot.files.screening.mesh_files import is_mesh, refuse_large_meshes
from heelstrike.robot.files.screening.xml_tree import Node
from heelstrike.robot.files.sdf.elements import (
    check,
    error,
    inverse,
    number,
    numbers,
    transform,
    truth,
    word,
)
from heelstrike.robot.files.sdf.frames import MODEL, WORLD, Frames, frames_of
from heelstrike.robot.files.sdf.nesting import JOINTS, flat
from heelstrike.robot.model import Floats
from heelstrike.robot.warning import warn
from heelstrike.wording import some_of

HINGES, SLIDES = ("revolute", "continuous"), ("prismatic",)
TWO_HINGES = ("universal", "revolute2")
PLANAR = "drake:planar"
PLANAR_AXES = (("TX", "slide", 0), ("TY", "slide", 1), ("RZ", "hinge", 2))  # as MuJoCo's of URDF
NO_LIMIT = 1e10  # SDF writes 1e16 where there is no limit
WEIGHED = ("mass", "inertia/ixx", "inertia/iyy", "inertia/izz")
SHOWN = 6  # oddities that a message lists before it counts the rest
STRAIGHT = 1e-15
"""Entries of rotations below which they are rounding: a quarter turn of 1.5707963267948966."""


@dataclass
class _Model:
    """A model as it is read: its frames, and the MJCF that comes of it."""

    label: str
    frames: Frames
    directory: Path
    packages: Sequence[Path]
    old_axes: bool
    root: Node
    custom: Node
    actuators: Node
    assets: Node
    told: dict[str, list[str]] = field(default_factory=dict)
    shapes: set[str] = field(default_factory=set)
    mesh_size: int = 0

    def tell(self, what: str, name: str) -> None:
        """Remember what is to be said, by its reason."""
        self.told.setdefault(what, []).append(name)


def as_mjcf(sdf: Node, directory: Path, packages: Sequence[Path], label: str) -> Node:
    """Return the one model that moves in an SDF file as an MJCF tree.

    Parameters
    ----------
    sdf : Node
        The file, with its texts.
    directory : Path
        Its folder.
    packages : sequence of Path
        Folders of packages, or that hold such.
    label : str
        What to call it in messages.

    Raises
    ------
    RobotError
        With line and element, if there is no such model or several, or it is none that can be
        read.

    Warns
    -----
    RobotWarning
        Of what is left out, and of what SDF assumes where the file says nothing.
    """
    element = flat(_the_model(sdf, label), label)
    strange = list(check(element, label))
    if strange:
        warn(f"{label}: unknown and left out: {some_of(strange, SHOWN, '; ')}.")
    joints = [
        _of_drake(child) if child.tag == "drake:joint" else child
        for child in element
        if child.tag in JOINTS
    ]
    frames = frames_of(element, joints, label)
    placed: Floats = transform(element.find("pose"), label)
    if element.get("placement_frame"):
        placed = placed @ inverse(frames.pose(element.get("placement_frame", ""), element))
    frames.found[WORLD] = inverse(placed)
    root = Node("mujoco", {"model": element.get("name", "") or "robot"})
    root.line = getattr(sdf, "line", 0)
    _put(root, sdf, "compiler", angle="radian", autolimits="true", strippath="false")
    _put(root, sdf, "option", gravity=_text(_gravity(sdf, label)))
    parts = [_put(root, sdf, tag) for tag in ("custom", "asset", "worldbody", "actuator")]
    custom, assets, world, actuators = parts
    model = _Model(
        label, frames, directory, packages, _version(sdf, label) < (1, 5), root, custom, actuators,
        assets,
    )  # fmt: skip
    _write_tree(model, element, joints, world)
    refuse_large_meshes(model.mesh_size, label)
    for what, names in model.told.items():
        warn(f"{label}: {what}: {some_of(names, SHOWN)}.")
    return root


def _the_model(sdf: Node, label: str) -> Element:
    models = [*sdf.iterfind("model"), *sdf.iterfind("world/model")]
    moving = [model for model in models if not truth(model, "static", label)]
    if len(moving) != 1:
        names = ", ".join(repr(model.get("name", "")) for model in moving) or "none"
        missing = [word(each, "uri") for each in sdf.iter("include")]
        sought = f" Not found, so not read: {', '.join(missing)[:200]}." if missing else ""
        raise RobotError(
            f"{label}: a robot is the one <model> of an SDF file that is not static; here are "
            f"{names}. Keep one, and put its parts into it.{sought}"
        )
    return moving[0]


def _version(sdf: Node, label: str) -> tuple[int, ...]:
    try:
        version = tuple(int(part) for part in sdf.get("version", "1.7").split("."))
    except ValueError:
        version = (0,)
    if not (1, 2) <= version < (2,):
        raise RobotError(
            f"{label}: its SDF version is {sdf.get('version', '')[:20]!r}; heelstrike reads 1.2 to "
            "1.12. Gazebo's `gz sdf -p` writes a newer one."
        )
    return version


def _of_drake(joint: Element) -> Element:
    """A joint of Drake's extension with the tags of SDF's own."""
    made = Node("joint", joint.attrib | {"type": f"drake:{joint.get('type', '')}"})
    made.line = getattr(joint, "line", 0)
    for child in joint:
        child.tag = child.tag.removeprefix("drake:")
        made.append(child)
    return made


def _gravity(sdf: Node, label: str) -> Floats:
    gravity = sdf.find("world/gravity")
    return np.array([0.0, 0.0, -9.81]) if gravity is None else numbers(gravity, 3, label)


def _write_tree(model: _Model, element: Element, joints: list[Element], world: Node) -> None:
    """Nest the links as joints connect them; what closes a loop is left out."""
    links = {link.get("name", ""): link for link in element.iterfind("link")}
    above: dict[str, tuple[Element, str, bool]] = {}
    # A gearbox couples joints that are there beside it.
    for joint in sorted(joints, key=lambda joint: joint.get("type") == "gearbox"):
        ends = [word(joint, tag) or (end.get("link", "") if end is not None else "")
                for tag in ("parent", "child") for end in (joint.find(tag),)]  # fmt: skip
        parent, child = (model.frames.link(end, joint) for end in ends)
        reverse = child == WORLD
        if reverse:
            parent, child = child, parent
        if parent == child:
            raise error(joint, model.label, f"joint {joint.get('name')!r} connects a link with "
                        "itself.")  # fmt: skip
        if child in above:
            model.tell("joints that close a loop are not simulated and left out",
                       joint.get("name", ""))  # fmt: skip
        else:
            above[child] = (joint, parent, reverse)
    bodies: dict[str, Node] = {}

    def body_of(name: str) -> Node:
        way = []
        while name not in bodies and name != WORLD:
            if name in way:
                raise error(links[name], model.label, f"link {name!r} is attached to itself, "
                            "through a circle of joints. Links make a tree: remove "
                            "one.")  # fmt: skip
            way.append(name)
            name = above[name][1] if name in above else WORLD
        for link in reversed(way):
            joint, parent, reverse = above.get(link, (None, WORLD, False))
            holder = world if parent == WORLD else bodies[parent]
            bodies[link] = _write_link(
                model, links[link], holder, _below(model, link, joint, parent)
            )
            if joint is None:
                _put(bodies[link], links[link], "freejoint")
            else:
                _write_joint(model, joint, link, bodies[link], -1.0 if reverse else 1.0)
        return world if name == WORLD and not way else bodies[way[0]] if way else bodies[name]

    for name in links:
        body_of(name)


def _below(model: _Model, link: str, joint: Element | None, parent: str) -> Floats:
    """Pose of a link in the link (or world) that it depends on."""
    pose, asking = model.frames.pose, model.frames.given[link][0]
    above = inverse(pose(parent, asking))
    if joint is not None and joint.get("type") == PLANAR:
        # Drake's joints begin where the two frames that they connect are one.
        child = inverse(pose(word(joint, "child"), joint)) @ pose(link, asking)
        return above @ pose(word(joint, "parent"), joint) @ child
    return above @ pose(link, asking)


def _write_link(model: _Model, link: Element, holder: Node, place: Floats) -> Node:
    name, label = link.get("name", ""), model.label
    body = _put(holder, link, "body", name=name, **_placed(place))
    if not truth(link, "gravity", label, True):
        body.set("gravcomp", "1")
    inertial = link.find("inertial")
    if inertial is None or any(inertial.find(part) is None for part in WEIGHED):
        model.tell(
            "without <inertial>, <mass> or moments of <inertia>; SDF means 1 kg, and 1 kg m² about "
            "each axis",
            name,
        )
    if inertial is not None and link.find("inertial").get("auto", "false") in ("true", "1"):  # type: ignore[union-attr]
        raise error(inertial, label, f"link {name!r} leaves its inertia to its shapes "
                    '(auto="true"). Write its <mass> and <inertia>.')  # fmt: skip
    inertial = Element("inertial") if inertial is None else inertial
    _write_inertia(model, inertial, body)
    for collision in link.iterfind("collision"):
        _write_shape(model, collision, body, name)
    return body


def _write_inertia(model: _Model, inertial: Element, body: Node) -> None:
    label = model.label
    place = transform(inertial.find("pose"), label)
    given = inertial.find("inertia")
    given = Element("inertia") if given is None else given
    xx, yy, zz = (number(given, tag, 1.0, label) for tag in ("ixx", "iyy", "izz"))
    xy, xz, yz = (number(given, tag, 0.0, label) for tag in ("ixy", "ixz", "iyz"))
    turn = place[:3, :3]
    tensor = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    _put(
        body, inertial, "inertial", pos=_text(place[:3, 3]),
        mass=repr(number(inertial, "mass", 1.0, label, least=0.0)),
        fullinertia=_text([*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]]),
    )  # fmt: skip


def _write_shape(model: _Model, collision: Element, body: Node, link: str) -> None:
    label = model.label
    bitmask = collision.findtext("surface/contact/collide_bitmask")
    if bitmask is not None and bitmask.strip() in ("0", "0x0", "0x00"):
        return
    geometry = collision.find("geometry")
    shape = next(iter(geometry), None) if geometry is not None else None
    made: dict[str, str] = {}
    if shape is not None and shape.tag == "box":
        made = {"type": "box", "size": _text(_sizes(shape, "size", 3, label) / 2.0)}
    elif shape is not None and shape.tag == "ellipsoid":
        made = {"type": "ellipsoid", "size": _text(_sizes(shape, "radii", 3, label))}
    elif shape is not None and shape.tag in ("sphere", "cylinder", "capsule"):
        size = [_sizes(shape, "radius", 1, label)[0]]
        if shape.tag != "sphere":
            size.append(_sizes(shape, "length", 1, label)[0] / 2.0)
        made = {"type": shape.tag, "size": _text(size)}
    elif shape is not None and shape.tag == "mesh":
        made = _mesh(model, shape, link)
    elif shape is not None and shape.tag != "empty":
        model.tell("shapes that no contact points are made of", f"<{shape.tag[:40]}> of {link}")
    if made:
        friction = collision.find("surface/friction/ode/mu")
        if friction is not None:
            (value,) = numbers(friction, 1, label)
            if value < 0.0:
                raise error(friction, label, f"<mu> is {value:g}; it must not be negative.")
            made["friction"] = _text([value])
        name = collision.get("name", "")
        if name and name not in model.shapes:
            model.shapes.add(name)
            made["name"] = name
        made |= _placed(_shape_pose(model, collision, link))
        _put(body, shape, "geom", **made)  # type: ignore[arg-type]


def _shape_pose(model: _Model, collision: Element, link: str) -> Floats:
    pose = collision.find("pose")
    place = transform(pose, model.label)
    base = "" if pose is None else pose.get("relative_to", "")
    if base:
        frames = model.frames
        there = frames.pose(base, collision)
        place = inverse(frames.pose(link, collision)) @ there @ place
    return place


def _sizes(shape: Element, tag: str, count: int, label: str) -> Floats:
    """Sizes of a shape; a radius of zero is a point."""
    child = shape.find(tag)
    if child is None:
        return np.ones(count)  # which the format means
    values = numbers(child, count, label)
    if (values < 0.0).any():
        raise error(child, label, f"<{tag}> of <{shape.tag}> must not be negative.")
    return np.maximum(values, 1e-12)


def _mesh(model: _Model, shape: Element, link: str) -> dict[str, str]:
    folder = getattr(shape, "folder", None) or model.directory
    file = find_file(word(shape, "uri"), folder, model.packages)
    if file is None or not is_mesh(file) or shape.find("submesh") is not None:
        model.tell(
            "collision meshes that are not where the file says, or none that MuJoCo reads (binary "
            ".stl, .obj), of links that so cannot touch the ground with them; package_path=… names "
            "folders of models",
            link,
        )
        return {}
    model.mesh_size += file.stat().st_size
    name = f"mesh{len(model.assets)}"
    scale = shape.find("scale")
    size = np.ones(3) if scale is None else numbers(scale, 3, model.label)
    _put(model.assets, shape, "mesh", name=name, file=str(file), scale=_text(size))
    return {"type": "mesh", "mesh": name}


def _write_joint(model: _Model, joint: Element, link: str, body: Node, sense: float) -> None:
    kind, name = joint.get("type", ""), joint.get("name", "")
    here = inverse(model.frames.pose(link, joint))
    place: Floats = here @ model.frames.of_joint(joint)
    if kind in HINGES or kind in SLIDES:
        _write_axis(model, joint, joint.find("axis"), name, body, here, place, sense)
    elif kind in TWO_HINGES:
        _write_axis(model, joint, joint.find("axis"), f"{name}_0", body, here, place, sense)
        _write_axis(model, joint, joint.find("axis2"), f"{name}_1", body, here, place, sense)
    elif kind == "ball":
        _put(body, joint, "joint", name=name, type="ball", pos=_text(place[:3, 3]))
    elif kind == PLANAR:
        own = here @ model.frames.pose(word(joint, "child"), joint)
        damping = joint.find("damping")
        rates = np.zeros(3) if damping is None else numbers(damping, 3, model.label)
        for ending, motion, axis in PLANAR_AXES:
            _put(
                body, joint, "joint", name=f"{name}_{ending}", type=motion, pos=_text(own[:3, 3]),
                axis=_text(own[:3, axis]), damping=repr(float(rates[axis])),
            )  # fmt: skip
    elif kind != "fixed":
        raise error(joint, model.label, f"joint {name!r} is of the type {kind[:40]!r}; heelstrike "
                    "reads revolute, continuous, prismatic, universal, revolute2, ball and fixed "
                    "ones, and Drake's planar ones.")  # fmt: skip


def _write_axis(
    model: _Model, joint: Element, axis: Element | None, name: str, body: Node, here: Floats,
    place: Floats, sense: float,
) -> None:  # fmt: skip
    label = model.label
    axis = Element("axis") if axis is None else axis
    kind = "slide" if joint.get("type") in SLIDES else "hinge"
    limit, dynamics = (
        Element(tag) if (found := axis.find(tag)) is None else found
        for tag in ("limit", "dynamics")
    )
    made = {
        "type": kind,
        "pos": _text(place[:3, 3]),
        "axis": _text(sense * _direction(model, axis, here, place)),
        "damping": repr(number(dynamics, "damping", 0.0, label, least=0.0)),
        "frictionloss": repr(number(dynamics, "friction", 0.0, label, least=0.0)),
        "springref": repr(number(dynamics, "spring_reference", 0.0, label)),
        "stiffness": repr(number(dynamics, "spring_stiffness", 0.0, label, least=0.0)),
    }
    lower = number(limit, "lower", -math.inf, label, endless=True)
    upper = number(limit, "upper", math.inf, label, endless=True)
    if joint.get("type") != "continuous" and min(-lower, upper) < NO_LIMIT:
        if not lower < upper:
            raise error(limit, label, f"the range of joint {name!r} is empty, from {lower:g} to "
                        f"{upper:g}. A joint that does not move is of type fixed.")  # fmt: skip
        made["range"] = _text([max(lower, -NO_LIMIT), min(upper, NO_LIMIT)])
    rotor = number(joint, "drake:rotor_inertia", 0.0, label, least=0.0)
    made["armature"] = repr(rotor * number(joint, "drake:gear_ratio", 1.0, label) ** 2)
    _put(body, joint, "joint", name=name, **made)
    speed = number(limit, "velocity", -1.0, label, endless=True)
    if 0.0 < speed < NO_LIMIT:
        _put(model.custom, limit, "numeric", name=f"speed_limit:{name}", data=repr(speed))
    effort = number(limit, "effort", -1.0, label, endless=True)
    sprung = float(made["stiffness"]) > 0.0
    if effort == 0.0 or (effort < 0.0 and sprung):
        return  # nothing drives it, as Drake has it; so a spring that is given no motor
    motor = {"name": name, "joint": name}
    if 0.0 < effort < NO_LIMIT:
        motor["ctrlrange"] = _text([-effort, effort])
    elif effort < 0.0:
        model.tell("joints without <effort>, which are driven without limit", name)
    _put(model.actuators, joint, "motor", **motor)


def _direction(model: _Model, axis: Element, here: Floats, place: Floats) -> Floats:
    """Axis of a joint in the frame of its link."""
    xyz = axis.find("xyz")
    given = np.array([0.0, 0.0, 1.0]) if xyz is None else numbers(xyz, 3, model.label)
    if not given.any():
        raise error(axis, model.label, "<xyz> is zero, which is no direction.")
    frame = "" if xyz is None else xyz.get("expressed_in", "")
    if frame:
        place = here @ model.frames.pose(frame, axis)
    elif truth(axis, "use_parent_model_frame", model.label, model.old_axes):
        place = here @ model.frames.pose(MODEL, axis)
    direction: Floats = place[:3, :3] @ given
    return direction / np.linalg.norm(direction)


def _placed(place: Floats) -> dict[str, str]:
    """Attributes of a pose, which is that of the parent where they are missing."""
    turn = np.where(np.abs(place[:3, :3]) < STRAIGHT, 0.0, place[:3, :3])
    given = {"pos": _text(place[:3, 3])}
    if not np.array_equal(turn, np.eye(3)):
        given["xyaxes"] = _text([*turn[:, 0], *turn[:, 1]])
    return given


def _put(parent: Node, source: Element, tag: str, **attributes: str) -> Node:
    """Add an element on the line of the one that it comes from."""
    made = Node(tag, attributes)
    made.line = getattr(source, "line", 0)
    parent.append(made)
    return made


def _text(values: Floats | Sequence[float]) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
