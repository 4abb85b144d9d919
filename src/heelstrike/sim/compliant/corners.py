"""Compliant ground in its concave corners: a point feels every face that it is in.

Near a corner a point is on two faces, each with a gap, a bristle and a force of its own. Which they
are does not change within a step, so that forces stay smooth where the nearer face becomes the
other; the bristle of the face that a point leaves the corner on goes with it. The record has the
resultant of both, in the frame of the row, where it leaves the disc.

Sides are the points, and after them their second faces; `other` says which of them these are.
"""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, part
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.faces import (
    NO_FACE,
    center_of,
    locate_on_face,
    move_to_line,
    nearest_face,
    room_to,
    second_face,
    take_surface,
)
from heelstrike.sim.contacts.geometry import observe
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Surface

# A point is in a corner when it is nearer to both faces than this (m), and no more when it is
# further than that from either.
ENTERS, LEAVES = 1e-3, 2e-3
# A third face takes the place of one that does not push and is hardly nearer than this (m).
AS_NEAR = 1e-6


class Corners(Bundle):
    """The points that are in concave corners."""

    sides: int = cell(int)
    doubled: int = cell(int)
    """sides, doubled: How many sides of points there are on this ground, and how many points have
    a second one: all, if it has corners."""
    other: Integers = array("nc", of=int)
    """Second side of each point."""
    first: Integers = array("nc", of=int)
    second: Integers = array("nc", of=int)
    """first, second: The faces that each point in a corner is on, -1 for the others."""
    contacts: Contacts = part(Contacts)
    """The points on their second faces; the gap is infinite where there is none."""
    friction: Floats = array("nc")
    """Coefficients there."""
    joins: Integers = array("nc", of=int)
    """Whether both faces of a point pushed it since the last sample, or its frame has changed."""
    frame: Floats = array("nc", "axes")
    """Normal of each point at the last sample, in whose frame forces are told."""
    center: Floats = array("nc", "axes")
    """Centre of each disc then."""
    force: Floats = array("nc", "axes")
    """Impulse of both faces since then, in world axes (N s)."""
    moment: Floats = array("nc")
    """Its moment about the centre of the disc (N m s)."""


def allocate_corners(robot: Robot) -> Corners:
    """Allocate it for a robot, of which no point is in a corner."""
    extents = {**robot.model.extents, "components": 2}
    none = np.full(robot.nc, NO_FACE)
    return Corners.allocate(
        extents, sides=robot.nc, other=np.arange(robot.nc, 2 * robot.nc),
        first=none, second=none.copy(),
        contacts=Contacts.allocate(extents, gap=np.full(robot.nc, np.inf)),
    )  # fmt: skip


