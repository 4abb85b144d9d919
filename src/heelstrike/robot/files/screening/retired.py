"""What MJCF had once: files of its first years say it still, and MuJoCo's parser refuses them.

Global coordinates are made local ones. Attributes that never moved a robot are left out, and so are
materials, which only colour it and which many published files name and do not hold.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.model import Floats
from heelstrike.robot.warning import warn

RETIRED = {
    "flag": ("sensornoise",),
    "option": ("collision", "apirate"),
    "compiler": ("coordinate",),
}
"""Attributes of elements that newer parsers do not know; what they did is no part of a robot, or,
as of ``coordinate``, done here."""

PLACED = ("geom", "joint", "site", "inertial", "camera", "light")
TURNED = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


def renew(root: Element, label: str) -> None:
    """Bring an old tree up to date.

    Parameters
    ----------
    root : Element
        The tree, which is changed.
    label : str
        What to call it in messages.

    Raises
    ------
    RobotError
        If a place is no three numbers.
    """
    compilers = list(root.iter("compiler"))
    if any(each.get("coordinate") == "global" for each in compilers):
        for body in root.iterfind("worldbody/body"):
            _make_local(body, np.zeros(3), label)
    if any(each.get("inertiafromgeom") == "true" for each in compilers):
        _forget_inertias(root)
    for element in root.iter():
        for name in ("material", *RETIRED.get(element.tag, ())):
            element.attrib.pop(name, None)


def _forget_inertias(root: Element) -> None:
    """Leave out ``<inertial>`` without a place, in files that weigh every body by its geoms."""
    for body in root.iter("body"):
        for inertial in body.findall("inertial"):
            if inertial.get("pos") is None:
                body.remove(inertial)


def _make_local(body: Element, above: Floats, label: str) -> None:
    """Give a body, and all in it, places in the frame that they hang in.

    Every place and direction of such a file is one of the world, so the frames of its bodies can
    all be parallel to it: however they turn, it is the same robot.
    """
    here = _place_of(body, above, label)
    for attribute in TURNED:
        body.attrib.pop(attribute, None)
    body.set("pos", _text(here - above))
    for child in body:
        if child.tag == "body":
            _make_local(child, here, label)
        elif child.tag in PLACED:
            if child.get("fromto") is not None:
                ends = _numbers(child, "fromto", 6, label) - np.tile(here, 2)
                child.set("fromto", _text(ends))
            elif child.get("pos") is not None or child.tag != "light":
                # A place that is not given is that of the body, in both kinds of coordinates.
                place = _numbers(child, "pos", 3, label) if child.get("pos") else here
                child.set("pos", _text(place - here))


def _place_of(body: Element, above: Floats, label: str) -> Floats:
    """Place of a body; nothing depends on it here, so files that have none were used."""
    if body.get("pos") is None:
        return above
    try:
        return _numbers(body, "pos", 3, label)
    except RobotError as error:
        warn(f"{error} In global coordinates the place of a body moves nothing: it is left out.")
        return above


def _numbers(element: Element, name: str, count: int, label: str) -> Floats:
    try:
        values = np.array([float(word) for word in element.get(name, "").split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != count:
        raise RobotError(
            f"{label}: line {getattr(element, 'line', 0)}: {name!r} of <{element.tag}> is "
            f"{element.get(name, '')[:60]!r}, where {count} numbers must be."
        )
    return values


def _text(values: Floats) -> str:
    return " ".join(repr(float(value) + 0.0) for value in values)
