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
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import OPEN, SOLVED, STICK
from heelstrike.contact.workspace import ContactProblem
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.brakes import share_friction
from heelstrike.sim.contacts.candidates import place_candidate
from heelstrike.sim.contacts.faces import NO_FACE, Located
from heelstrike.sim.contacts.geometry import (
    add_impulse,
    assemble_delassus,
    evaluate_equations,
    row_product,
)
from heelstrike.sim.contacts.loops import append_loops, free_loops, speed_along
from heelstrike.sim.contacts.rows import (
    CONSTRAINT,
    DRY_JOINT,
    SECOND_FACE,
    STOP,
    Rows,
    is_of_ground,
)
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.impact import heading
from heelstrike.sim.event_driven.phase import Bridge, HeldRows, Modes, Motion, Phase
from heelstrike.sim.event_driven.rows import write_row
from heelstrike.sim.event_driven.smooth.candidates import (
    free_acceleration,
    hold_row,
    solve_candidates,
    tell_parts,
)
from heelstrike.sim.event_driven.smooth.corners import IMPACT, report_joints, report_points
from heelstrike.sim.event_driven.smooth.dynamics import (
    evaluate,
    observe_rows,
    solve_constraints,
)
from heelstrike.sim.event_driven.smooth.faces import has_corners, locate, stand_on_face
from heelstrike.sim.event_driven.smooth.gaps import free_gap_acceleration, gap_rows, gap_velocity
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Equations, Loops, Memory, Surface
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import log_event, note_residual
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
def gather_near(
    length: float, bouncing: bool, model: Model, begin: Floats, free_end: Floats, rate: Floats,
    restitution: Floats, tree: Workspace, rows: Rows, modes: Modes, candidate: Integers,
    leaf: Integers, jacobian: Floats, problem: ContactProblem, added: Floats,
) -> int:  # fmt: skip
    """List what could touch within a bridge, and dry joints, with Jacobian rows and free terms.

    What is left of a gap may still close, at leisure. The free velocity is in `free_end`, the free
    acceleration is `rate`. What is no velocity of the normal free term goes to `added`, too.
    Returns how many candidates there are.
    """
    v, after = begin[model.nq :], free_end[model.nq :]
    free, first, count = problem.free, problem.first, 0
    for contact in range(modes.watched):
        kind, owner, gap = rows.kind[contact], rows.owner[contact], rows.gap[contact]
        is_dry = kind == DRY_JOINT
        if is_dry and modes.closed[contact] == 0:
            continue
        passes = is_of_ground(contact, rows) and modes.passing[owner] == 1
        if passes or (kind == SECOND_FACE and gap == np.inf):
            continue
        row = place_candidate(contact, count, rows.components[contact], candidate, first)
        gap_rows(contact, count, model, tree, rows, first, leaf, jacobian)
        normal = row_product(jacobian, row, after)
        if not is_dry and gap > length * max(CLOSING_SPEED, -2.0 * normal):
            continue
        free_gap_acceleration(
            contact, row, model, tree, rows, modes.face, modes.curvature, rate, jacobian, free
        )
        came = row_product(jacobian, row, v)
        for each in range(row, first[count + 1]):
            free[each] = row_product(jacobian, each, v) + length * free[each]
        added[count] = 0.0
        if is_dry:
            problem.bound[count] = length * modes.breakaway[owner]
        elif gap > CLOSED_GAP:
            added[count] = gap / length
        free[row] += added[count]
        if bouncing and not is_dry and gap <= CLOSED_GAP and came < -SLOW:
            added[count] = restitution[contact] * came
            free[row] += added[count]
        count += 1
    return count


@kernel
def find_faces(
    model: Model, ground: GroundModel, tree: Workspace, closed: Integers, seconds: int,
    located: Located, face: Integers, surface: Surface,
) -> None:  # fmt: skip
    """Put the open points on their nearest faces, for what else they could meet from there.

    The second faces are the entries of the table from `seconds` on.
    """
    for point in range(model.nc if ground.concave == 1 else 0):
        if closed[point] == 0:
            face[point] = NO_FACE
            second = seconds + point
            stand_on_face(point, second, model, ground, tree, closed, located, face, surface)


