"""A look at a robot file before MuJoCo's parser runs on it.

A file may come from anywhere. What makes a parser hang, crash or fill the memory is refused here:
devices, entities, elements that multiply themselves, sizes beyond all robots. What only costs
memory and plays no part in a robot's motion (textures, sensors, keyframes …) does not reach the
parser at all. Everything else is left to MuJoCo, whose messages name line and element.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.files.screening.inclusion import Place, Reading, read_model, read_tree
from heelstrike.robot.files.screening.mechanics_only import leave_mechanics
from heelstrike.robot.files.screening.mesh_files import name_mesh_files
from heelstrike.robot.files.screening.retired import renew
from heelstrike.robot.files.screening.xml_tree import DEEPEST, MOST_ELEMENTS, Node, xml_text

MOST_BODIES = 4000
"""Most bodies that a robot file may come to, copies included. Classes count as bodies, and what
takes a parser longer (meshes, replicas, joined models) as eight."""

LARGEST_SIZE = 10_000
"""Largest number in ``<size>``, and of rows, columns and pixels of height fields and textures."""

MOST_CELLS = 64 * 2**20
"""Most pixels of all textures together, and most points of all height fields."""

LARGEST_MEMORY = 64 * 2**30
"""Bytes; largest working memory that a file may ask MuJoCo for."""

LONGEST_NAME = 1000
"""Letters."""

LONGEST_NUMBERS = 100_000
"""Letters up to which every number of an attribute is looked at."""

_CELLS = {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}
_SIZED = {**_CELLS, "general": ("actdim",), "numeric": ("size",), "mesh": ("params",)}
_LARGEST = {"mesh": 100.0}  # corners around a mesh that MuJoCo makes itself
_MAY_BE_LARGE = ("nstack", "njmax", "nconmax")
_UNITS = {letter: 1024.0 ** (power + 1) for power, letter in enumerate("KMGTPE")}
_MAY_BE_ENDLESS = ("range", "lower", "upper", "effort", "velocity")
_MULTIPLIERS = ("replicate", "composite", "flexcomp")
# What MuJoCo takes long for; mostly its time grows with the square of their number.
_HEAVY = {
    **{"body": 1, "link": 1, "default": 1},
    **{"replicate": 8, "attach": 8, "model": 8, "mesh": 8},
}
_MADE = 200  # what a mesh weighs that MuJoCo makes itself: nobody sees its corners
_WEIGHED = {*_MULTIPLIERS, "attach", "model", "mesh"}
# What has brought parsers down: they read files of other formats, or join models.
_DELICATE = {"mesh", "plugin", "composite", "model", "attach"}


@dataclass(frozen=True)
class Screened:
    """A robot file that may be parsed."""

    xml: Node
    """Its tree, with what it includes in place, without what plays no part in motion."""
    text: str
    """The text of this tree; that of the file itself, where the two are the same."""
    models: dict[str, bytes]
    """Texts of the models that it joins to itself, by the names under which the text has them."""
    delicate: bool
    """Whether it holds what parsers have died of, so that it should be tried apart first."""
    flexible: bool
    """Whether it had flexible bodies."""
    massless: bool = False
    """Whether bodies without mass may move, as in formats other than MJCF."""


class _Weight(NamedTuple):
    """How much a file comes to when everything in it is multiplied out."""

    elements: float
    bodies: float
    depth: int


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
    root, place, text = read_tree(source, reading)
    if root.tag not in ("mujoco", "robot", "sdf"):
        raise RobotError(
            f"{label}: it begins with <{root.tag[:60]}>; MJCF begins with <mujoco>, URDF with "
            "<robot>, SDF with <sdf>."
        )
    tags: set[str] = set()
    changed, _ = _screen_tree(root, label, place, reading, tags)
    if (changed or reading.elements or root.mended) and root.tag == "mujoco":
        text = xml_text(root)
    models = {name: xml_text(model).encode() for name, model in reading.models.items()}
    return Screened(
        root,
        text,
        models,
        delicate=not tags.isdisjoint(_DELICATE),
        flexible=not tags.isdisjoint(("flex", "flexcomp")),
    )


def _screen_tree(
    root: Node, label: str, place: Place, reading: Reading, tags: set[str]
) -> tuple[bool, _Weight]:
    """Screen a tree and the models that it joins; return whether it had to be changed."""
    count, names = _check_values(root, label, tags)
    weights: dict[str, _Weight] = {}
    changed = False
    if "model" in tags:
        for element in [model for asset in root.iter("asset") for model in asset.iter("model")]:
            name = f"model{len(reading.models)}.xml"
            model, there = read_model(element, label, place, reading)
            reading.models[name] = model
            below = f"{reading.label}: model {there.above[-1]}"
            _, weight = _screen_tree(model, below, there, reading, tags)
            weights[element.get("name") or model.get("model") or ""] = weight
            element.set("file", name)
            changed = True
    weight = _Weight(count, count, DEEPEST)
    if place.above[1:] or reading.elements or count > MOST_BODIES or not tags.isdisjoint(_WEIGHED):
        weight = _weigh(root, label, weights)
    changed |= renew(root, names, label)
    changed |= leave_mechanics(root, tags, names)
    if "mesh" in tags and root.tag == "mujoco":
        changed |= name_mesh_files(root, label, place)
    return changed, weight


def _weigh(root: Element, label: str, models: dict[str, _Weight]) -> _Weight:
    """Count elements, copies included, and refuse too many of them."""
    elements = sum(model.elements for model in models.values())
    bodies = sum(model.bodies for model in models.values())
    deepest = 0
    stack = [(root, 1.0, 1)]
    while stack:
        element, copies, depth = stack.pop()
        tag = element.tag
        elements += copies
        bodies += copies * (_MADE if "builtin" in element.attrib else _HEAVY.get(tag, 0))
        if tag in _MULTIPLIERS:
            copies *= _count(element)
            bodies += copies
        elif tag == "attach":
            # Another model; or a part of this one, which is at most all that came before.
            so_far = _Weight(elements, bodies, deepest)
            joined = models.get(element.get("model", ""), so_far)
            elements += copies * joined.elements
            bodies += copies * joined.bodies
            depth += joined.depth
        deepest = max(deepest, depth)
        if not (elements <= MOST_ELEMENTS and bodies <= MOST_BODIES):
            most = f"{MOST_ELEMENTS} elements" if bodies <= MOST_BODIES else f"{MOST_BODIES} bodies"
            raise RobotError(
                f"{label}: line {getattr(element, 'line', 0)}: with <{tag[:60]}> the robot comes "
                f"to more than {most}, copies included, which no robot needs. Lower the count of "
                "<replicate>, <composite>, <attach> and <mesh>, or leave parts out."
            )
        if deepest > DEEPEST:
            raise RobotError(
                f"{label}: line {getattr(element, 'line', 0)}: more than {DEEPEST} elements inside "
                "one another, which no robot needs."
            )
        stack.extend((child, copies, depth + 1) for child in reversed(element))
    return _Weight(elements, bodies, deepest)


def _check_values(root: Element, label: str, tags: set[str]) -> tuple[int, set[str]]:
    """Refuse values that would hurt; return how many elements there are and their attributes.

    Their tags are added to those of other files.
    """
    names: set[str] = set()
    count = 0
    cells = dict.fromkeys(_CELLS, 0.0)
    for element in root.iter():
        tag, attributes = element.tag, element.attrib
        count += 1
        tags.add(tag)
        names.update(attributes)
        if tag in _SIZED or tag == "size":
            _refuse_sizes(element, label)
        if tag in cells:
            cells[tag] += math.prod(_number(element.get(name, "")) for name in _CELLS[tag])
            if cells[tag] > MOST_CELLS:
                raise RobotError(
                    f"{label}: line {getattr(element, 'line', 0)}: up to this <{tag}> the file "
                    f"asks for more than {MOST_CELLS} points of <{tag}>s together, which no robot "
                    "needs. Make them smaller or leave them out."
                )
        for name, text in attributes.items():
            if name == "name":
                if len(text) > LONGEST_NAME:
                    raise RobotError(
                        f"{label}: line {getattr(element, 'line', 0)}: the name of <{tag[:60]}> "
                        f"has {len(text)} letters. Shorten it to {LONGEST_NAME}."
                    )
            elif not _LETTERS_OF_NO_NUMBER.isdisjoint(text):
                _refuse_what_is_no_number(element, name, text, label)
    return count, names


def _refuse_sizes(element: Element, label: str) -> None:
    """Refuse numbers for which MuJoCo would fill the memory before it looks at the robot."""
    tag = element.tag
    for name in tuple(element.attrib) if tag == "size" else _SIZED[tag]:
        text = element.get(name, "")
        if name == "memory":
            value, largest = _bytes(text), float(LARGEST_MEMORY)
        elif name in _MAY_BE_LARGE:
            value, largest = _number(text), float(LARGEST_MEMORY)
        else:
            value = max((_number(word) for word in text.split()), default=0.0)
            largest = _LARGEST.get(tag, LARGEST_SIZE)
        if value > largest:
            raise RobotError(
                f"{label}: line {getattr(element, 'line', 0)}: {name!r} of <{tag}> is above "
                f"{largest:.0f}, which no robot needs. Lower it."
            )


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
        what = repr(element.get("name")) if element.get("name") else "no name"
        raise RobotError(
            f"{label}: {name!r} of <{element.tag}> ({what}) is {text[:60]!r}, which is no "
            "finite number."
        )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0  # not a number: MuJoCo's parser says so


def _bytes(text: str) -> float:
    """Bytes that are meant by a number with K, M, G … behind it."""
    unit = _UNITS.get(text.strip()[-1:].upper())
    return _number(text) if unit is None else _number(text.strip()[:-1]) * unit


def _count(element: Element) -> float:
    try:
        return math.prod(float(number) for number in element.get("count", "1").split())
    except ValueError:
        return 1.0  # not a number: MuJoCo's parser says so
