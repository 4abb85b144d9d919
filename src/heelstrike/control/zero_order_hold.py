"""Linear equations of motion over an interval, under controls that are held or that answer."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.model import Floats


def over_an_interval(A: Floats, B: Floats, width: float) -> tuple[Floats, Floats]:
    """Return what an interval makes of errors, and of controls that are held over it.

    Both are blocks of one exponential, as in ``scipy.signal.cont2discrete``, which takes half a
    second to import.
    """
    from scipy.linalg import expm

    states, controls = B.shape
    still = np.zeros((controls, states + controls))
    grown = expm(width * np.vstack([np.hstack([A, B]), still]))[:states]
    return grown[:, :states], grown[:, states:]


def under_gains(A: Floats, B: Floats, gain: Floats, width: float) -> Floats:
    """Return what an interval makes of errors to which controls answer at once, by −gain times."""
    from scipy.linalg import expm

    return np.asarray(expm(width * (A - B @ gain)))
