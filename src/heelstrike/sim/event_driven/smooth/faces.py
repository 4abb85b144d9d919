"""Which face of the ground a closed contact point is on, and where on it it would leave it.

As long as a point stays on a face, its gap and normal are those of this face, however the next one
turns: the motion is smooth until the point comes to the end of the face, and that is an event. In a
concave corner a face has no end: there a point that is on it meets a second one, which is a contact
of its own, with a gap, modes and forces: an entry of the table like the others. Flat ground has one
face, and none of this.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.kernels import point_position
from heelstrike.dynamics.places import velocity_at
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.candidates import find_constraints, locate_stops
from heelstrike.sim.contacts.faces import (
    CURVE,
    NO_FACE,
    Located,
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
from heelstrike.sim.event_driven.phase import Bounces, Modes
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
    point: int, second: int, model: Model, ground: GroundModel, tree: Workspace, closed: Integers,
    located: Located, face: Integers, surface: Surface,
) -> None:  # fmt: skip
    """Contact point, gap and normal of a point on its second face, the one it is on or could meet.

    Where there is none the gap is infinite.
    """
    located.gap[second] = np.inf
    if face[point] == NO_FACE:
        return
    if closed[second] == 0:
        x, z = center_of(model, located, point)
        _, face[second] = second_face(
            ground, face[point], NO_FACE, x, z, model.contact_radius[point]
        )
    if face[second] != NO_FACE:
        locate_on_face(model, ground, tree, point, face[second], second, located)
        take_surface(model, ground, point, second, face[second], surface)


@kernel
def locate(
    q: Floats, v: Floats, model: Model, ground: GroundModel, tree: Workspace, rows: Rows,
    modes: Modes, surface: Surface,
) -> None:  # fmt: skip
    """Gaps, contact points, normals and ground coefficients of the state now.

    Its kinematics and velocities have been found.
    """
    closed, face = modes.closed, modes.face
    locate_contacts(model, ground, tree, rows, surface)
    locate_stops(q, rows)
    if rows.outside.kernel.shape[0] > 0:
        find_constraints(model, q, v, tree, rows)
    if ground.curved == 1:
        for point in range(model.nc):
            face[point], modes.curvature[point] = CURVE, surface.curvature[point]
    if not has_corners(ground):
        return
    normals, normal = rows.normal, ground.normal
    for point in range(model.nc):
        its, segment = face[point], face[point] // 2
        if its != NO_FACE and not (
            its % 2 == 0
            and normals[point, 0] == normal[segment, 0]
            and normals[point, 1] == normal[segment, 1]
        ):
            locate_on_face(model, ground, tree, point, its, point, rows)
            take_surface(model, ground, point, point, its, surface)
    if ground.concave == 1:
        located = Located(rows.gap, rows.position, rows.normal)
        for point in range(model.nc):
            second = second_of(point, rows)
            locate_second(point, second, model, ground, tree, closed, located, face, surface)


@kernel
def stand_on_face(
    point: int, second: int, model: Model, ground: GroundModel, tree: Workspace, closed: Integers,
    located: Located, face: Integers, surface: Surface,
) -> None:  # fmt: skip
    """Put a point that has reached the ground on the face that its normal is of.

    In a corner two faces may be equally near.
    """
    if face[point] != NO_FACE or not has_corners(ground):
        return
    gap, normal = located.gap, located.normal
    x, z = center_of(model, located, point)
    face[point] = nearest_face(ground, x, z, model.contact_radius[point])
    if ground.concave == 1:
        locate_second(point, second, model, ground, tree, closed, located, face, surface)
        own, other = normal[point], normal[second]
        twice = own[0] * other[0] + own[1] * other[1] > 1.0 - ONE_NORMAL
        if twice and abs(gap[second] - gap[point]) < ONE_GAP:
            face[point] = face[second]
            locate_second(point, second, model, ground, tree, closed, located, face, surface)


@kernel
def exchange_entries(first: int, second: int, values: Any) -> None:
    """Exchange two entries of an array."""
    values[first], values[second] = values[second], values[first]


@kernel
def begin_with_first(
    rows: Rows, mode: Integers, modes: Modes, hit: Integers, bounces: Bounces
) -> None:
    """Let points that are on their second face only be there with their first contact."""
    for second in range(rows.first[SECOND_FACE], modes.watched):
        point = rows.owner[second]
        if modes.closed[second] == 0 or modes.closed[point] == 1:
            continue
        exchange_entries(point, second, modes.closed)
        exchange_entries(point, second, modes.slide)
        exchange_entries(point, second, modes.stuck)
        exchange_entries(point, second, modes.face)
        exchange_entries(point, second, hit)
        exchange_entries(point, second, bounces.plastic)
        exchange_entries(point, second, modes.anchor)
        exchange_entries(point, second, bounces.last_impact)
        exchange_entries(point, second, bounces.accumulation)
        exchange_entries(point, second, mode)


@kernel
def choose_faces(
    model: Model, ground: GroundModel, tree: Workspace, closed: Integers, face: Integers, rows: Rows
) -> None:
    """Put the closed points that are on no face yet on the nearest; open ones are on none.

    They have yet to be located there.
    """
    for point in range(model.nc):
        if closed[point] == 0 or not has_corners(ground):
            face[point] = NO_FACE
        elif face[point] == NO_FACE:
            center = rows.position[point]
            point_position(tree, model.contact_link[point], model.contact_position[point], center)
            face[point] = nearest_face(ground, center[0], center[1], model.contact_radius[point])


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
    point: int, model: Model, ground: GroundModel, rows: Rows, stuck: Integers, face: Integers
) -> bool:
    """Let a point go over to the following face; return whether its normal jumps there."""
    before = face[point]
    x, z = center_of(model, rows, point)
    _, face[point] = following_face(ground, before, x, z, model.contact_radius[point])
    stuck[point] = 0
    return not is_beside(before, face[point])


@kernel
def watch_corners(
    model: Model, ground: GroundModel, rows: Rows, watched: int, closed: Integers, face: Integers,
    value: Floats,
) -> None:  # fmt: skip
    """Event functions of the points on faces: how far each is from the end of its own."""
    first = 2 * watched
    for point in range(model.nc):
        value[first + point] = 1.0
        if face[point] != NO_FACE:
            x, z = center_of(model, rows, point)
            radius, second = model.contact_radius[point], second_of(point, rows)
            left = way_left(point, second, ground, x, z, radius, closed, face)
            value[first + point] = min(left, 1.0)


@kernel
def way_left(
    point: int, second: int, ground: GroundModel, x: float, z: float, radius: float,
    closed: Integers, face: Integers,
) -> float:  # fmt: skip
    """How far a disc on a face is from the end of it, or what there is to meet or leave besides."""
    left, _ = following_face(ground, face[point], x, z, radius)
    if ground.concave == 1:
        left = min(left, *way_out(point, second, ground, x, z, radius, closed, face))
    return float(left)


@kernel
def rate_corners(
    model: Model, ground: GroundModel, tree: Workspace, watched: int, seconds: int,
    located: Located, closed: Integers, face: Integers, fired: Integers, rate: Floats,
) -> None:  # fmt: skip
    """Rates of the event functions of corners that have fired.

    They are linear in the place of a disc, or nearly so: a short way ahead tells. The second faces
    are the entries of the table from `seconds` on.
    """
    for point in range(model.nc):
        corner = 2 * watched + point
        if fired[corner] == 0 or face[point] == NO_FACE:
            continue
        x, z = center_of(model, located, point)
        link, radius = model.contact_link[point], model.contact_radius[point]
        place = x - tree.pivot[0], z - tree.pivot[1]
        along_x, along_z = velocity_at(tree.velocity, link, place)
        soon_x, soon_z = x + SOON * along_x, z + SOON * along_z
        second = seconds + point
        here = way_left(point, second, ground, x, z, radius, closed, face)
        later = way_left(point, second, ground, soon_x, soon_z, radius, closed, face)
        rate[corner] = (later - here) / SOON


@kernel
def way_out(
    point: int, second: int, ground: GroundModel, x: float, z: float, radius: float,
    closed: Integers, face: Integers,
) -> tuple[float, float]:  # fmt: skip
    """How far a disc that is on two faces is from the end of the second, and from a third.

    Between parallel walls a disc can move on both.
    """
    if closed[second] == 0:
        return np.inf, np.inf
    left, _ = following_face(ground, face[second], x, z, radius)
    third, _ = second_face(ground, face[point], face[second], x, z, radius)
    return left, third


@kernel
def leave_second_face(
    point: int, second: int, model: Model, ground: GroundModel, tree: Workspace, located: Located,
    closed: Integers, slide: Integers, stuck: Integers, face: Integers, fired: Integers,
    surface: Surface,
) -> bool:  # fmt: skip
    """Let a point that is on two faces go over from the second to a third that it meets.

    Or off the end of the second. Returns false if it has come to the end of the first.
    """
    x, z = center_of(model, located, point)
    radius = model.contact_radius[point]
    own, _ = following_face(ground, face[point], x, z, radius)
    left, third = way_out(point, second, ground, x, z, radius, closed, face)
    if own < min(left, third):
        return False
    closed[second], slide[second], stuck[second] = 0, 0, 0
    if third <= left:
        _, face[second] = second_face(ground, face[point], face[second], x, z, radius)
        locate_on_face(model, ground, tree, point, face[second], second, located)
        take_surface(model, ground, point, second, face[second], surface)
        fired[2 * second] = 1
    return True


@kernel
def is_at_second(
    point: int, model: Model, ground: GroundModel, reach: float, rows: Rows, face: Integers
) -> bool:
    """Whether a point is within reach of its second face itself, and not only of the line of it."""
    its = face[second_of(point, rows)]
    x, z = center_of(model, rows, point)
    return room_to(ground, its, x, z, model.contact_radius[point]) <= reach
