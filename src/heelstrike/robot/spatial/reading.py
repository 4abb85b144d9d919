"""Robots in space from MJCF, URDF and SDF files, read by MuJoCo's own parser."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from heelstrike.robot.files.actuators import Actuators
from heelstrike.robot.files.joint_numbers import limits
from heelstrike.robot.files.mjcf import model_name
from heelstrike.robot.files.mujoco_file import MujocoFile, parse_whole
from heelstrike.robot.files.options import Options
from heelstrike.robot.files.posture import joint_name
from heelstrike.robot.files.unmodelled import acting_parts, tell_of_left_out
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.actuators import read_spatial_actuators
from heelstrike.robot.spatial.assembly import assembled_in_space, idle_joints
from heelstrike.robot.spatial.contact_points import (
    SpatialPoint,
    of_spatial_model,
    read_spatial_points,
)
from heelstrike.robot.spatial.joint_numbers import read_spatial_numbers
from heelstrike.robot.spatial.links import SpatialLinks, read_spatial_links
from heelstrike.robot.spatial.model import HINGE, SLIDE, SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.spatial.trunk import free_trunk, weld
from heelstrike.robot.spatial.visible_shapes import read_solids
from heelstrike.robot.warning import warn


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
    fixed: list[str] = []

    def free(spec: Any, held: bool) -> list[str]:
        told = weld(spec, fixed)
        return [*told, *free_trunk(spec, held, floating=options.floating, label=label)]

    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused in the end
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            file = parse_whole(source, options, text, free)
        if file.is_urdf:
            fixed += _without_mass(file)
        if fixed:
            file = parse_whole(source, options, text, free)
        else:
            for each in said:
                warn(str(each.message))
        return _robot(file, name or model_name(file, source), options)


def _without_mass(file: MujocoFile) -> list[str]:
    """Names of the hinges and slides of a file that nothing resists, as URDF has them."""
    if not file.model.njnt:
        return []
    links = read_spatial_links(file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # all that is said later
        model = _model(file, links, [], read_spatial_actuators(file))
    names = [joint_name(file.model, one) for one in idle_joints(model, links.origin, links.axes)]
    kinds = model.joint_kind.tolist()
    single = {joint_name(file.model, k) for k, kind in enumerate(kinds) if kind in (HINGE, SLIDE)}
    return [each for each in names if each in single]


def _robot(file: MujocoFile, name: str, options: Options) -> SpatialRobot:
    links = read_spatial_links(file)
    held = {"equality constraints (closed loops, coupled joints, welds)": _holds(file)}
    tell_of_left_out(file, held | acting_parts(file))
    points = read_spatial_points(file, links, options.mesh_points)
    actuators = read_spatial_actuators(file)
    model = _model(file, links, points, actuators)
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


def _model(
    file: MujocoFile, links: SpatialLinks, points: list[SpatialPoint], actuators: Actuators
) -> SpatialModel:
    """Numbers of a robot with these links, contact points and actuators."""
    numbers = read_spatial_numbers(file)
    numbers["armature"] = numbers["armature"] + actuators.armature
    if not file.disabled("damper"):
        numbers["damping"] = numbers["damping"] + actuators.damping
    return SpatialModel.made(
        **links.numbers,
        **numbers,
        **of_spatial_model(points),
        gravity=_gravity(file),
        actuator_velocity=actuators.joint,
        torque_lower=limits(actuators.lower),
        torque_upper=limits(actuators.upper),
        pivot=0,
    )


def _holds(file: MujocoFile) -> bool:
    """Whether any equality constraint of the file acts."""
    return not file.disabled("equality") and bool(np.any(file.model.eq_active0))


def _gravity(file: MujocoFile) -> Floats:
    if file.disabled("gravity"):
        return np.zeros(3)
    return np.array(file.model.opt.gravity)
