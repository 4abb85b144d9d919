"""What of a robot and its ground does not change while it moves, for ``drawing.js``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.dynamics import link_poses
from heelstrike.robot.robot import Robot
from heelstrike.view.drawing import Skeleton, body, extent
from heelstrike.view.style import in_words

DIGITS = 6
"""Digits behind the point of places in a scene: micrometres."""


def scene(robot: Robot, ground: Ground) -> dict[str, Any]:
    """Describe a robot and its ground in numbers and names that JSON has.

    Its members are those that ``drawing.js`` lists; a live viewer sends the same.

    Parameters
    ----------
    robot : Robot
        The robot.
    ground : Ground
        What it moves on.

    Returns
    -------
    dict
        Shapes by links, names of contact points and feet, size (m), weight (N), corners (m).
    """
    shape = body(robot)
    poses = link_poses(robot, robot.model.reference)
    low, high = extent(shape.segments(poses.origin, poses.angle))
    foot_of = {i: index for index, foot in enumerate(robot.feet) for i in foot.contacts}
    return {
        "robot": robot.name,
        "shapes": _shapes(shape),
        "links": list(robot.link_names),
        "contacts": [
            {"name": in_words(name), "foot": foot_of.get(i, -1)}
            for i, name in enumerate(robot.contact_names)
        ],
        "feet": [{"name": in_words(foot.name)} for foot in robot.feet],
        "size": round(max(float((high - low).max()), 1e-3), DIGITS),
        "weight": float(robot.weight),
        "ground": _corners(ground).ravel().tolist(),
    }


SMOOTH_UP_TO = 20.0
"""How far (m) from the origin smooth ground is drawn as it is; beyond, it goes on straight."""


def _corners(ground: Ground) -> NDArray[np.float64]:
    if ground.shape is None:
        return ground.model().vertices
    return np.round(ground.outline(-SMOOTH_UP_TO, SMOOTH_UP_TO), DIGITS)


def _shapes(shape: Skeleton) -> list[dict[str, Any]]:
    """Outlines and bones from back to front."""
    pieces = shape.pieces or tuple(slice(i, i + 1) for i in range(len(shape.link)))
    found = []
    for piece in pieces:
        link, end = (int(i) for i in shape.link[piece.start])
        bone = piece.stop - piece.start == 1
        corners = shape.local[piece.start] if bone else shape.local[piece, 0]
        one = {
            "link": link,
            "foot": int(shape.foot[piece.start]),
            "width": float(shape.width[piece.start]),
            "corners": np.round(corners, DIGITS).ravel().tolist(),
        }
        found.append(one | {"end": end} if bone and end != link else one)
    return found
