"""Recorded motions of joints, read from tables: names, units, rate."""

from __future__ import annotations

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.lines import Name
from heelstrike.gait.recordings.opensim import joints_of_opensim
from heelstrike.gait.recordings.table import Table, read_table
from heelstrike.gait.recordings.units import ANGLES, LENGTHS, check_unit, plain
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.wording import meant

BEYOND = 1.2
"""How far beyond its range a joint goes, in that range, where degrees were taken for radians."""


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """How the driven joints of a robot move."""

    time: Floats
    """(n,) In s, from 0 on."""
    position: Floats
    """(n, nu) Of the actuated joints, in the order of the actuators (rad, m)."""
    ignored: tuple[str, ...]
    """Columns of the file that were of no use."""

    @property
    def rate(self) -> float:
        """Rows a second."""
        return float((len(self.time) - 1) / self.time[-1])

    def seems_degrees(self, robot: Robot) -> bool:
        """Whether its numbers make sense as degrees and not as radians.

        Parameters
        ----------
        robot : Robot
            The robot, whose joints have ranges.

        Returns
        -------
        bool
            Whether most joints go far beyond their ranges, or turn right round, and would not as
            degrees.
        """
        joints = robot.model.actuator_joint
        limit = np.maximum(np.abs(robot.model.lower[joints]), np.abs(robot.model.upper[joints]))
        limit = np.where(np.isfinite(limit), limit, np.pi)
        hinges = robot.model.axis[joints, 0] != 0.0
        far = np.abs(self.position).max(axis=0) > BEYOND * limit
        near = np.abs(np.deg2rad(self.position)).max(axis=0) <= BEYOND * limit
        return bool(hinges.any() and far[hinges].mean() > 0.5 and near[hinges].all())


def load_recorded_motion(
    path: Name, robot: Robot, *, rate: float | None = None, unit: str = ""
) -> RecordedMotion:
    """Read a motion of joints from a table.

    Columns are the actuated joints, each perhaps with a unit as in ``left_hip [deg]`` or
    ``left_hip_deg``, and the time. In a table of text the first line names them; they are separated
    by commas, semicolons, tabs or blanks. A JSON file (.json) is an object of columns by name, and
    perhaps ``"rate_Hz"``. OpenSim's tables of coordinates (.mot, .sto) are read for robots whose
    joints are called as those of human7, with the senses of OpenSim's models of walking people.

    Parameters
    ----------
    path : path
        The file.
    robot : Robot
        The robot whose motion it is.
    rate : float, optional
        Rows a second, where the file has no times.
    unit : str
        Of the joints whose columns name none: ``"rad"`` or ``"deg"``; rad by default.

    Returns
    -------
    RecordedMotion
        The motion.

    Raises
    ------
    GaitError
        If it is no such file, a joint is missing, or numbers are; the message has the place.
    """
    check_unit(unit)
    return motion_of(read_table(path), robot, rate=rate, unit=unit)


def motion_of(
    table: Table, robot: Robot, *, rate: float | None = None, unit: str = ""
) -> RecordedMotion:
    """Return the motion of a robot's joints that a table holds.

    Parameters
    ----------
    table : Table
        The table.
    robot : Robot
        The robot.
    rate : float, optional
        Rows a second, where the table has no times.
    unit : str
        Of columns that name none: ``"rad"`` or ``"deg"``; rad by default.

    Raises
    ------
    GaitError
        If the unit is none of these, a joint or a number of one is missing, or there are no times.
    """
    check_unit(unit)
    if table.opensim:
        table = joints_of_opensim(table, unit)
    missing = [name for name in robot.actuator_names if table.column(plain(name)) < 0]
    if missing:
        guess = meant(missing[0], {name: repr(name) for name in table.names})
        raise GaitError(
            f"{table.path}: no column for {', '.join(missing)}.{guess} The first line names the "
            f"columns; it has {', '.join(table.written[:12])}"
        )
    names = [plain(name) for name in robot.actuator_names]
    order = [table.column(name) for name in names]
    turns = robot.model.axis[robot.model.actuator_joint, 0] != 0.0
    scale = [
        table.unit(column, ANGLES, unit) if turn else table.unit(column, LENGTHS)
        for column, turn in zip(order, turns.tolist(), strict=True)
    ]
    used = {*order, table.column("time")}
    ignored = tuple(name for column, name in enumerate(table.written) if column not in used)
    return RecordedMotion(table.time(rate), table.whole(names) * scale, ignored)