@kernel
def leave_faces(model: Model, closed: Integers, face: Integers) -> None:
    """Let the open points be on no face again."""
    for point in range(model.nc):
        if closed[point] == 0:
            face[point] = NO_FACE


@kernel
def collect_impulses(
    count: int, watched: int, assembly: Assembly, added: Floats, mode: Integers, impulse: Floats
) -> None:
    """Write what the bridge found: impulses, and modes of what does not leave by its end.

    Its velocity then is that of the problem, which knows how the ground turns under the robot in
    this time, but for restitution and gaps that close.
    """
    answer, first = assembly.answer, assembly.problem.first
    tell_parts(count, watched, assembly, answer.impulse, impulse)
    for place in range(count):
        if not answer.velocity[first[place]] - added[place] > CLOSED_GAP:
            mode[assembly.candidate[place]] = answer.mode[place]


@kernel
def made_energy(count: int, assembly: Assembly, added: Floats) -> bool:
    """Whether the impulses, beside what the known forces did, made energy."""
    delassus, impulse = assembly.problem.delassus, assembly.answer.impulse
    first = assembly.problem.first
    made = 0.0
    through = 0.0
    for place in range(count):
        for row in range(first[place], first[place + 1]):
            before = assembly.problem.free[row]
            if row == first[place]:
                before -= added[place]
            after = before
            for column in range(first[count]):
                after += delassus[row, column] * impulse[column]
            made += impulse[row] * (before + after)
            through += abs(impulse[row]) * (abs(before) + abs(after))
    return made > NOTICEABLE_ENERGY * through


@kernel
def lend_faces(count: int, candidate: Integers, rows: Rows, modes: Modes, lent: Integers) -> None:
    """Keep the second faces of candidates, which open ones would look for again wherever they are.

    Those that are lent so are marked.
    """
    for second in range(rows.first[SECOND_FACE], modes.watched):
        lent[second] = 0
    for place in range(count):
        contact = candidate[place]
        if rows.kind[contact] == SECOND_FACE and modes.closed[contact] == 0:
            lent[contact], modes.closed[contact] = 1, 1


@kernel
def return_faces(rows: Rows, modes: Modes, lent: Integers) -> None:
    """Take back what :func:`lend_faces` did."""
    for second in range(rows.first[SECOND_FACE], modes.watched):
        if lent[second] == 1:
            lent[second], modes.closed[second] = 0, 0


@kernel
def keeps_face(contact: int, ground: GroundModel, rows: Rows, face: Integers) -> bool:
    """Whether a candidate is a contact that will be on the same face at the end of a bridge."""
    if rows.kind[contact] == DRY_JOINT:
        return False
    if rows.kind[contact] in (STOP, SECOND_FACE, CONSTRAINT):
        return True
    return face[contact] != NO_FACE or not has_corners(ground)


@kernel
def put_in_place(
    count: int, total: int, model: Model, ground: GroundModel, begin: Floats, added: Floats,
    equations: Equations, rows: Rows, surface: Surface, assembly: Assembly, loops: Loops,
    modes: Modes, held: HeldRows, kept: Floats, end: Floats,
) -> None:  # fmt: skip
    """Put on the ground what the bridge presses there at its end, and close the loops.

    The `count` contacts among the `total` candidates come before the loops.
    """
    face, tree, candidate, directions = (
        modes.face, equations.tree, assembly.candidate, assembly.directions,
    )  # fmt: skip
    impulse, velocity = assembly.answer.impulse, assembly.answer.velocity
    first = assembly.problem.first
    for row in range(first[total]):
        kept[row] = impulse[row]
    for _ in range(2):
        observe_rows(end, model, ground, tree, rows, modes, surface, loops)
        size = 0
        for place in range(count):
            contact = candidate[place]
            leaves = velocity[first[place]] - added[place] > CLOSED_GAP
            pressed = kept[first[place]] > 0.0 and not leaves
            if pressed and keeps_face(contact, ground, rows, face):
                size = hold_row(place, first[place], 0.0, size, held)
        contacts = size
        for place in range(count, total):
            size = hold_row(place, first[place], 0.0, size, held)
        for i in range(size):
            contact = candidate[held.place[i]]
            off = rows.gap[contact] if i < contacts else loops.rows.displacement[i - contacts]
            held.system[i, size] = -off
        observe_rows(begin, model, ground, tree, rows, modes, surface, loops)
        solve_constraints(size, 0.0, assembly.problem.delassus, held)
        for row in range(first[total]):
            impulse[row] = 0.0
        for i in range(size):
            impulse[held.row[i]] = held.unknown[i]
        add_impulse(model, first[total], impulse, directions, equations, end[: model.nq])
    for row in range(first[total]):
        impulse[row] = kept[row]


