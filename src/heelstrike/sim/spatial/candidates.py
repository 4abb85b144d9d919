"""What takes part in a step: points, stops and dry friction that could act within it, as rows.

The rows of a point are those of the body at its projection onto the ground, not at the point: of
one flat foot with unequal gaps the rows then lie in one plane, and sticking contradicts itself
nowhere.
"""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.spatial.ground import (
    BESIDE,
    SpatialGroundModel,
    distance_to_face,
    is_beside,
)
from heelstrike.contact.spatial.modes import OPEN
from heelstrike.dynamics.spatial.algebra import Vector, dot, spatial, velocity_at
from heelstrike.dynamics.spatial.configurations import turn_between
from heelstrike.dynamics.spatial.kinematics import place_of
from heelstrike.dynamics.spatial.rotations import matrix, quaternion_at
from heelstrike.dynamics.spatial.rows import (
    along_rows,
    contact_center,
    contact_frame,
    contact_point,
    whiten_rows,
    write_delassus,
    write_point_rows,
    write_velocity_row,
)
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.spatial.memory import SpatialAssembly, SpatialFeet
from heelstrike.sim.spatial.table import (
    BALL_STOP,
    DRY_JOINT,
    NEVER_TOUCHED,
    POINT,
    STOP,
    WALL,
    BlockTable,
)

CLOSING = 5.0
"""Speed (m/s) at which what closes within a step takes part; or at twice its free speed."""

FAR = 20.0
"""Steps at that speed beyond which nothing is looked at."""

CLOSING_TURN = 20.0
"""The same of joints at their stops (rad/s, m/s)."""

PARALLEL = 1.0 - 1e-9
"""Cosine of the angle below which two faces are one."""

KERB = 0.95
"""Cosine of the angle to the face below from which on a ball meets an edge as a wall."""

NO_ANGLE = 1e-12
"""Turn (rad) of a ball joint that has no axis."""


@kernel
def is_point(kind: int) -> bool:
    """Whether an entry is a contact point, at the face below it or at a wall."""
    return kind in (POINT, WALL)


@kernel
def meet_face(
    model: SpatialModel, ground: SpatialGroundModel, tree: SpatialWorkspace, contact: int,
    face: int,
) -> tuple[Vector, float, Vector]:  # fmt: skip
    """Point of a contact that comes first against a face, its gap, and the normal there.

    A sphere meets the edge of a box along the line from there to its middle, in the box as before
    it; what a rim meets is told by its lowest point.
    """
    center = contact_center(model, tree, contact)
    distance, normal = distance_to_face(ground, face, center)
    point = contact_point(model, tree, contact, normal)
    if face > 0 and model.contact_rim[contact] == 0.0:
        return point, distance - model.contact_radius[contact], normal
    gap, normal = distance_to_face(ground, face, point)
    return point, gap, normal


@kernel
def is_hidden(
    ground: SpatialGroundModel, face: int, place: Vector, depth: float, normal: Vector,
    away: Vector,
) -> bool:  # fmt: skip
    """Whether a wall that a point is in shows only within what it is deeper in.

    Lifted out of that, it meets another face of the box, or none: where two boxes of one height
    cross, their sides within each other are no walls.
    """
    gap, _ = distance_to_face(ground, face, place)
    if gap >= 0.0:  # the middle of a ball
        return False
    lifted = (
        place[0] + depth * normal[0], place[1] + depth * normal[1], place[2] + depth * normal[2]
    )  # fmt: skip
    gap, there = distance_to_face(ground, face, lifted)
    return gap > 0.0 or dot(there, away) < PARALLEL


@kernel
def wall_beside(
    model: SpatialModel, ground: SpatialGroundModel, tree: SpatialWorkspace, contact: int,
    below: int, normal: Vector, depth: float, wall: int, across: Vector,
) -> tuple[int, float, Vector]:  # fmt: skip
    """Return the nearest face that a contact meets beside others, its gap and normal.

    The others are the face below it, in which it is by a depth, and if it is not -1 a wall, with
    their normals; one parallel to either is none beside it, and neither is what a ball meets at the
    seam of a floor or wall of several boxes. -1 if there is none.
    """
    is_ball = model.contact_radius[contact] > 0.0 and model.contact_rim[contact] == 0.0
    found, least, way = -1, math.inf, normal
    for face in range(ground.half.shape[0] + 1):
        if face in (below, wall):
            continue
        point, gap, away = meet_face(model, ground, tree, contact, face)
        probe = point if model.contact_rim[contact] > 0.0 else contact_center(model, tree, contact)
        beside_both = max(dot(away, normal), dot(away, across) if wall >= 0 else -1.0)
        at_edge = is_ball and beside_both < KERB
        if face > 0 and not (at_edge or is_beside(ground, face - 1, probe)):
            continue
        if face > 0 and gap < 0.0 and depth > 0.0 and is_hidden(
            ground, face, probe, depth, normal, away
        ):  # fmt: skip
            continue
        if gap < least and beside_both < PARALLEL:
            found, least, way = face, gap, away
    return found, least, way


