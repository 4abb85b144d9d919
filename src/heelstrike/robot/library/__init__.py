"""The built-in robots, and how a robot is found by its name or file."""

from __future__ import annotations

import os
import reprlib
from pathlib import Path
from typing import Unpack

from heelstrike.arguments import takes
from heelstrike.errors import RobotError
from heelstrike.robot.files.options import LoadOptions
from heelstrike.robot.files.reading import read_mjcf, read_own
from heelstrike.robot.robot import Robot
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


@takes(RobotError)
def load_robot(name_or_path: str | os.PathLike[str], **how: Unpack[LoadOptions]) -> Robot:
    """Load a built-in robot by its name, or a planar robot from an MJCF, URDF or SDF file.

    Parameters
    ----------
    name_or_path : str or path
        A name of `builtin_robots`, or the path of an ``.xml`` (MJCF), ``.urdf`` or ``.sdf`` file;
        of a ``.xacro`` file with ``xacro=True``.
    **how : LoadOptions
        How a file is read: floating, projected, forward, pose, package_path, mirror, xacro.

    Returns
    -------
    Robot
        The robot.

    Raises
    ------
    RobotError
        If there is no such robot or file, the file cannot be read, or the robot does not move in
        the x–z plane.

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
    """
    if not isinstance(name_or_path, str | os.PathLike):
        raise RobotError(
            f"a robot is loaded by its name or path, not by a {type(name_or_path).__name__}."
        )
    name = os.fspath(name_or_path)
    if isinstance(name_or_path, str) and name in builtin_robots():
        return read_own(_HERE / f"{name}.xml", **how)
    path = Path(name)
    if path.suffix.lower() in _FILE_TYPES:
        robot = read_mjcf(path, **how)
        _tell_of_what_is_missing(robot)
        return robot
    if name and _exists(path):
        raise RobotError(
            f"{path}: expected an MJCF file (.xml), a URDF file (.urdf) or an SDF file (.sdf)."
        )
    raise RobotError(_unknown(name))


def _tell_of_what_is_missing(robot: Robot) -> None:
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
