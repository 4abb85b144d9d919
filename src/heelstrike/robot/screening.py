"""A look at a robot file before MuJoCo's parser runs on it.

A file may come from anywhere. What makes a parser hang, fill the memory or read other files is
refused here: devices, entities, elements that multiply themselves, sizes beyond all robots.
Everything else is left to MuJoCo, whose messages name line and element.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

from heelstrike.errors import RobotError
from heelstrike.robot.xml_tree import xml_tree

LARGEST_FILE = 16 * 2**20
"""Robot files larger than this (in characters) are refused; the largest we know have 200 kB."""

MOST_COPIES = 10_000
"""Most elements that ``replicate``, ``composite`` and ``flexcomp`` may multiply to."""

MOST_ELEMENTS = 30_000
"""Most XML elements of a robot file, copies included; the largest we know have some 2000."""

LARGEST_SIZE = 10_000
"""Largest number in ``<size>``, and of rows, columns and pixels of height fields and textures."""

_SIZED = {"hfield": ("nrow", "ncol"), "texture": ("width", "height")}
_MAY_BE_LARGE = ("memory", "nstack", "njmax", "nconmax")  # MuJoCo allocates or refuses these
_MAY_BE_ENDLESS = ("range", "lower", "upper", "effort", "velocity")
_MULTIPLIERS = ("replicate", "composite", "flexcomp")


def screen(source: Path | str, label: str) -> Element:
    """Refuse what is no robot file, or one that would hurt the machine.

    Parameters
    ----------
    source : Path or str
        Path of the file, or the XML text itself.
    label : str
        What to call it in messages.

    Returns
    -------
    Element
        The XML tree.

    Raises
    ------
    RobotError
        With the file and what to do about it.
    """
    directory = source.parent if isinstance(source, Path) else Path()
    root = _checked(source, label, directory)
    pending = [root]
    seen: set[Path] = set()
    while pending:
        tree = pending.pop()
        for include in tree.iter("include"):
            path = directory / include.get("file", "")
            if path not in seen and is_readable(path):
                seen.add(path)
                pending.append(_checked(path, f"{label}: included {path}", directory))
    return root


def _checked(source: Path | str, label: str, directory: Path) -> Element:
    """Check one file, without those that it includes."""
    text = _read(source, label) if isinstance(source, Path) else source
    if len(text) > LARGEST_FILE:
        raise RobotError(_too_large(label))
    if not text.strip("\ufeff \t\r\n"):
        raise RobotError(f"{label}: the file is empty.")
    if "\0" in text:
        raise RobotError(f"{label}: this is not a text file; MJCF and URDF are XML text.")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise RobotError(
            f"{label}: it has a document type or entity declaration, which no robot needs and "
            "which can make a parser read other files. Remove it."
        )
    root = xml_tree(text, label)
    _refuse_multiplication(root, label)
    _refuse_sizes(root, label)
    _refuse_what_is_no_number(root, label)
    for path in _files(root, directory):
        if _is_special(path):
            raise RobotError(f"{label}: it reads {str(path)!r}, which is not a regular file.")
    return root


def _read(path: Path, label: str) -> str:
    try:
        if path.is_dir():
            raise RobotError(f"{label}: this is a directory; name the .xml or .urdf file in it.")
        if not path.exists():
            raise RobotError(f"{label}: there is no such file.")
        if not path.is_file():
            raise RobotError(f"{label}: this is not a regular file.")
        if path.stat().st_size > LARGEST_FILE:
            raise RobotError(_too_large(label))
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise RobotError(f"{label}: this is not a text file in UTF-8.") from error
    except RobotError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise RobotError(f"{label}: the file cannot be read: {error}.") from error


def is_readable(path: Path) -> bool:
    """Whether there is a regular file; an impossible name (too long, null character) is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _is_special(path: Path) -> bool:
    """Whether there is something, but not a regular file: a directory, a device, a pipe."""
    try:
        return path.exists() and not path.is_file()
    except (OSError, ValueError):
        return False


def _too_large(label: str) -> str:
    return (
        f"{label}: the file is larger than {LARGEST_FILE // 2**20} MB, which no robot needs; "
        "meshes belong in files of their own."
    )


def _refuse_multiplication(root: Element, label: str) -> None:
    """Refuse elements whose copies, nested ones included, number more than `MOST_COPIES`."""
    stack = [(root, 1.0)]
    total = 0.0
    while stack:
        element, copies = stack.pop()
        total += copies
        if total > MOST_ELEMENTS:
            raise RobotError(
                f"{label}: it has more than {MOST_ELEMENTS} elements, copies included, which no "
                "robot needs."
            )
        if element.tag in _MULTIPLIERS:
            copies *= _count(element)
            if not copies <= MOST_COPIES:
                raise RobotError(
                    f"{label}: <{element.tag}> makes more than {MOST_COPIES} copies of its "
                    "content. Lower its count."
                )
        stack.extend((child, copies) for child in element)


def _refuse_sizes(root: Element, label: str) -> None:
    """Refuse numbers for which MuJoCo would fill the memory before it looks at the robot."""
    for element in root.iter():
        names = tuple(element.attrib) if element.tag == "size" else _SIZED.get(element.tag, ())
        for name in names:
            if name not in _MAY_BE_LARGE and _number(element.get(name, "")) > LARGEST_SIZE:
                raise RobotError(
                    f"{label}: {name!r} of <{element.tag}> is above {LARGEST_SIZE}, which no robot "
                    "needs. Lower it."
                )


def _refuse_what_is_no_number(root: Element, label: str) -> None:
    """Refuse NaN, which MuJoCo's parser lets pass into axes and limits, and infinite masses."""
    for element in root.iter():
        for name, text in element.attrib.items():
            if name == "name" or not set(text.lower()) & set("ne"):  # of nan, inf and 1e999
                continue
            try:
                numbers = [float(word) for word in text.split()]
            except ValueError:
                continue  # words: other readers judge them
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


def _count(element: Element) -> float:
    try:
        return math.prod(float(number) for number in element.get("count", "1").split())
    except ValueError:
        return 1.0  # not a number: MuJoCo's parser says so


def _files(root: Element, directory: Path) -> Iterator[Path]:
    """Files that the robot names, in every directory where MuJoCo may look for them."""
    folders = [directory]
    for compiler in root.iter("compiler"):
        for attribute in ("meshdir", "texturedir", "assetdir"):
            if attribute in compiler.attrib:
                folders.append(directory / compiler.attrib[attribute])
    for element in root.iter():
        for attribute in ("file", "filename"):
            name = element.get(attribute)
            if name:
                yield from (folder / name for folder in folders)
