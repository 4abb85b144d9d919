"""What ended a step: touchdowns, what comes to rest, forces at their limits, ends of faces."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.dynamics.kernels import momentum
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Integers, Model
from heelstrike.sim.contacts.faces import locate_on_face, take_surface
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.rows import (
    DRY_JOINT,
    POINT,
    SECOND_FACE,
    Rows,
    second_of,
)
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.deciding import BEGUN, ON_THE_GROUND, WALKING
from heelstrike.sim.event_driven.impact import REST, SHORTEST_BOUNCE, heading, strike
from heelstrike.sim.event_driven.location import GAP_NOISE, TOGETHER
from heelstrike.sim.event_driven.phase import Bounces, Decision, Faces, Impact, Modes, Phase, Step
from heelstrike.sim.event_driven.smooth.corners import impulse_of
from heelstrike.sim.event_driven.smooth.faces import (
    is_at_second,
    leave_second_face,
    stand_on_face,
    turn_corner,
)
from heelstrike.sim.event_driven.smooth.gaps import gap_now, gap_velocity
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
def behind(contact: int, direction: float, contacts: Contacts, modes: Modes) -> bool:
    """Whether a point is behind one on the ground and, by the rule, may pass below it.

    Feet of legs of one length reach the ground where they pass each other: a foot beside the other
    is not ahead of it, whatever rounding says.
    """
    forward = -1.0 if direction < 0.0 else 1.0
    for other in range(contacts.gap.shape[0]):
        ahead = contacts.position[other, 0] - contacts.position[contact, 0]
        if modes.closed[other] == 1 and forward * ahead > -BESIDE:
            return modes.let_pass == 1
    return False


@kernel
def turns_over(
    model: Model, ground: GroundModel, tree: Workspace, contact: int, rows: Rows,
    contacts: Contacts, surface: Surface, seconds: Contacts, modes: Modes, faces: Faces,
    fired: Integers,
) -> bool:  # fmt: skip
    """Let a point that has come to the end of its face go over to the next; tell whether it has."""
    if rows.kind[contact] != POINT or fired[2 * modes.watched + contact] == 0:
        return False
    fired[2 * modes.watched + contact] = 0
    two_faces = faces.paired == 1 and modes.closed[second_of(contact, rows)]
    if two_faces and leave_second_face(
        model, ground, tree, contact, contacts, rows, surface, seconds, modes, faces.face, fired
    ):
        return False
    if turn_corner(model, ground, contact, contacts, modes.stuck, faces):
        face = faces.face[contact]
        locate_on_face(model, ground, tree, contact, face, contacts)
        take_surface(model, ground, contact, contact, face, surface)
        modes.closed[contact] = 0
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
    rows: Rows, step: Step, contacts: Contacts, surface: Surface, seconds: Contacts, phase: Phase,
    hit: Integers, bounces: Bounces,
) -> tuple[bool, bool]:  # fmt: skip
    """Tell what ended the step: whether an impact, or contact forces at their limits.

    Points that touch the ground without speed are closed, whatever ended the step, and sliding ones
    that stop are at rest; an impact goes through those that touch without force. At the start of a
    run every point near the ground touches it.
    """
    modes, watch = phase.modes, phase.watch
    strikes = False
    forced = False
    rest = ON_THE_GROUND if starting else REST
    for contact in range(modes.watched):
        hit[contact] = 0
        first = watch.fired[2 * contact] == 1
        second = watch.fired[2 * contact + 1] == 1
        turns = turns_over(
            model, ground, tree, contact, rows, contacts, surface, seconds, modes, phase.faces,
            watch.fired,
        )  # fmt: skip
        kind = rows.kind[contact]
        if kind == SECOND_FACE:
            point = rows.owner[contact]
            if modes.closed[point] == 0 and hit[point] == 0:
                continue  # it is met from the other face only
            stand_on_face(
                model, ground, tree, point, contacts, rows, modes.closed, surface, seconds,
                phase.faces,
            )  # fmt: skip
            if seconds.gap[point] == np.inf:
                continue
            if starting and not is_at_second(
                model, ground, point, rest, contacts, rows, phase.faces
            ):
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
        gap = gap_now(contact, rows, step.begin)
        normal, tangent = gap_velocity(contact, model, contacts, tree, rows, seconds, step.begin)
        if starting:
            first = touches_at_start(contact, gap, rows, modes) and normal <= rest
        may_pass = first and not starting and kind == POINT
        if turns:
            first = normal <= rest
        if modes.passing[contact] == 1:
            modes.passing[contact] = 0 if first else 1
        elif may_pass and behind(contact, direction, contacts, modes):
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
            if step.time - bounces.last_blow < SHORTEST_BOUNCE:  # too low a bounce to be followed
                bounces.accumulation[contact] = step.time
        elif gap <= TOGETHER and normal <= rest:
            hit[contact] = UNPRESSED
            if abs(gap) <= GAP_NOISE and rows.kind[contact] != SECOND_FACE:
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
    starting: bool, model: Model, ground: GroundModel, memory: Memory, phase: Phase, step: Step,
    impact: Impact, bounces: Bounces, decision: Decision, record: Record,
) -> int:  # fmt: skip
    """Deal with what ended the step: impacts change velocities, all else is left to be decided.

    The equations of now have been evaluated.
    """
    contacts, tree, direction = memory.contacts, memory.equations.tree, impact.momentum
    momentum(model, tree, direction)
    first = record.events
    strikes, forced = find_what_happened(
        starting, direction[0], model, ground, tree, memory.rows, step, contacts, memory.surface,
        memory.seconds, phase, impact.hit, bounces,
    )  # fmt: skip
    if strikes and not strike(model, ground, memory, phase, step, impact, bounces, record):
        decision.bridging = 1
    elif strikes:
        # The controller shall know before the modes are decided under its torques.
        for contact in range(model.nc):
            if impact.hit[contact] == 1 and impact.impulse[contact, 0] > 0.0:
                force = impulse_of(
                    contact, contacts, memory.rows, memory.seconds, phase.faces.paired, impact
                )
                contacts.force[contact, 0], contacts.force[contact, 1] = force
        react(model, first, step.begin[: model.nq], record, memory.loops)
    for point in range(impact.meets.shape[0]):
        impact.meets[point] = 0
    decision.started = BEGUN if starting else WALKING
    decision.undecided = 1
    decision.forced = 1 if forced else 0
    return DONE
