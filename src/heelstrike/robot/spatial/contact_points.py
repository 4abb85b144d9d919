"""From the collision geoms of a file to the points, spheres and rims that meet the ground."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.files.contact_points import (
    CYLINDER,
    MESH,
    SMALLEST_RADIUS,
    contact_scales,
    geoms_that_touch,
    not_too_many,
)
from heelstrike.robot.files.mujoco_file import MujocoFile
from heelstrike.robot.files.shapes import ball_radius, geom_corners, mesh_corners
from heelstrike.robot.model import SCALES, Floats
from heelstrike.robot.shapes.solids import few_corners
from heelstrike.robot.spatial.links import SpatialLinks
from heelstrike.robot.warning import warn
from heelstrike.tolerances import ONE_POINT
from heelstrike.wording import some_of

AROUND = 8
"""Points round each end of a cylinder that stands."""

UPRIGHT = 0.7
"""Cosine of the angle of a cylinder from upright, in the reference configuration, up to which it
stands on an end; one that is more level rolls on its rims."""

SAID = 1e-3
"""Metres by which meshes reach beyond their points, from which on that is told."""

SHOWN = 4  # how many names a message lists before it counts the rest


@dataclass(frozen=True)
class SpatialPoint:
    """A sphere (or a point, of radius zero) or a rim that is fixed to a link."""

    link: int
    """Link that carries it."""
    place: tuple[float, float, float]
    """Its centre in the link frame (m)."""
    radius: float
    """Radius of the sphere (m)."""
    friction: float
    """Sliding friction that the file gives its geom."""
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Unit axis of a rim in the link frame."""
    rim: float = 0.0
    """Radius of a rim (m)."""
    friction_scale: float = 1.0
    restitution_scale: float = 1.0
    """friction_scale, restitution_scale: What friction and restitution of the ground are multiplied
    by under it."""


def of_spatial_model(points: list[SpatialPoint]) -> dict[str, list[object]]:
    """Return contact points as a model has them."""
    return {
        "contact_link": [point.link for point in points],
        "contact_position": [point.place for point in points],
        "contact_radius": [point.radius for point in points],
        "contact_axis": [point.axis for point in points],
        "contact_rim": [point.rim for point in points],
        **{name: [getattr(point, name) for point in points] for name in SCALES},
    }


def read_spatial_points(file: MujocoFile, links: SpatialLinks, most: int) -> list[SpatialPoint]:
    """Turn the geoms that can touch the ground into contact points, link by link.

    A sphere is one, of its radius, or a point if that is below 1e-9 m; a capsule is the spheres of
    its two ends, a box its eight corners. A cylinder that lies is its two rims, of which the lowest
    points meet the ground wherever it rolls; one that stands is eight points round each end. Of the
    meshes of a link it is up to `most` corners of their convex hull, which meets level ground where
    they do. Edges meet nothing between their ends, and links never each other.

    Raises
    ------
    RobotError
        If they are more than `MOST_POINTS`.

    Warns
    -----
    RobotWarning
        Of geoms without contact points, and of meshes that reach far beyond their points.
    """
    points: list[SpatialPoint] = []
    skipped: list[str] = []
    beyond: dict[int, float] = {}
    scales = contact_scales(file)
    touching = geoms_that_touch(file, links.of_body)
    _tell_of_self_collision(file, touching)
    of_meshes: dict[tuple[int, tuple[float, ...]], list[Floats]] = {}
    for geom in touching:
        own = scales.get(file.given_name("geom", geom), {})
        if file.model.geom_type[geom] == MESH:
            link = int(links.of_body[file.model.geom_bodyid[geom]])
            place = links.within(file, geom, mesh_corners(file, geom))
            friction = float(file.model.geom_friction[geom, 0])
            surface = friction, *(own.get(name, 1.0) for name in SCALES)
            of_meshes.setdefault((link, surface), []).append(place)
            continue
        shape = list(_shape(file, geom, links))
        points += [_scaled(point, **own) for point in shape]
        if not shape:
            skipped.append(file.name("geom", geom))
    for (link, (friction, *own_scales)), places in of_meshes.items():
        corners, reach = few_corners(np.concatenate(places), most)
        if reach > SAID:
            beyond[link] = max(reach, beyond.get(link, 0.0))
        scaled = dict(zip(SCALES, own_scales, strict=True))
        points += [
            _scaled(SpatialPoint(link, _triple(place), 0.0, friction), **scaled)
            for place in corners
        ]
    if skipped:
        warn(
            f"{file.source}: these geoms cannot touch the ground here, because their shape "
            f"(ellipsoid …) has no contact points: {some_of(skipped, SHOWN)}. Add spheres, "
            "capsules or boxes where the robot meets the ground."
        )
    if beyond:
        worst = max(beyond, key=lambda each: beyond[each])
        name = file.name("body", int(file.model.jnt_bodyid[worst]))
        warn(
            f"{file.source}: the {most} corners that stand for the meshes of a link miss "
            f"their hull by more than {1e3 * SAID:g} mm on {len(beyond)} of its links, by up to "
            f"{1e3 * beyond[worst]:.2g} mm on {name!r}. Whoever wants less gives the link spheres, "
            "capsules or boxes."
        )
    return not_too_many(file, sorted(_merged(points), key=lambda point: point.link))


def _tell_of_self_collision(file: MujocoFile, geoms: list[int]) -> None:
    """Say that links go through each other, where the file lets some collide."""
    model = file.model
    types, affinities = model.geom_contype[geoms], model.geom_conaffinity[geoms]
    able = (types[:, None] & affinities) != 0
    body = np.asarray(model.geom_bodyid)[geoms]
    parent = np.asarray(model.body_weldid)[model.body_parentid[model.body_weldid[body]]]
    weld = np.asarray(model.body_weldid)[body]
    near = (weld[:, None] == weld) | (parent[:, None] == weld) | (weld[:, None] == parent)
    if np.any(able & ~near):
        warn(
            f"{file.source}: links of the robot that the file lets collide with each other go "
            "through each other here: contact is with the ground alone."
        )


def _shape(file: MujocoFile, geom: int, links: SpatialLinks) -> Iterator[SpatialPoint]:
    """Points of a geom, none if it has no shape that we know."""
    model, pose = file.model, file.pose
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    link = int(links.of_body[model.geom_bodyid[geom]])
    radius = ball_radius(file, geom)
    axis, rim = np.zeros(3), 0.0
    if kind == CYLINDER and abs(pose.geom_xmat[geom, 8]) <= UPRIGHT:
        local = np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]])
        axis = links.axes[link].T @ pose.geom_xmat[geom, 2::3]
        rim = float(size[0])
    else:
        local = geom_corners(file, geom, AROUND)
    friction = float(model.geom_friction[geom, 0])
    radius = radius if radius > SMALLEST_RADIUS else 0.0
    for place in links.within(file, geom, local):
        yield SpatialPoint(link, _triple(place), radius, friction, _triple(axis), rim)


def _scaled(
    point: SpatialPoint, friction_scale: float = 1.0, restitution_scale: float = 1.0
) -> SpatialPoint:
    return replace(point, friction_scale=friction_scale, restitution_scale=restitution_scale)


def _triple(values: Floats) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _merged(points: list[SpatialPoint]) -> list[SpatialPoint]:
    """Points without repetition; of several that coincide the first stays."""
    kept: dict[tuple[object, ...], SpatialPoint] = {}
    for point in points:
        numbers = (*point.place, point.radius, *point.axis, point.rim)
        key = point.link, *(round(number / ONE_POINT) for number in numbers)
        kept.setdefault(key, point)
    return list(kept.values())
