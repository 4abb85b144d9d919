"""The support polygon: the least convex area of the ground round the points that carry a robot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.support import carrying
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.shapes.convex import convex_hull
from heelstrike.sim.spatial.run import SpatialRun, tangents_of


@dataclass(frozen=True, eq=False)
class SupportPolygon:
    """A convex area of a plane."""

    origin: Floats
    """(3,) A point of the plane, in m."""
    axes: Floats
    """(3, 3) Normal of the plane and two directions in it, in rows."""
    corners: Floats
    """(k, 2) Corners along those directions from the origin, in m, in order; one or two where the
    points lie at one place or on a line, none where nothing carries."""

    @property
    def world(self) -> Floats:
        """(k, 3) The corners in the world, in m."""
        return np.asarray(self.origin + self.corners @ self.axes[1:])

    @property
    def area(self) -> float:
        """Area (m²)."""
        x, y = self.corners.T if len(self.corners) else np.zeros((2, 0))
        return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))

    def margin(self, point: Floats) -> float:
        """Distance of a point from the nearest edge, positive inside, in m.

        Parameters
        ----------
        point : (3,) array
            The point, in the world (m); it is seen along the normal.

        Returns
        -------
        float
            NaN where there are no corners. On a line or at one point nothing is inside: the
            distance from it, negative, and along a line zero between its ends.
        """
        place = self.axes[1:] @ (np.asarray(point, np.float64) - self.origin)
        return margin(self.corners, place)


def margin(corners: Floats, place: Floats) -> float:
    """Distance of a place from the nearest edge of a convex polygon, positive inside."""
    if not len(corners) or not np.all(np.isfinite(place)):
        return float("nan")
    edge = np.roll(corners, -1, axis=0) - corners
    away = place - corners
    length = np.einsum("ki,ki->k", edge, edge)
    share = np.einsum("ki,ki->k", away, edge) / np.where(length > 0.0, length, 1.0)
    nearest = corners + np.clip(share, 0.0, 1.0)[:, None] * edge
    distance = float(np.linalg.norm(nearest - place, axis=1).min())
    if len(corners) < 3:
        return -distance
    side = edge[:, 0] * away[:, 1] - edge[:, 1] * away[:, 0]
    return distance if np.all(side >= 0.0) or np.all(side <= 0.0) else -distance


def plane_of(run: SpatialRun, row: int, touching: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Point and axes (normal, t1, t2) of the plane under the point that is pressed hardest."""
    among = np.flatnonzero(touching)
    hardest = int(among[np.argmax(run.contact_force[row, among, 0])])
    normal = run.contact_normal[row, hardest]
    origin = run.contact_point[row, hardest] - run.gap[row, hardest] * normal
    return origin, np.stack((normal, *tangents_of(normal)))


def support_polygon(run: SpatialRun, row: int) -> SupportPolygon:
    """Find the polygon round the contact points that carry a robot in space.

    It lies in the plane of the ground under the point that is pressed hardest; others are seen
    along its normal.

    Parameters
    ----------
    run : SpatialRun
        The run.
    row : int
        A row of it.

    Returns
    -------
    SupportPolygon
        Without corners where nothing touches.
    """
    return polygon_of(run, row, carrying(run)[row])


def polygon_of(run: SpatialRun, row: int, touching: NDArray[np.bool_]) -> SupportPolygon:
    """Find the polygon round some contact points in a row."""
    if not touching.any():
        return SupportPolygon(np.zeros(3), np.roll(np.eye(3), 1, axis=0), np.zeros((0, 2)))
    origin, axes = plane_of(run, row, touching)
    places = (run.contact_point[row, touching] - origin) @ axes[1:].T
    return SupportPolygon(origin, axes, convex_hull(places))
