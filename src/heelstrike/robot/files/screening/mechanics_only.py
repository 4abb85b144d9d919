"""MJCF without what plays no part in a robot's motion.

Textures, keyframes, sensors, user data, flexible bodies and requests for memory can each fill the
memory of any machine, in sums that no limit for one of them catches. None of them says anything
about how links move, so the parser does not see them. Ground made of height fields is no part of
the robot either: it stays, by name and size, with four corners.
"""

from __future__ import annotations

from pathlib import PurePath
from xml.etree.ElementTree import Element, SubElement

_ELEMENTS = frozenset(
    (
        *("size", "keyframe", "sensor", "deformable", "flexcomp", "skin", "texture", "layer"),
        *("flex", "flexvert", "flexstrain", "lengthrange", "text", "tuple"),
    )
)
_ATTRIBUTES = frozenset(("user", "nsample", "delay", "interp"))
_ACTUATOR_LAWS = frozenset(("dyntype", "gaintype", "biastype"))
_TEXTURED = ("material", "light")


def leave_mechanics(root: Element, tags: set[str], names: set[str]) -> bool:
    """Take out of a tree what plays no part in motion; return whether there was any.

    Parameters
    ----------
    root : Element
        The tree, which is changed.
    tags, names : set of str
        All its elements and attributes, so that most trees need not be searched again.
    """
    if root.tag != "mujoco":
        return False
    changed = False
    if not _ELEMENTS.isdisjoint(tags):
        for parent in list(root.iter()):
            if any(child.tag in _ELEMENTS for child in parent):
                parent[:] = [child for child in parent if child.tag not in _ELEMENTS]
                changed = True
    if not _ATTRIBUTES.isdisjoint(names):
        for element in root.iter():
            for name in _ATTRIBUTES.intersection(element.attrib):
                del element.attrib[name]
                changed = True
    if "texture" in names:
        for tag in _TEXTURED:
            for element in root.iter(tag):
                changed |= element.attrib.pop("texture", None) is not None
    if "hfield" in tags:
        for field in root.iter("hfield"):
            _flatten(field)
            changed = True
    if "muscle" in tags or not _ACTUATOR_LAWS.isdisjoint(names):
        changed |= _skip_muscles(root)
    if "numeric" in tags:
        for custom in root.iter("custom"):
            for numeric in custom.findall("numeric"):
                if numeric.get("data"):
                    changed |= numeric.attrib.pop("size", None) is not None
                else:  # an empty place for so many numbers
                    custom.remove(numeric)
                    changed = True
    return changed


def _skip_muscles(root: Element) -> bool:
    """Keep the parser from simulating muscles, for as long as a file likes, to learn their ranges.

    A robot with muscles is refused by the reader of actuators.
    """
    muscles = any(
        element.tag == "muscle" or "muscle" in map(element.get, _ACTUATOR_LAWS)
        for element in root.iter()
    )
    if muscles:
        SubElement(SubElement(root, "compiler"), "lengthrange", {"mode": "none"})
    return muscles


def _flatten(field: Element) -> None:
    """Leave four corners of a height field."""
    name = field.get("name") or PurePath(field.get("file", "")).stem
    size = field.get("size")
    field.attrib.clear()
    field.attrib.update({"name": name, "nrow": "2", "ncol": "2"})
    if size is not None:
        field.set("size", size)
