"""What it takes to begin: setting up a run, calls from Python, first simulations, a whole walk.

    python benchmarks/beginning.py [--processes 5] [--cold] [--walk]

Microseconds are the least of many calls. Seconds are processor time of fresh processes and their
children, beside wall time: the least of `--processes`, in turn with one that only imports Numba,
which is the yardstick of a machine with other work. Nothing is compiled in them but with `--cold`:
then the cache is an empty folder, and the second loop is that of a ground with a profile. `--walk`
adds ``heelstrike walk`` with its film.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import heelstrike as hs

STEP = 1e-3

IMPORT = "import numba"
FIRST = """
import heelstrike as hs
robot = hs.load_robot("bravo7")
gait = hs.load_gait(GAIT, robot)
run = hs.simulate(robot, hs.ComputedTorque(robot, gait), state=gait.initial_state, duration=0.001)
assert run.completed
"""
SECOND = FIRST.replace(
    "duration=0.001", "duration=0.001, ground=hs.Ground(profile=[[-9, 0], [0, 0], [9, 0]])"
)


def calls(robot: hs.Robot, gait: hs.Gait) -> dict[str, float]:
    """Microseconds of calls from Python, bravo7 walking under computed torque."""
    law = hs.ComputedTorque(robot, gait)
    setup: dict[str, Any] = {"state": gait.initial_state, "method": hs.TimeStepping(step=STEP)}
    going = hs.Simulation(robot, law, **setup)
    for _ in range(10):
        going.step()
    kept = going.snapshot()

    def ahead(steps: int) -> Callable[[], object]:
        return lambda: going.advance(going.time + steps * STEP)

    few, many = (_least(ahead(n), 150) for n in (8, 72))
    a_step = (many - few) / 64
    one = _least(lambda: hs.simulate(robot, law, duration=STEP, **setup), 400)
    return {
        "simulate() of a step, without it": one - a_step,
        "Simulation(...)": _least(lambda: hs.Simulation(robot, law, **setup), 400),
        "step()": _least(going.step, 4000),
        "contacts": _least(lambda: going.contacts, 4000),
        "snapshot()": _least(going.snapshot, 1000),
        "restore(...)": _least(lambda: going.restore(kept), 1000),
        "advance() of 8 ms beyond its steps": few - 8 * a_step,
        "a step": a_step,
    }


def _least(call: Callable[[], object], times: int) -> float:
    best = float("inf")
    for _ in range(times):
        begin = perf_counter()
        call()
        best = min(best, perf_counter() - begin)
    return 1e6 * best


def process(command: list[str], **variables: str) -> tuple[float, float]:
    """Processor time of a process and its children, and wall time, in s."""
    # Python keeps the bytecode of what it imports, as pip does of what it installs.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    subprocess.run(command, env=environment | variables, check=True, stdout=subprocess.DEVNULL)
    after, end = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, end - begin


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--processes", type=int, default=5)
    parser.add_argument("--cold", action="store_true", help="compile everything, too")
    parser.add_argument("--walk", action="store_true", help="heelstrike walk, with its film")
    options = parser.parse_args()
    robot = hs.load_robot("bravo7")
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    for name, microseconds in calls(robot, gait).items():
        print(f"{name:42s} {microseconds:9.2f} us")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "gait.json"
        gait.save(file)
        first, second = (code.replace("GAIT", json.dumps(str(file))) for code in (FIRST, SECOND))
        works = {
            "import numba": [sys.executable, "-c", IMPORT],
            "import heelstrike, first simulation": [sys.executable, "-c", first],
        }
        if options.walk:
            walk = "from heelstrike.cli import run; run()"
            out = ["walk", "--out", str(Path(folder) / "walk")]
            works["heelstrike walk"] = [sys.executable, "-c", walk, *out]
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in works}
        for _ in range(options.processes):
            for name, command in works.items():
                times[name].append(process(command))
        if options.cold:
            cache = {"NUMBA_CACHE_DIR": folder, "XDG_CACHE_HOME": folder}
            for name, code in (("the same, cold", first), ("a second loop, cold", second)):
                times[name] = [process([sys.executable, "-c", code], **cache)]
    for name, found in times.items():
        used, wall = (min(each) for each in zip(*found, strict=True))
        print(f"{name:42s} {used:9.2f} s of processor time, {wall:.2f} s")


if __name__ == "__main__":
    main()
