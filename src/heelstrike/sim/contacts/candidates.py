"""Who takes part in a contact problem, and what its answer means for each of them.

A method lists the entries of the table (:mod:`heelstrike.sim.contacts.rows`) that could act in its
step, kind by kind in the order of the table, and notes where each kind begins and ends among them.
Whatever is to be done for all of a kind is a loop over its places then, and nothing for kinds that
are not there. What differs between methods is who is near enough, and the free terms.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import dissolved_kernel, kernel
from heelstrike.contact.modes import OPEN, STICK
from heelstrike.contact.sets import INTERVAL
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
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
def list_candidate(entry: int, place: int, memory: Memory) -> None:
    """List an entry as a candidate, with its set, its friction and its mode before."""
    problem, assembly = memory.assembly.problem, memory.assembly
    problem.set[place] = memory.rows.set[entry]
    problem.friction[place] = memory.surface.friction[entry]
    assembly.answer.mode[place] = memory.reaction.mode[entry]
    assembly.candidate[place] = entry


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
        list_candidate(stops[missing], count, memory)
        assembly.problem.free[2 * count] = (
            -model.latch_side[missing] * v[model.latch_joint[missing]]
        )
        assembly.problem.free[2 * count + 1] = 0.0
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
            list_candidate(dry, count, memory)
            problem.free[2 * count + 1] = v[joint]
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
def write_own_rows(entry: int, place: int, rows: Rows, assembly: Assembly) -> None:
    """Write the rows that the kernel of a constraint wrote as those of a candidate."""
    jacobian, its, rubs = assembly.jacobian, rows.outside.jacobian, rows.set[entry] == INTERVAL
    own = rows.owner[entry]
    for j in range(jacobian.shape[1]):
        jacobian[2 * place, j] = 0.0 if rubs else its[own, 0, j]
        jacobian[2 * place + 1, j] = its[own, 0 if rubs else 1, j]
    assembly.leaf[place] = EVERYWHERE


@kernel
def write_rows(
    model: Model, tree: Workspace, contacts: Contacts, seconds: Contacts, rows: Rows,
    assembly: Assembly,
) -> None:  # fmt: skip
    """Write the Jacobian rows of the candidates, but for those of loops, which have theirs.

    A stop has a normal row ±1 at its joint and a tangent row of zeros, a dry joint the reverse.
    """
    for place in range(assembly.begin[POINT], assembly.until[POINT]):
        contact_rows(model, tree, contacts, rows.owner[assembly.candidate[place]], place, assembly)
    for place in range(assembly.begin[STOP], assembly.until[STOP]):
        stop = assembly.candidate[place]
        write_unit_row(rows.owner[stop], 2 * place, rows.side[stop], assembly)
    for place in range(assembly.begin[CONSTRAINT], assembly.until[CONSTRAINT]):
        write_own_rows(assembly.candidate[place], place, rows, assembly)
    for place in range(assembly.begin[DRY_JOINT], assembly.until[DRY_JOINT]):
        write_unit_row(rows.owner[assembly.candidate[place]], 2 * place + 1, 1.0, assembly)
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
    problem = assembly.problem
    for joint in range(model.nv):
        reaction.stop_torque[joint] = 0.0
    for contact in range(model.nc):
        force[contact, 0] = 0.0
        force[contact, 1] = 0.0
        reaction.slip[contact] = 0.0
    for entry in range(rows.first[DRY_JOINT]):
        reaction.mode[entry] = OPEN
    for place in range(begin[POINT], until[POINT]):
        contact = candidate[place]
        force[contact, 0] = impulse[2 * place] / span
        force[contact, 1] = impulse[2 * place + 1] / span
        reaction.slip[contact] = answer.velocity[2 * place + 1]
        reaction.mode[contact] = answer.mode[place]
    for place in range(begin[STOP], until[STOP]):
        stop = candidate[place]
        reaction.stop_torque[rows.owner[stop]] += rows.side[stop] * impulse[2 * place] / span
        reaction.mode[stop] = answer.mode[place] != OPEN
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        memory.loops.constraint_force[rows.owner[entry], 0] = 0.0
        memory.loops.constraint_force[rows.owner[entry], 1] = 0.0
    for place in range(begin[CONSTRAINT], until[CONSTRAINT]):
        entry = candidate[place]
        constraint = memory.loops.constraint_force[rows.owner[entry]]
        rubs = problem.set[place] == INTERVAL
        constraint[0] = impulse[2 * place + (1 if rubs else 0)] / span
        constraint[1] = 0.0 if rubs else impulse[2 * place + 1] / span
        reaction.mode[entry] = answer.mode[place]
    for place in range(begin[DRY_JOINT], until[DRY_JOINT]):
        dry = candidate[place]
        reaction.friction_torque[rows.owner[dry]] = impulse[2 * place + 1] / span
        reaction.mode[dry] = answer.mode[place]
    for place in range(begin[SECOND_FACE], until[SECOND_FACE]):
        second = candidate[place]
        contact = rows.owner[second]
        memory.seconds.force[contact, 0] = impulse[2 * place] / span
        memory.seconds.force[contact, 1] = impulse[2 * place + 1] / span
        reaction.mode[second] = answer.mode[place]
    note_loops(rows, until[LOOP], span, impulse, memory.loops)
