"""How far robots on point feet walk under virtual constraints.

``python benchmarks/endless_walk.py --event-driven 100000 --time-stepping 10000`` walks rabbit and
rabbit_optimtraj so many steps and says whether they still walk as at first, and what a step costs;
with ``--footsteps`` under footstep feedback, on the gaits of ``basin.py``.
A walk is simulated in parts; each goes on from the end of the one before, bit by bit.
"""

from __future__ import annotations

import argparse
import time

import basin

import heelstrike as hs

FRICTION = 0.75
PART = 500  # steps simulated in one call
GAITS = {"rabbit": (0.21, 0.58), "rabbit_optimtraj": (0.40, 0.60)}
"""Step length (m) and duration (s) by robot."""


def walk(
    zero: hs.ZeroDynamics, law: hs.VirtualConstraints | hs.SteppingConstraints,
    method: hs.EventDriven | hs.TimeStepping, steps: int,
) -> str:  # fmt: skip
    """Walk so many steps; return what happened, in a line."""
    robot = zero.gait.robot
    state: hs.State | hs.Snapshot = zero.initial_state
    taken, worst, clock = 0, 0.0, time.process_time()
    while taken < steps:
        part = min(PART, steps - taken)
        run = hs.simulate(
            robot, law, state=state, duration=part * zero.period, method=method,
            ground=hs.Ground(friction=FRICTION),
        )  # fmt: skip
        if not run.completed:
            return f"{run.status.value} after {taken} to {taken + part} steps: {run.message}"
        speed = (run.position[-1, 0] - run.position[0, 0]) / (run.time[-1] - run.time[0])
        worst = max(worst, abs(speed * zero.period / zero.step_length - 1.0))
        state, taken = run.final, taken + part
    cost = (time.process_time() - clock) / taken
    return (
        f"{taken} steps, {run.position[-1, 0]:.1f} m; mean speed of {PART} steps within "
        f"{worst:.1e} of the quadrature's; {1e3 * cost:.2f} ms of CPU a step"
    )


def begin(
    robot: hs.Robot, footsteps: bool
) -> tuple[hs.ZeroDynamics, hs.VirtualConstraints | hs.SteppingConstraints]:
    """Return a walk that repeats, and its law."""
    if footsteps:
        family = basin.bent_family(robot)
        return hs.zero_dynamics(family.gait), hs.SteppingConstraints(family)
    length, duration = GAITS[robot.name]
    gait = hs.optimize_gait(
        robot, step_length=length, step_duration=duration, clearance=0.02, friction=0.6
    )
    zero = hs.zero_dynamics(hs.PhasedGait.from_gait(robot, gait))
    return zero, hs.VirtualConstraints(zero.gait, kp=900.0, kd=60.0)


def main() -> None:
    """Walk."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--robot", choices=GAITS, action="append", help="by default both")
    options.add_argument("--event-driven", type=int, default=1000, metavar="STEPS")
    options.add_argument("--time-stepping", type=int, default=100, metavar="STEPS")
    options.add_argument("--footsteps", action="store_true", help="with footstep feedback")
    given = options.parse_args()
    for name in given.robot or GAITS:
        zero, law = begin(hs.load_robot(name), given.footsteps)
        methods = (
            (hs.EventDriven(output_period=zero.period), given.event_driven),
            (hs.TimeStepping(step=1e-3), given.time_stepping),
        )
        for method, steps in methods:
            if steps > 0:
                print(
                    f"{name}, {type(method).__name__}: {walk(zero, law, method, steps)}", flush=True
                )


if __name__ == "__main__":
    main()
