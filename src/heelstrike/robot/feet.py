"""Which links are feet, and what their contact points are called."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Foot


def find_feet(model: Model, names: tuple[str, ...], origin: Floats) -> tuple[Foot, ...]:
    """Find the links that end a leg: leaves of the tree with contact points, low on the robot.

    Low means that, in the reference configuration, the lowest contact point of the link is below
    the middle between the lowest one of the robot and the robot's centre of mass. So hands and the
    ends of a tail are not feet; the shanks of a robot with point feet are.

    Parameters
    ----------
    model : Model
        The robot's arrays.
    names : tuple of str
        Name of every link.
    origin : (nl, 2) float
        World position of the link frames in the reference configuration.
    """
    if not model.nc:
        return ()
    center = model.mass @ (origin + model.center_of_mass) / model.mass.sum()
    bottom = (origin[model.contact_link] + model.contact_position)[:, 1] - model.contact_radius
    low = bottom.min() + 0.5 * max(0.0, float(center[1] - bottom.min()))
    leaves = np.setdiff1d(model.contact_link, model.parent).tolist()
    contacts = {link: np.flatnonzero(model.contact_link == link) for link in leaves}
    return tuple(
        Foot(names[link], link, tuple(contacts[link].tolist()))
        for link in leaves
        if bottom[contacts[link]].min() <= low
    )


def name_contacts(model: Model, names: tuple[str, ...], feet: tuple[Foot, ...]) -> tuple[str, ...]:
    """Call the two ends of a foot heel and toe, and number the points of everything else.

    Contact points are in the order of their links, and of x on a link.
    """
    ends = {foot.link: foot.contacts for foot in feet if len(foot.contacts) == 2}
    result = []
    for link in np.unique(model.contact_link).tolist():
        x = model.contact_position[model.contact_link == link, 0]
        sole = link in ends and x[1] - x[0] > 1e-6
        endings = ("heel", "toe") if sole else range(len(x))
        result += [f"{names[link]}_{ending}" for ending in endings]
    return tuple(result)
