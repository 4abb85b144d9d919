"""Contact modes of the phase that begins: the acceleration-level problem (paper eq. 15-19).

At the very instant at which a force reaches its limit the old modes and the new are equally right,
so the problem is put a moment ahead; where it has no solution velocities jump without a collision.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.modes import OPEN, SOLVED
from heelstrike.contact.sets import INTERVAL, LINE
from heelstrike.contact.workspace import ContactProblem
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.loops import rows_of
from heelstrike.sim.contacts.rows import SECOND_FACE
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.impact import collide
from heelstrike.sim.event_driven.phase import Modes, Motion, Watch
from heelstrike.sim.event_driven.rows import write_row
from heelstrike.sim.event_driven.smooth.corners import report_joints, report_points
from heelstrike.sim.event_driven.smooth.dynamics import evaluate
from heelstrike.sim.event_driven.smooth.faces import begin_with_first, choose_faces, locate
from heelstrike.sim.event_driven.smooth.modes import adopt_modes, form_groups, report_modes
from heelstrike.sim.event_driven.smooth.projection import is_in_place, project
from heelstrike.sim.event_driven.smooth.saddle_point import solve_contacts
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Memory
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import log_event, note_residual
from heelstrike.tolerances import CLOSED_GAP

PAINLEVE = int(EventKind.PAINLEVE)
# At the start of a run, points nearer to the ground than this (m) and slower (m/s) are on it: no
# robot is placed more exactly than to a micrometre.
ON_THE_GROUND = 1e-6
# Speed (m/s) of approach that makes a sliding point without consistent force collide. As near to a
# pole of the forces as steps get that may be too little, and it is more each time, up to a most.
NUDGE, HARDER, HARDEST = 1e-10, 10.0, 1e-7
# So many in a row are switched by what fired.
INSISTENT = 8
# How far the first projection of a phase may move coordinates and velocities (m, rad, m/s, rad/s;
# of large ones, this part): at the start of a run, later, and how much further after a bridge, for
# each second of its length, up to a longest. Impacts and events leave nothing to be projected.
FITTING = 1e-4
UNSEEN = 1e-6
BRIDGED = 1e3
LONG_BRIDGE = 1e-6
# How far ahead (s) forces that reached a limit are looked at, first and last; how far beyond it, as
# a fraction of the weight, they must be by then; how often modes are tried in one instant.
# The first is a thousand times what events are located to; nine looks, each so many times as far,
# reach the last. Forces are noise below 1e-10.
FIRST_LOOK = 1e-9
LAST_LOOK = 1e-4
FURTHER = 4.0
CLEARLY = 1e-7
LOOKS = 24
# Forces that are so far beyond a limit, as a fraction of the weight, when a phase begins, are none.
CONTRADICTION = 1e-3
# Places in the life of a simulation: the first contact modes are being decided; they have been.
BEGUN = 1
WALKING = 2


@kernel
def extrapolate(model: Model, ahead: float, begin: Floats, slope: Floats, state: Floats) -> None:
    """Where the state comes to in a moment if its accelerations stay as they are."""
    for i in range(model.nq):
        v, v_dot = model.nq + i, slope[model.nq + i]
        state[i] = begin[i] + ahead * (begin[v] + 0.5 * ahead * v_dot)
        state[v] = begin[v] + ahead * v_dot


@kernel
def insist(fired: Integers, force: Floats, modes: Modes) -> None:
    """Switch what fired, without asking the acceleration-level problem first."""
    for contact in range(modes.watched):
        if modes.closed[contact] == 1 and fired[2 * contact] == 1:
            modes.closed[contact] = 0
            modes.slide[contact] = 0
        elif modes.holder[contact] == 1 and fired[2 * contact + 1] == 1:
            modes.slide[contact] = -1 if force[contact, 1] > 0.0 else 1


@kernel
def is_unclear(ahead: float, watch: Watch) -> bool:
    """Whether a force that reached its limit is not clearly beyond it in a moment."""
    for i in range(watch.fired.shape[0]):
        if watch.fired[i] == 1 and watch.value[i] > -CLEARLY * watch.force_scale:
            return ahead < LAST_LOOK
    return False


@kernel
def jump(model: Model, nudge: float, memory: Memory, work: Motion, record: Record) -> bool:
    """Let velocities jump without a collision (Painlevé's paradox); return success."""
    modes, step, impact, plastic = work.phase.modes, work.step, work.impact, work.bounces.plastic
    rows = memory.rows
    copy_words(step.begin, impact.before)
    for contact in range(modes.watched):
        impact.hit[contact] = 0
        plastic[contact] = modes.closed[contact]
    solved, _, _ = collide(model, nudge, memory, work)
    for contact in range(modes.watched):
        plastic[contact] = 0
    if solved:
        closed, slipping = memory.reported.closed, memory.reported.slipping
        report_points(
            PAINLEVE, step.time, rows.first[SECOND_FACE], rows.normal, impact, closed, slipping,
            record,
        )  # fmt: skip
        report_joints(step.time, rows, impact.impulse, closed, record.told)
    else:
        copy_words(impact.before, step.begin)
    return bool(solved)


@kernel
def leave_if_possible(
    count: int, candidate: Integers, problem: ContactProblem, friction: Floats, owner: Integers,
    slide: Integers, time: float, mode: Integers, record: Record,
) -> None:  # fmt: skip
    """Let all points leave the ground, if that is one of several solutions.

    `mode` are those of the candidates, `owner` of what each entry of the table is.
    """
    free, delassus, first = problem.free, problem.delassus, problem.first
    several = False
    apart = True
    for place in range(count):
        contact, row = candidate[place], first[place]
        if problem.set[place] == INTERVAL:
            continue
        apart = apart and free[row] >= 0.0
        ratio = -slide[contact] * friction[contact]
        across = delassus[row, first[place + 1] - 1]
        if delassus[row, row] + ratio * across <= 0.0:
            # Pressing it harder would push it into the ground: there are other solutions.
            several = True
            log_event(time, PAINLEVE, owner[contact], 0.0, 0.0, record.told)
    if several and apart:
        for place in range(count):
            if problem.set[place] not in (INTERVAL, LINE):
                mode[place] = OPEN


@kernel
def begin_phase(
    scene: Scene, count: int, control: Control, memory: Memory, work: Motion, record: Record
) -> bool:
    """Begin a phase with the modes that the acceleration-level problem has found, and evaluate it.

    Returns false if the state is not one of such modes, or the forces contradict them.
    """
    phase, step, series, decision = work.phase, work.step, work.series, work.decision
    modes, rows, assembly, surface = phase.modes, memory.rows, memory.assembly, memory.surface
    model, ground, equations, loops = scene.model, scene.ground, memory.equations, memory.loops
    answer, guess, tree = assembly.answer, memory.reaction.mode, equations.tree
    if rows_of(loops) == 0:  # with loops neither matrix nor free term tell enough
        leave_if_possible(
            count, assembly.candidate, assembly.problem, surface.friction, rows.owner, modes.slide,
            step.time, answer.mode, record,
        )  # fmt: skip
    if count > 0:
        note_residual(answer.residual, memory.tally)
    adopt_modes(count, assembly.candidate, answer.mode, rows, modes.closed, modes.slide, guess)
    begin, before = step.begin, decision.before
    q, v = begin[: model.nq], begin[model.nq :]
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    begin_with_first(rows, guess, modes, work.impact.hit, work.bounces)
    choose_faces(model, ground, tree, modes.closed, modes.face, rows)
    locate(q, v, model, ground, tree, rows, modes, surface)
    form_groups(model, tree.angle, q, surface.friction, rows, modes)
    copy_words(begin, before)
    step.left, strayed, fastest = project(
        model, ground, equations, rows, surface, assembly, loops, phase, begin
    )
    closest, slip = (ON_THE_GROUND, FITTING) if decision.started == BEGUN else (CLOSED_GAP, UNSEEN)
    if series.last_end == step.time:
        slip += BRIDGED * min(series.length, LONG_BRIDGE)
    fits = step.left <= closest
    for i in range(begin.shape[0]):
        fits = fits and abs(begin[i] - before[i]) <= slip * (1.0 + abs(before[i]))
    if not fits:
        copy_words(before, begin)
        step.left = strayed
        if not is_in_place(strayed, fastest):
            return False
    first, reported = record.told.events, memory.reported
    report_modes(
        step.time, decision.started == BEGUN, modes.watched, rows.kind, rows.owner, modes.closed,
        modes.slide, reported.closed, reported.slipping, record,
    )  # fmt: skip
    react(model, first, q, record.told, loops.held)
    decision.forced = decision.jammed = 0
    evaluate(scene, step.time, begin, control, memory, phase, step.slopes[0])
    return not contradicts_itself(modes, phase.watch, phase.forces.deficient)


@kernel
def decide_modes(
    scene: Scene, control: Control, memory: Memory, work: Motion, record: Record
) -> bool:
    """Decide the contact modes of the phase that begins now; return success.

    If contact forces ended the last phase (`forced`), the acceleration-level problem is put a
    moment ahead, where the state comes to if the modes stay as they are: at the very instant at
    which a normal force vanishes or friction reaches its limit, the old modes and the new are
    equally right. Where the problem has no solution, or forces grow without bound before a sliding
    point (`jammed`), the velocities jump without a collision (Painlevé's paradox). Where it has
    several, the points leave the ground if that is one of them.
    """
    phase, step, decision, model = work.phase, work.step, work.decision, scene.model
    forced, jammed = decision.forced == 1, decision.jammed == 1
    ahead = FIRST_LOOK if forced else 0.0
    nudge = NUDGE
    for _ in range(LOOKS):
        extrapolate(model, ahead, step.begin, step.slopes[0], decision.state)
        time = step.time + ahead
        evaluate(scene, time, decision.state, control, memory, phase, decision.slope)
        if forced:
            forced = is_unclear(ahead, phase.watch)
            if forced:
                ahead *= FURTHER
                continue
            if decision.burst >= INSISTENT:
                insist(phase.watch.fired, phase.forces.force, phase.modes)
                decision.burst += 1
                continue
        count = phase.forces.count
        if not jammed and count > 0:
            jammed = solve_contacts(count, True, model, memory, phase) != SOLVED
            if jammed and ahead > 0.0:
                ahead = 0.0
                continue
        if not jammed:
            return begin_phase(scene, count, control, memory, work, record)
        jammed = False
        if work.output.last_row < step.time:
            write_row(scene, False, control, memory, work, record)
        evaluate(scene, step.time, step.begin, control, memory, phase, decision.slope)
        if not jump(model, nudge, memory, work, record):
            return False
        nudge = min(HARDER * nudge, HARDEST)
    return False


@kernel
def contradicts_itself(modes: Modes, watch: Watch, deficient: int) -> bool:
    """Whether forces of the phase that begins are far beyond limits at once.

    At a pole of the forces, before which they grow without bound, the modes of a moment later may
    be none of now. An event function that is negative from the beginning would not end the phase.
    """
    if deficient == 1:
        return False
    least = -CONTRADICTION * watch.force_scale
    for contact in range(modes.watched):
        if modes.carrier[contact] == 1 and watch.value[2 * contact] < least:
            return True
        if modes.holder[contact] == 1 and watch.value[2 * contact + 1] < least:
            return True
    return False