@kernel
def faces_of(
    model: SpatialModel, ground: SpatialGroundModel, tree: SpatialWorkspace, contact: int
) -> tuple[int, int, int]:
    """Return the face that a contact meets, and two walls beside it; -1 if there is none.

    In a corner the first is the one that points more upwards. A ball that lies on one face may meet
    the edge of another box, too, as of a kerb; rolling from box to box of one height it does not.
    """
    best, distance, normal = 0, math.inf, (0.0, 0.0, 1.0)
    for face in range(ground.half.shape[0] + 1):
        _, gap, away = meet_face(model, ground, tree, contact, face)
        if gap < distance:
            best, distance, normal = face, gap, away
    if ground.half.shape[0] == 0:
        return best, -1, -1
    wall, least, across = wall_beside(
        model, ground, tree, contact, best, normal, -distance, -1, normal
    )  # fmt: skip
    if wall < 0:
        return best, -1, -1
    other, farther, aside = wall_beside(
        model, ground, tree, contact, best, normal, -distance, wall, across
    )  # fmt: skip
    if least <= distance + BESIDE and across[2] > normal[2]:
        best, wall, normal = wall, best, across
    if other >= 0 and farther <= distance + BESIDE and aside[2] > normal[2]:
        best, other = other, best
    return best, wall, other


@kernel
def keep_foot(entry: int, point: Vector, gap: float, normal: Vector, feet: SpatialFeet) -> None:
    """Keep where the rows of an entry are taken, and their directions."""
    frame = contact_frame(normal)
    for k in range(3):
        feet.foot[entry, k] = point[k] - gap * normal[k]
    for k in range(9):
        feet.frame[entry, k] = frame[k]


@kernel
def locate_points(
    model: SpatialModel, ground: SpatialGroundModel, tree: SpatialWorkspace, table: BlockTable,
    position: Floats, normals: Floats, gaps: Floats, feet: SpatialFeet,
) -> None:  # fmt: skip
    """Find where the contact points are, and the ground that is nearest to each."""
    for contact in range(model.nc):
        face, wall, other = faces_of(model, ground, tree, contact)
        point, gap, normal = meet_face(model, ground, tree, contact, face)
        for k in range(3):
            position[contact, k] = point[k]
            normals[contact, k] = normal[k]
        if table.wall[contact] >= 0:
            entry = table.wall[contact]
            second = table.wall[entry]
            slots = contact, entry, second
            if (wall >= 0 and wall == table.face[slots[2]]) or (
                other >= 0 and other == table.face[slots[1]]
            ):
                wall, other = other, wall
            faces = face, wall, other
            for i in range(3):
                if faces[i] >= 0:
                    _, _, way = meet_face(model, ground, tree, contact, faces[i])
                    go_on_at(slots[i], faces[i], way, slots, feet, table)
            keep_faces(slots, faces, table)
            locate_wall(model, ground, tree, contact, wall, entry, table, feet)
            locate_wall(model, ground, tree, contact, other, second, table, feet)
        keep_foot(contact, point, gap, normal, feet)
        gaps[contact] = gap
        table.gap[contact] = gap
        table.friction[contact] = model.friction_scale[contact] * ground.friction[face]
        bounces = model.restitution_scale[contact] * ground.restitution[face]
        table.restitution[contact] = min(bounces, 1.0)


@kernel
def go_on_at(
    entry: int, face: int, normal: Vector, slots: tuple[int, int, int], feet: SpatialFeet,
    table: BlockTable,
) -> None:  # fmt: skip
    """Let an entry go on at a face that its point was not at before, if it goes the same way.

    So does a point that moves from one box to the next in one floor or wall.
    """
    for i in range(3):
        if table.face[slots[i]] == face:
            return
    before = feet.frame[entry, 0], feet.frame[entry, 1], feet.frame[entry, 2]
    if table.face[entry] >= 0 and dot(before, normal) >= PARALLEL:
        table.face[entry] = face


