"""What the derivatives of a step cost: of bravo7 in stance, by state and torques.

``python benchmarks/derivatives.py`` prints microseconds a step: in compiled code, and from Python
with the step itself and the law's answer left out. Processor time, the best of several.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import heelstrike as hs
from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Model
from heelstrike.sim.linearized.time_step import (
    StepSlopes,
    allocate_slopes,
    differentiate_step,
)
from heelstrike.sim.memory import Memory
from heelstrike.sim.time_stepping.method import Stepping

CALLS, REPEATS = 20_000, 15


@kernel
def differentiate_often(
    count: int, model: Model, work: Stepping, memory: Memory, slopes: StepSlopes
) -> None:
    """Differentiate the same step again and again."""
    for _ in range(count):
        differentiate_step(model, work, memory, slopes)


def best(calls: int, function: Callable[..., Any], *arguments: Any) -> float:
    """Return microseconds of processor time a call."""
    times = []
    for _ in range(REPEATS):
        begin = process_time()
        function(*arguments)
        times.append(process_time() - begin)
    return 1e6 * min(times) / calls


def main() -> None:
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


if __name__ == "__main__":
    main()
