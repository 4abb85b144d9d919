"""From arrays and names to a `SpatialRobot`: its feet, and what no robot may be."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.assembly import low_leaves, refuse_idle_joint, refuse_impossible_numbers
from heelstrike.robot.model import Floats
from heelstrike.robot.named_tree import Foot
from heelstrike.robot.spatial.model import BALL, FREE, HINGE, SPATIAL_NUMBERS, SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.spatial.solids import Solid

LEAST = 1e-30
"""Resistance (kg, kg m²) of a joint that is none: places that differ by rounding make less."""


def assembled_in_space(
    name: str,
    model: SpatialModel,
    *,
    joint_names: tuple[str, ...],
    link_names: tuple[str, ...],
    actuator_names: tuple[str, ...],
    friction: tuple[float, ...],
    source: str,
    origin: Floats,
    axes: Floats,
    solids: tuple[Solid, ...] = (),
) -> SpatialRobot:
    """Make a robot in space of its numbers and names.

    Parameters
    ----------
    name : str
        Name of the robot.
    model : SpatialModel
        Its numbers.
    joint_names, link_names, actuator_names : tuple of str
        Its names.
    friction : tuple of float
        Friction of its contact points, as its file has it.
    source : str
        What to call the robot in messages.
    origin, axes : (nl, 3) and (nl, 3, 3) float
        World poses of its links in the reference configuration.
    solids : tuple of Solid
        What its links look like.

    Raises
    ------
    RobotError
        If a number is NaN or absurdly large, or a joint moves no mass.
    """
    refuse_impossible_numbers(model, SPATIAL_NUMBERS, source)
    for joint in idle_joints(model, origin, axes):
        refuse_idle_joint(joint_names[joint], source)
    return SpatialRobot(
        name=name,
        model=model,
        joint_names=joint_names,
        link_names=link_names,
        actuator_names=actuator_names,
        contact_names=_name_contacts(model, link_names),
        feet=_find_feet(model, link_names, origin, axes),
        contact_friction=friction,
        source=source,
        solids=solids,
    )


def _name_contacts(model: SpatialModel, names: tuple[str, ...]) -> tuple[str, ...]:
    """Number the points of every link."""
    found: list[str] = []
    for link in np.unique(model.contact_link).tolist():
        found += [f"{names[link]}_{k}" for k in range(np.count_nonzero(model.contact_link == link))]
    return tuple(found)


def _find_feet(
    model: SpatialModel, names: tuple[str, ...], origin: Floats, axes: Floats
) -> tuple[Foot, ...]:
    """Find the links that end a leg, as :func:`heelstrike.robot.assembly.find_feet` does."""
    if not model.nc:
        return ()
    center = origin + np.einsum("lij,lj->li", axes, model.center_of_mass)
    height = float(model.mass @ center[:, 2] / model.mass.sum())
    place = np.einsum("cij,cj->ci", axes[model.contact_link], model.contact_position)
    along = np.einsum("cij,cj->ci", axes[model.contact_link], model.contact_axis)[:, 2]
    drop = model.contact_radius + model.contact_rim * np.sqrt(np.maximum(0.0, 1.0 - along**2))
    bottom = origin[model.contact_link, 2] + place[:, 2] - drop
    return low_leaves(model, names, bottom, height)


def idle_joints(model: SpatialModel, origin: Floats, axes: Floats) -> list[int]:
    """Joints that nothing resists, with their links in given world poses."""
    resistance = model.armature.copy()
    center = origin + np.einsum("lij,lj->li", axes, model.center_of_mass)
    for link in range(model.nl):
        xx, yy, zz, xy, xz, yz = model.inertia[link]
        local = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        tensor = axes[link] @ local @ axes[link].T
        above = link
        while above >= 0:
            for k, (turns, along) in enumerate(_motions(model, above, axes)):
                moved = along + np.cross(turns, center[link] - origin[above])
                resistance[model.first_velocity[above] + k] += (
                    model.mass[link] * moved @ moved + turns @ tensor @ turns
                )
            above = int(model.parent[above])
    return [int(joint) for joint in np.unique(model.velocity_joint[~(resistance > LEAST)])]


def _motions(model: SpatialModel, link: int, axes: Floats) -> list[tuple[Floats, Floats]]:
    """Angular velocity and velocity of the origin of a link, per unit of its joint's velocities."""
    still = np.zeros(3)
    kind = int(model.joint_kind[link])
    axis = axes[link] @ model.axis[link]
    turns = [(axes[link][:, k], still) for k in range(3)]
    if kind == FREE:
        return [*((still, np.eye(3)[k]) for k in range(3)), *turns]
    if kind == BALL:
        return turns
    return [(axis, still)] if kind == HINGE else [(still, axis)]
