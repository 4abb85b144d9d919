"""How far runs of one robot lie apart."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from heelstrike.analysis.motion import run_motion
from heelstrike.analysis.support import walking_steps
from heelstrike.sim.run import Run

INSTANTS = 1000
"""At how many times runs are held against each other."""

QUANTITIES = (
    "steps",
    "last common time (s)",
    "centre of mass, largest distance (mm)",
    "coordinates, largest difference (rad, m)",
    "touchdowns of steps, largest difference in time (ms)",
)


def differences(named: Mapping[str, Run]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return heading and rows of a table, a column a run: how far each is from the first.

    Coordinates are compared between robots of the same joints only.
    """
    reference = next(iter(named.values()))
    columns = [_apart(run, reference) for run in named.values()]
    return ("", *named), list(zip(QUANTITIES, *columns, strict=True))


def _apart(run: Run, reference: Run) -> tuple[str, ...]:
    start = max(float(run.time[0]), float(reference.time[0]))
    end = min(float(run.time[-1]), float(reference.time[-1]))
    steps = str(len(walking_steps(run)))
    if not end > start:
        return steps, f"{end:.4g}", "–", "–", "–"
    grid = np.linspace(start, end, INSTANTS)

    def at(time: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(grid, time, column) for column in values.T])

    center, other = (at(each.time, run_motion(each).center_of_mass) for each in (run, reference))
    apart = float(np.hypot(*(center - other).T).max())
    coordinates = math.nan
    if run.robot.joint_names == reference.robot.joint_names:
        ours, theirs = at(run.time, run.position), at(reference.time, reference.position)
        coordinates = float(np.abs(ours - theirs).max())
    ours, theirs = (
        np.array([step.touchdown for step in walking_steps(each)]) for each in (run, reference)
    )
    common = min(len(ours), len(theirs))
    late = float(np.abs(ours[:common] - theirs[:common]).max()) if common else math.nan
    return (
        steps,
        f"{end:.4g}",
        _number(1e3 * apart),
        _number(coordinates),
        _number(1e3 * late),
    )


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"
