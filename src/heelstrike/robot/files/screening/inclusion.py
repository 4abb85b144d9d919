"""A robot file and the files that it includes, read and joined into one tree.

Files are found as MuJoCo finds them: beside the main file first, then beside the one that names
them. What is read is bounded as a whole, so that a file cannot include itself, a thousand others,
or the same one again and again.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import field
from pathlib import Path
from xml.etree.ElementTree import Element

from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.files.looks import is_file, is_there, will_read
from heelstrike.robot.files.packages import find_model
from heelstrike.robot.files.screening.xml_tree import MOST_ELEMENTS, Node, xml_tree

LARGEST_FILE = 16 * 2**20
"""Robot files larger than this (in bytes), with all that they include, are refused; the largest we
know have 200 kB."""

DEEPEST_INCLUDE = 20
"""Most files that include one another in a chain."""

_AROUND = "\0\ufeff \t\r\n"  # what a text may have before and after it

MOST_FILES = 500
"""Most files that a robot is made of, each counted as often as it is included."""


@dataclass
class Reading:
    """What has been read for one robot."""

    label: str
    """What to call the main file in messages."""
    files: int = 0
    characters: int = 0
    elements: int = 0
    """files, characters, elements: How much has been read, repetitions included."""
    models: dict[str, Node] = field(default_factory=dict)
    """The other models (``<asset><model>``) of the robot, by names for the parser's eyes."""
    packages: Sequence[Path] = ()
    """Folders of packages and models, or that hold such."""


@dataclass(frozen=True)
class Place:
    """Where a file stands: what relative paths in it mean."""

    main: Path
    """Folder of the main file, sought first."""
    own: Path
    """Folder of the file itself."""
    above: tuple[Path, ...] = ()
    """The files that are being read, from the main file to this one; all but the main file by their
    resolved paths."""


def read_tree(source: Path | str, reading: Reading) -> tuple[Node, Place]:
    """Read a file or text with what it includes.

    Returns
    -------
    Node
        The tree, included elements in the place of ``<include>``.
    Place
        Where it stands.

    Raises
    ------
    RobotError
        If a file cannot be read, is no robot file, includes itself, or if it is all too much.
    """
    if isinstance(source, Path):
        place = Place(source.parent, source.parent, (source,))
    else:
        place = Place(Path(), Path())
    text = plain(_read(source, reading.label) if isinstance(source, Path) else source)
    return _tree(text, reading.label, place, reading), place


def plain(text: str) -> str:
    """Return a text without what editors leave around it, every line where it was.

    That is null characters and byte order marks at both ends, and blank lines before the XML
    declaration, which has to come first. The declaration goes: it says nothing, and some are wrong.
    """
    bare = text.lstrip(_AROUND)
    if not bare:
        return text  # which is refused
    end = bare.find("?>") + 2 if bare.startswith("<?xml") else 0
    lines = text[: len(text) - len(bare) + end].count("\n")
    return "\n" * lines + bare[end:].rstrip(_AROUND)


def _tree(text: str, label: str, place: Place, reading: Reading) -> Node:
    """Return the tree of one file, with what it includes."""
    reading.characters += len(text)
    if reading.characters > LARGEST_FILE:
        raise RobotError(_too_large(reading.label))
    if not text.strip("\ufeff \t\r\n"):
        raise RobotError(f"{label}: the file is empty.")
    if "\0" in text:
        raise RobotError(f"{label}: this is not a text file; MJCF and URDF are XML text.")
    root = xml_tree(text, label)
    if root.tag.lower() == "robot":
        return root  # it includes nothing of this kind
    # MuJoCo takes <INCLUDE> for <include>.
    parents = [e for e in root.iter() if any(c.tag.lower() == "include" for c in e)]
    put = _included_models if root.tag == "sdf" else _included
    for parent in parents:
        for index in range(len(parent) - 1, -1, -1):
            if parent[index].tag.lower() == "include":
                parent[index : index + 1] = put(parent[index], label, place, reading)
    return root


def _included(include: Element, label: str, place: Place, reading: Reading) -> list[Element]:
    """Return the elements that a file puts in the place of an ``<include>``."""
    name = include.get("file", "")
    line = getattr(include, "line", 0)
    where = f"{label}: line {line}: <include>"
    if not name or len(include):
        raise RobotError(f'{where} must name a file and hold nothing: <include file="part.xml"/>.')
    path = _found(name, (place.main, place.own))
    if path is None:
        raise RobotError(
            f"{where} names {name[:200]!r}, which is not there. It is sought beside the main file "
            "and beside the one that includes it."
        )
    root = _below(path, f"{reading.label}: included {path}", where, place, reading)
    if not len(root):
        raise RobotError(f"{where}: the file {name!r} has nothing in it. Remove the <include>.")
    _join(root, path, line, where, reading)
    return list(root)


