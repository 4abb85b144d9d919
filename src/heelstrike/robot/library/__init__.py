"""The built-in robots, and how a robot is found by its name or file."""

from __future__ import annotations

import os
import reprlib
from pathlib import Path
from typing import Literal, Unpack, overload

from heelstrike.arguments import takes
from heelstrike.errors import RobotError
from heelstrike.robot.files.options import LoadOptions, Options
from heelstrike.robot.files.reading import read_own, read_robot
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.warning import warn
from heelstrike.wording import meant

NO_MOTORS = "no joint has a motor"
NO_CONTACTS = "it has no contact points"
"""What is said of a robot from a file that cannot be driven, or cannot stand."""

_HERE = Path(__file__).parent
_FILE_TYPES = (".xml", ".mjcf", ".urdf", ".sdf", ".world", ".xacro")


def builtin_robots() -> tuple[str, ...]:
    """Return the names of the built-in robots.

    Examples
    --------
    >>> from heelstrike.robot import builtin_robots
    >>> "bravo7" in builtin_robots()
    True
    """
    return tuple(sorted(path.stem for path in _HERE.glob("*.xml")))


@overload
def load_robot(
    name_or_path: str | os.PathLike[str],
    *,
    dimension: Literal[2] | None = None,
    **how: Unpack[LoadOptions],
) -> Robot: ...


@overload
def load_robot(
    name_or_path: str | os.PathLike[str], *, dimension: Literal[3], **how: Unpack[LoadOptions]
) -> SpatialRobot: ...


@takes(RobotError)
def load_robot(
    name_or_path: str | os.PathLike[str],
    *,
    dimension: int | None = None,
    **how: Unpack[LoadOptions],
) -> Robot | SpatialRobot:
    """Load a built-in robot by its name, or a robot from an MJCF, URDF or SDF file.

    Parameters
    ----------
    name_or_path : str or path
        A name of `builtin_robots`, or the path of an ``.xml`` (MJCF), ``.urdf`` or ``.sdf`` file;
        of a ``.xacro`` file with ``xacro=True``.
    dimension : {None, 2, 3}
        A robot of which dimension. By default one of the plane, if all its hinges turn about y and
        its slides stay in x–z, and else one of space. 2 locks what leaves the plane, as
        ``projected=True`` does. 3 takes any file as it is, planar ones too: one whose trunk slides
        and pitches in the plane stays there unless ``floating=True`` lets it move freely. (Type
        checkers take a robot for planar if no dimension is given.)
    **how : LoadOptions
        How a file is read: floating, projected, forward, pose, package_path, mirror, mesh_points,
        xacro.

    Returns
    -------
    Robot or SpatialRobot
        The robot.

    Raises
    ------
    RobotError
        If there is no such robot or file, the file cannot be read, or the options contradict each
        other.

    Warns
    -----
    RobotWarning
        If the file says something that is not simulated, its left and right differ, axes are
        turned into the plane, joints are locked, or it has no motors or contact points.

    Examples
    --------
    >>> from heelstrike.robot import load_robot
    >>> robot = load_robot("bravo7")
    >>> robot
    Robot('bravo7': 9 coordinates, 6 actuators, 4 contact points, 75 kg)
    >>> robot.joint_names[3:6]
    ('right_hip', 'right_knee', 'right_ankle')
    >>> load_robot("bravo7", dimension=3, floating=True)
    SpatialRobot('bravo7': 12 velocities (1 free, 6 hinge), 6 actuators, 16 contact points, 75 kg)
    """
    if dimension not in (None, 2, 3):
        raise RobotError(f"dimension is 2 or 3, or None for that of the file, not {dimension!r}.")
    if dimension == 2:
        how["projected"] = True
    if dimension == 3 and how.get("projected"):
        raise RobotError("projected=True makes a robot of two dimensions, and dimension is 3.")
    if dimension == 3 and how.get("mirror") is not None:
        raise RobotError(
            "left and right are made equal in the plane only: leave out mirror, or use dimension=2."
        )
    planar = bool(how.get("projected")) or dimension == 2
    return _loaded(name_or_path, 2 if planar else dimension, how)


def load_planar_robot(name_or_path: str | os.PathLike[str], **how: Unpack[LoadOptions]) -> Robot:
    """Load a robot like :func:`load_robot`, and refuse one that leaves the plane.

    Parameters
    ----------
    name_or_path : str or path
        Its name or file.
    **how : LoadOptions
        How a file is read.

    Returns
    -------
    Robot
        The robot.

    Raises
    ------
    RobotError
        As there, or if the robot does not move in the x–z plane; the message names the joints that
        leave it.
    """
    robot = _loaded(name_or_path, 2, how)
    assert isinstance(robot, Robot)  # which is what was asked for
    return robot


def _loaded(
    name_or_path: str | os.PathLike[str], dimension: int | None, how: LoadOptions
) -> Robot | SpatialRobot:
    if not isinstance(name_or_path, str | os.PathLike):
        raise RobotError(
            f"a robot is loaded by its name or path, not by a {type(name_or_path).__name__}."
        )
    name = os.fspath(name_or_path)
    if isinstance(name_or_path, str) and name in builtin_robots():
        if Options(**how).packages:
            raise RobotError(
                f"robot {name!r} is built in, and no file of it lies in a package: leave out "
                f"package_path. A file is loaded by its path, as in ./{name}.urdf."
            )
        return read_own(_HERE / f"{name}.xml", dimension or 2, **how)
    path = Path(name)
    if path.suffix.lower() in _FILE_TYPES:
        robot = read_robot(path, dimension=dimension, **how)
        _tell_of_what_is_missing(robot)
        return robot
    if name and _exists(path):
        raise RobotError(
            f"{path}: expected an MJCF file (.xml), a URDF file (.urdf) or an SDF file (.sdf)."
        )
    raise RobotError(_unknown(name))


def _tell_of_what_is_missing(robot: Robot | SpatialRobot) -> None:
    """Warn of a robot from elsewhere that cannot be driven, or cannot stand."""
    if not robot.nu:
        warn(f"{robot.source}: {NO_MOTORS}: gravity, springs and pushes alone move this robot.")
    if not robot.nc:
        warn(
            f"{robot.source}: {NO_CONTACTS}: it can swing or fly, but not stand. Give its feet "
            "boxes, or spheres at heel and toe, that collide."
        )


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # no possible name of a file
        return False


def _unknown(name: str) -> str:
    known = builtin_robots()
    guess = meant(name.lower(), known)
    return (
        f"there is no robot called {reprlib.repr(name)}.{guess} Built in are {', '.join(known)}; "
        "any other robot is loaded by the path of its .xml (MJCF), .urdf or .sdf file."
    )
