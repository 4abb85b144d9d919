"""What a trial of a campaign came to."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from heelstrike.analysis.diagnosis.falls import first_cause, walked_on
from heelstrike.field_texts import dataclass
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.run import Run

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait

REFUSED, CRASHED = "refused", "crashed"
"""Status of a trial that could not begin, and of one whose worker died of it, twice."""


@dataclass(frozen=True)
class Outcome:
    """What a trial of a campaign came to."""

    status: str
    """How its run ended, a value of :class:`~heelstrike.RunStatus`; ``"refused"`` if it could not
    begin, ``"crashed"`` if the process died in which it ran."""
    message: str
    """The same in a person's words."""
    success: bool
    """Whether the run lasted as long as it was asked to, and the robot is up."""
    cause: str = ""
    """First cause of a fall, a value of
    :class:`~heelstrike.analysis.diagnosis.symptoms.Cause`; nothing if there was none."""
    cause_time: float = math.nan
    """When that began, in s."""
    where: str = ""
    """Foot or joint at which it did."""
    chain: str = ""
    """The first cause and what followed from it, with commas between."""
    time: float = math.nan
    """When the run ended, in s."""
    distance: float = math.nan
    """How far the robot got, in m; NaN of one that does not float."""
    saturations: int = 0
    """Times that a torque was clipped to its limit."""
    penetration: float = math.nan
    """Deepest penetration of a contact point, in m."""
    residual: float = math.nan
    """Largest relative residual of the contact problems."""

    @property
    def given_up(self) -> bool:
        """Whether it was ended before its time because it took too long."""
        return self.status == RunStatus.INTERRUPTED.value


def judged(run: Run, gait: Gait | None) -> Outcome:
    """Judge the run of a trial, as the report does.

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait, optional
        The gait that it followed.
    """
    fall = first_cause(run, gait)
    certificates = run.certificates
    floats = run.robot.floating and len(run.time)
    return Outcome(
        status=run.status.value,
        message=run.message,
        success=walked_on(run, fall),
        cause="" if fall is None else fall.cause.value,
        cause_time=math.nan if fall is None else fall.time,
        where="" if fall is None else fall.where,
        chain="" if fall is None else ", ".join(each.cause.value for each in fall.chain),
        time=float(run.time[-1]) if len(run.time) else 0.0,
        distance=float(run.position[-1, 0] - run.position[0, 0]) if floats else math.nan,
        saturations=run.saturations,
        penetration=certificates.penetration,
        residual=max(
            certificates.complementarity, certificates.cone, certificates.non_penetration
        ),
    )  # fmt: skip
