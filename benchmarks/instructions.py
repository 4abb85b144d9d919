"""Instructions a step, counted by callgrind: the noise-free companion of the times.

The compiled loops run under valgrind, and what they execute is counted: the same number each time
for the same code, compiler and step, whatever else the machine does. Kernels are compiled for
Haswell, since valgrind knows no AVX-512. A step is a millisecond of simulated time, also where a
method chooses steps of its own.

What slips, or lies on joint stops, is held beside the same robot sticking; a law that is not of the
package beside the same law that is.

Counts are kept in benchmarks/instructions.json. A count that grew by more than 2 % fails the run;
whoever means it writes the new counts down with --update and commits them.

Needs valgrind and a C compiler. Run: python benchmarks/instructions.py [--update]
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from speed import page, users_law
from speed.scenarios import falling, plank, standing, walk_gait

import heelstrike as hs
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.experiments.engines import Scenario
from heelstrike.robot import read_mjcf
from heelstrike.sim import Scheme
from heelstrike.sim.frame import Outcome

KEPT = Path(__file__).with_name("instructions.json")
TOLERANCE = 0.02
STEP = 1e-3
TIME_STEPPING = hs.TimeStepping(step=STEP)

# What valgrind 3.19 can run.
TARGET = {
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": "+64bit,+avx,+avx2,+bmi,+bmi2,+cmov,+cx16,+cx8,+f16c,+fma,+fxsr,+lzcnt,"
    "+mmx,+movbe,+popcnt,+sse,+sse2,+sse3,+sse4.1,+sse4.2,+ssse3,+xsave",
    # Python and the C library spread their hash tables and addresses; the loops do not care.
    "PYTHONHASHSEED": "0",
}

SWITCH = """
#include <valgrind/callgrind.h>
void begin(void) { CALLGRIND_START_INSTRUMENTATION; CALLGRIND_ZERO_STATS; }
void end(const char *name) { CALLGRIND_DUMP_STATS_AT(name); CALLGRIND_STOP_INSTRUMENTATION; }
"""


@dataclass(frozen=True)
class Counted:
    """A scenario and what of it is counted.

    Attributes
    ----------
    scenario : Scenario
    first, count : int
        Steps to let pass, and steps to count.
    method : Method
        Simulation method.
    controller : controller, optional
        Instead of the scenario's own law.
    beside : str
        Scenario whose count this one's is held against: of the same robot that only sticks, or
        under the same law of the package.
    """

    scenario: Scenario
    first: int
    count: int
    method: Any = TIME_STEPPING
    controller: Any = None
    beside: str = ""


def scenarios(gait: hs.Gait | None = None) -> dict[str, Counted]:
    """What is counted, by name; designs the gait that is walked, unless it is given."""
    walker, eight = hs.load_robot("walker2d"), read_mjcf(plank(8))
    bent = standing("bravo7")
    robot = bent.robot
    gait = walk_gait()[1] if gait is None else gait
    walk = Scenario("bravo7 walking", robot, gait.initial_state, 1.0)
    law = hs.ComputedTorque(robot, gait)
    sliding = hs.State(bent.state.q, 0.5 * np.eye(robot.nv)[0])
    on_stops = {"beside": "standing, walker2d"}
    return {
        "standing, knees straight": Counted(standing("bravo7", bent=False), 100, 500),
        "standing, knees bent": Counted(bent, 100, 500),
        "standing, walker2d": Counted(standing("walker2d"), 100, 500),
        "standing, plank on 8 points": Counted(at_reference(eight), 100, 500),
        "walking, computed torque": Counted(walk, 0, 1000, controller=law),
        "walking, computed torque of a user": Counted(
            walk, 0, 1000, controller=users_law.ComputedTorque(robot, gait),
            beside="walking, computed torque",
        ),
        "walking, event driven": Counted(walk, 20, 200, hs.EventDriven(), law),
        "walking, compliant": Counted(walk, 20, 900, hs.Compliant(), law),
        "falling": Counted(falling("bravo7"), 0, 400),
        "at its stops, walker2d left alone": Counted(at_reference(walker), 0, 600, **on_stops),
        "at its stops, walker2d held": Counted(
            at_reference(walker, feedback=held(walker, 0.0)), 0, 600, **on_stops
        ),
        "against its stops, walker2d": Counted(
            at_reference(walker, feedback=held(walker, 0.02)), 0, 600, **on_stops
        ),
        "slipping, bravo7": Counted(
            replace(bent, state=sliding, friction=0.05), 50, 500, beside="standing, knees bent"
        ),
        # Impacts make a difference of 1e-12 that decides in which step a foot arrives one of 1e-3;
        # the scheme that lets feet arrive in two steps has no such edge, and counts repeat.
        "stamping, bravo7": Counted(
            replace(bent, feedback=stamping(bent), friction=0.1), 0, 600,
            method=hs.TimeStepping(step=STEP, scheme=Scheme.GAP_LINEARISED),
            beside="standing, knees bent",
        ),
        "slipping, plank on 8 points": Counted(
            replace(at_reference(eight, speed=5.0), friction=0.2), 50, 500,
            beside="standing, plank on 8 points",
        ),
    }  # fmt: skip


def at_reference(
    robot: hs.Robot, *, speed: float = 0.0, feedback: JointFeedback | None = None
) -> Scenario:
    """Return a robot in its reference position, moving forward at a speed (m/s)."""
    state = hs.State(robot.model.reference, speed * np.eye(robot.nv)[0])
    return Scenario(robot.name, robot, state, 1.0, feedback)


def held(robot: hs.Robot, beyond: float) -> JointFeedback:
    """Return springs that want hips and knees some angle (rad) beyond their stops."""
    bent = np.array(["ankle" not in name for name in robot.actuator_names])
    target = robot.model.reference[robot.model.actuator_joint] + beyond * bent
    return JointFeedback(robot, target, kp=1000.0, kd=15.0)


def stamping(still: Scenario) -> JointFeedback:
    """Return a law under which knees jump ± 0.02 rad every 5 ms: contacts change in most steps.

    What it does must not depend on rounding: a change of 1e-12 stays one.
    """
    law, robot = still.feedback, still.robot
    assert law is not None
    gains = law.parameters
    sign = np.array([1.0 if "right" in name else -1.0 for name in robot.actuator_names])
    jump = 0.02 * gains.kp * sign * ["knee" in name for name in robot.actuator_names]
    command = gains.coefficients[0, :, 0] + np.where(np.arange(200)[:, None] % 2, -jump, jump)
    begins = 0.005 * np.arange(200)
    return JointFeedback(
        robot, 0.0, torque=command[..., None], kp=gains.kp, kd=gains.kd, begins=begins
    )


class Loop:
    """The compiled loop of a simulation, begun."""

    def __init__(self, counted: Counted) -> None:
        scenario = counted.scenario
        self._simulation = hs.Simulation(
            scenario.robot,
            scenario.feedback if counted.controller is None else counted.controller,
            state=scenario.state,
            method=counted.method,
            ground=scenario.ground,
            record_every=2**62,
            stop_when_fallen=False,
        )
        self._simulation._clock.until = 10.0

    @property
    def time(self) -> float:
        """Simulated time now (s)."""
        return self._simulation.time

    def advance(self, steps: int) -> None:
        """Take some steps of the method."""
        clock = self._simulation._clock
        clock.pause = clock.index + steps
        if self._simulation._run_loop() is not Outcome.PAUSED:
            raise RuntimeError(f"the run ended early at t = {self.time} s")


def count(folder: Path, switch: Any) -> None:
    """Run the scenarios, counting (or, without a switch, only compiling)."""
    seconds = {}
    for name, counted in scenarios(hs.load_gait(folder / "gait.json")).items():
        loop = Loop(counted)
        loop.advance(counted.first)
        begin = loop.time
        for label, steps in (("call", 0), ("steps", counted.count)):
            if switch is not None:
                switch.begin()
            loop.advance(steps)
            if switch is not None:
                switch.end(f"{label}: {name}".encode())
        seconds[name] = loop.time - begin
    (folder / "seconds.json").write_text(json.dumps(seconds))


def measure() -> tuple[dict[str, float], dict[str, float]]:
    """Instructions a step of every scenario, and how many times as many as when it sticks."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or shutil.which("valgrind") is None:
        sys.exit("instructions are counted by valgrind with a switch in C: install both")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "switch.c").write_text(SWITCH)
        library = folder / "switch.so"
        subprocess.run(
            [compiler, "-shared", "-fPIC", "-O1", "-o", library, folder / "switch.c"], check=True
        )
        environment = os.environ | TARGET
        walk_gait()[1].save(folder / "gait.json")
        child = [sys.executable, __file__, "--child", name]
        subprocess.run([*child, "--compile"], env=environment, check=True)
        subprocess.run(
            [
                "valgrind",
                "--tool=callgrind",
                "--instr-atstart=no",
                "--smc-check=all-non-file",
                f"--callgrind-out-file={name}/counts",
                *child,
            ],
            env=environment,
            check=True,
            stderr=subprocess.DEVNULL,
        )
        totals = {}
        for file in folder.glob("counts*"):
            text = file.read_text(errors="replace")
            said = re.search(r"Client Request: (\w+): (.+)", text)
            total = re.search(r"^(?:totals|summary): (\d+)", text, re.MULTILINE)
            if said and total:
                totals[said.group(1), said.group(2)] = int(total.group(1))
        seconds = json.loads((folder / "seconds.json").read_text())
    found = {
        name: round((totals["steps", name] - totals["call", name]) * STEP / simulated, 1)
        for name, simulated in seconds.items()
    }
    partners = {name: each.beside for name, each in scenarios().items() if each.beside}
    return found, {name: round(found[name] / found[of], 2) for name, of in partners.items()}


