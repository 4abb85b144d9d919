"""The five-link walker of OptimTraj on finer and finer meshes: cost, change, time.

Run with ``python benchmarks/five_link.py``. The problem is that of M. Kelly, *An introduction to
trajectory optimization* (SIAM Review 59, 2017), section 6: a step of 0.5 m in 0.7 s at least
∫Σu² dt, no torque at the stance ankle, steps that mirror each other through a plastic impact.
Friction is not limited there, so the cone is opened until it does not matter.
"""

from __future__ import annotations

from time import perf_counter

import heelstrike as hs

MESHES = (6, 12, 24, 48)
STARTS = 3


def main() -> None:
    """Print a row a mesh."""
    robot = hs.load_robot("rabbit_optimtraj")
    print("intervals  cost (N²m²s)       change  found in (s)  peak torque (N m)  friction needed")
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
            intervals=intervals,
            starts=STARTS,
        )
        seconds = perf_counter() - begin
        change = "" if before is None else f"{abs(gait.cost - before) / gait.cost:.1e}"
        needed = gait.friction * gait.margins.friction_use
        print(
            f"{intervals:9d} {gait.cost:13.6f} {change:>12} {seconds:13.1f} "
            f"{gait.margins.peak_torque:18.2f} {needed:16.3f}"
        )
        before = gait.cost


if __name__ == "__main__":
    main()
