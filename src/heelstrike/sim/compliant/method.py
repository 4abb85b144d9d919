"""Compliant ground: springs, dampers and smoothed friction in the place of the contact problem.

The penalty methods of the paper's [13]. Between two samples, one `step` apart, the equations of
motion are integrated with steps of their own, as long as the tolerances allow. Because the contact
forces are taken implicitly (:mod:`heelstrike.sim.compliant.dynamics`), stiff ground does not
shorten them while a foot stands; they end where a contact point meets the ground, and are short
where the force really changes fast, after an impact.
"""

# ruff: noqa: ARG001 - the kernels of all methods have the same arguments

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from heelstrike.arguments import check_fields
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.sets import ImpulseSet
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.compliant.contact_law import BristleFriction, HuntCrossley, KelvinVoigt
from heelstrike.sim.compliant.corners import (
    begin_joining,
    choose_sides,
    join,
    misses_corner,
    observe_sides,
    show_forces,
    tell_resultants,
)
from heelstrike.sim.compliant.dynamics import (
    ACCEPTED,
    DECIDED,
    GAINS_LAST,
    HELD,
    TRIED,
    CompliantWorkspace,
    Laws,
    attempt_step,
    begin_step,
    compliant_workspace,
    evaluate,
    find_gains,
)
from heelstrike.sim.compliant.law import FrictionLaw, NormalLaw
from heelstrike.sim.compliant.rosenbrock import ORDER
from heelstrike.sim.contacts.brakes import awaits_hold, note_brakes, share_friction, take_hold
from heelstrike.sim.contacts.faces import NO_FACE
from heelstrike.sim.contacts.geometry import observe
from heelstrike.sim.contacts.latches import react
from heelstrike.sim.contacts.loops import close_loops, note_loop, rows_of, steady_loops
from heelstrike.sim.contacts.rows import CONSTRAINT
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.motors import limit_torque
from heelstrike.sim.frame import BAD_CONTROLLER, DIVERGED, DONE, Kernels, Scene
from heelstrike.sim.memory import Memory
from heelstrike.sim.method import Method
from heelstrike.sim.push import share_over_step
from heelstrike.sim.record.record import Record
from heelstrike.sim.record.recording import (
    CONSTRAINT_HOLDS,
    CONSTRAINT_LETS_GO,
    JOINT_STOP,
    LIFTOFF,
    LIFTOFF_GAP,
    SLIP,
    STICK,
    TOUCHDOWN,
    log_event,
    note_event,
    note_row_when_due,
)
from heelstrike.sim.setting import Setting

BRIDGE = int(EventKind.BRIDGE)

# Shortest step in s. It is taken whatever its error: only a torque that jumps asks for less, and a
# jump of 1000 rad/s² over so short a time is 1e-7 rad/s.
SHORTEST = 1e-10
# Under a controller that changes its mind to and fro such steps would not end (a sample with hard
# impacts takes some hundreds). After so many tries within a sample its torques are held for this
# part of it; in the next one after so many, and after twice as many in each that held none.
PATIENCE, IMPATIENCE = 5000, 40
HELD_PART = 0.01
SAFETY = 0.9
SHRINK = 0.2
GROW = 5.0


NEARLY_OVER = 1e-9
"""A step that leaves less than this part of what remains takes all of it."""


