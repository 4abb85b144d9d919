"""Bars between shapes of a link that stand apart, so that what moves together hangs together.

Files draw a head that floats above its trunk, or give only shapes that collide, which end short of
the joints. Each link is drawn connected: its shapes and its joints, by the shortest bars.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from itertools import combinations

import numpy as np

from heelstrike.dynamics import link_poses
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.shapes.convex import nearest_points
from heelstrike.robot.shapes.outlines import Outline

THICKNESS = 0.25
"""Radius of a bar as a share of the narrow side of the slimmest shape that it leads to."""
THINNEST = 0.01
"""The least radius, as a share of the length of the longest."""


def bars(robot: Robot) -> tuple[Outline, ...]:
    """Bars, as outlines in the frames of the links, that connect what `Robot.outlines` are of."""
    reference = link_poses(robot, robot.model.reference).origin
    found = []
    for link in dict.fromkeys(outline.link for outline in robot.outlines):
        rims = [outline.rim() for outline in robot.outlines if outline.link == link]
        nodes = rims + [place[None] for place in _joints(robot, link, reference)]
        for a, b, start, end in shortest(nodes):
            shapes = [nodes[i] for i in (a, b) if i < len(rims)] or rims
            narrow, wide = np.transpose([_sides(shape) for shape in shapes])
            radius = max(THICKNESS * narrow.min(), THINNEST * wide.max())
            found.append(Outline(link, np.array([start, end]), float(radius)))
    return tuple(found)


def _joints(robot: Robot, link: int, reference: Floats) -> list[Floats]:
    """Hinges of a link: its own, those of the links that it carries, those of closed loops.

    The frame of a slide may be anywhere, so may that of a link that floats.
    """
    model = robot.model
    hinge = model.axis[:, 0] != 0.0
    parent = int(model.parent[link])
    floats = parent >= 0 and model.mass[: parent + 1].sum() == 0.0
    places = [np.zeros(2)] if hinge[link] and not floats else []
    carried = np.flatnonzero((model.parent == link) & hinge)
    places += [reference[child] - reference[link] for child in carried]
    places += list(model.loop_position[model.loop_link == link])
    return places


def shortest(nodes: list[Floats]) -> list[tuple[int, int, Floats, Floats]]:
    """Shortest bars that connect convex polygons: a tree, without what touches already.

    Two polygons are no nearer each other than the boxes round them, and only those that may be
    next are measured.
    """
    low, high = (np.array([end(node, axis=0) for node in nodes]) for end in (np.min, np.max))
    apart = np.maximum(low[:, None] - high, 0.0)
    least = np.hypot(*np.moveaxis(np.maximum(apart, apart.swapaxes(0, 1)), -1, 0))
    ways: list[tuple[float, int, int, tuple[Floats, Floats] | None]] = [
        (float(least[a, b]), a, b, None) for a, b in combinations(range(len(nodes)), 2)
    ]
    heapify(ways)
    group = list(range(len(nodes)))
    found = []
    while ways:
        length, a, b, ends = heappop(ways)
        if group[a] == group[b]:
            continue
        if ends is None:
            ends = nearest_points(nodes[a], nodes[b])
            heappush(ways, (float(np.hypot(*(ends[1] - ends[0]))), a, b, ends))
            continue
        group = [group[a] if each == group[b] else each for each in group]
        if length > 0.0:
            found.append((a, b, *ends))
    return found


def _sides(polygon: Floats) -> tuple[float, float]:
    """Narrow and wide side of a polygon, along its principal axes (m)."""
    middle = polygon - polygon.mean(axis=0)
    extents = np.ptp(middle @ np.linalg.svd(middle, full_matrices=False)[2].T, axis=0)
    return float(extents.min()), float(extents.max())
