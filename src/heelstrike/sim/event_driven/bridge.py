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
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.brakes import share_friction
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
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.candidates import free_acceleration, solve_candidates
from heelstrike.sim.event_driven.corners import is_struck, log_impulse
from heelstrike.sim.event_driven.dynamics import evaluate, observe_faces, solve_constraints
from heelstrike.sim.event_driven.faces import has_corners, locate, stand_on_face
from heelstrike.sim.event_driven.gaps import (
    free_gap_acceleration,
    gap_now,
    gap_rows,
    gap_velocity,
)
from heelstrike.sim.event_driven.impact import IMPACT, NOTICEABLE, heading
from heelstrike.sim.event_driven.phase import Phase
from heelstrike.sim.event_driven.rows import write_row
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Assembly, Memory, Reaction, Reported
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import JOINT_STOP, TOUCHDOWN, log_event, note_residual

BRIDGE = int(EventKind.BRIDGE)

# Length (s) of the first bridge of a series, how much longer each further one is, and how many
# there may be; progress (s) that ends a series.
SHORTEST_BRIDGE = 1e-6
LONGER = 4.0
MOST_BRIDGES = 10
PROGRESS = 1e-3
# Gap (m) up to which a contact touches; speed (m/s, rad/s) at which another might within a bridge.
TOUCHING = 1e-9
CLOSING_SPEED = 20.0
# Approach (m/s, rad/s) at the end of a bridge that is no more than the turning of the rows leaves.
SETTLED = 1e-6
# Approach (m/s) below which a bridge knows no restitution: bounces so small are what piled up.
SLOW = 1e-3
# What a bridge of order one is wrong by grows with the square of its length: its halves together
# are half as wrong as the whole, its quarters a quarter. So it is this many times as wrong as the
# whole is apart from the halves, and as these are from the quarters; what these two estimates
# differ by is how far the first may be wrong itself.
FROM_HALVES, FROM_QUARTERS = 2.0, 4.0
# Slopes of the step to come, where states can be kept until then.
HERE, HALVED, QUARTERED = 2, 3, 4


@kernel
def write_free(
    gap: float, length: float, contact: int, place: int, model: Model, phase: Phase, memory: Memory
) -> None:
    """Make a contact a candidate: what is left of its gap may still close, at leisure.

    The free acceleration is in ``equations.rate``. What is no velocity of the normal free term
    goes to ``phase.lean``, too.
    """
    assembly, v = memory.assembly, phase.begin[model.nq :]
    free, jacobian = assembly.problem.free, assembly.jacobian
    free_gap_acceleration(model, memory.contacts, memory.equations, contact, place, phase, assembly)
    for row in range(2 * place, 2 * place + 2):
        free[row] = row_product(jacobian, row, v) + length * free[row]
    phase.lean[place] = gap / length if gap > TOUCHING else 0.0
    free[2 * place] += phase.lean[place]
    if phase.first_dry <= contact < phase.first_second:
        assembly.problem.bound[place] *= length
    assembly.candidate[place] = contact


@kernel
def gather_near(model: Model, length: float, bouncing: bool, phase: Phase, memory: Memory) -> int:
    """List what could touch within a bridge, and dry joints, with Jacobian rows and free terms.

    The free velocity is in ``phase.trial``. Returns how many.
    """
    assembly, state, trial = memory.assembly, phase.begin, phase.trial
    jacobian, restitution = assembly.jacobian, memory.surface.restitution
    count = 0
    for contact in range(phase.watched):
        if contact < model.nc and phase.passing[contact] == 1:
            continue
        if contact >= phase.first_second:
            point = contact - phase.first_second
            if phase.passing[point] == 1 or phase.seconds.gap[point] == np.inf:
                continue
        if phase.first_dry <= contact < phase.first_second and phase.closed[contact] == 0:
            continue
        gap_rows(model, memory.equations.tree, memory.contacts, phase, contact, count, assembly)
        if phase.first_dry <= contact < phase.first_second:
            write_free(0.0, length, contact, count, model, phase, memory)
            count += 1
            continue
        gap = gap_now(contact, memory.contacts, phase, state)
        normal = row_product(jacobian, 2 * count, trial[model.nq :])
        if gap > length * max(CLOSING_SPEED, -2.0 * normal):
            continue
        write_free(gap, length, contact, count, model, phase, memory)
        came = row_product(jacobian, 2 * count, state[model.nq :])
        if bouncing and gap <= TOUCHING and came < -SLOW:
            phase.lean[count] = restitution[contact] * came
            assembly.problem.free[2 * count] += phase.lean[count]
        count += 1
    return count


