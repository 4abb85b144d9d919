"""Up to which pushes the stance foot stays flat under regulation of the zero moment point.

A push of 0.1 s on the trunk's centre of mass, at phases of the third step, is raised until one of
these fails: the walk recovers strictly (:func:`heelstrike.analysis.recovery.recovery`); and in 99.9
per cent of the samples of single support, one a millisecond, the zero moment point is 1 cm and more
inside the sole, both ends of the sole are loaded, and the foot is at rest: its points move by less
than 5 mm/s, of which time stepping leaves a millimetre or two. The sample of a touchdown itself, an
impact, is left out: the first on a new foot. Beside it stands the
least push that tips the foot under computed torque with the same gains: one that leaves an end of
the sole unloaded for ten samples.

Run: python benchmarks/foot_rotation.py [--robot bravo7] [--phases 10] [--rise 2]
     [--method stepping]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.recovery import recovery
from heelstrike.analysis.zero_moment_point import zero_moment_point
from heelstrike.gait.sole import sole, standing_height

HEIGHT = 0.9538  # of bravo7, to whose gait those of other robots are scaled
INSIDE, REST, PART = 0.01, 5e-3, 0.999
LEAST_LOAD = 1e-3  # of the weight
TIPPED = 10
METHODS: dict[str, hs.TimeStepping | hs.EventDriven] = {
    "stepping": hs.TimeStepping(step=1e-3),
    "events": hs.EventDriven(),
}


@dataclass(frozen=True)
class Footing:
    """How the stance foot did in the samples of single support."""

    samples: int
    inside: float
    flat: float
    unloaded: int
    least: float

    @property
    def kept(self) -> bool:
        """Whether zero moment point and foot were where they should be."""
        return self.inside >= PART and self.flat >= PART


def footing(run: hs.Run) -> Footing:
    """Judge the samples of a run that are a millisecond apart."""
    robot, moved = run.robot, run_motion(run)
    zero = zero_moment_point(run, motion=moved)
    grid = np.abs(run.time / 1e-3 - np.round(run.time / 1e-3)) < 1e-6
    grid &= ~np.append(np.diff(run.time) < 1e-6, False)  # of rows at an event, the last
    rows = np.flatnonzero(zero.single_support & grid)
    force = run.contact_force[rows, :, 0]
    feet = [list(foot.contacts) for foot in robot.feet]
    stance = np.argmax([force[:, points].sum(axis=1) for points in feet], axis=0)
    stands = np.append(True, np.diff(stance) == 0)
    rows, force, stance = rows[stands], force[stands], stance[stands]
    margin = zero.foot_margin[rows, stance]
    ends = np.array([[points[0], points[-1]] for points in feet])[stance]
    load = np.take_along_axis(force, ends, axis=1).min(axis=1)
    speed = np.abs(moved.contact_velocity[rows]).max(axis=2)
    still = np.take_along_axis(speed, ends, axis=1).max(axis=1) < REST
    loaded = load > LEAST_LOAD * robot.weight
    return Footing(
        len(rows), float(np.mean(margin >= INSIDE)), float(np.mean(loaded & still)),
        int(np.sum(~loaded)), float(margin.min()),
    )  # fmt: skip


@dataclass(frozen=True)
class Walker:
    """A robot with its gait, and how time is stepped."""

    robot: hs.Robot
    gait: hs.Gait
    method: hs.TimeStepping | hs.EventDriven

    def walk(self, law: hs.Law, impulse: float, phase: float) -> tuple[hs.Run, hs.Push]:
        """Walk, pushed in the third step."""
        start = (2.0 + phase) * self.gait.step_duration
        push = hs.Push(2, force=(10.0 * impulse, 0.0), start=start, duration=0.1)
        options: dict[str, Any] = {"ground": hs.Ground(friction=0.75), "control_period": 1e-3}
        run = hs.simulate(
            self.robot, law, state=self.gait.initial_state, duration=push.end + 7.01,
            method=self.method, pushes=push, **options,
        )  # fmt: skip
        return run, push


def largest(walker: Walker, sign: float, phase: float, rise: float) -> tuple[float, float, str]:
    """Return the largest push that is kept, its least margin, and what failed at the next."""
    law = hs.ZeroMomentPointRegulation(walker.robot, walker.gait)
    kept, least, impulse = 0.0, np.inf, rise
    while impulse < 100.0 * rise:
        run, _ = walker.walk(law, sign * impulse, phase)
        feet, verdict = footing(run), recovery(run, after=7.0)
        if not feet.kept:
            return kept, least, f"inside {feet.inside:.4f}, flat {feet.flat:.4f}"
        if not verdict:
            return kept, least, f"no recovery: {verdict.reason}"
        kept, least, impulse = impulse, min(least, feet.least), impulse + rise
    return kept, least, ""


def tipping(walker: Walker, sign: float, phase: float, rise: float) -> float:
    """Return the least push that tips the foot under computed torque."""
    law = hs.ComputedTorque(walker.robot, walker.gait)
    impulse = rise
    while footing(walker.walk(law, sign * impulse, phase)[0]).unloaded < TIPPED:
        impulse += rise
    return impulse


def main() -> None:
    """Print a line for each phase and direction."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="bravo7")
    parser.add_argument("--phases", type=int, default=10)
    parser.add_argument("--rise", type=float, default=2.0)
    parser.add_argument("--method", choices=METHODS, default="stepping")
    options = parser.parse_args()
    robot = hs.load_robot(options.robot)
    size = standing_height(robot, sole(robot, 0)) / HEIGHT
    gait = hs.optimize_gait(
        robot, step_length=round(0.30 * size, 3), step_duration=round(0.70 * size**0.5, 3)
    )
    walker = Walker(robot, gait, METHODS[options.method])
    for name, sign in (("forwards", 1.0), ("backwards", -1.0)):
        for phase in np.arange(options.phases) / options.phases:
            tips = tipping(walker, sign, phase, 0.5 * options.rise)
            kept, least, why = largest(walker, sign, phase, options.rise)
            print(
                f"{name} at {phase:.2f}: computed torque tips at {tips:.3g} N s; kept up to "
                f"{kept:.3g} N s, least margin {100 * least:.2f} cm; then {why}",
                flush=True,
            )


if __name__ == "__main__":
    main()
