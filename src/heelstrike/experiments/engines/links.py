"""A planar robot as engines in space are told it, link by link, where files cannot say it."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.field_texts import dataclass
from heelstrike.robot import Robot
from heelstrike.robot.loops import refuse_loops
from heelstrike.robot.model import Floats


@dataclass(frozen=True)
class Link:
    """A link and the joint that it depends on; vectors are (3,), in link axes."""

    name: str
    parent: int
    """-1 for the world."""
    hinge: bool
    """Whether its joint is a hinge; a slide otherwise."""
    axis: Floats
    place: Floats
    """axis, place: (3,) Axis of the joint, and where it is on the parent."""
    mass: float
    center: Floats
    """(3,) Centre of mass."""
    inertia: float
    """mass, inertia: Mass, and moment of inertia about the centre of mass (the same about all axes,
    of which only y plays a part)."""
    lower: float
    upper: float
    damping: float
    armature: float
    """lower, upper, damping, armature: Of the joint, whose coordinate is zero in the reference
    position of the robot."""
    points: tuple[tuple[Floats, float], ...]
    """Centre (3,) and radius of the contact points."""
    contacts: tuple[int, ...]
    """Which contact points of the robot these are."""


def links(robot: Robot, *, least_radius: float = 0.0) -> list[Link]:
    """Links of a robot, each after its parent.

    Parameters
    ----------
    robot : Robot
    least_radius : float
        Contact points get at least this radius (m), and touch the ground where they did.

    Raises
    ------
    InvalidRunError
        If the robot has what no engine here is told.
    """
    model = robot.model
    refuse_loops(robot, "what hands robots over to other engines", InvalidRunError)
    if np.any(model.friction_scale != 1.0):
        raise InvalidRunError("its points have friction scales, which this engine is not told")
    for name in ("stiffness", "dry_friction"):
        if np.any(getattr(model, name)):
            raise InvalidRunError(f"this engine is not given {name.replace('_', ' ')} of joints")

    def points(link: int) -> tuple[tuple[Floats, float], ...]:
        found = []
        for i in np.flatnonzero(model.contact_link == link):
            radius = max(float(model.contact_radius[i]), least_radius)
            center = space(model.contact_position[i])
            center[2] += radius - float(model.contact_radius[i])
            found.append((center, radius))
        return tuple(found)

    return [
        Link(
            f"link{i}",
            int(model.parent[i]),
            bool(model.axis[i, 0]),
            np.array([0.0, model.axis[i, 0], 0.0])
            if model.axis[i, 0]
            else space(model.axis[i, 1:]),
            space(model.offset[i]),
            float(model.mass[i]),
            space(model.center_of_mass[i]),
            float(model.inertia[i]),
            float(model.lower[i] - model.reference[i]),
            float(model.upper[i] - model.reference[i]),
            float(model.damping[i]),
            float(model.armature[i]),
            points(i),
            tuple(np.flatnonzero(model.contact_link == i).tolist()),
        )
        for i in range(robot.nv)
    ]


def space(vector: Any) -> Floats:
    """Put a vector (x, z) of the plane into space."""
    return np.array([float(vector[0]), 0.0, float(vector[1])])
