"""Event-driven simulation: smooth phases between events, impacts at events (paper section 2).

Between events every contact point keeps its mode and the motion is integrated with high order and
adaptive steps. What ends a phase - a touchdown, a normal force that vanishes, friction that reaches
its limit, a sliding point that comes to rest - is located on the dense output of the step, the step
is repeated to end there, and the acceleration-level problem (eq. 15-19) decides the modes of the
next phase; at a touchdown the impact law (eq. 20-22) first decides the velocities.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from heelstrike.arguments import check_fields
from heelstrike.compiler.compilation import kernel
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.sets import ImpulseSet
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.clock import Clock
from heelstrike.sim.contacts.brakes import awaits_hold
from heelstrike.sim.contacts.faces import NO_FACE
from heelstrike.sim.contacts.geometry import evaluate_equations
from heelstrike.sim.contacts.rows import SECOND_FACE, contact_components
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.deciding import LOOKS, ON_THE_GROUND, decide_modes
from heelstrike.sim.event_driven.events import meet_event
from heelstrike.sim.event_driven.moving import EVENTS_AT_ONCE, NO_BRIDGE, move
from heelstrike.sim.event_driven.phase import Motion, allocate_motion
from heelstrike.sim.event_driven.rows import ROWS_OF_AN_INSTANT, write_row
from heelstrike.sim.event_driven.rubbing import begin_rubbing, brake, rubs_otherwise
from heelstrike.sim.event_driven.smooth.corners import show_forces
from heelstrike.sim.event_driven.smooth.dynamics import evaluate
from heelstrike.sim.event_driven.smooth.faces import locate
from heelstrike.sim.frame import DONE, Kernels, Scene
from heelstrike.sim.memory import Memory
from heelstrike.sim.method import Method, solver_order
from heelstrike.sim.push import switch_at
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.size import check_room, check_steps
from heelstrike.sim.setting import Setting

# Length (s) of the first step that is tried: error control shortens it tenfold, or lengthens it so.
FIRST_STEP = 1e-3
# Torque (relative) that a controller may change between two looks at the same instant.
JUMP = 1e-7


@dataclass(frozen=True, kw_only=True)
class EventDriven(Method):
    """Adaptive high-order integration between events, which are found to 1e-12 s.

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
    """rtol, atol: Error that a step may make in each coordinate and velocity: ``atol + rtol
    |y|``."""
    max_step: float = 0.05
    """Longest step in seconds; an open contact point that would touch the ground and leave it again
    within a quarter of this may only be seen thanks to its velocity."""
    output_period: float | None = 1e-3
    """Seconds between two rows of the record, which change no step and are about as exact as the
    ends of steps. None for a row at every step. Events have rows of their own: one, or two if
    velocities jump."""
    solver: str = "lemke"
    """Contact solver tried first: ``"lemke"``, ``"fischer_burmeister"`` or ``"gauss_seidel"``."""
    swing_feet_pass: bool = False
    """A rule for passive walkers, whose legs of equal length scuff the ground at mid-stance: a
    point that reaches the ground beside or behind a point already on it, seen in the direction in
    which the robot moves, passes below the ground until it comes up again."""

    impulses_in_events: ClassVar[bool] = True
    holds: ClassVar[frozenset[ImpulseSet]] = frozenset({ImpulseSet.LINE, ImpulseSet.HALF_LINE})
    python_period: ClassVar[float | None] = 1e-3

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        for name in ("rtol", "atol", "max_step", "output_period"):
            value = getattr(self, name)
            if not (value is None and name == "output_period") and not 0.0 < value < np.inf:
                raise SimulationError(f"{name} must be a positive number, got {value}")
        if self.rtol < 1e-14:
            raise SimulationError(
                f"rtol = {self.rtol} is too small for floating point: give 1e-14 or more"
            )
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
        contacts = len(contact_components(robot))
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
                f"{-at.gap[deepest]:.3g} m deep in the ground. EventDriven cannot push it out: "
                f"raise the robot by {needed:.3g} m, begin on the ground that the state was made "
                f"for, or use TimeStepping or Compliant, which push it out"
            )
        model = robot.model
        beyond = np.maximum(model.lower - state.q, state.q - model.upper)
        joint = int(np.argmax(beyond))
        if beyond[joint] > ON_THE_GROUND:
            raise SimulationError(
                f"joint {robot.joint_names[joint]!r} begins at {state.q[joint]:.6g}, beyond its "
                f"range of {model.lower[joint]:.6g} to {model.upper[joint]:.6g}. EventDriven "
                f"cannot push it back: begin within the range, or use TimeStepping or Compliant"
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
        for each in (work.phase.forces.force, work.step.end_force, work.impact.impulse):
            each[:] = 0.0
        work.impact.meets[:] = 0
        modes.face[:] = NO_FACE
        work.phase.watch.fired[:] = 0
        clock.begun = 0

    def reconsider(self, work: Motion) -> None:
        """Decide contact modes again: what they depend on has been changed."""
        work.decision.undecided = 1

    def rows_in(self, duration: float, record_every: int) -> int:
        """Return about how many rows the record of a time has."""
        return 1024 if self.output_period is None else super().rows_in(duration, record_every) + 64

    def reason(self, work: Motion) -> str:
        """Say why a simulation could not go on."""
        return _REASONS.get(work.series.reason, "")


@kernel
def begin(model: Model, ground: GroundModel, memory: Memory, work: Motion, record: Record) -> int:
    """Find what the robot stands on when the simulation begins."""
    step, modes = work.step, work.phase.modes
    q, v, rows, equations = memory.q, memory.v, memory.rows, memory.equations
    # Modes that are guessed here are those of another instant: where forces or accelerations are
    # not unique, what comes of correcting them need not be what the solvers would say.
    memory.solver.settings.corrections = 0
    memory.solver.settings.patient = 1
    modes.watched = rows.end[SECOND_FACE] if ground.concave == 1 else rows.first[SECOND_FACE]
    for second in range(rows.first[SECOND_FACE], rows.end[SECOND_FACE]):
        rows.gap[second] = np.inf
    for i in range(model.nv):
        step.begin[i] = q[i]
        step.begin[model.nq + i] = v[i]
    begin_rubbing(v, memory.breakaway, rows, modes, memory.reported)
    evaluate_equations(model, q, v, equations)
    locate(q, v, model, ground, equations.tree, rows, modes, memory.surface)
    code = meet_event(True, model, ground, memory, work, record)
    for i in range(model.nv):
        v[i] = step.begin[model.nq + i]
    return code


@kernel
def prepare(model: Model, ground: GroundModel, memory: Memory, work: Motion) -> None:
    """Kinematics, velocities and contact points of the state now."""
    q, v, tree = memory.q, memory.v, memory.equations.tree
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    locate(q, v, model, ground, tree, memory.rows, work.phase.modes, memory.surface)


@kernel
def decide(
    scene: Scene, control: Control, memory: Memory, work: Motion, record: Record, clock: Clock
) -> int:
    """Decide the contact modes if an event or a jump of forces left them open."""
    phase, step, decision, rows = work.phase, work.step, work.decision, memory.rows
    work.output.every = clock.record_every
    jumped, decision.next_push = switch_at(step.time, memory.pushes)
    for i in range(scene.model.nu):
        change = abs(memory.torque[i] - step.torque[i])
        jumped = jumped or change > JUMP * (1.0 + abs(memory.torque[i]))
        step.torque[i] = memory.torque[i]
    if awaits_hold(memory.loops.braked) or rubs_otherwise(memory.breakaway, rows, phase.modes):
        brake(scene, control, memory, work, record)
    decision.at_event = decision.undecided
    if decision.bridging == 0:
        if decision.at_event == 0 and not jumped:
            evaluate(scene, step.time, step.begin, control, memory, phase, step.slopes[0])
        elif not decide_modes(scene, control, memory, work, record):
            decision.bridging = 1
    if decision.bridging == 1:
        decision.at_event = 0
        decision.undecided = 1
        return DONE
    decision.undecided = decision.forced = decision.jammed = 0
    if decision.at_event == 1:
        show_forces(phase.forces.force, rows, work.impact.meets, memory.contacts.force)
    return DONE


@kernel
def report(
    scene: Scene, control: Control, memory: Memory, work: Motion, record: Record, clock: Clock
) -> None:
    """Append a row at events, at the end, and at every step if no period is asked for."""
    step, output = work.step, work.output
    every_step = output.period == 0.0 and memory.tally.steps % output.every == 0
    last = (clock.finishing == 1 or every_step) and output.last_row < step.time
    if work.decision.at_event == 1 or last:
        write_row(scene, True, control, memory, work, record)


EventDriven.work = Motion
EventDriven.kernels = Kernels(begin, prepare, decide, report, move)

_REASONS = {
    NO_BRIDGE: "Contact events followed each other without time moving on, or no contact forces "
    "agreed with the laws of motion and friction; nor did impulses over ten times from 1e-6 s on, "
    "each four times as long as the one before. TimeStepping() asks less of an instant",
}
