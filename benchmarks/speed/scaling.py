"""What a step costs with more joints, and with more contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from heelstrike.experiments.engines import Engine, InvalidRunError, Scenario, simulators
from heelstrike.robot import State, read_mjcf
from speed.race import STEP, race
from speed.scenarios import chain, plank

STEPS = 500
JOINTS = (2, 3, 5, 8, 12, 20, 30, 45, 60)
CONTACTS = (0, 2, 4, 8, 16, 32, 64)


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Time a swinging chain by its joints, and a plank at rest by its contact points."""
    joints = (2, 8, 30) if quick else JOINTS
    contacts = (0, 4, 16) if quick else CONTACTS
    engines = simulators(peers)
    part, seconds = "pinocchio" in peers, 0.1 if quick else 1.5
    result: dict[str, Any] = {
        "engines": {name: engine.label for name, engine in engines.items()},
        "joints": [_row(chain(n), n, engines, part=part, seconds=seconds) for n in joints],
        "contacts": [_row(plank(n), n, engines, part=False, seconds=seconds) for n in contacts],
    }
    for name in ("joints", "contacts"):
        rows = result[name]
        sides = ["heelstrike", *engines, "pinocchio_part"]
        result[f"{name}_slope"] = {
            side: slope for side in sides if (slope := _slope(rows, f"{side}_us")) is not None
        }
        result[f"{name}_crossover"] = {side: crossover(rows, side) for side in engines}
    return result


def _row(
    xml: str, size: int, engines: dict[str, Engine], *, part: bool, seconds: float
) -> dict[str, Any]:
    robot = read_mjcf(xml, name="test body")
    q = robot.model.reference.copy()
    if not robot.floating:
        q += 0.3
    state = State(q, np.zeros(robot.nv))
    scenario = Scenario(robot.name, robot, state, STEPS * STEP, contacts=robot.nc or None)
    row = race(
        scenario, engines, part=part, seconds=seconds, least=3, same_motion=False, alike=True
    )
    if "invalid" in row:
        raise InvalidRunError(f"{robot.name} of {size}: {row['invalid']}")
    return {"size": size, **row}


def _slope(rows: Sequence[dict[str, Any]], name: str) -> float | None:
    """Exponent of size to which the cost grows, over the upper half of the sizes."""
    upper = [row for row in rows if row["size"] > 0][-max(2, len(rows) // 2) :]
    if any(name not in row for row in upper):
        return None
    size = np.log([row["size"] for row in upper])
    cost = np.log([row[name] for row in upper])
    return float(np.polyfit(size, cost, 1)[0])


def crossover(rows: Sequence[dict[str, Any]], side: str) -> int | None:
    """Smallest size from which on a peer is faster; None if there is none."""
    key = f"{side}_us"
    smallest = None
    for row in reversed(rows):
        if key in row:
            if row["heelstrike_us"] <= row[key]:
                break
            smallest = row["size"]
    return smallest