@kernel
def find_faces(model: Model, ground: GroundModel, memory: Memory, phase: Phase) -> None:
    """Put the open points on their nearest faces, for what else they could meet from there."""
    if phase.watched == phase.first_second:
        return
    contacts, tree, surface = memory.contacts, memory.equations.tree, memory.surface
    for point in range(model.nc):
        if phase.closed[point] == 0:
            phase.face[point] = NO_FACE
            stand_on_face(model, ground, tree, point, contacts, surface, phase)


@kernel
def leave_faces(model: Model, phase: Phase) -> None:
    """Let the open points be on no face again."""
    for point in range(model.nc):
        if phase.closed[point] == 0:
            phase.face[point] = NO_FACE


@kernel
def collect_impulses(count: int, assembly: Assembly, reaction: Reaction, phase: Phase) -> None:
    """Write what the bridge found: impulses, and modes of what does not leave by its end.

    Its velocity then is that of the problem, which knows how the ground turns under the robot in
    this time, but for restitution and gaps that close.
    """
    impulse, velocity = assembly.answer.impulse, assembly.answer.velocity
    for place in range(count):
        contact = assembly.candidate[place]
        phase.impulse[contact, 0] = impulse[2 * place]
        phase.impulse[contact, 1] = impulse[2 * place + 1]
        if not velocity[2 * place] - phase.lean[place] > TOUCHING:
            reaction.mode[contact] = assembly.answer.mode[place]


