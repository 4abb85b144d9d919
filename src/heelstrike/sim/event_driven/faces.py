"""Which face of the ground a closed contact point is on, and where on it it would leave it.

As long as a point stays on a face, its gap and normal are those of this face, however the next one
turns: the motion is smooth until the point comes to the end of the face, and that is an event. Face
2 i is the line of segment i; a disc that pivots on corner i is on face 2 i + 1. Flat ground has one
face, and none of this.
"""

from __future__ import annotations

import math

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel, line_contact
from heelstrike.dynamics.kernels import point_position
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.geometry import locate_contacts
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.memory import Surface

NO_FACE = -1


@kernel
def has_corners(ground: GroundModel) -> bool:
    """Whether the ground has more than one face."""
    return bool(ground.friction.shape[0] > 1)


@kernel
def along_segment(ground: GroundModel, segment: int, x: float, z: float) -> tuple[float, float]:
    """How far beyond the beginning of a segment a place is along it, and how far before its end."""
    begin, end = ground.vertices[segment], ground.vertices[segment + 1]
    tangent_x, tangent_z = ground.normal[segment, 1], -ground.normal[segment, 0]
    after = (x - begin[0]) * tangent_x + (z - begin[1]) * tangent_z
    before = (end[0] - x) * tangent_x + (end[1] - z) * tangent_z
    return after, before


@kernel
def distance_to(ground: GroundModel, segment: int, x: float, z: float) -> float:
    """Distance of a place from a segment."""
    after, before = along_segment(ground, segment, x, z)
    if after < 0.0 and segment > 0:
        corner = ground.vertices[segment]
    elif before < 0.0 and segment < ground.friction.shape[0] - 1:
        corner = ground.vertices[segment + 1]
    else:
        origin, normal = ground.vertices[segment], ground.normal[segment]
        return abs((x - origin[0]) * normal[0] + (z - origin[1]) * normal[1])
    return math.sqrt((x - corner[0]) ** 2 + (z - corner[1]) ** 2)


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
def choose_faces(model: Model, ground: GroundModel, tree: Workspace, phase: Phase) -> None:
    """Put the closed points that are on no face yet on the nearest; open ones are on none."""
    place = phase.scratch[0]
    for contact in range(model.nc):
        if phase.closed[contact] == 0 or not has_corners(ground):
            phase.face[contact] = NO_FACE
        elif phase.face[contact] == NO_FACE:
            point_position(
                tree, model.contact_link[contact], model.contact_position[contact], place
            )
            radius = model.contact_radius[contact]
            phase.face[contact] = nearest_face(ground, place[0], place[1], radius)


@kernel
def locate_on_face(
    model: Model, ground: GroundModel, tree: Workspace, contact: int, face: int,
    contacts: Contacts, surface: Surface,
) -> None:  # fmt: skip
    """Contact point, gap and normal of a disc on a face, wherever it is along it."""
    point, normal, segment = contacts.position[contact], contacts.normal[contact], face // 2
    radius = model.contact_radius[contact]
    if face % 2 == 0 and (
        normal[0] == ground.normal[segment, 0] and normal[1] == ground.normal[segment, 1]
    ):
        return
    point_position(tree, model.contact_link[contact], model.contact_position[contact], point)
    if face % 2 == 0:
        distance = line_contact(ground, segment, point[0], point[1], normal)
    else:
        corner = ground.vertices[segment]
        distance = math.sqrt((point[0] - corner[0]) ** 2 + (point[1] - corner[1]) ** 2)
        normal[0] = (point[0] - corner[0]) / distance
        normal[1] = (point[1] - corner[1]) / distance
        segment -= 1
    contacts.gap[contact] = distance - radius
    point[0] -= radius * normal[0]
    point[1] -= radius * normal[1]
    surface.friction[contact] = model.friction_scale[contact] * ground.friction[segment]
    surface.restitution[contact] = model.restitution_scale[contact] * ground.restitution[segment]


