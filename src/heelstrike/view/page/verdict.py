"""What a run comes to: does it walk, how close to each limit, what to change."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.actuation import distance_travelled
from heelstrike.analysis.friction import friction_use
from heelstrike.analysis.slip import max_slip
from heelstrike.analysis.support import walking_steps
from heelstrike.analysis.zero_moment_point import zero_moment_point
from heelstrike.gait.gait import Gait
from heelstrike.robot.sole import soles
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.run import Run
from heelstrike.view.drawing import are_around
from heelstrike.view.style import in_words

Floats = NDArray[np.float64]

REACHED = 1.0 - 1e-6
"""Share of a limit from which it is reached, but for rounding."""
RECENT = 0.5
"""Seconds within which a push before the first limit is named as what may have led to it."""
SLID = 1e-3
"""Metres that a pressed foot may slide before a verdict speaks of it."""


@dataclass(frozen=True)
class Limit:
    """How close a run came to something that it cannot go beyond.

    Attributes
    ----------
    name : str
        What is limited: friction of a foot, its zero moment point, a torque, a joint.
    kind : str
        ``"friction"``, ``"zero moment point"``, ``"torque"`` or ``"joint"``.
    used : float
        Largest share of the limit, 1 at the limit; zero moment point: 0 in the middle of the sole,
        1 at its ends, in single support.
    time : float
        When that was, in s.
    reached : float
        When the limit was first reached (s); infinite if it never was.
    detail : str
        The same in units.
    """

    name: str
    kind: str
    used: float
    time: float
    reached: float
    detail: str


@dataclass(frozen=True)
class Verdict:
    """What a run comes to.

    Attributes
    ----------
    good : bool
        Whether it lasted as long as it was asked to, every contact problem was certified and
        nothing puts its numbers in doubt.
    headline : str
        Does it walk, how close to its limits, what to change: in one line.
    limits : tuple of Limit
        Those that were reached in the order of time, then the others, the closest first.
    advice : tuple of str
        What to change; nothing if nothing has to.
    """

    good: bool
    headline: str
    limits: tuple[Limit, ...]
    advice: tuple[str, ...]


def judge(run: Run, gait: Gait | None = None) -> Verdict:
    """Say what a run comes to.

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait, optional
        The gait that it followed.

    Returns
    -------
    Verdict
        In words and numbers.
    """
    limits = tuple(sorted(_limits(run), key=lambda limit: (limit.reached, -limit.used)))
    advice = tuple(_advice(run, gait, limits))
    good = run.completed and not run.solver.failures and not run.doubt
    parts = [_does(run)]
    if limits:
        first = limits[0]
        if math.isfinite(first.reached):
            parts.append(f"First limit reached: {first.name} at {first.reached:.3g} s.")
        else:
            closest = f"{first.name}, {first.detail} ({_percent(first.used)} used)"
            parts.append(f"No limit is reached; closest comes {closest}.")
    parts.append(f"To change: {advice[0]}" if advice else "Nothing has to change.")
    return Verdict(good, " ".join(parts), limits, advice)


def _does(run: Run) -> str:
    """Whether the robot walks, in a sentence."""
    name = run.robot.name
    if not len(run.time):
        return f"{name} did not begin: {run.message}."
    steps, last = len(walking_steps(run)), float(run.time[-1])
    went = f"{steps} step{'' if steps == 1 else 's'}, {distance_travelled(run):.3g} m"
    if run.completed:
        if steps:
            return f"{name} walks: {went} in {last:.3g} s."
        return f"{name} takes no step in {last:.3g} s."
    if run.status is RunStatus.FELL:
        return f"{name} falls at {last:.3g} s, after {went}."
    return f"{name} does not get to the end ({run.message}), after {went}."


def _limits(run: Run) -> Iterator[Limit]:
    if not len(run.time):
        return
    yield from _of_feet(run)
    yield from _of_motors(run)
    yield from _of_joints(run)


def _of_feet(run: Run) -> Iterator[Limit]:
    use = friction_use(run).foot
    zmp = zero_moment_point(run)
    alone = np.where(zmp.single_support[:, None], zmp.foot_margin, np.nan)
    for i, (foot, sole) in enumerate(zip(run.robot.feet, soles(run.robot), strict=True)):
        if (found := _largest(run, use[:, i])) is not None:
            k, used, reached = found
            time = float(run.time[k])
            detail = f"at {time:.3g} s"
            yield Limit(f"friction of the {in_words(foot.name)}", "friction", used, time, reached,
                        detail)  # fmt: skip
        half = 0.5 * (sole.toe - sole.heel)
        if are_around(run.robot.model.contact_position[list(foot.contacts)]):
            continue  # a wheel has no sole
        if half > 0.0 and (found := _largest(run, 1.0 - alone[:, i] / half)) is not None:
            k, used, reached = found
            time = float(run.time[k])
            margin = max(float(alone[k, i]), 0.0)
            detail = f"{1e3 * margin:.3g} mm from the end of the sole at {time:.3g} s"
            name = f"zero moment point of the {in_words(foot.name)}"
            yield Limit(name, "zero moment point", used, time, reached, detail)


def _of_motors(run: Run) -> Iterator[Limit]:
    model = run.robot.model
    for i, name in enumerate(run.robot.actuator_names):
        torque = run.torque[:, i]
        ends = np.where(torque < 0.0, model.torque_lower[i], model.torque_upper[i])
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(torque == 0.0, 0.0, torque / ends)
        if np.isfinite(ends).any() and (found := _largest(run, share)) is not None:
            k, used, reached = found
            unit = "N m" if model.axis[model.actuator_joint[i], 0] != 0.0 else "N"
            time = float(run.time[k])
            detail = f"{torque[k]:.3g} of {ends[k]:.3g} {unit} at {time:.3g} s".replace("-", "−")
            yield Limit(f"torque of {in_words(name)}", "torque", used, time, reached, detail)


def _of_joints(run: Run) -> Iterator[Limit]:
    model = run.robot.model
    for joint, name in enumerate(run.robot.joint_names):
        low, high = float(model.lower[joint]), float(model.upper[joint])
        if not (np.isfinite(low) and np.isfinite(high) and high > low):
            continue
        angle = run.position[:, joint]
        found = _largest(run, np.abs(angle - 0.5 * (low + high)) / (0.5 * (high - low)))
        if found is None:
            continue
        k, used, reached = found
        unit = "rad" if model.axis[joint, 0] != 0.0 else "m"
        time = float(run.time[k])
        away = max(min(float(angle[k]) - low, high - float(angle[k])), 0.0)
        detail = f"{away:.3g} {unit} from its stop at {time:.3g} s"
        yield Limit(f"range of {in_words(name)}", "joint", used, time, reached, detail)


def _largest(run: Run, share: Floats) -> tuple[int, float, float] | None:
    """Row of the largest share (nt,), the share, and when it first reached 1 (s)."""
    if not np.isfinite(share).any():
        return None
    k = int(np.nanargmax(np.where(np.isfinite(share), share, np.nan)))
    there = np.flatnonzero(share >= REACHED)
    return k, float(share[k]), float(run.time[there[0]]) if len(there) else math.inf


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


WHAT_TO_DO = {
    "friction": (
        "the foot slides, which only more friction or a smaller tangential force prevents",
        "optimize_gait(robot, friction=...) designs a gait for the friction that there is",
    ),
    "zero moment point": (
        "the foot tips about that end of its sole, or rolls over it",
        "optimize_gait(robot, zmp_margin=...) designs a gait that keeps a distance from it",
    ),
    "torque": (
        "the motor gives no more",
        "a gait of smaller step_length, or another step_duration, may ask for less",
    ),
    "joint": (
        "the joint is at its stop",
        "optimize_gait(robot, joint_ranges=...) designs a gait that keeps off it",
    ),
}
"""What it means that a limit is reached, and what to do where a gait was designed, by its kind."""


def _advice(run: Run, gait: Gait | None, limits: tuple[Limit, ...]) -> Iterator[str]:
    """What to change, what came first in time first."""
    if run.solver.failures:
        yield (
            f"{run.solver.failures} contact problems have no certified solution: try another "
            "solver or a smaller step before believing this run."
        )
    if run.doubt:
        yield f"{run.doubt}."
    if run.certificates.energy_gain > 0.0:
        yield (
            f"restitution with friction made {run.certificates.energy_gain:.3g} J in impacts "
            "(Kane's paradox; events ENERGY_GAIN): less restitution or friction, or "
            "TimeStepping(bounded_restitution=True), which scales restitution back there."
        )
    if run.status is RunStatus.DIVERGED:
        yield "Numbers grew beyond all bounds: a smaller time step, or smaller gains."
    first = limits[0] if limits else None
    reached = math.inf if first is None else first.reached
    fell = run.status is RunStatus.FELL
    for push in run.pushes if fell else ():
        if 0.0 <= min(reached, float(run.time[-1])) - push.start <= RECENT:
            newtons = math.hypot(*push.force)
            yield (
                f"the push of {newtons:.3g} N from {push.start:.3g} s on came before the first "
                "limit: a weaker or shorter one, or a controller that steps to catch it."
            )
    if first is not None and reached < math.inf:  # what is reached later may follow from it
        meaning, design = WHAT_TO_DO[first.kind]
        yield f"{first.name} is at its limit at {reached:.3g} s: {meaning}." + (
            f" For the next gait: {design}." if gait is not None else ""
        )
    slid = max_slip(run) if run.robot.nc and len(run.time) else 0.0
    if slid > SLID and (first is None or first.kind != "friction"):
        yield f"a foot slides by {1e3 * slid:.3g} mm while it is pressed: more friction is needed."
    if fell and gait is not None and gait.point_feet:
        yield (
            "the robot stands on points, and no motor acts on its tipping about them: a gait that "
            "is followed in time is lost from step to step; its feet need length, or another "
            "controller is needed."
        )
    if fell and not reached < math.inf:
        yield "no limit was reached before the fall: look at what the controller wanted."
