"""Convex polygons in the plane: outlines of shapes, and the part of one on which it can stand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.tolerances import LEVEL_SOLE, ON_A_LINE

Floats = NDArray[np.float64]

STEEPEST = 1.0
"""Slope of the steepest edge on which a foot is expected to roll: 45 degrees."""
COARSE = 0.01
"""Share of its size by which an outline may be smaller where corners are left out."""


def circle(around: int) -> Floats:
    """So many corners (k, 2) on a circle of radius one."""
    turn = np.arange(around) * (2.0 * np.pi / around)
    return np.column_stack((np.cos(turn), np.sin(turn)))


def convex_hull(points: Floats) -> Floats:
    """Corners (k, 2) of the least convex polygon around points (n, 2), from +x towards +z."""
    center = points.mean(axis=0)
    along = np.linalg.svd(points - center, full_matrices=False)[2] if len(points) > 1 else np.eye(2)
    across = (points - center) @ along[-1]
    if len(points) < 3 or np.ptp(across) < ON_A_LINE:
        on_line = (points - center) @ along[0]
        ends = points[[np.argmin(on_line), np.argmax(on_line)]]
        return ends[:1] if np.ptp(on_line) < ON_A_LINE else ends
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).vertices], dtype=np.float64)


def with_fewer_corners(polygon: Floats) -> Floats:
    """Leave out the corners of a convex polygon that hardly stand out from their neighbours."""
    least = COARSE * float(np.ptp(polygon, axis=0).max())
    corners = polygon
    while len(corners) > 3:
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        height = _distance(corners, before, after)
        flattest = int(np.argmin(height))
        if height[flattest] > least:
            break
        corners = np.delete(corners, flattest, axis=0)
    return corners


def lowest_chain(points: Floats) -> Floats:
    """Corners (k, 2) of the hull of points (n, 2) on which it stands and rolls, back to front.

    The first and last of the lowest ones, and before and behind them what is less steep than 45
    degrees, without what stands out by less than a hundredth of the size.
    """
    hull = convex_hull(points)
    hull = hull[np.lexsort((hull[:, 1], hull[:, 0]))]
    # The lower ones of the hull's corners: those below the line from the first to the last.
    first, last = hull[0], hull[-1]
    run = last[0] - first[0]
    if run < ON_A_LINE:
        return hull[:1]
    line = first[1] + (hull[:, 0] - first[0]) * (last[1] - first[1]) / run
    lower = hull[hull[:, 1] <= line + ON_A_LINE]
    low = np.flatnonzero(lower[:, 1] <= lower[:, 1].min() + LEVEL_SOLE)
    back, front = int(low[0]), int(low[-1])
    least = COARSE * float(np.ptp(points, axis=0).max())
    behind = _outwards(lower[back::-1], least)[::-1]
    ahead = _outwards(lower[front:], least)
    return np.concatenate((behind, ahead[front == back :]))


def touches_first(points: Floats, radius: Floats) -> NDArray[np.bool_]:
    """Which of the discs about points (n, 2) flat ground meets first at some tilt up to 45 degrees.

    Those that come as near as the lowest of them do, to `LEVEL_SOLE`, count.
    """
    tilt = np.arctan(STEEPEST) * np.linspace(-1.0, 1.0, 91)
    depth = points @ np.array([np.sin(tilt), -np.cos(tilt)]) + radius[:, None]
    return np.any(depth >= depth.max(axis=0) - LEVEL_SOLE, axis=1)


def nearest_points(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Points of two convex polygons (m, 2) and (n, 2) that are nearest each other.

    One point twice where they touch. A polygon may be a line or a point.
    """
    if not _apart(a, b):
        return a[0], a[0]
    on_b, far_b = _nearest_on(b, a)
    on_a, far_a = _nearest_on(a, b)
    if far_b.min() <= far_a.min():
        return a[far_b.argmin()], on_b[far_b.argmin()]
    return on_a[far_a.argmin()], b[far_a.argmin()]


def _apart(a: Floats, b: Floats) -> bool:
    """Whether a line separates two convex polygons: along an edge of one, or across from it."""
    edges = np.concatenate([np.roll(each, -1, axis=0) - each for each in (a, b)])
    across = np.column_stack((-edges[:, 1], edges[:, 0]))
    axes = np.concatenate((across, edges, [b.mean(axis=0) - a.mean(axis=0)]))
    ours, theirs = a @ axes.T, b @ axes.T
    gap = np.maximum(ours.min(axis=0) - theirs.max(axis=0), theirs.min(axis=0) - ours.max(axis=0))
    return bool(np.any(gap > ON_A_LINE * np.hypot(*axes.T)))


def _nearest_on(polygon: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Points (m, 2) of a polygon's rim nearest to points (m, 2) outside, and how far they are."""
    edge = np.roll(polygon, -1, axis=0) - polygon
    away = points[:, None] - polygon
    length = np.einsum("ni,ni->n", edge, edge)
    share = np.einsum("mni,ni->mn", away, edge) / np.where(length > 0.0, length, 1.0)
    places = polygon + np.clip(share, 0.0, 1.0)[..., None] * edge
    far = np.hypot(*np.moveaxis(points[:, None] - places, -1, 0))
    rows = np.arange(len(points))
    best = far.argmin(axis=1)
    return places[rows, best], far[rows, best]


def _outwards(chain: Floats, least: float) -> Floats:
    """Corners of a chain that rises from its first, up to the steepest, the outstanding ones."""
    steps = np.diff(chain, axis=0)
    steep = np.flatnonzero(steps[:, 1] > STEEPEST * np.abs(steps[:, 0]))
    chain = chain[: steep[0] + 1] if len(steep) else chain
    if np.hypot(*(chain[-1] - chain[0])) <= least:
        return chain[:1]
    return _outstanding(chain, least)


def _outstanding(chain: Floats, least: float) -> Floats:
    """First and last corner of a chain, and those further than `least` from the line between."""
    if len(chain) < 3:
        return chain
    height = _distance(chain[1:-1], chain[0], chain[-1])
    highest = int(np.argmax(height)) + 1
    if height[highest - 1] <= least:
        return chain[[0, -1]]
    parts = _outstanding(chain[: highest + 1], least), _outstanding(chain[highest:], least)
    return np.concatenate((parts[0], parts[1][1:]))


def _distance(point: Floats, start: Floats, end: Floats) -> Floats:
    """Distance of points from lines."""
    x, z = np.moveaxis(end - start, -1, 0)
    dx, dz = np.moveaxis(point - start, -1, 0)
    length = np.hypot(x, z)
    return np.asarray(np.abs(x * dz - z * dx) / np.where(length > 0.0, length, 1.0))
