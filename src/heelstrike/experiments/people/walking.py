"""A motion walked event-driven, by the law that follows it."""

from __future__ import annotations

from collections.abc import Callable

from heelstrike.analysis.support import walking_steps
from heelstrike.contact.ground import Ground
from heelstrike.control import MotionTracking
from heelstrike.field_texts import dataclass
from heelstrike.gait.motion.motion import Motion
from heelstrike.robot.robot import Robot
from heelstrike.sim import EventDriven
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import simulate

GAINS = ((400.0, 40.0), (1600.0, 80.0))
"""Gains of the law (1/s², 1/s) that are tried, one after the other, until one walks all steps."""
OVER = 0.25
"""Share of a step that is walked after the last, which has landed by then."""


@dataclass(frozen=True, eq=False)
class Walked:
    """How many steps of a motion a robot walks."""

    steps: int
    """Whole steps that it walked."""
    asked: int
    """Steps that it was to walk."""
    gains: tuple[float, float]
    """Gains kp and kd of the law (1/s², 1/s)."""
    run: Run
    """The walk."""

    @property
    def all_of_them(self) -> bool:
        """Whether it walked all steps."""
        return self.steps >= self.asked


def walked(
    robot: Robot, motion: Motion, *, steps: int = 20,
    progress: Callable[[float], None] | None = None,
) -> Walked:  # fmt: skip
    """Walk a motion on hard contact, event by event, with MotionTracking.

    Parameters
    ----------
    robot : Robot
        The robot.
    motion : Motion
        The motion: one step.
    steps : int
        Steps to walk.
    progress : callable, optional
        Told the fraction of a walk that is done.

    Returns
    -------
    Walked
        The first walk that lasts, or the longest.
    """
    found = []
    for kp, kd in GAINS:
        run = simulate(
            robot, MotionTracking(robot, motion, kp=kp, kd=kd), state=motion.initial_state,
            duration=(steps + OVER) * motion.duration, method=EventDriven(),
            ground=Ground(friction=motion.friction), progress=progress,
        )  # fmt: skip
        # What lands as it falls is no step: nothing of the last one before the end counts then.
        up = float(run.time[-1]) - (0.0 if run.completed else motion.duration)
        count = sum(each.touchdown <= up for each in walking_steps(run))
        found.append(Walked(min(count, steps), steps, (kp, kd), run))
        if found[-1].all_of_them:
            break
    return max(found, key=lambda each: each.steps)
