"""The mesh files of an MJCF file, found as MuJoCo finds them and named by whole paths."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePath
from xml.etree.ElementTree import Element, SubElement

from heelstrike.errors import RobotError
from heelstrike.robot.files.looks import is_file, is_there, will_read
from heelstrike.robot.files.screening.inclusion import Place, resolved
from heelstrike.robot.warning import warn
from heelstrike.wording import some_of

LARGEST_MESHES = 256 * 2**20
"""Bytes of all mesh files of a robot together."""

SHOWN = 6  # bodies that a message names before it counts the rest

MOST_FACES = 200_000
"""Most faces of an .stl file that MuJoCo reads."""


def name_mesh_files(root: Element, label: str, place: Place) -> None:
    """Give every mesh of a tree the whole path of its file.

    The parser then opens these files and no others, wherever it runs.

    Raises
    ------
    RobotError
        If a file that a body is weighed by is not there, one is a directory, device or pipe, or
        they are too large together.
    """
    meshes = [mesh for asset in root.iter("asset") for mesh in asset.iter("mesh")]
    meshes = [mesh for mesh in meshes if mesh.get("file")]
    if not meshes:
        return
    meshdir = assetdir = ""
    stripped = False
    for compiler in root.iter("compiler"):
        meshdir = compiler.attrib.pop("meshdir", meshdir)
        assetdir = compiler.attrib.pop("assetdir", assetdir)
        stripped = compiler.attrib.pop("strippath", str(stripped)).lower() == "true"
    size = 0
    missing: dict[str, str] = {}
    for mesh in meshes:
        name = mesh.get("file", "")
        name = PurePath(name.replace("\\", "/")).name if stripped else name
        sought = _candidates(name, meshdir or assetdir, place, getattr(mesh, "folder", None))
        path = next((path for path in sought if is_there(path)), None)
        where = f"{label}: line {getattr(mesh, 'line', 0)}: <mesh>"
        if path is None:
            missing[mesh.get("name") or PurePath(name).stem] = f"{where} names {name[:200]!r}"
            continue
        if not is_file(path):
            raise RobotError(f"{where} names {str(path)!r}, which is not a regular file.")
        size += path.stat().st_size
        mesh.set("file", str(resolved(will_read(path))))
    refuse_large_meshes(size, label)
    if missing:
        _leave_out(root, missing)
    # One more compiler element: MuJoCo reads them all, the last one last.
    SubElement(root, "compiler", {"strippath": "false"})


def is_mesh(file: Path) -> bool:
    """Whether a file is a mesh in a format that MuJoCo reads: .obj, .msh or binary .stl."""
    kind = file.suffix.lower()
    if kind != ".stl":
        return kind in (".obj", ".msh") and is_file(will_read(file))
    try:
        with will_read(file).open("rb") as stream:
            header = stream.read(84)
        size = file.stat().st_size
    except OSError:
        return False
    faces = int.from_bytes(header[80:84], "little")
    return len(header) == 84 and 0 < faces <= MOST_FACES and size >= 84 + 50 * faces


def _leave_out(root: Element, missing: dict[str, str]) -> None:
    """Leave out geoms whose meshes are not there, on bodies that state their inertia themselves.

    Raises
    ------
    RobotError
        If a body is weighed by such a geom.

    Warns
    -----
    RobotWarning
        Of the bodies that cannot touch the ground with them.
    """
    first = next(iter(missing.values()))
    weighed = any(each.get("inertiafromgeom") == "true" for each in root.iter("compiler"))
    for default in root.iter("default"):
        if any(geom.get("mesh") in missing for geom in default.iterfind("geom")):
            raise RobotError(f"{first}, which is not there, for a class of geoms.")
    bare = []
    for body in root.iter():
        gone = [each for each in body if each.tag == "geom" and each.get("mesh") in missing]
        if not gone:
            continue
        if body.tag == "body" and (weighed or body.find("inertial") is None):
            raise RobotError(
                f"{first}, which is not there, and the body {body.get('name', '')!r} has its mass "
                "from meshes. Meshes are sought from the folder of the robot file, through the "
                "'meshdir' of its <compiler>. Give the body an <inertial>, or the mesh."
            )
        for each in gone:
            body.remove(each)
        bare.append(body.get("name") or body.tag)
    for asset in root.iter("asset"):
        for mesh in asset.findall("mesh"):
            name = mesh.get("name") or PurePath(mesh.get("file", "").replace("\\", "/")).stem
            if name in missing:
                asset.remove(mesh)
    if bare:
        warn(
            f"{first}, which is not there: {len(missing)} meshes are missing, and "
            f"{some_of(bare, SHOWN)} cannot touch the ground with them. If one is a foot, give it "
            "a box, or spheres at heel and toe."
        )


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
