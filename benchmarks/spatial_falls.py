"""Robots in space that fall limp: what share of their contact problems is solved, and how fast.

Every fall begins from the posture of the file with joints moved by up to 0.3 rad, every second one
turned at random, 2 cm above the ground, with a drawn velocity and friction. Seconds are those of
the processor, of one step called from Python.

Run: python benchmarks/spatial_falls.py humanoid.xml [--falls 20] [--seconds 1.5] [--step 1e-3]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

import heelstrike as hs


def begin(robot: hs.SpatialRobot, seed: int) -> tuple[hs.State, hs.SpatialGround]:
    """Draw where a fall begins, and the ground."""
    rng = np.random.default_rng(seed)
    q = robot.reference_state().q.copy()
    if seed % 2:
        turn = rng.normal(size=4)
        q[3:7] = turn / np.linalg.norm(turn)
    q[7:] += rng.uniform(-0.3, 0.3, len(q) - 7)
    at = hs.Simulation(robot, state=hs.State(q, np.zeros(robot.nv)), stop_when_fallen=False)
    q[2] += 0.02 - float(np.min(at.contacts.gap))
    state = hs.State(q, 0.5 * rng.normal(size=robot.nv))
    return state, hs.SpatialGround(friction=float(rng.uniform(0.2, 1.2)))


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--falls", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=1.5)
    parser.add_argument("--step", type=float, default=1e-3)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    robot = hs.load_robot(options.file, dimension=3)
    print(robot)
    method = hs.TimeStepping(step=options.step)
    counts: Counter[str] = Counter()
    seconds: list[float] = []
    deepest = 0.0
    for seed in range(options.falls):
        state, ground = begin(robot, seed)
        simulation = hs.Simulation(
            robot, state=state, ground=ground, method=method, stop_when_fallen=False
        )
        for _ in range(round(options.seconds / options.step)):
            start = time.process_time()
            status = simulation.step()
            seconds.append(time.process_time() - start)
            if status is not hs.RunStatus.COMPLETED:
                print(f"fall {seed}: {simulation.message}")
                break
        run = simulation.record
        counts.update(
            steps=run.steps, uncertified=run.certificates.uncertified,
            halved=run.certificates.halved, relaxed=run.certificates.relaxed,
            problems=run.solver.solves, unsolved=run.solver.failures,
            fallbacks=run.solver.fallbacks,
        )  # fmt: skip
        deepest = max(deepest, run.certificates.penetration)
    certified = 1.0 - counts["uncertified"] / counts["steps"]
    solved = 1.0 - counts["unsolved"] / max(counts["problems"], 1)
    print(f"{100 * certified:.4f} % of steps certified, {100 * solved:.3f} % of problems; {counts}")
    spent = 1e6 * np.array(seconds)
    median, most, worst = np.quantile(spent, [0.5, 0.99, 1.0])
    print(f"a step: median {median:.1f} us, 99 % {most:.1f} us, mean {spent.mean():.1f} us, worst "
          f"{worst:.0f} us; deepest {deepest:.1e} m")  # fmt: skip


if __name__ == "__main__":
    main()
