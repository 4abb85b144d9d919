"""What a run in space comes to: does it stay up, why did it fall, how close to each limit."""

from __future__ import annotations

import math
from collections.abc import Iterator

from heelstrike.analysis.diagnosis.falls import Fall
from heelstrike.analysis.diagnosis.symptoms import Cause
from heelstrike.analysis.spatial.diagnosis import first_cause_in_space, spatial_limits
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.view.page.verdict import Verdict, verdict_of
from heelstrike.wording import counted

TO_CHANGE = {
    Cause.SLIPPED: "more friction under the feet, or less push to the side.",
    Cause.TIPPED_FORWARD: "a controller that steps, or bends, to catch it: a posture cannot.",
    Cause.TORQUE_LIMIT: "stronger motors, or a posture that asks for less torque.",
    Cause.SPEED_LIMIT: "another reduction of the motor, or a slower motion.",
    Cause.CONTROLLER: "mend the controller: the message of the run says what is wrong with it.",
    Cause.JOINT_STOP: "a wider range of the joint, or a motion that keeps away from its stop.",
}
"""What would help, by the first cause."""
TO_CHANGE |= dict.fromkeys(
    (Cause.TIPPED_BACK, Cause.TIPPED_SIDEWAYS), TO_CHANGE[Cause.TIPPED_FORWARD]
)
SMALLER = 10.0
"""By how much a step is smaller that may find a way on."""
UNKNOWN = "nothing is known that would help."


def judge_in_space(run: SpatialRun) -> Verdict:
    """Say what a run in space comes to.

    Parameters
    ----------
    run : SpatialRun
        The run, of at least one row.

    Returns
    -------
    Verdict
        In words and numbers, as :func:`heelstrike.view.page.verdict.judge` gives it.
    """
    fall = first_cause_in_space(run)
    found = spatial_limits(run, until=math.inf if fall is None else fall.time)
    doubts = tuple(_doubts(run))
    advice = doubts if fall is None else (*doubts, _to_change(run, fall))
    return verdict_of(run, fall, found, advice, (), (), does=_does(run, fall), sound=not doubts)


def _to_change(run: SpatialRun, fall: Fall) -> str:
    """What would help."""
    if fall.cause is not Cause.NUMERICAL:
        return TO_CHANGE.get(fall.cause, UNKNOWN)
    step = getattr(run.method, "step_length", None)
    smaller = f", as hs.TimeStepping(step={step / SMALLER:.3g})" if step else ""
    return f"a smaller step{smaller}: this one found no way on."


def _does(run: SpatialRun, fall: Fall | None) -> str:
    name, last = run.robot.name, float(run.time[-1])
    if run.completed:
        if fall is not None:
            return f"{name} is falling when its time is up at {last:.3g} s."
        stands = run.robot.floating and run.robot.feet
        return f"{name} {'stays up' if stands else 'moves'} for {last:.3g} s."
    if run.status is RunStatus.FELL:
        return f"{name} falls at {last:.3g} s."
    return f"{name} does not get to the end: {run.message}."


def _doubts(run: SpatialRun) -> Iterator[str]:
    if run.certificates.uncertified:
        yield (
            f"{counted(run.certificates.uncertified, 'step is', 'steps are')} certified to 1e-6 "
            "only, not to 1e-9: a smaller step may do better."
        )
    if run.certificates.energy_gain > 0.0:
        yield (
            f"restitution with friction made {run.certificates.energy_gain:.3g} J in impacts "
            "(Kane's paradox): less restitution or friction."
        )
