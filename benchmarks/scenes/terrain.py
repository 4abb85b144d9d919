"""Distance from points to a rigid polyline, written a second time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

TIE = 1e-9
"""Features whose distances differ by less (m) are equally near."""


class Terrain:
    """A polyline that goes on forever at both ends.

    Parameters
    ----------
    corner : (s + 1, 2) float
        Corners from left to right (m).
    friction, restitution : (s,) float
        Coefficients of its segments.
    """

    def __init__(self, corner: Array, friction: Array, restitution: Array) -> None:
        self.corner = np.asarray(corner, dtype=float)
        self.friction = np.asarray(friction, dtype=float)
        self.restitution = np.asarray(restitution, dtype=float)
        along = np.diff(self.corner, axis=0)
        self.length = np.hypot(along[:, 0], along[:, 1])
        self.tangent = along / self.length[:, None]
        self.normal = np.stack((-self.tangent[:, 1], self.tangent[:, 0]), axis=1)

    def height(self, x: Array) -> Array:
        """Height at x; at a vertical step, that of its right side."""
        left = np.searchsorted(self.corner[:, 0], x, side="right") - 1
        left = np.clip(left, 0, len(self.length) - 1)
        run = self.tangent[left, 0]
        rise = np.divide(self.tangent[left, 1], run, where=run > 0, out=np.zeros_like(run))
        return self.corner[left, 1] + rise * (x - self.corner[left, 0])

    def _feet(self, point: Array) -> tuple[Array, Array, Array]:
        """Distances (..., s) to the segments, nearest points, and whether these are corners."""
        away = point[..., None, :] - self.corner[:-1]
        along = np.einsum("...sc,sc->...s", away, self.tangent)
        low = np.zeros_like(self.length)
        high = self.length.copy()
        low[0], high[-1] = -np.inf, np.inf
        held = np.clip(along, low, high)
        foot = self.corner[:-1] + held[..., None] * self.tangent
        return np.linalg.norm(point[..., None, :] - foot, axis=-1), foot, held != along

    def to_corner(self, point: Array, *ahead: Array) -> Array:
        """How near points (T, n, 2) are to a second face of a concave corner.

        Infinite where there is none. Where they go from there may be told in `ahead`, of the same
        shape: what counts is how near they ever come to that face.
        """
        distance, _, _ = self._feet(point)
        beside = self._beside(point, distance)
        second = np.argmin(beside, axis=-1)[..., None]
        nearest = np.take_along_axis(beside, second, -1)[..., 0]
        for place in ahead:
            then = np.take_along_axis(self._feet(place)[0], second, -1)[..., 0]
            nearest = np.where(np.isfinite(nearest), np.minimum(nearest, then), np.inf)
        return nearest

    def faces(self, point: Array) -> list[int]:
        """Segment nearest to a point (2,), and one that makes a concave corner with it, if any."""
        distance, _, _ = self._feet(point)
        beside = self._beside(point, distance)
        nearest, second = int(np.argmin(distance)), int(np.argmin(beside))
        return [nearest, second] if np.isfinite(beside[second]) else [nearest]

    def _beside(self, point: Array, distance: Array) -> Array:
        """Distances (..., s) to what makes a concave corner with the nearest segment, or infinity.

        Its neighbours do where the ground turns upwards between them, others if they face it. To
        the line through a neighbour that a point is below, it is negative.
        """
        nearest = np.argmin(distance, axis=-1)
        place = np.arange(len(self.length))
        away = place - nearest[..., None]
        own = self.normal[nearest]
        turn = own[..., None, 0] * self.normal[:, 1] - own[..., None, 1] * self.normal[:, 0]
        height = np.einsum("...sc,sc->...s", point[..., None, :] - self.corner[:-1], self.normal)
        joined = np.abs(away) == 1
        faces = np.where(joined, turn * away > 1e-9, height >= 0.0) & (away != 0)
        distance = np.where(joined & (height < 0.0), height, distance)
        return np.where(faces, distance, np.inf)

    def measure(self, point: Array) -> Measurement:
        """Measure points (..., 2)."""
        distance, foot, on_corner = self._feet(point)
        nearest = np.argmin(distance, axis=-1)
        shortest = np.take_along_axis(distance, nearest[..., None], -1)[..., 0]
        outside = point[..., 1] >= self.height(point[..., 0])
        tied = distance <= shortest[..., None] + TIE
        signed = np.where(outside, shortest, -shortest)
        away = point[..., None, :] - self.corner[:-1]
        height = np.einsum("...sc,sc->...s", away, self.normal)
        deepest = np.where(tied, height, np.inf).min(axis=-1)
        wedged = ~outside & self._concave(tied) & np.all(on_corner | ~tied, axis=-1)
        signed = np.where(wedged, deepest, signed)
        return Measurement(self, point, signed, tied, foot, on_corner, wedged)

    def _concave(self, tied: Array) -> Array:
        """Whether two neighbours among some segments (..., s) make a concave corner."""
        first, second = self.normal[:-1], self.normal[1:]
        turns = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] > 1e-9
        return np.any(tied[..., :-1] & tied[..., 1:] & turns, axis=-1)


class Measurement:
    """What is nearest to some points.

    Attributes
    ----------
    distance : (...,) float
        Signed distance (m), negative in the ground. Under both faces of a concave corner it is
        that to the one that the place is deeper under.
    tied : (..., s) bool
        The segments that are nearest.
    lowest_friction, highest_friction, restitution : (...,) float
        Coefficients there; two segments that share a corner may differ in friction.
    """

    def __init__(
        self,
        terrain: Terrain,
        point: Array,
        distance: Array,
        tied: Array,
        foot: Array,
        on_corner: Array,
        wedged: Array,
    ) -> None:
        self.terrain, self.point, self.distance = terrain, point, distance
        self.tied, self._foot, self._wedged = tied, foot, wedged
        self.lowest_friction = np.where(tied, terrain.friction, np.inf).min(axis=-1)
        self.highest_friction = np.where(tied, terrain.friction, -np.inf).max(axis=-1)
        self.restitution = np.where(tied, terrain.restitution, -np.inf).max(axis=-1)
        self.at_corner = np.all(on_corner | ~tied, axis=-1)

    def disagreement(self, normal: Array) -> Array:
        """How far given normals (..., 2) are from any that the nearest features allow.

        Off the ground the way along the normal has to end at a nearest point; on it (and at every
        segment) a normal of a nearest segment will do, and at a convex corner one between two.
        """
        terrain = self.terrain
        unit = np.abs(np.linalg.norm(normal, axis=-1) - 1.0)
        to_foot = self.point[..., None, :] - self.distance[..., None, None] * normal[..., None, :]
        miss = np.linalg.norm(to_foot - self._foot, axis=-1)
        far = (np.abs(self.distance) > 1e-6)[..., None] & ~self._wedged[..., None]
        turn = np.linalg.norm(normal[..., None, :] - terrain.normal, axis=-1)
        wrong = np.where(far, miss / np.maximum(np.abs(self.distance)[..., None], 1e-6), turn)
        best = np.where(self.tied, wrong, np.inf).min(axis=-1)
        # Between the normals of two segments that meet here.
        cross = (
            normal[..., None, 0] * terrain.normal[:, 1]
            - normal[..., None, 1] * (terrain.normal[:, 0])
        )
        behind = np.where(self.tied, cross, -np.inf).max(axis=-1) >= -1e-9
        ahead = np.where(self.tied, cross, np.inf).min(axis=-1) <= 1e-9
        between = behind & ahead & ~far[..., 0] & (self.tied.sum(axis=-1) > 1)
        return np.maximum(np.where(between, 0.0, best), unit)
