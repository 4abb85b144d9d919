"""Event-driven simulation: smooth phases between events, impacts at events (paper section 2).

Between events every contact point keeps its mode and the motion is integrated with high order and
adaptive steps. What ends a phase - a touchdown, a normal force that vanishes, friction that reaches
its limit, a sliding point that comes to rest - is located on the dense output of the step, the step
is repeated to end there, and the acceleration-level problem (eq. 15-19) decides the modes of the
next phase; at a touchdown the impact law (eq. 20-22) first decides the velocities.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numba import types

from heelstrike.compiler.compilation import kernel, loop_for
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import OPEN, SOLVED
from heelstrike.contact.solvers.search import try_solvers
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities, momentum
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.contact_geometry import contact_velocity, locate_contacts, observe
from heelstrike.sim.controller.asking import ask
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.controller.interface import CONTROLLER_TYPE, MODEL_TYPE, Contacts
from heelstrike.sim.dry_friction import dry_force
from heelstrike.sim.engine import (
    BAD_CONTROLLER,
    DIVERGED,
    DONE,
    FELL,
    PAUSED,
    RECORD_FULL,
    SOLVER_FAILED,
    Engine,
    Setting,
    solver_order,
)
from heelstrike.sim.event_driven.candidates import solve_candidates
from heelstrike.sim.event_driven.dormand_prince import SLOPES, interpolate
from heelstrike.sim.event_driven.dynamics import evaluate, project
from heelstrike.sim.event_driven.gaps import gap_now, gap_velocity
from heelstrike.sim.event_driven.impact import REST, collide, heading, strike
from heelstrike.sim.event_driven.location import integrate, shortest_step, total_weight
from heelstrike.sim.event_driven.modes import (
    JOINT_STOP,
    adopt_modes,
    form_groups,
    log_event,
    note_residual,
    report_modes,
)
from heelstrike.sim.event_driven.phase import (
    ABSOLUTE,
    BURST,
    CLOSED,
    END,
    FALLEN,
    FINISHED,
    FIRED,
    FORCED,
    JAMMED,
    LAST_EVENT,
    LAST_IMPACT,
    LAST_ROW,
    LENGTH,
    LET_PASS,
    LONGEST,
    NEXT_PUSH,
    OUTPUT_PERIOD,
    PAUSE,
    PAUSE_STEP,
    REASON,
    RELATIVE,
    ROW,
    ROW_EVERY,
    SAMPLE,
    SAMPLE_PERIOD,
    STARTED,
    STEP,
    TIME,
    UNDECIDED,
    Phase,
    allocate_phase,
)
from heelstrike.sim.memory import (
    PENETRATION,
    STEPS,
    Memory,
    Record,
)
from heelstrike.sim.push import switch_at
from heelstrike.sim.record_size import check_room, check_steps
from heelstrike.sim.recording import center_height, limit_torque, sound
from heelstrike.sim.status import EventKind

ZENO = int(EventKind.ZENO)
PAINLEVE = int(EventKind.PAINLEVE)

# Points nearer to the ground than this (m) share an impact; at the start of a run, and slower than
# this (m/s), they are on it.
TOGETHER = 1e-10
ON_THE_GROUND = 1e-6
# Speed (m/s) of approach that makes a sliding point without consistent force collide.
NUDGE = 1e-10
# Torque (relative) that a controller may change between two looks at the same instant.
JUMP = 1e-7
# An event is followed by another in the same instant when less than this (s) lies between.
INSTANT = 1e-10
# Mark of a point that touches the ground without force or speed, until it is known what happens.
UNPRESSED = 2
# So many in a row are switched by what fired; so many end the run.
INSISTENT = 8
TOO_MANY = 100

# How far ahead (s) forces that reached a limit are looked at, first and last; how far beyond it, as
# a fraction of the weight, they must be by then; how often modes are tried in one instant.
FIRST_LOOK = 1e-9
LAST_LOOK = 1e-4
CLEARLY = 1e-7
LOOKS = 24

# What the controller did when it was asked.
BAD = 0
SAME = 1
JUMPED = 2

# Seconds between two calls of a Python controller that has no period of its own.
PYTHON_PERIOD = 1e-3

# Places in the life of a simulation: the first contact modes are being decided; they have been.
BEGUN = 1
WALKING = 2

# Why the loop gave up.
STEP_TOO_SHORT = 1
EVENTS_WITHOUT_END = 2
NO_CONSISTENT_FORCE = 3


@dataclass(frozen=True, kw_only=True)
class EventDriven:
    """Adaptive high-order integration between events, which are found to 1e-12 s.

    Parameters
    ----------
    rtol, atol : float
        Error that a step may make in each coordinate and velocity: ``atol + rtol |y|``.
    max_step : float
        Longest step in seconds; an open contact point that would touch the ground and leave it
        again within a quarter of this may only be seen thanks to its velocity.
    output_period : float or None
        Seconds between two rows of the record, which come from the dense output and cost no
        accuracy; None for a row at every step. Events have rows of their own: one, or two if
        velocities jump.
    solver : str
        Contact solver tried first: ``"lemke"``, ``"fischer_burmeister"`` or ``"gauss_seidel"``.
    swing_feet_pass : bool
        A rule for passive walkers, whose legs of equal length scuff the ground at mid-stance: a
        point that reaches the ground behind a point already on it, seen in the direction in which
        the robot moves, passes below the ground until it comes up again.

    Raises
    ------
    SimulationError
        If a tolerance, the longest step or the output period is not a positive finite number.

    Notes
    -----
    Without a `control_period` a compiled controller acts continuously. Its memory changes only at
    the ends of steps, and the contact forces it sees are those at the last of these; right after an
    impact, a point that was hit but carries no force shows its impulse (N s) instead. A Python
    controller is called every `control_period`, by default 1 ms, and its torques are held.
    """

    rtol: float = 1e-8
    atol: float = 1e-10
    max_step: float = 0.05
    output_period: float | None = 1e-3
    solver: str = "lemke"
    swing_feet_pass: bool = False

    # Impulses of impacts are in the run's events, not in the forces of its rows.
    impulses_in_events: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for name in ("rtol", "atol", "max_step", "output_period"):
            value = getattr(self, name)
            if not (value is None and name == "output_period") and not 0.0 < value < np.inf:
                raise SimulationError(f"{name} must be a positive number, got {value}")
        if self.rtol < 1e-14:
            raise SimulationError(f"rtol = {self.rtol} is below what floating point can hold")
        solver_order(self.solver)

    def engine(self, setting: Setting) -> Engine:
        """Return this way through time, compiled and ready to run.

        Raises
        ------
        SimulationError
            If the robot begins in the ground, or with a joint beyond its range; if steps or rows
            are too many to be counted or kept.
        """
        return _EventDrivenEngine(self, setting)


@kernel
def copy_row(
    row: int,
    time: float,
    state: Floats,
    torque: Floats,
    contacts: Contacts,
    residual: Floats,
    record: Record,
) -> None:
    """Copy everything but the contact forces to a row of the record."""
    nv = record.q.shape[1]
    record.time[row] = time
    for i in range(nv):
        record.q[row, i] = state[i]
        record.v[row, i] = state[nv + i]
        record.stop_torque[row, i] = 0.0
        record.friction_torque[row, i] = 0.0
    for i in range(torque.shape[0]):
        record.torque[row, i] = torque[i]
    for i in range(contacts.gap.shape[0]):
        for k in range(2):
            record.point[row, i, k] = contacts.position[i, k]
            record.normal[row, i, k] = contacts.normal[i, k]
            record.force[row, i, k] = 0.0
        record.gap[row, i] = contacts.gap[i]
        record.slip[row, i] = 0.0
    for k in range(3):
        record.residual[row, k] = residual[k]


@kernel
def write_row(
    controller: Any,
    model: Model,
    ground: GroundModel,
    parameters: Floats,
    kept: Floats,
    spare: Floats,
    memory: Memory,
    record: Record,
    phase: Phase,
    order: Integers,
    time: float,
    state: Floats,
) -> None:
    """Append a state, put on its constraints, with the certified contact forces in it."""
    contacts = memory.contacts
    for i in range(state.shape[0]):
        phase.trial[i] = state[i]
    project(model, ground, memory, phase, phase.trial)
    evaluate(
        controller, model, ground, parameters, kept, spare, memory, phase, time, phase.trial,
        phase.slopes[SLOPES - 1], True,
    )  # fmt: skip
    for k in range(3):
        memory.residual[k] = 0.0
    count = phase.count[CLOSED]
    if count > 0:
        solve_candidates(count, memory, phase.slide, True, order)
        note_residual(memory.residual, memory.extreme)
    row = record.row_count[0]
    copy_row(row, time, phase.trial, memory.torque, contacts, memory.residual, record)
    points = contacts.gap.shape[0]
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    dry_force(
        phase.dry_joint, phase.slide[first:], model.dry_friction, record.friction_torque[row]
    )  # fmt: skip
    for contact in range(points):
        if phase.passing[contact] == 0:
            memory.extreme[PENETRATION] = max(memory.extreme[PENETRATION], -contacts.gap[contact])
    for place in range(count):
        contact = memory.candidate[place]
        if contact >= first:
            joint = phase.dry_joint[contact - first]
            record.friction_torque[row, joint] = memory.impulse[2 * place + 1]
            continue
        if contact >= points:
            stop = contact - points
            record.stop_torque[row, phase.stop_joint[stop]] += (
                phase.stop_side[stop] * memory.impulse[2 * place]
            )
            continue
        record.force[row, contact, 0] = memory.impulse[2 * place]
        record.force[row, contact, 1] = memory.impulse[2 * place + 1]
        _, record.slip[row, contact] = contact_velocity(
            model.contact_link[contact], contacts.position[contact], contacts.normal[contact],
            memory.tree,
        )  # fmt: skip
    record.row_count[0] = row + 1
    phase.clock[LAST_ROW] = time
    period = phase.clock[OUTPUT_PERIOD] * phase.count[ROW_EVERY]
    if period > 0.0 and abs(phase.count[ROW] * period - time) <= 1e-12:
        phase.count[ROW] += 1


@kernel
def extrapolate(ahead: float, begin: Floats, slope: Floats, state: Floats) -> None:
    """Where the state comes to in a moment if its accelerations stay as they are."""
    nv = begin.shape[0] // 2
    for i in range(nv):
        state[i] = begin[i] + ahead * (begin[nv + i] + 0.5 * ahead * slope[nv + i])
        state[nv + i] = begin[nv + i] + ahead * slope[nv + i]


@kernel
def insist(phase: Phase) -> None:
    """Switch what fired, without asking the acceleration-level problem first."""
    for contact in range(phase.closed.shape[0]):
        if phase.closed[contact] == 1 and phase.fired[2 * contact] == 1:
            phase.closed[contact] = 0
            phase.slide[contact] = 0
        elif phase.holder[contact] == 1 and phase.fired[2 * contact + 1] == 1:
            phase.slide[contact] = -1 if phase.force[contact, 1] > 0.0 else 1


@kernel
def decide(
    controller: Any,
    model: Model,
    ground: GroundModel,
    parameters: Floats,
    kept: Floats,
    spare: Floats,
    memory: Memory,
    record: Record,
    phase: Phase,
    order: Integers,
    weight: float,
    forced: bool,
    jammed: bool,
) -> bool:
    """Decide the contact modes of the phase that begins now; return success.

    If contact forces ended the last phase (`forced`), the acceleration-level problem is put a
    moment ahead, where the state comes to if the modes stay as they are: at the very instant at
    which a normal force vanishes or friction reaches its limit, the old modes and the new are
    equally right. Where the problem has no solution, or forces grow without bound before a sliding
    point (`jammed`), the velocities jump without a collision (Painlevé's paradox). Where it has
    several, the points leave the ground if that is one of them.
    """
    time = phase.clock[TIME]
    contacts = phase.closed.shape[0]
    dry = contacts - phase.dry_joint.shape[0]
    points = model.contact_link.shape[0]
    ahead = FIRST_LOOK if forced else 0.0
    for _ in range(LOOKS):
        extrapolate(ahead, phase.begin, phase.slopes[0], phase.trial)
        evaluate(
            controller, model, ground, parameters, kept, spare, memory, phase, time + ahead,
            phase.trial, phase.slopes[1], True,
        )  # fmt: skip
        if forced:
            forced = False
            for i in range(2 * contacts):
                if phase.fired[i] == 1 and phase.value[i] > -CLEARLY * weight:
                    forced = ahead < LAST_LOOK
            if forced:
                ahead *= 4.0
                continue
            if phase.count[BURST] >= INSISTENT:
                insist(phase)
                phase.count[BURST] += 1
                continue
        count = phase.count[CLOSED]
        if not jammed and count > 0:
            jammed = solve_candidates(count, memory, phase.slide, True, order) != SOLVED
            if jammed and ahead > 0.0:
                ahead = 0.0
                continue
        if jammed:
            jammed = False
            for contact in range(dry):
                phase.hit[contact] = 0
                phase.plastic[contact] = phase.closed[contact]
            solved, _ = collide(model, memory, phase, order, phase.begin, NUDGE)
            for contact in range(dry):
                phase.plastic[contact] = 0
                if phase.impulse[contact, 0] > 0.0 and contact >= points:
                    log_event(
                        record, time, JOINT_STOP, phase.stop_joint[contact - points],
                        phase.impulse[contact, 0], 0.0,
                    )  # fmt: skip
                elif phase.impulse[contact, 0] > 0.0:
                    log_event(
                        record, time, PAINLEVE, contact, phase.impulse[contact, 0],
                        phase.impulse[contact, 1],
                    )  # fmt: skip
            if not solved:
                return False
            continue
        several = False
        apart = True
        for place in range(count):
            contact = memory.candidate[place]
            if contact >= dry:
                continue
            row = 2 * place
            apart = apart and memory.free[row] >= 0.0
            lean = -phase.slide[contact] * memory.friction[contact]
            if memory.delassus[row, row] + lean * memory.delassus[row, row + 1] <= 0.0:
                # Pressing it harder would push it into the ground: there are other solutions.
                several = True
                log_event(record, time, PAINLEVE, contact, 0.0, 0.0)
        if several and apart:
            for place in range(count):
                if memory.candidate[place] < dry:
                    memory.problem_mode[place] = OPEN
        if count > 0:
            note_residual(memory.residual, memory.extreme)
        adopt_modes(count, memory.candidate, memory.problem_mode, memory.mode, phase)
        nv = model.parent.shape[0]
        forward_kinematics(model, phase.begin[:nv], memory.tree)
        locate_contacts(model, ground, memory)
        form_groups(
            model, memory.contacts.position, memory.contacts.normal, memory.friction,
            memory.tree.angle, phase,
        )  # fmt: skip
        project(model, ground, memory, phase, phase.begin)
        report_modes(time, phase, memory, record, phase.count[STARTED] == BEGUN)
        return True
    return False


@kernel
def behind(contact: int, direction: float, contacts: Contacts, phase: Phase) -> bool:
    """Whether a point is behind one on the ground and, by the rule, may pass below it."""
    for other in range(contacts.gap.shape[0]):
        ahead = contacts.position[other, 0] - contacts.position[contact, 0]
        if phase.closed[other] == 1 and direction * ahead > 0.0:
            return phase.count[LET_PASS] == 1
    return False


@kernel
def begin_dry_joints(memory: Memory, phase: Phase) -> None:
    """Let joints with dry friction begin as they move."""
    first = phase.closed.shape[0] - phase.dry_joint.shape[0]
    for dry in range(phase.dry_joint.shape[0]):
        phase.slide[first + dry] = heading(memory.v[phase.dry_joint[dry]])
        memory.closed[first + dry] = 1
        memory.slipping[first + dry] = phase.slide[first + dry]


@kernel
def find_what_happened(
    starting: bool,
    direction: float,
    model: Model,
    memory: Memory,
    phase: Phase,
) -> tuple[bool, bool]:
    """Tell what ended the step: whether an impact, or contact forces at their limits.

    Points that touch the ground without speed are closed, sliding ones that stop are at rest; an
    impact goes through those that touch without force. At the start of a run every point near the
    ground touches it.
    """
    impact = False
    forced = False
    contacts = memory.contacts
    points = contacts.gap.shape[0]
    rest = ON_THE_GROUND if starting else REST
    for contact in range(phase.closed.shape[0]):
        phase.hit[contact] = 0
        first = phase.fired[2 * contact] == 1
        second = phase.fired[2 * contact + 1] == 1
        if phase.closed[contact] == 0:
            gap = gap_now(contact, contacts, phase, phase.begin)
            normal, tangent = gap_velocity(
                contact, model, contacts, memory.tree, phase, phase.begin
            )
            if starting:
                phase.group[contact] = contact
                if contact < points and gap < -ON_THE_GROUND:
                    phase.passing[contact] = phase.count[LET_PASS]
                first = gap <= ON_THE_GROUND and normal <= rest and phase.passing[contact] == 0
            if phase.passing[contact] == 1:
                phase.passing[contact] = 0 if first else 1
            elif (
                first
                and not starting
                and contact < points
                and behind(contact, direction, contacts, phase)
            ):
                phase.passing[contact] = 1
            elif normal < -rest and (first or gap <= TOGETHER):
                phase.hit[contact] = 1
                impact = True
            elif first:
                phase.closed[contact] = 1
                phase.slide[contact] = 0
                if abs(tangent) > rest:
                    phase.slide[contact] = 1 if tangent > 0.0 else -1
            elif gap <= TOGETHER and normal <= rest:
                phase.hit[contact] = UNPRESSED
        elif second and phase.slide[contact] != 0:
            for other in range(phase.closed.shape[0]):
                if phase.group[other] == phase.group[contact]:
                    phase.slide[other] = 0
        elif first or second:
            forced = True
    for contact in range(phase.closed.shape[0]):
        if phase.hit[contact] == UNPRESSED:
            phase.hit[contact] = 1 if impact else 0
    return impact, forced and not impact


@kernel
def control(
    controller: Any,
    model: Model,
    ground: GroundModel,
    parameters: Floats,
    kept: Floats,
    memory: Memory,
    phase: Phase,
) -> int:
    """Ask the controller, if it is due, and let pushes begin and end.

    Returns BAD, SAME or JUMPED, which is what the forces did.
    """
    clock, count = phase.clock, phase.count
    nv = model.parent.shape[0]
    jumped, clock[NEXT_PUSH] = switch_at(memory.pushes, clock[TIME])
    period = clock[SAMPLE_PERIOD]
    if period > 0.0:
        if clock[TIME] < count[SAMPLE] * period:
            return JUMPED if jumped else SAME
        count[SAMPLE] += 1
    state = phase.begin
    forward_kinematics(model, state[:nv], memory.tree)
    link_velocities(model, state[nv:], memory.tree)
    locate_contacts(model, ground, memory)
    ask(
        controller, clock[TIME], state[:nv], state[nv:], model, memory, parameters, kept,
        memory.torque,
    )  # fmt: skip
    if not limit_torque(model, memory):
        return BAD
    for i in range(memory.torque.shape[0]):
        change = abs(memory.torque[i] - phase.torque[i])
        jumped = jumped or change > JUMP * (1.0 + abs(memory.torque[i]))
        phase.torque[i] = memory.torque[i]
    return JUMPED if jumped else SAME


@kernel
def next_stop(clock: Floats, count: Integers, accumulation: Floats) -> float:
    """Time that the next step may not pass."""
    stop = min(clock[END], clock[PAUSE], clock[NEXT_PUSH])
    if clock[SAMPLE_PERIOD] > 0.0:
        stop = min(stop, count[SAMPLE] * clock[SAMPLE_PERIOD])
    for contact in range(accumulation.shape[0]):
        stop = min(stop, accumulation[contact])
    return stop


@kernel
def end_bounces(memory: Memory, record: Record, phase: Phase) -> None:
    """Let the points rest whose accumulating impacts have come to an end by now."""
    for contact in range(phase.closed.shape[0]):
        if phase.accumulation[contact] <= phase.clock[TIME]:
            if contact < memory.contacts.gap.shape[0]:
                log_event(record, phase.accumulation[contact], ZENO, contact, 0.0, 0.0)
            phase.accumulation[contact] = np.inf


@kernel
def end_step(memory: Memory, record: Record, phase: Phase) -> None:
    """Move time and state to the end of the finished step."""
    clock = phase.clock
    stop = next_stop(clock, phase.count, phase.accumulation)
    clock[TIME] += clock[LENGTH]
    if abs(clock[TIME] - stop) <= 4e-16 * max(abs(stop), 1e-3):
        clock[TIME] = stop
    for i in range(phase.begin.shape[0]):
        phase.begin[i] = phase.end[i]
    points = memory.contacts.gap.shape[0]
    for contact in range(points):
        memory.contacts.force[contact, 0] = phase.end_force[contact, 0]
        memory.contacts.force[contact, 1] = phase.end_force[contact, 1]
    end_bounces(memory, record, phase)
    phase.count[FINISHED] = 0
    memory.tally[STEPS] += 1
    if phase.count[FIRED] == 1:
        together = clock[TIME] - clock[LAST_EVENT] < INSTANT
        phase.count[BURST] = phase.count[BURST] + 1 if together else 0
        clock[LAST_EVENT] = clock[TIME]


def _advance(
    controller: Any,
    model: Model,
    ground: GroundModel,
    parameters: Floats,
    kept: Floats,
    spare: Floats,
    memory: Memory,
    record: Record,
    phase: Phase,
    order: Integers,
) -> int:
    """Advance an event-driven simulation until it ends or something stops it.

    Parameters
    ----------
    kept, spare : (m,) float
        Memory of the controller, and as much scratch for the calls that it shall forget.
    """
    clock, count = phase.clock, phase.count
    contacts = memory.contacts
    link = model.contact_link
    nv = model.parent.shape[0]
    weight = total_weight(model.mass, model.gravity)
    rows, events = record.row_count, record.event_count
    row_room = record.time.shape[0] - 4
    # In one instant: what each look of `decide` finds, and what else may happen to a contact.
    event_room = record.event_time.shape[0] - (LOOKS + 6) * phase.closed.shape[0] - 8
    period = clock[OUTPUT_PERIOD] * count[ROW_EVERY]
    while True:
        if rows[0] > row_room or events[0] > event_room:
            return RECORD_FULL
        starting = count[STARTED] == 0
        event = starting
        if count[FINISHED] == 1:
            # The rows due within the finished step; an event at its end has rows of its own, one
            # before it if velocities may jump.
            last = clock[TIME] + clock[LENGTH]
            touch = False
            if count[FIRED] == 1:
                last -= 1e-12
                for contact in range(phase.closed.shape[0]):
                    touch = touch or (phase.closed[contact] == 0 and phase.fired[2 * contact] == 1)
            due = period > 0.0 and count[ROW] * period <= last
            while due or touch:
                if rows[0] > row_room:
                    return RECORD_FULL
                time = clock[TIME] + clock[LENGTH]
                part = 1.0
                if due:
                    time = count[ROW] * period
                    part = (time - clock[TIME]) / clock[LENGTH]
                else:
                    touch = False
                interpolate(part, phase.begin, phase.dense, phase.slopes[SLOPES - 1])
                write_row(
                    controller, model, ground, parameters, kept, spare, memory, record, phase,
                    order, time, phase.slopes[SLOPES - 1],
                )  # fmt: skip
                due = period > 0.0 and count[ROW] * period <= last
            end_step(memory, record, phase)
            project(model, ground, memory, phase, phase.begin)
            event = count[FIRED] == 1
            if count[BURST] > TOO_MANY:
                count[REASON] = EVENTS_WITHOUT_END
                return DIVERGED
        elif starting:
            for i in range(nv):
                phase.begin[i] = memory.q[i]
                phase.begin[nv + i] = memory.v[i]
            begin_dry_joints(memory, phase)
        if event:
            evaluate(
                controller, model, ground, parameters, kept, spare, memory, phase, clock[TIME],
                phase.begin, phase.slopes[0], True,
            )  # fmt: skip
            momentum(model, memory.tree, phase.scratch[0])
            impact, forced = find_what_happened(starting, phase.scratch[0, 0], model, memory, phase)
            if impact:
                if not strike(model, ground, memory, record, phase, order):
                    count[REASON] = NO_CONSISTENT_FORCE
                    return SOLVER_FAILED
                # The controller shall know before the modes are decided under its torques.
                for contact in range(link.shape[0]):
                    if phase.hit[contact] == 1 and phase.impulse[contact, 0] > 0.0:
                        contacts.force[contact, 0] = phase.impulse[contact, 0]
                        contacts.force[contact, 1] = phase.impulse[contact, 1]
            count[STARTED] = BEGUN if starting else WALKING
            count[UNDECIDED] = 1
            count[FORCED] = 1 if forced else 0
        for i in range(nv):
            memory.q[i] = phase.begin[i]
            memory.v[i] = phase.begin[nv + i]
        if not sound(memory):
            return DIVERGED
        if center_height(model, ground, memory) < clock[FALLEN]:
            return FELL
        if clock[TIME] < clock[END] and (
            clock[TIME] >= clock[PAUSE] or memory.tally[STEPS] >= count[PAUSE_STEP]
        ):
            return PAUSED

        asked = control(controller, model, ground, parameters, kept, memory, phase)
        if asked == BAD:
            return BAD_CONTROLLER
        event = count[UNDECIDED] == 1
        if (event or asked == JUMPED) and not decide(
            controller, model, ground, parameters, kept, spare, memory, record, phase, order,
            weight, count[FORCED] == 1, count[JAMMED] == 1,
        ):  # fmt: skip
            count[REASON] = NO_CONSISTENT_FORCE
            return SOLVER_FAILED
        count[UNDECIDED] = 0
        count[FORCED] = 0
        count[JAMMED] = 0
        evaluate(
            controller, model, ground, parameters, kept, spare, memory, phase, clock[TIME],
            phase.begin, phase.slopes[0], True,
        )  # fmt: skip
        if event:
            for contact in range(link.shape[0]):
                contacts.force[contact, 0] = phase.force[contact, 0]
                contacts.force[contact, 1] = phase.force[contact, 1]
        over = clock[TIME] >= clock[END]
        every_step = period == 0.0 and memory.tally[STEPS] % count[ROW_EVERY] == 0
        if event or ((over or every_step) and clock[LAST_ROW] < clock[TIME]):
            write_row(
                controller, model, ground, parameters, kept, spare, memory, record, phase, order,
                clock[TIME], phase.begin,
            )  # fmt: skip
        if over:
            return DONE
        stop = next_stop(clock, count, phase.accumulation)
        if stop - clock[TIME] < shortest_step(clock[TIME]):
            # The same time but for rounding: 0.3 for one, 3 · 0.1 for the other.
            clock[TIME] = stop
            end_bounces(memory, record, phase)
            continue
        if not integrate(
            controller, model, ground, parameters, kept, spare, memory, phase, stop, weight
        ):
            # Forces that grow without bound before a sliding point end in a jump of velocity.
            for contact in range(link.shape[0]):
                if phase.slide[contact] != 0:
                    count[JAMMED] = 1
                    count[UNDECIDED] = 1
            count[BURST] += 1
            if count[JAMMED] == 0 or count[BURST] > INSISTENT:
                count[REASON] = STEP_TOO_SHORT
                return DIVERGED
            clock[STEP] = 1e-6


@lru_cache(maxsize=1)
def compiled_advance() -> tuple[Any, float]:
    """Compile the loop or load it from the cache; return it with the seconds that took."""
    begin = perf_counter()
    vector = types.float64[::1]
    signature = types.int64(
        CONTROLLER_TYPE,
        MODEL_TYPE,
        GroundModel.compiled_type(),
        vector,
        vector,
        vector,
        Memory.compiled_type(),
        Record.compiled_type(),
        Phase.compiled_type(),
        types.int64[::1],
    )
    try_solvers.begin()
    compiled = loop_for(signature, _advance)
    try_solvers.finish()
    return compiled, perf_counter() - begin


def _check_start(setting: Setting, swing_feet_pass: bool) -> None:
    """Refuse a state in the ground or beyond a joint stop: no motion leads there or out of it."""
    robot, memory = setting.robot, setting.memory
    observe(robot.model, setting.ground, memory)
    gap, normal = memory.contacts.gap, memory.contacts.normal
    inside = np.flatnonzero(gap < -ON_THE_GROUND)
    stands = bool(np.any(np.abs(gap) <= ON_THE_GROUND))
    if len(inside) and not (swing_feet_pass and stands):
        deepest = int(inside[np.argmin(gap[inside])])
        others = f" (and {len(inside) - 1} more)" if len(inside) > 1 else ""
        needed = float(np.max(-gap[inside] / normal[inside, 1]))
        raise SimulationError(
            f"contact point {robot.contact_names[deepest]!r}{others} begins "
            f"{-gap[deepest]:.3g} m deep in the ground. EventDriven knows no way out of it: raise "
            f"the robot by {needed:.3g} m, begin on the ground that the state was made for, or use "
            f"TimeStepping or Compliant, which push it out"
        )
    model = robot.model
    beyond = np.maximum(model.lower - memory.q, memory.q - model.upper)
    joint = int(np.argmax(beyond))
    if beyond[joint] > ON_THE_GROUND:
        raise SimulationError(
            f"joint {robot.joint_names[joint]!r} begins at {memory.q[joint]:.6g}, beyond its range "
            f"of {model.lower[joint]:.6g} to {model.upper[joint]:.6g}. EventDriven knows no way "
            f"back: begin within the range, or use TimeStepping or Compliant"
        )


class _EventDrivenEngine:
    """Event-driven simulation at work."""

    def __init__(self, method: EventDriven, setting: Setting) -> None:
        check_steps(setting, "max_step", method.max_step, recorded=method.output_period is None)
        if setting.control_period is not None:
            check_steps(setting, "control_period", setting.control_period, recorded=False)
        if method.output_period is None:
            check_room(setting, "max_step", method.max_step)  # and more, if steps get shorter
        else:
            check_steps(setting, "output_period", method.output_period)
            check_room(setting, "output_period", method.output_period)
        _check_start(setting, method.swing_feet_pass)
        self._advance, self.compile_s = compiled_advance()
        self._setting = setting
        self._phase = allocate_phase(setting.robot)
        self.spare = guarded(())
        self._order = solver_order(method.solver)
        self._phase.order[:] = self._order
        self.solver = method.solver
        clock, count = self._phase.clock, self._phase.count
        clock[STEP] = min(1e-3, method.max_step)
        clock[END] = setting.duration
        clock[PAUSE] = np.inf
        clock[OUTPUT_PERIOD] = method.output_period or 0.0
        clock[SAMPLE_PERIOD] = setting.control_period or 0.0
        clock[LONGEST] = method.max_step
        clock[NEXT_PUSH] = np.inf
        clock[LAST_EVENT] = -np.inf
        clock[LAST_IMPACT] = -np.inf
        clock[LAST_ROW] = -np.inf
        clock[RELATIVE] = method.rtol
        clock[ABSOLUTE] = method.atol
        clock[FALLEN] = setting.fallen_height
        count[ROW_EVERY] = setting.record_every
        count[LET_PASS] = int(method.swing_feet_pass)

    def _spare_for(self, controller_memory: Floats) -> Floats:
        if self.spare.size != controller_memory.size:
            self.spare = guarded(controller_memory)
        return self.spare

    @property
    def time(self) -> float:
        return float(self._phase.clock[TIME])

    @property
    def rows_left(self) -> int:
        clock, count = self._phase.clock, self._phase.count
        period = clock[OUTPUT_PERIOD] * count[ROW_EVERY]
        if period == 0.0:
            return 1024
        return int((clock[END] - clock[TIME]) / period) + 64

    @property
    def reason(self) -> str:
        """Why the loop gave up, in a person's words; empty if it did not."""
        return _REASONS.get(int(self._phase.count[REASON]), "")

    def pause_after(self, steps: int | None) -> None:
        clock, count = self._phase.clock, self._phase.count
        clock[PAUSE] = np.inf
        count[PAUSE_STEP] = np.iinfo(np.int64).max
        if steps is None:
            period = self._setting.control_period or PYTHON_PERIOD
            clock[SAMPLE_PERIOD] = period
            clock[PAUSE] = (int(count[SAMPLE]) + 1) * period
        else:
            count[PAUSE_STEP] = self._setting.memory.tally[STEPS] + steps

    def advance(
        self,
        controller: Any,
        parameters: Floats,
        controller_memory: Floats,
        record: Record,
    ) -> int:
        setting = self._setting
        return int(
            self._advance(
                controller,
                setting.robot.model,
                setting.ground,
                parameters,
                controller_memory,
                self._spare_for(controller_memory),
                setting.memory,
                record,
                self._phase,
                self._order,
            )
        )


_REASONS = {
    STEP_TOO_SHORT: "the step became too short to move time on",
    EVENTS_WITHOUT_END: "contact events followed each other without time moving on",
    NO_CONSISTENT_FORCE: "no contact forces or impulses agree with the laws of motion and friction",
}
