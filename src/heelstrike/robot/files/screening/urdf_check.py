"""A strict look at URDF. MuJoCo's parser passes over in silence what it does not know.

A misspelt ``<dynamcs>`` loses a joint its damping, a forgotten ``upper`` its range, a negative mass
becomes none: wrong robots that look right. After the format's definition at
https://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from heelstrike.errors import RobotError
from heelstrike.robot.files.ros.drives import drives_of
from heelstrike.robot.warning import warn
from heelstrike.wording import meant, some_of

# Attributes of each element, with how many numbers they hold (0: a word), and its children.
_ORIGIN = {"xyz": 3, "rpy": 3}
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_ATTRIBUTES: dict[str, dict[str, int]] = {
    "robot": {"name": 0, "version": 0},
    "link": {"name": 0, "type": 0},
    "inertial": {},
    "origin": _ORIGIN,
    "mass": {"value": 1},
    "inertia": dict.fromkeys(_MOMENTS, 1),
    "collision": {"name": 0, "group": 0},
    "geometry": {},
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"filename": 0, "scale": 3},
    "joint": {"name": 0, "type": 0},
    "parent": {"link": 0},
    "child": {"link": 0},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "effort": 1, "velocity": 1},
    "dynamics": {"damping": 1, "friction": 1},
}
_CHILDREN: dict[str, set[str]] = {
    "robot": {"link", "joint"},
    "link": {"inertial", "collision"},
    "inertial": {"origin", "mass", "inertia"},
    "collision": {"origin", "geometry"},
    "geometry": {"box", "sphere", "cylinder", "capsule", "mesh"},
    "joint": {"origin", "parent", "child", "axis", "limit", "dynamics"},
}
_SEVERAL = {
    *(("robot", "link"), ("robot", "joint"), ("link", "collision")),
    ("joint", "dynamics"),  # of which the first counts
}
_REQUIRED = {
    "link": ("name",),
    "joint": ("name", "type"),
    "parent": ("link",),
    "child": ("link",),
    "mass": ("value",),
}
# What is known, and is about other things than mechanics, or told elsewhere (mimic).
_OTHER_MATTERS = {
    "robot": "material transmission gazebo mujoco ros2_control sensor plugin drake",
    "link": "visual contact gazebo sensor self_collision_checking verbose audio disable",
    "inertial": "gazebo",
    "collision": "verbose material surface max_contacts contact_coefficients drake",
    "geometry": "",
    "joint": "mimic calibration safety_controller gazebo physics hardwareInterface sensor drake",
}
DEEPEST_LINK = 1000
"""Most joints in a chain; MuJoCo's time grows with the square of their number."""

SHOWN = 6  # how many oddities a message lists before it counts the rest
GUESS = " (did you mean {}?)"
_BOUNDED = ("revolute", "prismatic")


def check_urdf(root: Element, label: str) -> None:
    """Refuse a URDF whose numbers cannot be meant; warn of what plays no part but may be meant to.

    Raises
    ------
    RobotError
        For numbers that are none, negative masses and the like, and names given twice.

    Warns
    -----
    RobotWarning
        Of unknown elements and attributes, and joints without the limits that URDF wants.
    """
    for kind in ("link", "joint"):
        counts = Counter(element.get("name", "") for element in root.iterfind(kind))
        twice = [name for name, count in counts.items() if count > 1]
        if twice:
            raise RobotError(f"{label}: two {kind}s are called {twice[0]!r}. Rename one.")
    strange: list[str] = []
    _check(root, "the robot", label, strange)
    massive = {
        link.get("name", "") for link in root.iterfind("link") if link.find("inertial") is not None
    } - {"world"}
    driven = drives_of(root, label)
    for joint in root.iterfind("joint"):
        parent = joint.find("parent")
        # The joints of a floating base, on links without mass, have no limits.
        if parent is not None and (
            parent.get("link") in massive or joint.find("limit") is not None
        ):
            strange += _missing_limits(joint, joint.get("name", "") in driven)
    if strange:
        shown = some_of(strange, SHOWN, "; ")
        warn(f"{label}: this URDF may not say what is meant: {shown}.")


def refuse_macros(root: Element, label: str) -> None:
    """Refuse a file whose macros nobody expanded.

    Raises
    ------
    RobotError
        With the macro, and how it is expanded.
    """
    for element in root.iter():
        if element.tag.startswith("xacro:"):
            raise RobotError(
                f"{label}: <{element.tag}> is a macro of xacro, so this is not a URDF file yet. "
                "Load it with xacro=True, if you trust it: expanding a macro runs what it says."
            )


