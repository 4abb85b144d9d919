"""Cost of the reference gaits and the time it takes to find them.

Run with ``python benchmarks/gait_cost.py``. The reference costs are local optima of the same
problem, found before with constraints held at 25 nodes only.
"""

from __future__ import annotations

from time import perf_counter

import heelstrike as hs

REFERENCE = {
    (0.30, 0.70): 90.3,
    (0.20, 0.80): 84.5,
    (0.40, 0.60): 305.0,
    (0.40, 0.50): 379.0,
    (0.50, 0.60): 901.0,
}


def main() -> None:
    """Print a row a gait."""
    robot = hs.load_robot("bravo7")
    print("step (m)  in (s)  cost (N²m²s)  reference  found in (s)")
    for (length, duration), reference in REFERENCE.items():
        begin = perf_counter()
        gait = hs.optimize_gait(robot, step_length=length, step_duration=duration, friction=0.75)
        seconds = perf_counter() - begin
        print(f"{length:8.2f} {duration:7.2f} {gait.cost:13.2f} {reference:10.1f} {seconds:13.2f}")


if __name__ == "__main__":
    main()
