"""The loop of a simulation in space: an instant is found, the controller asked, a step taken.

It comes back undecided, before a controller in Python is asked, so that whatever is set meanwhile
acts at once.
"""

from __future__ import annotations

from functools import lru_cache
from time import perf_counter
from typing import Any

from numba import types

from heelstrike.compiler.bundle import Bundle, cell
from heelstrike.compiler.compilation import kernel, loop_for
from heelstrike.contact.spatial.certified_solve import try_ways
from heelstrike.contact.spatial.ground import SpatialGroundModel
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.controller.law import controller_in
from heelstrike.sim.frame import (
    ASKING,
    BAD_CONTROLLER,
    DIVERGED,
    DONE,
    FELL,
    PAUSED,
    RECORD_FULL,
    SOLVER_FAILED,
    STOPPED,
)
from heelstrike.sim.record.recording import FARTHEST, FASTEST
from heelstrike.sim.spatial.controlled import SpatialControl, ask_law
from heelstrike.sim.spatial.memory import SpatialEquations, SpatialMemory, SpatialTally
from heelstrike.sim.spatial.record import (
    ENERGY_GAIN,
    NO_IMPULSE,
    UNCERTIFIED,
    SpatialRecord,
    begin_row,
    finish_row,
    log_spatial_event,
    note_deepest,
    note_spatial_events,
)
from heelstrike.sim.spatial.stepping import find_state, residual_of, take_step


class SpatialClock(Bundle):
    """When a simulation in space is, and what its loop goes by."""

    start: float = cell(float)
    """Time at which steps began to be counted (s)."""
    step: float = cell(float)
    """Length of a step (s)."""
    index: int = cell(int)
    """Steps taken since `start`."""
    last: int = cell(int)
    """Index at which the loop comes back."""
    control_every: int = cell(int)
    """Steps between two calls of the controller."""
    answered: int = cell(int)
    """Whether a controller in Python has been asked for this instant."""
    record_every: int = cell(int)
    """Steps between two rows of the record."""
    resolves: int = cell(int)
    """Whether impacts are whole within their step."""
    finishing: int = cell(int)
    """Whether this instant is to be decided and recorded, but not to be left."""
    fallen_height: float = cell(float)
    """Height of the centre of mass above the ground below which the robot has fallen (m)."""
    begun: int = cell(int)
    """Whether the first step has been taken."""
    event_margin: int = cell(int)
    """Most events of a step."""


@kernel
def limit_commands(
    model: SpatialModel, v: Floats, command: Floats, tally: SpatialTally, torque: Floats
) -> bool:
    """Find the torques of an instant from its commands; return whether all of these are finite.

    Torques keep to the limits of their actuators, and to the line from stall torque to no-load
    speed where a motor has one.
    """
    for i in range(model.nu):
        wanted = command[i]
        if not abs(wanted) < FASTEST * FASTEST:
            tally.bad_torque = i
            return False
        applied = min(max(wanted, model.torque_lower[i]), model.torque_upper[i])
        k = model.actuator_velocity[i]
        stall = model.stall_torque[k]
        if stall < FASTEST * FASTEST:
            drag = stall / model.no_load_speed[k] * v[k]
            applied = min(max(applied, -stall - drag), stall - drag)
        tally.saturations += applied != wanted
        torque[i] = applied
    return True


@kernel
def is_sound(q: Floats, v: Floats) -> bool:
    """Whether the state is finite and not absurd."""
    bad = 0
    for i in range(q.shape[0]):
        bad += not abs(q[i]) < FARTHEST
    for i in range(v.shape[0]):
        bad += not abs(v[i]) < FASTEST
    return bad == 0


