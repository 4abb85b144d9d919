"""Robots in space from MJCF, URDF and SDF files, read by MuJoCo's own parser."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from heelstrike.robot.files.mjcf import model_name
from heelstrike.robot.files.mujoco_file import MujocoFile, parse_whole
from heelstrike.robot.files.options import Options
from heelstrike.robot.files.posture import joint_name
from heelstrike.robot.files.unmodelled import acting_parts, tell_of_left_out
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.actuators import read_spatial_actuators
from heelstrike.robot.spatial.assembly import assembled_in_space
from heelstrike.robot.spatial.contact_points import of_spatial_model, read_spatial_points
from heelstrike.robot.spatial.joint_numbers import limits, read_spatial_numbers
from heelstrike.robot.spatial.links import read_spatial_links
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.spatial.trunk import free_trunk
from heelstrike.robot.spatial.visible_shapes import read_solids


def spatial_robot(
    source: Path | str, options: Options, name: str | None = None, text: str | None = None
) -> SpatialRobot:
    """Read a robot in space in this process; `heelstrike.robot.files.reading` does so in another.

    Parameters
    ----------
    source : Path or str
        Path of the file, or the XML text itself.
    options : Options
        How the file is read; `projected` and `mirror` are of the plane.
    name : str, optional
        Name of the robot.
    text : str, optional
        What its file expands to.

    Raises
    ------
    RobotError
        If the file cannot be read, or the robot is none that can move.
    """
    label = str(source) if isinstance(source, Path) else "XML string"
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused in the end
        file = parse_whole(
            source,
            options,
            text,
            lambda spec, held: free_trunk(spec, held, floating=options.floating, label=label),
        )
        return _robot(file, name or model_name(file, source))


def _robot(file: MujocoFile, name: str) -> SpatialRobot:
    links = read_spatial_links(file)
    held = {"equality constraints (closed loops, coupled joints, welds)": _holds(file)}
    tell_of_left_out(file, held | acting_parts(file))
    points = read_spatial_points(file, links)
    actuators = read_spatial_actuators(file)
    numbers = read_spatial_numbers(file)
    numbers["armature"] = numbers["armature"] + actuators.armature
    if not file.disabled("damper"):
        numbers["damping"] = numbers["damping"] + actuators.damping
    model = SpatialModel.made(
        **links.numbers,
        **numbers,
        **of_spatial_model(points),
        gravity=_gravity(file),
        actuator_velocity=actuators.joint,
        torque_lower=limits(actuators.lower),
        torque_upper=limits(actuators.upper),
        pivot=0,
    )
    joints = range(file.model.njnt)
    return assembled_in_space(
        name,
        model,
        joint_names=tuple(joint_name(file.model, joint) for joint in joints),
        link_names=tuple(file.name("body", file.model.jnt_bodyid[joint]) for joint in joints),
        actuator_names=actuators.names,
        friction=tuple(point.friction for point in points),
        source=file.source,
        origin=links.origin,
        axes=links.axes,
        solids=read_solids(file, links),
    )


def _holds(file: MujocoFile) -> bool:
    """Whether any equality constraint of the file acts."""
    return not file.disabled("equality") and bool(np.any(file.model.eq_active0))


def _gravity(file: MujocoFile) -> Floats:
    if file.disabled("gravity"):
        return np.zeros(3)
    return np.array(file.model.opt.gravity)
