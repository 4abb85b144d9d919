"""From the bodies and joints of a file to the planar links of a `Model`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from heelstrike.robot.files.inertias import MASSLESS
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.model import Floats, Integers

MOST_JOINTS = 1000


@dataclass(frozen=True)
class Links:
    """The kinematic tree and inertia of a robot.

    Attributes
    ----------
    numbers : dict of str to array
        Numbers of `Model`: the tree and the inertia of its links.
    origin : (nl, 2) float
        World position of the link frames in the reference configuration.
    of_body : (nbody,) int
        Link that each body of the file belongs to; -1 for what is fixed to the world.
    names : tuple of str
        Body that each link moves.
    """

    numbers: dict[str, Any]
    origin: Floats
    of_body: Integers
    names: tuple[str, ...]

    @property
    def axis(self) -> Floats:
        """Motion of every joint per unit of its coordinate."""
        axis: Floats = self.numbers["axis"]
        return axis


def read_links(file: MujocoFile) -> Links:
    """Turn the bodies of a robot seen in the plane into links of one degree of freedom each.

    A body with several joints becomes a chain of links and its mass goes to the last; a body
    without joints is welded to the link of its parent. Frames are parallel to the world in the
    reference configuration, so the orientations that the file gives its bodies never matter.

    Raises
    ------
    RobotError
        If there is no joint at all, or too many.
    """
    model, coordinates = file.model, file.coordinates
    if not coordinates:
        raise file.error(
            "the robot has no joints, so nothing can move. A body that floats needs three: "
            "slide along x, slide along z, hinge about y; did the root <body> lose its <joint>s?"
        )
    if len(coordinates) > MOST_JOINTS:
        raise file.error(
            f"the robot has {len(coordinates)} joints; heelstrike takes up to {MOST_JOINTS}, whose "
            "equations are dense."
        )
    of_body = np.full(model.nbody, -1, dtype=np.int64)
    parent = np.empty(len(coordinates), dtype=np.int64)
    moves: dict[int, list[int]] = {}
    for index, one in enumerate(coordinates):
        moves.setdefault(one.body, []).append(index)
    for body in range(1, model.nbody):
        link = of_body[model.body_parentid[body]]
        for index in moves.get(body, ()):
            parent[index] = link
            link = index
        of_body[body] = link

    origin = np.array([one.anchor[::2] for one in coordinates])
    offset = origin - np.where((parent >= 0)[:, None], origin[parent], 0.0)
    tree = {"parent": parent, "axis": _axes(file), "offset": offset}
    names = tuple(file.name("body", one.body) for one in coordinates)
    return Links(tree | _inertia(file, of_body, origin), origin, of_body, names)


def _axes(file: MujocoFile) -> Floats:
    """Motion per unit of each coordinate as (rotation about y, translation x, z)."""
    hinge = np.array([one.hinge for one in file.coordinates])[:, None]
    axes = np.array([one.axis for one in file.coordinates])
    turn = np.column_stack([np.sign(axes[:, 1]), np.zeros((len(axes), 2))])
    direction = axes[:, ::2].copy()
    direction[np.abs(direction) < 1e-12] = 0.0  # round-off of the file's rotations
    length = np.where(hinge, 1.0, np.hypot(*direction.T)[:, None])
    slide = np.column_stack([np.zeros(len(axes)), direction / length])
    return np.where(hinge, turn, slide)


def _inertia(file: MujocoFile, of_body: Integers, origin: Floats) -> dict[str, Floats]:
    """Mass, centre of mass (link frame) and inertia of every link, its welded bodies combined."""
    model, pose = file.model, file.pose
    moving = of_body >= 0
    link = of_body[moving]
    body_mass = model.body_mass[moving].copy()
    position = pose.xipos[moving, ::2] - origin[link]
    # Only the moment about y of the rotated inertia tensor acts in the plane.
    about_y = ((pose.ximat[moving, 3:6] ** 2) * model.body_inertia[moving]).sum(axis=1)
    nothing = body_mass < MASSLESS
    body_mass[nothing] = 0.0
    about_y[about_y < MASSLESS] = 0.0

    def total(values: Floats) -> Floats:
        return np.bincount(link, values, minlength=len(origin)).astype(np.float64)

    mass = total(body_mass)
    moment = np.column_stack([total(body_mass * position[:, k]) for k in range(2)])
    center = np.divide(moment, mass[:, None], out=np.zeros_like(moment), where=mass[:, None] > 0)
    distance = ((position - center[link]) ** 2).sum(axis=1)
    inertia = total(about_y + body_mass * distance)
    return {"mass": mass, "center_of_mass": center, "inertia": inertia}
