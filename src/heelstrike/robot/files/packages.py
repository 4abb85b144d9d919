"""Files that a robot file names by ``package://``, found where ROS keeps packages."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

from heelstrike.robot.files.looks import folders_in, is_file, is_folder, will_read

FOLDERS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
"""Environment variables that name folders of packages."""

DEEPEST_FOLDER = 40  # most folders in the path of a file, and above a robot file
DEEPEST_PACKAGE = 3  # folders below one of ROS_PACKAGE_PATH in which packages are sought
MOST_FOLDERS = 2000  # that are looked into for one package

LONGEST_CONFIGURATION = 100_000  # letters of a model.config
_SDF_FILE = re.compile(r"<sdf[^>]*>\s*([\w.-]+)\s*</sdf>")

_SCHEMES = ("package://", "model://", "file://")


def find_file(name: str, directory: Path, packages: Sequence[Path]) -> Path | None:
    """Return the file that a robot file means, None if it is not there.

    Parameters
    ----------
    name : str
        A path, or an address that begins with package://, model:// or file://.
    directory : Path
        Folder of the robot file.
    packages : sequence of Path
        Folders of packages, or that hold such, which are sought first.
    """
    scheme = next((each for each in _SCHEMES if name.startswith(each)), "")
    plain = name[len(scheme) :].replace("\\", "/")
    if "%" in plain and scheme:
        plain = unquote(plain)
    parts = Path(plain).parts
    if not parts or len(parts) > DEEPEST_FOLDER or "\0" in plain:
        return None
    if scheme in ("package://", "model://"):
        for folder in _package_folders(parts[0], directory, packages):
            if is_file(path := folder.joinpath(*parts[1:])):
                return path.resolve()
    # Beside the robot file; packages were often copied without the folders around them.
    for first in range(len(parts)):
        if is_file(path := directory.joinpath(*parts[first:])):
            return path.resolve()
    return None


def find_package(name: str, directory: Path, packages: Sequence[Path]) -> Path | None:
    """Return the folder of a package, None if it is not there.

    Parameters
    ----------
    name : str
        Name of the package.
    directory : Path
        Folder of the file that names it.
    packages : sequence of Path
        Folders of packages, or that hold such, which are sought first.
    """
    return next((p for p in _package_folders(name, directory, packages) if is_folder(p)), None)


def find_model(name: str, directory: Path, packages: Sequence[Path]) -> Path | None:
    """Return the SDF file that the address of a model means, None if it is not there.

    Parameters
    ----------
    name : str
        A file, or the folder of a model, whose ``model.config`` names its file; a path, or an
        address that begins with model://, package:// or file://.
    directory : Path
        Folder of the file that names it.
    packages : sequence of Path
        Folders of models, or that hold such, which are sought first.
    """
    file = find_file(name, directory, packages)
    if file is not None:
        return file
    plain = name.removeprefix("model://").removeprefix("file://").replace("\\", "/").strip("/")
    if not plain or "\0" in plain or len(Path(plain).parts) > DEEPEST_FOLDER:
        return None
    folder = directory / plain
    if not is_file(folder / "model.sdf") and not is_file(folder / "model.config"):
        found = None if "/" in plain else find_package(plain, directory, packages)
        if found is None:
            return None
        folder = found
    named = _SDF_FILE.search(_text(folder / "model.config"))
    path = folder / (named[1] if named else "model.sdf")
    return path if is_file(path) else None


def _text(path: Path) -> str:
    """Beginning of a small file, nothing where there is none."""
    try:
        with will_read(path).open(encoding="utf-8", errors="replace") as file:
            return file.read(LONGEST_CONFIGURATION)
    except (OSError, ValueError):
        return ""


def _package_folders(name: str, directory: Path, packages: Sequence[Path]) -> Iterator[Path]:
    """Folders that may be a package: asked for, around the robot file, and those of ROS."""
    for folder in packages:
        yield from _packages_in(folder, name)
    try:
        here = directory.resolve()
    except (OSError, RuntimeError):
        here = directory
    for above in (here, *here.parents[:DEEPEST_FOLDER]):
        if above.name == name or (is_file(above / "package.xml") and _named(above, name)):
            yield above
        yield above / name
    for folder in _folders_of("ROS_PACKAGE_PATH"):
        yield from _packages_in(folder, name)
    for folder in _folders_of("AMENT_PREFIX_PATH"):
        yield folder / "share" / name


def _packages_in(folder: Path, name: str) -> Iterator[Path]:
    """Return the folder itself, and packages of that name in it, nearest first."""
    if folder.name == name or _named(folder, name):
        yield folder
    level = [folder]
    seen = 0
    for _ in range(DEEPEST_PACKAGE):
        below: list[Path] = []
        for each in level:
            yield each / name
            try:
                inner = folders_in(each)
            except OSError:
                continue
            seen += len(inner)
            if seen > MOST_FOLDERS:
                return
            yield from (path for path in inner if _named(path, name))
            below += inner
        level = below


def _named(folder: Path, name: str) -> bool:
    """Whether a folder is a package of a name that differs from its own."""
    manifest = folder / "package.xml"
    try:
        return is_file(manifest) and (
            f"<name>{name}</name>" in will_read(manifest).read_text("utf-8")[:10_000]
        )
    except (OSError, ValueError):
        return False


def _folders_of(variable: str) -> list[Path]:
    return [Path(text) for text in os.environ.get(variable, "").split(os.pathsep) if text]
