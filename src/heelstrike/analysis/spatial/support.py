"""On what a robot in space stands: points on the ground, their polygon, the zero moment point.

The ground is taken for the plane under the contact point that is pressed hardest. The zero moment
point is where the contact forces have no moment in that plane (Vukobratović and Borovac 2004,
eq. 3): with f their sum, n the normal of the plane, m their moment about a point o of it,

    p = o + n × m / (f · n)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.support import NOTHING
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.shapes.convex import convex_hull
from heelstrike.sim.spatial.run import SpatialRun, tangents_of
from heelstrike.tolerances import STANDING_GAP


@dataclass(frozen=True, eq=False)
class SpatialPressure:
    """Zero moment point of a robot in space, row by row; NaN where nothing pushes."""

    point: Floats
    """(n, 3) Zero moment point of all contact forces, in the world, in m."""
    margin: Floats
    """(n,) Distance from it to the nearest edge of the support polygon; positive inside (m). That
    of a polygon without area is zero at most."""
    polygon: tuple[Floats, ...]
    """(k, 3) Corners of the support polygon of each row, anticlockwise as seen from above, in the
    world, in m: of one or two points these, of none nothing."""


def pushing_in_space(run: SpatialRun) -> NDArray[np.bool_]:
    """Tell which contact points push, (nt, nc).

    Parameters
    ----------
    run : SpatialRun
        The run.

    Returns
    -------
    (nt, nc) bool
        Whether the normal force is more than 1e-9 of the weight.
    """
    return np.asarray(run.contact_force[..., 0] > NOTHING * run.robot.weight)


def on_ground(run: SpatialRun) -> Floats:
    """Projections of the contact points onto the ground, (nt, nc, 3), in m."""
    return np.asarray(run.contact_point - run.gap[..., None] * run.contact_normal)


def pressure_in_space(run: SpatialRun, rows: Integers | None = None) -> SpatialPressure:
    """Find zero moment point and support polygon in some rows of a run.

    Parameters
    ----------
    run : SpatialRun
        The run.
    rows : (n,) int, optional
        Which rows; all by default.

    Returns
    -------
    SpatialPressure
        Of each row.
    """
    chosen = np.arange(len(run.time)) if rows is None else rows
    count = len(chosen)
    point, margin = np.full((count, 3), np.nan), np.full(count, np.nan)
    polygons: list[Floats] = [np.zeros((0, 3))] * count
    if not run.robot.nc:
        return SpatialPressure(point, margin, tuple(polygons))
    force, feet = run.world_force, on_ground(run)
    touching = (run.gap <= STANDING_GAP) | pushing_in_space(run)
    floor = NOTHING * run.robot.weight
    for i, row in enumerate(chosen.tolist()):
        hardest = int(np.argmax(run.contact_force[row, :, 0]))
        normal = run.contact_normal[row, hardest]
        center = feet[row, hardest]
        arm = feet[row] - center
        pressing = float((force[row] @ normal).sum())
        loaded = pressing > floor
        if loaded:
            moment = np.cross(arm, force[row]).sum(axis=0)
            point[i] = center + np.cross(normal, moment) / pressing
        own = touching[row]
        if not own.any():
            continue
        first, second = tangents_of(normal)
        flat = np.stack((arm[own] @ first, arm[own] @ second), axis=1)
        corners = convex_hull(flat)
        polygons[i] = center + corners[:, :1] * first + corners[:, 1:] * second
        if loaded:
            away = point[i] - center
            margin[i] = inside(np.array([away @ first, away @ second]), corners)
    return SpatialPressure(point, margin, tuple(polygons))


def inside(point: Floats, polygon: Floats) -> float:
    """How far a point (2,) is inside a convex polygon (k, 2), anticlockwise; negative outside."""
    if len(polygon) < 3:
        ends = polygon[0], polygon[-1]
        along = ends[1] - ends[0]
        length = float(along @ along)
        share = np.clip((point - ends[0]) @ along / length, 0.0, 1.0) if length > 0.0 else 0.0
        return -float(np.linalg.norm(point - ends[0] - share * along))
    edge = np.roll(polygon, -1, axis=0) - polygon
    away = point - polygon
    across = (edge[:, 0] * away[:, 1] - edge[:, 1] * away[:, 0]) / np.linalg.norm(edge, axis=1)
    if across.min() >= 0.0:
        return float(across.min())
    share = np.einsum("ki,ki->k", away, edge) / np.einsum("ki,ki->k", edge, edge)
    nearest = polygon + np.clip(share, 0.0, 1.0)[:, None] * edge
    return -float(np.linalg.norm(point - nearest, axis=1).min())


def capture_point_in_space(run: SpatialRun, center: Floats, velocity: Floats) -> Floats:
    """Where a foot would have to stand to bring the robot to rest above it, (n, 3), in m.

    Of the linear inverted pendulum: x + ẋ √(h/g), h being the height of the centre of mass above
    the plane of the ground (Pratt, Carff, Drakunov, Goswami 2006); likewise along y. NaN where that
    is negative.

    Parameters
    ----------
    run : SpatialRun
        The run, for gravity and ground.
    center, velocity : (n, 3) float
        Of the centre of mass (m, m/s).

    Returns
    -------
    (n, 3) float
        Places on the plane of the ground, in m.
    """
    normal = np.asarray(run.ground.normal, dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    gravity = max(float(np.linalg.norm(run.robot.model.gravity)), 1e-12)

    def below(places: Floats) -> Floats:
        slope = (places[:, :2] @ normal[:2]) / normal[2]
        return np.asarray(run.ground.height - slope)

    with np.errstate(invalid="ignore"):
        delay = np.sqrt((center[:, 2] - below(center)) / gravity)
    place = center + delay[:, None] * velocity
    place[:, 2] = below(place)
    return np.asarray(place)
