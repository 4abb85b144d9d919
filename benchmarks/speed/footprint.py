"""What it takes to begin: import, compiling, memory; each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

IMPORT = """
import json, time
begin = time.perf_counter()
import heelstrike
print(json.dumps({"seconds": time.perf_counter() - begin}))
"""

FIRST_STEP = """
import json, time
begin = time.perf_counter()
import heelstrike as hs
robot = hs.load_robot("bravo7")
gait = hs.load_gait(GAIT, robot)
run = hs.simulate(robot, hs.ComputedTorque(robot, gait), state=gait.initial_state, duration=0.001)
assert run.completed
print(json.dumps({"seconds": time.perf_counter() - begin}))
"""

MEMORY = """
import json
from pathlib import Path
import heelstrike as hs
robot = hs.load_robot("bravo7")
gait = hs.load_gait(GAIT, robot)
control = hs.ComputedTorque(robot, gait)
def peak():
    status = Path("/proc/self/status")  # what the process inherited from its parent is not in it
    if not status.is_file():
        return None
    return int(status.read_text().split("VmHWM:")[1].split()[0]) / 1024
def walk(duration, every):
    return hs.simulate(robot, control, state=gait.initial_state, duration=duration,
                       record_every=every)
walk(SHORT, 1000)
before = peak()
run = walk(LONG, 1000 * round(LONG / SHORT))
print(json.dumps({"before_MiB": before, "after_MiB": peak(), "status": run.status.value,
                  "steps": run.steps, "rows": len(run.time)}))
"""

ALLOCATIONS = """
import json
import heelstrike as hs
from numba.core.runtime import rtsys
robot = hs.load_robot("bravo7")
gait = hs.load_gait(GAIT, robot)
control = hs.ComputedTorque(robot, gait)
def walk(method, duration):
    return hs.simulate(robot, control, state=gait.initial_state, duration=duration, method=method,
                       record_every=2**62)
def allocated(method, duration):
    before = rtsys.get_allocation_stats().alloc
    run = walk(method, duration)
    return rtsys.get_allocation_stats().alloc - before, run.steps
result = {}
for method in (hs.TimeStepping(), hs.EventDriven(output_period=None)):
    walk(method, 0.3)  # Numba counts from the first kernel on
    (less, few), (more, many) = allocated(method, 0.3), allocated(method, 1.2)
    result[type(method).__name__] = (more - less) / (many - few)
print(json.dumps(result))
"""


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:  # noqa: ARG001
    """Seconds to import and to the first step, with and without compiled code; memory in MiB."""
    from speed.scenarios import walk_gait

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "gait.json"
        walk_gait()[1].save(file)
        names = {"GAIT": repr(str(file))}
        result: dict[str, Any] = {
            "import_s": _best(IMPORT, {}, 1 if quick else 7)["seconds"],
            "warm_first_step_s": _best(FIRST_STEP, names, 1 if quick else 5)["seconds"],
        }
        short, long = (7.0, 35.0) if quick else (60.0, 600.0)
        memory = _run(MEMORY, names | {"SHORT": repr(short), "LONG": repr(long)})
        memory |= {"short_s": short, "long_s": long}
        result["memory"] = memory
        result["allocations_a_step"] = _run(ALLOCATIONS, names, NUMBA_NRT_STATS="1")
        if not quick:
            cache = str(Path(folder) / "cache")
            cold = _run(FIRST_STEP, names, NUMBA_CACHE_DIR=cache)
            result["cold_first_step_s"] = cold["seconds"]
    return result


def _best(code: str, names: dict[str, str], times: int) -> dict[str, Any]:
    return min((_run(code, names) for _ in range(times)), key=lambda result: result["seconds"])


def _run(code: str, names: dict[str, str], **variables: str) -> dict[str, Any]:
    for name, value in names.items():
        code = code.replace(name, value)
    # Python keeps the bytecode of what it imports, as pip does of what it installs.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(f"a measurement failed:\n{done.stderr}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result
