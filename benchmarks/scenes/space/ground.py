"""Distances to a plane and to boxes in space, in plain numpy, over all rows of a record at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True)
class Block:
    """A box by its middle, its axes in rows, and half its lengths along them."""

    center: Array
    axes: Array
    half: Array

    def distance(self, point: Array) -> tuple[Array, Array]:
        """Signed distance (...) of points (..., 3), and the direction away (..., 3)."""
        own = (point - self.center) @ self.axes.T
        beyond = np.abs(own) - self.half
        outside = np.maximum(beyond, 0.0)
        far = np.linalg.norm(outside, axis=-1)
        deepest = beyond.max(axis=-1)
        signed = np.where(own < 0.0, -1.0, 1.0)
        nearest = np.zeros_like(own)
        np.put_along_axis(nearest, beyond.argmax(axis=-1)[..., None], 1.0, axis=-1)
        away = np.where(
            (far > 0.0)[..., None], outside / np.where(far > 0.0, far, 1.0)[..., None], nearest
        )
        return np.where(far > 0.0, far, deepest), (away * signed) @ self.axes


class Terrain:
    """A plane, and boxes on it.

    Parameters
    ----------
    normal : (3,) float
        Upward normal of the plane, of any length.
    height : float
        Where the plane meets the z axis (m).
    blocks : sequence of Block
        The boxes.
    """

    def __init__(self, normal: Array, height: float, blocks: tuple[Block, ...] = ()) -> None:
        self.normal = np.asarray(normal) / np.linalg.norm(normal)
        self.height, self.blocks = height, blocks

    def distances(self, point: Array) -> tuple[Array, Array]:
        """Distances (f, ...) of points (..., 3) to the plane and each box, and the ways away."""
        flat = (point - [0.0, 0.0, self.height]) @ self.normal
        found = [(flat, np.broadcast_to(self.normal, point.shape))]
        found += [block.distance(point) for block in self.blocks]
        return np.stack([gap for gap, _ in found]), np.stack([away for _, away in found])
