"""What URDF files need before and after MuJoCo's parser: meshes, massless links, the root."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from heelstrike.errors import RobotError
from heelstrike.robot.files.flattening import mend_planar_root
from heelstrike.robot.files.screening.mesh_files import refuse_large_meshes
from heelstrike.robot.warning import warn

MASSLESS = 1e-14  # kg; no link that is meant to weigh anything weighs less
DEEPEST_FOLDER = 40  # most folders in the path of a mesh
_SMALLEST = 2e-15  # what MuJoCo takes for a massless link, just above its own limit


def urdf_text(xml: Element, directory: Path, label: str) -> str:
    """Return a URDF without what is only looked at, and with the meshes that are really there.

    Visual shapes play no part in mechanics, and their files are often missing. A collision mesh
    whose file cannot be found is left out with a warning, if its link has an inertia of its own.

    Raises
    ------
    RobotError
        If it has none, or if the meshes are too large.
    """
    root = deepcopy(xml)
    missing: list[str] = []
    weighed: list[str] = []
    size = 0
    for link in root.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        has_inertia = link.find("inertial") is not None
        if not has_inertia and link.find("collision") is not None:
            weighed.append(link.get("name", ""))
        for collision in link.findall("collision"):
            mesh = collision.find("geometry/mesh")
            if mesh is None:
                continue
            file = _found(mesh.get("filename", ""), directory)
            if file is not None:
                mesh.set("filename", str(file))
                size += file.stat().st_size
            elif has_inertia:
                link.remove(collision)
                missing.append(link.get("name", ""))
            else:
                raise RobotError(
                    f"{label}: the collision mesh of link {link.get('name')!r}, "
                    f"{mesh.get('filename', '')[:200]!r}, is not where the file says, and the link "
                    "has no <inertial>. Give it one, or the mesh file beside the URDF."
                )
    refuse_large_meshes(size, label)
    for extension in root.findall("mujoco"):  # requests for memory, which play no part here
        for request in extension.findall("size"):
            extension.remove(request)
    _keep_paths(root)
    if missing:
        warn(
            f"{label}: the collision meshes of {', '.join(missing)} are not where the file says, "
            "so these links cannot touch the ground. If one is a foot, give it a <collision> with "
            "a box, or with spheres at heel and toe."
        )
    if weighed:
        warn(
            f"{label}: {', '.join(weighed)} have no <inertial>; their masses are those of their "
            "collision shapes at 1000 kg/m³. Give them an <inertial>."
        )
    return ElementTree.tostring(root, encoding="unicode")


def prepare_urdf(spec: Any) -> None:
    """Let massless links pass, and give a planar root the coordinates x, z and pitch."""
    let_massless_links_pass(spec)
    mend_planar_root(spec)


def let_massless_links_pass(spec: Any) -> None:
    """Give massless links the least mass that MuJoCo takes, below `MASSLESS`."""
    spec.compiler.boundmass = max(spec.compiler.boundmass, _SMALLEST)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, _SMALLEST)


def _keep_paths(root: Element) -> None:
    """Tell MuJoCo, which strips paths by default, that ours are whole."""
    if root.find("link/collision/geometry/mesh") is None:
        return
    extension = root.find("mujoco")
    extension = SubElement(root, "mujoco") if extension is None else extension
    compiler = extension.find("compiler")
    compiler = SubElement(extension, "compiler") if compiler is None else compiler
    compiler.set("strippath", "false")
    compiler.attrib.pop("meshdir", None)


def _found(name: str, directory: Path) -> Path | None:
    """File of a mesh, sought where ROS packages and MuJoCo have it."""
    plain = name.split("://", 1)[-1]
    parts = Path(plain).parts
    if len(parts) > DEEPEST_FOLDER:
        return None
    for first in range(len(parts)):
        candidate = directory.joinpath(*parts[first:])
        try:
            if candidate.is_file():
                return candidate.resolve()
        except (OSError, ValueError):  # no possible name of a file
            return None
    return None
