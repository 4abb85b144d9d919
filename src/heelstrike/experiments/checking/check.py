"""check_motion(): find what is wrong with a trajectory, walk it, and walk it with tolerances."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.stats import norm, uniform

from heelstrike.analysis.diagnosis.falls import Fall, first_cause
from heelstrike.analysis.stability.trial import Trial
from heelstrike.contact.ground import Ground
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.experiments.campaigns import Campaign, CampaignResults
from heelstrike.experiments.checking.findings import ORDER, Finding, find
from heelstrike.experiments.checking.stance import Placed, placed
from heelstrike.experiments.laws import servo_gains
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.motion import RecordedMotion
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import OnError
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import simulate

WALKING = 0.95
"""Share of the walks with tolerances that have to succeed."""
TOLERANCES: Mapping[str, Any] = {
    "robot.mass *": norm(1.0, 0.025), "robot.inertia *": norm(1.0, 0.025),
    "ground.friction +": uniform(-0.1, 0.2), "ground.roughness": uniform(0.0, 0.005),
    "actuators.delay": [0.0, 1e-3, 2e-3],
}  # fmt: skip
"""What differs in walks with tolerances: masses and inertias (±5 % are two standard deviations),
the ground, the delay of motors."""
KNOTS = 0.02
"""Time between the knots of the reference, in s, where a motion has more of them."""


@dataclass(frozen=True, eq=False)
class Check:
    """The result of a check of a motion."""

    motion: RecordedMotion
    """The motion."""
    findings: tuple[Finding, ...]
    """What is too much, causes first, then what comes nearest to that."""
    placed: Placed | None = None
    """The motion with its trunk and phases; None if its units are wrong."""
    run: Run | None = None
    """The walk of it; None if its units are wrong."""
    fall: Fall | None = None
    """Why that fell."""
    campaign: CampaignResults | None = None
    """Walks of it with tolerances, if they were asked for."""

    @property
    def good(self) -> bool:
        """Whether nothing is wrong with it, and the robot walked it."""
        return not any(each.broken for each in self.findings)

    @property
    def headline(self) -> str:
        """The verdict in one line."""
        if self.good:
            return "nothing is wrong with it: the robot walks it"
        first = self.findings[0]
        return f"no: {first.cause} at {first.time:.3g} s: {first.message}"

    def __str__(self) -> str:
        lines = [self.headline]
        for each in self.findings:
            sign = "✗" if each.broken else "✓"
            lines.append(f"{sign} {each.cause} ({each.used:.2f}): {each.message}")
            if each.broken:
                lines.append(f"    change: {each.advice}")
        if self.campaign is not None:
            lines.append(f"with tolerances: {self.campaign}")
        return "\n".join(lines)


def check_motion(
    robot: Robot,
    motion: RecordedMotion,
    *,
    friction: float = 0.75,
    stiffness: ArrayLike | None = None,
    damping: ArrayLike | None = None,
    trials: int = 0,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Check:
    """Check a trajectory of joints before it reaches hardware.

    Base and contact phases follow from the joints: the foot that stands lies flat. Then inverse
    dynamics; and the motion is walked on hard contact by servos that follow it in time.

    Parameters
    ----------
    robot : Robot
        A robot on two flat feet, all joints driven.
    motion : RecordedMotion
        The trajectory; :func:`~heelstrike.gait.recordings.motion.load_recorded_motion` reads one.
    friction : float
        Of the ground.
    stiffness, damping : float or (nu,) float, optional
        Of the servos (N m/rad, N m s/rad); by default those of bravo7 as the robot's size is.
    trials : int
        Walks with tolerances: mass ±5 %, friction ±0.1, ground ±5 mm, delay up to 2 ms.
    seed : int
        Of those.
    progress : callable, optional
        Told what is being done.

    Returns
    -------
    Check
        What is wrong with it, violations first.

    Raises
    ------
    GaitError
        If the robot is no such one.
    """
    tell = progress or (lambda _: None)
    if motion.seems_degrees(robot):
        largest = float(np.abs(motion.position).max())
        wrong = Finding(
            "degrees", 2.0, 0.0, f"angles up to {largest:.3g} make no sense in rad, but in degrees",
            "say the unit: --unit deg, or a column left_hip [deg]",
        )  # fmt: skip
        return Check(motion, (wrong,))
    ground = Ground(friction=friction)
    tell("inverse dynamics")
    there = placed(robot, motion)
    findings = list(find(robot, there, ground))
    tell("walking it")
    trial = _trial(robot, motion, there, ground, stiffness, damping)
    duration = float(motion.time[-1])
    run = simulate(
        robot, trial.controller, state=trial.state, duration=duration, ground=ground,
        method=trial.method, on_error=OnError.STOP,
    )  # fmt: skip
    fall = first_cause(run)
    if fall is not None:
        findings.append(
            Finding("walk", 2.0, fall.time, f"the robot falls: {fall}", "see what comes before it")
        )
    campaign = None
    if trials:
        tell("walking it with tolerances")
        campaign = Campaign(trial, TOLERANCES, trials, seed, duration=duration).run()
        if fall is None:  # else they fall of what is found already
            findings.append(_tolerated(campaign))
    ranked = sorted(
        findings, key=lambda e: (not e.broken, ORDER.index(e.cause) if e.broken else -e.used)
    )
    return Check(motion, tuple(ranked), there, run, fall, campaign)


def _tolerated(campaign: CampaignResults) -> Finding:
    """Return whether enough of the walks with tolerances succeed."""
    good, count = int(campaign.success.sum()), len(campaign)
    causes = ", ".join(f"{cause} {number} times" for cause, number in campaign.causes.items())
    return Finding(
        "tolerances", (1.0 - good / count) / (1.0 - WALKING), 0.0,
        f"{good} of {count} walks with tolerances succeed, {WALKING:.0%} have to"
        + (f"; the others: {causes}" if causes else ""),
        "stiffer servos, or more margin in what is listed below: the first cause of most falls "
        "names it",
    )  # fmt: skip


def _trial(
    robot: Robot, motion: RecordedMotion, there: Placed, ground: Ground,
    stiffness: ArrayLike | None, damping: ArrayLike | None,
) -> Trial:  # fmt: skip
    """Return the walk of a motion by servos."""
    usual = servo_gains(robot)
    knots = max(int(motion.time[-1] / KNOTS), 3) + 1
    time = np.linspace(0.0, float(motion.time[-1]), knots)
    spline = CubicSpline(time, CubicSpline(motion.time, motion.position)(time))
    pieces = np.moveaxis(spline.c[::-1], 0, -1)  # (pieces, nu, terms), lowest power first
    law = JointFeedback(
        robot, pieces, begins=time[:-1], kp=usual[0] if stiffness is None else stiffness,
        kd=usual[1] if damping is None else damping,
    )  # fmt: skip
    q, v = there.q[0].copy(), there.v[0].copy()
    state = robot.placed(State(q, v), ground)
    longest = max(len(there.phases) - 1, 1)
    distance = float(there.q[-1, 0] - there.q[0, 0])
    return replace(
        Trial(
            robot=robot,
            controller=law,
            state=state,
            step_length=max(distance, 0.0) / longest,
            step_duration=float(motion.time[-1]) / longest,
            ground=ground,
        ),
        undisturbed=1,
    )
