"""Gaits: what they cost, how long it takes to find them, and how far they are walked.

    python benchmarks/gaits.py costs       # reference gaits of bravo7
    python benchmarks/gaits.py meshes      # the five-link walker on finer and finer meshes
    python benchmarks/gaits.py library     # every robot of the library that can walk

`costs`: the reference costs are local optima of the same problem, found before with constraints
held at 25 nodes only.

`meshes`: the problem is that of M. Kelly, *An introduction to trajectory optimization* (SIAM Review
59, 2017), section 6: a step of 0.5 m in 0.7 s at least ∫Σu² dt, no torque at the stance ankle,
steps that mirror each other through a plastic impact, knees that do not bend back. Friction is not
limited there, so the cone is opened wide. The second table lets the knees bend back.

`library`: steps, tracking error (rms of the actuated joints over all steps), friction use and slip
(in total, of the point that slid most) are those of twenty steps, or of as many as the robot took
before it fell. On point feet computed torque cannot hold the gait, so the tracking error of the
first step stands beside that of the walk.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

import numpy as np
from rich.console import Console
from speed.stopwatch import timed
from table import Table

import heelstrike as hs
from heelstrike.experiments.walk import design, walk, why_unstable

os.environ["HEELSTRIKE_KEEP_GAITS"] = "0"  # what is timed is the design

REFERENCE = {
    (0.30, 0.70): 90.3,
    (0.20, 0.80): 84.5,
    (0.40, 0.60): 305.0,
    (0.40, 0.50): 379.0,
    (0.50, 0.60): 901.0,
}
MESHES = (6, 12, 24, 48)
HUMAN_KNEES = {"right_knee": (0.0, 2.5)}  # rad; the left one follows
ROBOTS = (
    "bravo7",
    "human7",
    "geyer7",
    "spring_flamingo",
    "walker2d",
    "rabbit",
    "rabbit_optimtraj",
)
METHODS = {"time stepping": hs.TimeStepping(step=1e-3), "event-driven": hs.EventDriven()}
STEPS = 20
FRICTION = 0.75


def costs() -> Iterator[Table]:
    """Reference gaits, and the time it takes to find them."""
    robot = hs.load_robot("bravo7")
    body = []
    for (length, duration), reference in REFERENCE.items():
        gait, seconds = timed(
            hs.optimize_gait, robot, step_length=length, step_duration=duration, friction=FRICTION
        )
        cells = (f"{length:.2f}", f"{duration:.2f}", f"{gait.cost:.2f}", f"{reference:.1f}")
        body.append([*cells, f"{seconds:.2f}"])
    head = ["step (m)", "in (s)", "cost (N²m²s)", "reference", "found in (s)"]
    yield Table("bravo7", head, body)


def meshes() -> Iterator[Table]:
    """Cost, change and time by the number of intervals."""
    robot = hs.load_robot("rabbit_optimtraj")
    knee_ranges = {"knees do not bend back": HUMAN_KNEES, "knees bend both ways": None}
    for title, joint_ranges in knee_ranges.items():
        body, before = [], None
        for intervals in MESHES:
            gait, seconds = timed(
                hs.optimize_gait,
                robot,
                step_length=0.5,
                step_duration=0.7,
                clearance=0.0,
                friction=5.0,
                force_margin=0.0,
                joint_ranges=joint_ranges,
                intervals=intervals,
                starts=3,
            )
            change = "" if before is None else f"{abs(gait.cost - before) / gait.cost:.1e}"
            knees = [k for k, name in enumerate(gait.joint_names) if "knee" in name]
            least = gait.in_step(np.linspace(0.0, gait.step_duration, 10_001))[:, knees].min()
            peak = gait.margins.peak_torque
            cells = (f"{gait.cost:.6f}", change, f"{seconds:.1f}", f"{least:.6f}", f"{peak:.2f}")
            body.append([str(intervals), *cells])
            before = gait.cost
        head = ["intervals", "cost (N²m²s)", "change", "found in (s)", "least knee (rad)"]
        yield Table(title, [*head, "peak torque (N m)"], body)


def library() -> Iterator[Table]:
    """Two rows a robot, one a method."""
    ground = hs.Ground(friction=FRICTION)
    body, unstable = [], []
    for name in ROBOTS:
        robot = hs.load_robot(name)
        gait, seconds = timed(design, robot, friction=FRICTION)
        if reason := why_unstable(gait):
            unstable.append([reason])
        found = (f"{gait.step_length:.2f}", f"{gait.step_duration:.2f}", f"{gait.cost:.2f}")
        for label, method in METHODS.items():
            first = walk(robot, gait, steps=1, method=method, ground=ground).summary(gait=gait)
            run = walk(robot, gait, steps=STEPS, method=method, ground=ground)
            summary = run.summary(gait=gait)
            tracking = (f"{each.tracking_rms_rad:.1e}" for each in (summary, first))
            slip = (f"{summary.friction_use_max:.3f}", f"{summary.slip_max_m:.1e}")
            steps = f"{summary.steps}/{STEPS}"
            body.append([name, *found, f"{seconds:.1f}", label, steps, *tracking, *slip])
    head = ["robot", "step (m)", "in (s)", "cost (N²m²s)", "found in (s)", "method", "steps"]
    head += ["tracking (rad)", "first step (rad)", "friction use", "slip (m)"]
    yield Table("", head, body)
    yield Table("", ["unstable"], unstable)


if __name__ == "__main__":
    tables = {each.__name__: each for each in (costs, meshes, library)}
    if len(sys.argv) != 2 or sys.argv[1] not in tables:
        sys.exit(__doc__)
    for table in tables[sys.argv[1]]():
        Console(width=160).print(table)
