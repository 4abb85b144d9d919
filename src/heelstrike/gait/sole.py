"""The flat underside of a foot: how it must be turned to lie on level ground, and where it ends."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError
from heelstrike.robot.robot import Robot

Floats = NDArray[np.float64]

TOUCHING = 1e-9
"""Contact points less than this above the ground (m) belong to the sole of a flat foot."""


@dataclass(frozen=True)
class Sole:
    """A foot lying flat.

    Attributes
    ----------
    foot : int
        Index of the foot in ``robot.feet``.
    link : int
        Link of the foot.
    angle : float
        Rotation of the link about +y (rad) at which the foot lies flat.
    point : (2,) float
        Middle of the sole on the ground, in the link frame (m).
    half_length : float
        Distance (m) from the middle of the sole to its heel and toe.
    contacts : tuple of int
        All contact points of the foot.
    """

    foot: int
    link: int
    angle: float
    point: Floats
    half_length: float
    contacts: tuple[int, ...]


def sole(robot: Robot, foot: int) -> Sole:
    """Find the flat sole of a foot: the pair of its contact discs it can rest on.

    Of several such pairs, the one nearest to the foot's reference orientation counts.

    Raises
    ------
    GaitError
        If the foot has fewer than two contact points, or they all lie in one place.
    """
    name = robot.feet[foot].name
    contacts = robot.feet[foot].contacts
    if len(contacts) < 2:
        raise GaitError(
            f"robot {robot.name!r}: foot {name!r} has {len(contacts)} contact point(s). A flat "
            "foot needs a heel and a toe; for a gait on points, give each foot a single one."
        )
    center = robot.model.contact_position[list(contacts)]
    radius = robot.model.contact_radius[list(contacts)]
    best: tuple[float, float, float, float] | None = None
    for i, j in combinations(range(len(contacts)), 2):
        for angle in _tangent_angles(center[i] - center[j], radius[i] - radius[j]):
            x, z = _rotated(center, angle)
            bottom = z - radius
            if bottom.min() < bottom[i] - TOUCHING:
                continue
            touching = x[bottom < bottom[i] + TOUCHING]
            extent = float(np.ptp(touching))
            if extent > TOUCHING and (best is None or abs(angle) < abs(best[0])):
                best = (angle, float(touching.min()), float(touching.max()), float(bottom[i]))
    if best is None:
        raise GaitError(
            f"robot {robot.name!r}: foot {name!r} cannot rest flat on its contact points; they "
            "lie in one place. Give it a heel and a toe."
        )
    angle, heel, toe, ground = best
    point = np.array(_rotated(np.array([[0.5 * (heel + toe), ground]]), -angle)).ravel()
    return Sole(foot, robot.feet[foot].link, angle, point, 0.5 * (toe - heel), contacts)


def point_sole(robot: Robot, foot: int) -> Sole:
    """Return the sole of a foot with a single contact disc: the bottom of it, without length."""
    (contact,) = robot.feet[foot].contacts
    radius = float(robot.model.contact_radius[contact])
    point = robot.model.contact_position[contact] - np.array([0.0, radius])
    return Sole(foot, robot.feet[foot].link, 0.0, point, 0.0, (contact,))


def _rotated(points: Floats, angle: float) -> tuple[Floats, Floats]:
    """World components of link-frame vectors when the link is turned by an angle about +y."""
    c, s = np.cos(angle), np.sin(angle)
    x, z = points.T
    return c * x + s * z, c * z - s * x


def _tangent_angles(difference: Floats, radii: float) -> list[float]:
    """Angles in (-pi, pi] that bring the bottoms of two discs to one height.

    Solves c dz - s dx = dr for the rotation angle, with (dx, dz) between the centres.
    """
    dx, dz = difference
    length = float(np.hypot(dx, dz))
    if length <= abs(radii):
        return []
    direction = np.arctan2(dz, dx)
    offset = np.arcsin(radii / length)
    angles = np.array([direction - offset, direction - np.pi + offset])
    return [float(a) for a in np.arctan2(np.sin(angles), np.cos(angles))]
