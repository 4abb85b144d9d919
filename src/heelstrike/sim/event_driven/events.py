"""What ended a step: touchdowns, what comes to rest, forces at their limits, ends of faces."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.kernels import momentum
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.faces import Located, locate_on_face, take_surface
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.rows import DRY_JOINT, POINT, SECOND_FACE, Rows, second_of
from heelstrike.sim.event_driven.deciding import BEGUN, ON_THE_GROUND, WALKING
from heelstrike.sim.event_driven.impact import REST, SHORTEST_BOUNCE, heading, strike
from heelstrike.sim.event_driven.location import GAP_NOISE, TOGETHER
from heelstrike.sim.event_driven.phase import Modes, Motion
from heelstrike.sim.event_driven.smooth.corners import joined
from heelstrike.sim.event_driven.smooth.faces import (
    is_at_second,
    leave_second_face,
    stand_on_face,
    turn_corner,
)
from heelstrike.sim.event_driven.smooth.gaps import gap_velocity
from heelstrike.sim.frame import DONE
from heelstrike.sim.memory import Memory, Surface
from heelstrike.sim.record.record import Record

# Feet nearer to each other than this (m) are beside each other.
BESIDE = 1e-6
# Mark of a point that touches the ground without force or speed, until it is known what happens.
UNPRESSED = 2
# Mark of one that is so near that nobody could tell, as at the top of a bounce too low to see.
LYING = 3


@kernel
def behind(point: int, direction: float, nc: int, rows: Rows, closed: Integers) -> bool:
    """Whether a point is behind one on the ground, where the rule may let it pass below.

    Feet of legs of one length reach the ground where they pass each other: a foot beside the other
    is not ahead of it, whatever rounding says.
    """
    forward = -1.0 if direction < 0.0 else 1.0
    for other in range(nc):
        ahead = rows.position[other, 0] - rows.position[point, 0]
        if closed[other] == 1 and forward * ahead > -BESIDE:
            return True
    return False


@kernel
def turns_over(
    contact: int, model: Model, ground: GroundModel, tree: Workspace, watched: int, rows: Rows,
    closed: Integers, slide: Integers, stuck: Integers, face: Integers, fired: Integers,
    surface: Surface,
) -> bool:  # fmt: skip
    """Let a point that has come to the end of its face go over to the next; tell whether it has."""
    corner = 2 * watched + contact
    if rows.kind[contact] != POINT or fired[corner] == 0:
        return False
    fired[corner] = 0
    second, located = second_of(contact, rows), Located(rows.gap, rows.position, rows.normal)
    two_faces = ground.concave == 1 and closed[second] == 1
    if two_faces and leave_second_face(
        contact, second, model, ground, tree, located, closed, slide, stuck, face, fired, surface
    ):
        return False
    if turn_corner(contact, model, ground, rows, stuck, face):
        locate_on_face(model, ground, tree, contact, face[contact], contact, rows)
        take_surface(model, ground, contact, contact, face[contact], surface)
        closed[contact] = 0
    return True


@kernel
def touches_at_start(contact: int, gap: float, rows: Rows, modes: Modes) -> bool:
    """Whether an open contact is on its limit when the run begins, and may not pass below it."""
    modes.group[contact] = contact
    if rows.kind[contact] == POINT and gap < -ON_THE_GROUND:
        modes.passing[contact] = modes.let_pass
    return bool(gap <= ON_THE_GROUND and modes.passing[contact] == 0)


@kernel
def find_what_happened(
    starting: bool, direction: float, model: Model, ground: GroundModel, tree: Workspace,
    time: float, v: Floats, last_blow: float, rows: Rows, surface: Surface, modes: Modes,
    fired: Integers, hit: Integers, accumulation: Floats,
) -> tuple[bool, bool]:  # fmt: skip
    """Tell what ended the step: whether an impact, or contact forces at their limits.

    Points that touch the ground without speed are closed, whatever ended the step, and sliding ones
    that stop are at rest; an impact goes through those that touch without force. At the start of a
    run every point near the ground touches it.
    """
    strikes = forced = False
    rest = ON_THE_GROUND if starting else REST
    for contact in range(modes.watched):
        hit[contact] = 0
        first, second = fired[2 * contact] == 1, fired[2 * contact + 1] == 1
        turns = turns_over(
            contact, model, ground, tree, modes.watched, rows, modes.closed, modes.slide,
            modes.stuck, modes.face, fired, surface,
        )  # fmt: skip
        kind = rows.kind[contact]
        if kind == SECOND_FACE:
            point = rows.owner[contact]
            if modes.closed[point] == 0 and hit[point] == 0:
                continue  # it is met from the other face only
            located = Located(rows.gap, rows.position, rows.normal)
            stand_on_face(
                point, contact, model, ground, tree, modes.closed, located, modes.face, surface
            )
            if rows.gap[contact] == np.inf:
                continue
            if starting and not is_at_second(point, model, ground, rest, rows, modes.face):
                continue
        if modes.closed[contact] == 1:
            if second and modes.slide[contact] != 0:
                for other in range(modes.watched):
                    if modes.group[other] == modes.group[contact]:
                        modes.slide[other] = 0
            elif first or second:
                forced = True
            continue
        if kind == DRY_JOINT:
            continue
        gap = rows.gap[contact]
        normal, tangent = gap_velocity(contact, model, tree, rows, v)
        if starting:
            first = touches_at_start(contact, gap, rows, modes) and normal <= rest
        may_pass = first and not starting and kind == POINT
        if turns:
            first = normal <= rest
        if modes.passing[contact] == 1:
            modes.passing[contact] = 0 if first else 1
        elif (
            may_pass
            and modes.let_pass == 1
            and behind(contact, direction, model.nc, rows, modes.closed)
        ):
            modes.passing[contact] = 1
        elif normal < -rest and (first or gap <= TOGETHER):
            hit[contact] = 1
            strikes = True
        elif first and normal <= rest:
            modes.closed[contact] = 1
            hit[contact] = UNPRESSED
            modes.slide[contact] = 0
            if abs(tangent) > rest:
                modes.slide[contact] = 1 if tangent > 0.0 else -1
            if time - last_blow < SHORTEST_BOUNCE:  # too low a bounce to be followed
                accumulation[contact] = time
        elif gap <= TOGETHER and normal <= rest:
            hit[contact] = UNPRESSED
            if abs(gap) <= GAP_NOISE and kind != SECOND_FACE:
                hit[contact] = LYING
                modes.slide[contact] = heading(tangent)
    for contact in range(modes.watched):
        if hit[contact] == LYING and not strikes:
            modes.closed[contact] = 1
        if hit[contact] >= UNPRESSED:
            hit[contact] = 1 if strikes else 0
    return strikes, forced and not strikes


@kernel
def meet_event(
    starting: bool, model: Model, ground: GroundModel, memory: Memory, work: Motion, record: Record
) -> int:
    """Deal with what ended the step: impacts change velocities, all else is left to be decided.

    The equations of now have been evaluated.
    """
    phase, step, impact, decision = work.phase, work.step, work.impact, work.decision
    tree, direction, rows, hit = memory.equations.tree, impact.momentum, memory.rows, impact.hit
    momentum(model, tree, direction)
    first, shown = record.told.events, memory.contacts.force
    strikes, forced = find_what_happened(
        starting, direction[0], model, ground, tree, step.time, step.begin[model.nq :],
        work.bounces.last_blow, rows, memory.surface, phase.modes, phase.watch.fired, hit,
        work.bounces.accumulation,
    )  # fmt: skip
    if strikes and not strike(model, ground, memory, work, record):
        decision.bridging = 1
    elif strikes:
        # The controller shall know before the modes are decided under its torques.
        for point in range(model.nc):
            if hit[point] == 1 and impact.impulse[point, 0] > 0.0:
                shown[point, 0], shown[point, 1] = joined(
                    point, second_of(point, rows), impact.impulse, rows.normal, impact.meets
                )
        react(model, first, step.begin[: model.nq], record.told, memory.loops.held)
    for point in range(model.nc):
        impact.meets[point] = 0
    decision.started = BEGUN if starting else WALKING
    decision.undecided = 1
    decision.forced = 1 if forced else 0
    return DONE
