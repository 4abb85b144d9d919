"""Who takes part in a contact problem, and what its answer means for each of them.

A method lists the entries of the table (:mod:`heelstrike.sim.contacts.rows`) that could act in its
step, kind by kind in the order of the table, and notes where each kind begins and ends among them.
Whatever is to be done for all of a kind is a loop over its places then, and nothing for kinds that
are not there. What differs between methods is who is near enough, and the free terms.
"""

from __future__ import annotations

from typing import NamedTuple

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.modes import OPEN, STICK
from heelstrike.contact.sets import EVERY_ROW, INTERVAL, row_of
from heelstrike.contact.workspace import ContactProblem
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contacts.geometry import EVERYWHERE, contact_rows, write_unit_row
from heelstrike.sim.contacts.latches import hold
from heelstrike.sim.contacts.loops import note_loops
from heelstrike.sim.contacts.rows import (
    CONSTRAINT,
    DRY_JOINT,
    LOOP,
    POINT,
    SECOND_FACE,
    STOP,
    Rows,
)
from heelstrike.sim.contacts.writers import write_own
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Assembly, Memory


class Listing(NamedTuple):
    """Candidates as they are listed, and what is known of all entries of the table before.

    Attributes
    ----------
    set, friction, guess : (entries,) array
        Where impulses of each entry may lie, its friction, and its mode in the last solve.
    candidate, mode, problem
        Who the candidates are, their modes to begin with, and their contact problem.
    """

    set: Integers
    friction: Floats
    guess: Integers
    candidate: Integers
    mode: Integers
    problem: ContactProblem


@dissolved_kernel
def place_candidate(
    entry: int, place: int, components: int, candidate: Integers, first: Integers
) -> int:
    """Put an entry at its place among the candidates; return the first of its rows.

    Candidates are listed one after the other; `components` tells how many rows this one has.
    """
    row = row_of(place, first)
    first[place + 1] = row + components
    candidate[place] = entry
    return row


@dissolved_kernel
def list_candidate(entry: int, place: int, components: int, listing: Listing) -> int:
    """List an entry as a candidate, with its set, its friction and its mode before.

    Returns the first of its rows, as :func:`place_candidate` does.
    """
    problem, place, entry = listing.problem, place & EVERY_ROW, entry & EVERY_ROW
    problem.set[place] = listing.set[entry]
    problem.friction[place] = listing.friction[entry]
    listing.mode[place] = listing.guess[entry]
    return place_candidate(entry, place, components, listing.candidate, problem.first)


@dissolved_kernel
def part_of(place: int, first: Integers, values: Floats) -> tuple[float, float]:
    """Normal and tangential part of what a candidate has a number a row of.

    What has one row has no tangential part.
    """
    row = row_of(place, first)
    if row_of(place + 1, first) == row + 1:
        return values[row], 0.0
    return values[row], values[row + 1]


@dissolved_kernel
def note_group(kind: int, first: int, count: int, assembly: Assembly) -> int:
    """Note that the candidates of a kind are those from `first` on, the last of `count`."""
    assembly.begin[kind] = first
    assembly.until[kind] = count
    return count


@dissolved_kernel
def are_there(kind: int, assembly: Assembly) -> bool:
    """Whether any candidate is of a kind."""
    return bool(assembly.until[kind] > assembly.begin[kind])


@dissolved_kernel
def locate_stops(q: Floats, rows: Rows) -> None:
    """Write the gaps of the joint stops."""
    for stop in range(rows.first[STOP], rows.end[STOP]):
        rows.gap[stop] = rows.side[stop] * (q[rows.owner[stop]] - rows.limit[stop])


@dissolved_kernel
def hold_latched(
    model: Model, count: int, v: Floats, stop: Integers, held: Integers, listing: Listing
) -> int:
    """Let the stops of engaged latches hold; return how many candidates there are with them.

    Where the gap decides, and a method has left a joint before its stop, it is held there. `stop`
    and `held` tell which entry the stop of each latch is, and whether that is engaged.
    """
    candidate, problem = listing.candidate, listing.problem
    missing = hold(count, stop, held, candidate, problem.set)
    while missing >= 0:
        row = list_candidate(stop[missing], count, 1, listing)
        rate = -model.latch_side[missing] * v[model.latch_joint[missing]]
        problem.free[row] = rate
        listing.mode[count] = STICK
        count += 1
        missing = hold(count, stop, held, candidate, problem.set)
    return count


