"""The faces of the ground, and which two of them a contact point can touch at once.

Face 2 i is the line of segment i; a disc that pivots on corner i is on face 2 i + 1. A point that
is on a face touches a second one in a concave corner: the next face where the ground turns upwards,
of a disc whatever of the ground is nearest beside its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel, line_contact, turn_at
from heelstrike.dynamics.kernels import point_position
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.rows import Rows
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Surface
from heelstrike.tolerances import STRAIGHT_GROUND

NO_FACE = -1

CURVE = -2
"""The one face of smooth ground: how far along it anything has gone is not measured."""


@kernel
def along_segment(ground: GroundModel, segment: int, x: float, z: float) -> tuple[float, float]:
    """How far beyond the beginning of a segment a place is along it, and how far before its end."""
    begin, end = ground.vertices[segment], ground.vertices[segment + 1]
    tangent_x, tangent_z = ground.normal[segment, 1], -ground.normal[segment, 0]
    after = (x - begin[0]) * tangent_x + (z - begin[1]) * tangent_z
    before = (end[0] - x) * tangent_x + (end[1] - z) * tangent_z
    return after, before


@kernel
def height_over(ground: GroundModel, segment: int, x: float, z: float) -> float:
    """Distance of a place from the line of a segment, negative below it."""
    origin, normal = ground.vertices[segment], ground.normal[segment]
    return (x - origin[0]) * normal[0] + (z - origin[1]) * normal[1]


@kernel
def distance_to(ground: GroundModel, segment: int, x: float, z: float) -> float:
    """Distance of a place from a segment."""
    after, before = along_segment(ground, segment, x, z)
    if after < 0.0 and segment > 0:
        corner = ground.vertices[segment]
    elif before < 0.0 and segment < ground.friction.shape[0] - 1:
        corner = ground.vertices[segment + 1]
    else:
        return abs(height_over(ground, segment, x, z))
    return math.sqrt((x - corner[0]) ** 2 + (z - corner[1]) ** 2)


@kernel
def room_to(ground: GroundModel, face: int, x: float, z: float, radius: float) -> float:
    """Distance between a disc and a face itself, not the line of it."""
    if face % 2 == 0:
        return distance_to(ground, face // 2, x, z) - radius
    corner = ground.vertices[face // 2]
    return math.sqrt((x - corner[0]) ** 2 + (z - corner[1]) ** 2) - radius


@kernel
def nearest_face(ground: GroundModel, x: float, z: float, radius: float) -> int:
    """Face of the ground that a disc at a place is nearest to."""
    segments = ground.friction.shape[0]
    nearest = np.inf
    face = 0
    for segment in range(segments):
        distance = distance_to(ground, segment, x, z)
        if distance < nearest:
            nearest = distance
            after, before = along_segment(ground, segment, x, z)
            face = 2 * segment
            if radius > 0.0 and after < 0.0 and segment > 0:
                face = 2 * segment + 1
            elif radius > 0.0 and before < 0.0 and segment < segments - 1:
                face = 2 * segment + 3
    return face


@kernel
def is_beside(face: int, other: int) -> bool:
    """Whether a disc rolls from one face to another without a jump: a line and one of its ends."""
    if face % 2 == other % 2:
        return False
    apart = face - other if face % 2 == 1 else other - face
    return apart in (1, 3)


@kernel
def is_concave(ground: GroundModel, corner: int) -> bool:
    """Whether the ground turns upwards at a corner between two segments."""
    inner = 0 < corner < ground.friction.shape[0]
    return bool(inner and turn_at(ground, corner) > STRAIGHT_GROUND)


@kernel
def second_face(
    ground: GroundModel, face: int, besides: int, x: float, z: float, radius: float
) -> tuple[float, int]:
    """Gap between a disc and the second face it could touch while it is on one, and which it is.

    With another face `besides` it is a third one, beside neither. The gap is infinite where there
    is none.
    """
    segments, segment = ground.friction.shape[0], face // 2
    pivots = face % 2 == 1
    nearest = np.inf
    second = NO_FACE
    first, last = 0, segments - 1
    if radius == 0.0:
        first, last = max(segment - 1, 0), min(segment + 1, segments - 1)
    for other in range(first, last + 1):
        if other == segment or (pivots and other == segment - 1):
            continue
        neighbours = not pivots and abs(other - segment) == 1
        if neighbours and not is_concave(ground, max(other, segment)):
            continue
        its = 2 * other
        if radius > 0.0:
            after, before = along_segment(ground, other, x, z)
            if after < 0.0 and other > 0:
                its += 1
            elif before < 0.0 and other < segments - 1:
                its += 3
        if its == besides or (besides != NO_FACE and is_beside(besides, its)):
            continue
        if its % 2 == 0:
            distance = height_over(ground, other, x, z)
        else:
            # A corner of its own face is never nearer than that.
            if is_beside(face, its):
                continue
            distance = distance_to(ground, other, x, z)
        # The back of a wall is no face of this side.
        if its % 2 == 0 and not neighbours and distance < 0.0:
            continue
        if distance - radius < nearest:
            nearest = distance - radius
            second = its
    return nearest, second


class Located(NamedTuple):
    """Where entries of the table of rows are: gaps, positions and normals, as it has them."""

    gap: Floats
    position: Floats
    normal: Floats


@kernel
def move_to_line(
    x: float, z: float, moment: float, radius: float, normal: Floats, place: Floats
) -> bool:
    """Move a contact point of a disc to where the line of action of a force (x, z) leaves it.

    `moment` is its moment about the centre of the disc, `normal` that at the contact point. The
    line of forces that nearly cancel may miss the disc: then it is where the line is nearest.
    Returns whether there is a force.
    """
    size = math.sqrt(x * x + z * z)
    if size > 0.0:
        lever = moment / size
        depth = math.sqrt(max(radius * radius - lever * lever, 0.0))
        place[0] += radius * normal[0] + (lever * z - depth * x) / size
        place[1] += radius * normal[1] + (-lever * x - depth * z) / size
    return bool(size > 0.0)


@kernel
def center_of(model: Model, contacts: Contacts | Rows | Located, point: int) -> tuple[float, float]:
    """Where the centre of the disc of a contact point is."""
    position, normal = contacts.position[point], contacts.normal[point]
    radius = model.contact_radius[point]
    return position[0] + radius * normal[0], position[1] + radius * normal[1]


@kernel
def locate_on_face(
    model: Model, ground: GroundModel, tree: Workspace, point: int, face: int, entry: int,
    contacts: Contacts | Rows | Located,
) -> None:  # fmt: skip
    """Contact point, gap and normal of a disc on a face, wherever it is along it.

    They are written as those of an `entry`.
    """
    place, normal = contacts.position[entry], contacts.normal[entry]
    radius = model.contact_radius[point]
    point_position(tree, model.contact_link[point], model.contact_position[point], place)
    if face % 2 == 0:
        distance = line_contact(ground, face // 2, place[0], place[1], normal)
    else:
        corner = ground.vertices[face // 2]
        distance = math.sqrt((place[0] - corner[0]) ** 2 + (place[1] - corner[1]) ** 2)
        normal[0] = (place[0] - corner[0]) / distance
        normal[1] = (place[1] - corner[1]) / distance
    contacts.gap[entry] = distance - radius
    place[0] -= radius * normal[0]
    place[1] -= radius * normal[1]


@kernel
def take_surface(
    model: Model, ground: GroundModel, point: int, contact: int, face: int, surface: Surface
) -> None:
    """Write the coefficients of a contact of a point with a face.

    Those of a corner of the ground are the left segment's.
    """
    segment = face // 2 - face % 2
    surface.friction[contact] = model.friction_scale[point] * ground.friction[segment]
    surface.restitution[contact] = model.restitution_scale[point] * ground.restitution[segment]
