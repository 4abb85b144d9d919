"""Which links are feet, and what their contact points are called."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.robot.contact_points import ContactPoint
from heelstrike.robot.robot import Foot


def find_feet(
    parent: NDArray[np.int64],
    names: tuple[str, ...],
    points: list[ContactPoint],
    origin: NDArray[np.float64],
    center_of_mass: NDArray[np.float64],
) -> tuple[Foot, ...]:
    """Find the links that end a leg: leaves of the tree with contact points, low on the robot.

    Low means that, in the reference configuration, the lowest contact point of the link is below
    the middle between the lowest one of the robot and the robot's centre of mass. So hands and the
    ends of a tail are not feet; the shanks of a robot with point feet are.

    Parameters
    ----------
    parent : (nv,) int
        Parent of every link.
    names : tuple of str
        Name of every link.
    points : list of ContactPoint
        Contact points in the order of the model.
    origin : (nv, 2) float
        World position of the link frames in the reference configuration.
    center_of_mass : (2,) float
        World position of the robot's centre of mass in the reference configuration.
    """
    if not points:
        return ()
    leaves = set(range(len(parent))) - {int(p) for p in parent}
    heights = np.array([origin[p.link, 1] + p.z - p.radius for p in points])
    low = heights.min() + 0.5 * max(0.0, float(center_of_mass[1] - heights.min()))
    feet = []
    for link in sorted({p.link for p in points} & leaves):
        contacts = tuple(i for i, p in enumerate(points) if p.link == link)
        if heights[list(contacts)].min() <= low:
            feet.append(Foot(names[link], link, contacts))
    return tuple(feet)


def name_contacts(
    names: tuple[str, ...], points: list[ContactPoint], feet: tuple[Foot, ...]
) -> tuple[str, ...]:
    """Call the two ends of a foot heel and toe, and number the points of everything else."""
    result = [""] * len(points)
    by_link: dict[int, list[int]] = {}
    for i, point in enumerate(points):
        by_link.setdefault(point.link, []).append(i)
    foot_links = {foot.link for foot in feet}
    for link, contacts in by_link.items():
        sole = (
            link in foot_links
            and len(contacts) == 2
            and points[contacts[1]].x - points[contacts[0]].x > 1e-6
        )
        endings = ["heel", "toe"] if sole else [str(k) for k in range(len(contacts))]
        for i, ending in zip(contacts, endings, strict=True):
            result[i] = f"{names[link]}_{ending}"
    return tuple(result)
