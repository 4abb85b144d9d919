"""A robot in space on its ground, drawn on the axes of a figure from where a camera stands.

What is far is drawn first. Triangles have the brightness that a sun gives them; their shadows lie
on the plane of the ground.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon

from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.view.arrows import Arrows
from heelstrike.view.spatial.body import body_in_space
from heelstrike.view.spatial.camera import Camera
from heelstrike.view.style import ORANGE, ZERO_MOMENT_POINT_COLOR, foot_color

SOIL, LINE, SHADOW, STONE = "#EFEFEB", "#D5D5CF", "#D6D6D0", "#C9C9C2"
TRUNK = "#5B646B"
"""Colours of the ground, its grid, shadows, boxes, and of the robot's trunk."""

SUN = np.array([-0.35, -0.25, 0.9]) / np.linalg.norm([-0.35, -0.25, 0.9])
"""Where the light comes from."""

DARKEST = 0.55
"""Brightness of what faces away from the sun."""

WIDE = 3.0
"""Radius of the ground that is drawn, in sizes of the robot."""

BOX_CORNERS = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij")).reshape(3, -1).T
BOX_SIDES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)


def corners_of_boxes(ground: SpatialGround) -> Floats:
    """Corners (boxes, 8, 3) of the boxes of a ground, as they were given (m)."""
    axes = ground.model().rotation.reshape(-1, 3, 3)
    center, size = (
        np.array([getattr(box, name) for box in ground.boxes], dtype=np.float64).reshape(-1, 3)
        for name in ("center", "size")
    )
    corners: Floats = center[:, None] + (0.5 * size[:, None] * BOX_CORNERS) @ axes
    return corners


@dataclass(frozen=True, eq=False)
class Instant:
    """What is drawn of one instant, in world axes; NaN and empty arrays for what there is not."""

    corners: Floats
    """(m, 3) Corners of the robot's body, in m."""
    place: Floats
    force: Floats
    """place, force: (ng, 3) Where contact forces act (m), and the forces on the robot (N)."""
    center: Floats
    """(3,) Centre of mass, in m."""
    pressure: Floats
    """(3,) Zero moment point, in m."""
    support: Floats
    """(k, 3) Corners of the support polygon, in m."""


def grid_spacing(size: float) -> float:
    """Distance (m) of the lines of the ground: a round number, above 0.3 times a robot's size."""
    spread = 10.0 ** np.floor(np.log10(size))
    return float(next(n * spread for n in (0.5, 1.0, 2.0, 5.0) if n * spread > 0.3 * size))


