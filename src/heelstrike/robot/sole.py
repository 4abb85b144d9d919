"""The frame in which a foot's wrench and zero moment point are given: the ankle over the sole."""

from __future__ import annotations

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.named_tree import Foot
from heelstrike.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Sole:
    """The line under a foot from its first to its last contact point."""

    foot: Foot
    """The foot."""
    reference: Floats
    """(2,) Reference point in the link frame (m): the foot link's origin, that is the ankle,
    projected onto the sole. A foot of one contact point has its reference there."""
    heel: float
    toe: float
    """heel, toe: Ends of the sole, measured forward along it from the reference point (m)."""
    ends: Floats
    """(2, 2) The same, heel and toe, as points (x, z) in the link frame (m)."""


def sole(robot: Robot, foot: Foot) -> Sole:
    """Find the sole of a foot: the common tangent under its first and last contact discs."""
    contacts = list(foot.contacts)
    center = robot.model.contact_position[contacts]
    radius = robot.model.contact_radius[contacts]
    length = float(np.hypot(*(center[-1] - center[0])))
    if length <= abs(radius[-1] - radius[0]):  # one point, or one disc inside the other
        lowest = center[0] - [0.0, radius[0]]
        return Sole(foot, lowest, 0.0, 0.0, np.array([lowest, lowest]))
    along = (center[-1] - center[0]) / length
    below = np.array([along[1], -along[0]])
    sine = (radius[-1] - radius[0]) / length
    down = np.sqrt(1.0 - sine**2) * below - sine * along  # normal to the tangent, out of the foot
    forward = np.array([-down[1], down[0]])
    bottom = center + radius[:, None] * down
    reference = bottom[0] - (bottom[0] @ forward) * forward
    place = (bottom - reference) @ forward
    heel, toe = float(place.min()), float(place.max())
    ends = reference + np.outer((heel, toe), forward)
    return Sole(foot, reference, heel, toe, ends)


def soles(robot: Robot) -> tuple[Sole, ...]:
    """Return the sole of every foot of a robot, in the order of ``robot.feet``.

    Parameters
    ----------
    robot : Robot
        The robot.

    Returns
    -------
    tuple of Sole
        One a foot.
    """
    return tuple(sole(robot, foot) for foot in robot.feet)


def has_length(robot: Robot, sole: Sole) -> bool:
    """Whether a foot can stand on a sole: it is neither a point nor a wheel."""
    around = are_around(robot.model.contact_position[list(sole.foot.contacts)])
    return sole.toe > sole.heel and not around


def are_around(points: Floats) -> bool:
    """Whether points lie on all sides of the joint, as those of a wheel: no half-plane is free."""
    if len(points) < 3:
        return False
    angle = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    return bool(np.diff(angle, append=angle[0] + 2.0 * np.pi).max() < np.pi)
