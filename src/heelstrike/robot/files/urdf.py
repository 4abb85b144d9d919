"""URDF files as people write them, made such that MuJoCo's parser reads what they mean."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from heelstrike.errors import RobotError
from heelstrike.robot.files.packages import find_file
from heelstrike.robot.files.screening.mesh_files import is_mesh, refuse_large_meshes
from heelstrike.robot.files.screening.xml_tree import Node, xml_text
from heelstrike.robot.warning import warn

WORLD = "world"
_SMALLEST = 2e-15  # what MuJoCo takes for a massless link, just above its own limit
_TAGS = {"drake:joint": "joint", "drake:capsule": "capsule"}
_JOINTS = {"planaraxis": "planar", "ball": "spherical"}
_SHAPES = {"box", "sphere", "cylinder", "capsule", "mesh"}
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def urdf_text(root: Node, directory: Path, packages: Sequence[Path], label: str) -> str:
    """Return a URDF in a form that parsers agree on; elements stay on their lines.

    Parameters
    ----------
    root : Node
        The file, which is changed.
    directory : Path
        Its folder.
    packages : sequence of Path
        Folders of packages, or that hold such.
    label : str
        What to call it in messages.

    Raises
    ------
    RobotError
        If meshes are too large, or one is not there that the file wants a link weighed by.

    Warns
    -----
    RobotWarning
        Of links without inertia, and of meshes that are left out.
    """
    _mend_world(root)
    _take_the_first(root, label)
    _forget_idle_axes(root)
    _complete_inertias(root, label)
    _find_meshes(root, directory, packages, label)
    for extension in root.findall("mujoco"):  # requests for memory, which play no part here
        for request in extension.findall("size"):
            extension.remove(request)
    _keep_paths(root)
    return xml_text(root)


def weigh_no_shapes(spec: Any) -> None:
    """Let links without ``<inertial>`` weigh nothing, as URDF says; MuJoCo takes 1000 kg/m³.

    A file that asks MuJoCo for inertia from its shapes keeps that.
    """
    import mujoco

    if spec.compiler.inertiafromgeom != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        for geom in spec.geoms:
            geom.density = 0.0


def let_thin_meshes_pass(spec: Any) -> None:
    """Let meshes without volume pass, such as plates, where nothing is weighed by them."""
    import mujoco

    weighing = {
        geom.meshname for geom in spec.geoms if geom.density and not geom.parent.explicitinertial
    }
    for mesh in spec.meshes:
        if mesh.name not in weighing:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


def missing_moments(root: Element) -> dict[str, list[str]]:
    """Moments of inertia, of those about the axes, that links of a URDF do not give."""
    found = {}
    for link in root.iterfind("link"):
        inertia = link.find("inertial/inertia")
        absent = [
            name for name in _MOMENTS[:3] if inertia is not None and name not in inertia.attrib
        ]
        if absent:
            found[link.get("name", "")] = absent
    return found


def translate_dialects(root: Node) -> None:
    """Give what Drake and Dojo add to URDF the names that others know."""
    for element in root.iter():
        element.tag = _TAGS.get(element.tag, element.tag)
        if element.tag == "joint":
            kind = element.get("type", "")
            element.set("type", _JOINTS.get(kind, kind))


def let_massless_links_pass(spec: Any) -> None:
    """Give massless links the least mass that MuJoCo takes, far below any that is meant."""
    spec.compiler.boundmass = max(spec.compiler.boundmass, _SMALLEST)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, _SMALLEST)


def _mend_world(root: Node) -> None:
    """Have a link ``world`` where joints depend on it, without mass, and nowhere below others.

    Parsers know the world by this name: it need not be written down, and it cannot be moved. What
    carries a free robot, and weighs nothing, is the world too.
    """
    links = {link.get("name", ""): link for link in root.iterfind("link")}
    parents = list(root.iterfind("joint/parent"))
    below = {child.get("link") for child in root.iterfind("joint/child")}
    for joint in root.iterfind("joint"):
        base = joint.find("parent")
        name = "" if base is None else base.get("link", "")
        link = links.get(name)
        bare = link is not None and link.find("inertial") is None and name not in below
        if bare and joint.get("type") == "floating" and WORLD not in links:
            links[WORLD] = links.pop(name)
            _rename(links[WORLD], WORLD, parents)
    if WORLD not in links:
        if any(parent.get("link") == WORLD for parent in parents):
            link = Node("link", {"name": WORLD})
            link.line = root.line
            root.insert(0, link)
        return
    if WORLD not in below:
        for inertial in links[WORLD].findall("inertial"):
            links[WORLD].remove(inertial)
        return
    other = WORLD
    while other in links:
        other += "_"
    _rename(links[WORLD], other, [*parents, *root.iterfind("joint/child")])


def _rename(link: Element, name: str, ends: Sequence[Element]) -> None:
    """Give a link another name, at the ends of joints too."""
    old = link.get("name")
    link.set("name", name)
    for end in ends:
        if end.get("link") == old:
            end.set("link", name)


def _take_the_first(root: Node, label: str) -> None:
    """Of two ``<dynamics>`` of a joint the first counts, as for the parsers of ROS."""
    several = []
    for joint in root.iterfind("joint"):
        for more in joint.findall("dynamics")[1:]:
            joint.remove(more)
            several.append(joint.get("name", ""))
    if several:
        warn(f"{label}: {', '.join(several)} have two <dynamics>; the first one counts.")


def _forget_idle_axes(root: Node) -> None:
    """Take away axes of joints that have none: exporters write zeros there."""
    for joint in root.iterfind("joint"):
        if joint.get("type") in ("fixed", "floating"):
            for axis in joint.findall("axis"):
                joint.remove(axis)


def _complete_inertias(root: Node, label: str) -> None:
    """Make a mass without ``<inertia>`` a point; moments that are left out are zero."""
    points = []
    for link in root.iterfind("link"):
        for inertial in link.iterfind("inertial"):
            mass, inertia = inertial.find("mass"), inertial.find("inertia")
            if inertia is None and mass is not None:
                inertia = SubElement(inertial, "inertia")
                if mass.get("value", "").strip(" +0.") != "":
                    points.append(link.get("name", ""))
            if inertia is not None:
                for name in _MOMENTS:
                    if not inertia.get(name, "").strip():
                        inertia.set(name, "0")
    if points:
        warn(
            f"{label}: {', '.join(points)} have a <mass> and no <inertia>; they are point masses. "
            "Give them an <inertia>."
        )


def _find_meshes(root: Node, directory: Path, packages: Sequence[Path], label: str) -> None:
    """Leave the collision meshes that are really there, and nothing that is only looked at.

    Visual shapes play no part in mechanics, and their files are often missing.
    """
    missing: dict[str, str] = {}
    weightless: list[str] = []
    strange: list[str] = []
    size = 0
    from_shapes = any(
        compiler.get("inertiafromgeom") == "true" for compiler in root.iterfind("mujoco/compiler")
    )
    ornaments = {
        child.get("link", "")
        for joint in root.iterfind("joint")
        if joint.get("type") == "fixed"
        for child in joint.findall("child")
    }
    for link in root.iterfind("link"):
        name = link.get("name", "")
        for visual in link.findall("visual"):
            link.remove(visual)
        has_inertia = link.find("inertial") is not None
        if not (has_inertia or from_shapes or name == WORLD) and any(
            not _is_point(shape) for shape in link.findall("collision")
        ):
            weightless.append(name)
        for collision in link.findall("collision"):
            mesh = collision.find("geometry/mesh")
            if mesh is None:
                if not any(shape.tag in _SHAPES for shape in collision.iterfind("geometry/*")):
                    link.remove(collision)
                    strange.append(name)
                continue
            address = mesh.get("filename", "")
            file = find_file(address, directory, packages)
            if file is not None and is_mesh(file):
                mesh.set("filename", str(file))
                size += file.stat().st_size
            elif has_inertia or not from_shapes or name in ornaments:
                link.remove(collision)
                missing.setdefault(name, address)
            else:
                line = getattr(mesh, "line", 0)
                raise RobotError(
                    f"{label}: line {line}: the collision mesh of link {name!r}, "
                    f"{address[:200]!r}, is not where the file says or no mesh that MuJoCo reads "
                    "(binary .stl, .obj), and the link has no <inertial>: the file wants it "
                    'weighed by this mesh (inertiafromgeom="true"). Give it an <inertial>, or the '
                    "mesh file beside the URDF."
                )
    refuse_large_meshes(size, label)
    if missing:
        warn(
            f"{label}: the collision meshes of {', '.join(missing)} are not where the file says, "
            "or no meshes that MuJoCo reads (binary .stl, .obj), so these links cannot touch the "
            "ground. If one is a foot, give it a <collision> with a box, or with spheres at heel "
            f"and toe; or name the folder of its package: package_path=…. The first is "
            f"{next(iter(missing.values()))[:200]!r}."
        )
    if strange:
        warn(
            f"{label}: {', '.join(strange)} have collision shapes that are none, or of a kind that "
            "heelstrike does not know; they are left out."
        )
    # An ornament whose mesh is not there is told of already.
    weightless = [name for name in weightless if name not in missing or name not in ornaments]
    if weightless:
        have, weigh = ("has", "it weighs") if len(weightless) == 1 else ("have", "they weigh")
        warn(
            f"{label}: {', '.join(weightless)} {have} a <collision> and no <inertial>: {weigh} "
            "nothing, for a URDF has no other masses. If that is not meant, write an <inertial>."
        )


def _is_point(collision: Element) -> bool:
    """Whether a shape is a sphere of radius 0, which weighs nothing."""
    sphere = collision.find("geometry/sphere")
    return sphere is not None and float(sphere.get("radius", "1")) == 0.0


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