@dataclass(frozen=True, kw_only=True)
class Compliant(Method):
    """Ground that gives way: contact forces from a law instead of a contact problem.

    Raises
    ------
    SimulationError
        If the step or a tolerance is not positive, or a law is none of the above.

    Notes
    -----
    A compiled controller without a control period acts continuously: it is called within every
    step of the integration and remembers what it saw at its end, with the contact forces of that
    very instant. Its gains are taken implicitly with the contact forces. One that switches to and
    fro faster than steps can follow has its torques held for a hundredth of `step` each time; the
    run has a ``BRIDGE`` event for each sample with such times. A controller in Python,
    and any with a control period, has its torques held from sample to sample, and sees the mean
    forces since the last. On compliant ground that is much harder for a light foot: stiff computed
    torque that walks when it acts continuously can fall when it is sampled at 1 ms.

    Third order in the steps of the integration. Penetration is part of the model and reported as
    such. The run's complementarity and non-penetration residuals are zero because there is no
    contact problem, not because it is solved well; its cone residual is measured on the forces of
    the law, which neither pull nor leave the cone. A contact counts as closed while the point is
    in the ground; it slips while its bristle is dragged or, with regularised friction, while it is
    faster than the regularisation speed.

    Dry friction of the joints is smoothed like regularised friction, around its speed or, beside a
    bristle, around 1e-4 rad/s (m/s): a joint that should stick creeps.
    """

    holds: ClassVar[frozenset[ImpulseSet]] = frozenset({ImpulseSet.LINE, ImpulseSet.HALF_LINE})

    law: NormalLaw = field(default_factory=HuntCrossley)
    """HuntCrossley, KelvinVoigt or another NormalLaw. Normal force from penetration and its rate,
    for each contact point."""
    friction: FrictionLaw = field(default_factory=BristleFriction)
    """RegularisedFriction, BristleFriction or another FrictionLaw. Tangential force; its
    coefficient μ is the ground's. Only a bristle holds a foot in place."""
    stop: NormalLaw = field(default_factory=lambda: KelvinVoigt(stiffness=1e5, damping=1e2))
    """HuntCrossley, KelvinVoigt or another NormalLaw. Torque of a joint beyond the end of its
    range, from the angle and its rate (with N m and rad in the place of N and m for a hinge); and
    force of a constraint from outside that may let go, from its gap."""
    step: float = 1e-3
    """Time in seconds between two samples: calls of the controller and rows of the record. The
    integration's own steps are never longer and as short as they need to be."""
    rtol: float = 1e-5
    atol: float = 1e-7
    """rtol, atol: Tolerated error of a step of the integration in positions (m, rad) and velocities
    (m/s, rad/s), relative and absolute; for the bends of bristles (m) too."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        for name in ("law", "stop"):
            law = getattr(self, name)
            if not isinstance(law, NormalLaw):
                raise SimulationError(
                    f"{name} must be HuntCrossley(...), KelvinVoigt(...) or another normal law, "
                    f"got {law!r}"
                )
        if not isinstance(self.friction, FrictionLaw):
            raise SimulationError(
                f"friction must be RegularisedFriction(...) or BristleFriction(...), got "
                f"{self.friction!r}; the coefficient μ belongs to the ground"
            )
        for name in ("step", "rtol", "atol"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise SimulationError(f"{name} must be a positive number, got {value}")

    @property
    def step_length(self) -> float:  # type: ignore[override]
        """Time between two samples."""
        return self.step

    @property
    def row_period(self) -> tuple[str, float]:
        """A row a sample."""
        return "step", self.step

    @property
    def solves_with(self) -> str:
        """Return the names of the laws."""
        return f"{type(self.law).__name__}, {type(self.friction).__name__}"

    def new_work(self, robot: Robot) -> CompliantWorkspace:
        """Allocate its scratch, with the numbers of the laws."""
        numbers = {name: getattr(self, name).parameters() for name in ("law", "friction", "stop")}
        code = {name: getattr(self, name).code(each) for name, each in numbers.items()}
        laws = Laws(
            normal=numbers["law"], normal_code=code["law"],
            friction=numbers["friction"], friction_code=code["friction"],
            stop=numbers["stop"], stop_code=code["stop"], joint_speed=self.friction.joint_speed,
        )  # fmt: skip
        work = compliant_workspace(robot, laws, self.step, self.rtol, self.atol)
        work.patience = PATIENCE
        return work

    def room(self, robot: Robot) -> tuple[int, int]:
        """Return how many rows and events a sample may add to the record."""
        joints = robot.nv + robot.model.latches + robot.model.brakes
        return 1, 1 + 4 * robot.nc + joints + 2 * len(robot.constraints)

    def forget_ground(
        self,
        robot: Robot,  # noqa: ARG002
        work: CompliantWorkspace,
        clock: Clock,
        *,
        stops: bool = False,
    ) -> None:
        """Let no point be in a corner of it."""
        work.corners.first[:] = NO_FACE
        work.corners.second[:] = NO_FACE
        if stops:
            clock.begun = 0

    def check(self, setting: Setting) -> None:
        """Refuse ground with a restitution of its own."""
        if np.any(setting.ground.model().restitution > 0.0):
            raise SimulationError(
                "on compliant ground the restitution follows from the contact law; leave that of "
                "the ground at zero and use HuntCrossley.from_sink or KelvinVoigt.from_sink"
            )


@kernel
def account(model: Model, since: float, h: float, memory: Memory, work: CompliantWorkspace) -> None:
    """Add a step of length h, begun at time `since`, to impulses, extremes, crossings and counts.

    The impulse is the trapezium of the forces of the law. As a sum of forces inside the friction
    cone with positive weights it lies in the cone itself.
    """
    now, base = work.now, work.base
    for joint in range(model.parent.shape[0]):
        work.stop_impulse[joint] += 0.5 * h * (base.stop_force[joint] + now.stop_force[joint])
        work.dry_impulse[joint] += 0.5 * h * (base.dry_force[joint] + now.dry_force[joint])
    for row in range(work.loop_impulse.shape[0]):
        work.loop_impulse[row] += 0.5 * h * (base.loop[row] + now.loop[row])
    for own in range(work.own_impulse.shape[0]):
        work.own_impulse[own] += 0.5 * h * (base.own.force[own] + now.own.force[own])
    for contact in range(work.corners.sides):
        normal = base.normal.force[contact] + now.normal.force[contact]
        tangent = base.friction.force[contact] + now.friction.force[contact]
        work.impulse[contact, 0] += 0.5 * h * normal
        work.impulse[contact, 1] += 0.5 * h * tangent
    if work.corners.doubled > 0:
        join(model, h, work.base_force, memory.contacts, work.corners)
        join(model, h, work.force, memory.contacts, work.corners)
    for contact in range(model.contact_link.shape[0]):
        gap = now.normal.gap[contact]
        before = base.normal.gap[contact]
        if work.corners.doubled > 0:
            gap = min(gap, now.normal.gap[work.corners.other[contact]])
            before = min(before, base.normal.gap[work.corners.other[contact]])
        memory.tally.penetration = max(memory.tally.penetration, -gap)
        if memory.reported.closed[contact] == 0 and gap < 0.0:
            memory.reported.closed[contact] = 1
            share = before / (before - gap) if before > 0.0 else 0.0
            work.touched[contact] = since + share * h
        elif memory.reported.closed[contact] == 1 and gap > LIFTOFF_GAP:
            memory.reported.closed[contact] = 0
            share = before / (before - gap) if before < 0.0 else 0.0
            work.left[contact] = since + share * h
    residual = memory.assembly.answer.residual
    residual[1] = max(residual[1], cone_residual(work))
    memory.tally.steps += 1
    work.age += 1


@kernel
def landing(model: Model, depth: float, gap_now: Floats, work: CompliantWorkspace) -> float:
    """Part of the step after which the first contact point that fell into the ground met it.

    One, if none began the step above the ground and ended it deeper than `depth`. The stages of a
    long step through the air may all lie above the ground that its end lies in.
    """
    first = 1.0
    before = work.base.normal.gap
    for point in range(model.nc):
        first = min(first, meets(depth, before[point], gap_now[point]))
    for point in range(work.corners.doubled):
        gap = work.corners.contacts.gap[point]
        first = min(first, meets(depth, before[work.corners.other[point]], gap))
    return first


@kernel
def meets(depth: float, before: float, after: float) -> float:
    """Part of a step after which a gap was zero, one if it did not become less than -`depth`."""
    return before / (before - after) if before > depth and after < -depth else 1.0


@kernel
def cone_residual(work: CompliantWorkspace) -> float:
    """Largest excess of a contact force over the friction cone, relative to the force."""
    worst = 0.0
    friction = work.now.friction.friction
    for contact in range(work.corners.sides):
        normal = work.force[contact, 0]
        tangent = abs(work.force[contact, 1])
        excess = max(-normal, tangent - friction[contact] * normal)
        if excess > 0.0:
            worst = max(worst, excess / (abs(normal) + tangent))
    return worst


@kernel
def sample(
    controller: Any, control: Control, model: Model, ground: GroundModel, start: float,
    memory: Memory, work: CompliantWorkspace,
) -> int:  # fmt: skip
    """Integrate from one sample to the next; return DONE or what was in the way."""
    span, corners = work.step, work.corners
    elapsed = 0.0
    h = work.proposed
    begin_step(model, memory, work)
    if control.continuous == 1 and work.age >= GAINS_LAST:
        find_gains(controller, control, start, model, memory, work)
    rejected = False
    tries = 0
    held_from, held_until = 0.0, 0.0
    while elapsed < span:
        held = elapsed < held_until
        remaining = (held_until if held else span) - elapsed
        final = h >= remaining * (1.0 - NEARLY_OVER)
        taken = remaining if final else h
        error = attempt_step(
            controller, control, model, ground, start + elapsed, taken, held, memory, work
        )
        tries += 1
        shortest = taken <= SHORTEST
        if not (error <= 1.0 or (shortest and error < np.inf)):
            brief = not held and taken <= HELD_PART * span
            if brief and control.continuous == 1 and tries > work.patience:
                held_from = elapsed
                held_until = min(elapsed + HELD_PART * span, span)
                h = held_until - elapsed
                make_up_mind(controller, control, model, ground, start + elapsed, memory, work)
                continue
            if control.continuous == 1 and (work.age > 0 or shortest):
                find_gains(controller, control, start + elapsed, model, memory, work)
            if shortest:
                for i in range(model.parent.shape[0]):
                    memory.q[i] = work.base_q[i]
                    memory.v[i] = work.base_v[i]
                return DIVERGED if limit_torque(model, control, memory) else BAD_CONTROLLER
            h = max(taken * rescaled(error, SHRINK), SHORTEST)
            rejected = True
            continue
        if work.loop_rows.shape[0] > 0:
            equations, loops, q = memory.equations, memory.loops, memory.q
            if not close_loops(model, equations, loops, q):
                return DIVERGED
            steady_loops(model, q, equations, loops, memory.v)
        observe_sides(model, ground, memory.q, memory.v, memory, corners)
        met = landing(model, work.atol, memory.contacts.gap, work)
        if misses_corner(model, ground, work.atol, memory.contacts, corners):
            met = min(met, 0.5)
        if met < 1.0 and not shortest:
            h = max(taken * met, SHORTEST)
            continue
        bend, forces = work.now.friction.bend, work.base_force
        choose_sides(model, ground, memory.contacts, corners, bend, forces)
        reached = elapsed + taken
        if final:
            reached = held_until if held else span
        # At the sample itself the controller is called by the frame.
        how = TRIED if reached == span else ACCEPTED
        if held and not final:
            how = HELD
        copy_words(work.now.acceleration, work.right_v)
        evaluate(controller, control, model, ground, how, start + elapsed + taken, memory, work)
        if held and final:
            note_held(held_from, held_until, work)
        account(model, start + elapsed, taken, memory, work)
        begin_step(model, memory, work)
        elapsed = reached
        factor = GROW if shortest else min(GROW, rescaled(error, GROW))
        if rejected and not shortest:
            factor = min(factor, 1.0)
            rejected = False
        # A step cut short by the sample says little about how long the next may be.
        h = max(h, taken * factor) if final else taken * factor
    work.proposed = min(h, span)
    work.patience = IMPATIENCE if work.held_for > 0.0 else min(2 * work.patience, PATIENCE)
    finish_sample(model, memory, work)
    return DONE


@kernel
def make_up_mind(
    controller: Any, control: Control, model: Model, ground: GroundModel, time: float,
    memory: Memory, work: CompliantWorkspace,
) -> None:  # fmt: skip
    """Ask the controller for good at the start of the step, for torques that will be held."""
    copy_words(work.base_q, memory.q)
    copy_words(work.base_v, memory.v)
    copy_words(work.base.friction.bend, work.now.friction.bend)
    evaluate(controller, control, model, ground, DECIDED, time, memory, work)
    begin_step(model, memory, work)


@kernel
def note_held(begin: float, end: float, work: CompliantWorkspace) -> None:
    """Account for torques that were held within a sample.

    The accelerations under them, at the end, are in ``work.right_v``.
    """
    if work.held_for == 0.0:
        work.held_since = begin
    work.held_for += end - begin
    for j in range(work.right_v.shape[0]):
        change = abs(work.now.acceleration[j] - work.right_v[j])
        work.held_wrong = max(work.held_wrong, (end - begin) * change)


@kernel
def rescaled(error: float, limit: float) -> float:
    """How much longer a step of this error may be, or `limit` if that cannot be told."""
    if not 0.0 < error < np.inf:
        return limit
    return max(SHRINK, SAFETY * error ** (-1.0 / ORDER))


@kernel
def begin_sample(model: Model, memory: Memory, work: CompliantWorkspace) -> None:
    """Forget the impulses and crossings of the sample before."""
    begin_joining(model, memory.contacts, work.corners)
    work.held_for, work.held_wrong = 0.0, 0.0
    for contact in range(work.corners.sides):
        work.impulse[contact, 0] = 0.0
        work.impulse[contact, 1] = 0.0
    for contact in range(work.touched.shape[0]):
        work.touched[contact] = -1.0
        work.left[contact] = -1.0
    for joint in range(work.stop_impulse.shape[0]):
        work.stop_impulse[joint] = 0.0
        work.dry_impulse[joint] = 0.0
    for row in range(work.loop_impulse.shape[0]):
        work.loop_impulse[row] = 0.0
    for own in range(work.own_impulse.shape[0]):
        work.own_impulse[own] = 0.0
    memory.assembly.answer.residual[1] = cone_residual(work)


@kernel
def brake(
    model: Model, time: float, memory: Memory, work: CompliantWorkspace, record: Record
) -> None:
    """Let the brakes that have been put on stop their joints, by impulses."""
    loops = memory.loops
    if take_hold(model, loops):
        steady_loops(model, memory.q, memory.equations, loops, memory.v)
        for row in range(rows_of(loops)):
            work.loop_impulse[row] = loops.unknown[row]
            note_loop(memory.rows, row, loops.unknown[row], loops)
    note_brakes(model, time, 1.0, record, loops)


@kernel
def finish_sample(model: Model, memory: Memory, work: CompliantWorkspace) -> None:
    """Put the mean forces since the sample before into the memory."""
    span = work.step
    for row in range(rows_of(memory.loops)):
        note_loop(memory.rows, row, work.loop_impulse[row] / span, memory.loops)
    for own in range(work.own_impulse.shape[0]):
        number = memory.rows.owner[memory.rows.first[CONSTRAINT] + own]
        memory.loops.constraint_force[number, 0] = work.own_impulse[own] / span
    tell_resultants(model, work.corners, work.impulse, work.place)
    for contact in range(work.touched.shape[0]):
        for k in range(2):
            memory.contacts.force[contact, k] = work.impulse[contact, k] / span
    for joint in range(work.stop_impulse.shape[0]):
        memory.reaction.stop_torque[joint] = work.stop_impulse[joint] / span
        memory.reaction.friction_torque[joint] = work.dry_impulse[joint] / span
    memory.tally.cone = max(memory.tally.cone, memory.assembly.answer.residual[1])


@kernel
def note_events(
    model: Model, time: float, work: CompliantWorkspace, memory: Memory, record: Record
) -> None:
    """Note what happened since the last sample; `time` is now.

    Touchdown and lift-off are timed where the gap passes zero, stick and slip to the sample.
    """
    force = memory.contacts.force
    if work.held_for > 0.0:
        since = time - work.step + work.held_since
        log_event(since, BRIDGE, 0, work.held_for, work.held_wrong, record)
    for contact in range(model.contact_link.shape[0]):
        touched = work.touched[contact]
        left = work.left[contact]
        if touched >= 0.0 or left >= 0.0:
            memory.reported.slipping[contact] = 0
        if left >= 0.0 and left < touched:
            note_event(left, LIFTOFF, contact, work.step, force, record)
        if touched >= 0.0:
            note_event(touched, TOUCHDOWN, contact, work.step, force, record)
        if left >= 0.0 and left >= touched:
            note_event(left, LIFTOFF, contact, work.step, force, record)
        if left >= 0.0 or work.force[contact, 0] <= 0.0:
            continue
        if work.now.friction.slides[contact] != memory.reported.slipping[contact]:
            memory.reported.slipping[contact] = work.now.friction.slides[contact]
            kind = SLIP if work.now.friction.slides[contact] == 1 else STICK
            note_event(time, kind, contact, work.step, force, record)
    for joint in range(model.parent.shape[0]):
        pressed = memory.reaction.stop_torque[joint] != 0.0
        if pressed and memory.reported.stopped[joint] == 0:
            impulse = abs(memory.reaction.stop_torque[joint]) * work.step
            log_event(time, JOINT_STOP, joint, impulse, 0.0, record)
        memory.reported.stopped[joint] = 1 if pressed else 0
    rows = memory.rows
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        own = entry - rows.first[CONSTRAINT]
        holds = 1 if work.now.own.force[own] > 0.0 else 0
        if holds != memory.reported.closed[entry]:
            kind, impulse = CONSTRAINT_LETS_GO, 0.0
            if holds == 1:
                kind, impulse = CONSTRAINT_HOLDS, work.own_impulse[own]
            log_event(time, kind, rows.owner[entry], impulse, 0.0, record)
        memory.reported.closed[entry] = holds


@kernel
def note_forces(
    model: Model, row: int, force: Floats, stop_force: Floats, dry_force: Floats, memory: Memory,
    record: Record,
) -> None:  # fmt: skip
    """Write the forces of contacts, joints and loops, the slip and the residual of a row."""
    for joint in range(stop_force.shape[0]):
        record.stop_torque[row, joint] = stop_force[joint]
        record.friction_torque[row, joint] = dry_force[joint]
    for contact in range(record.contact_force.shape[1]):
        record.contact_force[row, contact, 0] = force[contact, 0]
        record.contact_force[row, contact, 1] = force[contact, 1]
        record.slip_velocity[row, contact] = memory.reaction.slip[contact]
    for loop in range(record.loop_force.shape[1]):
        record.loop_force[row, loop, 0] = memory.loops.loop_force[loop, 0]
        record.loop_force[row, loop, 1] = memory.loops.loop_force[loop, 1]
    for coupling in range(record.coupling_force.shape[1]):
        record.coupling_force[row, coupling] = memory.loops.coupling_force[coupling]
    for own in range(record.constraint_force.shape[1]):
        for k in range(2):
            record.constraint_force[row, own, k] = memory.loops.constraint_force[own, k]
    for joint in range(record.brake_torque.shape[1]):
        record.brake_torque[row, joint] = memory.loops.brake_force[joint]
    share_friction(model, memory.breakaway, record.friction_torque[row], record.brake_torque[row])
    record.residual[row, 1] = memory.assembly.answer.residual[1]


@kernel
def begin(
    model: Model, ground: GroundModel, memory: Memory, work: CompliantWorkspace, record: Record
) -> int:
    """Points in the ground, or on it, are closed when the simulation begins; loops are, too."""
    if work.loop_rows.shape[0] > 0:
        equations, loops, q = memory.equations, memory.loops, memory.q
        if not close_loops(model, equations, loops, q):
            return DIVERGED
        steady_loops(model, q, equations, loops, memory.v)
    observe(model, ground, memory.q, memory.v, memory)
    for contact in range(model.contact_link.shape[0]):
        memory.reported.closed[contact] = memory.contacts.gap[contact] <= LIFTOFF_GAP
    return DONE


@kernel
def prepare(
    model: Model,
    ground: GroundModel,
    memory: Memory,
    work: CompliantWorkspace,
) -> None:
    """Kinematics and contact points of the state now."""
    corners = work.corners
    points = model.nc
    corners.doubled = points if ground.concave == 1 else 0
    corners.sides = points + corners.doubled
    observe_sides(model, ground, memory.q, memory.v, memory, corners)
    if corners.doubled > 0:
        bend, forces = work.now.friction.bend, work.base_force
        choose_sides(model, ground, memory.contacts, corners, bend, forces)
        observe_sides(model, ground, memory.q, memory.v, memory, corners)


@kernel
def decide(
    scene: Scene, control: Control, memory: Memory, work: CompliantWorkspace, record: Record,
    clock: Clock,
) -> int:  # fmt: skip
    """Forces and rates at this sample, under the torques that the frame asked for."""
    share_over_step(clock.time, work.step, memory.pushes)
    evaluate(scene.controller, control, scene.model, scene.ground, HELD, clock.time, memory, work)
    return DONE


@kernel
def report(
    scene: Scene, control: Control, memory: Memory, work: CompliantWorkspace, record: Record,
    clock: Clock,
) -> None:  # fmt: skip
    """Append a row if one is due, with the forces of this instant."""
    for row in range(rows_of(memory.loops)):
        note_loop(memory.rows, row, work.now.loop[row], memory.loops)
    for own in range(work.own_impulse.shape[0]):
        number = memory.rows.owner[memory.rows.first[CONSTRAINT] + own]
        memory.loops.constraint_force[number, 0] = work.now.own.force[own]
    work.row = note_row_when_due(memory, clock, record)
    if work.row >= 0:
        now = work.now
        note_forces(
            scene.model, work.row, work.force, now.stop_force, now.dry_force, memory, record
        )
        force, place = record.contact_force[work.row], record.contact_point[work.row]
        begin_joining(scene.model, memory.contacts, work.corners)
        join(scene.model, 2.0, work.force, memory.contacts, work.corners)
        tell_resultants(scene.model, work.corners, force, place)


@kernel
def move(
    scene: Scene, control: Control, memory: Memory, work: CompliantWorkspace, record: Record,
    clock: Clock,
) -> int:  # fmt: skip
    """Move on to the next sample, and note what happened on the way."""
    model = scene.model
    begin_sample(model, memory, work)
    if awaits_hold(memory.loops):
        brake(model, clock.time, memory, work, record)
        evaluate(scene.controller, control, model, scene.ground, HELD, clock.time, memory, work)
    code = sample(scene.controller, control, model, scene.ground, clock.time, memory, work)
    if code != DONE:
        return code
    step = work.step
    first = record.events
    note_events(model, clock.time + step, work, memory, record)
    react(model, first, memory.q, record, memory.loops)
    if work.row >= 0:
        # What acted until the next sample takes the place of what acted at the first instant.
        reaction = memory.reaction
        note_forces(
            model, work.row, memory.contacts.force, reaction.stop_torque, reaction.friction_torque,
            memory, record,
        )  # fmt: skip
        for contact in range(work.corners.doubled):
            if work.corners.joins[contact] == 1:
                for i in range(2):
                    record.contact_point[work.row, contact, i] = work.place[contact, i]
    if control.continuous == 1:
        show_forces(work.force, work.corners, memory.contacts)
    clock.time = clock.start + (clock.index + 1) * step
    return DONE


Compliant.work = CompliantWorkspace
Compliant.kernels = Kernels(begin, prepare, decide, report, move)
