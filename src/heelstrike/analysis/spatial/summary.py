"""The figures of a run in space on one page, for a person and for a program."""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.actuation import transport_over
from heelstrike.analysis.spatial.friction import face_friction, foot_friction
from heelstrike.analysis.spatial.links import link_motion
from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point
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
from heelstrike.field_texts import dataclass
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.spatial.run import SpatialRun

CERTAIN = 9
"""Decimals of a distance (m) that the tolerance of the contact problems leaves certain."""

MOST_LOOKED_AT = 2000
"""Rows of a run in which the zero moment point is looked for, evenly spread."""


@dataclass(frozen=True, kw_only=True)
class SpatialSummary(ToldSummary):
    """Figures of a run in space. Those that do not exist for it are NaN (null in JSON)."""

    forward_m: float
    left_m: float
    """forward_m, left_m: How far the centre of mass moved along x and y."""
    distance_m: float
    """The same as one distance, from the first place to the last, along the ground."""
    speed_m_s: float
    """That distance over the time."""
    turn_rad: float
    """How far the robot turned about the vertical, whole turns counted; NaN if it does not
    float."""
    touchdowns: int
    """Contact points that met the ground."""
    zmp_margin_min_m: float
    """Least distance of the zero moment point to the edges of the support polygon."""
    friction_use_max: float
    """Largest |f_t| / (μ f_n) of any foot, each of its points with the friction of the plane or box
    under it; of all points, if there are no feet. Rows in which one is at a wall, too, do not
    count."""
    residual_max: float
    """Worst value over all steps, from the certificates; it is relative."""
    uncertified: int
    halved: int
    relaxed: int
    """uncertified, halved, relaxed: Steps that went on with a residual above 1e-9; steps taken in
    parts; steps in which points in a wedge were not asked to leave the ground, or whose impact did
    not bounce or was left to the next step."""

    def lines(self) -> list[tuple[str, str]]:
        """Label and value of every line of the table a person reads."""
        needless = {
            OF_A_GAIN: not self.energy_gain_J > 0.0,
            "turn": not np.isfinite(self.turn_rad),
        }
        return in_lines(self, LINES, needless)


def summarize_in_space(run: SpatialRun) -> SpatialSummary:
    """Compute the figures of a run in space.

    Parameters
    ----------
    run : SpatialRun
        The run.

    Returns
    -------
    SpatialSummary
        Figures with units in their names.
    """
    count = len(run.time)
    ends = np.array([0, count - 1]) if count else np.zeros(0, dtype=np.int64)
    center = link_motion(run, ends).center_of_mass
    moved = center[-1] - center[0] if count else np.zeros(3)
    distance = float(np.hypot(moved[0], moved[1]))
    every = max(1, -(-count // MOST_LOOKED_AT))
    margin = spatial_zero_moment_point(run, np.arange(0, count, every)).margin
    common = common_figures(run, transport_over(run, distance))
    duration = common["duration_s"]
    return SpatialSummary(
        **common,
        forward_m=float(moved[0]),
        left_m=float(moved[1]),
        distance_m=distance,
        speed_m_s=distance / duration if duration > 0.0 else UNKNOWN,
        turn_rad=_turn(run),
        touchdowns=sum(event.kind is EventKind.TOUCHDOWN for event in run.events),
        zmp_margin_min_m=round(float(np.fmin.reduce(margin, initial=UNKNOWN)), CERTAIN) + 0.0,
        friction_use_max=_friction_use(run),
        residual_max=run.certificates.residual,
        uncertified=run.certificates.uncertified,
        halved=run.certificates.halved,
        relaxed=run.certificates.relaxed,
    )


def _turn(run: SpatialRun) -> float:
    """Angle about the vertical by which the x axis of a floating base has turned."""
    if not (run.robot.floating and len(run.time)):
        return UNKNOWN
    w, x, y, z = run.position[:, 3:7].T
    heading = np.unwrap(np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)))
    return float(heading[-1] - heading[0])


def _friction_use(run: SpatialRun) -> float:
    """Largest share of its friction that any foot used; of all points, if there are no feet."""
    groups = [foot.contacts for foot in run.robot.feet] or [tuple(range(run.robot.nc))]
    friction = face_friction(run)
    used = [foot_friction(run, friction, contacts)[0] for contacts in groups]
    return float(np.fmax.reduce(np.concatenate(used), initial=UNKNOWN))


# What a person reads, in letters that the consoles of Windows have.
LINES = {
    "status": "{s.status}",
    "distance": "{s.distance_m:.4} m in {s.duration_s:.4} s ({s.speed_m_s:.3} m/s): "
    "{s.forward_m:.3} m along x, {s.left_m:.3} m along y",
    "turn": "{s.turn_rad:.3} rad about the vertical",
    "touchdowns": "{s.touchdowns} of contact points",
    "zero moment point": "{s.zmp_margin_min_m:.3} m inside the support polygon at least",
    **FRICTION_LINES,
    "contact problems": "{s.solver.solves}, {s.solver.failures} not certified, "
    "{s.solver.fallbacks} needed another way; residual {s.residual_max:.2}",
    "steps not certified": "{s.uncertified} to 1e-9; {s.halved} halved; {s.relaxed} with a wedged "
    "point left in place, or an impact without bounce or left to the next step",
    **GAIN_LINE,
    "torque cost": "{s.torque_cost_N2m2s:.4} N²m²s",
    **COST_LINES,
}