@kernel
def turn_rows(
    count: int, total: int, model: Model, ground: GroundModel, begin: Floats, end: Floats,
    added: Floats, tree: Workspace, rows: Rows, modes: Modes, surface: Surface,
    assembly: Assembly, loops: Loops,
) -> None:  # fmt: skip
    """Let the free terms be those with which velocities at the end are what the problem says."""
    v, free, velocity = end[model.nq :], assembly.problem.free, assembly.answer.velocity
    first = assembly.problem.first
    observe_rows(end, model, ground, tree, rows, modes, surface, loops)
    for place in range(count, total):
        row = first[place]
        free[row] += speed_along(place - count, loops, v) - velocity[row]
    for place in range(count):
        contact = assembly.candidate[place]
        if not keeps_face(contact, ground, rows, modes.face):
            continue
        row = first[place]
        normal, tangent = gap_velocity(contact, model, tree, rows, v)
        free[row] += normal - (velocity[row] - added[place])
        if is_of_ground(contact, rows):
            free[row + 1] += tangent - velocity[row + 1]
    observe_rows(begin, model, ground, tree, rows, modes, surface, loops)


@kernel
def move_on(model: Model, length: float, begin: Floats, end: Floats) -> None:
    """Write where the velocities at the end lead to."""
    for i in range(model.nv):
        end[i] = begin[i] + length * end[model.nq + i]


@kernel
def solve_bridge(
    count: int, total: int, length: float, scene: Scene, begin: Floats, memory: Memory,
    phase: Phase, bridge: Bridge,
) -> bool:  # fmt: skip
    """Find the impulses of the candidates, and where they lead; return success."""
    model, ground, modes = scene.model, scene.ground, phase.modes
    rows, loops, surface = memory.rows, memory.loops, memory.surface
    equations, assembly, end, added = memory.equations, memory.assembly, bridge.end, bridge.added
    directions, impulse = assembly.directions, assembly.answer.impulse
    for attempt in range(2):
        status = solve_candidates(
            count, loops, False, surface.friction, memory.reaction.mode, rows, modes.slide,
            phase.forces.solvers, assembly, memory.solver,
        )  # fmt: skip
        note_residual(assembly.answer.residual, memory.tally)
        if status != SOLVED or made_energy(total, assembly, added):
            return False
        copy_words(bridge.free_end, end)
        size = assembly.problem.first[total]
        add_impulse(model, size, impulse, directions, equations, end[model.nq :])
        move_on(model, length, begin, end)
        put_in_place(
            count, total, model, ground, begin, added, equations, rows, surface, assembly, loops,
            modes, phase.held, bridge.kept, end,
        )  # fmt: skip
        if attempt == 0:
            turn_rows(
                count, total, model, ground, begin, end, added, equations.tree, rows, modes,
                surface, assembly, loops,
            )  # fmt: skip
    return True


