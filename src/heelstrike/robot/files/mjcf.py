"""Planar robots from MJCF and URDF files, read by MuJoCo's own parser."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from heelstrike.robot.assembly import LARGEST_NUMBER, assembled
from heelstrike.robot.contact_points import of_model, read_contact_points
from heelstrike.robot.files.actuators import read_actuators
from heelstrike.robot.files.joint_numbers import read_joint_numbers
from heelstrike.robot.files.links import IN_PLANE, read_links
from heelstrike.robot.files.mujoco_file import MujocoFile, parse
from heelstrike.robot.files.unmodelled import warn_of_unmodelled
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot


def read_mjcf(
    source: Path | str,
    *,
    name: str | None = None,
    floating: bool = False,
    projected: bool = False,
    lenient: bool = False,
) -> Robot:
    """Read a planar robot from an MJCF or URDF file, or from a string that holds one.

    Coordinates keep the order of the file, and so do links. The reference configuration is
    MuJoCo's ``qpos0``. The ground of the file, its cameras, sensors and keyframes are no part of
    the robot. A robot without contact points loads: it can swing or fly, but not stand.

    Parameters
    ----------
    source : Path or str
        Path of the file, or the XML text itself.
    name : str, optional
        Name of the robot; by default the model name that the file gives, or the file's own.
    floating : bool
        Let the trunk float in the x–z plane, though the file fixes it to the world or leaves it
        free in space.
    projected : bool
        Lock the joints that leave the x–z plane, where a symmetric robot of three dimensions is
        meant to move in it.
    lenient : bool
        Let impossible masses and inertias pass, to look at the robot; see `inspect_robot`.

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
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused in the end
        file = parse(source, floating=floating, projected=projected, lenient=lenient)
        return _robot(file, name or _model_name(file, source))


def _robot(file: MujocoFile, name: str) -> Robot:
    model = file.model
    links = read_links(file)
    warn_of_unmodelled(file)
    points = read_contact_points(file, links)
    actuators = read_actuators(file)
    limited = model.jnt_limited.astype(bool) & (not file.disabled("limit"))
    hinges = np.flatnonzero(links.axis[:, 0])
    numbers = read_joint_numbers(file)
    numbers["armature"] += actuators.armature
    if not file.disabled("damper"):
        numbers["damping"] += actuators.damping
    arrays = Model.made(
        **numbers,
        **links.numbers,
        lower=_limits(np.where(limited, model.jnt_range[:, 0], -np.inf)),
        upper=_limits(np.where(limited, model.jnt_range[:, 1], np.inf)),
        gravity=_gravity(file),
        **of_model(points),
        actuator_joint=actuators.joint,
        torque_lower=_limits(actuators.lower),
        torque_upper=_limits(actuators.upper),
        pivot=int(hinges[0]) if len(hinges) else 0,
    )
    return assembled(
        name,
        arrays,
        joint_names=_joint_names(file),
        link_names=links.names,
        actuator_names=actuators.names,
        points=points,
        source=file.source,
    )


def _limits(values: Floats) -> Floats:
    """Limits, of which a huge one is none: formats want numbers for both sides of a range."""
    return np.where(np.abs(values) >= LARGEST_NUMBER, np.copysign(np.inf, values), values)


def _gravity(file: MujocoFile) -> Floats:
    gravity = np.asarray(file.model.opt.gravity)
    if file.disabled("gravity"):
        return np.zeros(2)
    if abs(gravity[1]) > IN_PLANE * np.linalg.norm(gravity):
        raise file.error(
            "gravity is ({:g}, {:g}, {:g}), out of the x–z plane in which the robot moves. "
            'Set it in the file: <option gravity="0 0 -9.81"/>.'.format(*gravity)
        )
    return gravity[::2]


def _joint_names(file: MujocoFile) -> tuple[str, ...]:
    """Names of the joints; a nameless one is called after the body that it moves."""
    model = file.model
    names: list[str] = []
    for joint, body in enumerate(model.jnt_bodyid):
        name = file.given_name("joint", joint)
        if not name:
            siblings = int(model.body_jntnum[body])
            ending = f"_{joint - model.body_jntadr[body]}" if siblings > 1 else ""
            name = f"{file.name('body', body)}{ending}"
        names.append(name)
    return tuple(names)


def _model_name(file: MujocoFile, source: Path | str) -> str:
    """Return the model name of the file; MuJoCo's default name says nothing, the file's does."""
    name = bytes(file.model.names).split(b"\0", 1)[0].decode(errors="replace")
    if name in ("", "MuJoCo Model"):
        return source.stem if isinstance(source, Path) else "robot"
    return name
