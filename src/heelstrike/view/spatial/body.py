"""What a robot in space is drawn by: triangles that are fixed to its links.

They are those of the solids of its file. A link that has a mass and no solid is a rod to each link
that it carries, or to twice the distance of its centre of mass where it carries none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.dynamics import spatial
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.named_tree import legs
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.spatial.solids import Solid
from heelstrike.tolerances import NO_BONE

ROD = 0.02
"""Radius of a rod, in sizes of the robot."""


@dataclass(frozen=True, eq=False)
class SpatialBody:
    """Triangles fixed to the links of a robot."""

    corners: Floats
    """(m, 3) Corners in the frames of their links, in m."""
    link: Integers
    """(m,) Link of each corner."""
    faces: Integers
    """(n, 3) Corners of each triangle, anticlockwise as seen from outside."""
    foot: Integers
    """(n,) Index of the foot at the end of the leg of each triangle, −1 for the trunk."""
    size: float
    """Largest extent of the robot in its reference configuration, in m."""

    def placed(self, origin: Floats, rotation: Floats) -> Floats:
        """Return the corners in the world, (m, 3), for poses of the links, in m.

        Parameters
        ----------
        origin : (nl, 3) float
            Positions of the link frames, in m.
        rotation : (nl, 3, 3) float
            Their rotations.

        Returns
        -------
        (m, 3) float
            World positions, in m.
        """
        turned = np.einsum("mij,mj->mi", rotation[self.link], self.corners)
        return np.asarray(origin[self.link] + turned)


def body_in_space(robot: SpatialRobot) -> SpatialBody:
    """Make what a robot is drawn by."""
    poses = spatial.link_poses(robot, robot.model.reference)
    size = _extent(robot, poses.origin, poses.rotation)
    bare = set(np.flatnonzero(robot.model.mass > 0.0).tolist())
    bare -= {solid.link for solid in robot.solids}
    rods = [rod for link in sorted(bare) for rod in _rods(robot, link, poses, ROD * size)]
    solids = [*robot.solids, *rods]
    foot = legs(robot)
    corners, links, faces, feet = [], [], [], []
    count = 0
    for solid in solids:
        places, triangles = solid.surface()
        corners.append(places)
        links.append(np.full(len(places), solid.link, dtype=np.int64))
        faces.append(triangles + count)
        feet.append(np.full(len(triangles), foot[solid.link], dtype=np.int64))
        count += len(places)
    return SpatialBody(
        corners=_joined(corners, (0, 3), float),
        link=_joined(links, (0,), int),
        faces=_joined(faces, (0, 3), int),
        foot=_joined(feet, (0,), int),
        size=size,
    )


def _joined(parts: Sequence[Floats | Integers], shape: tuple[int, ...], kind: type) -> np.ndarray:
    return np.concatenate([np.zeros(shape, dtype=kind), *parts]).astype(kind)


def _extent(robot: SpatialRobot, origin: Floats, rotation: Floats) -> float:
    """Largest extent of joints, solids and contact points along a world axis."""
    model = robot.model
    heavy = origin[model.mass > 0.0]
    link = model.contact_link
    points = origin[link] + np.einsum("cij,cj->ci", rotation[link], model.contact_position)
    shown = [
        origin[s.link] + s.corners @ rotation[s.link].T + side * s.radius
        for s in robot.solids
        for side in (-1.0, 1.0)
    ]
    places = np.concatenate([heavy, points, *shown])
    return max(float(np.ptp(places, axis=0).max()), 1e-3) if len(places) else 1.0


def _rods(
    robot: SpatialRobot, link: int, poses: spatial.SpatialPoses, radius: float
) -> list[Solid]:
    """Rods of a link that has a mass and no solid."""
    model = robot.model
    turn = poses.rotation[link]
    own = poses.origin[link]
    ends = [
        (poses.origin[child] - own) @ turn
        for child in np.flatnonzero(model.parent == link).tolist()
    ]
    ends += list(model.contact_position[model.contact_link == link])
    if not ends:
        ends = [2.0 * model.center_of_mass[link]]
    rods = [
        Solid(link, np.stack((np.zeros(3), end)), radius)
        for end in ends
        if np.linalg.norm(end) > NO_BONE
    ]
    return rods or [Solid(link, np.zeros((1, 3)), 2.0 * radius)]
