"""What a robot measured as it moved: joints, torques, forces of the ground, perhaps its trunk."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.lines import Name
from heelstrike.gait.recordings.table import Table, read_table
from heelstrike.gait.recordings.units import UNITS, check_unit, plain
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run
from heelstrike.tolerances import SAME_ROW
from heelstrike.wording import meant

ROOT = 3
"""Coordinates of a trunk that floats: x, z and pitch."""
COMPONENTS = ("normal", "tangent")


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
        """
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
    ``contact_force POINT normal`` and ``tangent`` of all contact points, and ``position`` of the
    trunk's x, z and pitch, these are read too. Units may stand in brackets.

    Parameters
    ----------
    path : path
        The file: a table of text, or JSON.
    robot : Robot
        The robot.
    rate : float, optional
        Rows a second, where the file has no times.
    unit : str
        Of joints whose columns name none: ``"rad"`` or ``"deg"``; rad by default.

    Returns
    -------
    RobotLog
        What it measured.

    Raises
    ------
    GaitError
        If it is no such file, or a column or a number is missing; the message has the place.
    """
    check_unit(unit)
    table = read_table(path, gaps=True)
    first = root_size(robot)
    motor_of = dict(zip(robot.model.actuator_joint.tolist(), robot.actuator_names, strict=True))
    joints = [
        _needed(table, [f"position {name}", name, motor_of.get(first + j, name)])
        for j, name in enumerate(robot.joint_names[first:])
    ]
    torques = [
        _needed(table, [f"torque {motor}", f"{motor} torque", f"torque {robot.joint_names[joint]}"])
        for joint, motor in motor_of.items()
    ]
    trunk = [_there(table, [f"position {name}"]) for name in robot.joint_names[:first]]
    forces = [
        _there(table, [f"contact_force {name} {component}"])
        for name in robot.contact_names
        for component in COMPONENTS
    ]
    time = table.time(rate)
    force = None
    if forces and min(forces) >= 0:
        force = _columns(table, forces, "").reshape(len(time), robot.nc, 2)
    root = None
    if first and min(trunk) >= 0:
        root = np.hstack([_columns(table, trunk[:2], ""), _columns(table, trunk[2:], unit)])
    used = {table.column("time"), *joints, *torques, *trunk, *forces}
    return RobotLog(
        time=time,
        joints=_columns(table, joints, unit),
        torque=_columns(table, torques, ""),
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


def _columns(table: Table, columns: Sequence[int], unit: str) -> Floats:
    """Return columns in our units; of angles that name none in a given one."""
    scale = [UNITS[table.units[k] or unit or "rad"] for k in columns]
    found: Floats = table.whole([table.names[k] for k in columns]) * scale
    return found
