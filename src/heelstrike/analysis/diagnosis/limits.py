"""How close a run comes to what it cannot go beyond: friction, soles, motors, joint ranges."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.actuation import torque_bounds
from heelstrike.analysis.friction import friction_coefficient, friction_use
from heelstrike.analysis.zero_moment_point import zero_moment_point
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.sole import has_length, soles
from heelstrike.sim.run import Run

Rows = NDArray[np.bool_]

REACHED = 1.0 - 1e-6
"""Share of a limit from which it is reached, but for rounding."""


@dataclass(frozen=True)
class Limit:
    """How close a run came to a limit."""

    name: str
    """What is limited: friction of a foot, its zero moment point, a torque, a joint."""
    kind: str
    """``"friction"``, ``"zero moment point"``, ``"torque"``, ``"speed"`` or ``"joint"``."""
    used: float
    """Largest share of the limit, 1 at the limit; zero moment point: 0 in the middle of the sole, 1
    at its ends, in single support."""
    time: float
    """When that was, in s."""
    reached: float
    """When the limit was first reached (s); infinite if it never was."""
    detail: str
    """The same in units."""


def limits(run: Run, *, until: float = math.inf) -> tuple[Limit, ...]:
    """List the limits of a run: those that were reached in the order of time, then the closest.

    Parameters
    ----------
    run : Run
        The run.
    until : float
        Rows after this time (s) are left out, such as those of a fall.

    Returns
    -------
    tuple of Limit
        One for each foot, motor and joint that has a limit.
    """
    return tuple(
        sorted(_limits(run, run.time <= until), key=lambda limit: (limit.reached, -limit.used))
    )


def _limits(run: Run, shown: Rows) -> Iterator[Limit]:
    if not shown.any():
        return
    yield from _of_feet(run, shown)
    yield from _of_motors(run, shown)
    yield from _of_joints(run, shown)


def _of_feet(run: Run, shown: Rows) -> Iterator[Limit]:
    use, friction = friction_use(run).foot, friction_coefficient(run)
    zmp = zero_moment_point(run)
    alone = np.where(zmp.single_support[:, None], zmp.foot_margin, np.nan)
    for i, (foot, sole) in enumerate(zip(run.robot.feet, soles(run.robot), strict=True)):
        if (found := largest(run.time, use[:, i], shown)) is not None:
            k, used, reached = found
            time = float(run.time[k])
            there = float(friction[k, foot.contacts[0]])
            detail = f"{used * there:.3g} of {there:.3g} at {time:.3g} s"
            yield Limit(f"friction of the {_in_words(foot.name)}", "friction", used, time, reached,
                        detail)  # fmt: skip
        half = 0.5 * (sole.toe - sole.heel)
        if (
            has_length(run.robot, sole)
            and (found := largest(run.time, 1.0 - alone[:, i] / half, shown)) is not None
        ):
            k, used, reached = found
            time = float(run.time[k])
            margin = max(float(alone[k, i]), 0.0)
            detail = f"{1e3 * margin:.3g} mm from the end of the sole at {time:.3g} s"
            name = f"zero moment point of the {_in_words(foot.name)}"
            yield Limit(name, "zero moment point", used, time, reached, detail)


def _of_motors(run: Run, shown: Rows) -> Iterator[Limit]:
    model = run.robot.model
    lower, upper = torque_bounds(run)
    for i, name in enumerate(run.robot.actuator_names):
        joint = model.actuator_joint[i]
        hinge = bool(model.axis[joint, 0] != 0.0)
        ends = lower[:, i], upper[:, i]
        yield from limit_of_torque(run.time, name, run.torque[:, i], ends, shown, hinge=hinge)
        fastest, speed = float(model.no_load_speed[joint]), run.velocity[:, joint]
        yield from limit_of_speed(run.time, name, speed, fastest, shown, hinge=hinge)


def limit_of_torque(
    time: Floats,
    name: str,
    torque: Floats,
    ends: tuple[Floats, Floats],
    shown: Rows,
    *,
    hinge: bool,
) -> Iterator[Limit]:
    """Yield how close a torque (nt,) comes to its ends, if it has any."""
    reached = np.where(torque < 0.0, *ends)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(torque == 0.0, 0.0, torque / reached)
    if np.isfinite(reached).any() and (found := largest(time, share, shown)) is not None:
        k, used, first = found
        unit = "N m" if hinge else "N"
        detail = f"{torque[k]:.3g} of {reached[k]:.3g} {unit} at {time[k]:.3g} s".replace("-", "−")
        yield Limit(f"torque of {_in_words(name)}", "torque", used, float(time[k]), first, detail)


def limit_of_speed(
    time: Floats, name: str, speed: Floats, fastest: float, shown: Rows, *, hinge: bool
) -> Iterator[Limit]:
    """Yield how close the speed (nt,) of a motor comes to that without load, if that is known."""
    speed = np.abs(speed)
    if np.isfinite(fastest) and (found := largest(time, speed / fastest, shown)) is not None:
        k, used, first = found
        detail = f"{speed[k]:.3g} of {fastest:.3g} {'rad/s' if hinge else 'm/s'} at {time[k]:.3g} s"
        yield Limit(f"speed of {_in_words(name)}", "speed", used, float(time[k]), first, detail)


def _of_joints(run: Run, shown: Rows) -> Iterator[Limit]:
    model = run.robot.model
    for joint, name in enumerate(run.robot.joint_names):
        ends = float(model.lower[joint]), float(model.upper[joint])
        hinge = bool(model.axis[joint, 0] != 0.0)
        yield from limit_of_range(run.time, name, run.position[:, joint], ends, shown, hinge=hinge)


def limit_of_range(
    time: Floats, name: str, angle: Floats, ends: tuple[float, float], shown: Rows, *, hinge: bool
) -> Iterator[Limit]:
    """Yield how close a joint (nt,) comes to the ends of its range, if it has two."""
    low, high = ends
    if not (np.isfinite(low) and np.isfinite(high) and high > low):
        return
    share = np.abs(angle - 0.5 * (low + high)) / (0.5 * (high - low))
    if (found := largest(time, share, shown)) is not None:
        k, used, first = found
        away = max(min(float(angle[k]) - low, high - float(angle[k])), 0.0)
        detail = f"{away:.3g} {'rad' if hinge else 'm'} from its stop at {time[k]:.3g} s"
        yield Limit(f"range of {_in_words(name)}", "joint", used, float(time[k]), first, detail)


def largest(time: Floats, share: Floats, shown: Rows) -> tuple[int, float, float] | None:
    """Row of the largest share (nt,), the share, and when it first reached 1 (s)."""
    share = np.where(shown & np.isfinite(share), share, np.nan)
    if np.isnan(share).all():
        return None
    k = int(np.nanargmax(share))
    there = np.flatnonzero(share >= REACHED)
    return k, float(share[k]), float(time[there[0]]) if len(there) else math.inf


def _in_words(name: str) -> str:
    return name.replace("_", " ")
