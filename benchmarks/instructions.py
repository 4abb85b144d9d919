"""Instructions a step, counted by callgrind: the noise-free companion of the times.

The compiled loops run under valgrind, and what they execute is counted: the same number each time
for the same code, compiler and step, whatever else the machine does. Kernels are compiled for
Haswell, since valgrind knows no AVX-512. A step is a millisecond of simulated time, also where a
method chooses steps of its own.

What slips, or lies on joint stops, is held beside the same robot sticking.

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

KEPT = Path(__file__).with_name("instructions.json")
TOLERANCE = 0.02
STEP = 1e-3

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
    method : str
        Way through time.
    friction : float
        Coefficient of the ground.
    beside : str
        Scenario of the same robot that only sticks, whose count this one's is held against.
    """

    scenario: Any
    first: int
    count: int
    method: str = "TimeStepping"
    friction: float = 0.75
    beside: str = ""


def scenarios() -> dict[str, Counted]:
    """What is counted, by name."""
    from heelstrike import State, load_robot
    from heelstrike.control.joint_feedback import JointFeedback
    from heelstrike.experiments.benchmark.scenarios import (
        Scenario,
        falling,
        plank,
        standing,
        walking,
    )
    from heelstrike.robot import Robot, read_mjcf

    def at_reference(robot: Robot, speed: float, feedback: JointFeedback | None = None) -> Scenario:
        """Return a robot in its reference position, moving forward at a speed (m/s)."""
        state = State(robot.model.reference, speed * np.eye(robot.nv)[0])
        return Scenario(robot.name, robot, state, 1.0, feedback)

    def held(robot: Robot, beyond: float) -> JointFeedback:
        """Return springs that want hips and knees some angle (rad) beyond their stops."""
        bent = np.array(["ankle" not in name for name in robot.actuator_names])
        target = robot.model.reference[robot.model.actuator_joint] + beyond * bent
        return JointFeedback(robot, target, kp=1000.0, kd=15.0)

    def stamping() -> Scenario:
        """Return bravo7 whose hips jump ± 0.05 rad every 20 ms: contacts change in most steps."""
        still = standing("bravo7")
        law, robot = still.feedback, still.robot
        assert law is not None
        sign = np.array([1.0 if "right" in name else -1.0 for name in robot.actuator_names])
        jump = 0.05 * law.kp * sign * ["hip" in name for name in robot.actuator_names]
        begins = 0.02 * np.arange(50)
        command = law.coefficients[0, :, 0] + np.where(np.arange(50)[:, None] % 2, -jump, jump)
        law = JointFeedback(
            robot, 0.0, torque=command[..., None], kp=law.kp, kd=law.kd, begins=begins
        )
        return replace(still, feedback=law)

    walk = replace(walking(), feedback=walking().own)
    bent = standing("bravo7")
    sliding = replace(bent, state=State(bent.state.q, 0.5 * np.eye(bent.robot.nv)[0]))
    walker, eight = load_robot("walker2d"), read_mjcf(plank(8))
    on_stops = {"beside": "standing, walker2d"}
    return {
        "standing, knees straight": Counted(standing("bravo7", bent=False), 100, 500),
        "standing, knees bent": Counted(bent, 100, 500),
        "standing, walker2d": Counted(standing("walker2d"), 100, 500),
        "standing, plank on 8 points": Counted(at_reference(eight, 0.0), 100, 500),
        "walking, computed torque": Counted(walk, 0, 1000),
        "walking, event driven": Counted(walk, 20, 200, "EventDriven"),
        "walking, compliant": Counted(walk, 20, 900, "Compliant"),
        "falling": Counted(falling("bravo7"), 0, 400),
        "at its stops, walker2d left alone": Counted(at_reference(walker, 0.0), 0, 600, **on_stops),
        "at its stops, walker2d held": Counted(
            at_reference(walker, 0.0, held(walker, 0.0)), 0, 600, **on_stops
        ),
        "against its stops, walker2d": Counted(
            at_reference(walker, 0.0, held(walker, 0.02)), 0, 600, **on_stops
        ),
        "slipping, bravo7": Counted(sliding, 50, 500, friction=0.05, beside="standing, knees bent"),
        "stamping, bravo7": Counted(
            stamping(), 0, 600, friction=0.1, beside="standing, knees bent"
        ),
        "slipping, plank on 8 points": Counted(
            at_reference(eight, 5.0), 50, 500, friction=0.2, beside="standing, plank on 8 points"
        ),
    }


