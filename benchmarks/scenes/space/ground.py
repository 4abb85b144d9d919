"""Distances to a plane and to boxes in space, in plain numpy, over all rows of a record at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

ON_IT, FARTHER_DOWN, PIECES = 1e-9, 1e-3, 100
"""A block stands on what its bottom is in, to so much (m); it goes on so far (m) at most, and is
looked at in so many pieces of that."""


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

    def lengthened(self, more: float) -> Block:
        """Return it so much (m) longer at the lower end of its most upright axis."""
        upright = int(np.abs(self.axes[:, 2]).argmax())
        down = -np.sign(self.axes[upright, 2]) * self.axes[upright]
        half = self.half.copy()
        half[upright] += 0.5 * more
        return replace(self, center=self.center + 0.5 * more * down, half=half)

    def bottom(self) -> Array:
        """Corners (4, 3) of the lower end of its most upright axis."""
        upright = int(np.abs(self.axes[:, 2]).argmax())
        signs = np.array([(i, j) for i in (-1.0, 1.0) for j in (-1.0, 1.0)])
        own = np.insert(signs, upright, -np.sign(self.axes[upright, 2]), axis=1)
        return self.center + (own * self.half) @ self.axes


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

    def grown_together(self) -> Terrain:
        """Return it with blocks that go on below where they stand on the plane or in another.

        What is in the floor, under a block, does not come out downwards: only sideways.
        """
        alone = Terrain(self.normal, self.height)

        def is_within(block: Block, points: Array) -> bool:
            others = [alone.distances(points)[0][0]]
            others += [other.distance(points)[0] for other in self.blocks if other is not block]
            return any(bool(np.all(gaps <= ON_IT)) for gaps in others)

        blocks = []
        for block in self.blocks:
            stands = block
            for piece in range(PIECES + 1):
                longer = block.lengthened(FARTHER_DOWN * piece / PIECES)
                if not is_within(block, longer.bottom()):
                    break
                stands = longer
            blocks.append(stands)
        return Terrain(self.normal, self.height, tuple(blocks))

    def distances(self, point: Array) -> tuple[Array, Array]:
        """Distances (f, ...) of points (..., 3) to the plane and each box, and the ways away."""
        flat = (point - [0.0, 0.0, self.height]) @ self.normal
        found = [(flat, np.broadcast_to(self.normal, point.shape))]
        found += [block.distance(point) for block in self.blocks]
        return np.stack([gap for gap, _ in found]), np.stack([away for _, away in found])