@kernel
def made_energy(count: int, assembly: Assembly, phase: Phase) -> bool:
    """Whether the impulses, beside what the known forces did, made energy."""
    delassus, impulse = assembly.problem.delassus, assembly.answer.impulse
    made = 0.0
    through = 0.0
    for row in range(2 * count):
        before = assembly.problem.free[row]
        if row % 2 == 0:
            before -= phase.lean[row // 2]
        after = before
        for column in range(2 * count):
            after += delassus[row, column] * impulse[column]
        made += impulse[row] * (before + after)
        through += abs(impulse[row]) * (abs(before) + abs(after))
    return made > NOTICEABLE * through


@kernel
def lend_faces(count: int, assembly: Assembly, phase: Phase) -> None:
    """Keep the second faces of candidates, which open ones would look for anew wherever they are.

    Those that are lent so are marked in ``phase.hit``.
    """
    for contact in range(phase.first_second, phase.watched):
        phase.hit[contact] = 0
    for place in range(count):
        contact = assembly.candidate[place]
        if contact >= phase.first_second and phase.closed[contact] == 0:
            phase.hit[contact], phase.closed[contact] = 1, 1


@kernel
def return_faces(phase: Phase) -> None:
    """Take back what :func:`lend_faces` did."""
    for contact in range(phase.first_second, phase.watched):
        if phase.hit[contact] == 1:
            phase.hit[contact], phase.closed[contact] = 0, 0


@kernel
def keeps_face(contact: int, model: Model, ground: GroundModel, phase: Phase) -> bool:
    """Whether a candidate is a contact that will be on the same face at the end of a bridge."""
    if phase.first_dry <= contact < phase.first_second:
        return False
    return contact >= model.nc or phase.face[contact] != NO_FACE or not has_corners(ground)


@kernel
def reach_end(
    total: int, length: float, free_end: Floats, scene: Scene, memory: Memory, phase: Phase
) -> None:
    """Write where the impulses lead to ``phase.end``, from velocities without them."""
    model, begin, end = scene.model, phase.begin, phase.end
    for i in range(model.nv):
        end[model.nq + i] = free_end[model.nq + i]
    if total > 0:
        add_impulse(model, memory.assembly, total, memory.equations, end[model.nq :])
    for i in range(model.nv):
        end[i] = begin[i] + length * end[model.nq + i]


@kernel
def observe_rows(state: Floats, scene: Scene, memory: Memory, phase: Phase) -> None:
    """Kinematics, contact points, and loops of a state (q, v)."""
    model, tree = scene.model, memory.equations.tree
    observe_faces(model, scene.ground, state, phase, memory)
    if rows_of(memory.loops) > 0:
        find_loops(model, state[: model.nq], state[model.nq :], tree, memory.loops)


@kernel
def put_in_place(count: int, total: int, scene: Scene, memory: Memory, phase: Phase) -> None:
    """Put on the ground what the bridge presses there at its end, and close the loops.

    The `count` contacts among the `total` candidates come before the loops.
    """
    model, assembly, end = scene.model, memory.assembly, phase.end
    impulse, velocity, kept = (
        assembly.answer.impulse,
        assembly.answer.velocity,
        phase.saddle.impulse,
    )
    for row in range(2 * total):
        kept[row] = impulse[row]
    for _ in range(2):
        observe_rows(end, scene, memory, phase)
        size = 0
        for place in range(count):
            contact = assembly.candidate[place]
            leaves = velocity[2 * place] - phase.lean[place] > TOUCHING
            if (
                kept[2 * place] > 0.0
                and not leaves
                and keeps_face(contact, model, scene.ground, phase)
            ):
                phase.row[size] = 2 * place
                size += 1
        pressed = size
        for place in range(count, total):
            phase.row[size] = 2 * place
            size += 1
        for i in range(pressed):
            contact = assembly.candidate[phase.row[i] // 2]
            phase.system[i, size] = -gap_now(contact, memory.contacts, phase, end)
        for i in range(pressed, size):
            phase.system[i, size] = -memory.loops.rows.displacement[i - pressed]
        observe_rows(phase.begin, scene, memory, phase)
        solve_constraints(size, 0.0, assembly.problem.delassus, phase)
        for row in range(2 * total):
            impulse[row] = 0.0
        for i in range(size):
            impulse[phase.row[i]] = phase.unknown[i]
        add_impulse(model, assembly, total, memory.equations, end[: model.nq])
    for row in range(2 * total):
        impulse[row] = kept[row]


@kernel
def turn_rows(count: int, total: int, scene: Scene, memory: Memory, phase: Phase) -> None:
    """Let the free terms be those with which velocities at the end are what the problem says."""
    model, assembly = scene.model, memory.assembly
    free, velocity = assembly.problem.free, assembly.answer.velocity
    observe_rows(phase.end, scene, memory, phase)
    for place in range(count, total):
        along = speed_along(place - count, memory.loops, phase.end[model.nq :])
        free[2 * place] += along - velocity[2 * place]
    for place in range(count):
        contact = assembly.candidate[place]
        if not keeps_face(contact, model, scene.ground, phase):
            continue
        normal, tangent = gap_velocity(
            contact, model, memory.contacts, memory.equations.tree, phase, phase.end
        )
        free[2 * place] += normal - (velocity[2 * place] - phase.lean[place])
        if not model.nc <= contact < phase.first_dry:
            free[2 * place + 1] += tangent - velocity[2 * place + 1]
    observe_rows(phase.begin, scene, memory, phase)


@kernel
def solve_bridge(
    count: int, total: int, length: float, free_end: Floats, scene: Scene, memory: Memory,
    phase: Phase,
) -> bool:  # fmt: skip
    """Find the impulses of the candidates, and where they lead; return success."""
    assembly, guess, friction = memory.assembly, memory.reaction.mode, memory.surface.friction
    for attempt in range(2):
        status = solve_candidates(count, memory.loops, False, friction, guess, phase, assembly)
        note_residual(assembly.answer.residual, memory.tally)
        if status != SOLVED or made_energy(total, assembly, phase):
            return False
        reach_end(total, length, free_end, scene, memory, phase)
        put_in_place(count, total, scene, memory, phase)
        if attempt == 0:
            turn_rows(count, total, scene, memory, phase)
    return True


@kernel
def find_impulses(
    scene: Scene, length: float, bouncing: bool, control: Control, memory: Memory, phase: Phase
) -> bool:
    """Find a bridge of some length from ``phase.begin`` to ``phase.end``; return success.

    The velocities behind the impulses of the contacts go to ``phase.trial``, the impulses to
    ``phase.impulse``, what the contacts do at the end of it to ``memory.reaction.mode``.
    """
    model, equations, assembly = scene.model, memory.equations, memory.assembly
    begin, end, trial, answer = phase.begin, phase.end, phase.trial, memory.assembly.answer
    leave_faces(model, phase)
    evaluate(scene, phase.time, begin, control, memory, phase, phase.slopes[0])
    for contact in range(phase.first_dry, phase.first_second):
        phase.slide[contact] = 0
    free_acceleration(model, begin, memory.torque, phase, memory.pushes, equations)
    for i in range(model.nv):
        trial[model.nq + i] = begin[model.nq + i] + length * equations.rate[i]
    find_faces(model, scene.ground, memory, phase)
    for contact in range(phase.watched):
        memory.reaction.mode[contact] = OPEN
        phase.impulse[contact, 0] = 0.0
        phase.impulse[contact, 1] = 0.0
    count = gather_near(model, length, bouncing, phase, memory)
    total = append_loops(count, memory.loops, assembly)
    free_loops(total, memory.loops, trial[model.nq :], 0.5 * length, assembly)
    for place in range(count, total):
        phase.lean[place] = 0.0
    reach_end(0, length, trial, scene, memory, phase)
    if total > 0:
        assemble_delassus(model, total, equations, assembly)
        lend_faces(count, assembly, phase)
        solved = solve_bridge(count, total, length, trial, scene, memory, phase)
        return_faces(phase)
        if not solved:
            return False
    collect_impulses(count, assembly, memory.reaction, phase)
    for place in range(count):
        contact = assembly.candidate[place]
        if phase.first_dry <= contact < phase.first_second:  # a finite force works on the way
            answer.impulse[2 * place] = 0.0
            answer.impulse[2 * place + 1] = 0.0
    finite = True
    for i in range(model.nv):
        finite = finite and np.isfinite(end[i])
        trial[i] = begin[i]
        trial[model.nq + i] = begin[model.nq + i]
    if total > 0:
        add_impulse(model, assembly, total, equations, trial[model.nq :])
    return finite


@kernel
def copy_state(source: Floats, state: Floats) -> None:
    """Copy a state (q, v)."""
    for i in range(source.shape[0]):
        state[i] = source[i]


@kernel
def end_of_parts(
    scene: Scene, parts: int, length: float, bouncing: bool, control: Control, memory: Memory,
    phase: Phase, end: Floats,
) -> None:  # fmt: skip
    """Write where so many bridges end that take some time together; where they begin without."""
    here = phase.slopes[HERE]
    copy_state(phase.begin, here)
    found = True
    for _ in range(parts):
        found = found and find_impulses(scene, length / parts, bouncing, control, memory, phase)
        copy_state(phase.end, phase.begin)
    copy_state(phase.begin if found else here, end)
    copy_state(here, phase.begin)


@kernel
def find_bridge(
    scene: Scene, length: float, control: Control, memory: Memory, phase: Phase
) -> tuple[bool, float]:
    """Find a bridge of some length; return success, and how far its end may be wrong."""
    halved, quartered = phase.slopes[HALVED], phase.slopes[QUARTERED]
    for attempt in range(2):
        bouncing = attempt == 0
        end_of_parts(scene, 2, length, bouncing, control, memory, phase, halved)
        end_of_parts(scene, 4, length, bouncing, control, memory, phase, quartered)
        if find_impulses(scene, length, bouncing, control, memory, phase):
            wrong, doubt = 0.0, 0.0
            for i in range(halved.shape[0]):
                first = FROM_HALVES * (phase.end[i] - halved[i])
                second = FROM_QUARTERS * (halved[i] - quartered[i])
                wrong = max(wrong, abs(first))
                doubt = max(doubt, abs(first - second))
            return True, wrong + doubt
    return False, 0.0


@kernel
def report_impulses(
    model: Model, wrong: float, contacts: Contacts, phase: Phase, reported: Reported, record: Record
) -> None:
    """Append the bridge to the events, and the impulses of the contacts."""
    log_event(phase.time, BRIDGE, 0, phase.length, wrong, record)
    for contact in range(phase.first_dry):
        normal = phase.impulse[contact, 0]
        struck = is_struck(contact, phase) if contact < model.nc else normal > 0.0
        if not struck:
            continue
        if contact >= model.nc:
            joint = phase.stop_joint[contact - model.nc]
            log_event(phase.time, JOINT_STOP, joint, normal, 0.0, record)
            reported.closed[contact] = 1
            continue
        kind = IMPACT
        if reported.closed[contact] == 0:
            kind = TOUCHDOWN
            reported.closed[contact] = 1
            reported.slipping[contact] = 0
        log_impulse(kind, contact, contacts, phase, record)


@kernel
def adopt_end(model: Model, ground: GroundModel, memory: Memory, phase: Phase) -> None:
    """Let the contacts do at the end of the bridge what it found."""
    tree, contacts, mode = memory.equations.tree, memory.contacts, memory.reaction.mode
    evaluate_equations(model, phase.begin[: model.nq], phase.begin[model.nq :], memory.equations)
    for contact in range(model.nc):
        phase.face[contact] = NO_FACE
        phase.meets[contact] = 0
    locate(model, ground, tree, phase, contacts, memory.surface)
    for contact in range(phase.watched):
        phase.stuck[contact] = 0
        phase.slide[contact] = 0
        if contact >= phase.first_second:
            point = contact - phase.first_second
            if contacts.gap[point] <= TOUCHING:
                stand_on_face(model, ground, tree, point, contacts, memory.surface, phase)
        elif contact >= phase.first_dry:
            if phase.closed[contact] == 1 and mode[contact] != STICK:
                joint = phase.dry_joint[contact - phase.first_dry]
                phase.slide[contact] = heading(phase.begin[model.nq + joint])
            continue
        touches = gap_now(contact, contacts, phase, phase.begin) <= TOUCHING
        normal, tangent = gap_velocity(contact, model, contacts, tree, phase, phase.begin)
        # What has come down by the end of the bridge meets the ground there.
        holds = mode[contact] != OPEN and normal >= -SETTLED
        phase.closed[contact] = 1 if touches and holds else 0
        if phase.closed[contact] == 1 and mode[contact] != STICK:
            phase.slide[contact] = heading(tangent)


@kernel
def cross(
    scene: Scene, stop: float, control: Control, memory: Memory, phase: Phase, record: Record
) -> bool:
    """Lay a bridge from now on, to `stop` at the longest; return success.

    ``phase.begin`` becomes the state at its end, ``phase.length`` its length.
    """
    model = scene.model
    if phase.last_row < phase.time:
        write_row(scene, phase.time, phase.begin, True, control, memory, phase, record)
    if phase.time - phase.series >= PROGRESS:
        phase.series = phase.time
        phase.bridges = 0
    found = False
    wrong = 0.0
    while not found and phase.bridges < MOST_BRIDGES:
        wish = SHORTEST_BRIDGE * LONGER**phase.bridges
        phase.length = min(wish, stop - phase.time)
        found, wrong = find_bridge(scene, phase.length, control, memory, phase)
        if phase.length == wish or not found:
            phase.bridges += 1
    if not found:
        return False
    report_impulses(model, wrong, memory.contacts, phase, memory.reported, record)
    for contact in range(phase.watched):
        if not phase.first_dry <= contact < phase.first_second:
            phase.closed[contact] = 0
        phase.carrier[contact] = 0
        phase.holder[contact] = 0
    leave_faces(model, phase)
    for i in range(model.nv):
        phase.begin[model.nq + i] = phase.trial[model.nq + i]
    row = record.rows
    write_row(scene, phase.time, phase.begin, True, control, memory, phase, record)
    for dry in range(phase.dry_joint.shape[0]):
        torque = phase.impulse[phase.first_dry + dry, 1] / phase.length
        record.friction_torque[row, phase.dry_joint[dry]] = torque
    share_friction(model, phase.breakaway, record.friction_torque[row], record.brake_torque[row])
    for i in range(phase.begin.shape[0]):
        phase.begin[i] = phase.end[i]
    adopt_end(model, scene.ground, memory, phase)
    phase.bridging = 0
    return True