@dissolved_kernel
def list_dry_joints(
    count: int, span: float, v: Floats, breakaway: Floats, rows: Rows, listing: Listing
) -> int:
    """List the joints with dry friction over a span of time; return how many candidates there are.

    Those whose brake is off, and that have none of their own, are left out: the most that dry
    friction is of each joint is its `breakaway`.
    """
    problem = listing.problem
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        joint = rows.owner[dry]
        if breakaway[joint] > 0.0:
            row = list_candidate(dry, count, 2, listing)
            problem.free[row + 1] = v[joint]
            problem.bound[count] = span * breakaway[joint]
            count += 1
    return count


@kernel
def find_constraints(model: Model, q: Floats, v: Floats, tree: Workspace, rows: Rows) -> None:
    """Find gaps and rows of the constraints from outside that may let go, in a state.

    Its kinematics and velocities are there. What rubs has no gap.
    """
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        write_own(rows.owner[entry], model, q, v, tree, rows.outside)
        if rows.set[entry] != INTERVAL:
            rows.gap[entry] = rows.outside.gap[rows.owner[entry], 0]


@kernel
def write_own_rows(
    entry: int, place: int, rows: Rows, first: Integers, leaf: Integers, jacobian: Floats
) -> None:
    """Write the rows that the kernel of a constraint wrote as those of a candidate."""
    its, own, row = rows.outside.jacobian, rows.owner[entry], first[place]
    if rows.set[entry] == INTERVAL:
        for j in range(jacobian.shape[1]):
            jacobian[row, j] = 0.0
            jacobian[row + 1, j] = its[own, 0, j]
    else:
        for component in range(first[place + 1] - row):
            for j in range(jacobian.shape[1]):
                jacobian[row + component, j] = its[own, component, j]
    leaf[place] = EVERYWHERE


@kernel
def write_contact_rows(
    kind: int, model: Model, tree: Workspace, contacts: Contacts, owner: Integers,
    assembly: Assembly,
) -> None:  # fmt: skip
    """Write the Jacobian rows of the candidates that are contact points, on one of their faces.

    `contacts` are the points on faces of that kind, `owner` tells of each entry which it is.
    """
    directions, first = assembly.directions, assembly.problem.first
    for place in range(assembly.begin[kind], assembly.until[kind]):
        point = owner[assembly.candidate[place]]
        contact_rows(model, tree, contacts, point, place, first, directions)


@kernel
def write_joint_rows(rows: Rows, assembly: Assembly) -> None:
    """Write the Jacobian rows of stops, constraints from outside and dry joints.

    A stop has one row, ±1 at its joint; a dry joint such a tangent, and a normal row of zeros.
    """
    candidate, first = assembly.candidate, assembly.problem.first
    leaf, jacobian = assembly.directions.leaf, assembly.directions.jacobian
    for place in range(assembly.begin[STOP], assembly.until[STOP]):
        stop = candidate[place]
        write_unit_row(rows.owner[stop], place, 0, rows.side[stop], first, leaf, jacobian)
    for place in range(assembly.begin[CONSTRAINT], assembly.until[CONSTRAINT]):
        write_own_rows(candidate[place], place, rows, first, leaf, jacobian)
    for place in range(assembly.begin[DRY_JOINT], assembly.until[DRY_JOINT]):
        joint = rows.owner[candidate[place]]
        write_unit_row(joint, place, 1, 1.0, first, leaf, jacobian)


