"""Macros of xacro expanded, in another process.

A xacro file is a program: what stands in ``${…}`` is evaluated by Python. So it is expanded only
where the user asks for it, in a process of its own that has a time limit and hands over nothing but
text.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

from heelstrike.errors import RobotError
from heelstrike.reader_process import ReaderProcess, ReadingError
from heelstrike.robot.files.packages import find_package

LONGEST_EXPANSION = 60.0
"""Seconds after which a file counts as one that never ends."""

LARGEST = 16 * 2**20
"""Letters of an expanded file."""

MACRO = "xacro:macro"

LONGEST_REASON = 400  # letters of xacro's own words in a message


def expanded(path: Path, arguments: Mapping[str, str], packages: Sequence[Path], label: str) -> str:
    """Return the text that a xacro file expands to.

    Parameters
    ----------
    path : Path
        The file.
    arguments : mapping
        Values of its ``<xacro:arg>``, by name.
    packages : sequence of Path
        Folders of packages for ``$(find …)``, or that hold such, which are sought first.
    label : str
        What to call it in messages.

    Raises
    ------
    RobotError
        If the package xacro is not installed, the file cannot be expanded, or this takes too long.
    """
    if importlib.util.find_spec("xacro") is None:
        raise RobotError(
            f"{label}: expanding it needs the package xacro: pip install xacro. Or expand it "
            "elsewhere: xacro robot.xacro > robot.urdf"
        )
    order = {
        "file": str(path.resolve()),
        "arguments": {str(name): str(value) for name, value in arguments.items()},
        "packages": [str(folder.resolve()) for folder in packages],
    }
    process = ReaderProcess()  # which no program of a stranger shares with the files after it
    try:
        done = process.ask(
            f"{__name__}:expand", json.dumps(order).encode(), patience=LONGEST_EXPANSION
        )
    except ReadingError as error:
        if not error.kind:
            raise RobotError(f"{label}: xacro {error}.") from error
        said = f"{error.kind}: {error}" if error.kind != "RobotError" else str(error)
        reason = " ".join(said.split())[-LONGEST_REASON:]
        raise RobotError(
            f"{label}: xacro cannot expand this file: {reason}. Values of "
            'its <xacro:arg> are given as xacro={"name": "value"}, folders of packages that it '
            "finds as package_path=…."
        ) from error
    finally:
        process.end()
    return done.decode("utf-8", "replace")


def expand(order: bytes) -> bytes:
    """Expand a file in this process, whatever it does."""
    asked = json.loads(order)
    text = _expand(asked["file"], asked["arguments"], asked["packages"])
    if len(text) > LARGEST:
        raise RobotError(f"it expands to more than {LARGEST} letters, which no robot needs")
    return text.encode("utf-8", "replace")


def _expand(file: str, arguments: dict[str, str], packages: list[str]) -> str:
    """Expand a file in this process, with packages found as heelstrike finds them."""

    def share_directory(name: str) -> str:
        folder = find_package(name, Path(file).parent, [Path(each) for each in packages])
        if folder is None:
            raise KeyError(f"package {name!r} is not found.")
        return str(folder)

    # What xacro asks for packages, which comes with ROS only.
    ament, inner = ModuleType("ament_index_python"), ModuleType("ament_index_python.packages")
    inner.get_package_share_directory = share_directory  # type: ignore[attr-defined]
    inner.PackageNotFoundError = KeyError  # type: ignore[attr-defined]
    ament.packages = inner  # type: ignore[attr-defined]
    sys.modules |= {"ament_index_python": ament, "ament_index_python.packages": inner}

    xacro = importlib.import_module("xacro")
    try:
        document = xacro.process_file(file, mappings=arguments)
    except xacro.XacroException as error:
        # Xacro once read all macros first, and files of that time call them before.
        if "unknown macro" not in str(error):
            raise
        xacro.init_stacks(file)
        document = xacro.parse(None, file)
        root = document.documentElement
        for macro in reversed([each for each in root.childNodes if each.nodeName == MACRO]):
            root.insertBefore(macro, root.firstChild)
        xacro.process_doc(document, mappings=arguments)
    return str(document.toprettyxml(indent=" "))
