"""Convex solids: the corners of one that stand for it, as few as are wanted."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.shapes.convex import Floats, convex_hull
from heelstrike.tolerances import ON_A_LINE

FINE = 2e-4
"""Distance (m) of a corner from the solid of those that stand for it, up to which they suffice."""


def hull_corners(points: Floats) -> Floats:
    """Corners (k, 3) of the least convex solid around points (n, 3), also of a flat one."""
    center = points.mean(axis=0)
    _, size, along = np.linalg.svd(points - center, full_matrices=False)
    rank = int(np.count_nonzero(size > ON_A_LINE))
    if len(points) < 4 or rank < 3:
        within = (points - center) @ along.T
        if rank < 2:
            return points[np.unique([np.argmin(within[:, 0]), np.argmax(within[:, 0])])]
        flat = convex_hull(within[:, :2])
        return np.asarray(center + flat @ along[:2], dtype=np.float64)
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).vertices], dtype=np.float64)


def few_corners(points: Floats, most: int) -> tuple[Floats, float]:
    """Corners (k, 3) of the hull of points that stand for it, and how far it reaches beyond them.

    The extremes along the axes come first, then always the corner that is furthest outside the
    solid of those that are there, until that is little or they are as many as may be.
    """
    corners = hull_corners(points)
    if len(corners) <= 6 or most < 6:
        return corners, 0.0
    chosen = list(
        dict.fromkeys([*corners.argmin(axis=0).tolist(), *corners.argmax(axis=0).tolist()])
    )
    while True:
        beyond = _outside(corners, corners[chosen])
        furthest = int(np.argmax(beyond))
        if beyond[furthest] <= FINE or len(chosen) >= min(most, len(corners)):
            break
        chosen.append(furthest)
    if len(chosen) == len(corners):
        return corners, 0.0
    worst = np.argsort(beyond)[-WORST:]
    return corners[sorted(chosen)], max(_distance(corners[i], corners[chosen]) for i in worst)


WORST = 400
"""Corners whose distance is looked at: those that are furthest beyond one face."""


def _outside(points: Floats, solid: Floats) -> Floats:
    """How far points are beyond the face of a solid that is furthest from them; 0 within it."""
    from scipy.spatial import ConvexHull

    center = solid.mean(axis=0)
    _, size, along = np.linalg.svd(solid - center)
    rank = int(np.count_nonzero(size > ON_A_LINE))
    away, within = points - center, solid - center
    if rank < 3:
        aside = np.linalg.norm(away - away @ along[:rank].T @ along[:rank], axis=1)
        if aside.max() > ON_A_LINE:
            return np.asarray(aside)
        away, within = away @ along[:rank].T, within @ along[:rank].T
    if rank < 2:
        low, high = within.min(axis=0), within.max(axis=0)
        return np.maximum(np.maximum(low - away, away - high), 0.0).sum(axis=1)
    faces = ConvexHull(within).equations
    return np.maximum(0.0, (away @ faces[:, :-1].T + faces[:, -1]).max(axis=1))


def _distance(point: Floats, solid: Floats) -> float:
    """Distance of a point from the convex solid of some corners."""
    from scipy.optimize import nnls

    away = solid - point
    size = float(np.abs(away).max())
    # The nearest point is a mean of corners whose weights are positive and add up to one.
    weight = 1e4 * size
    system = np.vstack((away.T, np.full(len(solid), weight)))
    shares, _ = nnls(system, np.array([0.0, 0.0, 0.0, weight]))
    return float(np.linalg.norm(shares @ away / shares.sum()))
