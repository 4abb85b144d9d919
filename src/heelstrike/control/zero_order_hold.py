"""Linear equations of motion under controls that are held over an interval."""

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
