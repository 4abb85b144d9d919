"""A robot written to a file of the format that its name ends in."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree

from heelstrike.errors import RobotError
from heelstrike.robot.files.saving.mjcf import mjcf
from heelstrike.robot.files.saving.sdf import sdf
from heelstrike.robot.files.saving.urdf import urdf
from heelstrike.robot.robot import Robot
from heelstrike.whole_file import write_whole

FORMATS = {".xml": mjcf, ".mjcf": mjcf, ".urdf": urdf, ".sdf": sdf}


def save_robot(robot: Robot, path: str | os.PathLike[str]) -> Path:
    """Write a robot as MJCF (.xml, .mjcf), URDF (.urdf) or SDF (.sdf); see :meth:`Robot.save`."""
    file = Path(path)
    kind = file.suffix.lower()
    if kind not in FORMATS:
        raise RobotError(
            f"{file}: a robot is saved as MJCF (.xml), URDF (.urdf) or SDF (.sdf), "
            f"not as {kind or 'nothing'!r}."
        )
    root = FORMATS[kind](robot)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode") + "\n"
    try:
        ElementTree.fromstring(text.replace("<drake:", "<").replace("</drake:", "</"))
    except ElementTree.ParseError:
        raise RobotError(
            f"{file}: a name of robot {robot.name!r} has a character that XML cannot hold."
        ) from None
    return write_whole(file, text, RobotError)
