"""Robots in space that hold their posture, go limp or are driven by a law of a user."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from heelstrike.control.spatial.gains import bearable_gains
from heelstrike.control.spatial.hold_posture import HoldPosture
from heelstrike.errors import ControllerError
from heelstrike.experiments.own_law import own_law
from heelstrike.field_texts import dataclass
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.spatial.controlled import driven_positions
from heelstrike.wording import meant

KP, KD = 200.0, 5.0
"""Stiffness (N m/rad) and damping (N m s/rad) with which a posture is held, where a joint bears
them."""


@dataclass(frozen=True)
class SpatialLaw:
    """A law of robots in space by its name."""

    name: str
    """What it is called."""
    make: Callable[[SpatialRobot, float], Any]
    """Takes a robot and the step (s) over which torques are held, returns a new controller; None
    where nothing drives the joints."""
    source: str = ""
    """File of a user whose code was run for it."""


def holds(robot: SpatialRobot) -> bool:
    """Whether a robot can hold a posture: it has motors, on hinges and slides alone."""
    return bool(robot.nu) and bool(np.all(driven_positions(robot) >= 0))


def hold(robot: SpatialRobot, step: float, *, kp: float = KP, kd: float = KD) -> HoldPosture | None:
    """Return the law that holds the posture of a robot's file, its gains no more than a step bears.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    step : float
        Time over which torques are held (s).
    kp, kd : float
        Stiffness (N m/rad) and damping (N m s/rad) that are asked for.

    Returns
    -------
    HoldPosture or None
        None for a robot without motors.
    """
    if not robot.nu:
        return None
    stiffness, damping = bearable_gains(robot, step, kp=kp, kd=kd)
    return HoldPosture(robot, kp=stiffness, kd=damping)


HOLD = SpatialLaw("HoldPosture", hold)
LIMP = SpatialLaw("no torque", lambda robot, step: None)  # noqa: ARG005 - it needs neither


def spatial_law_called(words: str) -> SpatialLaw:
    """Return a law of robots in space by its name, or one of a user.

    Parameters
    ----------
    words : str
        ``HoldPosture``, whose capitals and hyphens do not matter; or ``module:name`` or
        ``file.py:name`` of a class or function of a robot, whose code is run.

    Returns
    -------
    SpatialLaw
        The law.

    Raises
    ------
    ControllerError
        If there is none.
    """
    if ":" in words:
        making, source = own_law(words)
        return SpatialLaw(words, lambda robot, step: making(robot, None), source)  # noqa: ARG005
    name = words.replace("-", "").replace("_", "").lower()
    if name == HOLD.name.lower():
        return HOLD
    raise ControllerError(
        f"there is no controller {words!r} of robots in space."
        f"{meant(name, {HOLD.name.lower(): repr(HOLD.name)})} There is {HOLD.name}. One of your "
        "own is MODULE:NAME or FILE.py:NAME, a class or function of a robot."
    )
