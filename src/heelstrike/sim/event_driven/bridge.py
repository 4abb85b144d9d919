"""Bridges: impulsive steps where events pile up and time does not move on.

Chatter, contact forces that no mode explains, modes that contradict each other within rounding: in
all of these the motion goes on, but not as smooth phases between events. One step of time stepping
does not ask for modes. At its end, contacts that touch must not approach, others not go through::

    w = G λ + b,   b = J v + h (J a_f + J̇ v),   b_n more by e J_n v,  or by gap / h where it is open

with a_f the acceleration that the known forces lead to. The rows turn on the way, by more than J̇ v
tells: what velocities at the end differ by from w is added to b, and the problem solved again. What
is pressed then is put on the ground, and loops are closed, by as little as the masses allow. A
bridge is kept as short as suffices: each further one without progress is longer. The impulses act
at its beginning, as those of an impact; then the robot moves on freely to its end, where a smooth
phase begins again. Impulses that make energy are refused, with restitution first and then without.
Bridges of a half and of a quarter of the length tell how far a bridge may be wrong: its order is
one.
"""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import OPEN, SOLVED, STICK
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.brakes import share_friction
from heelstrike.sim.contacts.candidates import find_constraints
from heelstrike.sim.contacts.faces import NO_FACE
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    evaluate_equations,
    row_product,
)
from heelstrike.sim.contacts.loops import (
    append_loops,
    find_loops,
    free_loops,
    rows_of,
    speed_along,
)
from heelstrike.sim.contacts.rows import (
    CONSTRAINT,
    DRY_JOINT,
    POINT,
    SECOND_FACE,
    STOP,
    Rows,
    is_of_ground,
)
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.impact import IMPACT, heading
from heelstrike.sim.event_driven.phase import Bridge, Faces, Impact, Modes, Motion, Phase, Step
from heelstrike.sim.event_driven.rows import write_row
from heelstrike.sim.event_driven.smooth.candidates import free_acceleration, solve_candidates
from heelstrike.sim.event_driven.smooth.corners import is_struck, log_impulse
from heelstrike.sim.event_driven.smooth.dynamics import evaluate, observe_faces, solve_constraints
from heelstrike.sim.event_driven.smooth.faces import has_corners, locate, stand_on_face
from heelstrike.sim.event_driven.smooth.gaps import (
    free_gap_acceleration,
    gap_now,
    gap_rows,
    gap_velocity,
)
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Equations, Loops, Memory, Reported, Surface
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import (
    CONSTRAINT_HOLDS,
    JOINT_STOP,
    TOUCHDOWN,
    log_event,
    note_residual,
)
from heelstrike.tolerances import CLOSED_GAP, NOTICEABLE_ENERGY

BRIDGE = int(EventKind.BRIDGE)

# Length (s) of the first bridge of a series, how much longer each further one is, and how many
# there may be, of which the last takes 0.26 s; progress (s) that ends a series.
SHORTEST_BRIDGE = 1e-6
LONGER = 4.0
MOST_BRIDGES = 10
PROGRESS = 1e-3
CLOSING_SPEED = 20.0
# Approach (m/s, rad/s) at the end of a bridge that is no more than the turning of the rows leaves.
SETTLED = 1e-6
# Approach (m/s) below which a bridge knows no restitution: bounces so small, of 5e-8 m, are what
# piled up.
SLOW = 1e-3
# What a bridge of order one is wrong by grows with the square of its length: its halves together
# are half as wrong as the whole, its quarters a quarter. So it is this many times as wrong as the
# whole is apart from the halves, and as these are from the quarters; what these two estimates
# differ by is how far the first may be wrong itself.
FROM_HALVES, FROM_QUARTERS = 2.0, 4.0


@kernel
def write_free(
    gap: float, length: float, contact: int, place: int, model: Model, rows: Rows,
    seconds: Contacts, breakaway: Floats, begin: Floats, equations: Equations, contacts: Contacts,
    faces: Faces, added: Floats, assembly: Assembly,
) -> None:  # fmt: skip
    """Make a contact a candidate: what is left of its gap may still close, at leisure.

    The free acceleration is in ``equations.rate``. What is no velocity of the normal free term
    goes to ``bridge.added``, too.
    """
    v = begin[model.nq :]
    free, jacobian = assembly.problem.free, assembly.jacobian
    free_gap_acceleration(
        model, contacts, equations, contact, place, rows, seconds, breakaway, faces, assembly
    )
    for row in range(2 * place, 2 * place + 2):
        free[row] = row_product(jacobian, row, v) + length * free[row]
    added[place] = gap / length if gap > CLOSED_GAP else 0.0
    free[2 * place] += added[place]
    if rows.kind[contact] == DRY_JOINT:
        assembly.problem.bound[place] *= length
    assembly.candidate[place] = contact


