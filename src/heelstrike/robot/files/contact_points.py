"""From the collision geoms of a file to the points and discs that meet the ground."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from heelstrike.robot.contact_points import ContactPoint, in_order
from heelstrike.robot.files.links import Links
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.shapes import mesh_corners
from heelstrike.robot.files.snapping import IN_PLANE
from heelstrike.robot.model import NUMBERS, SCALES, Floats, Integers, bounds
from heelstrike.robot.shapes.convex import lowest_chain, touches_first
from heelstrike.robot.warning import warn
from heelstrike.tolerances import LEVEL_GROUND, ONE_POINT

SMALLEST_RADIUS = 1e-9  # metres; a smaller sphere is a point, which MJCF cannot say otherwise

MOST_POINTS = 2000

Point = TypeVar("Point")

PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH = range(8)  # MuJoCo's mjtGeom


def read_contact_points(file: MujocoFile, links: Links) -> list[ContactPoint]:
    """Turn the geoms that can touch the ground into contact points, link by link, heel to toe.

    A sphere, or a cylinder across the plane (a wheel), becomes a disc, or a point if its radius is
    below 1e-9 m; a capsule becomes the discs
    of its two ends; a box or a cylinder in the plane becomes the two ends of its sole, the
    lowest edge in the reference configuration. Its upper corners are left out: they meet flat
    ground only when the robot has fallen, and every contact point costs time in every step. Whoever
    needs them adds spheres of radius 1e-6 there. Of a mesh it is the corners of its convex outline
    on which it stands and rolls, but for those that others of its link always keep off the ground;
    see :mod:`heelstrike.robot.shapes.convex`.

    Parameters
    ----------
    file : MujocoFile
        The parsed file.
    links : Links
        Its links.

    Returns
    -------
    list of ContactPoint
        Ordered by link and, on a link, from back to front. Coinciding points are merged.

    Raises
    ------
    RobotError
        If they are more than `MOST_POINTS`.
    """
    points: list[ContactPoint] = []
    of_meshes: set[ContactPoint] = set()
    skipped: list[str] = []
    model, pose = file.model, file.pose
    scales = contact_scales(file)
    for geom in geoms_that_touch(file, links.of_body):
        link = int(links.of_body[model.geom_bodyid[geom]])
        turn = pose.geom_xmat[geom].reshape(3, 3)
        if model.geom_type[geom] == MESH:
            vertices = pose.geom_xpos[geom, ::2] + mesh_corners(file, geom) @ turn[::2].T
            shape: tuple[Floats, float] | None = (lowest_chain(vertices), 0.0)
        else:
            shape = _outline(
                int(model.geom_type[geom]), model.geom_size[geom], pose.geom_xpos[geom], turn
            )
        if shape is None:
            skipped.append(file.name("geom", geom))
            continue
        centers, radius = shape
        friction = float(model.geom_friction[geom, 0])
        for x, z in centers - links.origin[link]:
            own = scales.get(file.given_name("geom", geom), {})
            points.append(ContactPoint(link, float(x), float(z), radius, friction, **own))
            if model.geom_type[geom] == MESH:
                of_meshes.add(points[-1])
    if skipped:
        warn(
            f"{file.source}: these geoms cannot touch the ground here, because their shape "
            f"(ellipsoid, tilted cylinder …) has no contact points: {', '.join(skipped)}. Add "
            "spheres, capsules or boxes where the robot meets the ground."
        )
    return not_too_many(file, in_order(_without_idle(points, of_meshes)))


def not_too_many(file: MujocoFile, points: list[Point]) -> list[Point]:
    """Return the contact points of a robot, or refuse more than it may have."""
    if len(points) > MOST_POINTS:
        raise file.error(
            f"the robot has {len(points)} contact points, and heelstrike takes up to "
            f'{MOST_POINTS}. Let fewer of its geoms collide: give the others contype="0" and '
            'conaffinity="0".'
        )
    return points


def contact_scales(file: MujocoFile) -> dict[str, dict[str, float]]:
    """Return scales by the names of geoms: custom data called ``friction_scale:GEOM``.

    Raises
    ------
    RobotError
        If there is no such geom, or the number cannot be one.
    """
    geoms = {file.given_name("geom", geom) for geom in range(file.model.ngeom)} - {""}
    found: dict[str, dict[str, float]] = {}
    for name in SCALES:
        for geom, (value, *_) in file.custom(name):
            told = f"{name}:{geom} in <custom>"
            if geom not in geoms:
                raise file.error(f"{told}: there is no geom of that name.")
            if not NUMBERS[name].least <= value <= NUMBERS[name].most:
                raise file.error(f"{told} must be {bounds(name)}, got {value:g}.")
            found.setdefault(geom, {})[name] = float(value)
    return found


def _without_idle(points: list[ContactPoint], some: set[ContactPoint]) -> list[ContactPoint]:
    """Leave out those of some points that never come first where their link meets the ground."""
    kept = []
    for link in sorted({point.link for point in points}):
        own = [point for point in points if point.link == link]
        place = np.array([(point.x, point.z) for point in own])
        first = touches_first(place, np.array([point.radius for point in own]))
        kept += [p for p, touches in zip(own, first, strict=True) if touches or p not in some]
    return kept


def geoms_that_touch(file: MujocoFile, of_body: Integers) -> list[int]:
    """Geoms of moving links that the file lets collide with the ground.

    `of_body` (nbody,) is the link of every body, -1 of those that do not move.

    A file with a ground of its own says which geoms touch it (contype, conaffinity, explicit
    pairs, excluded bodies); without one, every geom that can collide at all counts.
    """
    model = file.model
    if file.disabled("contact"):
        warn(f"{file.source}: contact is switched off by the file, so there are no contact points.")
        return []
    moving = of_body[model.geom_bodyid] >= 0
    pairs = {
        frozenset((int(a), int(b))) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)
    }
    paired = set().union(*pairs) if pairs else set()
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    able = [g for g in range(model.ngeom) if collides[g] or g in paired]
    ground = [g for g in able if not moving[g]]
    _mention_terrain(file, ground)

    candidates = [g for g in able if moving[g]]
    if not ground:
        return candidates
    met = {geom for pair in pairs if not pair.isdisjoint(ground) for geom in pair}
    return [g for g in candidates if g in met or _touches(file, g, np.array(ground), excluded)]


def _touches(file: MujocoFile, geom: int, ground: Integers, excluded: set[tuple[int, int]]) -> bool:
    """Whether the file lets a geom collide with any of the ground."""
    model = file.model
    types, affinities = model.geom_contype, model.geom_conaffinity
    able = (types[geom] & affinities[ground]) | (types[ground] & affinities[geom])
    bodies = set(np.asarray(model.geom_bodyid)[ground[able != 0]].tolist())
    own = int(model.geom_bodyid[geom])
    return any((min(own, body), max(own, body)) not in excluded for body in bodies)


def _mention_terrain(file: MujocoFile, ground: Iterable[int]) -> None:
    """Warn of ground in the file that is more than the plane z = 0."""
    model, pose = file.model, file.pose
    terrain = [
        file.name("geom", g)
        for g in ground
        if model.geom_type[g] != PLANE
        or abs(pose.geom_xpos[g, 2]) > ONE_POINT
        or np.hypot(pose.geom_xmat[g, 2], pose.geom_xmat[g, 5]) > LEVEL_GROUND
    ]
    if terrain:
        warn(
            f"{file.source}: fixed geoms of the file are not part of the robot and are left out: "
            f"{', '.join(terrain)}. Describe the ground by a Ground object."
        )


def _outline(kind: int, size: Floats, center: Floats, turn: Floats) -> tuple[Floats, float] | None:
    """Centres (world x, z) and radius of the discs that stand for a geom; None if it has none."""
    middle = center[::2]
    along = turn[::2, 2]  # the geom's own axis (third column), seen in the plane
    across = np.hypot(*along) < IN_PLANE
    in_plane = abs(turn[1, 2]) < IN_PLANE
    if kind == SPHERE or (kind == CYLINDER and across):
        radius = float(size[0])
        return middle[None], radius if radius > SMALLEST_RADIUS else 0.0
    if kind == CAPSULE:
        ends = np.array([middle - size[1] * along, middle + size[1] * along])
        return ends, float(size[0])
    if kind == CYLINDER and in_plane:
        sideways = np.array([along[1], -along[0]])
        half = np.stack([size[0] * sideways, size[1] * along])
        return _sole(_corners(middle, half)), 0.0
    if kind == BOX:
        return _sole(_corners(middle, (turn[::2] * size[:3]).T)), 0.0
    return None


def _corners(middle: Floats, half: Floats) -> Floats:
    """Corners of the box with centre `middle` and half edges `half`, seen in the plane."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * len(half))).reshape(len(half), -1).T
    return middle + signs @ half


def _sole(corners: Floats) -> Floats:
    """Two corners between which a flat ground would carry the shape, back to front.

    They are the ends of the edge of the convex hull that leaves the lowest corner least steeply.
    """
    height = corners[:, 1] - corners[:, 1].min()
    lowest = corners[np.lexsort((corners[:, 0], np.round(height, 9)))[0]]
    reach = np.abs(corners[:, 0] - lowest[0])
    reach[reach < ONE_POINT] = 0.0
    rise = corners[:, 1] - lowest[1]
    slope = np.divide(rise, reach, out=np.full_like(reach, np.inf), where=reach > 0.0)
    other = corners[np.lexsort((-reach, np.round(slope, 9)))[0]]
    ends = np.array([lowest, other])
    return ends[np.argsort(ends[:, 0])]