def _included_models(include: Element, label: str, place: Place, reading: Reading) -> list[Element]:
    """Return the model that an SDF file means by an ``<include>``, with the name and place there.

    One that is nowhere, of a world's ground or sun, stays as it is.
    """
    line = getattr(include, "line", 0)
    where = f"{label}: line {line}: <include>"
    address = (include.findtext("uri") or "").strip()
    path = find_model(address, place.own, reading.packages)
    if path is None:
        return [include]
    root = _below(path, f"{reading.label}: included {path}", where, place, reading)
    models = root.findall("model")
    if root.tag != "sdf" or len(models) != 1:
        raise RobotError(f"{where}: {path.name} is no SDF file of one <model>.")
    _join(root, path, line, where, reading)
    if root.get("version", "1.7") in ("1.2", "1.3", "1.4"):
        raise RobotError(
            f"{where}: {path.name} is of SDF version {root.get('version')}, in which axes mean "
            "something else. Gazebo's `gz sdf -p` writes a newer one."
        )
    (model,) = models
    for tag in ("pose", "static"):
        given = include.find(tag)
        if given is not None:
            for old in model.findall(tag):
                model.remove(old)
            model.insert(0, given)
    if include.find("pose") is not None:
        model.attrib.pop("placement_frame", None)
    changes = {tag: (include.findtext(tag) or "").strip() for tag in ("name", "placement_frame")}
    model.attrib.update({name: value for name, value in changes.items() if value})
    if isinstance(model, Node):
        model.merged = include.get("merge") in ("true", "1")
    return [model]


def _join(root: Element, path: Path, line: int, where: str, reading: Reading) -> None:
    """Count what a file adds to a robot, and let it stand on the line that brought it."""
    reading.elements += sum(1 for _ in root.iter())
    if reading.elements > MOST_ELEMENTS:
        raise RobotError(
            f"{where}: with what it includes, the robot has more than {MOST_ELEMENTS} elements, "
            "which no robot needs."
        )
    for element in root.iter():
        if isinstance(element, Node):
            element.line = line
            element.folder = element.folder or path.parent


def _below(path: Path, label: str, where: str, place: Place, reading: Reading) -> Node:
    """Read a file that another one names."""
    here = resolved(path)
    # The main file stands there as it is named: most robots include nothing, and save the detour.
    if here in place.above or here in map(resolved, place.above[:1]):
        raise RobotError(f"{where}: {path.name} includes itself, directly or by others.")
    if len(place.above) > DEEPEST_INCLUDE:
        raise RobotError(
            f"{reading.label}: more than {DEEPEST_INCLUDE} files include one another in a chain, "
            f"the last of them {path.name}, which no robot needs. Join some of them."
        )
    reading.files += 1
    if reading.files > MOST_FILES:
        raise RobotError(
            f"{reading.label}: it is made of more than {MOST_FILES} files, repetitions included, "
            "which no robot needs. Join some of them."
        )
    below = Place(place.main, path.parent, (*place.above, here))
    return _tree(plain(_read(path, label)), label, below, reading)


def read_model(element: Element, label: str, place: Place, reading: Reading) -> tuple[Node, Place]:
    """Read the file of an ``<asset><model>``, whose paths begin at its own folder.

    Raises
    ------
    RobotError
        As `read_tree`.
    """
    name = element.get("file", "")
    where = f"{label}: line {getattr(element, 'line', 0)}: <model>"
    folder = getattr(element, "folder", None) or place.own
    path = _found(name, (place.main, folder)) if name else None
    if path is None:
        raise RobotError(f"{where} names {name[:200]!r}, which is not there.")
    below = Place(path.parent, path.parent, place.above)
    root = _below(path, f"{reading.label}: model {path}", where, below, reading)
    if root.tag != "mujoco":
        raise RobotError(f"{where} names {name[:200]!r}, which is no MJCF file.")
    return root, Place(path.parent, path.parent, (*place.above, resolved(path)))


def _found(name: str, folders: Iterable[Path]) -> Path | None:
    """Return the file that a name means, None if it is nowhere."""
    return next((path for folder in folders if is_there(path := folder / name)), None)


def resolved(path: Path) -> Path:
    """Path without links and detours, where there is one."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # links in a circle, impossible names
        return path


def _read(path: Path, label: str) -> str:
    try:
        if path.is_dir():
            raise RobotError(
                f"{label}: this is a directory and not a regular file; name the .xml or .urdf file "
                "in it."
            )
        if not is_there(path):
            raise RobotError(f"{label}: there is no such file.")
        if not is_file(path):
            raise RobotError(f"{label}: this is not a regular file.")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise RobotError(_too_large(label))
        if size == 0:  # and not to be opened: such are the files by which a system speaks
            raise RobotError(f"{label}: the file is empty.")
        with will_read(path).open(encoding="utf-8") as file:
            return file.read(LARGEST_FILE + 1)
    except UnicodeDecodeError as error:
        raise RobotError(f"{label}: this is not a text file in UTF-8.") from error
    except RobotError:
        raise
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        raise RobotError(f"{label}: the file cannot be read: {error}.") from error


def _too_large(label: str) -> str:
    return (
        f"{label}: the file, with what it includes, is larger than {LARGEST_FILE // 2**20} MB, "
        "which no robot needs; meshes belong in files of their own."
    )
