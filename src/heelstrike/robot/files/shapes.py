"""Outlines of a robot from the shapes of its file: those to be seen, or else those that collide."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TypeVar

import numpy as np

from heelstrike.robot.files.links import Links
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.model import Integers
from heelstrike.robot.shapes.convex import Floats, convex_hull, with_fewer_corners
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

TURN = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
CIRCLE = np.column_stack((np.cos(TURN), np.sin(TURN)))


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
    if kind == SPHERE:
        return middle[None], float(size[0])
    if kind == CAPSULE:
        return convex_hull(middle + np.outer((-size[1], size[1]), turn[:, 2])), float(size[0])
    if kind == ELLIPSOID:
        axes = np.linalg.cholesky((turn * size**2) @ turn.T)  # of the ellipse that it casts
        return middle + CIRCLE @ axes.T, 0.0
    if kind == CYLINDER:
        rim = size[0] * CIRCLE @ turn[:, :2].T
        ends = np.outer((-size[1], size[1]), turn[:, 2])
        return convex_hull(middle + (rim + ends[:, None]).reshape(-1, 2)), 0.0
    if kind == BOX:
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        return convex_hull(middle + (signs * size) @ turn.T), 0.0
    if kind == MESH:
        return with_fewer_corners(convex_hull(middle + mesh_corners(file, geom) @ turn.T)), 0.0
    return None


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
    model = file.model
    link = {one.name: index for index, one in enumerate(file.coordinates)}
    count = None
    found = []
    for numeric in range(model.nnumeric):
        held, _, name = file.given_name("numeric", numeric).partition(":")
        joint = name.partition(":")[2]
        first, size = int(model.numeric_adr[numeric]), int(model.numeric_size[numeric])
        data = np.array(model.numeric_data[first : first + size])
        if held == COUNT:
            count = data[0]
        elif held == PREFIX and joint in link and size % 2 and size > 1:
            if not (np.all(np.isfinite(data)) and data[0] >= 0.0):
                raise file.error(
                    f"the {PREFIX}:{name} must be a radius >= 0 and places of corners."
                )
            found.append(Outline(link[joint], data[1:].reshape(-1, 2), float(data[0])))
    if count is not None and count != len(found):
        warn(f"{file.source}: {count:g} outlines were saved, of which {len(found)} are there.")
    return None if count is None else tuple(found)