def prepare(folder: Path) -> None:
    """Write down what the counted process needs, and compile everything it will run."""
    from heelstrike.experiments.benchmark.scenarios import plank

    (folder / "plank.xml").write_text(plank(8))
    for number, (name, counted) in enumerate(scenarios().items()):
        scenario = counted.scenario
        compiled = None if scenario.feedback is None else scenario.feedback.compiled()
        robot = scenario.robot.name
        np.savez(
            folder / f"scenario{number:02d}.npz",
            name=name,
            robot=str(folder / "plank.xml") if robot == "plank" else robot,
            kernel="" if compiled is None else compiled.kernel.__name__,
            q=scenario.state.q,
            v=scenario.state.v,
            parameters=np.zeros(0) if compiled is None else compiled.parameters,
            memory=np.zeros(0) if compiled is None else compiled.memory,
            first=counted.first,
            count=counted.count,
            method=counted.method,
            friction=counted.friction,
            beside=counted.beside,
        )


def count(folder: Path, switch: Any) -> None:
    """Run the scenarios, counting (or, without a switch, only compiling)."""
    import heelstrike
    from heelstrike import Ground, State, load_robot
    from heelstrike.compiler.separate_kernel import SeparateKernel
    from heelstrike.sim import CompiledController
    from heelstrike.sim.controller.guard import guarded
    from heelstrike.sim.method import PAUSED
    from heelstrike.sim.simulation import compiled_form, prepared

    for file in sorted(folder.glob("scenario*.npz")):
        given = np.load(file)
        robot = load_robot(str(given["robot"]))
        name = str(given["kernel"])
        controller = compiled_form(robot, None)
        if name:
            module = "computed_torque" if name == "computed_torque" else "joint_feedback"
            kernel = getattr(__import__(f"heelstrike.control.{module}", fromlist=[name]), name)
            kernel = kernel.finish() if isinstance(kernel, SeparateKernel) else kernel
            controller = CompiledController(kernel, given["parameters"], given["memory"])
        assert controller is not None
        loop = prepared(
            robot=robot,
            state=State(given["q"], given["v"]),
            duration=10.0,
            method=getattr(heelstrike, str(given["method"]))(),
            ground=Ground(friction=float(given["friction"])),
            control_period=None,
            record_every=2**62,
            stop_when_fallen=False,
            pushes=(),
        )
        loop.begin()
        parameters = guarded(controller.parameters)
        memory = guarded(controller.memory)

        def advance(
            steps: int,
            loop: Any = loop,
            kernel: Any = controller.kernel,
            parameters: Any = parameters,
            memory: Any = memory,
        ) -> None:
            loop.engine.pause_after(steps)
            if loop.engine.advance(kernel, parameters, memory, loop.records[-1]) != PAUSED:
                raise RuntimeError(f"the run ended early at t = {loop.engine.time} s")

        advance(int(given["first"]))
        begin = loop.engine.time
        for label, steps in (("call", 0), ("steps", int(given["count"]))):
            if switch is not None:
                switch.begin()
            advance(steps)
            if switch is not None:
                switch.end(f"{file.stem} {label}".encode())
        np.save(file.with_suffix(".npy"), loop.engine.time - begin)


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
        child = [sys.executable, __file__, "--child", name]
        subprocess.run([*child, "--prepare"], env=environment, check=True)
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
            said = re.search(r"Client Request: (\S+) (\w+)", text)
            total = re.search(r"^(?:totals|summary): (\d+)", text, re.MULTILINE)
            if said and total:
                totals[said.group(1), said.group(2)] = int(total.group(1))
        result, partner = {}, {}
        for file in sorted(folder.glob("scenario*.npz")):
            given, seconds = np.load(file), float(np.load(file.with_suffix(".npy")))
            extra = totals[file.stem, "steps"] - totals[file.stem, "call"]
            result[str(given["name"])] = round(extra * STEP / seconds, 1)
            if given["beside"]:
                partner[str(given["name"])] = str(given["beside"])
        return result, {name: round(result[name] / result[of], 2) for name, of in partner.items()}


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
    """Count, compare, and keep if asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", help="keep the counts of this run")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--prepare", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child is not None:
        if options.prepare:
            prepare(options.child)
            count(options.child, None)
        else:
            count(options.child, ctypes.CDLL(str(options.child / "switch.so")))
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
    elif worse:
        sys.exit(f"more than {100 * TOLERANCE:g} % more instructions: {', '.join(worse)}")


if __name__ == "__main__":
    main()
