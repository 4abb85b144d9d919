"""A robot file as MuJoCo's own parser understands it, posed in its reference configuration."""

from __future__ import annotations

import math
import textwrap
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.files.flattening import Coordinate, flatten
from heelstrike.robot.files.inertias import (
    put_back,
    put_back_whole,
    refuse_missing,
    stated_tensor,
    take_out,
)
from heelstrike.robot.files.options import FORWARD, Options
from heelstrike.robot.files.posture import positions, turn
from heelstrike.robot.files.screening.screening import Screened, screen
from heelstrike.robot.files.screening.urdf_check import (
    check_urdf,
    check_urdf_tree,
    refuse_macros,
)
from heelstrike.robot.files.screening.xml_tree import xml_text
from heelstrike.robot.files.sdf.translation import as_mjcf
from heelstrike.robot.files.urdf import (
    WORLD,
    let_massless_links_pass,
    let_thin_meshes_pass,
    missing_moments,
    translate_dialects,
    urdf_text,
    weigh_no_shapes,
)
from heelstrike.robot.model import Floats
from heelstrike.robot.plausibility import is_possible
from heelstrike.robot.robot import LockedJoint
from heelstrike.robot.warning import warn

LONGEST_REASON = 600  # letters of MuJoCo's own words in a message

POINT = 1e-12
"""Metres; sizes of zero become this, which is nothing to everybody but a parser."""

_SIZES = {2: 1, 3: 2, 4: 3, 5: 2, 6: 3}
"""How many sizes there are, by MuJoCo's mjtGeom: sphere, capsule, ellipsoid, cylinder, box."""


@dataclass(frozen=True)
class MujocoFile:
    """A parsed MJCF or URDF file, seen in the plane, or left in space."""

    model: Any
    """``mujoco.MjModel``: the compiled file."""
    pose: Any
    """``mujoco.MjData``: world poses of joints, bodies and geoms in the reference configuration."""
    coordinates: tuple[Coordinate, ...]
    """What moves in the plane, in the order of the robot's coordinates; nothing of a file that is
    left in space."""
    locked: tuple[LockedJoint, ...]
    """Joints of the file that do not."""
    xml: Element
    """The file as it is written, included ones in place, without what plays no part in motion."""
    source: str
    """What to call the file in messages."""
    flexible: bool = False
    """Whether it had flexible bodies, which are left out."""

    @property
    def is_urdf(self) -> bool:
        """Whether the file is URDF and not MJCF."""
        return self.xml.tag == "robot"

    def given_name(self, kind: str, index: int) -> str:
        """Name that the file gives a body, joint, geom, actuator …, or the empty string."""
        import mujoco

        object_type = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        return mujoco.mj_id2name(self.model, object_type, index) or ""

    def name(self, kind: str, index: int) -> str:
        """Name of a body, joint, geom, actuator …, or its kind and number if it has none."""
        return self.given_name(kind, index) or f"{kind} {index}"

    def custom(self, kind: str) -> Iterator[tuple[str, Floats]]:
        """Yield custom data called ``KIND:REST``: that rest, and their numbers."""
        for one in range(self.model.nnumeric):
            held, _, rest = self.given_name("numeric", one).partition(":")
            if held == kind:
                first = self.model.numeric_adr[one]
                size = self.model.numeric_size[one]
                yield rest, np.array(self.model.numeric_data[first : first + size])

    def error(self, message: str) -> RobotError:
        """Return an error that names the file."""
        return RobotError(f"{self.source}: {message}")

    def disabled(self, flag: str) -> bool:
        """Whether the file switches off the part of the physics called `flag`."""
        import mujoco

        bit = getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag.upper()}", 0)
        return bool(self.model.opt.disableflags & int(bit))

    def of_joints(self, values: Any, default: float) -> Floats:
        """Numbers of the file's joints, for the coordinates; a default where it has none."""
        given = np.append(np.asarray(values, dtype=np.float64), default)
        return given[[one.joint for one in self.coordinates]]

    def of_velocities(self, values: Any) -> Floats:
        """Numbers of the file's velocities, for the coordinates; zero where it has none."""
        return self.of_joints(np.asarray(values)[self.model.jnt_dofadr], 0.0)

    def field(self, name: str) -> Floats:
        """Return an array of the model, empty where this version of MuJoCo does not have it."""
        return np.asarray(getattr(self.model, name, np.zeros(0)), dtype=np.float64)


