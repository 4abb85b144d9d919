"""Forces of the ground on a person, from OpenSim's MOT files or tables of the same names."""

from __future__ import annotations

import re

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.lines import Name
from heelstrike.gait.recordings.markers import AXES, axis_and_sense
from heelstrike.gait.recordings.table import Table, read_table
from heelstrike.gait.recordings.units import FORCES, LENGTHS
from heelstrike.robot.model import Floats

KINDS = {"v": FORCES, "p": LENGTHS}
"""Units of forces and of where they act; the first one where none is told."""


@dataclass(frozen=True, eq=False)
class RecordedForces:
    """Forces that plates measured."""

    time: Floats
    """(n,) In s, as the file counts it."""
    force: Floats
    """(n, plates, 2) Of the ground on the person, forward and up, in N."""
    point: Floats
    """(n, plates, 2) Where they act, forward and up, in m."""


def load_forces(path: Name, *, forward: str = "x", up: str = "y") -> RecordedForces:
    """Read forces of the ground: columns ``ground_force_vx`` … ``ground_force_px`` … of each plate.

    Parameters
    ----------
    path : path
        A MOT or STO file of OpenSim, or a table of text or JSON.
    forward, up : str
        Axes of the file, each perhaps with a minus before it.

    Returns
    -------
    RecordedForces
        The forces, plate by plate in the order of the file.

    Raises
    ------
    GaitError
        If there are none, or they are in no unit of forces or lengths; the message has the place.
    """
    axes = axis_and_sense(forward, "forward"), axis_and_sense(up, "up")
    if axes[0][0] == axes[1][0]:
        raise GaitError(f"{path}: one axis cannot be both up and forward")
    table = read_table(path)
    plates = [name[:-2] for name in table.names if re.fullmatch(r".*_vx", name)]
    forces, points = [], []
    for plate in plates:
        columns = [f"{plate}{kind}{AXES[axis]}" for kind in KINDS for axis, _ in axes]
        missing = [name for name in columns if table.column(name) < 0]
        if missing:
            raise GaitError(f"{path}: no column {missing[0]!r} beside {plate}vx")
        scale = [_scale(table, name) for name in columns]
        values = table.whole(columns) * scale * ([sense for _, sense in axes] * 2)
        forces.append(values[:, :2])
        points.append(values[:, 2:])
    if not plates:
        raise GaitError(
            f"{path}: no forces; columns are called as ground_force_vx and ground_force_px. It has "
            f"{', '.join(table.written[:8])}"
        )
    time = table.begin + table.time()
    return RecordedForces(time, np.stack(forces, axis=1), np.stack(points, axis=1))


def _scale(table: Table, name: str) -> float:
    """What a number of a column is in N or m."""
    return table.unit(table.column(name), KINDS[name[-2]])
