"""How far contact points slide while they press."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.analysis.intervals import mean_over_intervals
from heelstrike.analysis.support import pushing
from heelstrike.robot.model import Floats
from heelstrike.sim.run import AnyRun, Run


def slip_distance(run: AnyRun) -> Floats:
    """Distance that every contact point has slid while pressed, up to each row, (nt, nc), in m.

    The sum over steps of |tangential velocity at the end of the step| times the step, taken over
    steps in which the point pushes; in event-driven runs the mean of the two rows' velocities. It
    never decreases: sliding there and back counts twice. With ``record_every`` above 1, rows stand
    for the steps between them.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    (nt, nc) float
        Metres.
    """
    in_space: Any = run
    slips = run.slip_velocity if isinstance(run, Run) else np.linalg.norm(in_space.slip, axis=-1)
    speed = np.where(pushing(run), np.abs(slips), 0.0)
    slid = np.zeros_like(speed)
    slid[1:] = np.cumsum(mean_over_intervals(run, speed) * np.diff(run.time)[:, None], axis=0)
    return slid


def max_slip(run: AnyRun) -> float:
    """Largest distance that any contact point slid over the whole run, in m.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    float
        Metres.
    """
    slid = slip_distance(run)
    return float(slid[-1].max()) if slid.size else 0.0