def parse(
    source: Path | str, options: Options | None = None, text: str | None = None
) -> MujocoFile:
    """Parse an MJCF or URDF file, or a string that holds one.

    Parameters
    ----------
    source : Path or str
        Path of a file, or the XML text itself.
    options : Options, optional
        How the file is read; as it is, by default.
    text : str, optional
        What stands for the text of the file, as what its macros expand to.

    Raises
    ------
    RobotError
        If the file cannot be read, MuJoCo's parser refuses it (the message is the parser's), or it
        cannot be seen in the plane.
    """
    options = options or Options()
    label = str(source) if isinstance(source, Path) else "XML string"
    file = _screened(source, text, options, label)
    xml = file.xml
    remarks: list[str] = []
    with _refusing(label), _warnings_into(remarks):
        spec, missing = _understood(source, file, options, label)
        taken = take_out(spec)
        model = compiled(spec, remarks)
        plane = flatten(model, options, label, hanging=not _is_held(xml))
        refuse_missing(plane.model, plane.pose, missing, label)
        put_back(plane.model, plane.pose, taken, spec.compiler.boundinertia, label)
    for remark in (*remarks, *plane.remarks):
        warn(f"{label}: {remark}")
    if not options.lenient:
        _warn_of_mended_inertias(source, file, label)
    return MujocoFile(
        plane.model, plane.pose, plane.coordinates, plane.locked, xml, label, file.flexible
    )


def parse_whole(
    source: Path | str, options: Options, text: str | None, free: Callable[[Any, bool], list[str]]
) -> MujocoFile:
    """Parse a file like :func:`parse`, and leave it in three dimensions.

    Parameters
    ----------
    source : Path or str
        Path of a file, or the XML text itself.
    options : Options
        How the file is read.
    text : str, optional
        What stands for the text of the file.
    free : callable
        ``free(spec, held)`` lets the trunk of a parsed file move freely that is meant to, before it
        is compiled, and returns what the user should know. `held` is whether the file says that its
        trunk is fixed.

    Returns
    -------
    MujocoFile
        The file, without coordinates of the plane, posed in its reference configuration.

    Raises
    ------
    RobotError
        If the file cannot be read, or MuJoCo's parser refuses it.
    """
    import mujoco

    label = str(source) if isinstance(source, Path) else "XML string"
    file = _screened(source, text, options, label)
    remarks: list[str] = []
    with _refusing(label), _warnings_into(remarks):
        spec, missing = _understood(source, file, options, label)
        for link, moments in missing.items():
            raise RobotError(f"{label}: <inertia> of link {link!r} lacks {moments[0]!r}. Give it.")
        told = free(spec, _is_held(file.xml))
        taken = take_out(spec)
        model = compiled(spec, remarks)
        put_back_whole(model, taken, spec.compiler.boundinertia, label)
        pose = mujoco.MjData(model)
        pose.qpos[:] = positions(model, options, label)
        turn(model, pose, FORWARD[options.forward or "x"])
        mujoco.mj_kinematics(model, pose)
    for remark in (*remarks, *told):
        warn(f"{label}: {remark}")
    if not options.lenient:
        _warn_of_mended_inertias(source, file, label)
    return MujocoFile(model, pose, (), (), file.xml, label, file.flexible)


def _is_held(xml: Element) -> bool:
    """Whether a file says that a trunk without joints is fixed: all but URDF without a world."""
    return xml.tag != "robot" or any(link.get("name") == WORLD for link in xml.iterfind("link"))


def _understood(
    source: Path | str, file: Screened, options: Options, label: str
) -> tuple[Any, dict[str, list[str]]]:
    """Return a file as MuJoCo understands it, and the moments of inertia that a URDF leaves out."""
    xml = file.xml
    if xml.tag == "robot":
        refuse_macros(xml, label)
        translate_dialects(xml)
        if not options.lenient:
            check_urdf(xml, label)
    missing = missing_moments(xml)
    spec = _parsed(source, file, label, options.packages)
    if options.lenient:
        let_massless_links_pass(spec)
    return spec, missing


