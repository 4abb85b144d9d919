"""Motions of any phases: how long their design takes, and what they do event-driven.

Run, from the top folder::

    python benchmarks/motions.py                 # all
    python benchmarks/motions.py toe "run fast"  # some of them
    python benchmarks/motions.py --steps 1000 "run fast"
    python benchmarks/motions.py --film FOLDER toe    # pictures of the middle step
    python benchmarks/motions.py --law FootstepFeedback "run fast"

For each motion it prints the processor time of its design, its cost, how many of 20 steps it goes
under a stock law before it falls, and how well it closes: by how much, after 40 steps, two more
change the state (m, rad, m/s, rad/s; the trunk's place apart). Laws are `ComputedTorque` where
motors move all that the contacts leave free, and `MotionLQR` where they do not; of that the largest
multiplier is printed. `pushed` is the same walk with a push on the trunk in every tenth step, of
2 % of the robot's weight for a tenth of a second.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike import ContactPhase as Phase

STRONG = 250.0
"""Torque (N m) of the motors that human7 is given; those of its file have 60."""
EXACT = hs.EventDriven(rtol=1e-11, atol=1e-13)
SETTLED, APART = 40, 0.3
"""Steps after which a walk has to close, and share of a step between touchdowns of two steps."""
HEEL, FLAT, TOE = "right_foot_heel", "right_foot", "right_foot_toe"


@dataclass(frozen=True)
class Case:
    """A motion and the law that follows it."""

    robot: str
    phases: Callable[[], list[Phase]] | None = None
    """Phases of a motion; None for a gait on one flat foot."""
    asked: dict[str, Any] = field(default_factory=dict)
    law: Callable[..., Any] = hs.ComputedTorque


def rolling() -> list[Phase]:
    """Heel, flat, toe-off, in single support."""
    return [
        Phase(HEEL, duration=(0.03, 0.2), pieces=2),
        Phase(FLAT, duration=(0.2, 0.6), pieces=4),
        Phase(TOE, duration=(0.05, 0.3), pieces=3),
    ]


def both_feet() -> list[Phase]:
    """Double support, the rear foot on its toe; flat; toe-off."""
    return [
        Phase("left_foot_toe", FLAT, duration=(0.08, 0.3), pieces=3),
        Phase(FLAT, duration=(0.2, 0.6)),
        Phase(TOE, duration=(0.05, 0.3), pieces=3),
    ]


def whole_step() -> list[Phase]:
    """Heel strike and rolling flat, both while the rear foot stands on its toe; flat; toe-off."""
    return [
        Phase("left_foot_toe", HEEL, duration=(0.04, 0.2), pieces=2),
        Phase("left_foot_toe", FLAT, duration=(0.04, 0.2), pieces=2),
        Phase(FLAT, duration=(0.2, 0.6), pieces=4),
        Phase(TOE, duration=(0.05, 0.3), pieces=3),
    ]


def running(stance: str, least: tuple[float, float]) -> Callable[[], list[Phase]]:
    """Stance on a point, then flight, each of a least duration."""
    return lambda: [
        Phase(stance, duration=(least[0], 0.3), pieces=4),
        Phase(duration=(least[1], 0.3), pieces=3),
    ]


LONG_TREADS = {"step_length": 0.35, "step_duration": 0.80, "clearance": 0.02}
STEP = {"step_length": 0.30, "step_duration": 0.70}
TOE_STEP = {"distance": 0.30, "duration": 0.70}
WHOLE_STEP = {"distance": 0.30, "duration": 0.80, "clearance": 0.02, "starts": 1}
CASES = {
    "flat": Case("bravo7", lambda: [Phase(FLAT, duration=0.7)], {"distance": 0.30}),
    "toe": Case("bravo7", lambda: rolling()[1:], TOE_STEP),
    "heel, flat, toe": Case("bravo7", rolling, TOE_STEP | {"clearance": 0.02}),
    "double support": Case("bravo7", both_feet, {"distance": 0.30, "duration": 0.80}),
    "heel, flat, toe, faster": Case(
        "bravo7", rolling, TOE_STEP | {"clearance": 0.02, "landing_speed": 0.1}, hs.MotionLQR
    ),
    "heel, flat, toe, human7": Case(
        "human7", rolling, {"distance": 0.40, "duration": 0.70, "clearance": 0.02}
    ),
    "whole step": Case("bravo7", whole_step, WHOLE_STEP),
    "whole step, human7": Case("human7", whole_step, WHOLE_STEP | {"distance": 0.40}),
    "run": Case("rabbit", running("right_tibia", (0.05, 0.05)), {"speed": 2.0}, hs.MotionLQR),
    "run fast": Case("bravo7", running(TOE, (0.15, 0.1)), {"speed": 2.2}, hs.MotionLQR),
    "run, walker2d": Case("walker2d", running(TOE, (0.05, 0.05)), {"speed": 2.0}, hs.MotionLQR),
    "run, human7": Case("human7", running(TOE, (0.15, 0.1)), {"speed": 2.2}, hs.MotionLQR),
    "run on flat feet": Case("bravo7", running(FLAT, (0.05, 0.08)), {"speed": 2.0}),
    "limp": Case(
        "rabbit",
        lambda: [
            Phase("right_tibia", duration=(0.55, 0.8)),
            Phase("left_tibia", duration=(0.2, 0.5)),
        ],
        {"distance": 0.5, "duration": 1.0, "repeat": "same"},
        hs.MotionLQR,
    ),
} | {
    f"{name}, {robot}": Case(robot, None, STEP | ground)
    for robot in ("bravo7", "human7")
    for name, ground in {
        "up 8 degrees": {"slope": np.deg2rad(8.0)},
        "down 8 degrees": {"slope": np.deg2rad(-8.0)},
        "upstairs": {"rise": 0.10},
        "downstairs": {"rise": -0.10, **LONG_TREADS},
    }.items()
}


@cache
def robot_of(name: str) -> hs.Robot:
    """Return a robot of the library; human7 with strong motors."""
    robot = hs.load_robot(name)
    if name != "human7":
        return robot
    most = np.full(robot.nu, STRONG)
    return replace(robot, model=robot.model.replaced(torque_lower=-most, torque_upper=most))


def designed(case: Case) -> hs.Gait | hs.Motion:
    """Design the motion, or the gait."""
    robot = robot_of(case.robot)
    if case.phases is None:
        return hs.optimize_gait(robot, **case.asked)
    return hs.optimize_motion(robot, case.phases(), **case.asked)


def ground_of(walk: hs.Gait | hs.Motion) -> hs.Ground:
    """Return the ground that it was designed for, with the first foothold at the origin."""
    if not walk.rise:
        return hs.Ground(friction=walk.friction, slope=walk.slope)
    length = walk.step_length
    treads = np.arange(-3, 100)
    ends = np.column_stack([(treads - 0.5) * length, (treads + 0.5) * length]).ravel()
    profile = np.column_stack([ends, np.repeat(treads * walk.rise, 2)])
    return hs.Ground(friction=walk.friction, profile=profile)


def step_duration(walk: hs.Gait | hs.Motion) -> float:
    """Duration of what repeats (s)."""
    return walk.step_duration if isinstance(walk, hs.Gait) else walk.duration


def pushes_of(robot: hs.Robot, walk: Any, steps: int) -> list[hs.Push]:
    """Return a push on the trunk in every tenth step, forwards and backwards in turn."""
    force, period = 0.02 * robot.weight, step_duration(walk)
    return [
        hs.Push(2, force=((-1) ** k * force, 0.0), start=(10 * k + 5.2) * period, duration=0.1)
        for k in range(steps // 10)
    ]


def walked(case: Case, walk: Any, steps: float, **more: Any) -> tuple[hs.Run, float]:
    """Walk so many steps and a half; return the run, and how many it took."""
    robot, period = robot_of(case.robot), step_duration(walk)
    run = hs.simulate(
        robot, case.law(robot, walk), state=walk.initial_state, duration=(steps + 0.5) * period,
        ground=ground_of(walk), **({"method": hs.EventDriven()} | more),
    )  # fmt: skip
    return run, min(float(run.time[-1]) / period, steps)


def closes(case: Case, walk: Any) -> float:
    """How the trunk's pitch, the joints and all velocities differ after two more steps.

    Both times so long after a touchdown that all points are down.
    """
    run, gone = walked(case, walk, SETTLED, method=EXACT)
    downs = np.array([e.time for e in run.events if e.kind is hs.sim.EventKind.TOUCHDOWN])
    begins = downs[np.diff(downs, prepend=0.0) > APART * step_duration(walk)]
    if gone < SETTLED:
        return float("nan")
    robot = robot_of(case.robot)
    simulation = hs.Simulation(
        robot, case.law(robot, walk), state=walk.initial_state, method=EXACT, ground=ground_of(walk)
    )
    states = []
    for begin in begins[[-4, -2]]:
        simulation.advance(float(begin) + APART * step_duration(walk))
        states.append(simulation.state.vector[2:])
    return float(np.abs(states[1] - states[0]).max())


def row(name: str, steps: int, film: Path | None, law: str | None) -> str:
    """Design a motion and walk it, under another law if one is named; return its row."""
    case = CASES[name] if law is None else replace(CASES[name], law=getattr(hs, law))
    robot_of(case.robot)
    begin = time.process_time()
    try:
        walk = designed(case)
    except hs.GaitError as error:
        return f"| {name} | {case.robot} | not found: {str(error)[:300]} |"
    spent = time.process_time() - begin
    made = case.law(robot_of(case.robot), walk)
    largest = f"{abs(made.multipliers[0]):.2f}" if isinstance(made, hs.MotionLQR) else ""
    run, gone = walked(case, walk, steps)
    _, pushed = walked(case, walk, steps, pushes=pushes_of(robot_of(case.robot), walk, steps))
    if film is not None:
        film.mkdir(parents=True, exist_ok=True)
        run.plot("snapshots", path=film / f"{name.replace(', ', '_').replace(' ', '_')}.png")
    return (
        f"| {name} | {case.robot} | {spent:.1f} | {walk.cost:.4g} | {case.law.__name__} | "
        f"{largest} | {closes(case, walk):.0e} | {gone:.4g} | {pushed:.4g} |"
    )


def main() -> None:
    """Print the table."""
    reader = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    reader.add_argument("motions", nargs="*", help=f"some of: {'; '.join(CASES)}")
    reader.add_argument("--steps", type=int, default=20, help="steps to walk")
    reader.add_argument("--film", type=Path, help="folder for pictures of a step")
    reader.add_argument("--law", help="a law of hs, as WholeBody, in the place of the usual one")
    asked = reader.parse_args()
    columns = ("motion", "robot", "design (s)", "cost (N²m²s)", "law", "largest multiplier")
    columns += ("closes to", f"steps of {asked.steps}", "pushed")
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for name in asked.motions or CASES:
        print(row(name, asked.steps, asked.film, asked.law), flush=True)


if __name__ == "__main__":
    main()
