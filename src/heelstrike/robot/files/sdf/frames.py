"""Where the frames of an SDF model are: each is given relative to another."""

from __future__ import annotations

from dataclasses import field
from xml.etree.ElementTree import Element

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.files.sdf.elements import error, transform, word
from heelstrike.robot.model import Floats

MODEL, WORLD = "__model__", "world"


@dataclass
class Frames:
    """Frames of a model by name, found when they are asked for."""

    label: str
    """What to call the file in messages."""
    given: dict[str, tuple[Element, str, Floats]]
    """Element of each, the frame that it is given in, and its pose there."""
    found: dict[str, Floats] = field(default_factory=dict)

    def pose(self, name: str, asking: Element) -> Floats:
        """Pose (4, 4) of a frame in the model."""
        way: list[str] = []
        while name not in self.found:
            if name not in self.given:
                raise error(asking, self.label, f"there is no frame or link {name[:60]!r}.")
            if name in way:
                circle = [each[:60] for each in way[way.index(name) :]]
                told = f"frame {circle[0]!r} is given relative to itself"
                if len(circle) > 1:
                    told += f", by way of {', '.join(map(repr, circle[1:]))}"
                raise error(asking, self.label, f"{told}.")
            way.append(name)
            name = self.given[name][1]
        for each in reversed(way):
            _, base, pose = self.given[each]
            self.found[each] = self.found[base] @ pose
            name = each
        return self.found[name]

    def of_joint(self, joint: Element) -> Floats:
        """Pose of the frame of a joint in the model."""
        name = joint.get("name", "")
        return self.pose(name if self.tag(name) == "joint" else key_of(joint), joint)

    def link(self, name: str, asking: Element) -> str:
        """Link that a frame is fixed to."""
        seen: set[str] = set()
        while name != WORLD and self.tag(name) != "link":
            if name not in self.given or name in seen:
                raise error(asking, self.label, f"there is no link {name[:60]!r}.")
            seen.add(name)
            element = self.given[name][0]
            name = (
                word(element, "child") if element.tag == "joint" else element.get("attached_to", "")
            )
        return name

    def tag(self, name: str) -> str:
        """Tag of the element of a frame."""
        return self.given[name][0].tag if name in self.given else ""


def key_of(joint: Element) -> str:
    """Name of the frame of a joint that is called as a link is: no element can have it."""
    return f"joint\0{joint.get('name', '')}"


def frames_of(model: Element, joints: list[Element], label: str) -> Frames:
    """Return the frames of links, joints and ``<frame>`` of a model.

    Raises
    ------
    RobotError
        If a name is missing or given twice, or a pose is none.
    """
    frames = Frames(label, {}, {MODEL: np.eye(4), WORLD: np.eye(4)})
    for element in (*model.iterfind("link"), *joints, *model.iterfind("frame")):
        name = element.get("name", "")
        if element.tag == "joint" and frames.tag(name) == "link":
            name = key_of(element)  # older files call them alike
        if not name or name in frames.given:
            what = f"two elements are called {name[:60]!r}" if name else "it has no name"
            raise error(element, label, f"<{element.tag}>: {what}. Rename it.")
        pose = element.find("pose")
        base = "" if pose is None else pose.get("relative_to") or pose.get("frame", "")
        if not base and element.tag == "frame":
            base = element.get("attached_to", "")
        elif not base and element.tag != "link":
            base = word(element, "child")
        frames.given[name] = (element, base or MODEL, transform(pose, label))
    return frames