@contextmanager
def _refusing(label: str) -> Iterator[None]:
    """Say what MuJoCo's parser says as errors of ours."""
    import mujoco

    try:
        yield
    except RobotError:
        raise
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise _unreadable(label, error) from error


def _screened(source: Path | str, text: str | None, options: Options, label: str) -> Screened:
    """Return a file that may be parsed, as MJCF or URDF."""
    file = screen(source if text is None else text, label, options.packages)
    if file.xml.tag != "sdf":
        return file
    directory = source.parent if isinstance(source, Path) else Path()
    mjcf = as_mjcf(file.xml, directory, options.packages, label)
    return replace(file, xml=mjcf, massless=True)


def stated_bodies(
    path: Path | str, options: Options, text: str | None = None
) -> list[tuple[str, float, Floats]]:
    """Name, mass and inertia tensor of bodies; see `heelstrike.robot.files.reading.read_bodies`."""
    label = str(path)
    file = _screened(path, text, options, label)
    with _refusing(label), _warnings_into([]), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spec = _parsed(path, file, label, options.packages)
    return _stated(spec)


def _stated(spec: Any) -> list[tuple[str, float, Floats]]:
    tensors = [(body, stated_tensor(body)) for body in spec.bodies]
    return [(body.name, float(body.mass), t) for body, t in tensors if t is not None]


def _warn_of_mended_inertias(source: Path | str, file: Screened, label: str) -> None:
    """Warn of inertias that MuJoCo changed because the file says ``balanceinertia="true"``."""
    compilers = file.xml.iter("compiler") if file.xml.tag == "mujoco" else ()
    if not any(compiler.get("balanceinertia") == "true" for compiler in compilers):
        return
    with _warnings_into([]), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        stated = _stated(_parsed(source, file, label))
    mended = [name for name, _, tensor in stated if not is_possible(tensor)]
    if mended:
        warn(
            f"{label}: the inertias of {', '.join(mended)} violate the triangle inequality, and "
            'balanceinertia="true" in the file lets MuJoCo replace them by others.'
        )


_NO_MEMORY = ("Could not allocate memory", "unknown exception")
"""What MuJoCo says where there is none left."""


def _unreadable(label: str, error: Exception) -> RobotError:
    if any(words in str(error) for words in _NO_MEMORY):
        raise MemoryError from error
    reason = textwrap.shorten(" ".join(str(error).split()), LONGEST_REASON)
    return RobotError(f"{label}: MuJoCo's parser cannot read this robot: {reason}")


def compiled(spec: Any, remarks: list[str]) -> Any:
    """Compile a parsed file; what MuJoCo warns of goes to `remarks`."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        model = spec.compile()
    remarks += [str(one.message) for one in caught]
    return model


def _parsed(source: Path | str, file: Screened, label: str, packages: tuple[Path, ...] = ()) -> Any:
    """Return a file as MuJoCo understands it, not yet compiled."""
    import mujoco

    urdf = file.xml.tag == "robot"
    if urdf:
        translate_dialects(file.xml)
        directory = source.parent if isinstance(source, Path) else Path()
        text = urdf_text(file.xml, directory, packages, label)
        check_urdf_tree(file.xml, label)
    else:
        text = xml_text(file.xml)
    spec = mujoco.MjSpec.from_string(text, include=file.models)
    # Welded bodies are joined by our own reader, which needs to know where each of them is.
    spec.compiler.fusestatic = False
    if urdf:
        weigh_no_shapes(spec)
    if urdf or file.massless:
        let_massless_links_pass(spec)
        let_thin_meshes_pass(spec)
    if urdf:
        spec.compiler.balanceinertia = False  # which replaces moments that URDF states
    _lift_sizes(spec)
    return spec


def _lift_sizes(spec: Any) -> None:
    """Give shapes without extent, such as spheres of radius 0 for points, one that parsers take."""
    for geom in spec.geoms:
        sizes = _SIZES.get(int(geom.type), 0)
        if not math.isnan(geom.fromto[0]):  # the length is told by two points
            sizes = 1
        for k in range(sizes):
            if geom.size[k] == 0.0:
                geom.size[k] = POINT


@contextmanager
def _warnings_into(remarks: list[str]) -> Iterator[None]:
    """Collect MuJoCo's warnings, which it would print and append to a file in the work directory.

    MuJoCo has one handler a process; the one that was set is put back.
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(remarks.append)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
