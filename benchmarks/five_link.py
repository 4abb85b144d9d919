"""The five-link walker of OptimTraj on finer and finer meshes: cost, change, time.

Run with ``python benchmarks/five_link.py``. The problem is that of M. Kelly, *An introduction to
trajectory optimization* (SIAM Review 59, 2017), section 6: a step of 0.5 m in 0.7 s at least
∫Σu² dt, no torque at the stance ankle, steps that mirror each other through a plastic impact, knees
that do not bend back. Friction is not limited there, so the cone is opened wide.
The second table lets the knees bend back.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

import heelstrike as hs

MESHES = (6, 12, 24, 48)
STARTS = 3
HUMAN_KNEES = {"right_knee": (0.0, 2.5)}  # rad; the left one follows


def main() -> None:
    """Print a table with the knees as published, and one without."""
    robot = hs.load_robot("rabbit_optimtraj")
    table(robot, "knees do not bend back", HUMAN_KNEES)
    print()
    table(robot, "knees bend both ways", None)


def table(robot: hs.Robot, title: str, joint_ranges: dict[str, tuple[float, float]] | None) -> None:
    """Print a row a mesh."""
    print(title)
    print("intervals  cost (N²m²s)       change  found in (s)  least knee (rad)  peak torque (N m)")
    before = None
    for intervals in MESHES:
        begin = perf_counter()
        gait = hs.optimize_gait(
            robot,
            step_length=0.5,
            step_duration=0.7,
            clearance=0.0,
            friction=5.0,
            force_margin=0.0,
            joint_ranges=joint_ranges,
            intervals=intervals,
            starts=STARTS,
        )
        seconds = perf_counter() - begin
        change = "" if before is None else f"{abs(gait.cost - before) / gait.cost:.1e}"
        knees = [k for k, name in enumerate(gait.joint_names) if "knee" in name]
        least = gait.in_step(np.linspace(0.0, gait.step_duration, 10_001))[:, knees].min()
        print(
            f"{intervals:9d} {gait.cost:13.6f} {change:>12} {seconds:13.1f} {least:17.6f} "
            f"{gait.margins.peak_torque:18.2f}"
        )
        before = gait.cost


if __name__ == "__main__":
    main()
