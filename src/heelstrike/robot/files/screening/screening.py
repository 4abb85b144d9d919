"""A look at a robot file before MuJoCo's parser runs on it.

What a file may do to a parser, its process bears (:mod:`heelstrike.reader_process`). Refused here
is what a parser reads as something else than is written. What only costs memory and plays no part
in a robot's motion (textures, sensors, keyframes …) does not reach the parser at all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from xml.etree.ElementTree import Element

from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.files.screening.inclusion import Place, Reading, read_model, read_tree
from heelstrike.robot.files.screening.mechanics_only import leave_mechanics
from heelstrike.robot.files.screening.mesh_files import name_mesh_files
from heelstrike.robot.files.screening.retired import renew
from heelstrike.robot.files.screening.xml_tree import MOST_ELEMENTS, Node, xml_text

LONGEST_NUMBERS = 100_000
"""Letters up to which every number of an attribute is looked at."""

_MULTIPLIERS = ("replicate", "composite", "flexcomp")
_MAY_BE_ENDLESS = ("range", "lower", "upper", "effort", "velocity")


@dataclass(frozen=True)
class Screened:
    """A robot file that may be parsed."""

    xml: Node
    """Its tree, with what it includes in place, without what plays no part in motion."""
    models: dict[str, bytes]
    """Texts of the models that it joins to itself, by the names under which the text has them."""
    flexible: bool
    """Whether it had flexible bodies."""
    massless: bool = False
    """Whether bodies without mass may move, as in formats other than MJCF."""


def screen(source: Path | str, label: str, packages: Sequence[Path] = ()) -> Screened:
    """Refuse what is no robot file, or one that would hurt the machine.

    Parameters
    ----------
    source : Path or str
        Path of the file, or the XML text itself.
    label : str
        What to call it in messages.
    packages : sequence of Path
        Folders of models that an SDF file may include, or that hold such.

    Returns
    -------
    Screened
        The file as the parser may have it.

    Raises
    ------
    RobotError
        With the file and what to do about it.
    """
    reading = Reading(label, packages=packages)
    root, place = read_tree(source, reading)
    if root.tag not in ("mujoco", "robot", "sdf"):
        raise RobotError(
            f"{label}: it begins with <{root.tag[:60]}>; MJCF begins with <mujoco>, URDF with "
            "<robot>, SDF with <sdf>."
        )
    flexible = _screen_tree(root, label, place, reading)
    models = {name: xml_text(model).encode() for name, model in reading.models.items()}
    return Screened(root, models, flexible)


def _screen_tree(root: Node, label: str, place: Place, reading: Reading) -> bool:
    """Screen a tree and the models that it joins; return whether they had flexible bodies."""
    _check_values(root, label)
    if root.tag != "mujoco":
        return False
    flexible = any(element.tag in ("flex", "flexcomp") for element in root.iter())
    for element in [model for asset in root.iter("asset") for model in asset.iter("model")]:
        name = f"model{len(reading.models)}.xml"
        model, there = read_model(element, label, place, reading)
        reading.models[name] = model
        flexible |= _screen_tree(model, f"{reading.label}: model {there.above[-1]}", there, reading)
        element.set("file", name)
    _refuse_copies(root, label)
    renew(root, label)
    leave_mechanics(root)
    name_mesh_files(root, label, place)
    return flexible


def _refuse_copies(root: Element, label: str) -> None:
    """Refuse counts that a slip of the pen made: their process would bear them, but not at once."""
    total = 0.0
    stack = [(root, 1.0)]
    while stack:
        element, copies = stack.pop()
        if element.tag in _MULTIPLIERS:
            with suppress(ValueError):  # not a number: MuJoCo's parser says so
                copies *= math.prod(map(float, element.get("count", "1").split()))
            total += copies
        total += copies
        if not total <= MOST_ELEMENTS:
            raise RobotError(
                f"{label}: line {getattr(element, 'line', 0)}: with <{element.tag[:60]}> the robot "
                f"comes to more than {MOST_ELEMENTS} elements, copies included, which no robot "
                "needs. Lower the count of <replicate> and <composite>, or leave parts out."
            )
        stack.extend((child, copies) for child in reversed(element))


def _check_values(root: Element, label: str) -> None:
    """Refuse values that no parser notices."""
    for element in root.iter():
        for name, text in element.attrib.items():
            if name != "name" and not _LETTERS_OF_NO_NUMBER.isdisjoint(text):
                _refuse_what_is_no_number(element, name, text, label)


_LETTERS_OF_NO_NUMBER = frozenset("neNE")  # of nan, inf and 1e999


def _refuse_what_is_no_number(element: Element, name: str, text: str, label: str) -> None:
    """Refuse NaN, which MuJoCo's parser lets pass into axes and limits, and infinite masses."""
    if len(text) > LONGEST_NUMBERS:  # the corners of a mesh, of which only NaN passes a parser
        text = "nan" if "nan" in text.lower() else ""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        return  # words: other readers judge them
    nan = any(map(math.isnan, numbers))
    if nan or (any(map(math.isinf, numbers)) and not name.endswith(_MAY_BE_ENDLESS)):
        called = f" {element.get('name')!r}" if element.get("name") else ""
        line = getattr(element, "line", 0)
        raise RobotError(
            f"{label}: {f'line {line}: ' if line else ''}{name!r} of <{element.tag}>{called} is "
            f"{text[:60]!r}, which is not a finite number."
        )