@kernel
def gather_near(
    model: Model, length: float, bouncing: bool, rows: Rows, seconds: Contacts, modes: Modes,
    begin: Floats, equations: Equations, contacts: Contacts, restitution: Floats, faces: Faces,
    bridge: Bridge, assembly: Assembly,
) -> int:  # fmt: skip
    """List what could touch within a bridge, and dry joints, with Jacobian rows and free terms.

    The free velocity is in ``bridge.free_end``. Returns how many.
    """
    state, trial = begin, bridge.free_end
    jacobian = assembly.jacobian
    count = 0
    for contact in range(modes.watched):
        if rows.kind[contact] == POINT and modes.passing[contact] == 1:
            continue
        if rows.kind[contact] == SECOND_FACE:
            point = rows.owner[contact]
            if modes.passing[point] == 1 or seconds.gap[point] == np.inf:
                continue
        if rows.kind[contact] == DRY_JOINT and modes.closed[contact] == 0:
            continue
        gap_rows(model, equations.tree, contacts, rows, seconds, contact, count, assembly)
        if rows.kind[contact] == DRY_JOINT:
            write_free(
                0.0, length, contact, count, model, rows, seconds, modes.breakaway, begin,
                equations, contacts, faces, bridge.added, assembly,
            )  # fmt: skip
            count += 1
            continue
        gap = gap_now(contact, rows, state)
        normal = row_product(jacobian, 2 * count, trial[model.nq :])
        if gap > length * max(CLOSING_SPEED, -2.0 * normal):
            continue
        write_free(
            gap, length, contact, count, model, rows, seconds, modes.breakaway, begin, equations,
            contacts, faces, bridge.added, assembly,
        )  # fmt: skip
        came = row_product(jacobian, 2 * count, state[model.nq :])
        if bouncing and gap <= CLOSED_GAP and came < -SLOW:
            bridge.added[count] = restitution[contact] * came
            assembly.problem.free[2 * count] += bridge.added[count]
        count += 1
    return count


@kernel
def find_faces(
    model: Model, ground: GroundModel, tree: Workspace, contacts: Contacts, rows: Rows,
    closed: Integers, surface: Surface, seconds: Contacts, faces: Faces,
) -> None:  # fmt: skip
    """Put the open points on their nearest faces, for what else they could meet from there."""
    if faces.paired == 0:
        return
    for point in range(model.nc):
        if closed[point] == 0:
            faces.face[point] = NO_FACE
            stand_on_face(
                model, ground, tree, point, contacts, rows, closed, surface, seconds, faces
            )


@kernel
def leave_faces(model: Model, closed: Integers, face: Integers) -> None:
    """Let the open points be on no face again."""
    for point in range(model.nc):
        if closed[point] == 0:
            face[point] = NO_FACE


@kernel
def collect_impulses(
    count: int, assembly: Assembly, added: Floats, mode: Integers, impact: Impact
) -> None:
    """Write what the bridge found: impulses, and modes of what does not leave by its end.

    Its velocity then is that of the problem, which knows how the ground turns under the robot in
    this time, but for restitution and gaps that close.
    """
    impulse, velocity = assembly.answer.impulse, assembly.answer.velocity
    for place in range(count):
        contact = assembly.candidate[place]
        impact.impulse[contact, 0] = impulse[2 * place]
        impact.impulse[contact, 1] = impulse[2 * place + 1]
        if not velocity[2 * place] - added[place] > CLOSED_GAP:
            mode[contact] = assembly.answer.mode[place]


