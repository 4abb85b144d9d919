"""What a run comes to: does it walk, why did it fall, how close to each limit, what to change."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from heelstrike.analysis.actuation import distance_travelled
from heelstrike.analysis.diagnosis.changes import Change, Lever, Tried, changes
from heelstrike.analysis.diagnosis.falls import Fall, first_cause, walked_on
from heelstrike.analysis.diagnosis.limits import Limit, limits
from heelstrike.analysis.diagnosis.symptoms import Cause, Symptom
from heelstrike.analysis.support import walking_steps
from heelstrike.field_texts import dataclass
from heelstrike.gait.gait import Gait
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import has_length, soles
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.push import Push
from heelstrike.sim.run import AnyRun, Run
from heelstrike.view.style import in_words
from heelstrike.wording import counted

if TYPE_CHECKING:
    from heelstrike.robot.spatial.robot import SpatialRobot

SHOWN = 4
"""Links of the chain of a fall that its sentence has."""


@dataclass(frozen=True)
class Verdict:
    """What a run comes to."""

    good: bool
    """Whether it lasted as long as it was asked to, stayed up, every contact problem was
    certified, no impact made energy and nothing puts its numbers in doubt."""
    headline: str
    """Does it walk, how close to its limits or why it fell, what to change: in one line."""
    limits: tuple[Limit, ...]
    """Those that were reached in the order of time, then the others, the closest first; of a fall
    up to its first cause."""
    advice: tuple[str, ...]
    """What to change, what helps most first; nothing if nothing has to."""
    fall: Fall | None = None
    """Why it fell, what came first in time first."""
    changes: tuple[Change, ...] = ()
    """The advice as data that a program can follow."""
    tried: tuple[Tried, ...] = ()
    """What was tried beside the run."""


def judge(run: Run, gait: Gait | None = None, *, tried: Sequence[Tried] = ()) -> Verdict:
    """Say what a run comes to.

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait, optional
        The gait that it followed.
    tried : sequence of Tried
        What was tried beside it: changes, pushes, slopes.

    Returns
    -------
    Verdict
        In words and numbers.
    """
    fall = first_cause(run, gait)
    found = limits(run, until=math.inf if fall is None else fall.time)
    asked = () if fall is None else changes(run, fall, gait)
    doubts = tuple(_doubts(run))
    advice = (*doubts, *advice_of(asked, tried))
    if fall is not None and not asked:
        advice += (_without_a_change(run, fall, gait),)
    return verdict_of(
        run, fall, found, advice, asked, tried, does=_does(run, fall), sound=not doubts
    )


def verdict_of(
    run: AnyRun, fall: Fall | None, found: tuple[Limit, ...], advice: tuple[str, ...],
    asked: Sequence[Change], tried: Sequence[Tried], *, does: str, sound: bool,
) -> Verdict:  # fmt: skip
    """Put a verdict together.

    Parameters
    ----------
    run : Run or SpatialRun
        The run.
    fall : Fall or None
        Why it fell.
    found : tuple of Limit
        How close it came to its limits.
    advice : tuple of str
        What to change.
    asked : sequence of Change
        The same as data.
    tried : sequence of Tried
        What was tried beside it.
    does : str
        Whether the robot does what it is to do, in a sentence.
    sound : bool
        Whether nothing puts its numbers in doubt.

    Returns
    -------
    Verdict
        In words and numbers.
    """
    reached = bool(found) and math.isfinite(found[0].reached)
    if fall is None and reached and isinstance(run, Run):
        advice += (_no_reserve(found[0]),)
    good = walked_on(run, fall) and sound
    parts = [does]
    if fall is not None:
        parts.append(_why(run, fall))
    elif reached:
        parts.append(f"First limit reached: {found[0].name} at {found[0].reached:.3g} s.")
    elif found:
        closest = f"{found[0].name}, {found[0].detail} ({_percent(found[0].used)} used)"
        parts.append(f"No limit is reached. Tightest margin: {closest}.")
    if advice:
        parts.append(f"To change: {advice[0]}")
    elif good and not reached:
        parts.append(f"{NOTHING_TO_CHANGE}.")
    if good and (tried or isinstance(run, Run)):
        parts.append(f"{_what_was_tried(tried)}.")
    return Verdict(good, " ".join(parts), found, advice, fall, tuple(asked), tuple(tried))


def _does(run: Run, fall: Fall | None) -> str:
    """Whether the robot walks, in a sentence."""
    name = run.robot.name
    if not len(run.time):
        return f"{name} did not begin: {run.message}."
    steps, last = len(walking_steps(run)), float(run.time[-1])
    went = f"{counted(steps, 'step', 'steps')}, {distance_travelled(run):.3g} m"
    if run.completed:
        if fall is not None:
            return f"{name} is falling when its time is up at {last:.3g} s, after {went}."
        if steps:
            return f"{name} walks: {went} in {last:.3g} s."
        return f"{name} takes no step in {last:.3g} s."
    if run.status is RunStatus.FELL:
        return f"{name} falls at {last:.3g} s, after {went}."
    if run.status is RunStatus.STOPPED:
        return f"{name} does not go on after {went}: {run.message}."
    return f"{name} does not get to the end ({run.message}), after {went}."


def _why(run: AnyRun, fall: Fall) -> str:
    """First cause, what pushed before it, and what followed, in sentences."""
    first = fall.chain[0]
    sentence = f"First cause: {told(first, run.robot)}"
    sentence += "".join(f", {_after(push, first.time)}" for push in fall.pushes[-1:])
    after = [FOLLOWS[each.cause] for each in fall.chain[1:SHOWN]]
    return sentence + (f"; then {', '.join(after)}." if after else ".")


def happened(verdict: Verdict, run: AnyRun) -> list[tuple[float, str]]:
    """Say what went wrong in a run, each with its time (s), in order; nothing if nothing did."""
    if verdict.fall is None:
        return []
    rows = [(push.start, pushed(push, run.robot)) for push in verdict.fall.pushes]
    rows += [(each.time, told(each, run.robot, when=False)) for each in verdict.fall.chain]
    rows.append((verdict.fall.end, run.message))
    return sorted(rows, key=lambda row: row[0])


def pushed(push: Push, robot: Robot | SpatialRobot) -> str:
    """Say how hard a push was, on what, and for how long."""
    link = in_words(robot.link_names[push.place(robot)[0]])
    newtons = math.hypot(*push.force)
    return f"a push of {newtons:.3g} N on the {link}, for {push.duration:.3g} s"


def _after(push: Push, time: float) -> str:
    newtons = math.hypot(*push.force)
    return f"{1e3 * (time - push.start):.0f} ms after a push of {newtons:.3g} N began"


NOTHING_TO_CHANGE = "Limits, falls and contact certificates were checked: nothing needs to change"
"""What is said of a walk without advice."""

FOLLOWS = {
    Cause.SLIPPED: "a foot slides",
    Cause.TIPPED_FORWARD: "it tips forward",
    Cause.TIPPED_BACK: "it tips back",
    Cause.TIPPED_SIDEWAYS: "it tips to its side",
    Cause.SCUFFED: "a foot hits the ground in mid-swing",
    Cause.LATE_TOUCHDOWN: "the next foot is late",
    Cause.TORQUE_LIMIT: "torques reach their limits",
    Cause.SPEED_LIMIT: "motors reach their speed",
    Cause.JOINT_STOP: "a joint reaches its stop",
    Cause.LEG_GAVE_WAY: "a leg gives way",
    Cause.CONTROLLER: "a joint leaves the gait",
    Cause.NUMERICAL: "the simulation ends",
    Cause.UNKNOWN: "nothing else is seen",
}
"""What follows from a first cause, in short."""


def told(symptom: Symptom, robot: Robot | SpatialRobot, *, when: bool = True) -> str:
    """Say what went wrong, where and, unless that is told already, when, with its numbers."""
    given: dict[str, str] = {name: f"{value:.3g}" for name, value in symptom.evidence.items()}
    where = in_words(symptom.where)
    at = f" at {symptom.time:.3f} s" if when else ""

    def number(name: str, scale: float) -> float:
        return scale * symptom.evidence.get(name, 0.0)

    in_space = not isinstance(robot, Robot)
    on_soles = isinstance(robot, Robot) and any(has_length(robot, sole) for sole in soles(robot))
    match symptom.cause:
        case Cause.SLIPPED:
            friction = (
                f", on a ground of friction {given['friction']}" if "friction" in given else ""
            )
            return f"the {where} slides{at} by {number('distance_m', 1e3):.3g} mm{friction}"
        case Cause.TIPPED_FORWARD | Cause.TIPPED_BACK | Cause.TIPPED_SIDEWAYS if in_space:
            side = "left" if number("left_m", 1.0) > 0.0 else "right"
            ways = {Cause.TIPPED_FORWARD: "forwards", Cause.TIPPED_BACK: "backwards"}
            way = ways.get(symptom.cause, f"to its {side}")
            return f"it tips {way} over the edge of its support polygon{at}"
        case Cause.TIPPED_FORWARD:
            over = f"the {where} tips over its toe" if on_soles else "it tips forward too fast"
            return f"{over}{at}"
        case Cause.TIPPED_BACK:
            over = f"the {where} tips over its heel" if on_soles else "it tips too slowly, or back,"
            return f"{over}{at}"
        case Cause.SCUFFED:
            rise = number("rise_m", 1e3)
            higher = f", where the ground is {rise:.3g} mm higher" if rise > 0.5 else ""
            return (
                f"the {where} hits the ground in mid-swing{at}, at {given['speed_m_s']} m/s and "
                f"{number('step_phase', 100.0):.0f} % of its step{higher}"
            )
        case Cause.LATE_TOUCHDOWN:
            return f"the {where} was due{at} and is {number('gap_m', 1e3):.3g} mm above the ground"
        case Cause.TORQUE_LIMIT | Cause.SPEED_LIMIT:
            by = " at its speed" if symptom.cause is Cause.SPEED_LIMIT else ""
            missed = symptom.evidence["missed_rad"]
            misses = f", and the joint misses the gait by {missed:.2g} rad" if missed > 0.0 else ""
            limit = abs(symptom.evidence["limit_Nm"])
            return f"the motor of the {where} gives all of its {limit:.3g} N m{by}{at}{misses}"
        case Cause.JOINT_STOP:
            return f"the {where} is pressed against its stop{at}"
        case Cause.LEG_GAVE_WAY:
            return f"the leg on the {where} folds{at}, to {given['length_share']} of its length"
        case Cause.CONTROLLER if where:
            return f"the controller lets the {where} run away{at}, or drives it"
        case Cause.CONTROLLER:
            return f"the controller fails{at}"
        case Cause.NUMERICAL:
            return (
                f"the numbers fail{at}: they grow beyond all bounds, or no contact forces can be "
                "certified"
            )
    return "nothing that is known to make walkers fall was seen before the end"


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def _what_was_tried(tried: Sequence[Tried]) -> str:
    if not tried:
        return "No push and no slope was tried"
    return "Tried beside it: " + "; ".join(f"{each.what}: {each.outcome}" for each in tried)


def _doubts(run: Run) -> Iterator[str]:
    """What puts the numbers of a run in doubt, and what to do about it."""
    if run.solver.failures:
        yield (
            f"{counted(run.solver.failures, 'contact problem has', 'contact problems have')} no "
            "certified solution: try another solver or a smaller step before you trust this run."
        )
    if run.doubt:
        yield f"{run.doubt}."
    if run.certificates.energy_gain > 0.0:
        yield (
            f"restitution with friction made {run.certificates.energy_gain:.3g} J in impacts "
            "(Kane's paradox; events ENERGY_GAIN): less restitution or friction, or "
            "TimeStepping(bounded_restitution=True), which scales restitution back there."
        )


def advice_of(asked: Sequence[Change], tried: Sequence[Tried]) -> Iterator[str]:
    """What to change, the change that was seen to work first."""
    outcome = {each.change: each for each in tried if each.change is not None}
    ranked = sorted(asked, key=lambda each: each in outcome and outcome[each].lasted is not True)
    for each in ranked:
        seen = _seen(outcome.get(each))
        reason = f": {each.reason}" if each.reason else ""
        yield f"{_in_words(each)}{reason}.{seen}"


def on_points(run: Run) -> str:
    """Laws for point feet, without the one that just fell."""
    law = run.final.identity.get("controller", "") if run.final is not None else ""
    if law.endswith(".stepping_constraints"):
        return "the law that it had steps where balance needs it, and was at its end"
    stepping = "by hs.SteppingConstraints, which steps where balance needs it"
    if law.endswith(".virtual_constraints"):
        return f"walk it {stepping}"
    return f"walk it by hs.VirtualConstraints, or {stepping}"


RESERVE = {
    "friction": "optimize_gait(robot, friction=...) for less than there is keeps some",
    "zero moment point": "optimize_gait(robot, zmp_margin=...) keeps some",
    "torque": "a gait of smaller step_length, or another step_duration, may ask for less",
    "speed": "a slower gait, or another reduction of the motor, keeps some",
    "joint": "optimize_gait(robot, joint_ranges=...) keeps some",
}
"""What gives a walk that lasts a reserve, by the kind of limit that it reaches."""


def _no_reserve(limit: Limit) -> str:
    return (
        f"the walk lasts, but {limit.name} has no reserve at {limit.reached:.3g} s: "
        f"{RESERVE[limit.kind]}."
    )


def _seen(tried: Tried | None) -> str:
    if tried is None:
        return ""
    if tried.lasted is None:
        return f" Not tried: {tried.outcome}."
    return f" Tried: it {'walks' if tried.lasted else 'does not help'}, {tried.outcome}."


def _in_words(change: Change) -> str:
    value, where = change.value, in_words(change.where)
    number = f"{value:.3g}" if isinstance(value, float) else value
    match change.lever:
        case Lever.CONTROLLER:
            return f"walk it by hs.{value}(robot, gait)"
        case Lever.FRICTION:
            return f"a friction of at least {number} under the feet"
        case Lever.TORQUE_LIMIT:
            return f"motors of at least {number} N m"
        case Lever.GAIT_JOINT_RANGES:
            return (
                f"optimize_gait(robot, joint_ranges=...) that stays {number} rad off the stops of "
                f"the {where}"
            )
        case Lever.GAIT_SPEED:
            return f"a gait at {number} of this speed: optimize_gait(robot, step_duration=...)"
        case Lever.TIME_STEP:
            return f"a time step of {number} s"
    return f"optimize_gait(robot, {change.lever.value.removeprefix('gait: ')}={number})"


def _without_a_change(run: Run, fall: Fall, gait: Gait | None) -> str:
    if fall.cause is Cause.CONTROLLER:
        at = f" of the {in_words(fall.where)}" if fall.where else ""
        return f"mend the sign, the gain or the number{at} in the controller."
    if fall.cause is Cause.NUMERICAL:
        return "another method, as hs.TimeStepping(step=1e-4): this one found no way on."
    if gait is None:
        return (
            "no gait is known here: if it follows one, a report that has it (gait=, or gait.json "
            "beside the run) says more."
        )
    if gait.point_feet:
        return (
            "the robot stands on points, and no motor acts on its tipping about them: "
            f"{on_points(run)}."
        )
    if fall.cause is Cause.UNKNOWN:
        return "nothing is known that would help."
    return "a controller that steps to catch it; the one it had was at its end."
