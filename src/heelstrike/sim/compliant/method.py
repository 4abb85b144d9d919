"""Compliant ground: springs, dampers and smoothed friction in the place of the contact problem.

The penalty methods of the paper's [13]. Between two samples, one `step` apart, the equations of
motion are integrated with steps of their own, as long as the tolerances allow. Because the contact
forces are taken implicitly (:mod:`heelstrike.sim.compliant.dynamics`), stiff ground does not
shorten them while a foot stands; they end where a contact point meets the ground, and are short
where the force really changes fast, after an impact.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from time import perf_counter
from typing import Any

import numpy as np
from numba import types

from heelstrike.compiler.compilation import kernel, loop_for
from heelstrike.contact.ground import GroundModel
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.sim.compliant.contact_law import (
    NUMBERS,
    BristleFriction,
    FrictionLaw,
    HuntCrossley,
    KelvinVoigt,
    NormalLaw,
    RegularisedFriction,
    slips,
)
from heelstrike.sim.compliant.dynamics import (
    GAINS_LAST,
    CompliantWorkspace,
    Control,
    Laws,
    attempt_step,
    begin_step,
    compliant_workspace,
    evaluate,
    find_gains,
)
from heelstrike.sim.compliant.rosenbrock import ORDER
from heelstrike.sim.contact_geometry import observe
from heelstrike.sim.controller.asking import ask
from heelstrike.sim.controller.guard import guarded
from heelstrike.sim.controller.interface import (
    CONTROLLER_TYPE,
    MODEL_TYPE,
    hold_torque,
)
from heelstrike.sim.engine import (
    BAD_CONTROLLER,
    DIVERGED,
    DONE,
    FELL,
    PAUSED,
    RECORD_FULL,
    Engine,
    Setting,
    whole_steps,
)
from heelstrike.sim.memory import (
    CONE,
    PENETRATION,
    STEPS,
    Memory,
    Record,
)
from heelstrike.sim.push import share_over_step
from heelstrike.sim.record_size import check_room, check_steps
from heelstrike.sim.recording import (
    JOINT_STOP,
    LIFTOFF,
    LIFTOFF_GAP,
    SLIP,
    STICK,
    TOUCHDOWN,
    center_height,
    limit_torque,
    note_event,
    note_row,
    sound,
)

# Shortest step in s. It is taken whatever its error: only a torque that jumps asks for less, and a
# jump of 1000 rad/s² over so short a time is 1e-7 rad/s.
SHORTEST = 1e-10
SAFETY = 0.9
SHRINK = 0.2
GROW = 5.0

# Places in the clock and the span of a run.
START = 0
STEP = 1
FALLEN = 2
RTOL = 3
ATOL = 4
PROPOSED = 5
NOW = 0
LAST = 1
PAUSE = 2
CONTROL_EVERY = 3
RECORD_EVERY = 4
CONTINUOUS = 5


@dataclass(frozen=True, kw_only=True)
class Compliant:
    """Ground that gives way: contact forces from a law instead of a contact problem.

    Parameters
    ----------
    law : HuntCrossley or KelvinVoigt
        Normal force from penetration and its rate, for each contact point.
    friction : RegularisedFriction or BristleFriction
        Tangential force; its coefficient μ is the ground's. Only a bristle holds a foot in place.
    stop : HuntCrossley or KelvinVoigt
        Torque of a joint beyond the end of its range, from the angle and its rate (with N m and
        rad in the place of N and m for a hinge).
    step : float
        Time in seconds between two samples: calls of the controller and rows of the record. The
        integration's own steps are never longer and as short as they need to be.
    rtol, atol : float
        Tolerated error of a step of the integration in positions (m, rad) and velocities (m/s,
        rad/s), relative and absolute; for the bends of bristles (m) too.

    Raises
    ------
    SimulationError
        If the step or a tolerance is not positive, or a law is none of the above.

    Notes
    -----
    A compiled controller without a control period acts continuously: it is called within every
    step of the integration and remembers what it saw at its end, with the contact forces of that
    very instant. Its gains are taken implicitly with the contact forces. A controller in Python,
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

    law: NormalLaw = field(default_factory=HuntCrossley)
    friction: FrictionLaw = field(default_factory=BristleFriction)
    stop: NormalLaw = field(default_factory=lambda: KelvinVoigt(stiffness=1e5, damping=1e2))
    step: float = 1e-3
    rtol: float = 1e-5
    atol: float = 1e-7

    def __post_init__(self) -> None:
        for name in ("law", "stop"):
            law = getattr(self, name)
            if not isinstance(law, HuntCrossley | KelvinVoigt):
                raise SimulationError(
                    f"{name} must be HuntCrossley(...) or KelvinVoigt(...), got {law!r}"
                )
        if not isinstance(self.friction, RegularisedFriction | BristleFriction):
            raise SimulationError(
                f"friction must be RegularisedFriction(...) or BristleFriction(...), got "
                f"{self.friction!r}; the coefficient μ belongs to the ground"
            )
        for name in ("step", "rtol", "atol"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise SimulationError(f"{name} must be a positive number, got {value}")

    def engine(self, setting: Setting) -> Engine:
        """Return this way through time, compiled and ready to run.

        Raises
        ------
        SimulationError
            If the ground has a restitution of its own; if steps or rows are too many to be counted
            or kept.
        """
        return _CompliantEngine(self, setting)


@kernel
def account(model: Model, since: float, h: float, memory: Memory, work: CompliantWorkspace) -> None:
    """Add a step of length h, begun at time `since`, to impulses, extremes and crossings.

    The impulse is the trapezium of the forces of the law. As a sum of forces inside the friction
    cone with positive weights it lies in the cone itself.
    """
    for joint in range(model.parent.shape[0]):
        work.stop_impulse[joint] += 0.5 * h * (work.base_stop_force[joint] + work.stop_force[joint])
        work.dry_impulse[joint] += 0.5 * h * (work.base_dry_force[joint] + work.dry_force[joint])
    for contact in range(model.contact_link.shape[0]):
        for k in range(2):
            work.impulse[contact, k] += (
                0.5 * h * (work.base_force[contact, k] + work.force[contact, k])
            )
        gap = memory.contacts.gap[contact]
        before = work.base_gap[contact]
        memory.extreme[PENETRATION] = max(memory.extreme[PENETRATION], -gap)
        if memory.closed[contact] == 0 and gap < 0.0:
            memory.closed[contact] = 1
            share = before / (before - gap) if before > 0.0 else 0.0
            work.touched[contact] = since + share * h
        elif memory.closed[contact] == 1 and gap > LIFTOFF_GAP:
            memory.closed[contact] = 0
            share = before / (before - gap) if before < 0.0 else 0.0
            work.left[contact] = since + share * h


@kernel
def landing(model: Model, depth: float, memory: Memory, work: CompliantWorkspace) -> float:
    """Part of the step after which the first contact point that fell into the ground met it.

    One, if none began the step above the ground and ended it deeper than `depth`. The stages of a
    long step through the air may all lie above the ground that its end lies in.
    """
    first = 1.0
    for contact in range(model.contact_link.shape[0]):
        gap = memory.contacts.gap[contact]
        before = work.base_gap[contact]
        if before > depth and gap < -depth:
            first = min(first, before / (before - gap))
    return first


@kernel
def cone_residual(model: Model, memory: Memory, work: CompliantWorkspace) -> float:
    """Largest excess of a contact force over the friction cone, relative to the force."""
    worst = 0.0
    for contact in range(model.contact_link.shape[0]):
        normal = work.force[contact, 0]
        tangent = abs(work.force[contact, 1])
        excess = max(-normal, tangent - memory.friction[contact] * normal)
        if excess > 0.0:
            worst = max(worst, excess / (abs(normal) + tangent))
    return worst


@kernel
def sample(
    model: Model,
    ground: GroundModel,
    laws: Laws,
    control: Control,
    start: float,
    clock: Floats,
    memory: Memory,
    work: CompliantWorkspace,
) -> int:
    """Integrate from one sample to the next; return DONE or what was in the way.

    ``memory.contacts.force`` receives the mean contact forces.
    """
    for contact in range(model.contact_link.shape[0]):
        work.impulse[contact, 0] = 0.0
        work.impulse[contact, 1] = 0.0
        work.touched[contact] = -1.0
        work.left[contact] = -1.0
    for joint in range(model.parent.shape[0]):
        work.stop_impulse[joint] = 0.0
        work.dry_impulse[joint] = 0.0
    memory.residual[1] = cone_residual(model, memory, work)
    span = clock[STEP]
    elapsed = 0.0
    h = clock[PROPOSED]
    begin_step(model, memory, work)
    if control.continuous and work.age >= GAINS_LAST:
        find_gains(control, start, model, memory, work)
    rejected = False
    while elapsed < span:
        remaining = span - elapsed
        final = h >= remaining * (1.0 - 1e-9)
        taken = remaining if final else h
        error = attempt_step(
            model,
            ground,
            laws,
            control,
            start + elapsed,
            taken,
            clock[RTOL],
            clock[ATOL],
            memory,
            work,
        )
        shortest = taken <= SHORTEST
        finite = error < np.inf
        if not (error <= 1.0 or (shortest and finite)):
            if control.continuous and (work.age > 0 or shortest):
                find_gains(control, start + elapsed, model, memory, work)
            if shortest:
                for i in range(model.parent.shape[0]):
                    memory.q[i] = work.base_q[i]
                    memory.v[i] = work.base_v[i]
                return DIVERGED if limit_torque(model, memory) else BAD_CONTROLLER
            factor = SHRINK
            if finite:
                factor = max(SHRINK, SAFETY * error ** (-1.0 / ORDER))
            h = max(taken * factor, SHORTEST)
            rejected = True
            continue
        observe(model, ground, memory)
        met = landing(model, clock[ATOL], memory, work)
        if met < 1.0 and not shortest:
            h = max(taken * met, SHORTEST)
            continue
        # At the sample itself the controller is called by the one who takes it.
        evaluate(
            model, ground, laws, control, not final, False, start + elapsed + taken, memory, work
        )
        account(model, start + elapsed, taken, memory, work)
        memory.residual[1] = max(memory.residual[1], cone_residual(model, memory, work))
        memory.tally[STEPS] += 1
        work.age += 1
        begin_step(model, memory, work)
        elapsed = span if final else elapsed + taken
        factor = GROW
        if error > 0.0 and not shortest:
            factor = min(GROW, SAFETY * error ** (-1.0 / ORDER))
        if rejected and not shortest:
            factor = min(factor, 1.0)
            rejected = False
        # A step cut short by the sample says little about how long the next may be.
        h = max(h, taken * factor) if final else taken * factor
    clock[PROPOSED] = min(h, span)
    for contact in range(model.contact_link.shape[0]):
        for k in range(2):
            memory.contacts.force[contact, k] = work.impulse[contact, k] / span
    for joint in range(model.parent.shape[0]):
        memory.stop_torque[joint] = work.stop_impulse[joint] / span
        memory.friction_torque[joint] = work.dry_impulse[joint] / span
    memory.extreme[CONE] = max(memory.extreme[CONE], memory.residual[1])
    return DONE


@kernel
def note_events(
    model: Model, laws: Laws, record: Record, time: float, memory: Memory, work: CompliantWorkspace
) -> None:
    """Note what happened since the last sample; `time` is now.

    Touchdown and lift-off are timed where the gap passes zero, stick and slip to the sample.
    """
    for contact in range(model.contact_link.shape[0]):
        touched = work.touched[contact]
        left = work.left[contact]
        if touched >= 0.0 or left >= 0.0:
            memory.slipping[contact] = 0
        if left >= 0.0 and left < touched:
            note_event(record, left, LIFTOFF, contact, memory)
        if touched >= 0.0:
            note_event(record, touched, TOUCHDOWN, contact, memory)
        if left >= 0.0 and left >= touched:
            note_event(record, left, LIFTOFF, contact, memory)
        if left >= 0.0 or work.force[contact, 0] <= 0.0:
            continue
        sliding = slips(
            laws.friction,
            laws.numbers,
            memory.friction[contact] * work.force[contact, 0],
            memory.slip[contact],
            work.bristle[contact],
        )
        if sliding and memory.slipping[contact] == 0:
            memory.slipping[contact] = 1
            note_event(record, time, SLIP, contact, memory)
        elif not sliding and memory.slipping[contact] == 1:
            memory.slipping[contact] = 0
            note_event(record, time, STICK, contact, memory)
    for joint in range(model.parent.shape[0]):
        pressed = memory.stop_torque[joint] != 0.0
        if pressed and memory.stopped[joint] == 0:
            place = record.event_count[0]
            record.event_time[place] = time
            record.event_kind[place] = JOINT_STOP
            record.event_contact[place] = joint
            record.event_impulse[place, 0] = abs(memory.stop_torque[joint])
            record.event_impulse[place, 1] = 0.0
            record.event_count[0] = place + 1
        memory.stopped[joint] = 1 if pressed else 0


@kernel
def note_forces(
    record: Record, row: int, force: Floats, stop_force: Floats, dry_force: Floats, memory: Memory
) -> None:
    """Write the forces of contacts and joints, the slip and the residual of a row."""
    for joint in range(stop_force.shape[0]):
        record.stop_torque[row, joint] = stop_force[joint]
        record.friction_torque[row, joint] = dry_force[joint]
    for contact in range(force.shape[0]):
        record.force[row, contact, 0] = force[contact, 0]
        record.force[row, contact, 1] = force[contact, 1]
        record.slip[row, contact] = memory.slip[contact]
    record.residual[row, 1] = memory.residual[1]


def _advance(
    controller: Any,
    model: Model,
    ground: GroundModel,
    laws: Laws,
    parameters: Floats,
    controller_memory: Floats,
    trial_memory: Floats,
    memory: Memory,
    work: CompliantWorkspace,
    record: Record,
    clock: Floats,
    span: Integers,
) -> int:
    """Advance a simulation on compliant ground until its span ends or something stops it.

    Parameters
    ----------
    clock : (6,) float
        Time of sample 0, time between samples, height of the centre of mass below which it fell,
        relative and absolute tolerance, step that the integration proposes next.
    span : (6,) int
        Sample now, last sample, sample to pause before, samples between controller calls and
        between rows, whether the controller acts between the samples too. At the last sample
        everything is evaluated and recorded, but time does not move on.
    """
    step = clock[STEP]
    last = span[LAST]
    nv = model.parent.shape[0]
    count = model.contact_link.shape[0]
    continuous = span[CONTINUOUS] == 1
    control = Control(continuous, controller, parameters, controller_memory, trial_memory)
    held = Control(False, controller, parameters, controller_memory, trial_memory)
    while True:
        if (
            record.row_count[0] >= record.time.shape[0]
            or record.event_count[0] + 2 * count + nv > record.event_time.shape[0]
        ):
            return RECORD_FULL
        k = span[NOW]
        if k == span[PAUSE]:
            return PAUSED
        time = clock[START] + k * step
        if not sound(memory):
            return DIVERGED
        observe(model, ground, memory)
        if k == 0:
            for contact in range(count):
                memory.closed[contact] = memory.contacts.gap[contact] <= LIFTOFF_GAP
        if k % span[CONTROL_EVERY] == 0:
            ask(
                controller,
                time,
                memory.q,
                memory.v,
                model,
                memory,
                parameters,
                controller_memory,
                memory.torque,
            )
            if not limit_torque(model, memory):
                return BAD_CONTROLLER
        share_over_step(memory.pushes, time, step)
        evaluate(model, ground, laws, held, True, False, time, memory, work)
        recorded = k % span[RECORD_EVERY] == 0 or k == last
        row = record.row_count[0]
        if recorded:
            note_row(record, time, memory)
            note_forces(record, row, work.force, work.stop_force, work.dry_force, memory)
        if center_height(model, ground, memory) < clock[FALLEN]:
            return FELL
        if k == last:
            return DONE
        code = sample(model, ground, laws, control, time, clock, memory, work)
        if code != DONE:
            return code
        first = record.event_count[0]
        note_events(model, laws, record, time + step, memory, work)
        for place in range(first, record.event_count[0]):
            record.event_impulse[place, 0] *= step
            record.event_impulse[place, 1] *= step
        if recorded:
            # What acted until the next sample takes the place of what acted at the first instant.
            note_forces(
                record,
                row,
                memory.contacts.force,
                memory.stop_torque,
                memory.friction_torque,
                memory,
            )
        if continuous:
            for contact in range(count):
                memory.contacts.force[contact, 0] = work.force[contact, 0]
                memory.contacts.force[contact, 1] = work.force[contact, 1]
        span[NOW] = k + 1


@lru_cache(maxsize=1)
def compiled_advance() -> tuple[Any, float]:
    """Compile the loop or load it from the cache; return it with the seconds that took."""
    begin = perf_counter()
    vector = types.float64[::1]
    signature = types.int64(
        CONTROLLER_TYPE,
        MODEL_TYPE,
        GroundModel.compiled_type(),
        Laws.compiled_type(),
        vector,
        vector,
        vector,
        Memory.compiled_type(),
        CompliantWorkspace.compiled_type(),
        Record.compiled_type(),
        vector,
        types.int64[::1],
    )
    compiled = loop_for(signature, _advance)
    return compiled, perf_counter() - begin


class _CompliantEngine:
    """Compliant ground under one simulation."""

    def __init__(self, method: Compliant, setting: Setting) -> None:
        if np.any(setting.ground.restitution > 0.0):
            raise SimulationError(
                "on compliant ground the restitution follows from the contact law; leave that of "
                "the ground at zero and use HuntCrossley.from_sink or KelvinVoigt.from_sink"
            )
        check_steps(setting, "step", method.step)
        check_room(setting, "step", method.step)
        self._advance, self.compile_s = compiled_advance()
        self._setting = setting
        self.spare = guarded(())
        self._work = compliant_workspace(setting.robot)
        numbers = np.zeros(NUMBERS)
        method.law.write(numbers)
        method.friction.write(numbers)
        stop_numbers = np.zeros(NUMBERS)
        method.stop.write(stop_numbers)
        self._laws = Laws(
            normal=method.law.kind,
            friction=method.friction.kind,
            numbers=numbers,
            stop=method.stop.kind,
            stop_numbers=stop_numbers,
        )
        self.solver = f"{type(method.law).__name__}, {type(method.friction).__name__}"
        self._control_every = 1
        if setting.control_period is not None:
            self._control_every = whole_steps("control_period", setting.control_period, method.step)
        self._clock = np.array(
            [0.0, method.step, setting.fallen_height, method.rtol, method.atol, method.step]
        )
        self._span = np.array(
            [
                0,
                round(setting.duration / method.step),
                0,
                self._control_every,
                setting.record_every,
                0,
            ]
        )

    def _spare_for(self, controller_memory: Floats) -> Floats:
        if self.spare.size != controller_memory.size:
            self.spare = guarded(controller_memory)
        return self.spare

    @property
    def time(self) -> float:
        return float(self._clock[START] + self._span[NOW] * self._clock[STEP])

    @property
    def rows_left(self) -> int:
        return int(self._span[LAST] - self._span[NOW]) // self._setting.record_every + 1

    def pause_after(self, steps: int | None) -> None:
        self._span[PAUSE] = self._span[NOW] + (self._control_every if steps is None else steps)

    def advance(
        self,
        controller: Any,
        parameters: Floats,
        controller_memory: Floats,
        record: Record,
    ) -> int:
        setting = self._setting
        continuous = setting.control_period is None and controller is not hold_torque
        self._span[CONTINUOUS] = continuous
        return int(
            self._advance(
                controller,
                setting.robot.model,
                setting.ground,
                self._laws,
                parameters,
                controller_memory,
                self._spare_for(controller_memory),
                setting.memory,
                self._work,
                record,
                self._clock,
                self._span,
            )
        )
