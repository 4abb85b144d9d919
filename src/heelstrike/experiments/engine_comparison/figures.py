"""What a walk in an engine is worth, in numbers: against the truth, and by itself."""

from __future__ import annotations

import math

import numpy as np

from heelstrike.analysis import energy_balance, max_slip
from heelstrike.analysis.diagnosis.falls import Fall, first_cause, walked_on
from heelstrike.analysis.support import walking_steps
from heelstrike.analysis.tracking import tracking_error
from heelstrike.experiments.comparison import landing_impulse, root_mean_square, sampled
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.robot.model import Floats
from heelstrike.sim import Run

GRID = 2e-3
"""Time between the instants at which runs are compared, in s."""

NOISE_WINDOW = 0.01
"""Time (s) over which forces are averaged: what they differ by from that mean is their noise."""

AFTER_LANDING = 0.1
"""Time (s) after a landing, and before the next, in which forces are not asked for their noise."""

NONE = math.nan


@dataclass(frozen=True)
class WalkFigures:
    """A walk in an engine."""

    walks: bool
    """Whether it took all steps and the robot is still up."""
    steps: int
    """Steps taken."""
    ending: str
    """How it ended, and what went wrong first."""
    tracking_rad: float
    """Root mean square of the joints' distance from the gait, in rad."""
    position: float
    """Root mean square, over the walk, of the distance of all coordinates from the truth (m,
    rad)."""
    touchdown_s: float
    """Largest difference in time between a landing and that of the same step in the truth; errors
    of one step last to the end, in s."""
    impulse_Ns: float  # noqa: N815 - units keep their letters
    """Mean difference of a landing's normal impulse from the same step's, in N s."""
    zmp_m: float
    """Root mean square difference of the stance foot's zero moment point, in m."""
    slip_m: float
    penetration_m: float
    """slip_m, penetration_m: Longest way that a point slid while it pressed, and deepest point."""
    energy_J: float  # noqa: N815
    """Largest energy that came or went without work, in J."""
    noise: float
    """Root mean square of what the ground's force differs by from its mean over `NOISE_WINDOW`, in
    single support away from landings, in parts of the weight."""
    peak: float
    """Largest normal force on a foot, mean over a step, in parts of the weight."""
    step_us: float
    """Computing time of a step, in µs."""
    computing_s: float
    """Computing time of the walk, in s."""


def walk_figures(
    run: Run, truth: Run, gait: Gait, steps: int, *, forces_told: bool = True
) -> WalkFigures:
    """Measure a walk.

    Parameters
    ----------
    run : Run
        What the engine made of it.
    truth : Run
        What is held for true.
    gait : Gait
        What both followed.
    steps : int
        Steps that it was to take.
    forces_told : bool
        Whether the engine tells all forces, as means over steps: what energy follows from.

    Returns
    -------
    WalkFigures
        Its figures; NaN where there are none.
    """
    fall = first_cause(run, gait)
    taken = walking_steps(run)
    theirs = walking_steps(truth)
    pairs = list(zip(taken, theirs, strict=False))
    walks = walked_on(run, fall) and len(taken) >= steps
    end = min(run.time[-1], truth.time[-1])
    grid = np.linspace(0.0, end, max(2, round(end / GRID) + 1))
    ours, real = sampled(run, grid), sampled(truth, grid)
    apart = ours["position"] - real["position"]
    impulses = [
        landing_impulse(run, list(run.robot.feet[a.foot].contacts), a.touchdown)
        - landing_impulse(truth, list(run.robot.feet[b.foot].contacts), b.touchdown)
        for a, b in pairs
        if a.foot == b.foot
    ]
    normal = run.contact_force[..., 0].sum(axis=1) / run.robot.weight
    feet = [run.contact_force[:, list(foot.contacts), 0].sum(axis=1) for foot in run.robot.feet]
    return WalkFigures(
        walks=walks,
        steps=len(taken),
        ending=_ending(run, fall, len(taken), steps),
        tracking_rad=tracking_error(run, gait).rms,
        position=float(np.sqrt(np.mean(apart**2))),
        touchdown_s=max((abs(a.touchdown - b.touchdown) for a, b in pairs), default=NONE),
        impulse_Ns=float(np.mean(np.abs(impulses))) if impulses else NONE,
        zmp_m=root_mean_square(ours["zmp"] - real["zmp"]),
        slip_m=max_slip(run),
        penetration_m=run.certificates.penetration,
        energy_J=float(np.max(np.abs(energy_balance(run).residual))) if forces_told else NONE,
        noise=_noise(run, normal, [each.touchdown for each in taken]),
        peak=float(max(each.max() for each in feet) / run.robot.weight) if feet else NONE,
        step_us=1e6 * run.timing.wall_s / max(run.steps, 1),
        computing_s=run.timing.wall_s,
    )


def _ending(run: Run, fall: Fall | None, taken: int, steps: int) -> str:
    """How a walk ended, and what went wrong."""
    if fall is not None:
        return f"{run.status.value}: {fall}"
    short = run.completed and taken < steps
    return f"{run.status.value}: {taken} of {steps} steps" if short else run.status.value


def _noise(run: Run, normal: Floats, landings: list[float]) -> float:
    """Root mean square of what is left of a force when its mean over a window is taken away."""
    step = float(run.time[1] - run.time[0]) if len(run.time) > 1 else 1.0
    width = max(3, 2 * round(0.5 * NOISE_WINDOW / step) + 1)
    if len(normal) < width:
        return NONE
    smooth = np.convolve(normal, np.ones(width) / width, mode="same")
    calm = np.ones(len(normal), dtype=bool)
    for instant in (run.time[0], *landings, run.time[-1]):
        calm &= np.abs(run.time - instant) > AFTER_LANDING
    left = (normal - smooth)[calm]
    return float(np.sqrt(np.mean(left**2))) if len(left) else NONE
