"""The frame of every simulation: one loop, in which a method supplies what differs.

An instant is prepared, the controller asked, the instant decided and reported; then the simulation
moves on to the next::

    prepare   kinematics and contacts of the state now, into the memory
    ask       the controller, if it is due
    decide    what acts from now on: forces, contact modes, impulses
    report    rows and events, into the record
    move      to the next instant

The loop comes back undecided, before the controller is asked, so that whatever is set meanwhile
acts at once and a simulation can be stopped, kept and taken up again at any step.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from functools import lru_cache
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from numba import types

from heelstrike.compiler.bundle_type import Fixed
from heelstrike.compiler.compilation import AddressedLoop, dissolved_kernel, kernel
from heelstrike.compiler.separate_kernel import SeparateKernel
from heelstrike.contact.ground import GroundModel
from heelstrike.contact.solvers.certified_solve import try_solvers
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Model
from heelstrike.sim.clock import Clock
from heelstrike.sim.contacts.loops import begin_closed
from heelstrike.sim.controller.asking import ask
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.law import controller_in
from heelstrike.sim.controller.motors import limit_torque
from heelstrike.sim.dimension import AnyRobot, dimension_of
from heelstrike.sim.memory import Memory
from heelstrike.sim.record.record import Record, RowsAndEvents
from heelstrike.sim.record.recording import center_height, note_log, note_row_when_due, sound

if TYPE_CHECKING:  # which have the loops that are made here
    from heelstrike.sim.method import Method


class Outcome(enum.IntEnum):
    """Why a loop came back."""

    DONE = 0
    """The time it was to reach is reached, or the instant finished."""
    PAUSED = 1
    ASKING = 2
    """A controller in Python is due."""
    RECORD_FULL = 3
    FELL = 4
    DIVERGED = 5
    SOLVER_FAILED = 6
    BAD_CONTROLLER = 7
    FORK = 8
    """From here on the end of the simulation shapes its steps."""
    RAISED = 9
    STOPPED = 10
    """The controller has ended the run."""


DONE = int(Outcome.DONE)
PAUSED = int(Outcome.PAUSED)
ASKING = int(Outcome.ASKING)
RECORD_FULL = int(Outcome.RECORD_FULL)
FELL = int(Outcome.FELL)
DIVERGED = int(Outcome.DIVERGED)
SOLVER_FAILED = int(Outcome.SOLVER_FAILED)
BAD_CONTROLLER = int(Outcome.BAD_CONTROLLER)
FORK = int(Outcome.FORK)
STOPPED = int(Outcome.STOPPED)

# Of an instant that has been decided and recorded, and was the last.
TOLD = 2


class Scene(NamedTuple):
    """What a motion depends on and no method changes: who decides the torques, robot and ground.

    Attributes
    ----------
    controller : function
        To be asked by :func:`~heelstrike.sim.controller.asking.ask`.
    model : Model or SpatialModel
    ground : GroundModel or SpatialGroundModel
    """

    controller: Any
    model: Any
    ground: Any


@dataclass(frozen=True)
class Common:
    """What all methods of the plane have in common, or those of space."""

    kinds: tuple[Any, ...]
    """Classes of model, ground, control, memory and record."""
    sound: Callable[..., bool]
    """Kernel ``sound(q, v)``: whether the state is finite and not absurd."""
    ask: Callable[..., None]
    """Kernel ``ask(controller, time, q, v, model, tree, contacts, control, command)``: ask the
    controller."""
    limit_torque: Callable[..., bool]
    """Kernel ``limit_torque(model, voltage, v, tally, command, torque)``: find the torques of the
    commands; returns whether all of these are finite."""
    center_height: Callable[..., float]
    """Kernel ``center_height(model, ground, tree)``: height of the centre of mass over the
    ground."""
    note_row_when_due: Callable[..., int]
    """Kernel ``note_row_when_due(memory, clock, record)``: append a row if one is due; returns
    which, or -1."""
    solver: SeparateKernel
    """What solves contact problems."""
    begin_closed: Callable[..., bool] | None = None
    """Kernel ``begin_closed(model, q, equations, loops, v)``: close the loops of the first state;
    returns whether they can be closed. None where there are no loops."""


IN_THE_PLANE = Common(
    (Model, GroundModel, Control, Memory, Record), sound, ask, limit_torque, center_height,
    note_row_when_due, try_solvers, begin_closed,
)  # fmt: skip


@dataclass(frozen=True)
class Kernels:
    """What a method supplies to the frame; ``work`` is the bundle of the method."""

    begin: Callable[..., int] | None
    """Kernel ``begin(model, ground, memory, work, record)``: prepare the first instant, at which
    the loops have been closed; returns ``DONE`` or what is in the way. None of a method that has
    nothing to prepare."""
    prepare: Callable[..., None]
    """Kernel ``prepare(model, ground, memory, work)``: find kinematics, velocities and contacts of
    the state in ``memory.q`` and ``memory.v``."""
    decide: Callable[..., int]
    """Kernel ``decide(scene, control, memory, work, record, clock)``: decide what acts from now on;
    returns ``DONE`` or what is in the way."""
    report: Callable[..., None] | None
    """Kernel ``report(scene, control, memory, work, record, clock)``: append to the record what is
    due of this instant. None of a method that appends a row if one is due, and no more."""
    move: Callable[..., int]
    """Kernel ``move(scene, control, memory, work, record, clock)``: bring state and ``clock.time``
    to the next instant; returns ``DONE`` or what is in the way. After ``RECORD_FULL`` or ``FORK``
    it is called again."""
    common: Common = IN_THE_PLANE
    """What it has in common with others."""


@dissolved_kernel
def is_full(rows: int, events: int, record: RowsAndEvents) -> bool:
    """Whether there may be no room in the record for so many rows and events more."""
    told = record.told
    full = record.rows + rows > record.time.shape[0]
    return bool(full or told.events + events > told.event_time.shape[0])


@dissolved_kernel
def is_due(clock: Clock) -> bool:
    """Whether the controller is to be asked."""
    if clock.control_every > 0:
        return bool(clock.calls == 0 or clock.index % clock.control_every == 0)
    return bool(clock.time >= clock.calls * clock.control_period)


@kernel
def nothing(model: Any, ground: Any, memory: Any, work: Any, record: Any) -> int:  # noqa: ARG001
    """Begin with nothing to prepare."""
    return DONE


def closing(begin_closed: Callable[..., bool] | None) -> Callable[[Any, Any], bool]:
    """Make the kernel that closes the loops of a memory; it returns whether they can be closed."""

    @kernel
    def no_loops(model: Any, memory: Any) -> bool:  # noqa: ARG001
        return True

    @kernel
    def loops(model: Any, memory: Any) -> bool:
        return begin_closed(model, memory.q, memory.equations, memory.loops, memory.v)  # type: ignore[misc]

    return no_loops if begin_closed is None else loops


def reporting(note_row_when_due: Callable[..., int]) -> Callable[..., None]:
    """Make the kernel that reports an instant by a row, if one is due."""

    @dissolved_kernel
    def report(scene: Any, control: Any, memory: Any, work: Any, record: Any, clock: Clock) -> None:  # noqa: ARG001
        note_row_when_due(memory, clock, record)

    return report


def frame(kernels: Kernels) -> Callable[..., int]:
    """Return the loop of a method."""
    common = kernels.common
    begin = kernels.begin or nothing
    prepare, decide, move = kernels.prepare, kernels.decide, kernels.move
    report = kernels.report or reporting(common.note_row_when_due)
    is_sound, ask_law, limit = common.sound, common.ask, common.limit_torque
    close, height = closing(common.begin_closed), common.center_height

    def advance(
        model: Any, ground: Any, control: Any, memory: Any, work: Any, record: Any, clock: Clock
    ) -> int:
        """Advance a simulation until its time is up or something stops it; return what."""
        controller = controller_in(control.function)
        scene = Scene(controller, model, ground)
        q, v, equations = memory.q, memory.v, memory.equations
        if clock.moving == TOLD:  # taken up again, to be left or looked at
            if clock.finishing == 0 and clock.time >= clock.until:
                return DONE
            clock.moving = 1 - clock.finishing
        while True:
            if is_full(clock.row_margin, clock.event_margin, record):
                return RECORD_FULL
            if clock.begun == 0:
                if not close(model, memory):
                    return DIVERGED
                code = begin(model, ground, memory, work, record)
                if code != DONE:
                    return code
                clock.begun = 1
            if clock.moving == 0:
                if clock.finishing == 0:
                    if clock.time >= clock.until:
                        return DONE
                    if clock.index >= clock.pause:
                        return PAUSED
                if not is_sound(q, v):
                    return DIVERGED
                prepare(model, ground, memory, work)
                if is_due(clock):
                    if control.in_python == 0:
                        ask_law(
                            controller, clock.time, q, v, model, equations.tree, memory.contacts,
                            control, memory.command,
                        )  # fmt: skip
                    elif clock.answered == 0:
                        return ASKING
                    clock.answered = 0
                    clock.calls += 1
                command, torque = memory.command, memory.torque
                if not limit(model, control.voltage, v, memory.tally, command, torque):
                    return BAD_CONTROLLER
                if control.robot.ending >= 0:
                    clock.finishing = 1
                code = decide(scene, control, memory, work, record, clock)
                if code in (DONE, SOLVER_FAILED):
                    report(scene, control, memory, work, record, clock)
                note_log(control.kept, control.logged, record)
                if code != DONE:
                    return code
                if height(model, ground, equations.tree) < clock.fallen_height:
                    clock.moving = TOLD
                    return FELL
                if control.robot.ending >= 0:
                    clock.moving = TOLD
                    return STOPPED
                if clock.finishing == 1:
                    return DONE
                clock.moving = 1
            code = move(scene, control, memory, work, record, clock)
            note_log(control.kept, control.logged, record)
            if code != DONE:
                return code
            clock.moving = 0
            clock.index += 1

    return advance


PLAIN: Fixed = (
    ("loops", 0), ("couplings", 0), ("latches", 0), ("brakes", 0), ("loop_rows", 0), ("nd", 0),
    ("segments", 1), ("concave", 0), ("curved", 0), ("constraints", 0), ("ties", 0), ("axes", 2),
    ("components", 2),
)  # fmt: skip
"""What a robot and a ground without rarer features have none of, and what is so in the plane.