@kernel
def keep_faces(
    entries: tuple[int, int, int], faces: tuple[int, int, int], table: BlockTable
) -> None:
    """Let what is kept of entries of one point go with its faces; of new faces nothing is known."""
    for i in range(3):
        for j in range(3):
            one, two = entries[i], entries[j]
            if faces[i] >= 0 and table.face[one] != faces[i] and table.face[two] == faces[i]:
                table.face[one], table.face[two] = table.face[two], table.face[one]
                table.mode[one], table.mode[two] = table.mode[two], table.mode[one]
                touched = table.touching[one]
                table.touching[one], table.touching[two] = table.touching[two], touched
                for k in range(3):
                    impulse = table.impulse[one, k]
                    table.impulse[one, k], table.impulse[two, k] = table.impulse[two, k], impulse
    for i in range(3):
        one = entries[i]
        if table.face[one] != faces[i]:
            table.face[one], table.mode[one] = faces[i], OPEN
            table.touching[one] = NEVER_TOUCHED
            for k in range(3):
                table.impulse[one, k] = 0.0


@kernel
def locate_wall(
    model: SpatialModel, ground: SpatialGroundModel, tree: SpatialWorkspace, contact: int,
    wall: int, entry: int, table: BlockTable, feet: SpatialFeet,
) -> None:  # fmt: skip
    """Find how far a contact point is from a wall beside it, infinitely if there is none."""
    table.gap[entry] = math.inf
    if wall < 0:
        return
    point, gap, normal = meet_face(model, ground, tree, contact, wall)
    keep_foot(entry, point, gap, normal, feet)
    table.gap[entry] = gap
    table.friction[entry] = model.friction_scale[contact] * ground.friction[wall]
    table.restitution[entry] = min(model.restitution_scale[contact] * ground.restitution[wall], 1.0)


@kernel
def locate_ends(model: SpatialModel, q: Floats, table: BlockTable) -> None:
    """Find how far joints are from the ends of their ranges."""
    for entry in range(table.kind.shape[0]):
        joint = table.owner[entry]
        if table.kind[entry] == STOP:
            limit = model.lower[joint] if table.side[entry] > 0.0 else model.upper[joint]
            table.gap[entry] = table.side[entry] * (q[model.first_position[joint]] - limit)
        elif table.kind[entry] == BALL_STOP:
            x, y, z = turn_of_ball(model, joint, q)
            table.gap[entry] = model.upper[joint] - math.sqrt(x * x + y * y + z * z)


@kernel
def turn_of_ball(model: SpatialModel, joint: int, q: Floats) -> tuple[float, float, float]:
    """Rotation vector of a ball joint from where it has not turned, in body axes."""
    own = quaternion_at(q, model.first_position[joint])
    return turn_between((1.0, 0.0, 0.0, 0.0), own)


@kernel
def normal_speed(
    model: SpatialModel, tree: SpatialWorkspace, contact: int, entry: int, feet: SpatialFeet,
    v: Floats,
) -> float:  # fmt: skip
    """Normal velocity of a contact point, to the face of an entry, at some velocities."""
    foot = feet.foot[entry, 0], feet.foot[entry, 1], feet.foot[entry, 2]
    normal = feet.frame[entry, 0], feet.frame[entry, 1], feet.frame[entry, 2]
    place = place_of(tree, foot)
    last = model.last_velocity[model.contact_link[contact]]
    speed = 0.0
    for a in range(model.depth[last] + 1):
        k = model.chain[last, a]
        speed += dot(normal, velocity_at(spatial(tree.motion, k), place)) * v[k]
    return speed


@kernel
def ball_speed(model: SpatialModel, joint: int, q: Floats, v: Floats) -> float:
    """How fast a ball joint comes away from its stop."""
    x, y, z = turn_of_ball(model, joint, q)
    length = math.sqrt(x * x + y * y + z * z)
    if length < NO_ANGLE:
        return 0.0
    k = model.first_velocity[joint]
    return -(x * v[k] + y * v[k + 1] + z * v[k + 2]) / length


@kernel
def entry_speed(
    model: SpatialModel, tree: SpatialWorkspace, entry: int, table: BlockTable, feet: SpatialFeet,
    q: Floats, v: Floats,
) -> float:  # fmt: skip
    """How fast the gap of an entry opens at some velocities."""
    owner = table.owner[entry]
    if is_point(table.kind[entry]):
        return normal_speed(model, tree, owner, entry, feet, v)
    if table.kind[entry] == STOP:
        return table.side[entry] * v[model.first_velocity[owner]]
    return ball_speed(model, owner, q, v)


@kernel
def is_far(step: float, entry: int, table: BlockTable) -> bool:
    """Whether something is too far away to be looked at: 100 m/s would not bring it there."""
    closing = CLOSING if is_point(table.kind[entry]) else CLOSING_TURN
    return table.gap[entry] > FAR * closing * step