@kernel
def locate(
    model: Model, ground: GroundModel, tree: Workspace, phase: Phase, contacts: Contacts,
    surface: Surface,
) -> None:  # fmt: skip
    """Contact points, gaps, normals and ground coefficients of the state now."""
    locate_contacts(model, ground, tree, contacts, surface)
    if has_corners(ground):
        for contact in range(model.nc):
            if phase.face[contact] != NO_FACE:
                face = phase.face[contact]
                locate_on_face(model, ground, tree, contact, face, contacts, surface)


@kernel
def is_beside(face: int, other: int) -> bool:
    """Whether a disc rolls from one face to another without a jump: a line and one of its ends."""
    if face % 2 == other % 2:
        return False
    apart = face - other if face % 2 == 1 else other - face
    return apart in (1, 3)


@kernel
def following_face(
    ground: GroundModel, face: int, x: float, z: float, radius: float
) -> tuple[float, int]:
    """How far a disc at a place on a face is from the next one, and which that is."""
    segments, segment = ground.friction.shape[0], face // 2
    after, before = along_segment(ground, segment, x, z)
    pivots = radius > 0.0
    left = np.inf
    following = face
    if face % 2 == 1:
        left = -after
        following = 2 * segment
        _, beyond = along_segment(ground, segment - 1, x, z)
        if -beyond < left:
            left = -beyond
            following = 2 * segment - 2
    else:
        if segment > 0:
            left = after
            following = 2 * segment + 1 if pivots else 2 * segment - 2
        if segment < segments - 1 and before < left:
            left = before
            following = 2 * segment + 3 if pivots else 2 * segment + 2
    if not pivots:
        return left, following
    for other in range(segments):
        if other == segment or (face % 2 == 1 and other == segment - 1):
            continue
        ahead, behind = along_segment(ground, other, x, z)
        its = 2 * other
        if ahead < 0.0 and other > 0:
            its += 1
        elif behind < 0.0 and other < segments - 1:
            its += 3
        # A corner of the face is never nearer than the face.
        if its % 2 == 1 and is_beside(face, its):
            continue
        room = distance_to(ground, other, x, z) - radius
        if room < left:
            left = room
            following = its
    return left, following


@kernel
def turn_corner(
    model: Model, ground: GroundModel, contact: int, contacts: Contacts, phase: Phase
) -> bool:
    """Let a point go over to the following face; return whether its normal jumps there."""
    face, radius = phase.face[contact], model.contact_radius[contact]
    x = contacts.position[contact, 0] + radius * contacts.normal[contact, 0]
    z = contacts.position[contact, 1] + radius * contacts.normal[contact, 1]
    _, following = following_face(ground, face, x, z, radius)
    phase.face[contact] = following
    phase.stuck[contact] = 0
    return not is_beside(face, following)


@kernel
def watch_corners(
    model: Model, ground: GroundModel, contacts: Contacts, phase: Phase, value: Floats
) -> None:
    """Event functions of the points on faces: how far each is from the next."""
    first = 2 * phase.closed.shape[0]
    for contact in range(model.nc):
        value[first + contact] = 1.0
        face, radius = phase.face[contact], model.contact_radius[contact]
        if face != NO_FACE:
            x = contacts.position[contact, 0] + radius * contacts.normal[contact, 0]
            z = contacts.position[contact, 1] + radius * contacts.normal[contact, 1]
            value[first + contact], _ = following_face(ground, face, x, z, radius)


@kernel
def closes_corner(
    ground: GroundModel, face: int, other: int, x: float, z: float, radius: float
) -> bool:
    """Whether a segment and the face that a disc is on make a concave corner about it."""
    segment = face // 2
    if face % 2 == 1 or other == segment:
        return False
    own, normal, origin = ground.normal[segment], ground.normal[other], ground.vertices[other]
    if abs(other - segment) == 1:
        turn = (own[0] * normal[1] - own[1] * normal[0]) * (other - segment)
        return bool(turn > 0.0)
    return bool((x - origin[0]) * normal[0] + (z - origin[1]) * normal[1] >= radius)


@kernel
def face_curvature(contact: int, model: Model, phase: Phase) -> float:
    """Curvature (1/m) of the way of the centre of a disc on its face."""
    face = phase.face[contact]
    return 1.0 / model.contact_radius[contact] if face >= 0 and face % 2 == 1 else 0.0
