"""Joints that begin to rub, and brakes that take hold: friction that changes while time stands."""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats
from heelstrike.sim.contacts.brakes import note_brakes, stops_any, take_hold
from heelstrike.sim.contacts.rows import DRY_JOINT, Rows
from heelstrike.sim.controller.control import Control
from heelstrike.sim.event_driven.impact import REST, heading, strike
from heelstrike.sim.event_driven.phase import Modes, Motion
from heelstrike.sim.event_driven.rows import write_row
from heelstrike.sim.event_driven.smooth.dynamics import evaluate
from heelstrike.sim.frame import Scene
from heelstrike.sim.memory import Memory, Reported
from heelstrike.sim.record.record import Record


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
def brake(scene: Scene, control: Control, memory: Memory, work: Motion, record: Record) -> None:
    """Let the brakes that have been put on take hold, by an impact of all that touches.

    Those that slip begin to, and end.
    """
    phase, step, impact, loops = work.phase, work.step, work.impact, memory.loops
    model, time, begin = scene.model, step.time, step.begin
    v = begin[model.nq :]
    if work.output.last_row < time:
        write_row(scene, True, control, memory, work, record)
    begin_rubbing(v, memory.breakaway, memory.rows, phase.modes, memory.reported)
    stops = take_hold(model, loops.braked)
    # Of joints at rest there is no impact to solve: its data would be rounding.
    if stops and stops_any(model, v, REST, loops.braked):
        evaluate(scene, time, begin, control, memory, phase, step.slopes[0])
        for contact in range(impact.hit.shape[0]):
            impact.hit[contact] = 0
        if not strike(model, scene.ground, memory, work, record):
            work.decision.bridging = 1
    note_brakes(model, time, 1.0, loops.brake_force, record.told, loops.braked)
