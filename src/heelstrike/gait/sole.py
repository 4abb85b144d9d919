"""How a foot stands on level ground: flat between heel and toe, or on a point."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.tolerances import CLOSED_GAP


@dataclass(frozen=True)
class Sole:
    """A foot standing on level ground."""

    foot: int
    """Index of the foot in ``robot.feet``."""
    link: int
    """Link of the foot."""
    angle: float
    """Rotation of the link about +y (rad) at which the foot lies flat; zero for a point foot."""
    point: Floats
    """(2,) Middle of the sole on the ground, or centre of a point foot's disc, in the link frame
    (m)."""
    radius: float
    """Radius of a point foot's disc (m), which rolls; zero for a flat foot."""
    half_length: float
    """Distance (m) from the middle of the sole to its heel and toe; zero for a point foot."""
    contacts: tuple[int, ...]
    """All contact points of the foot."""

    @property
    def flat(self) -> bool:
        """Whether the ground can exert a moment on the foot."""
        return self.half_length > 0.0

    @property
    def held(self) -> int:
        """How many coordinates of the trunk follow from the others: x, z and, if flat, pitch."""
        return 3 if self.flat else 2


def sole(robot: Robot, foot: int) -> Sole:
    """Find what a foot stands on: its only contact disc, or the pair of them it can rest on.

    Of several such pairs, the one nearest to the foot's reference orientation counts.

    Raises
    ------
    GaitError
        If the foot has several contact points, but all in one place.
    """
    name, link = robot.feet[foot].name, robot.feet[foot].link
    contacts = robot.feet[foot].contacts
    if len(contacts) == 1:
        (contact,) = contacts
        center, disc = robot.model.contact_position[contact], robot.model.contact_radius[contact]
        return Sole(foot, link, 0.0, center, float(disc), 0.0, contacts)
    center = robot.model.contact_position[list(contacts)]
    radius = robot.model.contact_radius[list(contacts)]
    found: list[tuple[float, float, float, float]] = []
    for i, j in combinations(range(len(contacts)), 2):
        for angle in _tangent_angles(center[i] - center[j], radius[i] - radius[j]):
            x, z = _rotated(center, angle)
            bottom = z - radius
            touching = x[bottom < bottom[i] + CLOSED_GAP]
            if bottom.min() >= bottom[i] - CLOSED_GAP and np.ptp(touching) > CLOSED_GAP:
                found.append((angle, touching.min(), touching.max(), bottom[i]))
    if not found:
        raise GaitError(
            f"robot {robot.name!r}: foot {name!r} cannot rest flat on its contact points; they "
            "lie in one place. Give it a heel and a toe, or a single one for a gait on points."
        )
    best = min(found, key=lambda one: abs(one[0]))
    angle, heel, toe, ground = (float(number) for number in best)
    point = np.array(_rotated(np.array([[0.5 * (heel + toe), ground]]), -angle)).ravel()
    return Sole(foot, link, angle, point, 0.0, 0.5 * (toe - heel), contacts)


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


def leg(robot: Robot, foot: Sole) -> list[int]:
    """Links from a foot up, without those of the trunk's coordinates."""
    links = [foot.link]
    while (parent := int(robot.model.parent[links[-1]])) > 2:
        links.append(parent)
    return links


def standing_height(robot: Robot, stance: Sole) -> float:
    """Height of the trunk above a sole in the reference configuration, in m."""
    ground = np.array(_rotated(stance.point, stance.angle)) - [0.0, stance.radius]
    height = -float(ground[1] + robot.model.offset[leg(robot, stance), 1].sum())
    if not height > 0.0:
        raise GaitError(
            f"robot {robot.name!r}: in its reference configuration the trunk is not above the "
            "feet; give the robot's file a configuration in which it stands."
        )
    return height


def reach(robot: Robot, feet: tuple[Sole, Sole], lower: Floats, upper: Floats) -> float:
    """Distance of the feet with both legs in one line, an upper bound of any step (m)."""
    model = robot.model
    right, left = (leg(robot, foot) for foot in feet)
    own = [[j for j in right if j not in left], [j for j in left if j not in right]]
    # The last offset is from the trunk to the hip: only the distance of the hips counts.
    hips = model.offset[own[0][-1]] - model.offset[own[1][-1]]
    lengths = np.linalg.norm(model.offset[own[0][:-1] + own[1][:-1]], axis=1)
    slides = [j for j in own[0] + own[1] if model.axis[j, 0] == 0.0]
    spans = np.abs(np.array([lower[slides], upper[slides]]) - model.reference[slides])
    return float(lengths.sum() + np.hypot(*hips) + spans.max(axis=0).sum())
