"""Robot files read in a process of their own, and what came of them kept by content.

A file from elsewhere is parsed by :mod:`heelstrike.reader_process`, where it cannot hurt. What is
asked there and answered is JSON. Answers are kept on disk with all that was looked at for them, and
hold as long as that is the same; so do those for the built-in robots, which are read here. What
reads a file is not imported where an answer is there already.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.kept_files import kept_file, make_room, program_digest
from heelstrike.reader_process import READER, ReadingError
from heelstrike.robot.files.looks import Looks, noting, same
from heelstrike.robot.files.options import LoadOptions, Options
from heelstrike.robot.files.packages import FOLDERS
from heelstrike.robot.files.robot_json import robot_entries, robot_of_entries
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.warning import RobotWarning, warn
from heelstrike.whole_file import write_whole

LONGEST = 60.0
"""Seconds after which a file counts as one that never ends. Large meshes take ten, on a machine
that does nothing else."""

_JOB = f"{__name__}:answer"
_ROOMS = ("robot", "tolerances")


@dataclass(frozen=True, kw_only=True)
class _Order:
    """What is asked of a file; everything an answer follows from but what is on the disk."""

    path: str | None
    text: str | None
    options: dict[str, Any]
    name: str | None
    bodies: bool
    dimension: int | None
    folder: str
    environment: dict[str, str]

    @property
    def label(self) -> str:
        return self.path or "XML string"

    def json(self) -> bytes:
        return json.dumps(asdict(self)).encode("utf-8", "surrogatepass")


def read_mjcf(
    source: Path | str,
    *,
    name: str | None = None,
    lenient: bool = False,
    **how: Unpack[LoadOptions],
) -> Robot:
    """Read a planar robot from an MJCF, URDF or SDF file, or from a string that holds one.

    Coordinates keep the order of the file, and so do links. The reference configuration is
    MuJoCo's ``qpos0``. The ground of the file, its cameras, sensors and keyframes are no part of
    the robot. A robot without contact points loads: it can swing or fly, but not stand.

    Parameters
    ----------
    source : Path or str
        Path of the file, or the XML text itself.
    name : str, optional
        Name of the robot; by default the model name that the file gives, or the file's own.
    lenient : bool
        Let masses pass that MuJoCo refuses, to look at the robot; see `inspect_robot`.
    **how : LoadOptions
        How the file is read.

    Returns
    -------
    Robot
        The robot.

    Raises
    ------
    RobotError
        If the file cannot be read or the robot does not move in the x–z plane.

    Warns
    -----
    RobotWarning
        If the file says something that is not simulated, or left and right differ.
    """
    robot = _told(_answer(_order(source, Options(**how, lenient=lenient), name)))
    assert isinstance(robot, Robot)  # which is what the order says
    return robot


def read_robot(
    source: Path | str, *, dimension: int | None, **how: Unpack[LoadOptions]
) -> Robot | SpatialRobot:
    """Read a robot of two or three dimensions from a file or string; see :func:`read_mjcf`.

    Parameters
    ----------
    source : Path or str
        Path of the file, or the XML text itself.
    dimension : int or None
        2 or 3; None for a robot of two, if it moves in the plane only, and else of three.
    **how : LoadOptions
        How the file is read.

    Returns
    -------
    Robot or SpatialRobot
        The robot.

    Raises
    ------
    RobotError
        If the file cannot be read.
    """
    return _told(_answer(_order(source, Options(**how), None, dimension=dimension)))


def read_own(path: Path, dimension: int = 2, **how: Unpack[LoadOptions]) -> Robot | SpatialRobot:
    """Read a file of this package, which bears the name of its robot."""
    order = _order(path, Options(**how), path.stem, dimension=dimension)
    kept = _Kept(order)
    return _told(kept.load() or kept.save(_found(order)))


def read_bodies(path: Path, options: Options) -> list[tuple[str, float, Floats]]:
    """Name, mass and inertia tensor (about the centre of mass, kg m²) as a file states them.

    Bodies that do not move, and those that leave their inertia to their geoms, are not among them.

    Raises
    ------
    RobotError
        If the file cannot be read.
    """
    found = _answer(_order(path, options, None, bodies=True))
    if found["error"] is not None:
        raise RobotError(found["error"])
    return [(name, mass, np.array(tensor)) for name, mass, tensor in found["bodies"]]


def answer(order: bytes) -> bytes:
    """Answer an order in this process, whatever the file may do to it."""
    asked = _Order(**json.loads(order))
    if asked.folder:
        os.chdir(asked.folder)
    os.environ.update(asked.environment)
    return json.dumps(_found(asked)).encode("utf-8", "surrogatepass")


def _found(asked: _Order) -> dict[str, Any]:
    """What is found in a file, as JSON holds it."""
    from heelstrike.robot.files.mujoco_file import stated_bodies

    options = Options(**asked.options)
    source = Path(asked.path) if asked.path is not None else asked.text or ""
    found: dict[str, Any] = {"error": None, "robot": None, "bodies": None}
    with noting() as looks, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", RobotWarning)
        try:
            if asked.bodies:
                bodies = stated_bodies(source, options, asked.text)
                found["bodies"] = [(name, mass, tensor.tolist()) for name, mass, tensor in bodies]
            else:
                robot = _read(source, options, asked, caught)
                found["robot"] = robot_entries(robot)
        except RobotError as error:
            found["error"] = str(error)
    found["remarks"] = [str(one.message) for one in caught]
    found["looks"] = [[*which, state] for which, state in looks.items()]
    return found


def _read(
    source: Path | str, options: Options, asked: _Order, caught: list[warnings.WarningMessage]
) -> Robot | SpatialRobot:
    """Read a robot of the dimension that is asked for."""
    from heelstrike.robot.files.mjcf import planar_robot
    from heelstrike.robot.files.spatial import LeavesPlaneError
    from heelstrike.robot.spatial.reading import spatial_robot

    leaves: LeavesPlaneError | None = None
    if asked.dimension != 3:
        try:
            return planar_robot(source, options, asked.name, asked.text)
        except LeavesPlaneError as error:
            if asked.dimension is not None:
                raise
            leaves = error
            if options.mirror is not None:
                raise RobotError(
                    f"{error} Left and right are made equal in the plane only: add dimension=2, or "
                    "leave out mirror."
                ) from error
            caught.clear()  # what was said of a robot that is not the one
    robot = spatial_robot(source, options, asked.name, asked.text)
    if leaves is not None and not robot.floating:
        warn(f"{leaves} Until then it is one of three dimensions, which dimension=3 asks for.")
    return robot


def _order(
    source: Path | str,
    options: Options,
    name: str | None,
    *,
    bodies: bool = False,
    dimension: int | None = 2,
) -> _Order:
    path = source if isinstance(source, Path) else None
    text = None if isinstance(source, Path) else source
    if path is not None and options.arguments is not None:
        from heelstrike.robot.files.ros.xacro import expanded

        text = expanded(path, options.arguments, options.packages, str(path))
    return _Order(
        path=None if path is None else str(path),
        text=text,
        options=options.plain(),
        name=name,
        bodies=bodies,
        dimension=dimension,
        folder="" if path is not None and path.is_absolute() else _here(),
        environment={each: os.environ.get(each, "") for each in FOLDERS},
    )


def _here() -> str:
    try:
        return str(Path.cwd())
    except OSError:  # it is gone
        return ""


def _answer(order: _Order) -> dict[str, Any]:
    kept = _Kept(order)
    found = kept.load()
    if found is not None:
        return found
    try:
        return kept.save(json.loads(READER.ask(_JOB, order.json(), patience=LONGEST)))
    except ReadingError as error:
        what = f"fails over this file ({error.kind}: {error})" if error.kind else str(error)
        raise RobotError(
            f"{order.label}: the parser {what}. Look at its meshes (are their files whole?), "
            "plugins and attached models; replace meshes by boxes, capsules and spheres; lower the "
            "count of <replicate>, <composite> and <attach>, and sizes; or leave parts out."
        ) from error


def _told(found: dict[str, Any]) -> Robot | SpatialRobot:
    """Say what an answer says, and return its robot."""
    for remark in found["remarks"]:
        warn(remark)
    if found["error"] is not None:
        raise RobotError(found["error"])
    return robot_of_entries(found["robot"])


class _Kept:
    """Where the answer to an order is kept, if anywhere."""

    def __init__(self, order: _Order) -> None:
        digest = hashlib.sha256(program_digest(_ROOMS, "mujoco") + order.json())
        self._file = kept_file("robots", digest.hexdigest()[:32])

    def load(self) -> dict[str, Any] | None:
        """Return the answer, None if there is none, it is damaged, or the files have changed."""
        if self._file is None:
            return None
        try:
            digest, _, text = self._file.read_bytes().partition(b"\n")
            if digest != hashlib.sha256(text).hexdigest().encode():
                return None
            found: dict[str, Any] = json.loads(text)
        except (OSError, ValueError):
            return None
        looks: Looks = {(kind, path): state for kind, path, state in found["looks"]}
        return found if same(looks) else None

    def save(self, found: dict[str, Any]) -> dict[str, Any]:
        """Keep an answer that is no error, if its folder can be written to, and return it."""
        if self._file is not None and found["error"] is None:
            text = json.dumps(found).encode("utf-8", "surrogatepass")
            with suppress(RobotError, OSError):
                make_room(self._file)
                digest = hashlib.sha256(text).hexdigest().encode()
                write_whole(self._file, memoryview(digest + b"\n" + text))
        return found
