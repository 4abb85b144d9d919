"""What a robot measured as it moved: joints, torques, forces of the ground, perhaps its trunk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import GaitError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.lines import Name
from heelstrike.gait.recordings.table import Table, read_table
from heelstrike.gait.recordings.units import (
    ANGLES,
    FORCES,
    LENGTHS,
    TIMES,
    TORQUES,
    check_unit,
    plain,
)
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run
from heelstrike.tolerances import SAME_ROW
from heelstrike.wording import meant, some_of

ROOT = 3
"""Coordinates of a trunk that floats: x, z and pitch."""
COMPONENTS = ("normal", "tangent")
SLIDING_MOTOR = (*FORCES, *TORQUES)
"""Units of the column of a motor that pushes along a slide: tables of runs call all of them N m."""
SHOWN = 6
"""Missing columns that a message names."""

Kind = tuple[str, ...]
"""Units of one kind, ours first."""


@dataclass(frozen=True, eq=False)
class RobotLog:
    """What a robot measured as it moved."""

    time: Floats
    """(n,) In s, from 0 on."""
    joints: Floats
    """(n, k) Positions of all joints but those of a trunk that floats (rad, m)."""
    torque: Floats
    """(n, nu) Of the motors (N m, N)."""
    force: Floats | None = None
    """(n, nc, 2) Of the ground on the contact points, normal and tangent (N)."""
    trunk: Floats | None = None
    """(n, 3) x, z (m) and pitch (rad) of the trunk."""
    ignored: tuple[str, ...] = ()
    """Columns of the file that were of no use."""

    @classmethod
    def of(cls, run: Run) -> RobotLog:
        """Return what a robot would have measured in a simulation.

        Rows of events that stand at the time of another one are left out.

        Parameters
        ----------
        run : Run
            The simulation.

        Returns
        -------
        RobotLog
            Joints, torques, forces of the ground if there are contact points, and the trunk if
            it floats; time begins at zero.

        Raises
        ------
        SimulationError
            If the robot stands on ground that is not level: gravity and forces would have other
            directions than a robot on level ground measures.
        """
        ground = run.ground
        if run.robot.floating and (
            ground.shape is not None or np.ptp(ground.model().vertices[:, 1])
        ):
            raise SimulationError(
                "numbers of a robot are told from its motion on level ground; this run is on other "
                "ground. Simulate it on hs.Ground(friction=...)"
            )
        later = np.diff(run.time, append=np.inf) > SAME_ROW
        q, first = run.position[later], root_size(run.robot)
        return cls(
            time=run.time[later] - run.time[0],
            joints=q[:, first:],
            torque=run.torque[later],
            force=run.contact_force[later] if run.robot.nc else None,
            trunk=q[:, :first] if first else None,
        )


def root_size(robot: Robot) -> int:
    """How many coordinates are those of a trunk that floats."""
    return ROOT if robot.floating else 0


def load_robot_log(
    path: Name, robot: Robot, *, rate: float | None = None, unit: str = ""
) -> RobotLog:
    """Read what a robot measured from a table, as that of a run (``run.save("run.csv")``).

    Columns are ``position JOINT`` or ``JOINT``, ``torque MOTOR``, and the time. Where there are
    ``contact_force POINT normal`` and ``tangent`` of all contact points, or ``position`` of the
    trunk's x, z and pitch, these are read too. Units may stand in brackets. Of several rows at one
    time, as tables of runs have at events, the last counts.

    Parameters
    ----------
    path : path
        The file: a table of text, or JSON.
    robot : Robot
        The robot.
    rate : float, optional
        Rows a second, where the file has no times.
    unit : str
        Of hinges, and of the trunk's pitch, whose columns name none: ``"rad"`` or ``"deg"``; rad by
        default. What slides is in m.

    Returns
    -------
    RobotLog
        What it measured.

    Raises
    ------
    GaitError
        If it is no such file, a column or a number is missing, or a unit is of another kind; the
        message has the place.
    """
    check_unit(unit)
    table = _last_of_each_time(read_table(path, gaps=True))
    first = root_size(robot)
    turns = robot.model.axis[:, 0] != 0.0
    motor_of = dict(zip(robot.model.actuator_joint.tolist(), robot.actuator_names, strict=True))
    joints = [
        _needed(table, [f"position {name}", name, motor_of.get(first + j, name)])
        for j, name in enumerate(robot.joint_names[first:])
    ]
    torques = [
        _needed(table, [f"torque {motor}", f"{motor} torque", f"torque {robot.joint_names[joint]}"])
        for joint, motor in motor_of.items()
    ]
    trunk = _all_or_none(table, [f"position {name}" for name in robot.joint_names[:first]])
    forces = _all_or_none(
        table,
        [
            f"contact_force {name} {component}"
            for name in robot.contact_names
            for component in COMPONENTS
        ],
    )
    time = table.time(rate)
    force = root = None
    if forces:
        force = _columns(table, forces, [FORCES] * len(forces))
        force = force.reshape(len(time), robot.nc, 2)
    if trunk:
        root = _columns(table, trunk, _kinds(turns[:first], ANGLES, LENGTHS), unit)
    used = {table.column("time"), *joints, *torques, *trunk, *forces}
    return RobotLog(
        time=time,
        joints=_columns(table, joints, _kinds(turns[first:], ANGLES, LENGTHS), unit),
        torque=_columns(table, torques, _kinds(turns[list(motor_of)], TORQUES, SLIDING_MOTOR)),
        force=force,
        trunk=root,
        ignored=tuple(name for k, name in enumerate(table.written) if k not in used),
    )


def _there(table: Table, names: Sequence[str]) -> int:
    """Return the column of the first of several names that there is, -1 if there is none."""
    return next((k for k in map(table.column, map(plain, names)) if k >= 0), -1)


def _needed(table: Table, names: Sequence[str]) -> int:
    column = _there(table, names)
    if column < 0:
        guess = meant(plain(names[0]), {name: repr(name) for name in table.names})
        raise GaitError(
            f"{table.path}: no column {names[0]!r}.{guess} The first line names the columns; it "
            f"has {', '.join(table.written[:12])}"
        )
    return column


def _all_or_none(table: Table, names: Sequence[str]) -> list[int]:
    """Return the columns of several names; none if there is none of them.

    Raises
    ------
    GaitError
        If there are some of them only.
    """
    columns = [_there(table, [name]) for name in names]
    missing = [repr(name) for name, k in zip(names, columns, strict=True) if k < 0]
    if len(missing) == len(names):
        return []
    if missing:
        there = next(table.written[k] for k in columns if k >= 0)
        raise GaitError(
            f"{table.path}: there is {there!r}, but no column {some_of(missing, SHOWN)}: all of "
            "these are wanted, or none. Add them, or leave the others out"
        )
    return columns


def _last_of_each_time(table: Table) -> Table:
    """Return the table without rows that stand at the time of the next one."""
    column = table.column("time")
    if column < 0:
        return table
    steps = np.diff(table.values[:, column], append=np.inf) * table.unit(column, TIMES)
    kept = ~((steps >= 0.0) & (steps <= SAME_ROW))
    places = tuple(place for place, keeps in zip(table.places, kept, strict=True) if keeps)
    return replace(table, values=table.values[kept], places=places)


def _kinds(turns: NDArray[np.bool_], turning: Kind, sliding: Kind) -> list[Kind]:
    """Return the units of what turns and of what slides, one by one."""
    return [turning if each else sliding for each in turns]


def _columns(table: Table, columns: Sequence[int], kinds: Sequence[Kind], unit: str = "") -> Floats:
    """Return columns in our units; of angles that name none in a given one.

    Raises
    ------
    GaitError
        If a number is missing, or a column is in a unit of another kind.
    """
    scale = [
        table.unit(k, kind, unit if kind is ANGLES else "")
        for k, kind in zip(columns, kinds, strict=True)
    ]
    found: Floats = table.whole([table.names[k] for k in columns]) * scale
    return found
