"""Who takes part in a contact problem, and what its answer means for each of them.

A method lists the entries of the table (:mod:`heelstrike.sim.contacts.rows`) that could act in its
step, kind by kind in the order of the table, and notes where each kind begins and ends among them.
Whatever is to be done for all of a kind is a loop over its places then, and nothing for kinds that
are not there. What differs between methods is who is near enough, and the free terms.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.modes import OPEN, STICK
from heelstrike.contact.sets import INTERVAL, row_of
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


@dissolved_kernel
def list_candidate(entry: int, place: int, components: int, memory: Memory) -> int:
    """List an entry as a candidate, with its set, its friction and its mode before.

    Candidates are listed one after the other; `components` tells how many rows this one has.
    Returns the first of them.
    """
    problem, assembly = memory.assembly.problem, memory.assembly
    first = row_of(place, problem.first)
    problem.first[place + 1] = first + components
    problem.set[place] = memory.rows.set[entry]
    problem.friction[place] = memory.surface.friction[entry]
    assembly.answer.mode[place] = memory.reaction.mode[entry]
    assembly.candidate[place] = entry
    return first


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
def hold_latched(model: Model, count: int, v: Floats, memory: Memory) -> int:
    """Let the stops of engaged latches hold; return how many candidates there are with them.

    Where the gap decides, and a method has left a joint before its stop, it is held there.
    """
    loops, assembly, stops = memory.loops, memory.assembly, memory.rows.latch_stop
    missing = hold(count, stops, loops.held, assembly)
    while missing >= 0:
        row = list_candidate(stops[missing], count, 1, memory)
        rate = -model.latch_side[missing] * v[model.latch_joint[missing]]
        assembly.problem.free[row] = rate
        assembly.answer.mode[count] = STICK
        count += 1
        missing = hold(count, stops, loops.held, assembly)
    return count


@dissolved_kernel
def list_dry_joints(count: int, span: float, v: Floats, memory: Memory) -> int:
    """List the joints with dry friction over a span of time; return how many candidates there are.

    Those whose brake is off, and that have none of their own, are left out.
    """
    rows, problem = memory.rows, memory.assembly.problem
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        joint = rows.owner[dry]
        if memory.breakaway[joint] > 0.0:
            row = list_candidate(dry, count, 2, memory)
            problem.free[row + 1] = v[joint]
            problem.bound[count] = span * memory.breakaway[joint]
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
def write_rows(
    model: Model, tree: Workspace, contacts: Contacts, seconds: Contacts, rows: Rows,
    assembly: Assembly,
) -> None:  # fmt: skip
    """Write the Jacobian rows of the candidates, but for those of loops, which have theirs.

    A stop has one row, ±1 at its joint; a dry joint such a tangent, and a normal row of zeros.
    """
    first, leaf, jacobian = assembly.problem.first, assembly.leaf, assembly.jacobian
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        contact_rows(model, tree, contacts, rows.owner[assembly.candidate[place]], place, assembly)
    for place in range(assembly.begin[STOP], assembly.until[STOP]):
        stop = assembly.candidate[place]
        write_unit_row(rows.owner[stop], place, 0, rows.side[stop], first, leaf, jacobian)
    for place in range(assembly.begin[CONSTRAINT], assembly.until[CONSTRAINT]):
        entry = assembly.candidate[place]
        write_own_rows(entry, place, rows, first, leaf, jacobian)
    for place in range(assembly.begin[DRY_JOINT], assembly.until[DRY_JOINT]):
        joint = rows.owner[assembly.candidate[place]]
        write_unit_row(joint, place, 1, 1.0, first, leaf, jacobian)
    for place in range(assembly.begin[SECOND_FACE], assembly.until[SECOND_FACE]):
        contact_rows(model, tree, seconds, rows.owner[assembly.candidate[place]], place, assembly)


@dissolved_kernel
def note_answer(model: Model, span: float, memory: Memory) -> None:
    """Keep the forces of the candidates, whose impulses are those of a span of time, and more.

    These are their slips and modes; all others have none.
    """
    assembly, answer, rows = memory.assembly, memory.assembly.answer, memory.rows
    candidate, begin, until = assembly.candidate, assembly.begin, assembly.until
    impulse, force, reaction = answer.impulse, memory.contacts.force, memory.reaction
    problem, first = assembly.problem, assembly.problem.first
    for joint in range(model.nv):
        reaction.stop_torque[joint] = 0.0
    for contact in range(model.nc):
        force[contact, 0] = 0.0
        force[contact, 1] = 0.0
        reaction.slip[contact] = 0.0
    for entry in range(rows.first[DRY_JOINT]):
        reaction.mode[entry] = OPEN
    for place in range(begin[POINT], until[POINT]):
        contact, row = candidate[place], row_of(place, first)
        force[contact, 0] = impulse[row] / span
        force[contact, 1] = impulse[row + 1] / span
        reaction.slip[contact] = answer.velocity[row + 1]
        reaction.mode[contact] = answer.mode[place]
    for place in range(begin[STOP], until[STOP]):
        stop = candidate[place]
        pressing = rows.side[stop] * impulse[row_of(place, first)]
        reaction.stop_torque[rows.owner[stop]] += pressing / span
        reaction.mode[stop] = answer.mode[place] != OPEN
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        memory.loops.constraint_force[rows.owner[entry], 0] = 0.0
        memory.loops.constraint_force[rows.owner[entry], 1] = 0.0
    for place in range(begin[CONSTRAINT], until[CONSTRAINT]):
        entry = candidate[place]
        constraint = memory.loops.constraint_force[rows.owner[entry]]
        rubs, row = problem.set[place] == INTERVAL, first[place]
        constraint[0] = impulse[row + (1 if rubs else 0)] / span
        alone = rubs or first[place + 1] == row + 1
        constraint[1] = 0.0 if alone else impulse[row + 1] / span
        reaction.mode[entry] = answer.mode[place]
    for place in range(begin[DRY_JOINT], until[DRY_JOINT]):
        dry = candidate[place]
        reaction.friction_torque[rows.owner[dry]] = impulse[first[place] + 1] / span
        reaction.mode[dry] = answer.mode[place]
    for place in range(begin[SECOND_FACE], until[SECOND_FACE]):
        second = candidate[place]
        contact, row = rows.owner[second], first[place]
        memory.seconds.force[contact, 0] = impulse[row] / span
        memory.seconds.force[contact, 1] = impulse[row + 1] / span
        reaction.mode[second] = answer.mode[place]
    note_loops(rows, until[LOOP], span, first, impulse, memory.loops)
