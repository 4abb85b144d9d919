"""How figures keep the large forces of impacts from flattening everything else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.run import Run

Floats = NDArray[np.float64]

ROWS_OF_AN_IMPACT = 3
"""An impact acts over the step in which a gap closes and the next, in which the point stops; the
controller sees its effect in the row after."""

NOTE = "impacts leave the scale"


def impact_rows(run: Run) -> NDArray[np.bool_]:
    """Tell which rows show an impact, (nt,): the step in which it happened and the rows after."""
    rows = np.zeros(len(run.time), dtype=bool)
    kinds = (EventKind.TOUCHDOWN, EventKind.IMPACT)
    times = np.array([e.time for e in run.events if e.kind in kinds])
    first = np.searchsorted(run.time, times - 1e-9) - 1
    for k in range(ROWS_OF_AN_IMPACT):
        rows[np.clip(first + k, 0, len(rows) - 1)] = True
    return rows


def scale_without_impacts(axes: Axes, run: Run, curves: Sequence[Floats], rows: slice) -> bool:
    """Scale the y axis to what curves (nt,) do between impacts; tell whether impacts leave it."""
    usual = ~impact_rows(run)[rows]
    shown = np.array([curve[rows] for curve in curves])
    seen = shown[:, usual][np.isfinite(shown[:, usual])]
    if not seen.size:
        return False
    low, high = float(seen.min()), float(seen.max())
    room = 0.08 * max(high - low, 1e-9)
    axes.set_ylim(low - room, high + room)
    return bool(np.nanmax(shown) > high + room or np.nanmin(shown) < low - room)
