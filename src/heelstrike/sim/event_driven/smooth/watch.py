"""Event functions of a state: gaps, speeds of what slides, forces, what is left to limits."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, POINT, SECOND_FACE, STOP, Rows
from heelstrike.sim.contacts.writers import rate_of
from heelstrike.sim.event_driven.phase import Modes, Watch
from heelstrike.sim.event_driven.smooth.faces import has_corners, watch_corners
from heelstrike.sim.event_driven.smooth.gaps import gap_velocity
from heelstrike.sim.memory import Assembly


@dissolved_kernel
def friction_limit(
    leader: int, first: int, count: int, assembly: Assembly, friction: Floats, group: Integers
) -> float:
    """Largest tangential force of a group, under its normal forces."""
    limit = 0.0
    for place in range(first, count):
        contact = assembly.candidate[place]
        if group[contact] == leader:
            normal = assembly.answer.impulse[assembly.problem.first[place]]
            limit += friction[contact] * normal
    return limit


@kernel
def watch_faces(
    kind: int, model: Model, cornered: bool, tree: Workspace, v: Floats, rows: Rows,
    closed: Integers, passing: Integers, slide: Integers, group: Integers, value: Floats,
    rate: Floats,
) -> None:  # fmt: skip
    """Event functions of the contact points on their first or their second faces.

    Second faces are there for points on the ground, with those that they could meet. That of a
    point that is let pass below the ground is its depth. On ground with corners (it is `cornered`)
    the second rate of an open point bounds how fast it moves, or the centre of its disc.
    """
    first = kind == POINT
    for entry in range(rows.first[kind], rows.end[kind]):
        point = rows.owner[entry]
        value[2 * entry + 1] = 1.0
        if not first:
            value[2 * entry], rate[2 * entry] = 1.0, 0.0
            if closed[point] == 0 or rows.gap[entry] == math.inf:
                continue
        normal, tangent = gap_velocity(entry, model, tree, rows, v)
        if closed[entry] == 0:
            side = 1.0 - 2.0 * passing[entry]
            value[2 * entry] = side * rows.gap[entry]
            rate[2 * entry] = side * normal
            if first and cornered:
                spin = tree.velocity[model.contact_link[point], 0]
                rolls = abs(model.contact_radius[point] * spin)
                rate[2 * entry + 1] = abs(normal) + abs(tangent) + rolls
        elif slide[entry] != 0 and group[entry] == entry:
            value[2 * entry + 1] = slide[entry] * tangent


@kernel
def watch_geometry(
    model: Model, ground: GroundModel, tree: Workspace, v: Floats, rows: Rows, watched: int,
    closed: Integers, passing: Integers, slide: Integers, group: Integers, face: Integers,
    value: Floats, rate: Floats,
) -> None:  # fmt: skip
    """Event functions that need no forces: gaps of open points, speeds of what slides, corners."""
    cornered = has_corners(ground)
    if cornered:
        watch_corners(model, ground, rows, watched, closed, face, value)
        if ground.concave == 1:
            watch_faces(
                SECOND_FACE, model, cornered, tree, v, rows, closed, passing, slide, group, value,
                rate,
            )  # fmt: skip
    for contact in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        value[2 * contact + 1] = 1.0
        if slide[contact] != 0:
            value[2 * contact + 1] = slide[contact] * v[rows.owner[contact]]
    for contact in range(rows.first[STOP], rows.end[STOP]):
        if closed[contact] == 0:
            value[2 * contact] = rows.gap[contact]
            rate[2 * contact] = rows.side[contact] * v[rows.owner[contact]]
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        if closed[entry] == 0:
            value[2 * entry] = rows.gap[entry]
            rate[2 * entry] = rate_of(rows.owner[entry], 0, v, rows.outside)
    watch_faces(POINT, model, cornered, tree, v, rows, closed, passing, slide, group, value, rate)


@dissolved_kernel
def watch_forces(
    count: int, total: int, assembly: Assembly, friction: Floats, modes: Modes, watch: Watch
) -> None:
    """Event functions of closed points: normal forces, and what is left to the friction limit."""
    delassus, free, first = assembly.problem.delassus, assembly.problem.free, assembly.problem.first
    impulse = assembly.answer.impulse
    for place in range(count):
        contact, normal = assembly.candidate[place], first[place]
        watch.value[2 * contact] = 1.0
        if modes.carrier[contact] == 1:
            watch.value[2 * contact] = impulse[normal]
        if modes.holder[contact] == 1:
            limit = friction_limit(contact, 0, count, assembly, friction, modes.group)
            watch.value[2 * contact + 1] = limit - abs(impulse[normal + 1])
        elif modes.slide[contact] != 0 and modes.group[contact] == contact:
            acceleration = free[normal + 1]
            for column in range(first[total]):
                acceleration += delassus[normal + 1, column] * impulse[column]
            watch.rate[2 * contact + 1] = modes.slide[contact] * acceleration


@dissolved_kernel
def trust_latches(held: Integers, rows: Rows, closed: Integers, value: Floats) -> None:
    """Stops that hold their joint never open, whatever the sign of their force."""
    for latch in range(held.shape[0]):
        stop = rows.latch_stop[latch]
        if held[latch] == 1 and closed[stop] == 1:
            value[2 * stop] = 1.0


@kernel
def watch_slips(count: int, assembly: Assembly, modes: Modes, rate: Floats) -> None:
    """Rates of the sliding speeds, after :func:`hold_by_saddle_point`."""
    for place in range(count):
        contact = assembly.candidate[place]
        if modes.slide[contact] != 0 and modes.group[contact] == contact:
            acceleration = assembly.answer.velocity[assembly.problem.first[place] + 1]
            rate[2 * contact + 1] = modes.slide[contact] * acceleration
