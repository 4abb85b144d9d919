"""The mesh files of an MJCF file, found as MuJoCo finds them and named by whole paths."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePath
from xml.etree.ElementTree import Element, SubElement

from heelstrike.errors import RobotError
from heelstrike.robot.files.screening.inclusion import Place, is_readable, is_there, resolved

LARGEST_MESHES = 256 * 2**20
"""Bytes of all mesh files of a robot together."""

MOST_FACES = 200_000
"""Most faces of an .stl file that MuJoCo reads."""


def name_mesh_files(root: Element, label: str, place: Place) -> bool:
    """Give every mesh of a tree the whole path of its file; return whether one has a file.

    The parser then opens these files and no others, wherever it runs.

    Raises
    ------
    RobotError
        If a file is not there, is a directory, device or pipe, or they are too large together.
    """
    meshes = [mesh for asset in root.iter("asset") for mesh in asset.iter("mesh")]
    meshes = [mesh for mesh in meshes if mesh.get("file")]
    if not meshes:
        return False
    meshdir = assetdir = ""
    stripped = False
    for compiler in root.iter("compiler"):
        meshdir = compiler.attrib.pop("meshdir", meshdir)
        assetdir = compiler.attrib.pop("assetdir", assetdir)
        stripped = compiler.attrib.pop("strippath", str(stripped)).lower() == "true"
    size = 0
    for mesh in meshes:
        name = mesh.get("file", "")
        name = PurePath(name.replace("\\", "/")).name if stripped else name
        sought = _candidates(name, meshdir or assetdir, place, getattr(mesh, "folder", None))
        path = next((path for path in sought if is_there(path)), None)
        where = f"{label}: line {getattr(mesh, 'line', 0)}: <mesh>"
        if path is None:
            raise RobotError(
                f"{where} names {name[:200]!r}, which is not there. It is sought from the folder of"
                " the robot file, through the 'meshdir' of its <compiler>."
            )
        if not is_readable(path):
            raise RobotError(f"{where} names {str(path)!r}, which is not a regular file.")
        size += path.stat().st_size
        mesh.set("file", str(resolved(path)))
    refuse_large_meshes(size, label)
    # One more compiler element: MuJoCo reads them all, the last one last.
    SubElement(root, "compiler", {"strippath": "false"})
    return True


def is_mesh(file: Path) -> bool:
    """Whether a file is a mesh in a format that MuJoCo reads: .obj, .msh or binary .stl."""
    kind = file.suffix.lower()
    if kind != ".stl":
        return kind in (".obj", ".msh")
    try:
        with file.open("rb") as stream:
            header = stream.read(84)
        size = file.stat().st_size
    except OSError:
        return False
    faces = int.from_bytes(header[80:84], "little")
    return len(header) == 84 and 0 < faces <= MOST_FACES and size >= 84 + 50 * faces


def refuse_large_meshes(size: int, label: str) -> None:
    """Refuse mesh files of too many bytes together.

    Raises
    ------
    RobotError
        In words.
    """
    if size > LARGEST_MESHES:
        raise RobotError(
            f"{label}: its mesh files have {size / 2**20:.0f} MB together, and no robot needs more "
            f"than {LARGEST_MESHES // 2**20} MB. Give it coarser ones."
        )


def _candidates(name: str, folder: str, place: Place, own: Path | None) -> Iterator[Path]:
    yield place.main / folder / name
    if own is not None:
        yield own / name
