"""What a robot looks like from its right side: convex outlines fixed to its links."""

from __future__ import annotations

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.shapes.convex import Floats, circle, convex_hull
from heelstrike.tolerances import ON_A_LINE

ROUND = 16
"""Corners of a disc that is drawn."""


@dataclass(frozen=True, eq=False)
class Outline:
    """A convex shape on a link, seen in the plane: a polygon, or what a disc covers within one."""

    link: int
    """The link that it is fixed to."""
    corners: Floats
    """(k, 2) Corners (x, z) of the polygon in the frame of the link, in m; one for a disc, two for
    a capsule."""
    radius: float
    """Radius of the disc, in m; 0 for the polygon itself."""

    def rim(self) -> Floats:
        """Corners (m, 2) of a polygon around all of it, in the frame of the link (m)."""
        if self.radius == 0.0:
            return self.corners
        disc = self.radius * circle(ROUND)
        return convex_hull((self.corners[:, None] + disc).reshape(-1, 2))


def without_hidden(outlines: list[Outline]) -> tuple[Outline, ...]:
    """Leave out outlines that are points, or within another one of the same link."""
    rims = [each.rim() for each in outlines]
    kept: list[int] = []
    for i in sorted(range(len(rims)), key=lambda i: -float(np.ptp(rims[i], axis=0).max())):
        larger = [rims[k] for k in kept if outlines[k].link == outlines[i].link]
        size = np.ptp(rims[i], axis=0).max()
        if size > ON_A_LINE and not any(_inside(rims[i], rim) for rim in larger):
            kept.append(i)
    return tuple(outlines[i] for i in sorted(kept))


def _inside(points: Floats, polygon: Floats) -> bool:
    """Whether all points lie in a convex polygon whose corners go from +x towards +z."""
    if len(polygon) < 3:
        return False
    edge = np.roll(polygon, -1, axis=0) - polygon
    away = points[:, None] - polygon
    return bool(np.all(edge[:, 0] * away[..., 1] - edge[:, 1] * away[..., 0] >= -ON_A_LINE))