def compare(found: dict[str, float], kept: dict[str, Any]) -> list[str]:
    """Names of the scenarios that take more instructions than they did; print all."""
    worse = []
    print(f"{'':34s} {'kept':>10s} {'now':>10s} {'change':>9s}")
    for name, number in found.items():
        before = kept.get("instructions_a_step", {}).get(name)
        change = "" if before is None else f"{100.0 * (number / before - 1.0):+8.2f}%"
        was = "–" if before is None else f"{before:10.1f}"
        print(f"{name:34s} {was:>10s} {number:10.1f} {change:>9s}")
        if before is not None and number > (1.0 + TOLERANCE) * before:
            worse.append(name)
    return worse


def main() -> None:
    """Count, compare, and keep (with the table of the page) if asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", help="keep the counts of this run")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--compile", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child is not None:
        library = options.child / "switch.so"
        count(options.child, None if options.compile else ctypes.CDLL(str(library)))
        return
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    found, beside = measure()
    worse = compare(found, kept)
    if options.update:
        versions = {name: version(name) for name in ("numba", "llvmlite", "numpy")}
        content = {
            "step_s": STEP,
            "target": TARGET["NUMBA_CPU_NAME"],
            "versions": versions,
            "instructions_a_step": found,
            "times_sticking": beside,
        }
        KEPT.write_text(json.dumps(content, indent=2) + "\n")
        page.put([("instructions", page.instructions())])
    elif worse:
        sys.exit(f"more than {100 * TOLERANCE:g} % more instructions: {', '.join(worse)}")


if __name__ == "__main__":
    main()
