"""Models inside a model, put into it: their names take the name of the model before them.

What stands in a nested model is given in its frame, and is called ``leg::shin`` from outside; of a
model that is merged the names stay. See http://sdformat.org/tutorials?tut=composition_proposal.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np

from heelstrike.robot.files.screening.xml_tree import Node
from heelstrike.robot.files.sdf.elements import error, inverse, transform, truth, word
from heelstrike.robot.files.sdf.frames import MODEL, WORLD, frames_of
from heelstrike.robot.model import Floats

JOINTS = ("joint", "drake:joint")
SCOPE = "::"
_ENDS = ("parent", "child", "drake:parent", "drake:child")


def flat(model: Element, label: str) -> Element:
    """Put the links, joints and frames of the models inside a model in their place.

    Raises
    ------
    RobotError
        With the line, if a model that is included is not there, or a nested one has no name, is
        static, or is placed by a frame that it does not have.
    """
    missing = model.find("include")
    if missing is not None:
        sought = "It is sought beside the file and in the folders of package_path=…."
        uri = word(missing, "uri")[:200]
        raise error(missing, label, f"<include> names {uri!r}, which is not there. {sought}")
    nested = model.findall("model")
    if not nested:
        return model
    for child in nested:
        model.remove(child)
        model.extend(list(_parts(flat(child, label), label)))
    return model


def _parts(model: Element, label: str) -> Iterator[Element]:
    """Links, joints and frames of a nested model, as the model around it has them."""
    name = model.get("name", "")
    if not name:
        raise error(model, label, "a <model> in a <model> has no name. Give it one.")
    if truth(model, "static", label):
        raise error(model, label, f"the nested model {name[:60]!r} is static: it would hold the "
                    "robot. Take <static> or the model out.")  # fmt: skip
    merged = getattr(model, "merged", False)
    scope = "" if merged else f"{name}{SCOPE}"
    own = f"_merged__{name}__model__" if merged else name
    yield _own_frame(model, own, scope, label)
    for element in model:
        if element.tag in ("link", "frame", *JOINTS):
            _rename(element, scope, own)
            yield element


def _own_frame(model: Element, name: str, scope: str, label: str) -> Element:
    """Frame of a nested model, fixed to its first link, in the model around it."""
    given = model.find("pose")
    links = [link.get("name", "") for link in model.iterfind("link")]
    first = model.get("canonical_link") or (links[0] if links else "")
    frame = _made(model, "frame", name=name, attached_to=f"{scope}{first}")
    place = transform(given, label)
    placed_by = model.get("placement_frame")
    if placed_by:
        joints = [each for each in model if each.tag in JOINTS]
        place = place @ inverse(frames_of(model, joints, label).pose(placed_by, model))
    base = "" if given is None else given.get("relative_to") or given.get("frame", "")
    pose = _made(model, "pose", relative_to=base or MODEL)
    frame.append(pose)
    pose.text = " ".join(repr(float(value)) for value in (*place[:3, 3], *_angles(place)))
    return frame


def _angles(place: Floats) -> Floats:
    """Roll, pitch and yaw of a pose."""
    turn = place[:3, :3]
    pitch = np.arctan2(-turn[2, 0], np.hypot(turn[0, 0], turn[1, 0]))
    if np.hypot(turn[0, 0], turn[1, 0]) < 1e-12:  # upright: roll and yaw turn about one axis
        return np.array([np.arctan2(-turn[1, 2], turn[1, 1]), pitch, 0.0])
    roll, yaw = np.arctan2(turn[2, 1], turn[2, 2]), np.arctan2(turn[1, 0], turn[0, 0])
    return np.array([roll, pitch, yaw])


def _rename(element: Element, scope: str, own: str) -> None:
    """Give a link, joint or frame the names by which the model around it knows them."""

    def outer(name: str) -> str:
        return own if name == MODEL else name if name == WORLD else f"{scope}{name}"

    element.set("name", f"{scope}{element.get('name', '')}")
    for each in element.iter():
        for attribute in ("relative_to", "expressed_in", "attached_to", "frame"):
            if each.get(attribute):
                each.set(attribute, outer(each.attrib[attribute]))
        if each.tag in _ENDS and (each.text or "").strip():
            each.text = outer((each.text or "").strip())
        if each.tag in _ENDS and each.get("link"):
            each.set("link", outer(each.attrib["link"]))
        if each.tag in ("axis", "axis2") and word(each, "use_parent_model_frame") in ("true", "1"):
            direction = each.find("xyz")
            if direction is not None and not direction.get("expressed_in"):
                direction.set("expressed_in", own)
    _place_in(element, own)


def _place_in(element: Element, own: str) -> None:
    """Say of a link or frame that names none that it is given in the frame of its model."""
    if element.tag in JOINTS or (element.tag == "frame" and element.get("attached_to")):
        return  # given in the frame of its child, or of what it is attached to
    if element.tag == "frame":
        element.set("attached_to", own)
    pose = element.find("pose")
    if pose is None:
        pose = _made(element, "pose")
        element.append(pose)
    if not (pose.get("relative_to") or pose.get("frame")):
        pose.set("relative_to", own)


def _made(source: Element, tag: str, **attributes: str) -> Node:
    """Return an element on the line of the one that it comes from."""
    made = Node(tag, attributes)
    made.line = getattr(source, "line", 0)
    return made
