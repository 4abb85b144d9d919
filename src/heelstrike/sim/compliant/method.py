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
from typing import ClassVar

import numpy as np

from heelstrike.arguments import check_fields
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.sets import ImpulseSet
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.clock import Clock
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.compliant.contact_law import BristleFriction, HuntCrossley, KelvinVoigt
from heelstrike.sim.compliant.corners import (
    Corners,
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
    Evaluated,
    Holding,
    Laws,
    Sums,
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
from heelstrike.sim.contacts.rows import CONSTRAINT, Rows
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.motors import limit_torque
from heelstrike.sim.frame import BAD_CONTROLLER, DIVERGED, DONE, Kernels, Scene
from heelstrike.sim.memory import Equations, Loops, Memory, Tally
from heelstrike.sim.method import Method
from heelstrike.sim.push import share_over_step
from heelstrike.sim.record.record import Record, Told
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
        work.holding.patience = PATIENCE
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
def add_impulse(h: float, before: Floats, after: Floats, total: Floats) -> None:
    """Add the impulse of a step of length h: the trapezium of the forces before and after it."""
    for i in range(total.shape[0]):
        total[i] += 0.5 * h * (before[i] + after[i])


@kernel
def add_contact_impulse(
    h: float, sides: int, press_before: Floats, press: Floats, rub_before: Floats, rub: Floats,
    total: Floats,
) -> None:  # fmt: skip
    """The same of contacts, normal and tangential.

    As a sum of forces inside the friction cone with positive weights it lies in the cone itself.
    """
    for contact in range(sides):
        total[contact, 0] += 0.5 * h * (press_before[contact] + press[contact])
        total[contact, 1] += 0.5 * h * (rub_before[contact] + rub[contact])


@kernel
def note_crossings(
    model: Model, since: float, h: float, gap_before: Floats, gap_now: Floats, corners: Corners,
    touched: Floats, left: Floats, closed: Integers, tally: Tally,
) -> None:  # fmt: skip
    """Note which points came to the ground and left it in a step, begun at time `since`."""
    for contact in range(model.contact_link.shape[0]):
        gap = gap_now[contact]
        before = gap_before[contact]
        if corners.doubled > 0:
            gap = min(gap, gap_now[corners.other[contact]])
            before = min(before, gap_before[corners.other[contact]])
        tally.penetration = max(tally.penetration, -gap)
        if closed[contact] == 0 and gap < 0.0:
            closed[contact] = 1
            share = before / (before - gap) if before > 0.0 else 0.0
            touched[contact] = since + share * h
        elif closed[contact] == 1 and gap > LIFTOFF_GAP:
            closed[contact] = 0
            share = before / (before - gap) if before < 0.0 else 0.0
            left[contact] = since + share * h


@kernel
def accept_step(
    scene: Scene, how: int, since: float, h: float, evaluated: Evaluated, control: Control,
    memory: Memory, work: CompliantWorkspace,
) -> None:  # fmt: skip
    """Evaluate the end of a step of length h, begun at time `since`, and begin the next there.

    The step is added to impulses, extremes, crossings and counts.
    """
    model, now, base = scene.model, work.now, work.base
    sums, corners = work.sums, work.corners
    evaluate(
        scene, how, since + h, control, memory, work.laws, corners, now, work.now_rows, work.force
    )
    add_impulse(h, base.stop_force, now.stop_force, sums.stop)
    add_impulse(h, base.dry_force, now.dry_force, sums.dry)
    add_impulse(h, base.loop, now.loop, sums.loop)
    add_impulse(h, base.own.force, now.own.force, sums.own)
    add_contact_impulse(
        h, corners.sides, base.normal.force, now.normal.force, base.friction.force,
        now.friction.force, sums.contact,
    )  # fmt: skip
    if corners.doubled > 0:
        join(model, h, work.start.force, memory.contacts, corners)
        join(model, h, work.force, memory.contacts, corners)
    note_crossings(
        model, since, h, base.normal.gap, now.normal.gap, corners, sums.touched, sums.left,
        memory.reported.closed, memory.tally,
    )  # fmt: skip
    residual = memory.assembly.answer.residual
    worst = cone_residual(corners.sides, now.friction.friction, work.force)
    residual[1] = max(residual[1], worst)
    memory.tally.steps += 1
    work.gains.age += 1
    begin_step(corners.sides, evaluated, work.base_words, work.start)


@kernel
def landing(model: Model, depth: float, before: Floats, gap_now: Floats, corners: Corners) -> float:
    """Part of the step after which the first contact point that fell into the ground met it.

    One, if none began the step above the ground and ended it deeper than `depth`. The stages of a
    long step through the air may all lie above the ground that its end lies in.
    """
    first = 1.0
    for point in range(model.nc):
        first = min(first, meets(depth, before[point], gap_now[point]))
    for point in range(corners.doubled):
        gap = corners.contacts.gap[point]
        first = min(first, meets(depth, before[corners.other[point]], gap))
    return first


@kernel
def meets(depth: float, before: float, after: float) -> float:
    """Part of a step after which a gap was zero, one if it did not become less than -`depth`."""
    return before / (before - after) if before > depth and after < -depth else 1.0


@kernel
def cone_residual(sides: int, friction: Floats, force: Floats) -> float:
    """Largest excess of a contact force over the friction cone, relative to the force."""
    worst = 0.0
    for contact in range(sides):
        normal = force[contact, 0]
        tangent = abs(force[contact, 1])
        excess = max(-normal, tangent - friction[contact] * normal)
        if excess > 0.0:
            worst = max(worst, excess / (abs(normal) + tangent))
    return worst


@kernel
def sample(
    scene: Scene, start: float, control: Control, memory: Memory, work: CompliantWorkspace
) -> int:
    """Integrate from one sample to the next; return DONE or what was in the way."""
    model, ground, controller = scene.model, scene.ground, scene.controller
    span, corners, holding, gains = work.step, work.corners, work.holding, work.gains
    q, v, tree, contacts = memory.q, memory.v, memory.equations.tree, memory.contacts
    start_of_step, gap_before = work.start, work.base.normal.gap
    command, torque, tally = memory.command, memory.torque, memory.tally
    elapsed = 0.0
    h = work.proposed
    evaluated = Evaluated(
        work.force, q, v, memory.assembly.directions.jacobian, memory.equations.mass_matrix,
        work.now_rows, memory.loops.rows.jacobian, work.now_words,
    )  # fmt: skip
    begin_step(corners.sides, evaluated, work.base_words, start_of_step)
    if control.continuous == 1 and gains.age >= GAINS_LAST:
        find_gains(
            controller, control, start, model, start_of_step, tree, contacts, tally, q, v, command,
            torque, gains,
        )  # fmt: skip
    rejected = False
    tries = 0
    held_from, held_until = 0.0, 0.0
    while elapsed < span:
        held = elapsed < held_until
        remaining = (held_until if held else span) - elapsed
        final = h >= remaining * (1.0 - NEARLY_OVER)
        taken = remaining if final else h
        error = attempt_step(scene, start + elapsed, taken, held, control, memory, work)
        tries += 1
        shortest = taken <= SHORTEST
        if not (error <= 1.0 or (shortest and error < np.inf)):
            brief = not held and taken <= HELD_PART * span
            if brief and control.continuous == 1 and tries > holding.patience:
                held_from = elapsed
                held_until = min(elapsed + HELD_PART * span, span)
                h = held_until - elapsed
                make_up_mind(scene, start + elapsed, evaluated, control, memory, work)
                continue
            if control.continuous == 1 and (gains.age > 0 or shortest):
                find_gains(
                    controller, control, start + elapsed, model, start_of_step, tree, contacts,
                    tally, q, v, command, torque, gains,
                )  # fmt: skip
            if shortest:
                copy_words(start_of_step.q, q)
                copy_words(start_of_step.v, v)
                good = limit_torque(model, control.voltage, v, tally, command, torque)
                return DIVERGED if good else BAD_CONTROLLER
            h = max(taken * rescaled(error, SHRINK), SHORTEST)
            rejected = True
            continue
        if start_of_step.loop_rows.shape[0] > 0:
            equations, loops = memory.equations, memory.loops
            if not close_loops(model, equations, loops, q):
                return DIVERGED
            steady_loops(model, q, equations, loops, v)
        observe_sides(model, ground, q, v, tree, contacts, memory.surface, corners)
        met = landing(model, work.atol, gap_before, contacts.gap, corners)
        if misses_corner(model, ground, work.atol, contacts, corners):
            met = min(met, 0.5)
        if met < 1.0 and not shortest:
            h = max(taken * met, SHORTEST)
            continue
        bend, forces = work.now.friction.bend, start_of_step.force
        choose_sides(model, ground, contacts, corners, bend, forces)
        reached = elapsed + taken
        if final:
            reached = held_until if held else span
        # At the sample itself the controller is called by the frame.
        how = TRIED if reached == span else ACCEPTED
        if held and not final:
            how = HELD
        before = work.stages.right_v
        copy_words(work.now.acceleration, before)
        since = start + elapsed
        accept_step(scene, how, since, taken, evaluated, control, memory, work)
        if held and final:
            note_held(held_from, held_until, before, work.now.acceleration, holding)
        elapsed = reached
        factor = GROW if shortest else min(GROW, rescaled(error, GROW))
        if rejected and not shortest:
            factor = min(factor, 1.0)
            rejected = False
        # A step cut short by the sample says little about how long the next may be.
        h = max(h, taken * factor) if final else taken * factor
    work.proposed = min(h, span)
    patience = min(2 * holding.patience, PATIENCE)
    holding.patience = IMPATIENCE if holding.span > 0.0 else patience
    return DONE


@kernel
def make_up_mind(
    scene: Scene, time: float, evaluated: Evaluated, control: Control, memory: Memory,
    work: CompliantWorkspace,
) -> None:  # fmt: skip
    """Ask the controller for good at the start of the step, for torques that will be held."""
    copy_words(work.start.q, memory.q)
    copy_words(work.start.v, memory.v)
    copy_words(work.base.friction.bend, work.now.friction.bend)
    evaluate(
        scene, DECIDED, time, control, memory, work.laws, work.corners, work.now, work.now_rows,
        work.force,
    )  # fmt: skip
    begin_step(work.corners.sides, evaluated, work.base_words, work.start)


@kernel
def note_held(
    begin: float, end: float, held: Floats, acceleration: Floats, holding: Holding
) -> None:
    """Account for torques that were held within a sample.

    At the end the acceleration under them is `held`, and under what follows `acceleration`.
    """
    if holding.span == 0.0:
        holding.since = begin
    holding.span += end - begin
    for j in range(held.shape[0]):
        change = abs(acceleration[j] - held[j])
        holding.wrong = max(holding.wrong, (end - begin) * change)


@kernel
def rescaled(error: float, limit: float) -> float:
    """How much longer a step of this error may be, or `limit` if that cannot be told."""
    if not 0.0 < error < np.inf:
        return limit
    return max(SHRINK, SAFETY * error ** (-1.0 / ORDER))


@kernel
def begin_sample(
    model: Model, contacts: Contacts, corners: Corners, holding: Holding, sums: Sums
) -> None:
    """Forget the impulses and crossings of the sample before."""
    begin_joining(model, contacts, corners)
    holding.span, holding.wrong = 0.0, 0.0
    for contact in range(corners.sides):
        sums.contact[contact, 0] = 0.0
        sums.contact[contact, 1] = 0.0
    for contact in range(sums.touched.shape[0]):
        sums.touched[contact] = -1.0
        sums.left[contact] = -1.0
    for joint in range(sums.stop.shape[0]):
        sums.stop[joint] = 0.0
        sums.dry[joint] = 0.0
    for row in range(sums.loop.shape[0]):
        sums.loop[row] = 0.0
    for own in range(sums.own.shape[0]):
        sums.own[own] = 0.0


@kernel
def brake(
    model: Model, time: float, q: Floats, v: Floats, rows: Rows, equations: Equations,
    loops: Loops, impulse: Floats, told: Told,
) -> None:  # fmt: skip
    """Let the brakes that have been put on stop their joints, by impulses, one a row of loops."""
    if take_hold(model, loops.braked):
        steady_loops(model, q, equations, loops, v)
        for row in range(rows_of(loops)):
            impulse[row] = loops.unknown[row]
            note_loop(rows, row, loops.unknown[row], loops)
    note_brakes(model, time, 1.0, loops.brake_force, told, loops.braked)


@kernel
def note_means(span: float, rows: Rows, loop: Floats, own: Floats, loops: Loops) -> None:
    """Keep the mean forces of loops and constraints from outside, by their impulses over a time."""
    for row in range(rows_of(loops)):
        note_loop(rows, row, loop[row] / span, loops)
    for i in range(own.shape[0]):
        number = rows.owner[rows.first[CONSTRAINT] + i]
        loops.constraint_force[number, 0] = own[i] / span


@kernel
def note_mean_forces(
    span: float, sums: Sums, force: Floats, stop_torque: Floats, friction_torque: Floats
) -> None:
    """Keep the mean forces of contacts and joints, by their impulses over a time."""
    for contact in range(sums.touched.shape[0]):
        for k in range(2):
            force[contact, k] = sums.contact[contact, k] / span
    for joint in range(sums.stop.shape[0]):
        stop_torque[joint] = sums.stop[joint] / span
        friction_torque[joint] = sums.dry[joint] / span


@kernel
def tell_of_contacts(
    model: Model, time: float, step: float, mean: Floats, force: Floats, slides: Integers,
    touched: Floats, left: Floats, told: Told, slipping: Integers,
) -> None:  # fmt: skip
    """Tell what contact points did since the last sample; `time` is now, `force` that of now.

    Touchdown and lift-off are timed where the gap passes zero, stick and slip to the sample.
    """
    for contact in range(model.contact_link.shape[0]):
        down, up = touched[contact], left[contact]
        if down >= 0.0 or up >= 0.0:
            slipping[contact] = 0
        if up >= 0.0 and up < down:
            note_event(up, LIFTOFF, contact, step, mean, told)
        if down >= 0.0:
            note_event(down, TOUCHDOWN, contact, step, mean, told)
        if up >= 0.0 and up >= down:
            note_event(up, LIFTOFF, contact, step, mean, told)
        if up >= 0.0 or force[contact, 0] <= 0.0:
            continue
        if slides[contact] != slipping[contact]:
            slipping[contact] = slides[contact]
            note_event(time, SLIP if slides[contact] == 1 else STICK, contact, step, mean, told)


@kernel
def tell_of_stops(time: float, step: float, torque: Floats, told: Told, stopped: Integers) -> None:
    """Tell which joints came to their stops since the last sample, whose mean torques these are."""
    for joint in range(torque.shape[0]):
        pressed = torque[joint] != 0.0
        if pressed and stopped[joint] == 0:
            log_event(time, JOINT_STOP, joint, abs(torque[joint]) * step, 0.0, told)
        stopped[joint] = 1 if pressed else 0


@kernel
def tell_of_constraints(
    time: float, force: Floats, impulse: Floats, rows: Rows, told: Told, closed: Integers
) -> None:
    """Tell which constraints from outside began to hold since the last sample, or let go."""
    for entry in range(rows.first[CONSTRAINT], rows.end[CONSTRAINT]):
        own = entry - rows.first[CONSTRAINT]
        holds = 1 if force[own] > 0.0 else 0
        if holds != closed[entry]:
            kind, pressed = CONSTRAINT_LETS_GO, 0.0
            if holds == 1:
                kind, pressed = CONSTRAINT_HOLDS, impulse[own]
            log_event(time, kind, rows.owner[entry], pressed, 0.0, told)
        closed[entry] = holds


@kernel
def note_forces(
    model: Model, row: int, force: Floats, stop_force: Floats, dry_force: Floats, slip: Floats,
    residual: float, breakaway: Floats, loop_force: Floats, coupling_force: Floats,
    constraint_force: Floats, brake_force: Floats, record: Record,
) -> None:  # fmt: skip
    """Write the forces of contacts, joints and loops, the slip and the residual of a row."""
    for joint in range(stop_force.shape[0]):
        record.stop_torque[row, joint] = stop_force[joint]
        record.friction_torque[row, joint] = dry_force[joint]
    for contact in range(record.contact_force.shape[1]):
        record.contact_force[row, contact, 0] = force[contact, 0]
        record.contact_force[row, contact, 1] = force[contact, 1]
        record.slip_velocity[row, contact] = slip[contact]
    for loop in range(record.loop_force.shape[1]):
        record.loop_force[row, loop, 0] = loop_force[loop, 0]
        record.loop_force[row, loop, 1] = loop_force[loop, 1]
    for coupling in range(record.coupling_force.shape[1]):
        record.coupling_force[row, coupling] = coupling_force[coupling]
    for own in range(record.constraint_force.shape[1]):
        for k in range(2):
            record.constraint_force[row, own, k] = constraint_force[own, k]
    for joint in range(record.brake_torque.shape[1]):
        record.brake_torque[row, joint] = brake_force[joint]
    share_friction(model, breakaway, record.friction_torque[row], record.brake_torque[row])
    record.residual[row, 1] = residual


@kernel
def row_at(time: float, record: Record) -> int:
    """Row that a record has of this time, its last, or -1: it may have begun after it."""
    row = record.rows - 1
    return row if row >= 0 and record.time[row] == time else -1


@kernel
def begin(
    model: Model, ground: GroundModel, memory: Memory, work: CompliantWorkspace, record: Record
) -> int:
    """Points in the ground, or on it, are closed when the simulation begins."""
    contacts, tree = memory.contacts, memory.equations.tree
    observe(model, ground, memory.q, memory.v, tree, contacts, memory.surface)
    for contact in range(model.contact_link.shape[0]):
        memory.reported.closed[contact] = contacts.gap[contact] <= LIFTOFF_GAP
    return DONE


@kernel
def prepare(
    model: Model,
    ground: GroundModel,
    memory: Memory,
    work: CompliantWorkspace,
) -> None:
    """Kinematics and contact points of the state now."""
    q, v, tree, contacts = memory.q, memory.v, memory.equations.tree, memory.contacts
    corners, surface = work.corners, memory.surface
    points = model.nc
    corners.doubled = points if ground.concave == 1 else 0
    corners.sides = points + corners.doubled
    observe_sides(model, ground, q, v, tree, contacts, surface, corners)
    if corners.doubled > 0:
        bend, forces = work.now.friction.bend, work.start.force
        choose_sides(model, ground, contacts, corners, bend, forces)
        observe_sides(model, ground, q, v, tree, contacts, surface, corners)


@kernel
def decide(
    scene: Scene, control: Control, memory: Memory, work: CompliantWorkspace, record: Record,
    clock: Clock,
) -> int:  # fmt: skip
    """Forces and rates at this sample, under the torques that the frame asked for."""
    share_over_step(clock.time, work.step, memory.pushes)
    evaluate(
        scene, HELD, clock.time, control, memory, work.laws, work.corners, work.now, work.now_rows,
        work.force,
    )  # fmt: skip
    return DONE


@kernel
def report(
    scene: Scene, control: Control, memory: Memory, work: CompliantWorkspace, record: Record,
    clock: Clock,
) -> None:  # fmt: skip
    """Append a row if one is due, with the forces of this instant."""
    model, now, corners, loops = scene.model, work.now, work.corners, memory.loops
    note_means(1.0, memory.rows, now.loop, now.own.force, loops)
    row = note_row_when_due(memory, clock, record)
    if row >= 0:
        note_forces(
            model, row, work.force, now.stop_force, now.dry_force, memory.reaction.slip,
            memory.assembly.answer.residual[1], memory.breakaway, loops.loop_force,
            loops.coupling_force, loops.constraint_force, loops.brake_force, record,
        )  # fmt: skip
        force, place = record.contact_force[row], record.contact_point[row]
        begin_joining(model, memory.contacts, corners)
        join(model, 2.0, work.force, memory.contacts, corners)
        tell_resultants(model, corners, force, place)


@kernel
def move(
    scene: Scene, control: Control, memory: Memory, work: CompliantWorkspace, record: Record,
    clock: Clock,
) -> int:  # fmt: skip
    """Move on to the next sample, and note what happened on the way."""
    model, loops, rows, contacts = scene.model, memory.loops, memory.rows, memory.contacts
    reported, reaction, told = memory.reported, memory.reaction, record.told
    corners, sums, holding, friction = work.corners, work.sums, work.holding, work.now.friction
    residual = memory.assembly.answer.residual
    begin_sample(model, contacts, corners, holding, sums)
    residual[1] = cone_residual(corners.sides, friction.friction, work.force)
    if awaits_hold(loops.braked):
        brake(model, clock.time, memory.q, memory.v, rows, memory.equations, loops, sums.loop, told)
        evaluate(
            scene, HELD, clock.time, control, memory, work.laws, corners, work.now, work.now_rows,
            work.force,
        )  # fmt: skip
    code = sample(scene, clock.time, control, memory, work)
    if code != DONE:
        return code
    step, first, tally = work.step, told.events, memory.tally
    note_means(step, rows, sums.loop, sums.own, loops)
    tell_resultants(model, corners, sums.contact, sums.place)
    note_mean_forces(step, sums, contacts.force, reaction.stop_torque, reaction.friction_torque)
    tally.cone = max(tally.cone, residual[1])
    end = clock.time + step
    if holding.span > 0.0:
        log_event(end - step + holding.since, BRIDGE, 0, holding.span, holding.wrong, told)
    tell_of_contacts(
        model, end, step, contacts.force, work.force, friction.slides, sums.touched, sums.left,
        told, reported.slipping,
    )  # fmt: skip
    tell_of_stops(end, step, reaction.stop_torque, told, reported.stopped)
    tell_of_constraints(end, work.now.own.force, sums.own, rows, told, reported.closed)
    react(model, first, memory.q, told, loops.held)
    row = row_at(clock.time, record)
    if row >= 0:
        # What acted until the next sample takes the place of what acted at the first instant.
        note_forces(
            model, row, contacts.force, reaction.stop_torque, reaction.friction_torque,
            reaction.slip, residual[1], memory.breakaway, loops.loop_force, loops.coupling_force,
            loops.constraint_force, loops.brake_force, record,
        )  # fmt: skip
        for contact in range(corners.doubled):
            if corners.joins[contact] == 1:
                for i in range(2):
                    record.contact_point[row, contact, i] = sums.place[contact, i]
    if control.continuous == 1:
        show_forces(work.force, corners, contacts)
    clock.time = clock.start + (clock.index + 1) * step
    return DONE


Compliant.work = CompliantWorkspace
Compliant.kernels = Kernels(begin, prepare, decide, report, move)
