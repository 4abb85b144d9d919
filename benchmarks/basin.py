"""What rabbit stands under virtual constraints: pushes by phase, slopes, steps, rough ground.

A gait of 0.6 m at 1.1 m/s, gains 100/s² and 40/s for all of it, no feedback of where the feet land;
or, with ``--footsteps``, one with bent knees for each robot (`BENT_GAITS`), and the defaults of
``SteppingConstraints`` for both.
``python benchmarks/basin.py`` prints the tables of docs/virtual-constraints.md.
"""

from __future__ import annotations

import argparse

import numpy as np

import heelstrike as hs

LENGTH, SPEED, CLEARANCE = 0.6, 1.1, 0.03
KP, KD = 100.0, 40.0
PHASES = 20
SEEDS, OTHER_SEEDS = range(10), range(1000, 1020)

BENT_GAITS = {"rabbit": (0.43, 0.86, 0.25), "rabbit_optimtraj": (0.5, 0.95, 0.35)}
"""Length (m), speed (m/s) and friction of the gaits whose feet land elsewhere."""
BENT_CLEARANCE = 0.05
BENT = {"right_knee": (0.2, 2.6), "right_hip": (-0.8, 1.5)}
"""Its ranges of the joints: knees that stay bent, a trunk that does not lean far (rad)."""


def bent_family(robot: hs.Robot) -> hs.StepFamily:
    """Return the gaits of the walk with footstep feedback."""
    length, speed, friction = BENT_GAITS[robot.name]
    gait = hs.optimize_gait(
        robot, step_length=length, step_duration=length / speed, friction=friction,
        clearance=BENT_CLEARANCE, joint_ranges=BENT,
    )  # fmt: skip
    return hs.StepFamily.around(hs.PhasedGait.from_gait(robot, gait))


def footstep_trial(robot: hs.Robot, method: hs.TimeStepping | hs.EventDriven) -> hs.Trial:
    """Return the walk with footstep feedback."""
    family = bent_family(robot)
    law, zero = hs.SteppingConstraints(family), hs.zero_dynamics(family.gait)
    cycle = hs.find_limit_cycle(robot, zero.initial_state, law, memory=("slope",))
    print(f"contraction {zero.contraction:.4f}; multipliers with feedback {cycle.multipliers[:4]}")
    return hs.Trial(
        robot=robot,
        controller=law,
        state=zero.initial_state,
        step_length=zero.step_length,
        step_duration=zero.period,
        method=method,
    )


def trial(robot: hs.Robot, method: hs.TimeStepping | hs.EventDriven) -> hs.Trial:
    """Return the walk that is disturbed."""
    gait = hs.optimize_gait(
        robot, step_length=LENGTH, step_duration=LENGTH / SPEED, clearance=CLEARANCE, friction=0.6
    )
    phased = hs.PhasedGait.from_gait(robot, gait)
    zero = hs.zero_dynamics(phased)
    return hs.Trial(
        robot=robot,
        controller=hs.VirtualConstraints(phased, kp=KP, kd=KD),
        state=zero.initial_state,
        step_length=zero.step_length,
        step_duration=zero.period,
        method=method,
    )


def main() -> None:
    """Measure and print."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--robot", choices=BENT_GAITS, default="rabbit")
    options.add_argument("--phases", type=int, default=PHASES)
    options.add_argument("--event-driven", action="store_true", help="else 1 ms of time stepping")
    options.add_argument("--footsteps", action="store_true", help="with footstep feedback")
    given = options.parse_args()
    method = hs.EventDriven(output_period=0.01) if given.event_driven else hs.TimeStepping()
    begin = footstep_trial if given.footsteps else trial
    walk = begin(hs.load_robot(given.robot), method)
    print(f"{given.robot}, {type(method).__name__}")
    for name, direction in (("forwards", (1.0, 0.0)), ("backwards", (-1.0, 0.0))):
        found = [
            hs.largest_push(
                walk, phase=phase, direction=direction, most=50.0, strides=25, halvings=1
            ).recovered
            for phase in np.arange(given.phases) / given.phases
        ]
        print(f"push {name}: {min(found):.3g} N s at worst of {given.phases} phases; {found}")
    for name, up in (("up", True), ("down", False)):
        print(f"slope {name}: {hs.largest_slope(walk, uphill=up)}")
        print(f"step {name}: {hs.largest_ground_step(walk, up=up)}")
    seeds = OTHER_SEEDS if given.footsteps else SEEDS
    rough = [hs.largest_roughness(walk, seed=seed).recovered for seed in seeds]
    print(f"rough: ±{min(rough):.3g} m at worst of seeds {seeds}; {rough}")


if __name__ == "__main__":
    main()
