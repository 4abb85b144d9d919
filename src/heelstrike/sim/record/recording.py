"""What every simulation method does around its step: events, rows and worst values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from heelstrike.compiler.compilation import dissolved_kernel, kernel, rare_kernel
from heelstrike.compiler.words import bits_of, stay_below, word_at
from heelstrike.contact.ground import GroundModel, ground_height
from heelstrike.contact.sets import INTERVAL
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.geometry import contact_velocity
from heelstrike.sim.contacts.rows import CONSTRAINT, DRY_JOINT, Rows
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Reaction, Reported, Tally
from heelstrike.sim.record.record import RowsAndEvents, Told
from heelstrike.sim.run import QUANTITIES, Quantity
from heelstrike.tolerances import STANDING_SPEED

TOUCHDOWN = int(EventKind.TOUCHDOWN)
LIFTOFF = int(EventKind.LIFTOFF)
SLIP = int(EventKind.SLIP)
STICK = int(EventKind.STICK)
JOINT_STOP = int(EventKind.JOINT_STOP)
JOINT_SLIP = int(EventKind.JOINT_SLIP)
JOINT_STICK = int(EventKind.JOINT_STICK)
CONSTRAINT_HOLDS = int(EventKind.CONSTRAINT_HOLDS)
CONSTRAINT_LETS_GO = int(EventKind.CONSTRAINT_LETS_GO)

# A contact point has left the ground when its gap exceeds this (m), and slips above this (m/s).
LIFTOFF_GAP = 1e-7
SLIP_SPEED = 1e-6


FARTHEST, FASTEST = 1e9, 1e6
"""Coordinate (m, rad) and velocity (m/s, rad/s) of a robot that has diverged: no digit of a
millimetre is left of the one, and no step is as short as the other asks for."""
FARTHEST_BITS, FASTEST_BITS = bits_of(FARTHEST), bits_of(FASTEST)


@dissolved_kernel
def note_extremes(gap: Floats, residual: Floats, tally: Tally) -> None:
    """Keep the worst penetration of the contact points and the worst residuals of the run."""
    deepest = tally.penetration
    for contact in range(gap.shape[0]):
        deepest = max(deepest, -gap[contact])
    tally.penetration = deepest
    note_residual(residual, tally)


@kernel
def note_residual(residual: Floats, tally: Tally) -> None:
    """Keep the worst residuals of the run."""
    tally.complementarity = max(tally.complementarity, residual[0])
    tally.cone = max(tally.cone, residual[1])
    tally.non_penetration = max(tally.non_penetration, residual[2])


@rare_kernel
def log_event(
    time: float, kind: int, place: int, normal: float, tangent: float, told: Told
) -> None:
    """Append an event of a contact point or joint, with its impulse."""
    event = told.events
    told.event_time[event] = time
    told.event_kind[event] = kind
    told.event_contact[event] = place
    told.event_impulse[event, 0] = normal
    told.event_impulse[event, 1] = tangent
    told.events = event + 1


@kernel
def note_event(
    time: float, kind: int, contact: int, step: float, force: Floats, told: Told
) -> None:
    """Append an event of a contact point; its impulse is that of the step it happened in."""
    log_event(time, kind, contact, force[contact, 0] * step, force[contact, 1] * step, told)


@dissolved_kernel
def note_events(
    model: Model, time: float, end: float, step: float, steps: int, q: Floats, v: Floats,
    next_v: Floats, breakaway: Floats, tree: Workspace, contacts: Contacts, reaction: Reaction,
    constraint_force: Floats, rows: Rows, told: Told, reported: Reported,
) -> None:  # fmt: skip
    """Find touchdowns, lift-offs and changes between stick and slip of this step.

    It ends at `end`, which is the `time` of the next step to the last bit: what a step ends with
    comes before what the next begins with. An impulse closes a contact by the end of the step; a
    gap opens it at the start of a step. Points that already stand on the ground when the run begins
    do not touch down, and joints that rest at a stop do not reach it: `steps` is how many came
    before. Joints with dry friction come to rest, or begin to move.
    """
    for contact in range(model.contact_link.shape[0]):
        note_events_of_contact(
            model, time, end, step, steps, contact, tree, contacts, reaction.slip, told, reported
        )
    held = 0
    for joint in range(model.parent.shape[0]):  # all at once, since none is as a rule
        held |= word_at(reaction.stop_torque, joint) | reported.stopped[joint]
    for joint in range(model.parent.shape[0] if held != 0 else 0):
        torque = reaction.stop_torque[joint]
        if torque != 0.0 or reported.stopped[joint] != 0:
            note_stop(model, end, step, steps, joint, torque, q, v, told, reported.stopped)
    if constraint_force.shape[0] > 0:
        note_constraints(time, end, step, steps, constraint_force, rows, told, reported.closed)
    note_dry_joints(end, v, next_v, breakaway, rows, told, reported.resting)


@dissolved_kernel
def note_events_of_contact(
    model: Model, time: float, end: float, step: float, steps: int, contact: int, tree: Workspace,
    contacts: Contacts, slip: Floats, told: Told, reported: Reported,
) -> None:  # fmt: skip
    """Find what happened to a contact point in this step."""
    force, gap = contacts.force, contacts.gap[contact]
    closed, slipping = reported.closed, reported.slipping
    pushed = force[contact, 0] > 0.0
    if closed[contact] == 0 and pushed:
        closed[contact] = 1
        slipping[contact] = 0
        stood = steps == 0 and gap <= LIFTOFF_GAP
        if stood:
            normal, _ = contact_velocity(model, tree, contacts, contact)
            stood = normal >= -STANDING_SPEED
        if not stood:
            note_event(end, TOUCHDOWN, contact, step, force, told)
    elif closed[contact] == 1 and not pushed and gap > LIFTOFF_GAP:
        closed[contact] = 0
        slipping[contact] = 0
        note_event(time, LIFTOFF, contact, step, force, told)
    if closed[contact] == 1 and pushed:
        slips = abs(slip[contact]) > SLIP_SPEED
        if slips != (slipping[contact] == 1):
            slipping[contact] = 1 if slips else 0
            note_event(end, SLIP if slips else STICK, contact, step, force, told)


@dissolved_kernel
def note_stop(
    model: Model, end: float, step: float, steps: int, joint: int, torque: float, q: Floats,
    v: Floats, told: Told, stopped: Integers,
) -> None:  # fmt: skip
    """Find whether a joint reached a stop in this step, or left it."""
    way = min(q[joint] - model.lower[joint], model.upper[joint] - q[joint])
    stood = steps == 0 and way <= LIFTOFF_GAP and abs(v[joint]) <= STANDING_SPEED
    if torque != 0.0 and stopped[joint] == 0 and not stood:
        log_event(end, JOINT_STOP, joint, abs(torque) * step, 0.0, told)
    if torque != 0.0:
        stopped[joint] = 1
    elif way > LIFTOFF_GAP:
        stopped[joint] = 0


@dissolved_kernel
def note_constraints(
    time: float, end: float, step: float, steps: int, forces: Floats, rows: Rows, told: Told,
    closed: Integers,
) -> None:  # fmt: skip
    """Find which constraints from outside took hold in this step, or let go."""
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        number, gap = rows.owner[entry], rows.gap[entry]
        force = forces[number]
        if rows.set[entry] == INTERVAL:
            continue
        if closed[entry] == 0 and force[0] > 0.0:
            closed[entry] = 1
            if steps > 0 or gap > LIFTOFF_GAP:
                log_event(end, CONSTRAINT_HOLDS, number, step * force[0], step * force[1], told)
        elif closed[entry] == 1 and force[0] == 0.0 and gap > LIFTOFF_GAP:
            closed[entry] = 0
            log_event(time, CONSTRAINT_LETS_GO, number, 0.0, 0.0, told)


@dissolved_kernel
def note_dry_joints(
    end: float, v: Floats, next_v: Floats, breakaway: Floats, rows: Rows, told: Told,
    resting: Integers,
) -> None:  # fmt: skip
    """Find which joints with dry friction came to rest in this step, or began to move."""
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        joint = rows.owner[dry]
        if breakaway[joint] == 0.0:
            continue
        rests = abs(next_v[joint]) <= SLIP_SPEED
        if resting[dry] == -1:
            resting[dry] = 1 if abs(v[joint]) <= SLIP_SPEED else 0
        if rests != (resting[dry] == 1):
            log_event(end, JOINT_STICK if rests else JOINT_SLIP, joint, 0.0, 0.0, told)
            resting[dry] = 1 if rests else 0


def row_writer(
    quantities: Mapping[str, Quantity], module: str
) -> Callable[[float, Any, Any], None]:
    """Make the kernel `note_row` of a module, which writes rows: a loop for each quantity."""
    lines = [
        "def note_row(time, memory, record):",
        " row = record.rows",
        " record.time[row] = time",
    ]
    for name, quantity in quantities.items():
        indices = ["i", "j"][: len(quantity.shape)]
        for depth, index in enumerate(indices):
            extent = f"record.{name}.shape[{depth + 1}]"
            lines.append(f"{' ' * (depth + 1)}for {index} in range({extent}):")
        place = ", ".join(indices)
        its = f"memory.{quantity.of}[{place}]" if place else f"memory.{quantity.of}"
        copy = f"record.{name}[{', '.join(['row', *indices])}] = {its}"
        lines.append(" " * (len(indices) + 1) + copy)
    scope: dict[str, Any] = {"__name__": module}
    exec("\n".join([*lines, " record.rows = row + 1"]), scope)
    scope["note_row"].__doc__ = "Append what acts now, of every recorded quantity, to the record."
    return dissolved_kernel(scope["note_row"])


note_row = row_writer(QUANTITIES, __name__)


@dissolved_kernel
def note_log(kept: Integers, logged: Integers, record: RowsAndEvents) -> None:
    """Write to the rows that have none as yet what the controller logged last."""
    for row in range(record.logged, record.rows):
        for i in range(logged.shape[0]):
            record.log[row, i] = kept[logged[i]]
    record.logged = record.rows


def when_due(note_row: Callable[[float, Any, Any], None]) -> Callable[[Any, Clock, Any], int]:
    """Make the kernel that appends a row, by `note_row`, if one is due."""

    @kernel
    def note_row_when_due(memory: Any, clock: Clock, record: Any) -> int:
        """Append a row if one is due, every so many steps and at the end; return which, or -1."""
        if clock.index % clock.record_every != 0 and clock.finishing == 0:
            return -1
        note_row(clock.time, memory, record)
        return int(record.rows - 1)

    return note_row_when_due


note_row_when_due = when_due(note_row)


@dissolved_kernel
def center_height(model: Model, ground: GroundModel, tree: Workspace) -> float:
    """Height of the centre of mass above the ground below it."""
    mass = 0.0
    x = 0.0
    z = 0.0
    for i in range(model.parent.shape[0]):
        mass += tree.inertia[i, 0]
        x += tree.inertia[i, 1]
        z += tree.inertia[i, 2]
    below = ground_height(ground, tree.pivot[0] + x / mass)
    return tree.pivot[1] + z / mass - below


@dissolved_kernel
def sound(q: Floats, v: Floats) -> bool:
    """Whether the state is finite and not absurd."""
    return stay_below(FARTHEST_BITS, q) and stay_below(FASTEST_BITS, v)
