"""Event-driven simulation: smooth phases between events, impacts at events (paper section 2).

Between events every contact point keeps its mode and the motion is integrated with high order and
adaptive steps. What ends a phase - a touchdown, a normal force that vanishes, friction that reaches
its limit, a sliding point that comes to rest - is located on the dense output of the step, the step
is repeated to end there, and the acceleration-level problem (eq. 15-19) decides the modes of the
next phase; at a touchdown the impact law (eq. 20-22) first decides the velocities.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from heelstrike.arguments import check_fields
from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.modes import OPEN, SOLVED
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.sets import LINE
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities, momentum
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.brakes import awaits_hold, note_brakes, stops_any, take_hold
from heelstrike.sim.contacts.faces import NO_FACE, locate_on_face, take_surface
from heelstrike.sim.contacts.geometry import evaluate_equations
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.loops import close_loops, rows_of, steady_loops
from heelstrike.sim.contacts.rows import (
    DRY_JOINT,
    POINT,
    SECOND_FACE,
    STOP,
    Rows,
    contact_count,
    second_of,
)
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.event_driven.bridge import TOUCHING, cross
from heelstrike.sim.event_driven.corners import (
    impulse_of,
    is_struck,
    log_impulse,
    show_forces,
)
from heelstrike.sim.event_driven.dynamics import evaluate, is_in_place, project
from heelstrike.sim.event_driven.faces import (
    choose_faces,
    is_at_second,
    leave_second_face,
    locate,
    stand_on_face,
    turn_corner,
)
from heelstrike.sim.event_driven.gaps import gap_now, gap_velocity
from heelstrike.sim.event_driven.impact import REST, SHORTEST_BOUNCE, collide, heading, strike
from heelstrike.sim.event_driven.location import (
    EVENT_TIME,
    GAP_NOISE,
    TOGETHER,
    integrate,
    longest_turn,
    shortest_step,
)
from heelstrike.sim.event_driven.modes import adopt_modes, form_groups, report_modes
from heelstrike.sim.event_driven.phase import (
    Bounces,
    Decision,
    Faces,
    Impact,
    Modes,
    Motion,
    Phase,
    Step,
    Watch,
    allocate_motion,
)
from heelstrike.sim.event_driven.rows import (
    NO_ROOM,
    ROWS_OF_AN_INSTANT,
    TOO_FAR,
    write_row,
    write_rows_within,
)
from heelstrike.sim.event_driven.saddle_point import solve_accelerations
from heelstrike.sim.frame import DIVERGED, DONE, FORK, RECORD_FULL, SOLVER_FAILED, Kernels, Scene
from heelstrike.sim.memory import Assembly, Memory, Reported, Surface, Tally
from heelstrike.sim.method import Method, solver_order
from heelstrike.sim.push import switch_at
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import JOINT_STOP, log_event, note_residual
from heelstrike.sim.record.size import check_room, check_steps
from heelstrike.sim.setting import Setting

ZENO = int(EventKind.ZENO)
PAINLEVE = int(EventKind.PAINLEVE)

# Length (s) of the first step that is tried: error control shortens it tenfold, or lengthens it so.
FIRST_STEP = 1e-3
# At the start of a run, points nearer to the ground than this (m) and slower (m/s) are on it.
ON_THE_GROUND = 1e-6
# Feet nearer to each other than this (m) are beside each other.
BESIDE = 1e-6
# Speed (m/s) of approach that makes a sliding point without consistent force collide. As near to a
# pole of the forces as steps get that may be too little, and it is more each time, up to a most.
NUDGE, HARDER, HARDEST = 1e-10, 10.0, 1e-7
# Torque (relative) that a controller may change between two looks at the same instant.
JUMP = 1e-7
# An event is followed by another in the same instant when less than this (s) lies between.
INSTANT = 1e-10
# Mark of a point that touches the ground without force or speed, until it is known what happens.
UNPRESSED = 2
# Mark of one that is so near that nobody could tell, as at the top of a bounce too low to see.
LYING = 3
# So many in a row are switched by what fired.
INSISTENT = 8
# Events that may follow each other at once, and at once behind a bridge; how many more as time goes
# on, 1/s; steps too short to see count as a part of an event. What is more calls for a bridge.
EVENTS_AT_ONCE, EVENTS_A_BRIDGE = 200.0, 50.0
EVENTS_A_SECOND = 1e5
SHORT_STEP = 1e-6
SHARE_OF_A_STEP = 0.2

# How far the first projection of a phase may move coordinates and velocities (m, rad, m/s, rad/s;
# of large ones, this part): at the start of a run, later, and how much further after a bridge, for
# each second of its length, up to a longest. Impacts and events leave nothing to be projected.
FITTING = 1e-4
UNSEEN = 1e-6
BRIDGED = 1e3
LONG_BRIDGE = 1e-6

# How far ahead (s) forces that reached a limit are looked at, first and last; how far beyond it, as
# a fraction of the weight, they must be by then; how often modes are tried in one instant.
FIRST_LOOK = 1e-9
LAST_LOOK = 1e-4
CLEARLY = 1e-7
LOOKS = 24
# Forces that are so far beyond a limit, as a fraction of the weight, when a phase begins, are none.
CONTRADICTION = 1e-3

# Places in the life of a simulation: the first contact modes are being decided; they have been.
BEGUN = 1
WALKING = 2

# Why the loop gave up.
NO_BRIDGE = 1


@dataclass(frozen=True, kw_only=True)
class EventDriven(Method):
    """Adaptive high-order integration between events, which are found to 1e-12 s.

    Parameters
    ----------
    rtol, atol : float
        Error that a step may make in each coordinate and velocity: ``atol + rtol |y|``.
    max_step : float
        Longest step in seconds; an open contact point that would touch the ground and leave it
        again within a quarter of this may only be seen thanks to its velocity.
    output_period : float or None
        Seconds between two rows of the record, which change no step and are about as exact as the
        ends of steps. None for a row at every step. Events have rows of their own: one, or two if
        velocities jump.
    solver : str
        Contact solver tried first: ``"lemke"``, ``"fischer_burmeister"`` or ``"gauss_seidel"``.
    swing_feet_pass : bool
        A rule for passive walkers, whose legs of equal length scuff the ground at mid-stance: a
        point that reaches the ground beside or behind a point already on it, seen in the direction
        in which the robot moves, passes below the ground until it comes up again.

    Raises
    ------
    SimulationError
        If a tolerance, the longest step or the output period is not a positive finite number.

    Notes
    -----
    Without a `control_period` a compiled controller acts continuously. Its memory and log change
    only at the ends of steps - ``robot.trial`` tells a controller which calls are others - and the
    contact forces it sees are those at the last of these; right after an
    impact, a point that was hit but carries no force shows its impulse (N s) instead. A Python
    controller is called every `control_period`, by default 1 ms, and its torques are held.
    """

    rtol: float = 1e-8
    atol: float = 1e-10
    max_step: float = 0.05
    output_period: float | None = 1e-3
    solver: str = "lemke"
    swing_feet_pass: bool = False

    impulses_in_events: ClassVar[bool] = True
    python_period: ClassVar[float | None] = 1e-3

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        for name in ("rtol", "atol", "max_step", "output_period"):
            value = getattr(self, name)
            if not (value is None and name == "output_period") and not 0.0 < value < np.inf:
                raise SimulationError(f"{name} must be a positive number, got {value}")
        if self.rtol < 1e-14:
            raise SimulationError(f"rtol = {self.rtol} is below what floating point can hold")
        solver_order(self.solver)

    @property
    def solves_with(self) -> str:
        """Contact solver tried first."""
        return self.solver

    @property
    def row_period(self) -> tuple[str, float]:
        """Time between two rows: that of the output, or of the longest step."""
        if self.output_period is None:
            return "max_step", self.max_step  # there are more rows if steps get shorter
        return "output_period", self.output_period

    def new_work(self, robot: Robot) -> Motion:
        """Allocate its memory."""
        work = allocate_motion(robot)
        step, decision = work.step, work.decision
        work.phase.forces.solvers[:] = solver_order(self.solver)
        step.next_length = min(FIRST_STEP, self.max_step)
        step.longest = self.max_step
        step.relative, step.absolute = self.rtol, self.atol
        work.output.period = self.output_period or 0.0
        decision.next_push = np.inf
        decision.allowance = EVENTS_AT_ONCE
        work.series.begin = work.series.last_end = -np.inf
        decision.last_event = work.bounces.last_blow = work.output.last_row = -np.inf
        work.phase.modes.let_pass = int(self.swing_feet_pass)
        return work

    def room(self, robot: Robot) -> tuple[int, int]:
        """Return how many rows and events an instant may add to the record.

        These are what each look of `decide_modes` finds, and what else may happen to a contact.
        """
        others = 2 * robot.model.latches + robot.model.brakes
        contacts = contact_count(robot.model)
        return ROWS_OF_AN_INSTANT, (LOOKS + 6) * contacts + others + 8

    def check(self, setting: Setting) -> None:
        """Refuse a state in the ground or beyond a joint stop: no motion leads out of it."""
        robot, state = setting.robot, setting.state
        at = contact_kinematics(robot, state.q, state.v, setting.ground)
        inside = np.flatnonzero(at.gap < -ON_THE_GROUND)
        stands = bool(np.any(np.abs(at.gap) <= ON_THE_GROUND))
        if len(inside) and not (self.swing_feet_pass and stands):
            deepest = int(inside[np.argmin(at.gap[inside])])
            others = f" (and {len(inside) - 1} more)" if len(inside) > 1 else ""
            needed = float(np.max(-at.gap[inside] / at.normal[inside, 1]))
            raise SimulationError(
                f"contact point {robot.contact_names[deepest]!r}{others} begins "
                f"{-at.gap[deepest]:.3g} m deep in the ground. EventDriven knows no way out of it: "
                f"raise the robot by {needed:.3g} m, begin on the ground that the state was made "
                f"for, or use TimeStepping or Compliant, which push it out"
            )
        model = robot.model
        beyond = np.maximum(model.lower - state.q, state.q - model.upper)
        joint = int(np.argmax(beyond))
        if beyond[joint] > ON_THE_GROUND:
            raise SimulationError(
                f"joint {robot.joint_names[joint]!r} begins at {state.q[joint]:.6g}, beyond its "
                f"range of {model.lower[joint]:.6g} to {model.upper[joint]:.6g}. EventDriven knows "
                f"no way back: begin within the range, or use TimeStepping or Compliant"
            )

    def check_span(self, setting: Setting, duration: float) -> None:
        """Refuse a time whose steps cannot be counted, or whose record does not fit into memory."""
        check_steps(
            setting, duration, "max_step", self.max_step, recorded=self.output_period is None
        )
        if setting.control_period is not None:
            check_steps(setting, duration, "control_period", setting.control_period, recorded=False)
        if self.output_period is not None:
            check_steps(setting, duration, *self.row_period)
        check_room(setting, duration, *self.row_period)

    def forget_ground(
        self, robot: Robot, work: Motion, clock: Clock, *, stops: bool = False
    ) -> None:
        """Look for what touches the ground as at the beginning."""
        modes = work.phase.modes
        kept = slice(0, 0) if stops else slice(robot.nc, len(modes.closed) - robot.nc)
        for told, nothing in (
            *((each, 0) for each in (modes.closed, modes.slide, modes.stuck, modes.passing)),
            (work.bounces.accumulation, np.inf),
        ):
            before = told[kept].copy()
            told[:] = nothing
            told[kept] = before
        work.phase.faces.face[:] = NO_FACE
        work.phase.watch.fired[:] = 0
        clock.begun = 0

    def reconsider(self, work: Motion) -> None:
        """Decide contact modes anew: what they hang on has been changed."""
        work.decision.undecided = 1

    def rows_in(self, duration: float, record_every: int) -> int:
        """Return about how many rows the record of a time has."""
        return 1024 if self.output_period is None else super().rows_in(duration, record_every) + 64

    def reason(self, work: Motion) -> str:
        """Say why a simulation could not go on."""
        return _REASONS.get(work.series.reason, "")


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
        if watch.fired[i] == 1 and watch.value[i] > -CLEARLY * watch.weight:
            return ahead < LAST_LOOK
    return False


@kernel
def jump(
    model: Model, nudge: float, memory: Memory, phase: Phase, step: Step, impact: Impact,
    plastic: Integers, record: Record,
) -> bool:  # fmt: skip
    """Let velocities jump without a collision (Painlevé's paradox); return success."""
    modes = phase.modes
    begin, before = step.begin, impact.before
    for i in range(begin.shape[0]):
        before[i] = begin[i]
    for contact in range(modes.watched):
        impact.hit[contact] = 0
        plastic[contact] = modes.closed[contact]
    solved, _, _ = collide(model, nudge, plastic, memory, phase, impact, step.begin)
    for contact in range(modes.watched):
        plastic[contact] = 0
    for contact in range(memory.rows.end[STOP]):
        if not solved:
            continue
        if memory.rows.kind[contact] == STOP and impact.impulse[contact, 0] > 0.0:
            joint = memory.rows.owner[contact]
            log_event(step.time, JOINT_STOP, joint, impact.impulse[contact, 0], 0.0, record)
        elif memory.rows.kind[contact] == POINT and is_struck(
            contact, memory.rows, phase.faces.paired, impact.impulse
        ):
            log_impulse(
                PAINLEVE, contact, memory.contacts, memory.rows, memory.seconds, phase.faces.paired,
                step.time, impact, record,
            )  # fmt: skip
    if not solved:
        for i in range(begin.shape[0]):
            begin[i] = before[i]
    return bool(solved)


@kernel
def leave_if_possible(
    count: int, friction: Floats, rows: Rows, slide: Integers, time: float, assembly: Assembly,
    record: Record,
) -> None:  # fmt: skip
    """Let all points leave the ground, if that is one of several solutions."""
    free, delassus = assembly.problem.free, assembly.problem.delassus
    several = False
    apart = True
    for place in range(count):
        contact, row = assembly.candidate[place], 2 * place
        if rows.kind[contact] == DRY_JOINT:
            continue
        apart = apart and free[row] >= 0.0
        lean = -slide[contact] * friction[contact]
        if delassus[row, row] + lean * delassus[row, row + 1] <= 0.0:
            # Pressing it harder would push it into the ground: there are other solutions.
            several = True
            point = rows.owner[contact]
            log_event(time, PAINLEVE, point, 0.0, 0.0, record)
    if several and apart:
        for place in range(count):
            contact = assembly.candidate[place]
            is_dry = rows.kind[contact] == DRY_JOINT
            if not is_dry and assembly.problem.set[place] != LINE:
                assembly.answer.mode[place] = OPEN


@kernel
def begin_phase(
    model: Model, ground: GroundModel, count: int, memory: Memory, work: Motion, record: Record
) -> bool:
    """Begin a phase with the modes that the acceleration-level problem has found.

    Returns false if the state is not one of such modes.
    """
    phase = work.phase
    step, series, decision = work.step, work.series, work.decision
    assembly, friction = memory.assembly, memory.surface.friction
    if rows_of(memory.loops) == 0:  # with loops neither matrix nor free term tell enough
        leave_if_possible(
            count, friction, memory.rows, phase.modes.slide, step.time, assembly, record
        )
    if count > 0:
        note_residual(assembly.answer.residual, memory.tally)
    adopt_modes(count, assembly, memory.rows, phase.modes, memory.reaction.mode)
    tree, contacts = memory.equations.tree, memory.contacts
    forward_kinematics(model, step.begin[: model.nq], tree)
    choose_faces(
        model, ground, tree, memory.rows, memory.reaction.mode, phase.modes, phase.faces,
        work.impact.hit, work.bounces,
    )  # fmt: skip
    locate(
        model, ground, tree, memory.rows, phase.modes, memory.seconds, phase.faces, contacts,
        memory.surface,
    )  # fmt: skip
    form_groups(
        model, tree.angle, contacts, friction, memory.rows, memory.seconds, phase.faces.face,
        step.begin, phase.modes,
    )  # fmt: skip
    begin, before = step.begin, decision.before
    for i in range(begin.shape[0]):
        before[i] = begin[i]
    step.left, strayed, fastest = project(
        model, ground, memory.rows, memory.equations, contacts, memory.surface, assembly,
        memory.loops, memory.seconds, phase, begin,
    )  # fmt: skip
    closest, slip = (ON_THE_GROUND, FITTING) if decision.started == BEGUN else (TOUCHING, UNSEEN)
    if series.last_end == step.time:
        slip += BRIDGED * min(series.length, LONG_BRIDGE)
    fits = step.left <= closest
    for i in range(begin.shape[0]):
        fits = fits and abs(begin[i] - before[i]) <= slip * (1.0 + abs(before[i]))
    if not fits:
        for i in range(begin.shape[0]):
            begin[i] = before[i]
        fits = is_in_place(strayed, fastest)
        step.left = strayed
    if fits:
        first = record.events
        report_modes(
            step.time, decision.started == BEGUN, memory.rows, phase.modes, memory.reported, record,
        )  # fmt: skip
        react(model, first, begin[: model.nq], record, memory.loops)
    return fits


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
    phase = work.phase
    step, decision = work.step, work.decision
    model = scene.model
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
                ahead *= 4.0
                continue
            if decision.burst >= INSISTENT:
                insist(phase.watch.fired, phase.forces.force, phase.modes)
                decision.burst += 1
                continue
        count = phase.forces.count
        if not jammed and count > 0:
            status = solve_accelerations(count, model, decision.state, memory, phase)
            jammed = status != SOLVED
            if jammed and ahead > 0.0:
                ahead = 0.0
                continue
        if not jammed:
            return begin_phase(model, scene.ground, count, memory, work, record)
        jammed = False
        if work.output.last_row < step.time:
            write_row(
                scene, step.time, step.begin, False, step, work.impact, control, memory, phase,
                work.output, record,
            )  # fmt: skip
        evaluate(scene, step.time, step.begin, control, memory, phase, decision.slope)
        if not jump(model, nudge, memory, phase, step, work.impact, work.bounces.plastic, record):
            return False
        nudge = min(HARDER * nudge, HARDEST)
    return False


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
def rubs_otherwise(breakaway: Floats, rows: Rows, modes: Modes) -> bool:
    """Whether a joint has other dry friction from now on."""
    found = False
    for dry in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        joint = rows.owner[dry]
        found = found or modes.breakaway[joint] != breakaway[joint]
    return found


@kernel
def begin_rubbing(
    v: Floats, breakaway: Floats, rows: Rows, modes: Modes, reported: Reported
) -> None:
    """Let joints with dry friction begin as they move, and those with none any more be free."""
    for contact in range(rows.first[DRY_JOINT], rows.end[DRY_JOINT]):
        joint = rows.owner[contact]
        modes.breakaway[joint] = breakaway[joint]
        rubs = 1 if breakaway[joint] > 0.0 else 0
        if modes.closed[contact] != rubs:
            modes.closed[contact] = rubs
            modes.slide[contact] = rubs * heading(v[joint])
            reported.closed[contact] = rubs
            reported.slipping[contact] = modes.slide[contact]


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
def next_due(next_push: float, clock: Clock) -> float:
    """Time at which something from outside is due, or the end."""
    stop = min(clock.until, next_push)
    if clock.control_period > 0.0:
        stop = min(stop, clock.calls * clock.control_period)
    return stop


@kernel
def next_stop(watched: int, accumulation: Floats, next_push: float, clock: Clock) -> float:
    """Time that the next step may not pass."""
    stop = next_due(next_push, clock)
    for contact in range(watched):
        stop = min(stop, accumulation[contact])
    return stop


@kernel
def end_bounces(
    rows: Rows, watched: int, time: float, accumulation: Floats, record: Record
) -> None:
    """Let the points rest whose accumulating impacts have come to an end by now."""
    for contact in range(watched):
        if accumulation[contact] <= time:
            if rows.kind[contact] in (POINT, SECOND_FACE):
                point = rows.owner[contact]
                log_event(accumulation[contact], ZENO, point, 0.0, 0.0, record)
            accumulation[contact] = np.inf


@kernel
def pass_time(length: float, stop: float, step: Step, decision: Decision) -> None:
    """Let time move on, to `stop` if that is the same but for rounding."""
    step.time += length
    if abs(step.time - stop) <= 4e-16 * max(abs(stop), 1e-3):
        step.time = stop
    decision.allowance = min(decision.allowance + EVENTS_A_SECOND * length, EVENTS_AT_ONCE)


@kernel
def end_step(
    clock: Clock, rows: Rows, seconds: Contacts, watched: int, meets: Integers, contacts: Contacts,
    tally: Tally, step: Step, accumulation: Floats, decision: Decision, record: Record,
) -> None:  # fmt: skip
    """Move time and state to the end of the finished step."""
    pass_time(
        step.length, next_stop(watched, accumulation, decision.next_push, clock), step, decision
    )
    for i in range(step.begin.shape[0]):
        step.begin[i] = step.end[i]
    show_forces(step.end_force, rows, seconds, watched, meets, contacts)
    end_bounces(rows, watched, step.time, accumulation, record)
    step.finished = 0
    tally.steps += 1
    if step.has_fired == 1:
        together = step.time - decision.last_event < INSTANT
        decision.burst = decision.burst + 1 if together else 0
        decision.last_event = step.time
        decision.allowance -= 1.0
    elif step.length < min(SHORT_STEP, 0.01 * step.longest):
        decision.allowance -= SHARE_OF_A_STEP


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


@kernel
def begin(model: Model, ground: GroundModel, memory: Memory, work: Motion, record: Record) -> int:
    """Find what the robot stands on when the simulation begins."""
    phase = work.phase
    modes = phase.modes
    step = work.step
    q, v, equations = memory.q, memory.v, memory.equations
    # Modes that are guessed here are those of another instant: where forces or accelerations are
    # not unique, what comes of amending them need not be what the solvers would say.
    memory.solver.settings.amendments = 0
    memory.solver.settings.patient = 1
    if rows_of(memory.loops) > 0:
        if not close_loops(model, equations, memory.loops, q):
            return DIVERGED
        steady_loops(model, q, equations, memory.loops, v)
    modes.watched, phase.faces.paired = memory.rows.first[SECOND_FACE], ground.concave
    for point in range(model.nc):
        memory.seconds.gap[point] = np.inf
    if ground.concave == 1:
        modes.watched = memory.rows.end[SECOND_FACE]
    for i in range(model.nv):
        step.begin[i] = q[i]
        step.begin[model.nq + i] = v[i]
    begin_rubbing(v, memory.breakaway, memory.rows, modes, memory.reported)
    evaluate_equations(model, q, v, equations)
    locate(
        model, ground, equations.tree, memory.rows, modes, memory.seconds, phase.faces,
        memory.contacts, memory.surface,
    )  # fmt: skip
    code = meet_event(
        True, model, ground, memory, phase, step, work.impact, work.bounces, work.decision, record
    )
    for i in range(model.nv):
        v[i] = step.begin[model.nq + i]
    return code


@kernel
def prepare(model: Model, ground: GroundModel, memory: Memory, work: Motion) -> None:
    """Kinematics, velocities and contact points of the state now."""
    phase = work.phase
    forward_kinematics(model, memory.q, memory.equations.tree)
    link_velocities(model, memory.v, memory.equations.tree)
    locate(
        model, ground, memory.equations.tree, memory.rows, phase.modes, memory.seconds, phase.faces,
        memory.contacts, memory.surface,
    )  # fmt: skip


@kernel
def brake(scene: Scene, control: Control, memory: Memory, work: Motion, record: Record) -> None:
    """Let the brakes that have been put on take hold, by an impact of all that touches.

    Those that slip begin to, and end.
    """
    phase = work.phase
    step = work.step
    model = scene.model
    if work.output.last_row < step.time:
        write_row(
            scene, step.time, step.begin, True, step, work.impact, control, memory, phase,
            work.output, record,
        )  # fmt: skip
    begin_rubbing(
        step.begin[model.nq :], memory.breakaway, memory.rows, phase.modes, memory.reported
    )
    stops = take_hold(model, memory.loops)
    # Of joints at rest there is no impact to solve: its data would be rounding.
    if stops and stops_any(model, step.begin[model.nq :], REST, memory.loops):
        evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
        for contact in range(phase.modes.closed.shape[0]):
            work.impact.hit[contact] = 0
        if not strike(model, scene.ground, memory, phase, step, work.impact, work.bounces, record):
            work.decision.bridging = 1
    note_brakes(model, step.time, 1.0, record, memory.loops)


@kernel
def contradicts_itself(modes: Modes, watch: Watch, deficient: int) -> bool:
    """Whether forces of the phase that begins are far beyond limits at once.

    At a pole of the forces, before which they grow without bound, the modes of a moment later may
    be none of now. An event function that is negative from the beginning would not end the phase.
    """
    if deficient == 1:
        return False
    least = -CONTRADICTION * watch.weight
    for contact in range(modes.watched):
        if modes.carrier[contact] == 1 and watch.value[2 * contact] < least:
            return True
        if modes.holder[contact] == 1 and watch.value[2 * contact + 1] < least:
            return True
    return False


@kernel
def decide(
    scene: Scene, control: Control, memory: Memory, work: Motion, record: Record, clock: Clock
) -> int:
    """Decide the contact modes if an event or a jump of forces left them open."""
    phase = work.phase
    step, decision = work.step, work.decision
    work.output.every = clock.record_every
    jumped, decision.next_push = switch_at(step.time, memory.pushes)
    for i in range(scene.model.nu):
        change = abs(memory.torque[i] - step.torque[i])
        jumped = jumped or change > JUMP * (1.0 + abs(memory.torque[i]))
        step.torque[i] = memory.torque[i]
    if awaits_hold(memory.loops) or rubs_otherwise(memory.breakaway, memory.rows, phase.modes):
        brake(scene, control, memory, work, record)
    decision.at_event = decision.undecided
    open_modes = decision.at_event == 1 or jumped
    if decision.bridging == 0 and open_modes:
        decision.bridging = 0 if decide_modes(scene, control, memory, work, record) else 1
    if decision.bridging == 1:
        decision.at_event = 0
        decision.undecided = 1
        return DONE
    decision.undecided = 0
    decision.forced = 0
    decision.jammed = 0
    evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
    if open_modes and contradicts_itself(phase.modes, phase.watch, phase.forces.deficient):
        decision.bridging = 1
        decision.at_event = 0
        decision.undecided = 1
        return DONE
    if decision.at_event == 1:
        show_forces(
            phase.forces.force, memory.rows, memory.seconds, phase.modes.watched, work.impact.meets,
            memory.contacts,
        )  # fmt: skip
    return DONE


@kernel
def report(
    scene: Scene, control: Control, memory: Memory, work: Motion, record: Record, clock: Clock
) -> None:
    """Append a row at events, at the end, and at every step if no period is asked for."""
    phase = work.phase
    step, output = work.step, work.output
    every_step = output.period == 0.0 and memory.tally.steps % output.every == 0
    last = (clock.finishing == 1 or every_step) and output.last_row < step.time
    if work.decision.at_event == 1 or last:
        write_row(
            scene, step.time, step.begin, True, step, work.impact, control, memory, phase, output,
            record,
        )  # fmt: skip


@kernel
def show_state(model: Model, begin: Floats, q: Floats, v: Floats) -> None:
    """Let the frame see the state now."""
    for i in range(model.nv):
        q[i] = begin[i]
        v[i] = begin[model.nq + i]


@kernel
def move_over(
    scene: Scene, stop: float, control: Control, memory: Memory, work: Motion, record: Record,
    clock: Clock,
) -> int:  # fmt: skip
    """Leave an instant by a bridge, behind which it is looked for what there is to be met."""
    phase = work.phase
    watch = phase.watch
    step, bounces, series, output, decision = (
        work.step,
        work.bounces,
        work.series,
        work.output,
        work.decision,
    )
    end = stop
    if output.period > 0.0:  # a row is due no later than at its end
        period = output.period * output.every
        due = output.next_row * period
        end = min(stop, due if due > step.time + 1e-12 else due + period)
    first = record.events
    if not cross(scene, end, control, memory, work, record):
        series.reason = NO_BRIDGE
        return SOLVER_FAILED
    react(scene.model, first, step.begin[: scene.model.nq], record, memory.loops)
    pass_time(series.length, end, step, decision)
    clock.time = step.time
    series.last_end = step.time
    for contact in range(phase.modes.watched):
        if bounces.accumulation[contact] <= step.time:
            bounces.accumulation[contact] = np.inf
    memory.tally.steps += 1
    for i in range(watch.fired.shape[0]):
        watch.fired[i] = 0
    decision.burst = 0
    decision.allowance = EVENTS_A_BRIDGE
    step.next_length = 1e-6
    write_row(
        scene, step.time, step.begin, False, step, work.impact, control, memory, phase, output,
        record,
    )  # fmt: skip
    evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
    meet_event(
        False, scene.model, scene.ground, memory, phase, step, work.impact, bounces, decision,
        record,
    )  # fmt: skip
    show_state(scene.model, step.begin, memory.q, memory.v)
    return DONE


@kernel
def jam(model: Model, slide: Integers, decision: Decision) -> bool:
    """Leave it to a jump of the velocity to end forces that grow without bound before a pole.

    Only a sliding point has such; returns whether there is one. Where steps are as short for
    another reason, as under a torque that switches, no jump ends it however often it is tried.
    """
    for contact in range(model.nc):
        if slide[contact] != 0:
            decision.jammed = 1
            decision.undecided = 1
    decision.burst += 1
    return decision.jammed == 1 and decision.burst <= INSISTENT


@kernel
def move(
    scene: Scene, control: Control, memory: Memory, work: Motion, record: Record, clock: Clock
) -> int:
    """Take a step to the next event, at the longest to where something is due."""
    phase = work.phase
    step, decision = work.step, work.decision
    model, ground = scene.model, scene.ground
    if step.finished == 0:
        stop = (
            next_due(decision.next_push, clock)
            if decision.bridging == 1
            else next_stop(
                phase.modes.watched, work.bounces.accumulation, decision.next_push, clock
            )
        )
        if stop - step.time < shortest_step(step.time):
            # The same time but for rounding: 0.3 for one, 3 · 0.1 for the other.
            step.time = stop
            clock.time = stop
            end_bounces(
                memory.rows, phase.modes.watched, step.time, work.bounces.accumulation, record,
            )  # fmt: skip
            return DONE
        turn = longest_turn(model, memory.equations.tree.motion, step.begin)
        step.next_length = min(step.next_length, turn)
        wish = step.longest if decision.bridging == 1 else min(step.next_length, step.longest)
        if clock.forked == 0 and stop == clock.until and step.time + 1.0001 * wish >= stop:
            clock.forked = 1
            return FORK
        if decision.bridging == 1:
            return move_over(scene, stop, control, memory, work, record, clock)
        if not integrate(scene, stop, control, memory, phase, step):
            if not jam(model, phase.modes.slide, decision):
                decision.bridging = 1
            step.next_length = 1e-6
            return DONE
    written = write_rows_within(
        scene, control, memory, phase, step, work.impact, work.output, record
    )
    if written == NO_ROOM:
        return RECORD_FULL
    if written == TOO_FAR:  # the step is taken again, to end there
        step.finished = 0
        return DONE
    end_step(
        clock, memory.rows, memory.seconds, phase.modes.watched, work.impact.meets, memory.contacts,
        memory.tally, step, work.bounces.accumulation, decision, record,
    )  # fmt: skip
    clock.time = step.time
    if step.has_fired == 1:
        evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
        meet_event(
            False, model, ground, memory, phase, step, work.impact, work.bounces, decision, record
        )
    if decision.allowance < 0.0:
        if (
            step.has_fired == 0
            and step.length < EVENT_TIME
            and jam(model, phase.modes.slide, decision)
        ):
            decision.allowance = EVENTS_A_BRIDGE
        else:
            decision.bridging = 1
    show_state(model, step.begin, memory.q, memory.v)
    return DONE


EventDriven.work = Motion
EventDriven.kernels = Kernels(begin, prepare, decide, report, move)

_REASONS = {
    NO_BRIDGE: "Contact events followed each other without time moving on, or no contact forces "
    "agreed with the laws of motion and friction; nor did impulses over ten times from 1e-6 s on, "
    "each four times as long as the one before. TimeStepping() asks less of an instant",
}