@kernel
def find_impulses(
    scene: Scene, length: float, bouncing: bool, control: Control, memory: Memory, work: Motion
) -> bool:
    """Find a bridge of some length from ``step.begin`` to ``bridge.end``; return success.

    The velocities behind the impulses of the contacts go to ``bridge.after``, the impulses to
    ``impact.impulse``, what the contacts do at the end of it to ``memory.reaction.mode``.
    """
    phase, step, impact, bridge = work.phase, work.step, work.impact, work.bridge
    model, ground, modes, rows = scene.model, scene.ground, phase.modes, memory.rows
    equations, assembly, loops = memory.equations, memory.assembly, memory.loops
    directions, first = assembly.directions, assembly.problem.first
    begin, end, free_end, after = step.begin, bridge.end, bridge.free_end, bridge.after
    mode, impulse, closed, face = memory.reaction.mode, impact.impulse, modes.closed, modes.face
    leave_faces(model, closed, face)
    evaluate(scene, step.time, begin, control, memory, phase, step.slopes[0])
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        modes.slide[dry] = 0
    free_acceleration(
        model, begin, memory.torque, rows, modes.slide, modes.breakaway, memory.pushes, equations,
        phase.saddle.force,
    )  # fmt: skip
    for i in range(model.nv):
        free_end[model.nq + i] = begin[model.nq + i] + length * equations.rate[i]
    seconds, located = rows.first[SECOND_FACE], Located(rows.gap, rows.position, rows.normal)
    find_faces(model, ground, equations.tree, closed, seconds, located, face, memory.surface)
    for contact in range(modes.watched):
        mode[contact] = OPEN
    count = gather_near(
        length, bouncing, model, begin, free_end, equations.rate, memory.surface.restitution,
        equations.tree, rows, modes, assembly.candidate, directions.leaf, directions.jacobian,
        assembly.problem, bridge.added,
    )  # fmt: skip
    total = append_loops(count, loops, assembly)
    free_loops(total, loops, free_end[model.nq :], 0.5 * length, assembly)
    for place in range(count, total):
        bridge.added[place] = 0.0
    copy_words(free_end, end)
    move_on(model, length, begin, end)
    if total > 0:
        assemble_delassus(model, total, equations, directions, assembly.problem)
        lend_faces(count, assembly.candidate, rows, modes, bridge.lent)
        solved = solve_bridge(count, total, length, scene, begin, memory, phase, bridge)
        return_faces(rows, modes, bridge.lent)
        if not solved:
            return False
    collect_impulses(count, modes.watched, assembly, bridge.added, mode, impulse)
    for place in range(count):
        if rows.kind[assembly.candidate[place]] == DRY_JOINT:  # a finite force works on the way
            for row in range(first[place], first[place + 1]):
                assembly.answer.impulse[row] = 0.0
    finite = True
    for i in range(model.nv):
        finite = finite and np.isfinite(end[i])
    copy_words(begin, after)
    if total > 0:
        moved = after[model.nq :]
        add_impulse(model, first[total], assembly.answer.impulse, directions, equations, moved)
    return finite


@kernel
def end_of_parts(
    scene: Scene, parts: int, length: float, bouncing: bool, control: Control, memory: Memory,
    work: Motion, end: Floats,
) -> None:  # fmt: skip
    """Write where so many bridges end that take some time together; where they begin without."""
    begin, here, found = work.step.begin, work.bridge.here, True
    copy_words(begin, here)
    for _ in range(parts):
        found = found and find_impulses(scene, length / parts, bouncing, control, memory, work)
        copy_words(work.bridge.end, begin)
    copy_words(begin if found else here, end)
    copy_words(here, begin)


@kernel
def find_bridge(
    scene: Scene, length: float, control: Control, memory: Memory, work: Motion
) -> tuple[bool, float]:
    """Find a bridge of some length; return success, and how far its end may be wrong."""
    end, halved, quartered = work.bridge.end, work.bridge.halved, work.bridge.quartered
    for attempt in range(2):
        bouncing = attempt == 0
        end_of_parts(scene, 2, length, bouncing, control, memory, work, halved)
        end_of_parts(scene, 4, length, bouncing, control, memory, work, quartered)
        if find_impulses(scene, length, bouncing, control, memory, work):
            wrong, doubt = 0.0, 0.0
            for i in range(halved.shape[0]):
                first = FROM_HALVES * (end[i] - halved[i])
                second = FROM_QUARTERS * (halved[i] - quartered[i])
                wrong = max(wrong, abs(first))
                doubt = max(doubt, abs(first - second))
            return True, wrong + doubt
    return False, 0.0