@kernel
def could_act(
    model: SpatialModel, step: float, tree: SpatialWorkspace, entry: int, table: BlockTable,
    feet: SpatialFeet, q: Floats, v: Floats,
) -> bool:  # fmt: skip
    """Whether something could act within a step."""
    if table.kind[entry] == DRY_JOINT or table.called[entry] == 1:
        return True
    gap = table.gap[entry]
    if gap <= step * (CLOSING if is_point(table.kind[entry]) else CLOSING_TURN):
        return True
    if is_far(step, entry, table):
        return False
    return gap + 2.0 * step * entry_speed(model, tree, entry, table, feet, q, v) < 0.0


@kernel
def list_candidates(
    model: SpatialModel, step: float, tree: SpatialWorkspace, table: BlockTable,
    feet: SpatialFeet, q: Floats, v: Floats, assembly: SpatialAssembly,
) -> None:  # fmt: skip
    """List what could act within a step at the free velocity v, with where its rows begin."""
    count = rows = 0
    problem = assembly.problem
    for entry in range(table.kind.shape[0]):
        if not could_act(model, step, tree, entry, table, feet, q, v):
            continue
        assembly.candidate[count] = entry
        assembly.last[count] = table.last[entry]
        problem.first[count] = rows
        problem.set[count] = table.set[entry]
        problem.friction[count] = table.friction[entry]
        problem.bound[count] = 0.0
        if table.kind[entry] == DRY_JOINT:
            problem.bound[count] = step * model.dry_friction[table.owner[entry]]
        rows += table.size[entry]
        count += 1
    problem.first[count] = rows
    problem.count = count
    assembly.count = count
    begin_as_before(table, assembly)


@kernel
def begin_as_before(table: BlockTable, assembly: SpatialAssembly) -> None:
    """Let the candidates begin with modes and impulses of the last step."""
    answer, first = assembly.answer, assembly.problem.first
    for place in range(assembly.count):
        entry = assembly.candidate[place]
        answer.mode[place] = table.mode[entry]
        for i in range(table.size[entry]):
            answer.impulse[first[place] + i] = table.impulse[entry, i]


@kernel
def write_rows_of(
    model: SpatialModel, tree: SpatialWorkspace, entry: int, first: int, table: BlockTable,
    feet: SpatialFeet, q: Floats, rows: Floats,
) -> None:  # fmt: skip
    """Write the rows of an entry along its chain."""
    owner = table.owner[entry]
    if is_point(table.kind[entry]):
        foot = feet.foot[entry, 0], feet.foot[entry, 1], feet.foot[entry, 2]
        frame = matrix(feet.frame, entry)
        write_point_rows(model, tree, model.contact_link[owner], foot, frame, first, rows)
    elif table.kind[entry] == STOP:
        write_velocity_row(model, model.first_velocity[owner], table.side[entry], first, rows)
    elif table.kind[entry] == DRY_JOINT:
        write_velocity_row(model, owner, 1.0, first, rows)
    else:
        x, y, z = turn_of_ball(model, owner, q)
        length = max(math.sqrt(x * x + y * y + z * z), NO_ANGLE)
        last = table.last[entry]
        write_velocity_row(model, last, -z / length, first, rows)
        depth = model.depth[last]
        rows[first, depth - 1] = -y / length
        rows[first, depth - 2] = -x / length


@kernel
def assemble(
    model: SpatialModel, step: float, table: BlockTable, feet: SpatialFeet, q: Floats, v: Floats,
    next_v: Floats, tree: SpatialWorkspace, factor: TreeFactor, count: int, candidate: Integers,
    first_row: Integers, chain_end: Integers, rows: Floats, free: Floats, before: Floats,
) -> None:  # fmt: skip
    """Write the rows of the candidates, whitened, and free velocities with gaps over the step.

    v is the velocity as the step begins, next_v the free one at its end; `chain_end` is the last
    velocity of the chain of each candidate. Receives the normal velocities `before`.
    """
    for place in range(count):
        entry = candidate[place]
        first, last = first_row[place], chain_end[place]
        size = first_row[place + 1] - first
        write_rows_of(model, tree, entry, first, table, feet, q, rows)
        if table.kind[entry] == DRY_JOINT:
            before[place], free[first] = v[last], next_v[last]
        else:
            along_rows(model, last, first, 1, rows, v, free)
            before[place] = free[first]
            along_rows(model, last, first, size, rows, next_v, free)
            free[first] += table.gap[entry] / step
        whiten_rows(model, factor, last, first, size, rows)


@kernel
def complete(model: SpatialModel, assembly: SpatialAssembly) -> None:
    """Write the Delassus matrix of the problem, unless it is there."""
    if assembly.complete == 0:
        first, rows = assembly.problem.first, assembly.rows
        write_delassus(
            model, assembly.count, first, assembly.last, rows, assembly.problem.delassus
        )  # fmt: skip
        assembly.complete = 1
