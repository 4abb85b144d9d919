"""How a robot file is read: what the callers of the readers may ask for."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, TypedDict

from heelstrike.arguments import check_fields, refusal
from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass

FORWARD = {"x": 0, "y": 1, "-x": 2, "-y": 3}
"""Ways that a robot may walk in its file, in quarter turns from +x about z."""

AVERAGE = "average"

FEWEST = 6
"""Points that a mesh has at least: its extremes along the axes."""


class LoadOptions(TypedDict, total=False):
    """How a robot file is read; nothing is required.

    Attributes
    ----------
    floating : bool
        Let the trunk float in the plane by x, z and pitch, though the file fixes it to the world
        (as a URDF without a root joint does) or leaves it free in space.
    projected : bool
        Lock the joints of a robot of three dimensions that leave the x–z plane, and let its trunk
        float in the plane, unless the file fixes it to the link ``world``. Of a ball joint the
        pitch stays. The mass of the robot must be symmetric about that plane. `Robot.locked` is the
        table of what was locked.
    forward : {"x", "y", "-x", "-y"}
        Where the robot of the file looks; the robot is turned so that it is +x. By default +x, or
        +y if the robot moves in the y–z plane only.
    pose : mapping of str to float
        Positions (rad, m) of joints by their names. Locked joints are locked there; for the others
        it is the reference configuration of the robot.
    package_path : path or sequence of paths
        Folders of ROS packages, or folders that hold such, for files named by ``package://``. They
        are sought before the folders around the file and those of ``ROS_PACKAGE_PATH`` and
        ``AMENT_PREFIX_PATH``.
    mirror : {"average"}
        Make left and right equal, by the mean of their numbers, where they differ by more than
        rounding, and say by how much.
    mesh_points : int
        Contact points that stand for the meshes of a link of a robot in space at most, 32 by
        default: corners of their convex hull, of which six are the least.
    xacro : bool or mapping of str to str
        Expand the macros of a xacro file, with these values of its arguments. Such a file is a
        program, which runs in a process of its own for a minute at most: expand files of people
        whom you trust. Needs the package xacro.
    """

    floating: bool
    projected: bool
    forward: str | None
    pose: Mapping[str, float] | None
    package_path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
    mirror: str | None
    mesh_points: int
    xacro: bool | Mapping[str, str]


@dataclass(frozen=True, kw_only=True)
class Options:
    """The same, checked.

    Raises
    ------
    RobotError
        If one is impossible.
    """

    floating: bool = False
    projected: bool = False
    forward: str | None = None
    pose: Mapping[str, float] | None = field(default_factory=dict)
    package_path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = ()
    mirror: str | None = None
    mesh_points: int = 32
    xacro: bool | Mapping[str, str] = False
    """floating, projected, forward, pose, package_path, mirror, mesh_points, xacro: See
    :class:`LoadOptions`."""
    lenient: bool = False
    """Let masses pass that MuJoCo refuses, to look at the robot; see `inspect_robot`."""

    def __post_init__(self) -> None:
        check_fields(self, RobotError)
        given = self.package_path
        for folder in () if isinstance(given, str | os.PathLike) else given:
            if not isinstance(folder, str | os.PathLike):
                raise RobotError(refusal("a folder of package_path", folder, ["str", "Path"]))
        if self.forward is not None and self.forward not in FORWARD:
            raise RobotError(f"forward is one of {', '.join(FORWARD)}, not {self.forward!r}.")
        if self.mirror not in (None, AVERAGE):
            raise RobotError(f"mirror is {AVERAGE!r} or left out, not {self.mirror!r}.")
        if self.mesh_points < FEWEST:
            raise RobotError(f"mesh_points is {FEWEST} or more, not {self.mesh_points!r}.")
        for joint, value in (self.pose or {}).items():
            if not isinstance(value, int | float) or not math.isfinite(value):
                raise RobotError(f"pose of joint {joint!r} is {value!r}, not a number.")

    @property
    def arguments(self) -> Mapping[str, str] | None:
        """Arguments of a xacro file, None where it is not to be expanded."""
        if isinstance(self.xacro, Mapping):
            return self.xacro
        return {} if self.xacro else None

    def plain(self) -> dict[str, Any]:
        """What JSON can hold of them; macros are expanded before."""
        return {
            **{name: getattr(self, name) for name in ("floating", "projected", "forward")},
            **{name: getattr(self, name) for name in ("mirror", "lenient")},
            "mesh_points": int(self.mesh_points),
            "pose": self.pose and {joint: float(value) for joint, value in self.pose.items()},
            "package_path": [str(folder.absolute()) for folder in self.packages],
        }

    @property
    def packages(self) -> tuple[Path, ...]:
        """The folders of `package_path`."""
        given = self.package_path
        folders = (given,) if isinstance(given, str | os.PathLike) else given
        return tuple(map(Path, folders))
