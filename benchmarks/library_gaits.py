"""Every robot of the library that can walk: its gait, and how far each way through time takes it.

Run with ``python benchmarks/library_gaits.py [ROBOT ...]``. Steps, tracking error (rms of the
actuated joints over all steps), friction use and slip (in total, of the point that slid most) are
those of twenty steps, or of as many as the robot took before it fell. On point feet computed torque
cannot hold the gait, so the tracking error of the first step stands beside that of the walk.
"""

from __future__ import annotations

import sys
from time import perf_counter

import heelstrike as hs
from heelstrike.experiments.walk import design, walk, why_unstable

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


def main(names: tuple[str, ...]) -> None:
    """Print two rows a robot, one a method."""
    print(
        "robot             step (m)  in (s)   cost (N²m²s)  found in (s)  method         steps"
        "  tracking (rad)  first step (rad)  friction use  slip (m)"
    )
    ground = hs.Ground(friction=FRICTION)
    unstable = []
    for name in names:
        robot = hs.load_robot(name)
        begin = perf_counter()
        gait = design(robot, friction=FRICTION)
        seconds = perf_counter() - begin
        if reason := why_unstable(gait):
            unstable.append(reason)
        for label, method in METHODS.items():
            first = walk(robot, gait, steps=1, method=method, ground=ground).summary(gait=gait)
            run = walk(robot, gait, steps=STEPS, method=method, ground=ground)
            summary = run.summary(gait=gait)
            print(
                f"{name:17} {gait.step_length:8.2f} {gait.step_duration:7.2f} {gait.cost:14.2f} "
                f"{seconds:13.1f}  {label:14} {summary.steps:2d}/{STEPS}"
                f"{summary.tracking_rms_rad:16.1e}{first.tracking_rms_rad:18.1e}"
                f"{summary.friction_use_max:14.3f}{summary.slip_max_m:10.1e}"
            )
    for reason in unstable:
        print(reason)


if __name__ == "__main__":
    main(tuple(sys.argv[1:]) or ROBOTS)
