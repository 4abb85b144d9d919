"""Motions of several phases: how long their design takes, and what they do event-driven.

Run, from the top folder::

    python benchmarks/motions.py            # all
    python benchmarks/motions.py toe run    # some of them

For each motion it prints the processor time of its design, its cost, the largest difference between
the motion and its simulation over one cycle (coordinates, at rows apart from touchdowns), and how
many of 20 cycles it goes under ``MotionTracking`` before it falls.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

import heelstrike as hs
from heelstrike import ContactPhase as Phase

CYCLES = 20
TOE = {"distance": 0.30, "duration": 0.70}
MOTIONS: dict[str, tuple[str, Callable[[], list[Phase]], dict]] = {
    "flat": ("bravo7", lambda: [Phase("right_foot", duration=0.7)], {"distance": 0.30}),
    "toe": (
        "bravo7",
        lambda: [
            Phase("right_foot", duration=(0.3, 0.6)),
            Phase("right_foot_toe", duration=(0.05, 0.3), pieces=3),
        ],
        TOE,
    ),
    "heel, flat, toe": (
        "bravo7",
        lambda: [
            Phase("right_foot_heel", duration=(0.03, 0.2), pieces=2),
            Phase("right_foot", duration=(0.2, 0.6), pieces=4),
            Phase("right_foot_toe", duration=(0.05, 0.3), pieces=3),
        ],
        {**TOE, "clearance": 0.02},
    ),
    "double support": (
        "bravo7",
        lambda: [
            Phase("left_foot_toe", "right_foot", duration=(0.08, 0.3), pieces=3),
            Phase("right_foot", duration=(0.2, 0.6)),
            Phase("right_foot_toe", duration=(0.05, 0.3), pieces=3),
        ],
        {"distance": 0.30, "duration": 0.80},
    ),
    "run": (
        "rabbit",
        lambda: [
            Phase("right_tibia", duration=(0.05, 0.3), pieces=4),
            Phase(duration=(0.05, 0.3), pieces=3),
        ],
        {"speed": 2.0},
    ),
    "run on flat feet": (
        "bravo7",
        lambda: [
            Phase("right_foot", duration=(0.05, 0.3), pieces=4),
            Phase(duration=(0.08, 0.3), pieces=3),
        ],
        {"speed": 2.0},
    ),
    "limp": (
        "rabbit",
        lambda: [
            Phase("right_tibia", duration=(0.55, 0.8)),
            Phase("left_tibia", duration=(0.2, 0.5)),
        ],
        {"distance": 0.5, "duration": 1.0, "repeat": "same"},
    ),
}


def tried(name: str) -> str:
    """Design a motion and walk it; return its row of the table."""
    kind, phases, asked = MOTIONS[name]
    robot = hs.load_robot(kind)
    begin = time.process_time()
    motion = hs.optimize_motion(robot, phases(), **asked)
    spent = time.process_time() - begin
    law = hs.MotionTracking(robot, motion)
    ground = hs.Ground(friction=motion.friction)

    def run(cycles: int, method: hs.EventDriven) -> hs.Run:
        duration = cycles * motion.duration
        start = motion.initial_state
        return hs.simulate(robot, law, state=start, duration=duration, method=method, ground=ground)

    once = run(1, hs.EventDriven(rtol=1e-10, atol=1e-12))
    apart = np.abs(once.time - motion.duration) > 1e-4
    for end in motion.ends:
        apart &= np.abs(once.time - end) > 1e-4
    error = float(np.abs(once.position - motion.position(once.time))[apart].max())
    many = run(CYCLES, hs.EventDriven())
    gone = many.time[-1] / motion.duration
    return f"| {name} | {kind} | {spent:.1f} | {motion.cost:.4g} | {error:.1e} | {gone:.1f} |"


def main() -> None:
    """Print the table."""
    wanted = sys.argv[1:] or list(MOTIONS)
    print("| motion | robot | design (s) | cost (N²m²s) | error in one cycle | cycles of 20 |")
    print("|---|---|---|---|---|---|")
    for name in wanted:
        print(tried(name), flush=True)


if __name__ == "__main__":
    main()