@kernel
def height_of_mass(
    model: SpatialModel, ground: SpatialGroundModel, equations: SpatialEquations
) -> float:
    """Height of the centre of mass above the plane of the ground, along its normal."""
    mass = x = y = z = 0.0
    inertia, pivot, normal = equations.tree.inertia, equations.tree.pivot, ground.normal
    for i in range(model.nl):
        mass += inertia[i, 0]
        x += inertia[i, 1]
        y += inertia[i, 2]
        z += inertia[i, 3]
    along = normal[0] * (pivot[0] + x / mass) + normal[1] * (pivot[1] + y / mass)
    return along + normal[2] * (pivot[2] + z / mass) - ground.height


def advance_in_space(
    model: SpatialModel, ground: SpatialGroundModel, control: SpatialControl,
    memory: SpatialMemory, record: SpatialRecord, clock: SpatialClock,
) -> int:  # fmt: skip
    """Advance a simulation until its time is up or something stops it; return what."""
    controller = controller_in(control.function)
    while True:
        if clock.finishing == 0 and clock.index >= clock.last:
            return PAUSED
        full = record.events + clock.event_margin > record.event_time.shape[0]
        if full or record.rows + 1 > record.time.shape[0]:
            return RECORD_FULL
        if not is_sound(memory.q, memory.v):
            return DIVERGED
        time = clock.start + clock.index * clock.step
        find_state(
            model, ground, memory.q, memory.v, memory.equations, memory.blocks, memory.contacts,
            memory.feet,
        )  # fmt: skip
        if clock.index % clock.control_every == 0 or clock.begun == 0:
            if control.in_python == 0:
                ask_law(controller, time, model, memory.q, memory.v, control, memory.command)
            elif clock.answered == 0:
                return ASKING
        clock.answered = 0
        if not limit_commands(model, memory.v, memory.command, memory.tally, memory.torque):
            return BAD_CONTROLLER
        note_deepest(memory.feet.foot.shape[0], memory.blocks.gap, memory.tally)
        due = clock.index % clock.record_every == 0 or clock.finishing == 1
        if due:
            begin_row(time, memory.q, memory.v, memory.torque, memory.contacts, record)
        for i in range(model.nq):
            memory.kept_q[i] = memory.q[i]
        for k in range(model.nv):
            memory.kept_v[k] = memory.v[k]
        below = height_of_mass(model, ground, memory.equations) < clock.fallen_height
        gain, steps = memory.tally.energy_gain, memory.tally.steps
        done, certified = take_step(
            model, ground, time, clock.step, clock.resolves == 1, memory
        )  # fmt: skip
        if due:
            finish_row(
                memory.stop_torque, memory.friction_torque, memory.contacts.force, memory.feet.slip,
                residual_of(memory.assembly.answer), record,
            )  # fmt: skip
        ended = below or clock.finishing == 1 or control.robot.ending >= 0
        if not done or ended:
            for i in range(model.nq):
                memory.q[i] = memory.kept_q[i]
            for k in range(model.nv):
                memory.v[k] = memory.kept_v[k]
            memory.tally.steps = steps
            if not done:
                return SOLVER_FAILED
            if clock.finishing == 1:
                return DONE
            return FELL if below else STOPPED
        note_spatial_events(
            time, clock.step, clock.begun == 0, memory.v, memory.feet.slip, memory.blocks,
            memory.reported, record,
        )  # fmt: skip
        if not certified:
            log_spatial_event(time + clock.step, UNCERTIFIED, -1, NO_IMPULSE, record)
        if memory.tally.energy_gain > gain:
            log_spatial_event(time + clock.step, ENERGY_GAIN, -1, NO_IMPULSE, record)
        clock.begun = 1
        clock.index += 1


@lru_cache
def spatial_loop() -> tuple[Any, float]:
    """Compile the loop, or load it; return it with the seconds that took."""
    begin = perf_counter()
    kinds = (
        SpatialModel, SpatialGroundModel, SpatialControl, SpatialMemory, SpatialRecord,
        SpatialClock,
    )  # fmt: skip
    signature = types.int64(*(kind.compiled_type() for kind in kinds))
    try_ways.begin()
    compiled = loop_for(signature, advance_in_space)
    try_ways.finish()
    return compiled, perf_counter() - begin
