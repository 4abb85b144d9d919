"""How long gaits take to find: usual steps from scratch, and neighbours of known gaits.

    python benchmarks/gait_times.py usual          # every robot, median of 5
    python benchmarks/gait_times.py neighbours     # 100 neighbours: 5 % other speed, slope 1°

Times are of the processor: other work on the machine changes them little. What is compiled, loaded
or read once is done before. A neighbour has, of a robot drawn in turn, a step drawn from 0.85 to
1.05 of the usual one's length and duration (seed 0), as the known gait; then 5 % more or less speed
at the same duration, and 1° up or down.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from itertools import cycle
from typing import Any

import numpy as np
from gaits import ROBOTS
from rich.console import Console
from table import Table

import heelstrike as hs
from heelstrike.experiments.walk import design, typical_step

os.environ["HEELSTRIKE_KEEP_GAITS"] = "0"  # what is timed is the design

TIMES, NEIGHBOURS = 5, 100
SHARE = (0.85, 1.05)
FASTER, STEEPER = 0.05, np.deg2rad(1.0)


def spent(function: Callable[..., Any], *args: Any, **asked: Any) -> tuple[Any, float]:
    """Return what a function returns, and the processor time it took (s)."""
    begin = time.process_time()
    found = function(*args, **asked)
    return found, time.process_time() - begin


def usual() -> Table:
    """Usual steps of every robot."""
    hs.optimize_gait(hs.load_robot("bravo7"), step_length=0.3, step_duration=0.7, starts=1)
    body = []
    for name in ROBOTS:
        robot = hs.load_robot(name)
        found = [spent(design, robot, friction=0.75) for _ in range(TIMES)]
        seconds = [each for _, each in found]
        gait = found[0][0]
        cells = [name, f"{gait.cost:.4g}", str(gait.optimal), f"{np.median(seconds):.2f}"]
        body.append([*cells, f"{max(seconds):.2f}"])
    return Table(
        "usual steps", ["robot", "cost (N²m²s)", "optimal", "median (s)", "most (s)"], body
    )


def neighbours() -> Table:
    """Neighbours of known gaits."""
    random = np.random.default_rng(0)
    seconds: dict[str, list[float]] = {name: [] for name in ROBOTS}
    missed = dict.fromkeys(ROBOTS, 0)
    known = gaits(random)
    for _ in range(NEIGHBOURS):
        name, gait = next(known)
        robot, signs = hs.load_robot(name), random.choice([-1.0, 1.0], size=2)
        speed = gait.step_length / gait.step_duration * (1.0 + FASTER * signs[0])
        begin = time.process_time()
        try:
            hs.optimize_gait(
                robot, speed=speed, step_duration=gait.step_duration, clearance=gait.clearance,
                slope=STEEPER * signs[1], warm_start=gait,
            )  # fmt: skip
        except hs.GaitError:
            missed[name] += 1
        seconds[name].append(time.process_time() - begin)
    rows = [*seconds.items(), ("all", [each for own in seconds.values() for each in own])]
    body = [
        [name, str(len(each)), str(missed.get(name, sum(missed.values()))),
         f"{np.median(each):.2f}", f"{max(each):.2f}"]
        for name, each in rows
    ]  # fmt: skip
    return Table("neighbours", ["robot", "asked", "not found", "median (s)", "most (s)"], body)


def gaits(random: np.random.Generator) -> Iterator[tuple[str, hs.Gait]]:
    """Known gaits of the robots in turn, four neighbours of each before the next is drawn."""
    for name in cycle(ROBOTS):
        robot = hs.load_robot(name)
        step = typical_step(robot)
        length, duration = random.uniform(*SHARE, size=2)
        try:
            gait = hs.optimize_gait(
                robot, step_length=length * step.length, step_duration=duration * step.duration,
                clearance=step.clearance,
            )  # fmt: skip
        except hs.GaitError:
            continue
        for _ in range(4):
            yield name, gait


if __name__ == "__main__":
    tables = {each.__name__: each for each in (usual, neighbours)}
    if len(sys.argv) != 2 or sys.argv[1] not in tables:
        sys.exit(__doc__)
    Console(width=120).print(tables[sys.argv[1]]())
