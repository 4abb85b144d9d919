"""Which face of the ground a closed contact point is on, and where on it it would leave it.

As long as a point stays on a face, its gap and normal are those of this face, however the next one
turns: the motion is smooth until the point comes to the end of the face, and that is an event. In a
concave corner a face has no end: there a point that is on it meets a second one, which is a contact
of its own, with a gap, modes and forces. The second faces are numbered on from all other contacts.
Flat ground has one face, and none of this.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.kernels import point_position
from heelstrike.dynamics.places import place_of, velocity_at
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.faces import (
    CURVE,
    NO_FACE,
    along_segment,
    center_of,
    is_beside,
    is_concave,
    locate_on_face,
    nearest_face,
    room_to,
    second_face,
    take_surface,
)
from heelstrike.sim.contacts.geometry import locate_contacts
from heelstrike.sim.contacts.rows import SECOND_FACE, Rows, second_of
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Bounces, Faces, Modes, Watch
from heelstrike.sim.memory import Surface

# Two normals are one when one minus the cosine of the angle between them is below this.
ONE_NORMAL = 1e-12
# Faces whose gaps differ by less (m) are equally near.
ONE_GAP = 1e-9
# How far ahead (s) it is looked for how fast a corner comes near.
SOON = 1e-6


@kernel
def has_corners(ground: GroundModel) -> bool:
    """Whether the ground has more than one face."""
    return bool(ground.friction.shape[0] > 1)


@kernel
def locate_second(
    model: Model, ground: GroundModel, tree: Workspace, point: int, contacts: Contacts, rows: Rows,
    closed: Integers, surface: Surface, seconds: Contacts, face: Integers,
) -> None:  # fmt: skip
    """Contact point, gap and normal of a point on its second face, the one it is on or could meet.

    Where there is none the gap is infinite.
    """
    second = second_of(point, rows)
    seconds.gap[point] = np.inf
    if face[point] == NO_FACE:
        return
    if closed[second] == 0:
        x, z = center_of(model, contacts, point)
        _, face[second] = second_face(
            ground, face[point], NO_FACE, x, z, model.contact_radius[point]
        )
    if face[second] != NO_FACE:
        locate_on_face(model, ground, tree, point, face[second], seconds)
        take_surface(model, ground, point, second, face[second], surface)


@kernel
def locate(
    model: Model, ground: GroundModel, tree: Workspace, rows: Rows, modes: Modes, seconds: Contacts,
    faces: Faces, contacts: Contacts, surface: Surface,
) -> None:  # fmt: skip
    """Contact points, gaps, normals and ground coefficients of the state now."""
    locate_contacts(model, ground, tree, contacts, surface)
    if ground.curved == 1:
        for contact in range(model.nc):
            faces.face[contact], faces.bend[contact] = CURVE, surface.bend[contact]
    if not has_corners(ground):
        return
    normals, normal = contacts.normal, ground.normal
    for contact in range(model.nc):
        face = faces.face[contact]
        segment = face // 2
        if face != NO_FACE and not (
            face % 2 == 0
            and normals[contact, 0] == normal[segment, 0]
            and normals[contact, 1] == normal[segment, 1]
        ):
            locate_on_face(model, ground, tree, contact, face, contacts)
            take_surface(model, ground, contact, contact, face, surface)
    for second in range(rows.first[SECOND_FACE], modes.watched):
        point = rows.owner[second]
        locate_second(
            model, ground, tree, point, contacts, rows, modes.closed, surface, seconds, faces.face
        )


@kernel
def stand_on_face(
    model: Model, ground: GroundModel, tree: Workspace, point: int, contacts: Contacts, rows: Rows,
    closed: Integers, surface: Surface, seconds: Contacts, faces: Faces,
) -> None:  # fmt: skip
    """Put a point that has reached the ground on the face that its normal is of.

    In a corner two faces may be equally near.
    """
    if faces.face[point] == NO_FACE and has_corners(ground):
        x, z = center_of(model, contacts, point)
        faces.face[point] = nearest_face(ground, x, z, model.contact_radius[point])
        if faces.paired == 1:
            locate_second(
                model, ground, tree, point, contacts, rows, closed, surface, seconds, faces.face
            )
            own, other = contacts.normal[point], seconds.normal[point]
            twice = own[0] * other[0] + own[1] * other[1] > 1.0 - ONE_NORMAL
            if twice and abs(seconds.gap[point] - contacts.gap[point]) < ONE_GAP:
                faces.face[point] = faces.face[second_of(point, rows)]
                locate_second(
                    model, ground, tree, point, contacts, rows, closed, surface, seconds, faces.face
                )


@kernel
def exchange_entries(first: int, second: int, values: Any) -> None:
    """Exchange two entries of an array."""
    values[first], values[second] = values[second], values[first]


@kernel
def exchange(
    point: int, rows: Rows, mode: Integers, modes: Modes, face: Integers, hit: Integers,
    bounces: Bounces,
) -> None:  # fmt: skip
    """Let the first face of a point be the one that was its second."""
    second = second_of(point, rows)
    exchange_entries(point, second, modes.closed)
    exchange_entries(point, second, modes.slide)
    exchange_entries(point, second, modes.stuck)
    exchange_entries(point, second, face)
    exchange_entries(point, second, hit)
    exchange_entries(point, second, bounces.plastic)
    exchange_entries(point, second, modes.anchor)
    exchange_entries(point, second, bounces.last_impact)
    exchange_entries(point, second, bounces.accumulation)
    exchange_entries(point, second, mode)


@kernel
def choose_faces(
    model: Model, ground: GroundModel, tree: Workspace, rows: Rows, mode: Integers, modes: Modes,
    faces: Faces, hit: Integers, bounces: Bounces,
) -> None:  # fmt: skip
    """Put the closed points that are on no face yet on the nearest; open ones are on none.

    A point that is on one face only is there with its first contact.
    """
    place = faces.place
    for second in range(rows.first[SECOND_FACE], modes.watched):
        point = rows.owner[second]
        if modes.closed[second] == 1 and modes.closed[point] == 0:
            exchange(point, rows, mode, modes, faces.face, hit, bounces)
    for contact in range(model.nc):
        if modes.closed[contact] == 0 or not has_corners(ground):
            faces.face[contact] = NO_FACE
        elif faces.face[contact] == NO_FACE:
            point_position(
                tree, model.contact_link[contact], model.contact_position[contact], place
            )
            radius = model.contact_radius[contact]
            faces.face[contact] = nearest_face(ground, place[0], place[1], radius)


@kernel
def following_face(
    ground: GroundModel, face: int, x: float, z: float, radius: float
) -> tuple[float, int]:
    """How far a disc at a place on a face is from the end of it, and which face follows there.

    Where the ground turns upwards there is no end: the disc meets the next face before.
    """
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
        return left, following
    if segment > 0 and not is_concave(ground, segment):
        left = after
        following = 2 * segment + 1 if pivots else 2 * segment - 2
    if segment < segments - 1 and before < left and not is_concave(ground, segment + 1):
        left = before
        following = 2 * segment + 3 if pivots else 2 * segment + 2
    return left, following


@kernel
def turn_corner(
    model: Model, ground: GroundModel, contact: int, contacts: Contacts, stuck: Integers,
    faces: Faces,
) -> bool:  # fmt: skip
    """Let a point go over to the following face; return whether its normal jumps there."""
    face, radius = faces.face[contact], model.contact_radius[contact]
    x, z = center_of(model, contacts, contact)
    _, following = following_face(ground, face, x, z, radius)
    faces.face[contact] = following
    stuck[contact] = 0
    return not is_beside(face, following)


@kernel
def watch_corners(
    model: Model, ground: GroundModel, contacts: Contacts, rows: Rows, modes: Modes, faces: Faces,
    value: Floats,
) -> None:  # fmt: skip
    """Event functions of the points on faces: how far each is from the end of its own."""
    first = 2 * modes.watched
    for contact in range(model.nc):
        value[first + contact] = 1.0
        if faces.face[contact] != NO_FACE:
            x, z = center_of(model, contacts, contact)
            left = way_left(
                ground, contact, x, z, model.contact_radius[contact], rows, modes.closed, faces
            )
            value[first + contact] = min(left, 1.0)


@kernel
def way_left(
    ground: GroundModel, point: int, x: float, z: float, radius: float, rows: Rows,
    closed: Integers, faces: Faces,
) -> float:  # fmt: skip
    """How far a disc on a face is from the end of it, or what there is to meet or leave besides."""
    left, _ = following_face(ground, faces.face[point], x, z, radius)
    if faces.paired == 1:
        left = min(left, *way_out(ground, point, x, z, radius, rows, closed, faces.face))
    return float(left)


@kernel
def rate_corners(
    model: Model, ground: GroundModel, tree: Workspace, contacts: Contacts, rows: Rows,
    modes: Modes, faces: Faces, watch: Watch,
) -> None:  # fmt: skip
    """Rates of the event functions of corners that have fired.

    They are linear in the place of a disc, or nearly so: a short way ahead tells.
    """
    center = watch.center
    for contact in range(model.nc):
        corner = 2 * modes.watched + contact
        if watch.fired[corner] == 0 or faces.face[contact] == NO_FACE:
            continue
        x, z = center_of(model, contacts, contact)
        center[0], center[1] = x, z
        link, radius = model.contact_link[contact], model.contact_radius[contact]
        along_x, along_z = velocity_at(tree.velocity, link, place_of(tree, center))
        soon_x, soon_z = x + SOON * along_x, z + SOON * along_z
        here = way_left(ground, contact, x, z, radius, rows, modes.closed, faces)
        later = way_left(ground, contact, soon_x, soon_z, radius, rows, modes.closed, faces)
        watch.rate[corner] = (later - here) / SOON


@kernel
def way_out(
    ground: GroundModel, point: int, x: float, z: float, radius: float, rows: Rows,
    closed: Integers, face: Integers,
) -> tuple[float, float]:  # fmt: skip
    """How far a disc that is on two faces is from the end of the second, and from a third.

    Between parallel walls a disc can move on both.
    """
    second = second_of(point, rows)
    if closed[second] == 0:
        return np.inf, np.inf
    left, _ = following_face(ground, face[second], x, z, radius)
    third, _ = second_face(ground, face[point], face[second], x, z, radius)
    return left, third


@kernel
def leave_second_face(
    model: Model, ground: GroundModel, tree: Workspace, point: int, contacts: Contacts, rows: Rows,
    surface: Surface, seconds: Contacts, modes: Modes, face: Integers, fired: Integers,
) -> bool:  # fmt: skip
    """Let a point that is on two faces go over from the second to a third that it meets.

    Or off the end of the second. Returns false if it has come to the end of the first.
    """
    x, z = center_of(model, contacts, point)
    second, radius = second_of(point, rows), model.contact_radius[point]
    own, _ = following_face(ground, face[point], x, z, radius)
    left, third = way_out(ground, point, x, z, radius, rows, modes.closed, face)
    if own < min(left, third):
        return False
    modes.closed[second], modes.slide[second], modes.stuck[second] = 0, 0, 0
    if third <= left:
        _, its = second_face(ground, face[point], face[second], x, z, radius)
        face[second] = its
        locate_on_face(model, ground, tree, point, its, seconds)
        take_surface(model, ground, point, second, its, surface)
        fired[2 * second] = 1
    return True


@kernel
def is_at_second(
    model: Model, ground: GroundModel, point: int, reach: float, contacts: Contacts, rows: Rows,
    faces: Faces,
) -> bool:  # fmt: skip
    """Whether a point is within reach of its second face itself, and not only of the line of it."""
    face = faces.face[second_of(point, rows)]
    x, z = center_of(model, contacts, point)
    return room_to(ground, face, x, z, model.contact_radius[point]) <= reach


@kernel
def face_curvature(contact: int, radius: float, faces: Faces) -> float:
    """Curvature (1/m) of the way of the centre of a disc on its face."""
    face = faces.face[contact]
    return 1.0 / radius if face >= 0 and face % 2 == 1 else faces.bend[contact]
