"""What the derivatives of a step cost, and how exact they are.

``python benchmarks/derivatives.py cost`` prints microseconds a step of bravo7 in stance: in
compiled code, and from Python with the step itself and the law's answer left out. Processor time,
the best of several.

``python benchmarks/derivatives.py errors`` prints, of every library robot and method, the largest
error of a block of the derivative, in parts of the block, against Richardson differences of falls
onto ground and stops, and of how many steps or intervals; in event-driven falls also what happened.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import heelstrike as hs
from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Model
from heelstrike.sim import Scheme
from heelstrike.sim.linearized.time_step import (
    StepSlopes,
    allocate_slopes,
    differentiate_step,
)
from heelstrike.sim.memory import Memory
from heelstrike.sim.time_stepping.method import Stepping

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from derivative_checks import Checks, interval, time_steps

CALLS, REPEATS = 20_000, 15


@kernel
def differentiate_often(
    count: int, model: Model, work: Stepping, memory: Memory, slopes: StepSlopes
) -> None:
    """Differentiate the same step again and again."""
    for _ in range(count):
        differentiate_step(
            model, work.step, work.scheme, memory.stiffness, memory.next_v, memory.equations.added,
            memory.contacts.normal, memory.rows, memory.surface, memory.assembly, work.impact,
            memory.pushes, slopes,
        )  # fmt: skip


def best(calls: int, function: Callable[..., Any], *arguments: Any) -> float:
    """Return microseconds of processor time a call."""
    times = []
    for _ in range(REPEATS):
        begin = process_time()
        function(*arguments)
        times.append(process_time() - begin)
    return 1e6 * min(times) / calls


def cost() -> None:
    """Print the times."""
    robot, ground = hs.load_robot("bravo7"), hs.Ground(friction=0.75)
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.75)
    simulation = hs.Simulation(
        robot, hs.ComputedTorque(robot, gait), state=gait.initial_state, ground=ground,
        method=hs.TimeStepping(step=1e-3),
    )  # fmt: skip
    simulation.advance(0.3)
    slopes = allocate_slopes(robot)
    slopes.q[:], slopes.v[:] = simulation.state.q, simulation.state.v
    simulation.step()
    given = robot.model, simulation._work, simulation._memory, slopes
    differentiate_often(1, *given)
    compiled = best(CALLS, differentiate_often, CALLS, *given)
    now = simulation.snapshot()

    def from_python() -> None:
        simulation.restore(now)
        hs.step_derivatives(simulation, answers=False)

    print(f"a step of time stepping, bravo7 in stance, {slopes.state.shape[1]} columns")
    print(f"compiled     {compiled:8.2f} us")
    print(f"from Python  {best(1, from_python):8.0f} us, with the step and a snapshot restored")


SEEDS = range(1, 5)
"""Event-driven falls of each robot."""


def errors() -> None:
    """Print the table of errors."""
    print(f"{'robot':18}{'method':24}{'compared':>9}{'worst':>9}  inside")
    for name in hs.builtin_robots():
        robot = hs.load_robot(name)
        for scheme in Scheme:
            tell(name, scheme.name.lower(), time_steps(robot, scheme), "")
        found, events = Checks(), set()
        for seed in SEEDS:
            compared = interval(robot, seed=seed)
            if found.add(None if compared is None else compared[0]):
                events |= compared[1]
        tell(name, "event-driven", found, ", ".join(sorted(events)).lower())


def tell(robot: str, method: str, found: Checks, inside: str) -> None:
    """Print a row."""
    print(f"{robot:18}{method:24}{found.count:9}{found.worst:9.1e}  {inside}", flush=True)


if __name__ == "__main__":
    parts = {"cost": cost, "errors": errors}
    for part in sys.argv[1:] or parts:
        parts[part]()
