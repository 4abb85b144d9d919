"""Figures of a run in space that an engineer signs: way, impacts, slip, power."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from heelstrike.analysis.diagnosis.measures import Measure, measure_power
from heelstrike.analysis.spatial.summary import summarize_in_space
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.spatial.run import SpatialRun


def measures_in_space(run: SpatialRun) -> tuple[Measure, ...]:
    """Measure a run in space; see :func:`heelstrike.analysis.diagnosis.measures.measures`.

    Parameters
    ----------
    run : SpatialRun
        The run.

    Returns
    -------
    tuple of Measure
        Those that there are.
    """
    found = _measures(run) if len(run.time) else ()
    return tuple(each for each in found if np.isfinite(each.value))


def _measures(run: SpatialRun) -> Iterator[Measure]:
    summary = summarize_in_space(run)
    yield Measure(
        "distance along the ground", summary.distance_m, "m",
        f"{summary.forward_m:.3g} m along x, {summary.left_m:.3g} m along y",
    )  # fmt: skip
    yield Measure("speed from the first place to the last", summary.speed_m_s, "m/s")
    yield Measure("turn about the vertical", summary.turn_rad, "rad")
    landings = [event for event in run.events if event.kind is EventKind.TOUCHDOWN]
    if landings:
        hardest = max(landings, key=lambda event: event.impulse[0])
        yield Measure(
            "touchdown impulse of a contact point, largest", hardest.impulse[0], "N s",
            f"{hardest.place(run.robot).replace('_', ' ')} at {hardest.time:.3f} s",
        )  # fmt: skip
    if run.robot.nc:
        yield Measure("slip of a pressed contact point", 1e3 * summary.slip_max_m, "mm", "in all")
    if run.robot.nu:
        yield Measure(
            "cost of transport", summary.cost_of_transport, "",
            f"{summary.cost_of_transport_positive:.3g} of positive work",
        )  # fmt: skip
        yield from measure_power(run)
