"""Outlines of a robot from the shapes of its file: those to be seen, or else those that collide."""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import product
from typing import TypeVar

import numpy as np

from heelstrike.robot.files.links import Links
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.model import Integers
from heelstrike.robot.shapes.convex import Floats, circle, convex_hull, with_fewer_corners
from heelstrike.robot.shapes.outlines import Outline, without_hidden
from heelstrike.robot.warning import warn

SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(2, 8)  # MuJoCo's mjtGeom

PREFIX = "outline"
"""Outlines that were saved are custom data ``outline:NUMBER:JOINT``: radius, then x and z of each
corner in the frame of the link that the joint moves."""
COUNT = "outlines"
"""The custom number of them, which is zero for a robot that has none."""

MOST_SHAPES = 200
"""Bodies of more shapes than this are drawn as bones."""

Shape = TypeVar("Shape")

FARTHEST = 1e6
"""Metres within which a shape is drawn."""

AROUND = 24
"""Corners round what is round, in the plane."""

BOX_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
"""(8, 3) Corners of a box whose edges are two metres long."""


def read_outlines(file: MujocoFile, links: Links) -> tuple[Outline, ...]:
    """Return the outlines of a robot's links, seen in the plane.

    Those that were saved with it; else of every body of the file the shapes that do not collide,
    which are there to be seen, or the others if there are none.
    """
    saved = _saved(file)
    if saved is not None:
        return saved

    def outline(geom: int, link: int) -> Outline | None:
        shape = _drawable(file, geom, links.origin[link])
        return None if shape is None else Outline(link, *shape)

    return without_hidden(shapes_to_see(file, links.of_body, outline, without_hidden))


def shapes_to_see(
    file: MujocoFile, of_body: Integers, shape_of: Callable[[int, int], Shape | None],
    seen: Callable[[list[Shape]], Collection[Shape]],
) -> list[Shape]:  # fmt: skip
    """Return what bodies look like: of each the shapes that do not collide, or else the others.

    Parameters
    ----------
    file : MujocoFile
        The file.
    of_body : (bodies,) int
        Link of each body, -1 for none.
    shape_of : callable
        Takes a geom and its link, returns the shape, None if it has none.
    seen : callable
        Takes the shapes of a body, returns those that are seen of them.
    """
    model = file.model
    idle = (model.geom_contype | model.geom_conaffinity) == 0
    found: list[Shape] = []
    for body in range(1, model.nbody):
        link = int(of_body[body])
        geoms = np.flatnonzero(np.asarray(model.geom_bodyid) == body)
        if link < 0 or len(geoms) > MOST_SHAPES:
            continue
        for only_seen in (True, False):
            shapes = [shape_of(int(geom), link) for geom in geoms if idle[geom] == only_seen]
            there = [shape for shape in shapes if shape is not None]
            if seen(there):
                found += there
                break
    return found


def _drawable(file: MujocoFile, geom: int, origin: Floats) -> tuple[Floats, float] | None:
    """Shape of a geom, None of one that is too large for numbers, too."""
    with np.errstate(all="ignore"):
        try:
            shape = _shape(file, geom, origin)
        except np.linalg.LinAlgError:
            return None
    if shape is None or not (np.all(np.abs(shape[0]) < FARTHEST) and shape[1] < FARTHEST):
        return None
    return shape


def _shape(file: MujocoFile, geom: int, origin: Floats) -> tuple[Floats, float] | None:
    """Corners in a link's frame and radius of a geom, None of one that has no outline."""
    model, pose = file.model, file.pose
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    turn = pose.geom_xmat[geom].reshape(3, 3)[::2]  # its axes in the plane, in columns
    middle = pose.geom_xpos[geom, ::2] - origin
    if kind == ELLIPSOID:
        axes = np.linalg.cholesky((turn * size**2) @ turn.T)  # of the ellipse that it casts
        return middle + circle(AROUND) @ axes.T, 0.0
    corners = geom_corners(file, geom, AROUND)
    if not len(corners):
        return None
    hull = convex_hull(middle + corners @ turn.T)
    return with_fewer_corners(hull) if kind == MESH else hull, ball_radius(file, geom)


def geom_corners(file: MujocoFile, geom: int, around: int) -> Floats:
    """Corners (k, 3) of the hull that a geom is, in its own frame; none where there are none.

    A sphere has one and a capsule has two, which balls of :func:`ball_radius` cover; a cylinder has
    `around` of them round each end.
    """
    kind, size = int(file.model.geom_type[geom]), np.asarray(file.model.geom_size[geom])
    ends = np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]])
    if kind == SPHERE:
        return np.zeros((1, 3))
    if kind == CAPSULE:
        return ends
    if kind == CYLINDER:
        rim = size[0] * np.column_stack((circle(around), np.zeros(around)))
        return (ends[:, None] + rim).reshape(-1, 3)
    if kind == BOX:
        return size * BOX_CORNERS
    return mesh_corners(file, geom) if kind == MESH else np.zeros((0, 3))


def ball_radius(file: MujocoFile, geom: int) -> float:
    """Radius of the balls about the corners of a geom, 0 of one that has none."""
    round_ = file.model.geom_type[geom] in (SPHERE, CAPSULE)
    return float(file.model.geom_size[geom, 0]) if round_ else 0.0


def mesh_corners(file: MujocoFile, geom: int) -> Floats:
    """Corners of a mesh, in the frame of its geom, (n, 3)."""
    model = file.model
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    return np.asarray(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], dtype=np.float64)


def _saved(file: MujocoFile) -> tuple[Outline, ...] | None:
    """Outlines that were saved with a robot, None if it was not saved by us.

    Raises
    ------
    RobotError
        If one has numbers that are impossible.
    """
    link = {one.name: index for index, one in enumerate(file.coordinates)}
    found = []
    for name, data in file.custom(PREFIX):
        joint = name.partition(":")[2]
        if joint not in link or len(data) < 3 or len(data) % 2 == 0:
            continue
        if not (np.all(np.isfinite(data)) and data[0] >= 0.0):
            raise file.error(f"the {PREFIX}:{name} must be a radius >= 0 and places of corners.")
        found.append(Outline(link[joint], data[1:].reshape(-1, 2), float(data[0])))
    for _, (count, *_) in file.custom(COUNT):
        if count != len(found):
            warn(f"{file.source}: {count:g} outlines were saved, of which {len(found)} are there.")
        return tuple(found)
    return None