@kernel
def adopt_end(
    model: Model, ground: GroundModel, mode: Integers, begin: Floats, equations: Equations,
    rows: Rows, surface: Surface, modes: Modes,
) -> None:  # fmt: skip
    """Let the contacts do at the end of the bridge what it found."""
    q, v, tree = begin[: model.nq], begin[model.nq :], equations.tree
    closed, slide, face = modes.closed, modes.slide, modes.face
    evaluate_equations(model, q, v, equations)
    for point in range(model.nc):
        face[point] = NO_FACE
    locate(q, v, model, ground, tree, rows, modes, surface)
    for contact in range(modes.watched):
        kind, owner = rows.kind[contact], rows.owner[contact]
        modes.stuck[contact], slide[contact] = 0, 0
        if kind == DRY_JOINT:
            if closed[contact] == 1 and mode[contact] != STICK:
                slide[contact] = heading(v[owner])
            continue
        if kind == SECOND_FACE and rows.gap[owner] <= CLOSED_GAP:
            located = Located(rows.gap, rows.position, rows.normal)
            stand_on_face(owner, contact, model, ground, tree, closed, located, face, surface)
        normal, tangent = gap_velocity(contact, model, tree, rows, v)
        # What has come down by the end of the bridge meets the ground there.
        holds = mode[contact] != OPEN and normal >= -SETTLED
        closed[contact] = 1 if rows.gap[contact] <= CLOSED_GAP and holds else 0
        if closed[contact] == 1 and mode[contact] != STICK:
            slide[contact] = heading(tangent)


@kernel
def cross_bridge(
    scene: Scene, stop: float, control: Control, memory: Memory, work: Motion, record: Record
) -> bool:
    """Lay a bridge from now on, to `stop` at the longest; return success.

    ``step.begin`` becomes the state at its end, ``series.length`` its length.
    """
    phase, step, bridge, series = work.phase, work.step, work.bridge, work.series
    impact, output = work.impact, work.output
    model, modes, rows, begin, time = scene.model, phase.modes, memory.rows, step.begin, step.time
    if output.last_row < time:
        write_row(scene, True, control, memory, work, record)
    if time - series.begin >= PROGRESS:
        series.begin = time
        series.count = 0
    found = False
    wrong = 0.0
    while not found and series.count < MOST_BRIDGES:
        wish = SHORTEST_BRIDGE * LONGER**series.count
        series.length = min(wish, stop - time)
        found, wrong = find_bridge(scene, series.length, control, memory, work)
        if series.length == wish or not found:
            series.count += 1
    if not found:
        return False
    log_event(time, BRIDGE, 0, series.length, wrong, record.told)
    closed, slipping = memory.reported.closed, memory.reported.slipping
    report_points(
        IMPACT, time, rows.first[SECOND_FACE], rows.normal, impact, closed, slipping, record
    )
    report_joints(time, rows, impact.impulse, closed, record.told)
    for contact in range(modes.watched):
        if rows.kind[contact] != DRY_JOINT:
            modes.closed[contact] = 0
        modes.carrier[contact] = 0
        modes.holder[contact] = 0
    leave_faces(model, modes.closed, modes.face)
    for i in range(model.nq, begin.shape[0]):
        begin[i] = bridge.after[i]
    row = record.rows
    write_row(scene, True, control, memory, work, record)
    friction_torque = record.friction_torque[row]
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        friction_torque[rows.owner[dry]] = impact.impulse[dry, 1] / series.length
    share_friction(model, modes.breakaway, friction_torque, record.brake_torque[row])
    copy_words(bridge.end, begin)
    for point in range(model.nc):
        impact.meets[point] = 0
    adopt_end(
        model, scene.ground, memory.reaction.mode, begin, memory.equations, rows, memory.surface,
        modes,
    )  # fmt: skip
    work.decision.bridging = 0
    return True
