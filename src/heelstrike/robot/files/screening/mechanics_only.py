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


def leave_mechanics(root: Element) -> None:
    """Take out of a tree what plays no part in motion.

    Parameters
    ----------
    root : Element
        The tree, which is changed.
    """
    for element in list(root.iter()):
        element[:] = [child for child in element if child.tag not in _ELEMENTS]
        for name in _ATTRIBUTES:
            element.attrib.pop(name, None)
        if element.tag in _TEXTURED:
            element.attrib.pop("texture", None)
        elif element.tag == "hfield":
            _flatten(element)
        elif element.tag == "custom":
            for numeric in element.findall("numeric"):
                numeric.attrib.pop("size", None)
                if not numeric.get("data"):  # an empty place for so many numbers
                    element.remove(numeric)
    _skip_muscles(root)


def _skip_muscles(root: Element) -> None:
    """Keep the parser from simulating muscles, for as long as a file likes, to learn their ranges.

    A robot with muscles is refused by the reader of actuators.
    """
    if any(
        each.tag == "muscle" or "muscle" in map(each.get, _ACTUATOR_LAWS) for each in root.iter()
    ):
        SubElement(SubElement(root, "compiler"), "lengthrange", {"mode": "none"})


def _flatten(field: Element) -> None:
    """Leave four corners of a height field."""
    name = field.get("name") or PurePath(field.get("file", "")).stem
    size = field.get("size")
    field.attrib.clear()
    field.attrib.update({"name": name, "nrow": "2", "ncol": "2"})
    if size is not None:
        field.set("size", size)
