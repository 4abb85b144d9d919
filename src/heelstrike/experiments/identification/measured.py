"""What identify() is given: refused in words where it is no log of the robot."""

from __future__ import annotations

import numpy as np

from heelstrike.errors import SimulationError
from heelstrike.experiments.identification.standing import LEAST_SAMPLES
from heelstrike.gait.recordings.robot_log import RobotLog, root_size
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run


def measured_by(robot: Robot, log: RobotLog | Run) -> RobotLog:
    """Return what a robot measured, or refuse it.

    Parameters
    ----------
    robot : Robot
        The robot.
    log : RobotLog or Run
        What it measured.

    Raises
    ------
    SimulationError
        If it is neither, or not of this robot, or numbers are missing, or times do not go on.
    """
    if isinstance(log, Run):
        log = RobotLog.of(log)
    if not isinstance(log, RobotLog):
        raise SimulationError(
            f"log must be a RobotLog or a Run, got {type(log).__name__}; load_robot_log(file, "
            "robot) reads one"
        )
    first, rows = root_size(robot), np.size(log.time)
    shapes = {
        "time": (rows,), "joints": (rows, robot.nq - first), "torque": (rows, robot.nu),
        "force": (rows, robot.nc, 2), "trunk": (rows, first),
    }  # fmt: skip
    for name, shape in shapes.items():
        given = getattr(log, name)
        if given is None and name in ("force", "trunk"):
            continue
        if np.shape(given) != shape:
            raise SimulationError(
                f"the log's {name} must have shape {shape} for robot {robot.name!r}, got "
                f"{np.shape(given)}"
            )
        if not np.all(np.isfinite(given)):
            row = int(np.argwhere(~np.isfinite(given))[0, 0])
            raise SimulationError(
                f"the log's {name} has no number in row {row}; fill it in, or cut the log there"
            )
    if rows < LEAST_SAMPLES:
        raise SimulationError(f"the log has {rows} rows; at least {LEAST_SAMPLES} are wanted")
    steps = np.diff(log.time)
    if not np.all(steps > 0.0):
        row = int(np.argmin(steps > 0.0)) + 1
        raise SimulationError(f"the log's time does not go on in row {row}")
    return log
