"""A camera in space: from world places to places of a picture."""

from __future__ import annotations

import math

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

AZIMUTH, ELEVATION = -0.95, 0.24
"""Where a camera stands by default: to the robot's right and ahead of it, a little above, in rad.
The azimuth is that of the camera as seen from the robot, from x towards y."""

FAR_AWAY = 4.5
"""Distance of the camera from what it looks at, in sizes of the robot."""

NEAREST = 0.05
"""Share of that distance within which nothing is drawn."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera that looks at a place.

    A picture has x to the right and y upwards, in metres at the distance of that place.
    """

    target: Floats
    """(3,) Where it looks, in m."""
    distance: float
    """How far from there it is, in m."""
    azimuth: float = AZIMUTH
    elevation: float = ELEVATION
    """azimuth, elevation: In which direction, in rad: from x towards y, and above the ground."""

    @property
    def axes(self) -> Floats:
        """(3, 3) Rows: to the right of the picture, up in it, and towards the camera."""
        ca, sa = math.cos(self.azimuth), math.sin(self.azimuth)
        ce, se = math.cos(self.elevation), math.sin(self.elevation)
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])

    def seen(self, places: Floats) -> tuple[Floats, Floats]:
        """Return places (..., 2) in the picture, and how near they are to the camera.

        Parameters
        ----------
        places : (..., 3) float
            In the world, in m.

        Returns
        -------
        tuple
            (..., 2) In the picture, in m; (...,) distances towards the camera from what it looks
            at, in m.
        """
        turned = (places - self.target) @ self.axes.T
        near = turned[..., 2]
        left = np.maximum(self.distance - near, NEAREST * self.distance)
        return turned[..., :2] * (self.distance / left)[..., None], near

    @property
    def place(self) -> Floats:
        """(3,) Where the camera is, in m."""
        return np.asarray(self.target + self.distance * self.axes[2])
