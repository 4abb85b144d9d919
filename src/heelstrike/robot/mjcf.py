"""Planar robots from MJCF and URDF files, read by MuJoCo's own parser."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from heelstrike.robot.actuators import read_actuators
from heelstrike.robot.contact_points import read_contact_points
from heelstrike.robot.feet import find_feet, name_contacts
from heelstrike.robot.links import IN_PLANE, Links, read_links
from heelstrike.robot.mirror import find_mirror
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.mujoco_file import MujocoFile, parse
from heelstrike.robot.robot import Robot
from heelstrike.robot.unmodelled import warn_of_unmodelled
from heelstrike.robot.warning import warn

LARGEST_NUMBER = 1e10
"""Largest length, mass, inertia … of a robot in SI units; MuJoCo's own bound on a state."""


def read_mjcf(source: Path | str, *, name: str | None = None) -> Robot:
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

    Raises
    ------
    RobotError
        If the file cannot be read or the robot does not move in the x–z plane.

    Warns
    -----
    RobotWarning
        If the file says something that is not simulated, or left and right differ.
    """
    file = parse(source)
    model = file.model
    links = read_links(file)
    warn_of_unmodelled(file)
    points = read_contact_points(file, links)
    actuators = read_actuators(file)
    limited = model.jnt_limited.astype(bool) & (not file.disabled("limit"))
    spring = 0.0 if file.disabled("spring") else 1.0
    damper = 0.0 if file.disabled("damper") else 1.0
    dry = 0.0 if file.disabled("frictionloss") else 1.0
    hinges = np.flatnonzero(links.axis[:, 0])
    arrays = Model(
        parent=links.parent,
        axis=links.axis,
        offset=links.offset,
        reference=_floats(model.qpos0),
        mass=links.mass,
        center_of_mass=links.center_of_mass,
        inertia=links.inertia,
        armature=_floats(model.dof_armature + actuators.armature),
        damping=_floats(damper * (model.dof_damping + actuators.damping)),
        stiffness=_floats(spring * model.jnt_stiffness),
        rest=_floats(model.qpos_spring),
        dry_friction=_floats(dry * model.dof_frictionloss),
        lower=np.where(limited, model.jnt_range[:, 0], -np.inf),
        upper=np.where(limited, model.jnt_range[:, 1], np.inf),
        gravity=_gravity(file),
        contact_link=np.array([p.link for p in points], dtype=np.int64),
        contact_position=np.array([(p.x, p.z) for p in points], dtype=np.float64).reshape(-1, 2),
        contact_radius=np.array([p.radius for p in points], dtype=np.float64),
        actuator_joint=actuators.joint,
        torque_lower=actuators.lower,
        torque_upper=actuators.upper,
        pivot=int(hinges[0]) if len(hinges) else 0,
    )
    _refuse_impossible_numbers(file, arrays)
    joint_names = _joint_names(file)
    feet = find_feet(links.parent, links.names, points, links.origin, _center_of_mass(links))
    return Robot(
        name=name or _model_name(file, source),
        model=arrays,
        joint_names=joint_names,
        link_names=links.names,
        actuator_names=actuators.names,
        contact_names=name_contacts(links.names, points, feet),
        feet=feet,
        mirror=find_mirror(
            arrays, joint_names, links.names, feet, [p.friction for p in points], file.source
        ),
        floating=_is_floating(file, arrays),
        source=file.source,
    )


def _floats(values: Floats) -> Floats:
    return np.array(values, dtype=np.float64, order="C")


def _gravity(file: MujocoFile) -> Floats:
    gravity = np.asarray(file.model.opt.gravity)
    if file.disabled("gravity"):
        return np.zeros(2)
    if abs(gravity[1]) > IN_PLANE * np.linalg.norm(gravity):
        raise file.error(
            "gravity is ({:g}, {:g}, {:g}), out of the x–z plane in which the robot moves. "
            'Set it in the file: <option gravity="0 0 -9.81"/>.'.format(*gravity)
        )
    return _floats(gravity[::2])


def _center_of_mass(links: Links) -> Floats:
    """Centre of mass of the whole robot in the reference configuration (world x, z)."""
    center: Floats = links.mass @ (links.origin + links.center_of_mass) / links.mass.sum()
    return center


def _refuse_impossible_numbers(file: MujocoFile, model: Model) -> None:
    """Refuse NaN, and what is infinite or huge where only a limit may be."""
    limits = {"lower", "upper", "torque_lower", "torque_upper"}
    for field, values in model.members().items():
        bad = np.isnan(values) if field in limits else ~(np.abs(values) <= LARGEST_NUMBER)
        if np.any(bad):
            raise file.error(
                f"the {field.replace('_', ' ')} of the robot is not a number below "
                f"{LARGEST_NUMBER:g}. Look for NaN or a misplaced exponent in the file."
            )


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


def _is_floating(file: MujocoFile, model: Model) -> bool:
    """Whether the robot begins with unactuated slide x, slide z and hinge y of its trunk.

    Warn if it floats by three such joints in another order: gaits and controllers expect this one.
    """
    if len(model.parent) < 3 or list(model.parent[:3]) != [-1, 0, 1]:
        return False
    alone = all(np.count_nonzero(model.parent == k) == 1 for k in (-1, 0, 1))
    if not alone or np.any(model.mass[:2]) or np.any(model.actuator_joint < 3):
        return False
    first = model.axis[:3]
    if np.array_equal(first, [[0, 1, 0], [0, 0, 1], [1, 0, 0]]):
        return True
    if np.count_nonzero(first[:, 0]) == 1 and np.linalg.matrix_rank(first) == 3:
        warn(
            f"{file.source}: the first body floats, but not by slide along x, slide along z, hinge "
            "about y in this order and sense; gaits and walking controllers need them so."
        )
    return False
