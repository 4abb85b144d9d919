"""What a robot has beside its joints, in words: closed loops, coupled joints, latches."""

from __future__ import annotations

import numpy as np

from heelstrike.errors import RobotError
from heelstrike.robot.robot import Robot


def row_names(robot: Robot) -> list[str]:
    """Say what each row of :func:`~heelstrike.dynamics.loop_jacobian` ties, (rows,).

    Parameters
    ----------
    robot : Robot
        The robot.

    Returns
    -------
    list of str
        Of closed loops, two rows each, along x and z, and of coupled joints.
    """
    return _ties(robot, rows_of_a_loop=2)


def _ties(robot: Robot, rows_of_a_loop: int = 1) -> list[str]:
    loops = [f"loop {name}" for name in robot.loop_names for _ in range(rows_of_a_loop)]
    return loops + [f"coupling of {name}" for name in robot.coupling_names]


def refuse_loops(
    robot: Robot,
    what: str,
    kind: type[Exception] = RobotError,
    *,
    loops: bool = True,
    latches: bool = True,
) -> None:
    """Refuse a robot with closed loops, coupled joints or latches where only trees will do.

    Parameters
    ----------
    robot : Robot
        The robot.
    what : str
        What does not know of loops.
    kind : type
        Error to raise.
    loops, latches : bool
        Whether loops and couplings matter to it; whether latches do.

    Raises
    ------
    Exception
        Of this kind, that names the loops.
    """
    found = _ties(robot) if loops else []
    found += [f"latch of {name}" for name in robot.latch_names if latches]
    if found:
        raise kind(
            f"{what} knows robots whose joints move by themselves only, and robot {robot.name!r} "
            f"has {', '.join(found)}"
        )


def coupling_words(robot: Robot, coupling: int) -> str:
    """Say what a coupling is: ``rear = 0.1 + 2 front``, each joint from where it stands."""
    joint, leader = robot.model.coupling_joint[coupling]
    factors = robot.model.coupling_polynomial[coupling]
    letters = f" {robot.joint_names[leader]}" if leader >= 0 else ""
    powers = ["", letters, *(f"{letters}^{k}" for k in range(2, len(factors)))]
    terms = [
        f"{factors[k]:.6g}{powers[k]}" for k in np.flatnonzero(factors) if k == 0 or leader >= 0
    ]
    return f"{robot.joint_names[joint]} = {' + '.join(terms) or '0'}"


def latch_words(robot: Robot, latch: int) -> str:
    """Say what a latch does: ``left_knee at its lower end, until right_shank touches down``."""
    model = robot.model
    end = "upper" if model.latch_side[latch] > 0 else "lower"
    release = model.latch_release[latch]
    until = f", until {robot.link_names[release]} touches down" if release >= 0 else ""
    return f"{robot.latch_names[latch]} at its {end} end{until}"
