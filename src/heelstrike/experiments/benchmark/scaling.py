"""What a step costs with more joints, and with more contacts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.experiments.benchmark.engines import PARTS_OF_STEPS, simulators
from heelstrike.experiments.benchmark.own import NEVER, InvalidRunError
from heelstrike.experiments.benchmark.peer import Engine, reason
from heelstrike.experiments.benchmark.scenarios import FRICTION, Scenario, chain, plank
from heelstrike.experiments.benchmark.stopwatch import Work, best_of, steps_in_slot
from heelstrike.robot import State, read_mjcf
from heelstrike.sim import Run, TimeStepping, simulate
from heelstrike.sim.whole_run import whole

STEP = 1e-3
STEPS = 500
JOINTS = (2, 3, 5, 8, 12, 20, 30, 45, 60)
CONTACTS = (0, 2, 4, 8, 16, 32, 64)


def measure_scaling(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time a swinging chain by its joints, and a plank at rest by its contact points."""
    joints = (2, 8, 30) if quick else JOINTS
    contacts = (0, 4, 16) if quick else CONTACTS
    engines = simulators(peers)
    names = list(engines)
    result: dict[str, Any] = {
        "engines": {name: engine.label for name, engine in engines.items()},
        "joints": [_measure(chain(n), n, engines, quick=quick, peers=peers) for n in joints],
        "contacts": [_measure(plank(n), n, engines, quick=quick, peers=()) for n in contacts],
    }
    for name in ("joints", "contacts"):
        rows = result[name]
        sides = ["heelstrike", *names, *(f"{part}_part" for part in PARTS_OF_STEPS)]
        result[f"{name}_slope"] = {
            side: slope for side in sides if (slope := _slope(rows, f"{side}_us")) is not None
        }
        result[f"{name}_crossover"] = {side: _crossover(rows, side) for side in names}
    return result


def _measure(
    xml: str, size: int, engines: dict[str, Engine], *, quick: bool, peers: Sequence[str]
) -> dict[str, Any]:
    robot = read_mjcf(xml, name="test body")
    q = robot.model.reference.copy()
    if not robot.floating:
        q += 0.3
    state = State(q, np.zeros(robot.nv))
    scenario = Scenario(robot.name, robot, state, STEPS * STEP, None, contacts=robot.nc or None)
    method, ground = TimeStepping(step=STEP), Ground(friction=FRICTION)

    def run(steps: int = STEPS, record_every: int = NEVER) -> Run:
        done = whole(
            simulate(
                robot,
                state=state,
                duration=steps * STEP,
                method=method,
                ground=ground,
                record_every=record_every,
                stop_when_fallen=False,
            )
        )
        if not done.completed:
            raise InvalidRunError(f"{robot.name} of {size}: {done.message}")
        return done

    _check_contacts(run(record_every=1))
    row: dict[str, Any] = {"size": size}
    # All steps are alike: any part of a run is as good as the whole.
    ours = steps_in_slot(run().timing.wall_s / STEPS, most=STEPS)
    works: dict[str, Work] = {"heelstrike": lambda: run(ours).timing.wall_s}
    steps = {"heelstrike": ours}
    for name, engine in engines.items():
        try:
            peer = engine.peer(scenario, STEP)
            if robot.nc:
                peer.settle(peer.settling)
                peer.check()
            first = peer.run()
        except Exception as error:  # of one engine must not lose what the others found
            row[f"{name}_invalid"] = reason(error)
            continue
        steps[name] = steps_in_slot(first / peer.steps, most=peer.steps)
        works[name] = partial(peer.run, steps[name])
    for name in peers:
        if name in PARTS_OF_STEPS:
            from heelstrike.experiments.benchmark.pinocchio_peer import ForwardDynamics

            try:
                part = ForwardDynamics(scenario)
                part.check()
            except Exception as error:
                row[f"{name}_part_invalid"] = reason(error)
                continue
            works[f"{name}_part"], steps[f"{name}_part"] = part.run, 1
    best = best_of(works, seconds=0.1 if quick else 1.5, least=3, in_a_row=2)
    return row | {f"{name}_us": 1e6 * t / steps[name] for name, t in best.items()}


def _check_contacts(run: Run) -> None:
    """Check that all points carry in every step, and together the whole weight."""
    robot = run.robot
    if robot.nc == 0:
        return
    carried = run.contact_force[..., 0].sum(axis=1)
    if not np.allclose(carried, robot.weight, rtol=1e-9) or np.any(run.gap > 1e-9):
        raise InvalidRunError(f"the ground carries {carried.min():.3g} to {carried.max():.3g} N")
    if run.certificates.complementarity > 1e-9 or run.solver.failures:
        raise InvalidRunError(f"contact problems are solved to {run.certificates} only")


def _slope(rows: Sequence[dict[str, Any]], name: str) -> float | None:
    """Exponent of size to which the cost grows, over the upper half of the sizes."""
    upper = [row for row in rows if row["size"] > 0][-max(2, len(rows) // 2) :]
    if any(name not in row for row in upper):
        return None
    size = np.log([row["size"] for row in upper])
    cost = np.log([row[name] for row in upper])
    return float(np.polyfit(size, cost, 1)[0])


def _crossover(rows: Sequence[dict[str, Any]], side: str) -> int | None:
    """Smallest size from which on a peer is faster; None if there is none."""
    key = f"{side}_us"
    smallest = None
    for row in reversed(rows):
        if key in row:
            if row["heelstrike_us"] <= row[key]:
                break
            smallest = row["size"]
    return smallest
