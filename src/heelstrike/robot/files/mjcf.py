"""Planar robots from MJCF and URDF files, read by MuJoCo's own parser."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from heelstrike.robot.assembly import assembled
from heelstrike.robot.contact_points import of_model
from heelstrike.robot.files.actuators import read_actuators
from heelstrike.robot.files.contact_points import read_contact_points
from heelstrike.robot.files.joint_numbers import limits, read_joint_numbers
from heelstrike.robot.files.links import read_links, read_loops
from heelstrike.robot.files.mujoco_file import MujocoFile, parse
from heelstrike.robot.files.options import AVERAGE, Options
from heelstrike.robot.files.posture import BALL
from heelstrike.robot.files.shapes import read_outlines
from heelstrike.robot.files.unmodelled import warn_of_unmodelled
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot

SIDEWAYS = 1e-6  # share of gravity that may act out of the plane


def planar_robot(
    source: Path | str, options: Options, name: str | None = None, text: str | None = None
) -> Robot:
    """Read a robot in this process; `heelstrike.robot.files.reading` does so in another.

    Parameters
    ----------
    source : Path or str
        Path of the file, or the XML text itself.
    options : Options
        How the file is read.
    name : str, optional
        Name of the robot.
    text : str, optional
        What its file expands to.

    Raises
    ------
    RobotError
        If the file cannot be read or the robot does not move in the x–z plane.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused in the end
        file = parse(source, options, text)
        return _robot(file, name or model_name(file, source), options)


def _robot(file: MujocoFile, name: str, options: Options) -> Robot:
    links = read_links(file)
    warn_of_unmodelled(file)
    points = read_contact_points(file, links)
    actuators = read_actuators(file)
    hinges = np.flatnonzero(links.axis[:, 0])
    numbers = read_joint_numbers(file)
    numbers["armature"] += actuators.armature
    if not file.disabled("damper"):
        numbers["damping"] += actuators.damping
    arrays = Model.made(
        **numbers,
        **links.numbers,
        **_ranges(file),
        gravity=_gravity(file),
        **of_model(points),
        actuator_joint=actuators.joint,
        torque_lower=limits(actuators.lower),
        torque_upper=limits(actuators.upper),
        **read_loops(file, links),
        pivot=int(hinges[0]) if len(hinges) else 0,
    )
    robot = assembled(
        name,
        arrays,
        joint_names=tuple(one.name for one in file.coordinates),
        link_names=links.names,
        actuator_names=actuators.names,
        points=points,
        source=file.source,
        locked=file.locked,
        average=options.mirror == AVERAGE,
    )
    return replace(robot, outlines=read_outlines(file, links))


def _ranges(file: MujocoFile) -> dict[str, Floats]:
    """Ranges of the coordinates; that of a ball joint is the same for all senses."""
    model = file.model
    limited = model.jnt_limited.astype(bool) & (not file.disabled("limit"))
    low, high = np.array(model.jnt_range, dtype=np.float64).T
    low = np.where(model.jnt_type == BALL, -high, low)
    low = file.of_joints(np.where(limited, low, -np.inf), -np.inf)
    high = file.of_joints(np.where(limited, high, np.inf), np.inf)
    other = np.array([one.sense < 0.0 for one in file.coordinates])
    return {
        "lower": limits(np.where(other, -high, low)),
        "upper": limits(np.where(other, -low, high)),
    }


def _gravity(file: MujocoFile) -> Floats:
    gravity = np.asarray(file.model.opt.gravity)
    if file.disabled("gravity"):
        return np.zeros(2)
    if abs(gravity[1]) > SIDEWAYS * np.linalg.norm(gravity):
        raise file.error(
            "gravity is ({:g}, {:g}, {:g}), out of the x–z plane in which the robot moves. "
            'Set it in the file: <option gravity="0 0 -9.81"/>.'.format(*gravity)
        )
    return gravity[::2]


def model_name(file: MujocoFile, source: Path | str) -> str:
    """Return the model name of the file; MuJoCo's default name says nothing, the file's does."""
    name = bytes(file.model.names).split(b"\0", 1)[0].decode(errors="replace")
    if name in ("", "MuJoCo Model"):
        return source.stem if isinstance(source, Path) else "robot"
    return name