@kernel
def made_energy(count: int, assembly: Assembly, added: Floats) -> bool:
    """Whether the impulses, beside what the known forces did, made energy."""
    delassus, impulse = assembly.problem.delassus, assembly.answer.impulse
    made = 0.0
    through = 0.0
    for row in range(2 * count):
        before = assembly.problem.free[row]
        if row % 2 == 0:
            before -= added[row // 2]
        after = before
        for column in range(2 * count):
            after += delassus[row, column] * impulse[column]
        made += impulse[row] * (before + after)
        through += abs(impulse[row]) * (abs(before) + abs(after))
    return made > NOTICEABLE_ENERGY * through


@kernel
def lend_faces(count: int, candidate: Integers, rows: Rows, modes: Modes, lent: Integers) -> None:
    """Keep the second faces of candidates, which open ones would look for anew wherever they are.

    Those that are lent so are marked in ``bridge.lent``.
    """
    for contact in range(rows.first[SECOND_FACE], modes.watched):
        lent[contact] = 0
    for place in range(count):
        contact = candidate[place]
        if rows.kind[contact] == SECOND_FACE and modes.closed[contact] == 0:
            lent[contact], modes.closed[contact] = 1, 1


@kernel
def return_faces(rows: Rows, modes: Modes, lent: Integers) -> None:
    """Take back what :func:`lend_faces` did."""
    for contact in range(rows.first[SECOND_FACE], modes.watched):
        if lent[contact] == 1:
            lent[contact], modes.closed[contact] = 0, 0


@kernel
def keeps_face(contact: int, ground: GroundModel, rows: Rows, face: Integers) -> bool:
    """Whether a candidate is a contact that will be on the same face at the end of a bridge."""
    if rows.kind[contact] == DRY_JOINT:
        return False
    if rows.kind[contact] in (STOP, SECOND_FACE, CONSTRAINT):
        return True
    return face[contact] != NO_FACE or not has_corners(ground)


@kernel
def reach_end(
    total: int, length: float, free_end: Floats, scene: Scene, assembly: Assembly, begin: Floats,
    equations: Equations, end: Floats,
) -> None:  # fmt: skip
    """Write where the impulses lead to ``bridge.end``, from velocities without them."""
    model = scene.model
    for i in range(model.nv):
        end[model.nq + i] = free_end[model.nq + i]
    if total > 0:
        add_impulse(model, assembly, total, equations, end[model.nq :])
    for i in range(model.nv):
        end[i] = begin[i] + length * end[model.nq + i]


@kernel
def observe_rows(
    state: Floats, scene: Scene, modes: Modes, rows: Rows, tree: Workspace, contacts: Contacts,
    surface: Surface, loops: Loops, seconds: Contacts, faces: Faces,
) -> None:  # fmt: skip
    """Kinematics, contact points, and loops of a state (q, v)."""
    model = scene.model
    observe_faces(model, scene.ground, state, modes, rows, seconds, faces, tree, contacts, surface)
    if rows_of(loops) > 0:
        find_loops(model, state[: model.nq], state[model.nq :], tree, loops)


@kernel
def put_in_place(
    count: int, total: int, scene: Scene, begin: Floats, rows: Rows, equations: Equations,
    contacts: Contacts, surface: Surface, assembly: Assembly, loops: Loops, seconds: Contacts,
    phase: Phase, bridge: Bridge,
) -> None:  # fmt: skip
    """Put on the ground what the bridge presses there at its end, and close the loops.

    The `count` contacts among the `total` candidates come before the loops.
    """
    held = phase.held
    model, end = scene.model, bridge.end
    impulse, velocity, kept = (
        assembly.answer.impulse,
        assembly.answer.velocity,
        bridge.kept,
    )
    for row in range(2 * total):
        kept[row] = impulse[row]
    for _ in range(2):
        observe_rows(
            end, scene, phase.modes, rows, equations.tree, contacts, surface, loops, seconds,
            phase.faces,
        )  # fmt: skip
        size = 0
        for place in range(count):
            contact = assembly.candidate[place]
            leaves = velocity[2 * place] - bridge.added[place] > CLOSED_GAP
            if (
                kept[2 * place] > 0.0
                and not leaves
                and keeps_face(contact, scene.ground, rows, phase.faces.face)
            ):
                held.row[size] = 2 * place
                size += 1
        pressed = size
        for place in range(count, total):
            held.row[size] = 2 * place
            size += 1
        for i in range(pressed):
            contact = assembly.candidate[held.row[i] // 2]
            held.system[i, size] = -gap_now(contact, rows, end)
        for i in range(pressed, size):
            held.system[i, size] = -loops.rows.displacement[i - pressed]
        observe_rows(
            begin, scene, phase.modes, rows, equations.tree, contacts, surface, loops, seconds,
            phase.faces,
        )  # fmt: skip
        solve_constraints(size, 0.0, assembly.problem.delassus, held)
        for row in range(2 * total):
            impulse[row] = 0.0
        for i in range(size):
            impulse[held.row[i]] = held.unknown[i]
        add_impulse(model, assembly, total, equations, end[: model.nq])
    for row in range(2 * total):
        impulse[row] = kept[row]


@kernel
def turn_rows(
    count: int, total: int, scene: Scene, modes: Modes, begin: Floats, bridge: Bridge, rows: Rows,
    tree: Workspace, contacts: Contacts, surface: Surface, assembly: Assembly, loops: Loops,
    seconds: Contacts, faces: Faces,
) -> None:  # fmt: skip
    """Let the free terms be those with which velocities at the end are what the problem says."""
    model = scene.model
    free, velocity = assembly.problem.free, assembly.answer.velocity
    observe_rows(bridge.end, scene, modes, rows, tree, contacts, surface, loops, seconds, faces)
    for place in range(count, total):
        along = speed_along(place - count, loops, bridge.end[model.nq :])
        free[2 * place] += along - velocity[2 * place]
    for place in range(count):
        contact = assembly.candidate[place]
        if not keeps_face(contact, scene.ground, rows, faces.face):
            continue
        normal, tangent = gap_velocity(contact, model, contacts, tree, rows, seconds, bridge.end)
        free[2 * place] += normal - (velocity[2 * place] - bridge.added[place])
        if is_of_ground(contact, rows):
            free[2 * place + 1] += tangent - velocity[2 * place + 1]
    observe_rows(begin, scene, modes, rows, tree, contacts, surface, loops, seconds, faces)


@kernel
def solve_bridge(
    count: int, total: int, length: float, free_end: Floats, scene: Scene, begin: Floats,
    memory: Memory, phase: Phase, bridge: Bridge,
) -> bool:  # fmt: skip
    """Find the impulses of the candidates, and where they lead; return success."""
    assembly, guess, friction = memory.assembly, memory.reaction.mode, memory.surface.friction
    for attempt in range(2):
        status = solve_candidates(
            count, memory.loops, False, friction, guess, memory.rows, phase.modes.slide,
            phase.forces.solvers, assembly, memory.solver,
        )  # fmt: skip
        note_residual(assembly.answer.residual, memory.tally)
        if status != SOLVED or made_energy(total, assembly, bridge.added):
            return False
        reach_end(total, length, free_end, scene, assembly, begin, memory.equations, bridge.end)
        put_in_place(
            count, total, scene, begin, memory.rows, memory.equations, memory.contacts,
            memory.surface, assembly, memory.loops, memory.seconds, phase, bridge,
        )  # fmt: skip
        if attempt == 0:
            turn_rows(
                count, total, scene, phase.modes, begin, bridge, memory.rows, memory.equations.tree,
                memory.contacts, memory.surface, assembly, memory.loops, memory.seconds,
                phase.faces,
            )  # fmt: skip
    return True


@kernel
def find_impulses(
    scene: Scene, length: float, bouncing: bool, control: Control, memory: Memory, phase: Phase,
    step: Step, impact: Impact, bridge: Bridge,
) -> bool:  # fmt: skip
    """Find a bridge of some length from ``step.begin`` to ``bridge.end``; return success.

    The velocities behind the impulses of the contacts go to ``bridge.after``, the impulses to
    ``impact.impulse``, what the contacts do at the end of it to ``memory.reaction.mode``.
    """
    modes = phase.modes
    model, equations, assembly = scene.model, memory.equations, memory.assembly
    begin, end, free_end = step.begin, bridge.end, bridge.free_end
    after, answer = bridge.after, memory.assembly.answer
    leave_faces(model, modes.closed, phase.faces.face)
    evaluate(scene, step.time, begin, control, memory, phase, step.slopes[0])
    for contact in range(memory.rows.first[DRY_JOINT], memory.rows.end[DRY_JOINT]):
        modes.slide[contact] = 0
    free_acceleration(model, begin, memory.torque, memory.rows, modes, memory.pushes, equations)
    for i in range(model.nv):
        free_end[model.nq + i] = begin[model.nq + i] + length * equations.rate[i]
    find_faces(
        model, scene.ground, equations.tree, memory.contacts, memory.rows, modes.closed,
        memory.surface, memory.seconds, phase.faces,
    )  # fmt: skip
    for contact in range(modes.watched):
        memory.reaction.mode[contact] = OPEN
        impact.impulse[contact, 0] = 0.0
        impact.impulse[contact, 1] = 0.0
    count = gather_near(
        model, length, bouncing, memory.rows, memory.seconds, modes, step.begin, equations,
        memory.contacts, memory.surface.restitution, phase.faces, bridge, assembly,
    )  # fmt: skip
    total = append_loops(count, memory.loops, assembly)
    free_loops(total, memory.loops, free_end[model.nq :], 0.5 * length, assembly)
    for place in range(count, total):
        bridge.added[place] = 0.0
    reach_end(0, length, free_end, scene, assembly, step.begin, equations, bridge.end)
    if total > 0:
        assemble_delassus(model, total, equations, assembly)
        lend_faces(count, assembly.candidate, memory.rows, modes, bridge.lent)
        solved = solve_bridge(
            count, total, length, free_end, scene, step.begin, memory, phase, bridge
        )
        return_faces(memory.rows, modes, bridge.lent)
        if not solved:
            return False
    collect_impulses(count, assembly, bridge.added, memory.reaction.mode, impact)
    for place in range(count):
        contact = assembly.candidate[place]
        if memory.rows.kind[contact] == DRY_JOINT:  # a finite force works on the way
            answer.impulse[2 * place] = 0.0
            answer.impulse[2 * place + 1] = 0.0
    finite = True
    for i in range(model.nv):
        finite = finite and np.isfinite(end[i])
        after[i] = begin[i]
        after[model.nq + i] = begin[model.nq + i]
    if total > 0:
        add_impulse(model, assembly, total, equations, after[model.nq :])
    return finite


@kernel
def copy_state(source: Floats, state: Floats) -> None:
    """Copy a state (q, v)."""
    for i in range(source.shape[0]):
        state[i] = source[i]


@kernel
def end_of_parts(
    scene: Scene, parts: int, length: float, bouncing: bool, control: Control, memory: Memory,
    phase: Phase, step: Step, impact: Impact, bridge: Bridge, end: Floats,
) -> None:  # fmt: skip
    """Write where so many bridges end that take some time together; where they begin without."""
    here = bridge.here
    copy_state(step.begin, here)
    found = True
    for _ in range(parts):
        found = found and find_impulses(
            scene, length / parts, bouncing, control, memory, phase, step, impact, bridge
        )
        copy_state(bridge.end, step.begin)
    copy_state(step.begin if found else here, end)
    copy_state(here, step.begin)


@kernel
def find_bridge(
    scene: Scene, length: float, control: Control, memory: Memory, phase: Phase, step: Step,
    impact: Impact, bridge: Bridge,
) -> tuple[bool, float]:  # fmt: skip
    """Find a bridge of some length; return success, and how far its end may be wrong."""
    halved, quartered = bridge.halved, bridge.quartered
    for attempt in range(2):
        bouncing = attempt == 0
        end_of_parts(
            scene, 2, length, bouncing, control, memory, phase, step, impact, bridge, halved
        )
        end_of_parts(
            scene, 4, length, bouncing, control, memory, phase, step, impact, bridge, quartered
        )
        if find_impulses(scene, length, bouncing, control, memory, phase, step, impact, bridge):
            wrong, doubt = 0.0, 0.0
            for i in range(halved.shape[0]):
                first = FROM_HALVES * (bridge.end[i] - halved[i])
                second = FROM_QUARTERS * (halved[i] - quartered[i])
                wrong = max(wrong, abs(first))
                doubt = max(doubt, abs(first - second))
            return True, wrong + doubt
    return False, 0.0


@kernel
def report_impulses(
    wrong: float, contacts: Contacts, rows: Rows, seconds: Contacts, paired: int, time: float,
    impact: Impact, length: float, reported: Reported, record: Record,
) -> None:  # fmt: skip
    """Append the bridge to the events, and the impulses of the contacts."""
    log_event(time, BRIDGE, 0, length, wrong, record)
    for contact in range(rows.end[CONSTRAINT]):
        normal = impact.impulse[contact, 0]
        struck = (
            is_struck(contact, rows, paired, impact.impulse)
            if rows.kind[contact] == POINT
            else normal > 0.0
        )
        if not struck:
            continue
        if rows.kind[contact] == STOP:
            joint = rows.owner[contact]
            log_event(time, JOINT_STOP, joint, normal, 0.0, record)
            reported.closed[contact] = 1
            continue
        if rows.kind[contact] == CONSTRAINT:
            number = rows.owner[contact]
            log_event(time, CONSTRAINT_HOLDS, number, normal, 0.0, record)
            reported.closed[contact] = 1
            continue
        kind = IMPACT
        if reported.closed[contact] == 0:
            kind = TOUCHDOWN
            reported.closed[contact] = 1
            reported.slipping[contact] = 0
        log_impulse(kind, contact, contacts, rows, seconds, paired, time, impact, record)


@kernel
def adopt_end(
    model: Model, ground: GroundModel, mode: Integers, begin: Floats, rows: Rows,
    equations: Equations, contacts: Contacts, surface: Surface, seconds: Contacts, modes: Modes,
    faces: Faces, meets: Integers,
) -> None:  # fmt: skip
    """Let the contacts do at the end of the bridge what it found."""
    tree = equations.tree
    evaluate_equations(model, begin[: model.nq], begin[model.nq :], equations)
    if rows.outside.kernel.shape[0] > 0:
        find_constraints(model, begin[: model.nq], begin[model.nq :], tree, rows)
    for contact in range(model.nc):
        faces.face[contact] = NO_FACE
        meets[contact] = 0
    locate(model, ground, tree, rows, modes, seconds, faces, contacts, surface)
    for contact in range(modes.watched):
        modes.stuck[contact] = 0
        modes.slide[contact] = 0
        kind = rows.kind[contact]
        if kind == SECOND_FACE:
            point = rows.owner[contact]
            if contacts.gap[point] <= CLOSED_GAP:
                stand_on_face(
                    model, ground, tree, point, contacts, rows, modes.closed, surface, seconds,
                    faces,
                )  # fmt: skip
        elif kind == DRY_JOINT:
            if modes.closed[contact] == 1 and mode[contact] != STICK:
                joint = rows.owner[contact]
                modes.slide[contact] = heading(begin[model.nq + joint])
            continue
        touches = gap_now(contact, rows, begin) <= CLOSED_GAP
        normal, tangent = gap_velocity(contact, model, contacts, tree, rows, seconds, begin)
        # What has come down by the end of the bridge meets the ground there.
        holds = mode[contact] != OPEN and normal >= -SETTLED
        modes.closed[contact] = 1 if touches and holds else 0
        if modes.closed[contact] == 1 and mode[contact] != STICK:
            modes.slide[contact] = heading(tangent)


@kernel
def cross_bridge(
    scene: Scene, stop: float, control: Control, memory: Memory, work: Motion, record: Record
) -> bool:
    """Lay a bridge from now on, to `stop` at the longest; return success.

    ``step.begin`` becomes the state at its end, ``series.length`` its length.
    """
    phase = work.phase
    modes = phase.modes
    step, bridge, series = work.step, work.bridge, work.series
    model = scene.model
    if work.output.last_row < step.time:
        write_row(
            scene, step.time, step.begin, True, step, work.impact, control, memory, phase,
            work.output, record,
        )  # fmt: skip
    if step.time - series.begin >= PROGRESS:
        series.begin = step.time
        series.count = 0
    found = False
    wrong = 0.0
    while not found and series.count < MOST_BRIDGES:
        wish = SHORTEST_BRIDGE * LONGER**series.count
        series.length = min(wish, stop - step.time)
        found, wrong = find_bridge(
            scene, series.length, control, memory, phase, step, work.impact, bridge
        )
        if series.length == wish or not found:
            series.count += 1
    if not found:
        return False
    report_impulses(
        wrong, memory.contacts, memory.rows, memory.seconds, phase.faces.paired, step.time,
        work.impact, series.length, memory.reported, record,
    )  # fmt: skip
    for contact in range(modes.watched):
        if memory.rows.kind[contact] != DRY_JOINT:
            modes.closed[contact] = 0
        modes.carrier[contact] = 0
        modes.holder[contact] = 0
    leave_faces(model, modes.closed, phase.faces.face)
    for i in range(model.nv):
        step.begin[model.nq + i] = bridge.after[model.nq + i]
    row = record.rows
    write_row(
        scene, step.time, step.begin, True, step, work.impact, control, memory, phase, work.output,
        record,
    )  # fmt: skip
    for dry in range(memory.rows.first[DRY_JOINT], memory.rows.end[DRY_JOINT]):
        torque = work.impact.impulse[dry, 1] / series.length
        record.friction_torque[row, memory.rows.owner[dry]] = torque
    share_friction(model, modes.breakaway, record.friction_torque[row], record.brake_torque[row])
    for i in range(step.begin.shape[0]):
        step.begin[i] = bridge.end[i]
    adopt_end(
        model, scene.ground, memory.reaction.mode, step.begin, memory.rows, memory.equations,
        memory.contacts, memory.surface, memory.seconds, modes, phase.faces, work.impact.meets,
    )  # fmt: skip
    work.decision.bridging = 0
    return True
