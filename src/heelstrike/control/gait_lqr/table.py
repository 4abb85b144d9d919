"""Numbers kept at places of a step or phase, and what they are between these."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats


def interpolated(values: Floats, known: Floats, places: Floats) -> Floats:
    """Return values at places, (places, …), of those at known places, (known, …): linear between.

    Beyond the first and the last of the known places they stay.
    """
    flat = values.reshape(len(values), -1)
    found = np.array([np.interp(places, known, each) for each in flat.T]).T
    return found.reshape(len(places), *values.shape[1:])


def in_the_middles(known: Floats, values: Floats, count: int) -> Floats:
    """Return values in the middles of so many even intervals, (count, …), of those at instants.

    The instants (s) begin at 0 and end with the last interval; a cubic spline is between them.
    """
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(known, values)((np.arange(count) + 0.5) * known[-1] / count))


@kernel
def feed_back(share: float, torque: Floats, gains: Floats, away: Floats, asked: Floats) -> None:
    """Write what is asked for (nu,) at a share of a step or phase, by tables over even places.

    `torque` (places, nu) and `gains` (places, nu, n) times what is `away` (n,), linear between.
    """
    last = torque.shape[0] - 1
    place = min(max(share, 0.0), 1.0) * last
    here = min(int(place), last - 1)
    part = place - here
    for i in range(torque.shape[1]):
        total = 0.0
        for side in range(2):
            told = torque[here + side, i]
            for j in range(away.shape[0]):
                told += gains[here + side, i, j] * away[j]
            total += (part if side == 1 else 1.0 - part) * told
        asked[i] = total