@dissolved_kernel
def note_answer(span: float, memory: Memory) -> None:
    """Keep the forces of the candidates, whose impulses are those of a span of time, and more.

    These are their slips and modes; all others have none.
    """
    assembly, reaction, rows, loops = memory.assembly, memory.reaction, memory.rows, memory.loops
    for entry in range(rows.first[DRY_JOINT]):
        reaction.mode[entry] = OPEN
    keep_points(span, assembly, memory.contacts.force, reaction.slip, reaction.mode)
    keep_stops(span, rows.owner, rows.side, assembly, reaction.stop_torque, reaction.mode)
    if loops.constraint_force.shape[0] > 0:
        keep_constraints(span, rows, assembly, loops.constraint_force, reaction.mode)
    keep_dry_joints(span, rows.owner, assembly, reaction.friction_torque, reaction.mode)
    keep_second_faces(span, rows.owner, assembly, memory.second_faces.force, reaction.mode)
    first, impulse = assembly.problem.first, assembly.answer.impulse
    note_loops(rows, assembly.until[LOOP], span, first, impulse, loops)


@dissolved_kernel
def keep_points(
    span: float, assembly: Assembly, force: Floats, slip: Floats, mode: Integers
) -> None:
    """Keep forces, slips and modes of the contact points."""
    answer, first = assembly.answer, assembly.problem.first
    for contact in range(force.shape[0]):
        force[contact, 0] = 0.0
        force[contact, 1] = 0.0
        slip[contact] = 0.0
    for listed in range(assembly.begin[POINT], assembly.until[POINT]):
        place = listed & EVERY_ROW
        contact, row = row_of(place, assembly.candidate), row_of(place, first)
        force[contact, 0] = answer.impulse[row] / span
        force[contact, 1] = answer.impulse[row + 1] / span
        slip[contact] = answer.velocity[row + 1]
        mode[contact] = answer.mode[place]


@dissolved_kernel
def keep_stops(
    span: float, owner: Integers, side: Floats, assembly: Assembly, torque: Floats, mode: Integers
) -> None:
    """Keep torques and modes of the joint stops."""
    answer, first = assembly.answer, assembly.problem.first
    for joint in range(torque.shape[0]):
        torque[joint] = 0.0
    for place in range(assembly.begin[STOP], assembly.until[STOP]):
        stop = assembly.candidate[place]
        torque[owner[stop]] += side[stop] * answer.impulse[row_of(place, first)] / span
        mode[stop] = answer.mode[place] != OPEN


@dissolved_kernel
def keep_constraints(
    span: float, rows: Rows, assembly: Assembly, force: Floats, mode: Integers
) -> None:
    """Keep forces and modes of the constraints from outside that may let go."""
    problem, impulse = assembly.problem, assembly.answer.impulse
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        force[rows.owner[entry], 0] = 0.0
        force[rows.owner[entry], 1] = 0.0
    for place in range(assembly.begin[CONSTRAINT], assembly.until[CONSTRAINT]):
        entry = assembly.candidate[place]
        its = force[rows.owner[entry]]
        normal, tangent = part_of(place, problem.first, impulse)
        if problem.set[place] == INTERVAL:  # what rubs has one force, and it is no normal one
            normal, tangent = tangent, 0.0
        its[0], its[1] = normal / span, tangent / span
        mode[entry] = assembly.answer.mode[place]


@dissolved_kernel
def keep_dry_joints(
    span: float, owner: Integers, assembly: Assembly, torque: Floats, mode: Integers
) -> None:
    """Keep torques and modes of the joints with dry friction."""
    answer, first = assembly.answer, assembly.problem.first
    for place in range(assembly.begin[DRY_JOINT], assembly.until[DRY_JOINT]):
        dry = assembly.candidate[place]
        torque[owner[dry]] = answer.impulse[first[place] + 1] / span
        mode[dry] = answer.mode[place]


@dissolved_kernel
def keep_second_faces(
    span: float, owner: Integers, assembly: Assembly, force: Floats, mode: Integers
) -> None:
    """Keep forces and modes of contact points on their second faces."""
    answer, first = assembly.answer, assembly.problem.first
    for place in range(assembly.begin[SECOND_FACE], assembly.until[SECOND_FACE]):
        second = assembly.candidate[place]
        contact, row = owner[second], first[place]
        force[contact, 0] = answer.impulse[row] / span
        force[contact, 1] = answer.impulse[row + 1] / span
        mode[second] = answer.mode[place]
