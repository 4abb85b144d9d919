"""What to change so that a walk lasts, as data that a program can follow."""

from __future__ import annotations

import enum
from collections.abc import Iterator

import numpy as np

from heelstrike.analysis.diagnosis.falls import Fall
from heelstrike.analysis.diagnosis.symptoms import FOOTHOLD, Cause
from heelstrike.control.balance.controllers import FootstepFeedback
from heelstrike.errors import HeelstrikeError
from heelstrike.field_texts import dataclass
from heelstrike.gait.gait import Gait
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run

RESERVE = 1.25
"""What is asked for, in what is needed."""
CLEARANCE_RESERVE = 0.02
"""How much higher (m) than the ground there, or than now, a swing foot shall pass."""


class Lever(enum.Enum):
    """What a proposed change alters.

    ``CONTROLLER``
        The law; the value is the name of its class in :mod:`heelstrike`.
    ``FRICTION``
        Least friction of the ground under the feet.
    ``TORQUE_LIMIT``
        Least limit of the torques of all motors, in N m.
    ``GAIT_FRICTION``, ``GAIT_CLEARANCE``, ``GAIT_SPEED``
        Argument of :func:`heelstrike.optimize_gait` for the next gait: ``friction``, ``clearance``
        in m, or the speed in that of this one, steps as long as now.
    ``GAIT_JOINT_RANGES``
        Reserve to the ends of the range of a joint that the next gait shall keep, in rad.
    ``TIME_STEP``
        Step of the method, in s.
    """

    CONTROLLER = "controller"
    FRICTION = "friction"
    TORQUE_LIMIT = "torque limit"
    GAIT_FRICTION = "gait: friction"
    GAIT_CLEARANCE = "gait: clearance"
    GAIT_SPEED = "gait: speed"
    GAIT_JOINT_RANGES = "gait: joint ranges"
    TIME_STEP = "time step"


@dataclass(frozen=True)
class Change:
    """A change that may keep a robot from falling."""

    lever: Lever
    """What."""
    value: float | str
    """To what, as the lever says."""
    where: str = ""
    """Name of the joint that it is about; nothing if it is about none."""
    reason: str = ""
    """Why, in a sentence."""


@dataclass(frozen=True)
class Tried:
    """The outcome of a change or disturbance that was tried."""

    what: str
    """What was tried, in words."""
    outcome: str
    """What came of it, in words."""
    lasted: bool | None = None
    """Whether the walk lasted; None if it was no matter of that, or was not tried."""
    change: Change | None = None
    """The change that was tried, if it was one."""


def changes(run: Run, fall: Fall, gait: Gait | None = None) -> tuple[Change, ...]:
    """Propose changes that would keep a robot from falling, the most effective first.

    A change follows from the first cause alone: what came after it needs none.

    Parameters
    ----------
    run : Run
        The run that fell.
    fall : Fall
        Why, as :func:`~heelstrike.analysis.diagnosis.falls.first_cause` says.
    gait : Gait, optional
        The gait that it followed.

    Returns
    -------
    tuple of Change
        Nothing where nothing is known that would help.
    """
    return tuple(_changes(run, fall, gait))


def balancing_law(robot: Robot, gait: Gait | None) -> str:
    """Name of the law that steps where balance needs it, if the robot can have it."""
    if gait is None:
        return ""
    try:
        FootstepFeedback(robot, gait)
    except HeelstrikeError:
        return ""
    return FootstepFeedback.__name__


def _changes(run: Run, fall: Fall, gait: Gait | None) -> Iterator[Change]:
    law = "" if FOOTHOLD in run.log else balancing_law(run.robot, gait)
    balance = Change(
        Lever.CONTROLLER, law,
        reason="it sets the next foot where the robot can be caught, and keeps the zero moment "
        "point within the sole",
    )  # fmt: skip
    match fall.cause:
        case Cause.SLIPPED:
            yield from _more_friction(fall, gait)
        case Cause.TIPPED_FORWARD | Cause.TIPPED_BACK | Cause.LATE_TOUCHDOWN | Cause.LEG_GAVE_WAY:
            if law:
                yield balance
        case Cause.SCUFFED:
            if law:
                yield balance
            yield from _more_clearance(fall, gait)
        case Cause.TORQUE_LIMIT | Cause.SPEED_LIMIT:
            yield from _stronger_motors(fall, gait)
        case Cause.JOINT_STOP:
            if gait is not None:
                yield Change(
                    Lever.GAIT_JOINT_RANGES, 0.1, fall.where,
                    "the gait needs room between the joint and its stop for what feedback adds",
                )  # fmt: skip
            if law:
                yield balance
        case Cause.CONTROLLER:
            if law:
                yield Change(
                    Lever.CONTROLLER, law, fall.where,
                    "it drives every joint towards what it plans; or mend the sign, the gain or "
                    "the number that the controller gives this joint",
                )  # fmt: skip
        case Cause.NUMERICAL:
            step = getattr(run.method, "step", None)
            if step is not None:
                yield Change(
                    Lever.TIME_STEP, 0.1 * float(step),
                    reason="stiff gains, springs or small inertias need shorter steps",
                )  # fmt: skip


def _more_friction(fall: Fall, gait: Gait | None) -> Iterator[Change]:
    there = fall.evidence.get("friction", np.nan)
    if gait is None:
        return
    margins = gait.margins
    needed = gait.friction * max(margins.friction_use, margins.impulse_friction_use)
    if RESERVE * needed > there:
        yield Change(
            Lever.FRICTION, RESERVE * needed,
            reason=f"the gait needs {needed:.2g}, and the ground has {there:.2g}",
        )  # fmt: skip
        yield Change(
            Lever.GAIT_FRICTION, there / RESERVE,
            reason="a gait for the friction that there is, if there is one",
        )  # fmt: skip
    else:
        yield Change(
            Lever.FRICTION, 2.0 * there,
            reason="what the controller adds to the gait needs more than the ground has",
        )  # fmt: skip


def _more_clearance(fall: Fall, gait: Gait | None) -> Iterator[Change]:
    if gait is not None:
        rise = max(float(fall.evidence.get("rise_m", 0.0)), 0.0)
        yield Change(
            Lever.GAIT_CLEARANCE, round(max(rise, float(gait.clearance)) + CLEARANCE_RESERVE, 3),
            reason=f"the ground is {1e3 * rise:.0f} mm higher there than under the other foot",
        )  # fmt: skip


def _stronger_motors(fall: Fall, gait: Gait | None) -> Iterator[Change]:
    if gait is None:
        return
    needed = RESERVE * float(gait.margins.peak_torque)
    if fall.cause is Cause.TORQUE_LIMIT and needed > abs(fall.evidence["limit_Nm"]):
        yield Change(
            Lever.TORQUE_LIMIT, needed, fall.where,
            f"the gait alone needs {gait.margins.peak_torque:.3g} N m",
        )  # fmt: skip
    yield Change(
        Lever.GAIT_SPEED,
        0.75,
        fall.where,
        "a slower gait asks its motors for less speed and torque",
    )