A loop that is made for these has no code for closed loops, latches, brakes, dry friction,
constraints from outside, profiles or curves.
"""


def fixed_for(robot: AnyRobot, ground: Any, work: Any, method: Method) -> Fixed:
    """Return what the loop of a simulation can take for granted: all that is rare, or nothing.

    So a method has two loops, and a third where it names the usual extents of robots. Each is
    compiled when it is first needed. In space there is one.
    """
    plain = PLAIN + tuple(method.usual_numbers.items())
    if not (dimension_of(robot).is_plain(robot, ground) and agrees(work, plain)):
        return ()
    extents, seven = robot.model.extents, plain + tuple(method.usual_extents.items())
    usual = all(extents[name] == size for name, size in method.usual_extents.items())
    return seven if usual and agrees(work, seven) else plain


def agrees(bundle: Any, fixed: Fixed) -> bool:
    """Whether a bundle and its parts have what is taken for granted of extents and numbers.

    In the package a name means the same everywhere. A method from outside may give it to something
    else.
    """
    known, extents = dict(fixed), bundle.extents
    if any(size != known.get(name, size) for name, size in extents.items()):
        return False
    for name, member in bundle.declared.items():
        if member.role == "part" and not agrees(getattr(bundle, name), fixed):
            return False
        if member.role == "number" and name in known and getattr(bundle, name) != known[name]:
            return False
    return True


@lru_cache
def compiled_loop(kernels: Kernels, work: Any, fixed: Fixed = ()) -> tuple[AddressedLoop, float]:
    """Compile the loop of a method, or load it; return it with the seconds that took."""
    begin = perf_counter()
    model, ground, control, memory, record = kernels.common.kinds
    kinds = (model, ground, control, memory, work, record, Clock)
    signature = types.int64(*(kind.compiled_type() for kind in kinds))
    kernels.common.solver.begin()
    compiled = AddressedLoop(signature, frame(kernels), fixed)
    kernels.common.solver.finish()
    return compiled, perf_counter() - begin
