"""From the shapes of a file, as they are there to be seen, to the solids of a robot in space."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.shapes import (
    ELLIPSOID,
    FARTHEST,
    MESH,
    ball_radius,
    geom_corners,
    shapes_to_see,
)
from heelstrike.robot.shapes.solids import few_corners
from heelstrike.robot.spatial.links import SpatialLinks
from heelstrike.robot.spatial.solids import Solid, ball

MOST_CORNERS = 28
"""Corners by which a mesh is drawn at most."""

AROUND = 16
"""Corners round each end of a cylinder that is drawn."""

DIGITS = 6
"""Digits behind the point of places of solids: micrometres."""


def read_solids(file: MujocoFile, links: SpatialLinks) -> tuple[Solid, ...]:
    """Return what the links of a robot look like.

    Of every body of the file the shapes that do not collide, which are there to be seen, or the
    others if there are none. A mesh is the hull of some of its corners.
    """

    def solid(geom: int, link: int) -> Solid | None:
        return _solid(file, geom, link, links)

    return tuple(shapes_to_see(file, links.of_body, solid, list))


def _solid(file: MujocoFile, geom: int, link: int, links: SpatialLinks) -> Solid | None:
    """Return the solid of a geom; none of one that has no shape, or no size."""
    kind, radius = int(file.model.geom_type[geom]), ball_radius(file, geom)
    if kind == ELLIPSOID:
        local = np.asarray(file.model.geom_size[geom]) * ball()
    else:
        local = geom_corners(file, geom, AROUND)
    place = links.within(file, geom, local)
    if not (len(place) and np.all(np.abs(place) < FARTHEST) and radius < FARTHEST):
        return None
    if kind == MESH:
        try:
            place, _ = few_corners(place, MOST_CORNERS)
        except (ArithmeticError, RuntimeError, ValueError, np.linalg.LinAlgError):
            return None  # corners of which no hull can be made
    return Solid(link, np.round(place, DIGITS), radius)
