"""Numbers kept at places of a step or phase, and what they are between these."""

from __future__ import annotations

import numpy as np

from heelstrike.robot.model import Floats


def interpolated(values: Floats, known: Floats, places: Floats) -> Floats:
    """Return values at places, (places, …), of those at known places, (known, …): linear between.

    Beyond the first and the last of the known places they stay.
    """
    flat = values.reshape(len(values), -1)
    found = np.array([np.interp(places, known, each) for each in flat.T]).T
    return found.reshape(len(places), *values.shape[1:])
