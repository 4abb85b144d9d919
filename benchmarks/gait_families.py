"""Families of gaits over speed and slope: their time, and what gaits between them are worth.

Run, from the top folder::

    python benchmarks/gait_families.py            # both robots
    python benchmarks/gait_families.py bravo7     # one of them

A family has 10 speeds and 10 slopes, -8° to 8°. In the middle of each of the 81 cells `family.at`
is asked for a gait, which is held against the optimum (the better one of those that are found from
it and from scratch), and walked event-driven under computed torque on its slope: 20 steps on flat
feet, one on points, on which computed torque cannot go on.
Times are of the clock and of the processor; the load is that of the machine before and after.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from itertools import product

import numpy as np
from machine import load
from rich.console import Console
from table import Table

import heelstrike as hs

os.environ["HEELSTRIKE_KEEP_GAITS"] = "0"  # what is timed is the design

SLOPES = np.deg2rad(np.linspace(-8.0, 8.0, 10)).tolist()
ROBOTS = {
    "bravo7": {"step_duration": 0.70, "friction": 0.75},
    "rabbit": {"step_duration": 0.60, "friction": 0.60},
}
SPEEDS = np.linspace(0.3, 0.6, 10).tolist()
STEPS = 20


@dataclass(frozen=True)
class Between:
    """A gait between those of a family."""

    more: float
    """By how much it costs more than the optimum, as a share."""
    seconds: float
    """How long it took to find, of the processor."""
    optimal: bool
    """Whether it is itself an optimum."""
    steps: int
    """How many steps it was walked."""
    asked: int
    """How many it was to be walked."""


def middles(axis: np.ndarray) -> list[float]:
    """Return the middles between the values of an axis."""
    return (0.5 * (axis[1:] + axis[:-1])).tolist()


def tried(family: hs.GaitFamily, speed: float, slope: float) -> Between | None:
    """Interpolate a gait, find the optimum, and walk it; None where there is a gap."""
    begun = time.process_time()
    try:
        gait = family.at(speed=speed, slope=slope)
    except hs.GaitError:
        return None
    seconds = time.process_time() - begun
    optima = []
    for start in (gait, None):
        with suppress(hs.GaitError):
            optima.append(
                hs.optimize_gait(
                    family.robot, **family.asked, speed=speed, slope=slope, warm_start=start
                ).spent
            )
    if not optima:
        return None
    robot = family.robot
    steps = 1 if gait.point_feet else STEPS
    run = hs.simulate(
        robot, hs.ComputedTorque(robot, gait), state=gait.initial_state,
        duration=(steps + 0.1) * gait.step_duration, method=hs.EventDriven(),
        ground=hs.Ground(friction=0.75, slope=slope),
    )  # fmt: skip
    more = gait.spent / min(optima) - 1.0
    return Between(more, seconds, gait.optimal, run.summary(gait=gait).steps, steps)


def row(name: str) -> list[str]:
    """Design the family of a robot and return its row of the table."""
    begun = load()
    clock, spent = time.perf_counter(), time.process_time()
    family = hs.gait_family(hs.load_robot(name), **ROBOTS[name], speed=SPEEDS, slope=SLOPES)
    clock, spent = time.perf_counter() - clock, time.process_time() - spent
    optimal = sum(gait.optimal for gait in family.gaits.values())
    errors = [
        max(each.margins.touchdown_error, each.margins.impact_error)
        for each in family.gaits.values()
    ]
    cells = [
        tried(family, speed, slope)
        for speed, slope in product(*(middles(axis) for axis in family.axes.values()))
    ]
    found = [each for each in cells if each is not None]
    more, seconds = [each.more for each in found], [each.seconds for each in found]
    return [
        name, str(len(family.gaits)), str(len(family.gaps)), str(optimal), f"{max(errors):.0e}",
        f"{clock:.0f}", f"{spent:.0f}", f"{begun:.1f}, {load():.1f}", str(len(found)),
        f"{sum(each.optimal for each in found)}", f"{np.median(seconds):.2f}",
        f"{max(seconds):.2f}", f"{np.median(more):.0e}", f"{max(more):.0e}",
        f"{sum(each.steps == each.asked for each in found)}",
    ]  # fmt: skip


def main() -> None:
    """Print the table."""
    head = ["robot", "gaits", "gaps", "optimal", "closes to", "clock (s)", "processor (s)", "load"]
    head += [
        "between",
        "optimal",
        "processor (s): median",
        "most",
        "costs more (share): median",
        "most",
    ]
    head += ["walked"]
    Console(width=180).print(Table("", head, [row(name) for name in sys.argv[1:] or ROBOTS]))


if __name__ == "__main__":
    main()
