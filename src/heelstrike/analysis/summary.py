"""The figures of a run on one page, for a person and for a program."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heelstrike.analysis.actuation import cost_of_transport
from heelstrike.analysis.diagnosis.falls import first_cause
from heelstrike.analysis.friction import friction_use
from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.support import double_support_fraction, walking_steps
from heelstrike.analysis.told_summary import (
    COST_LINES,
    FRICTION_LINES,
    GAIN_LINE,
    OF_A_GAIN,
    UNKNOWN,
    ToldSummary,
    common_figures,
    in_lines,
)
from heelstrike.analysis.tracking import tracking_error
from heelstrike.analysis.zero_moment_point import zero_moment_point, zero_moment_point_limits
from heelstrike.field_texts import dataclass
from heelstrike.sim.run import Run

if TYPE_CHECKING:
    from heelstrike.gait.gait import Gait


@dataclass(frozen=True)
class GaitFigures:
    """The gait that a run followed."""

    step_length_m: float
    step_duration_s: float
    """step_length_m, step_duration_s: Length and duration of one step."""
    cost_N2m2s: float  # noqa: N815 - units keep their capitals
    """∫ ΓᵀΓ dt of one step of the gait as designed (paper eq. 40)."""


@dataclass(frozen=True, kw_only=True)
class Summary(ToldSummary):
    """Figures of a run. Those that do not exist for it are NaN (null in JSON)."""

    first_cause: str
    """Why it did not go well, what came first in time first; nothing if it did."""
    steps: int
    """Walking steps taken: touchdowns of alternating feet."""
    distance_m: float
    """How far the centre of mass moved along x."""
    gait: GaitFigures | None
    """The gait that the run followed, if it was given."""
    tracking_rms_rad: float
    tracking_max_rad: float
    """tracking_rms_rad, tracking_max_rad: Error of the actuated joints against the gait."""
    zmp_min_m: float
    zmp_max_m: float
    """zmp_min_m, zmp_max_m: Range of the zero moment point of the stance foot in single support,
    ahead of the ankle's projection onto the sole."""
    zmp_limits_m: tuple[float, float]
    """Heel and toe in the same frame."""
    zmp_margin_min_m: float
    """Least distance of that zero moment point to the ends of the sole's touching points."""
    friction_use_max: float
    """Largest |f_t| / (μ f_n) of a foot."""
    complementarity_max: float
    """Worst value over all steps, from the certificates; it is relative."""
    double_support_fraction: float
    """Share of the time in which both feet push."""
    doubt: str = ""
    """Why the run may mean little though it was completed; nothing if nothing is known."""

    @property
    def speed(self) -> float:
        """Mean speed of the centre of mass along x, in m/s."""
        return self.distance_m / self.duration_s if self.duration_s > 0.0 else UNKNOWN

    def lines(self) -> list[tuple[str, str]]:
        """Label and value of every line of the table a person reads."""
        needless = dict.fromkeys(OF_A_GAIT, self.gait is None) | {
            OF_A_GAIN: not self.energy_gain_J > 0.0,
            "first cause": not self.first_cause,
            "doubt": not self.doubt,
        }
        return in_lines(self, LINES, needless)


def summarize(run: Run, *, gait: Gait | None = None) -> Summary:
    """Compute the figures of a run.

    Parameters
    ----------
    run : Run
        The run.
    gait : Gait, optional
        The gait it followed, for the tracking error.

    Returns
    -------
    Summary
        Figures with units in their names.

    Raises
    ------
    GaitError
        If the gait does not fit the robot of the run.
    """
    motion = run_motion(run)
    fall = first_cause(run, gait)
    tracking = tracking_error(run, gait) if gait is not None and len(run.time) else None
    zmp = zero_moment_point(run, motion=motion)
    margin = np.where(zmp.single_support[:, None], zmp.foot_margin, np.nan)
    transport = cost_of_transport(run, motion=motion)
    return Summary(
        **common_figures(run, transport),
        first_cause="" if fall is None else str(fall),
        steps=len(walking_steps(run)),
        distance_m=transport.distance,
        gait=None
        if gait is None
        else GaitFigures(float(gait.step_length), float(gait.step_duration), float(gait.cost)),
        tracking_rms_rad=UNKNOWN if tracking is None else tracking.rms,
        tracking_max_rad=UNKNOWN if tracking is None else tracking.max,
        zmp_min_m=float(np.fmin.reduce(zmp.stance, initial=UNKNOWN)),
        zmp_max_m=float(np.fmax.reduce(zmp.stance, initial=UNKNOWN)),
        zmp_limits_m=zero_moment_point_limits(run.robot),
        zmp_margin_min_m=float(np.fmin.reduce(margin, axis=None, initial=UNKNOWN)),
        friction_use_max=friction_use(run).max,
        complementarity_max=run.certificates.complementarity,
        doubt=run.doubt,
        double_support_fraction=double_support_fraction(run),
    )


# What a person reads, in letters that the consoles of Windows have.
LINES = {
    "status": "{s.status}",
    "first cause": "{s.first_cause}",
    "doubt": "{s.doubt}",
    "steps": "{s.steps}",
    "distance": "{s.distance_m:.4} m in {s.duration_s:.4} s ({s.speed:.3} m/s)",
    "gait": "{s.gait.step_length_m:.3} m in {s.gait.step_duration_s:.3} s a step, "
    "torque cost {s.gait.cost_N2m2s:.4} N²m²s",
    "joint tracking error": "{s.tracking_rms_rad:.3} rad rms, {s.tracking_max_rad:.3} rad at most",
    "zero moment point": "{s.zmp_min_m:.3} … {s.zmp_max_m:.3} m "
    "(sole {s.zmp_limits_m[0]:.3} … {s.zmp_limits_m[1]:.3} m)",
    **FRICTION_LINES,
    "contact problems": "{s.solver}; complementarity residual {s.complementarity_max:.2}",
    **GAIN_LINE,
    **COST_LINES,
}
OF_A_GAIT = ("gait", "joint tracking error")