@kernel
def observe_sides(
    model: Model, ground: GroundModel, q: Floats, v: Floats, tree: Workspace, contacts: Contacts,
    surface: Surface, corners: Corners,
) -> None:  # fmt: skip
    """Kinematics, velocities and contact points of a state, on both faces of corners."""
    observe(model, ground, q, v, tree, contacts, surface)
    seconds = corners.contacts
    for point in range(corners.doubled):
        seconds.gap[point] = np.inf
        face, other = corners.first[point], corners.second[point]
        if other == NO_FACE:
            continue
        locate_on_face(model, ground, tree, point, face, point, contacts)
        take_surface(model, ground, point, point, face, surface)
        locate_on_face(model, ground, tree, point, other, point, seconds)
        friction = ground.friction[other // 2 - other % 2]
        corners.friction[point] = model.friction_scale[point] * friction


@kernel
def third_face(
    ground: GroundModel, point: int, x: float, z: float, radius: float, corners: Corners
) -> tuple[float, int]:
    """Gap between a disc in a corner and a third face, and which it is."""
    first, second = corners.first[point], corners.second[point]
    gap, face = second_face(ground, first, second, x, z, radius)
    other_gap, other = second_face(ground, second, first, x, z, radius)
    if other_gap < gap:
        return other_gap, other
    return gap, face


@kernel
def is_beyond(
    ground: GroundModel, face: int, gap: float, x: float, z: float, radius: float
) -> bool:
    """Whether a point is beyond the ends of a face, the gap to whose line is given.

    One that has sunk into the bottom of a corner is beyond both.
    """
    return room_to(ground, face, x, z, radius) > abs(gap) + AS_NEAR


@kernel
def misses_corner(
    model: Model, ground: GroundModel, depth: float, contacts: Contacts, corners: Corners
) -> bool:
    """Whether a step has taken a point deeper than this into a face that it was not known to meet.

    Points fast enough go through the neighbourhood of a corner within a step.
    """
    for point in range(corners.doubled):
        if contacts.gap[point] >= ENTERS:
            continue
        x, z = center_of(model, contacts, point)
        radius = model.contact_radius[point]
        sunk = False
        if corners.second[point] == NO_FACE:
            face = nearest_face(ground, x, z, radius)
            gap, other = second_face(ground, face, NO_FACE, x, z, radius)
            sunk = is_beyond(ground, face, contacts.gap[point], x, z, radius)
        elif max(contacts.gap[point], corners.contacts.gap[point]) >= 0.0:
            gap, other = third_face(ground, point, x, z, radius, corners)
        else:
            continue
        if gap < -depth and (sunk or room_to(ground, other, x, z, radius) < ENTERS):
            return True
    return False


@kernel
def leaves(
    ground: GroundModel, point: int, x: float, z: float, radius: float, contacts: Contacts,
    corners: Corners,
) -> bool:  # fmt: skip
    """Whether a point is well away from one of its faces, and over the other."""
    first, second = corners.first[point], corners.second[point]
    far = room_to(ground, first, x, z, radius) >= LEAVES
    if far and not is_beyond(ground, second, corners.contacts.gap[point], x, z, radius):
        return True
    far = room_to(ground, second, x, z, radius) >= LEAVES
    return far and not is_beyond(ground, first, contacts.gap[point], x, z, radius)


@kernel
def exchange_sides(
    point: int, second: int, contacts: Contacts, corners: Corners, bend: Floats, forces: Floats
) -> None:
    """Let the first side of a point be its second, with its bristle and its force."""
    seconds = corners.contacts
    first, other = corners.first[point], corners.second[point]
    corners.first[point], corners.second[point] = other, first
    contacts.gap[point], seconds.gap[point] = seconds.gap[point], contacts.gap[point]
    bend[point], bend[second] = bend[second], bend[point]
    for i in range(2):
        forces[point, i], forces[second, i] = forces[second, i], forces[point, i]


@kernel
def choose_sides(
    model: Model, ground: GroundModel, contacts: Contacts, corners: Corners, bend: Floats,
    forces: Floats,
) -> None:  # fmt: skip
    """Find which points enter and leave corners, and which of their faces is the nearer, the first.

    The bends of the bristles are those now, the forces those at the beginning of the step.
    """
    for point in range(corners.doubled):
        second = corners.other[point]
        radius = model.contact_radius[point]
        x, z = center_of(model, contacts, point)
        if corners.second[point] == NO_FACE:
            if contacts.gap[point] >= ENTERS:
                continue
            face = nearest_face(ground, x, z, radius)
            gap, other = second_face(ground, face, NO_FACE, x, z, radius)
            sunk = is_beyond(ground, face, contacts.gap[point], x, z, radius)
            if gap < ENTERS and (sunk or room_to(ground, other, x, z, radius) < ENTERS):
                corners.first[point], corners.second[point] = face, other
                bend[second] = 0.0
            continue
        if corners.contacts.gap[point] < contacts.gap[point]:
            exchange_sides(point, second, contacts, corners, bend, forces)
        gap, third = third_face(ground, point, x, z, radius, corners)
        farther = corners.contacts.gap[point]
        nearer = gap < farther + (AS_NEAR if farther >= 0.0 else 0.0)
        if nearer and room_to(ground, third, x, z, radius) < ENTERS:
            # Of three faces the nearer ones are felt.
            corners.second[point] = third
            bend[second] = 0.0
        elif leaves(ground, point, x, z, radius, contacts, corners):
            bend[second] = 0.0
            corners.first[point], corners.second[point] = NO_FACE, NO_FACE


@kernel
def show_forces(forces: Floats, corners: Corners, contacts: Contacts) -> None:
    """Let controllers see the forces of the points now, of both faces where there are two."""
    copy_words(forces, contacts.force)
    for point in range(corners.doubled):
        second = corners.other[point]
        if corners.second[point] != NO_FACE:
            other = out_of_frame(
                corners.contacts.normal[point], (forces[second, 0], forces[second, 1])
            )
            press, rub = into_frame(contacts.normal[point], other)
            contacts.force[point, 0] += press
            contacts.force[point, 1] += rub


@kernel
def begin_joining(model: Model, contacts: Contacts, corners: Corners) -> None:
    """Keep the frames of the points at a sample, and forget what pushed them before."""
    for point in range(corners.doubled):
        corners.joins[point] = 0
        corners.moment[point] = 0.0
        corners.center[point, 0], corners.center[point, 1] = center_of(model, contacts, point)
        for i in range(2):
            corners.frame[point, i] = contacts.normal[point, i]
            corners.force[point, i] = 0.0


@kernel
def join(model: Model, step: float, forces: Floats, contacts: Contacts, corners: Corners) -> None:
    """Add half a step's impulse of the forces of all sides to those of both faces."""
    for point in range(corners.doubled):
        second = corners.other[point]
        radius = model.contact_radius[point]
        for side in range(2):
            force = forces[second if side == 1 else point]
            normal = corners.contacts.normal[point] if side == 1 else contacts.normal[point]
            x, z = out_of_frame(normal, (force[0], force[1]))
            corners.force[point, 0] += 0.5 * step * x
            corners.force[point, 1] += 0.5 * step * z
            corners.moment[point] += 0.5 * step * radius * force[1]
        if forces[second, 0] > 0.0 or corners.second[point] != NO_FACE:
            corners.joins[point] = 1


@kernel
def tell_resultants(model: Model, corners: Corners, impulse: Floats, place: Floats) -> None:
    """Write the impulses of both faces in the frames of the sample, and where they act.

    Where the resultant's line of action leaves the disc; that of forces that nearly cancel may miss
    it. No force acts where the frame has its contact point.
    """
    for point in range(corners.doubled):
        if corners.joins[point] == 0:
            continue
        x, z = corners.force[point, 0], corners.force[point, 1]
        impulse[point, 0], impulse[point, 1] = into_frame(corners.frame[point], (x, z))
        radius, frame = model.contact_radius[point], corners.frame[point]
        for i in range(2):
            place[point, i] = corners.center[point, i] - radius * frame[i]
        move_to_line(x, z, corners.moment[point], radius, frame, place[point])
