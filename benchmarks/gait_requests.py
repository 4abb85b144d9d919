"""Random requests for gaits of seven robots: how many are found by the first call.

    python benchmarks/gait_requests.py RESULTS.jsonl            # requests 0 to 199
    python benchmarks/gait_requests.py RESULTS.jsonl 0:40       # some of them
    python benchmarks/gait_requests.py RESULTS.jsonl --judge    # is what was not found feasible?

Request k is drawn from seed k: one of the robots, step length and duration each 0.75 to 1.2 of the
usual step's, friction 0.35 to 0.9. Results are added to the file line by line, and what is in it
already is not done again; at the end the table of all that is there is printed. Times are of the
processor: other work on the machine changes them little.

`--judge` takes the requests for which no gait was found and looks for one by other ways: 20 calls
that start from gaits of the same robot with other steps, and the direct collocation of all
coordinates (`hs.optimize_motion`), whose program and polynomials are others. That one knows no
margins of the sole but the force at its ends. A request counts as feasible if any of them succeeds.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gaits import ROBOTS
from rich.console import Console
from table import Table

import heelstrike as hs
from heelstrike.experiments.walk import typical_step

STEP = (0.75, 1.2)
"""Least and greatest share of the usual step length and duration."""
FRICTION = (0.35, 0.9)
REQUESTS = 200
OTHERS = 20
"""Gaits from which a request that was not found is started once more."""
FAR = 1000
"""Seeds of these begin so far away."""


@dataclass(frozen=True)
class Asked:
    """A request."""

    robot: str
    length: float
    duration: float
    clearance: float
    friction: float

    def arguments(self) -> dict[str, float]:
        """Return what `hs.optimize_gait` is asked."""
        return {
            "step_length": self.length,
            "step_duration": self.duration,
            "clearance": self.clearance,
            "friction": self.friction,
        }


def drawn(seed: int, robot: str | None = None) -> Asked:
    """Return the request of a seed, of one of the robots or of a given one."""
    random = np.random.default_rng(seed)
    chosen = ROBOTS[random.integers(len(ROBOTS))] if robot is None else robot
    usual = typical_step(hs.load_robot(chosen))
    length, duration = random.uniform(*STEP, size=2)
    return Asked(
        robot=chosen,
        length=usual.length * length,
        duration=usual.duration * duration,
        clearance=usual.clearance,
        friction=float(random.uniform(*FRICTION)),
    )


def answered(asked: Asked) -> dict[str, Any]:
    """Ask for a gait once; return what came of it."""
    robot = hs.load_robot(asked.robot)
    begin = time.process_time()
    try:
        gait = hs.optimize_gait(robot, **asked.arguments())
        answer = {"found": True, "optimal": gait.optimal, "cost": gait.cost}
    except hs.GaitError as error:
        answer = {"found": False, "error": type(error).__name__, "message": str(error)}
    return {**asked.__dict__, **answer, "seconds": time.process_time() - begin}


def others(asked: Asked) -> Iterator[hs.Gait]:
    """Gaits of the same robot with other steps."""
    robot = hs.load_robot(asked.robot)
    for seed in range(FAR, FAR + OTHERS):
        try:
            yield hs.optimize_gait(robot, **drawn(seed, asked.robot).arguments(), starts=1)
        except hs.GaitError:
            continue


def judged(asked: Asked) -> str | None:
    """Return how a request was met after all, or None."""
    robot = hs.load_robot(asked.robot)
    os.environ["HEELSTRIKE_KEEP_GAITS"] = "1"  # of the others, which serve many requests
    for k, other in enumerate(others(asked)):
        try:
            hs.optimize_gait(robot, **asked.arguments(), warm_start=other)
        except hs.GaitError:
            continue
        return f"start {k + 1}"
    phase = hs.ContactPhase(robot.feet[0].name, duration=asked.duration)
    try:
        hs.optimize_motion(
            robot, [phase], distance=asked.length, friction=asked.friction,
            clearance=asked.clearance, force_margin=0.1 * robot.weight,
        )  # fmt: skip
    except hs.GaitError:
        return None
    return "direct collocation"


def read(path: Path) -> dict[int, dict[str, Any]]:
    """Return what is in a file of results, by seed; the last line of a seed counts."""
    if not path.exists():
        return {}
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {line["seed"]: line for line in lines}


def table(results: dict[int, dict[str, Any]]) -> Table:
    """Count what was found, by robot."""
    body = []
    for name in (*ROBOTS, "all"):
        own = [each for each in results.values() if name in (each["robot"], "all")]
        missed = [each for each in own if not each["found"]]
        feasible = [each for each in missed if each.get("judged")]
        open_ = [each for each in missed if "judged" not in each]
        seconds = np.median([each["seconds"] for each in own]) if own else np.nan
        worst = max((each["seconds"] for each in own), default=np.nan)
        found = [each for each in own if each["found"]]
        body.append([
            name, str(len(own)), str(len(found)), str(sum(not each["optimal"] for each in found)),
            str(len(missed)), str(len(feasible)), str(len(open_)), f"{seconds:.1f}", f"{worst:.1f}",
        ])  # fmt: skip
    head = ["robot", "requests", "found", "not optimal", "not found", "feasible", "not judged"]
    return Table("", [*head, "median (s)", "most (s)"], body)


def main() -> None:
    """Ask, or judge, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("seeds", nargs="?", default=f"0:{REQUESTS}")
    parser.add_argument("--judge", action="store_true", help="look for what was not found")
    given = parser.parse_args()
    first, end = (int(each) for each in given.seeds.split(":"))
    results = read(given.results)
    with given.results.open("a", encoding="utf-8") as file:
        for seed in range(first, end):
            before = results.get(seed)
            if given.judge:
                if before is None or before["found"] or "judged" in before:
                    continue
                result = {**before, "judged": judged(drawn(seed))}
            elif before is None:
                os.environ["HEELSTRIKE_KEEP_GAITS"] = "0"  # what is timed is the design
                result = {"seed": seed, **answered(drawn(seed))}
            else:
                continue
            results[seed] = result
            file.write(json.dumps(result) + "\n")
            file.flush()
    Console(width=160).print(table(results))


if __name__ == "__main__":
    main()
