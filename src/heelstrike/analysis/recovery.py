"""Judge, strictly, whether a robot recovered its walk after a push.

A run that completes is no recovery by itself: a robot that kneels, or walks backwards, completes.
"""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.motion import Motion, run_motion
from heelstrike.analysis.support import walking_steps
from heelstrike.dynamics import leg_joints
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.run import Run

# Steps over which a speed is taken, and the time (s) of a robot that takes none.
STEPS = 2
STANDING = 1.0
# A speed within this (m/s) of the normal one is normal, however slow that is.
SLOW = 0.05


@dataclass(frozen=True, kw_only=True)
class Recovery:
    """Whether a robot recovered from a push."""

    recovered: bool
    """Whether it recovered, strictly."""
    reason: str
    """What it did not do; nothing if it recovered."""
    hip: float
    """Lowest height of the hip above the ground from the push on, as a part of that before it."""
    pitch: float
    """Largest angle of the trunk from the push on, from the mean before it, without its sign, in
    rad."""
    speed: float
    normal_speed: float
    """speed, normal_speed: Forward speed of the centre of mass when it is judged, and before the
    push, in m/s; the former is NaN of a run that does not last."""

    def __bool__(self) -> bool:
        return self.recovered


# More arguments than eight: what is strict is a user's to say.
def recovery(
    run: Run,
    *,
    pushed: tuple[float, float] | None = None,
    normal_speed: float | None = None,
    after: float = 7.0,
    hip: float = 0.65,
    pitch: float = 0.6,
    speed: float = 0.25,
) -> Recovery:
    """Judge whether a robot recovered from the pushes of a run.

    It did if the run went on for some time after them, the hip stayed up and the trunk upright, and
    the robot then goes forwards about as fast as before. That a push is survived does not mean that
    smaller ones are: who looks for the largest one tries those, too.

    Parameters
    ----------
    run : Run
        The run.
    pushed : tuple of float, optional
        When the disturbance began and ended, in s; by default the first and the last instant of
        the pushes of the run.
    normal_speed : float, optional
        Forward speed in m/s; by default the mean over the whole steps before the disturbance, or
        zero of a robot that took none.
    after : float
        Seconds after the disturbance at which the speed is judged: the mean over the two steps
        before, or over the last second of a robot that has stopped stepping.
    hip : float
        Least height of the hip, the mean of the legs' first joints, above the ground below it, as
        a part of the mean before the disturbance.
    pitch : float
        Largest angle of the trunk, in rad, from how it leant on average before the disturbance
        (from upright if there is no time before): a gait may lean all the time.
    speed : float
        Largest difference of the speed to the normal one, as a part of it; less than 0.05 m/s is
        none.

    Returns
    -------
    Recovery
        True in a condition if it recovered.

    Raises
    ------
    SimulationError
        If the run has no push and no disturbance is named, or no time before it.
    """
    begin, end = _window(run, pushed)
    motion = run_motion(run)
    before = run.time < begin + 1e-9
    if before.sum() < 2 and normal_speed is None:
        raise SimulationError(
            f"there is no walk before the push at {begin:.6g} s to compare with: push later, or "
            "give normal_speed"
        )
    from_then = run.time >= begin - 1e-9
    height, angle = _hip_height(run, motion), _trunk_angle(run, motion)
    usual = float(np.mean(height[before])) if before.any() else float(height[0])
    judged = end + after
    lowest = float(np.min(height[from_then], initial=np.inf)) / usual
    leant = float(np.mean(angle[before])) if before.any() else 0.0
    largest = float(np.max(np.abs(angle[from_then] - leant), initial=0.0))
    normal = _speed(run, motion, begin, -np.inf) if normal_speed is None else normal_speed
    lasted = run.completed and run.time[-1] >= judged - 1e-6
    now = _speed(run, motion, judged, end) if lasted else float("nan")
    reasons = []
    if not run.completed:
        reasons.append(f"the run did not complete: {run.message}")
    elif not lasted:
        reasons.append(
            f"the run ends at {run.time[-1]:.6g} s, before it is judged at {judged:.6g} s"
        )
    if lowest < hip:
        reasons.append(f"the hip sank to {lowest:.3g} of its height")
    if largest >= pitch:
        reasons.append(f"the trunk leant by {largest:.3g} rad")
    if lasted and not abs(now - normal) <= max(speed * abs(normal), SLOW):
        reasons.append(f"the walk changed: its speed is {now:.3g} m/s instead of {normal:.3g} m/s")
    return Recovery(
        recovered=not reasons, reason="; ".join(reasons), hip=lowest, pitch=largest,
        speed=now, normal_speed=normal,
    )  # fmt: skip


def _window(run: Run, pushed: tuple[float, float] | None) -> tuple[float, float]:
    """Return when the disturbance began and ended."""
    if not len(run.time):
        raise SimulationError(f"the run has no rows ({run.message}): there is nothing to judge")
    if pushed is not None:
        return float(pushed[0]), float(pushed[1])
    if not run.pushes:
        raise SimulationError(
            "nothing pushed the robot in this run: say when it was disturbed, pushed=(begin, end)"
        )
    return min(each.start for each in run.pushes), max(each.end for each in run.pushes)


def _hips(run: Run) -> list[int]:
    """Return the links of the legs' first joints; of a robot without motors its trunk."""
    hips = [leg[0] for leg in leg_joints(run.robot) if leg]
    return hips or [int(run.robot.model.pivot)]


def _hip_height(run: Run, motion: Motion) -> Floats:
    place = motion.link_origin[:, _hips(run)].mean(axis=1)
    height: Floats = place[:, 1] - run.ground.height(place[:, 0])
    return height


def _trunk_angle(run: Run, motion: Motion) -> Floats:
    first = _hips(run)[0]
    trunk = int(run.robot.model.parent[first])
    angle: Floats = motion.link_angle[:, trunk if trunk >= 0 else first]
    return angle


def _speed(run: Run, motion: Motion, until: float, since: float) -> float:
    """Return the mean speed over the last whole steps before a time; standing, over a second.

    A robot stands that has taken no step for longer than two of these take.
    """
    landings = [s.touchdown for s in walking_steps(run) if since <= s.touchdown <= until + 1e-9]
    x = motion.center_of_mass[:, 0]
    ends = max(until - STANDING, float(run.time[0]), since), until
    if len(landings) >= 2:
        count = min(len(landings) - 1, STEPS)
        first, last = landings[-1 - count], landings[-1]
        stands = until - last > STEPS * (last - first) / count
        ends = ends if stands else (first, last)
    places = np.interp(ends, run.time, x)
    return float((places[1] - places[0]) / (ends[1] - ends[0]))
