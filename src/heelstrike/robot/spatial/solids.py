"""What a robot in space looks like: convex solids fixed to its links."""

from __future__ import annotations

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.tolerances import ON_A_LINE


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex solid on a link, or what a ball covers within one."""

    link: int
    """The link that it is fixed to."""
    corners: Floats
    """(k, 3) Corners in the frame of the link, in m; one for a ball, two for a capsule."""
    radius: float
    """Radius of the ball, in m; 0 for the solid itself."""

    def surface(self) -> tuple[Floats, Integers]:
        """Return corners (m, 3) of a polyhedron around all of it, and its triangles (n, 3).

        Corners are in the frame of the link, in m. Triangles go anticlockwise, seen from outside.
        A solid without volume has no triangles.
        """
        points = self.corners
        if self.radius > 0.0:
            points = (points[:, None] + self.radius * ball()).reshape(-1, 3)
        return triangulated(points)


def triangulated(points: Floats) -> tuple[Floats, Integers]:
    """Return the corners of the hull of points (k, 3), and its triangles, from outside."""
    nothing = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    if len(points) < 4:
        return nothing
    size = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if not size[-1] > ON_A_LINE:
        return nothing
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        return nothing
    number = np.zeros(len(points), dtype=np.int64)
    number[hull.vertices] = np.arange(len(hull.vertices))
    corners = points[hull.vertices]
    faces = number[hull.simplices]
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inwards = np.einsum("ni,ni->n", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    return corners, faces


def ball() -> Floats:
    """Return corners (42, 3) on a ball of radius one, all about as far from each other."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    first = np.array([[0.0, a, b * golden] for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    corners = np.concatenate([np.roll(first, turn, axis=1) for turn in range(3)])
    apart = np.linalg.norm(corners[:, None] - corners, axis=2)
    one, other = np.nonzero(np.triu(np.isclose(apart, 2.0)))
    both = np.concatenate((corners, 0.5 * (corners[one] + corners[other])))
    return np.asarray(both / np.linalg.norm(both, axis=1, keepdims=True))