def check_urdf_tree(root: Element, label: str) -> None:
    """Refuse a URDF whose joints do not make a tree, or one too deep for a parser.

    Raises
    ------
    RobotError
        With the joint or link that does not fit.
    """
    names = {link.get("name", "") for link in root.iterfind("link")}
    parents: dict[str, str] = {}
    for joint in root.iterfind("joint"):
        ends = {kind: joint.find(kind) for kind in ("parent", "child")}
        above, below = (
            "" if end is None else end.get("link", "") for end in (ends["parent"], ends["child"])
        )
        what = f"{_at(label, joint)}: joint {joint.get('name', '')!r}"
        for kind, link in (("parent", above), ("child", below)):
            if link not in names:
                raise RobotError(
                    f"{what} has the {kind} {link[:60]!r}, but there is no link of that name."
                )
        if below in parents:
            raise RobotError(
                f"{what} is the second that moves link {below!r}. Links of a URDF make a tree, in "
                "which each has one joint above it: remove one of the two."
            )
        parents[below] = above
    depths: dict[str, int] = dict.fromkeys(names - parents.keys(), 0)
    for start in parents:
        way: list[str] = []
        link = start
        while link not in depths:
            way.append(link)
            if len(way) > len(parents):
                raise RobotError(
                    f"{label}: link {link!r} is attached to itself, through a circle of joints. "
                    "Links of a URDF make a tree: remove one of these joints."
                )
            link = parents[link]
        depth = depths[link]
        for below in reversed(way):
            depth += 1
            depths[below] = depth
    if max(depths.values(), default=0) > DEEPEST_LINK:
        raise RobotError(
            f"{label}: a chain has more than {DEEPEST_LINK} joints, the most that is read. Shorten "
            "it, or merge links that do not move against each other."
        )


def _at(label: str, element: Element) -> str:
    return f"{label}: line {getattr(element, 'line', 0)}"


def _check(element: Element, where: str, label: str, strange: list[str], joint: str = "") -> None:
    tag = element.tag
    if tag == "joint":
        joint = element.get("type", "")
    if tag in ("link", "joint"):
        where = f"{tag} {element.get('name', '')!r}"
    attributes = _ATTRIBUTES[tag]
    for name in _REQUIRED.get(tag, ()):
        if name not in element.attrib:
            raise RobotError(f"{_at(label, element)}: <{tag}> of {where} lacks {name!r}.")
    for name, text in element.attrib.items():
        if name in attributes:
            _check_numbers(element, name, text, attributes[name], where, label, joint)
        elif ":" not in name and not name.startswith("xmlns"):
            strange.append(
                f"<{tag}> of {where} has the unknown attribute {name[:60]!r}"
                f"{meant(name, list(attributes), GUESS)}"
            )
    known = _CHILDREN.get(tag, set())
    other = _OTHER_MATTERS.get(tag, "").split()
    seen: set[str] = set()
    for child in element:
        if child.tag in known:
            if child.tag in seen and (tag, child.tag) not in _SEVERAL:
                raise RobotError(f"{_at(label, child)}: {where} has two <{child.tag}>. Keep one.")
            seen.add(child.tag)
            _check(child, where, label, strange, joint)
        elif child.tag not in other and ":" not in child.tag:
            strange.append(
                f"<{child.tag[:60]}> in <{tag}> of {where} is unknown"
                f"{meant(child.tag, known, GUESS)}"
            )
    if tag == "inertial" and "mass" not in seen:
        raise RobotError(f"{_at(label, element)}: the <inertial> of {where} needs a <mass>.")


def _check_numbers(
    element: Element, name: str, text: str, count: int, where: str, label: str, joint: str
) -> None:
    if count == 0 or (element.tag == "inertia" and not text.strip()):
        return  # a word, or a moment that is left out
    what = f"{_at(label, element)}: {name!r} of <{element.tag}> of {where}"
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    # Python reads 1_000 and the digits of all scripts as numbers; MuJoCo reads their beginning.
    if len(values) != count or "_" in text or not text.isascii():
        numbers = "a number" if count == 1 else f"{count} numbers"
        raise RobotError(f"{what} is {text[:60]!r}, where {numbers} must be.")
    limit = element.tag == "limit"
    if any(math.isnan(value) or (math.isinf(value) and not limit) for value in values):
        raise RobotError(f"{what} is {text[:60]!r}, which is not a finite number.")
    # Of the moments of inertia only the one about the plane's normal has to be one; see `inertias`.
    signed = element.tag in ("origin", "axis", "inertia") or name in ("lower", "upper")
    if not signed and name != "scale" and min(values) < 0.0:
        raise RobotError(f"{what} is {text[:60]!r}; it must not be negative.")
    if element.tag == "axis" and not any(values) and joint not in ("fixed", "floating"):
        raise RobotError(f"{what} is zero, which is no direction.")


def _missing_limits(joint: Element, driven: bool) -> Iterator[str]:
    """What a joint lacks of its limits; `driven` is one to which the file gives a motor."""
    name = joint.get("name", "")
    limit = joint.find("limit")
    if joint.get("type") not in _BOUNDED:
        return
    if limit is None:
        motor = "so is the torque of its motor" if driven else "it has no motor"
        yield f"joint {name!r} has no <limit>: its range is unlimited, and {motor}"
        return
    ends = [end for end in ("lower", "upper") if end not in limit.attrib]
    if ends:
        yield f"<limit> of joint {name!r} has no {' and no '.join(repr(end) for end in ends)}"
    if "effort" not in limit.attrib:
        meant = "so that its motor's torque is unlimited" if driven else "so that no motor moves it"
        yield f"<limit> of joint {name!r} has no 'effort', {meant}"
    lower, upper = (float(limit.get(end, "0")) for end in ("lower", "upper"))
    if not ends and lower >= upper:
        yield (
            f"the range of joint {name!r} is empty, from {lower:g} to {upper:g}: it counts as free"
        )
