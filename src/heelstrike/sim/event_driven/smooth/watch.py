"""Event functions of a state: gaps, speeds of what slides, forces, what is left to limits."""

from __future__ import annotations

import math

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.geometry import (
    contact_velocity,
)
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, SECOND_FACE, STOP, Rows
from heelstrike.sim.contacts.writers import rate_of
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.phase import Faces, Modes, Watch
from heelstrike.sim.event_driven.smooth.faces import has_corners, watch_corners
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
            limit += friction[contact] * assembly.answer.impulse[2 * place]
    return limit


@kernel
def watch_second_faces(
    model: Model, tree: Workspace, rows: Rows, seconds: Contacts, modes: Modes, watch: Watch
) -> None:
    """Event functions of the second faces: gaps to those that points on the ground could meet."""
    value, rate = watch.value, watch.rate
    for contact in range(rows.first[SECOND_FACE], rows.end[SECOND_FACE]):
        point = rows.owner[contact]
        value[2 * contact], value[2 * contact + 1] = 1.0, 1.0
        rate[2 * contact] = 0.0
        if modes.closed[point] == 0 or seconds.gap[point] == math.inf:
            continue
        normal, tangent = contact_velocity(model, tree, seconds, point)
        if modes.closed[contact] == 0:
            value[2 * contact] = seconds.gap[point]
            rate[2 * contact] = normal
        elif modes.slide[contact] != 0 and modes.group[contact] == contact:
            value[2 * contact + 1] = modes.slide[contact] * tangent


@kernel
def watch_geometry(
    model: Model, ground: GroundModel, tree: Workspace, contacts: Contacts, state: Floats,
    rows: Rows, seconds: Contacts, modes: Modes, faces: Faces, watch: Watch,
) -> None:  # fmt: skip
    """Event functions that need no forces: gaps of open points, speeds of what slides, corners.

    That of a point that is let pass below the ground is its depth. On ground with corners the
    second rate of an open point bounds how fast it moves, or the centre of its disc.
    """
    value, rate, corners = watch.value, watch.rate, has_corners(ground)
    if corners:
        watch_corners(model, ground, contacts, rows, modes, faces, value)
        if faces.paired == 1:
            watch_second_faces(model, tree, rows, seconds, modes, watch)
    table = rows
    for contact in range(table.first[DRY_JOINT], table.end[DRY_JOINT]):
        slide = modes.slide[contact]
        value[2 * contact + 1] = 1.0
        if slide != 0:
            value[2 * contact + 1] = slide * state[model.nq + table.owner[contact]]
    for contact in range(table.first[STOP], table.end[STOP]):
        if modes.closed[contact] == 0:
            joint, side = table.owner[contact], table.side[contact]
            value[2 * contact] = side * (state[joint] - table.limit[contact])
            rate[2 * contact] = side * state[model.nq + joint]
    for contact in range(table.first[CONSTRAINT], table.end[CONSTRAINT]):
        if modes.closed[contact] == 0:
            value[2 * contact] = table.gap[contact]
            rate[2 * contact] = rate_of(table.owner[contact], 0, state[model.nq :], table.outside)
    for contact in range(model.nc):
        normal, tangent = contact_velocity(model, tree, contacts, contact)
        value[2 * contact + 1] = 1.0
        if modes.closed[contact] == 0:
            side = 1.0 - 2.0 * modes.passing[contact]
            value[2 * contact] = side * contacts.gap[contact]
            rate[2 * contact] = side * normal
            if corners:
                spin = tree.velocity[model.contact_link[contact], 0]
                rolls = abs(model.contact_radius[contact] * spin)
                rate[2 * contact + 1] = abs(normal) + abs(tangent) + rolls
        elif modes.slide[contact] != 0 and modes.group[contact] == contact:
            value[2 * contact + 1] = modes.slide[contact] * tangent


@dissolved_kernel
def watch_forces(
    count: int, loop_rows: int, assembly: Assembly, friction: Floats, modes: Modes, watch: Watch
) -> None:
    """Event functions of closed points: normal forces, and what is left to the friction limit."""
    delassus, free = assembly.problem.delassus, assembly.problem.free
    impulse = assembly.answer.impulse
    for place in range(count):
        contact = assembly.candidate[place]
        watch.value[2 * contact] = 1.0
        if modes.carrier[contact] == 1:
            watch.value[2 * contact] = impulse[2 * place]
        if modes.holder[contact] == 1:
            limit = friction_limit(contact, 0, count, assembly, friction, modes.group)
            watch.value[2 * contact + 1] = limit - abs(impulse[2 * place + 1])
        elif modes.slide[contact] != 0 and modes.group[contact] == contact:
            acceleration = free[2 * place + 1]
            for column in range(2 * (count + loop_rows)):
                acceleration += delassus[2 * place + 1, column] * impulse[column]
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
            acceleration = assembly.answer.velocity[2 * place + 1]
            rate[2 * contact + 1] = modes.slide[contact] * acceleration