class Stage:
    """What shows a robot on axes whose units are those of a camera's picture.

    Parameters
    ----------
    axes : Axes
        Where.
    robot : SpatialRobot
        The robot.
    ground : SpatialGround
        What it stands on.
    width : float
        Width of lines, in points.
    """

    def __init__(
        self, axes: Axes, robot: SpatialRobot, ground: SpatialGround, *, width: float = 1.0
    ) -> None:
        self.body = body_in_space(robot)
        colors = [TRUNK if foot < 0 else foot_color(int(foot)) for foot in self.body.foot]
        self._colors = np.array([to_rgb(color) for color in colors]).reshape(-1, 3)
        self._normal = np.asarray(ground.normal, dtype=np.float64)
        self._normal = self._normal / np.linalg.norm(self._normal)
        self._height = float(ground.height)
        self._boxes = corners_of_boxes(ground)[:, BOX_SIDES]
        size = self.body.size
        self._spacing = grid_spacing(size)
        self._soil = Polygon(np.zeros((1, 2)), closed=True, facecolor=SOIL, edgecolor="none")
        axes.add_patch(self._soil)
        self._grid = LineCollection([], colors=LINE, linewidths=width)
        self._shadow = PolyCollection([], facecolors=SHADOW, edgecolors=SHADOW, linewidths=0.3)
        self._stones = PolyCollection([], edgecolors="white", linewidths=0.5 * width)
        self._support = PolyCollection(
            [], facecolors=ZERO_MOMENT_POINT_COLOR, edgecolors=ZERO_MOMENT_POINT_COLOR, alpha=0.35,
            linewidths=1.5 * width,
        )  # fmt: skip
        self._faces = PolyCollection([], linewidths=0.4 * width)
        self._plumb = LineCollection([], colors=ORANGE, linewidths=width, linestyles="dotted")
        for each in (
            self._grid,
            self._shadow,
            self._stones,
            self._support,
            self._faces,
            self._plumb,
        ):
            axes.add_collection(each, autolim=False)
        self._arrows = Arrows(axes, size, robot.weight, width=2.5 * width)
        look: dict[str, Any] = {"mec": "white", "linestyle": ""}
        (self._pressure,) = axes.plot(
            [], [], marker="D", color=ZERO_MOMENT_POINT_COLOR, ms=8.0 * width, **look
        )
        (self._center,) = axes.plot([], [], marker="o", color=ORANGE, ms=7.0 * width, **look)
        self.artists: list[Artist] = [
            self._soil, self._grid, self._shadow, self._stones, self._support, self._faces,
            self._plumb, self._arrows.shafts, self._arrows.heads, self._center, self._pressure,
        ]  # fmt: skip
        for order, artist in enumerate(self.artists):
            artist.set_zorder(2.0 + 0.1 * order)

    def below(self, place: Floats) -> Floats:
        """Return what is below some places (..., 3) on the plane of the ground, in m."""
        found = place.copy()
        slope = (place[..., :2] @ self._normal[:2]) / self._normal[2]
        found[..., 2] = self._height - slope
        return found

    def show(self, instant: Instant, camera: Camera) -> None:
        """Let the axes show an instant as a camera sees it."""
        self._show_ground(camera)
        self._show_boxes(camera)
        self._show_faces(instant.corners, camera)
        support = instant.support if len(instant.support) > 1 else np.zeros((0, 3))
        flat, _ = camera.seen(support)
        self._support.set_verts([flat] if len(flat) else [])
        place, _ = camera.seen(instant.place)
        self._arrows.show(place, instant.force @ camera.axes[:2].T)
        for marker, where in ((self._pressure, instant.pressure), (self._center, instant.center)):
            x, y = camera.seen(where)[0].tolist()
            marker.set_data([x], [y])
        ends = np.stack((instant.center, self.below(instant.center)))
        self._plumb.set_segments([camera.seen(ends)[0]] if np.all(np.isfinite(ends)) else [])

    def _show_ground(self, camera: Camera) -> None:
        """Draw a disc of ground about what the camera looks at, and its grid."""
        middle = camera.target
        radius = WIDE * self.body.size
        turn = np.linspace(0.0, 2.0 * np.pi, 73)
        rim = middle + radius * np.stack((np.cos(turn), np.sin(turn), 0.0 * turn), axis=1)
        self._soil.set_xy(camera.seen(self.below(rim))[0])
        lines = []
        for axis in range(2):
            first = np.ceil((middle[axis] - radius) / self._spacing)
            along = self._spacing * np.arange(first, (middle[axis] + radius) / self._spacing)
            half = np.sqrt(np.maximum(radius**2 - (along - middle[axis]) ** 2, 0.0))
            ends = np.zeros((len(along), 2, 3))
            ends[..., axis] = along[:, None]
            ends[..., 1 - axis] = middle[1 - axis] + half[:, None] * [-1.0, 1.0]
            lines += list(camera.seen(self.below(ends))[0])
        self._grid.set_segments(lines)

    def _show_boxes(self, camera: Camera) -> None:
        sides = self._boxes.reshape(-1, 4, 3)
        if not len(sides):
            return
        near = (
            np.linalg.norm(sides.mean(axis=1) - camera.target, axis=1) < 2.0 * WIDE * self.body.size
        )
        sides = sides[near]
        across = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
        seen = np.einsum("ni,ni->n", across, camera.place - sides[:, 0]) > 0.0
        sides, across = sides[seen], across[seen]
        away = np.linalg.norm(sides.mean(axis=1) - camera.place, axis=1)
        order = np.argsort(-away)
        colors = _lit(np.tile(to_rgb(STONE), (len(sides), 1)), across)
        self._stones.set_verts(list(camera.seen(sides[order])[0]))
        self._stones.set_facecolor(_as_colors(colors[order]))

    def _show_faces(self, corners: Floats, camera: Camera) -> None:
        """Draw the triangles that face the camera, far ones first, and the shadows of all."""
        triangles = corners[self.body.faces]
        across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        sunny = across @ SUN > 0.0
        over = triangles[sunny] @ self._normal - self._height * self._normal[2]
        shadow = triangles[sunny] - over[..., None] / (SUN @ self._normal) * SUN
        self._shadow.set_verts(list(camera.seen(shadow)[0]))
        place = camera.place
        seen = np.einsum("ni,ni->n", across, place - triangles[:, 0]) > 0.0
        away = np.linalg.norm(triangles[seen].mean(axis=1) - place, axis=1)
        order = np.argsort(-away)
        colors = _lit(self._colors[seen], across[seen])[order]
        self._faces.set_verts(list(camera.seen(triangles[seen][order])[0]))
        self._faces.set_facecolor(_as_colors(colors))
        self._faces.set_edgecolor(_as_colors(colors))


def _as_colors(colors: Floats) -> Any:
    """Colours as matplotlib takes them, whose types know no arrays."""
    return colors


def _lit(colors: Floats, across: Floats) -> Floats:
    """Colours (n, 3) of faces whose normals are (n, 3), in the light of the sun."""
    length = np.linalg.norm(across, axis=1, keepdims=True)
    facing = (across / np.where(length > 0.0, length, 1.0)) @ SUN
    bright = DARKEST + (1.0 - DARKEST) * 0.5 * (1.0 + facing)
    lit = np.clip(colors * bright[:, None] * 1.15, 0.0, 1.0)
    return np.asarray(lit)
