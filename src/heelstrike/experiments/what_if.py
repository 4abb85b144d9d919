"""The same walk again with something changed: what a report tries by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from heelstrike.analysis.diagnosis.changes import Change, Lever, Tried, changes
from heelstrike.analysis.diagnosis.falls import first_cause, walked_on
from heelstrike.analysis.support import walking_steps
from heelstrike.contact.ground import Ground
from heelstrike.errors import HeelstrikeError
from heelstrike.experiments.laws import bent_knees, law_called
from heelstrike.experiments.walk import Case
from heelstrike.experiments.zoo.disturbances import DISTURBANCES, Chance, Effort
from heelstrike.gait import Gait, optimize_gait
from heelstrike.sim import Run, RunStatus
from heelstrike.sim.closed_sets import OnError
from heelstrike.sim.time_stepping.method import TimeStepping
from heelstrike.sim.whole_run import whole

TOLD = {
    "push-forwards": "largest push forwards on the trunk, 0.1 s in mid-step",
    "push-backwards": "largest push backwards",
    "slope-up": "steepest climb, begun unseen",
    "slope-down": "steepest descent, begun unseen",
}
"""Disturbances of the zoo that a report tries, in its words."""
EFFORT = Effort(strides=4, halvings=5)
"""How finely their sizes are searched."""
BY = TimeStepping(step=1e-3)
"""The method of these trials, whatever that of the walk: they take some forty walks."""
PHASE = Chance(phase=0.5, seed=0)
"""When in a step a push begins."""


PAPER = law_called("ComputedTorque")
"""The law of the paper, which walks where none is asked for."""

NO_CONTROLLER = Tried(
    "pushes, slopes, changes",
    "not tried: the file of a run does not hold its controller; “heelstrike report ROBOT” tries "
    "them",
)
NO_GAIT = Tried(
    "pushes, slopes, changes",
    "not tried: only walks by a gait are, for pushes and slopes begin on level ground",
)
"""Why nothing was tried."""


def changed(case: Case, change: Change) -> Case:
    """Return a walk with a change made.

    Raises
    ------
    GaitError
        If there is no gait as asked for.
    """
    value = change.value
    match change.lever:
        case Lever.CONTROLLER:
            return replace(case, law=law_called(str(value)))
        case Lever.FRICTION:
            more = np.maximum(case.ground.friction, value)
            return replace(case, ground=replace(case.ground, friction=more))
        case Lever.TORQUE_LIMIT:
            model = case.robot.model
            ends = {
                "torque_lower": np.minimum(model.torque_lower, -float(value)),
                "torque_upper": np.maximum(model.torque_upper, float(value)),
            }
            return replace(case, robot=replace(case.robot, model=model.replaced(**ends)))
        case Lever.GAIT_FRICTION:
            return replace(case, gait=_designed(case, friction=float(value)))
        case Lever.GAIT_CLEARANCE:
            return replace(case, gait=_designed(case, clearance=float(value)))
        case Lever.GAIT_SPEED:
            return replace(case, gait=_designed(case, faster=float(value)))
        case Lever.GAIT_JOINT_RANGES:
            joint = case.robot.joint_index(change.where)
            room = (
                float(case.robot.model.lower[joint]) + float(value),
                float(case.robot.model.upper[joint]) - float(value),
            )
            return replace(case, gait=_designed(case, joint_ranges={change.where: room}))
        case Lever.TIME_STEP:
            return replace(case, method=replace(case.method, step=float(value)))  # type: ignore[type-var]


def _designed(case: Case, **asked: Any) -> Gait:
    """Design the gait of a walk with something else asked; knees that it keeps bent stay so."""
    gait = case.followed
    assert gait is not None
    asked["step_duration"] = gait.step_duration / asked.pop("faster", 1.0)
    ranges = bent_knees(case.robot, gait)
    for joint, (low, high) in asked.pop("joint_ranges", {}).items():
        kept = ranges.get(joint, (low, high))
        ranges[joint] = (max(low, kept[0]), min(high, kept[1]))
    if ranges:
        asked["joint_ranges"] = ranges
    given: dict[str, Any] = {
        "step_length": gait.step_length,
        "friction": gait.friction,
        "clearance": gait.clearance,
    }
    return optimize_gait(case.robot, **(given | asked))


def tried_beside(case: Case, run: Run) -> tuple[Tried, ...]:
    """Try beside a run what a report shows: what to change if it fell, pushes and slopes.

    Parameters
    ----------
    case : Case
        What the run is one of.
    run : Run
        The run.

    Returns
    -------
    tuple of Tried
        What came of it, or why it was not tried.

    Raises
    ------
    KeyboardInterrupt
        If Ctrl-C ended a walk.
    """
    if run.status is RunStatus.INTERRUPTED or not len(run.time):  # it did not begin
        return ()
    if case.followed is None:
        return (NO_GAIT,)
    fall = first_cause(run, case.followed)
    asked = () if fall is None else changes(run, fall, case.followed)
    return (*try_changes(case, asked), *try_disturbances(case))


def try_changes(case: Case, asked: Sequence[Change]) -> Iterator[Tried]:
    """Walk again with each change by itself, until the first that makes the walk last."""
    for change in asked:
        what = change.lever.value
        try:
            other = changed(case, change)
            # What the law raises was told by the walk itself.
            run = whole(other.run(on_error=OnError.STOP))
        except HeelstrikeError as error:
            yield Tried(what, str(error), None, change)
            continue
        assert other.followed is not None
        fall = first_cause(run, other.followed)
        lasted = walked_on(run, fall)
        steps = f"{len(walking_steps(run))} steps in {float(run.time[-1]):.3g} s"
        yield Tried(what, steps if fall is None else f"{steps}, then {fall}", lasted, change)
        if lasted:
            return


def try_disturbances(case: Case) -> Iterator[Tried]:
    """Find the largest push and slope that a walk stands, one after the other.

    The walk is the one without its own pushes, on level ground of the friction that it has, by time
    stepping at 1 ms.
    """
    friction = float(case.ground.model().friction.min())
    walking = (case.law or PAPER).trial(case.robot, case.followed)
    trial = replace(walking, method=BY, ground=Ground(friction=friction), on_error=OnError.STOP)
    for disturbance in DISTURBANCES:
        if disturbance.name not in TOLD:
            continue
        found = disturbance.measure(trial, PHASE, EFFORT)
        if not found.failed > 0.0:
            yield Tried(
                "pushes and slopes",
                f"not tried: undisturbed it does not walk on for {trial.settling:g} s",
            )
            return
        outcome = str(found)
        if not found.recovered > 0.0:
            outcome = f"none: {found.failed:.2g} {found.unit} is too much"
        yield Tried(TOLD[disturbance.name], outcome)
