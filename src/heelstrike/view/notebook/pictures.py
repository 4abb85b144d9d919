"""Small pictures for notebooks, written as SVG from numbers alone: no name is in them."""

from __future__ import annotations

import base64
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.dynamics import link_poses
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.view.drawing import Skeleton, body, extent
from heelstrike.view.style import FOOT_COLORS, GREY, INK, PALE

WIDTH, HEIGHT = 420.0, 190.0
"""Largest picture, in pixels."""
EDGE = 10.0
POINTS = 200
"""Corners of a ground and points of a curve that are drawn."""


def picture(shapes: Sequence[str], width: float, height: float, alt: str) -> str:
    """Image that holds an SVG drawing.

    Parameters
    ----------
    shapes : sequence of str
        Elements of the drawing, with y downwards, in pixels.
    width, height : float
        In pixels.
    alt : str
        What is to be seen, as plain words without names.
    """
    drawing = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}"><rect width="100%" height="100%" fill="#fff"/>'
        f"{''.join(shapes)}</svg>"
    )
    text = base64.b64encode(drawing.encode()).decode("ascii")
    return (
        f'<img alt="{alt}" width="{width:.0f}" height="{height:.0f}" '
        f'style="max-width:100%;height:auto" src="data:image/svg+xml;base64,{text}">'
    )


def poses_picture(robot: Robot, positions: Floats, ground: Ground, alt: str) -> str:
    """Draw a robot in some configurations (n, nq), at their places, on its ground."""
    shape = body(robot)
    placed = [link_poses(robot, q) for q in positions]
    segments = np.array([shape.segments(each.origin, each.angle) for each in placed])
    segments = np.nan_to_num(segments)
    low, high = extent(segments)
    size = max(float((high - low).max()), 1e-3)
    surface = ground.outline(float(low[0]) - 0.2 * size, float(high[0]) + 0.2 * size)
    box = np.array([low, high, *surface])
    room = np.array([0.0, 0.05 * size])
    view = _View(box.min(axis=0) - room, box.max(axis=0) + room)
    shapes = [view.soil(surface)]
    for k, pose in enumerate(segments):
        faint = 1.0 if k == len(segments) - 1 else 0.35
        shapes += _body(shape, pose, view, faint)
    return picture(shapes, view.width, view.height, alt)


FLATTEST = 0.1
"""Least height of a profile as a share of its length: what is flatter is drawn higher."""


def ground_picture(ground: Ground) -> tuple[str, float]:
    """Draw the profile of a ground; tell by what factor its heights are drawn larger."""
    corners = ground.model().vertices
    left, right = float(corners[0, 0]), float(corners[-1, 0])
    if ground.profile is None:  # a smooth shape is drawn where robots begin
        left, right = -1.0, 1.0
    surface = ground.outline(left, right)
    surface = surface[:: max(1, len(surface) // POINTS)]
    low, high = surface.min(axis=0), surface.max(axis=0)
    length, height = (high - low).tolist()
    factor = max(1.0, FLATTEST * length / height) if height > 0.0 else 1.0
    stretch = np.array([1.0, factor])
    room = np.array([0.0, 0.1 * length])
    view = _View(stretch * low - room, stretch * high + room)
    soil = view.soil(stretch * surface)
    return picture([soil], view.width, view.height, "profile of the ground"), factor


def curves_picture(time: Floats, values: Floats, alt: str) -> str:
    """Draw curves (n, k) over time (n,), each to the same scale."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    scale = (HEIGHT - 2.0 * EDGE) / max(high - low, 1e-12)
    x = EDGE + (WIDTH - 2.0 * EDGE) * (time - time[0]) / max(float(np.ptp(time)), 1e-12)
    zero = HEIGHT - EDGE - scale * (0.0 - low)
    shapes = [_line([(0.0, zero), (WIDTH, zero)], GREY, 0.6)] if low < 0.0 < high else []
    for k, column in enumerate(values.T):
        y = HEIGHT - EDGE - scale * (column - low)
        dash = "" if k < len(FOOT_COLORS) else ' stroke-dasharray="5 3"'
        corners = list(zip(x.tolist(), y.tolist(), strict=True))
        shapes.append(_line(corners, FOOT_COLORS[k % len(FOOT_COLORS)], 1.8, dash))
    return picture(shapes, WIDTH, HEIGHT, alt)


def multipliers_picture(multipliers: NDArray[np.complex128]) -> str:
    """Draw Floquet multipliers in the complex plane, with the unit circle."""
    reach = max(1.2, 1.1 * float(np.abs(multipliers).max(initial=0.0)))
    scale = 0.5 * HEIGHT / reach
    middle = 0.5 * HEIGHT
    shapes = [
        f'<circle cx="{middle:.1f}" cy="{middle:.1f}" r="{scale:.2f}" fill="{PALE}" '
        f'stroke="{INK}" stroke-dasharray="5 3"/>',
        _line([(0.0, middle), (HEIGHT, middle)], GREY, 0.6),
        _line([(middle, 0.0), (middle, HEIGHT)], GREY, 0.6),
    ]
    for each in multipliers.tolist():
        x, y = middle + scale * each.real, middle - scale * each.imag
        color = FOOT_COLORS[0] if abs(each) < 1.0 else FOOT_COLORS[1]
        shapes.append(f'<circle cx="{x:.2f}" cy="{y:.2f}" r="4.5" fill="{color}"/>')
    return picture(shapes, HEIGHT, HEIGHT, "Floquet multipliers and the unit circle")


class _View:
    """From metres to pixels, both axes alike."""

    def __init__(self, low: Floats, high: Floats) -> None:
        span = np.maximum(high - low, 1e-6)
        self.scale = min((WIDTH - 2.0 * EDGE) / span[0], (HEIGHT - 2.0 * EDGE) / span[1])
        self.low = low
        self.width, self.height = (self.scale * span + 2.0 * EDGE).tolist()

    def pixels(self, points: Floats) -> list[tuple[float, float]]:
        x = EDGE + self.scale * (points[:, 0] - self.low[0])
        y = self.height - EDGE - self.scale * (points[:, 1] - self.low[1])
        return list(zip(x.tolist(), y.tolist(), strict=True))

    def soil(self, surface: Floats) -> str:
        top = self.pixels(surface)
        top = [(0.0, top[0][1]), *top, (self.width, top[-1][1])]
        corners = [*top, (self.width, self.height), (0.0, self.height)]
        return _area(corners, PALE, "none") + _line(top, GREY, 1.0)


def _body(shape: Skeleton, pose: Floats, view: _View, faint: float) -> list[str]:
    pieces = shape.pieces or tuple(slice(i, i + 1) for i in range(len(shape.link)))
    found = []
    for piece in pieces:
        color = shape.colors[piece.start]
        if piece.stop - piece.start == 1:
            width = max(1.5, 0.3 * float(shape.width[piece.start]))
            found.append(_line(view.pixels(pose[piece.start]), color, width))
        else:
            found.append(_area(view.pixels(pose[piece, 0]), color, "#fff"))
    return [f'<g opacity="{faint:g}">{"".join(found)}</g>']


def _corners(corners: Sequence[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)


def _line(corners: Sequence[tuple[float, float]], color: str, width: float, extra: str = "") -> str:
    return (
        f'<polyline points="{_corners(corners)}" fill="none" stroke="{color}" '
        f'stroke-width="{width:.1f}" stroke-linecap="round"{extra}/>'
    )


def _area(corners: Sequence[tuple[float, float]], color: str, rim: str) -> str:
    return (
        f'<polygon points="{_corners(corners)}" fill="{color}" stroke="{rim}" stroke-width="0.6"/>'
    )
