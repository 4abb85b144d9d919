"""Whether the estimate of a bridge covers its error, and half the length halves it.

Bridges are laid where nothing calls for them, in the middle of motions that event-driven contact
can follow: at moments drawn at random, from the row before them on. The same time without a bridge
at a tolerance of 1e-11 tells the error of the state at its end (greatest difference of a coordinate
or velocity). The shortest of a series takes 1e-6 s and each further one four times as long: LONGER
says which; a second bridge from the same moment is half as long.

A moment counts if the exact motion has no impact within the bridge. That an impact acts at its
beginning, and not where it belongs, is what a bridge is for: such are told apart (`with_impact`).
A scene without a moment that counts neither passes nor fails (`counts` is false).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.errors import HeelstrikeError
from heelstrike.sim import Event, EventKind, Run, Simulation
from scenes.methods import Setting, bounces
from scenes.scene import random_scene

Words = dict[str, Any]

MOMENTS = 2
"""Bridges a scene."""
LONGER = 3
"""Place of the bridge in its series: 6.4e-5 s."""
LENGTH = 1e-6 * 4.0**LONGER
EXACT = {"rtol": 1e-11, "atol": 1e-13}
NOISE = 1e-11
"""Difference that tolerances leave."""
HALF = 0.6
"""What is left of the error at half the length, at the most."""
IMPULSIVE = (EventKind.TOUCHDOWN, EventKind.IMPACT, EventKind.JOINT_STOP, EventKind.PAINLEVE)


def goes_on(setting: Setting, state: hs.State, begin: float, lead: float, length: float) -> Run:
    """Record of the motion to `lead` + |length| behind a state; with a bridge if `length` > 0."""
    scene, robot = setting.scene, setting.robot
    simulation = Simulation(
        robot, scene.controller(robot), state=state, method=hs.EventDriven(**EXACT),
        ground=scene.ground(restitution=bounces("event_driven")), pushes=scene.pushes(begin),
        stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(lead)
    if length > 0.0:
        motion = simulation._work
        motion.decision.bridging = 1
        motion.series.count, motion.series.begin = LONGER, simulation.time
    simulation.advance(lead + abs(length))
    return simulation.record


def bridge_in(run: Run) -> Event | None:
    """Return the bridge of a record if it is its only one."""
    found = [event for event in run.events if event.kind is EventKind.BRIDGE]
    return found[0] if len(found) == 1 else None


def apart(one: Run, other: Run) -> float:
    """Greatest difference of the last coordinates and velocities."""
    q = np.abs(one.position[-1] - other.position[-1])
    return float(max(q.max(), np.abs(one.velocity[-1] - other.velocity[-1]).max()))


def bridge_at(setting: Setting, run: Run, moment: float) -> Words | None:
    """Lay a bridge at a moment of a run; None where it does not come about."""
    row = int(np.searchsorted(run.time, moment, side="right")) - 1
    state, begin = hs.State(run.position[row], run.velocity[row]), float(run.time[row])
    lead = moment - begin
    errors, wrong, struck = [], 0.0, False
    for length in (0.5 * LENGTH, LENGTH):
        bridged = goes_on(setting, state, begin, lead, length)
        exact = goes_on(setting, state, begin, lead, -length)
        bridge = bridge_in(bridged)
        if bridge is None or not (bridged.completed and exact.completed) or bridge_in(exact):
            return None
        if abs(bridge.impulse[0] - length) > 1e-6 * length:
            return None
        errors.append(apart(bridged, exact))
        wrong = bridge.impulse[1]
        struck = any(e.kind in IMPULSIVE and e.time > lead for e in exact.events)
    halved = errors[0] <= HALF * errors[1] + NOISE
    return {
        "moment": moment, "error": errors[1], "estimate": wrong,
        "covered": errors[1] <= wrong + NOISE, "halved": halved, "with_impact": struck,
    }  # fmt: skip


def bridges_of_scene(check: str, seed: int, *, twins: bool = True) -> Words:
    """Lay bridges into one scene; `twins` says nothing here."""
    del twins
    began = time.process_time()
    setting = Setting.of(random_scene(seed))
    result: Words = {"method": check, "seed": seed, "kind": setting.scene.kind}
    try:
        run = setting.run("event_driven")
    except HeelstrikeError as error:
        return result | {"status": "refused", "passes": False, "message": str(error)}
    draw = np.random.default_rng([seed, 3])
    moments = draw.uniform(0.01, max(run.time[-1] - 0.01, 0.02), size=MOMENTS).tolist()
    tried = [bridge_at(setting, run, moment) for moment in moments]
    found = [one for one in tried if one is not None]
    plain = [one for one in found if not one["with_impact"]]
    causes = []
    if not all(one["covered"] for one in plain):
        causes.append("estimate too small")
    if not all(one["halved"] for one in plain):
        causes.append("not halved")
    return result | {
        "status": run.status.value,
        "message": run.message,
        "counts": bool(plain),
        "passes": bool(plain) and not causes,
        "cause": ", ".join(causes) if plain else "no bridge",
        "size": max((one["error"] for one in plain), default=0.0),
        "bridges": found,
        "seconds": time.process_time() - began,
    }
