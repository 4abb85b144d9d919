"""How close a run comes to what it cannot go beyond: friction, soles, motors, joint ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.actuation import torque_bounds, turning
from heelstrike.analysis.friction import friction_coefficient, friction_use
from heelstrike.analysis.zero_moment_point import zero_moment_point
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.sole import has_length, soles
from heelstrike.sim.run import AnyRun, Run

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
    shown = run.time <= until
    return ordered(_limits(run, shown) if shown.any() else ())


def ordered(found: Iterable[Limit]) -> tuple[Limit, ...]:
    """Return limits in the order in which they were reached, then the closest first."""
    return tuple(sorted(found, key=lambda limit: (limit.reached, -limit.used)))


def _limits(run: Run, shown: Rows) -> Iterator[Limit]:
    model = run.robot.model
    yield from _of_feet(run, shown)
    yield from of_motors(run, shown)
    for joint, name in enumerate(run.robot.joint_names):
        ends = float(model.lower[joint]), float(model.upper[joint])
        hinge = bool(model.axis[joint, 0] != 0.0)
        yield from limit_of_range(run.time, name, run.position[:, joint], ends, shown, hinge=hinge)


def _of_feet(run: Run, shown: Rows) -> Iterator[Limit]:
    use, friction = friction_use(run).foot, friction_coefficient(run)
    zmp = zero_moment_point(run)
    alone = np.where(zmp.single_support[:, None], zmp.foot_margin, np.nan)
    for i, (foot, sole) in enumerate(zip(run.robot.feet, soles(run.robot), strict=True)):
        there = friction[:, foot.contacts[0]]
        yield from limit_of_friction(run.time, foot.name, use[:, i], there, shown)
        if has_length(run.robot, sole):
            half, of = 0.5 * (sole.toe - sole.heel), f" of the {_in_words(foot.name)}"
            yield from limit_of_pressure(
                run.time, of, alone[:, i], half, shown, edge="the end of the sole"
            )


def of_motors(run: AnyRun, shown: Rows) -> Iterator[Limit]:
    """Yield how close the motors of a run come to their torques and speeds."""
    lower, upper = torque_bounds(run)
    hinges = turning(run.robot)
    for i, name in enumerate(run.robot.actuator_names):
        k = int(run.robot.driven[i])
        ends, fastest = (lower[:, i], upper[:, i]), float(run.robot.model.no_load_speed[k])
        hinge, speed = bool(hinges[k]), np.abs(run.velocity[:, k])
        yield from _limit_of_torque(run.time, name, run.torque[:, i], ends, shown, hinge=hinge)
        yield from _limit_of_speed(run.time, name, speed, fastest, shown, hinge=hinge)


def limit_of_friction(
    time: Floats, foot: str, share: Floats, friction: Floats, shown: Rows
) -> Iterator[Limit]:
    """Yield how much of its friction (nt,) a foot uses at most."""

    def told(k: int) -> str:
        return f"{share[k] * friction[k]:.3g} of {friction[k]:.3g}"

    yield from _worst(f"friction of the {_in_words(foot)}", "friction", time, share, shown, told)


def limit_of_pressure(
    time: Floats, of: str, margin: Floats, room: Floats | float, shown: Rows, *, edge: str
) -> Iterator[Limit]:
    """Yield how close a zero moment point comes to an edge, from which `room` (m) is farthest."""

    def told(k: int) -> str:
        return f"{1e3 * max(float(margin[k]), 0.0):.3g} mm from {edge}"

    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(np.asarray(room) > 0.0, 1.0 - margin / room, np.nan)
    name = "zero moment point"
    yield from _worst(f"{name}{of}", name, time, share, shown, told)


def _limit_of_torque(
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

    def told(k: int) -> str:
        unit = "N m" if hinge else "N"
        return f"{torque[k]:.3g} of {reached[k]:.3g} {unit}".replace("-", "−")

    if np.isfinite(reached).any():
        yield from _worst(f"torque of {_in_words(name)}", "torque", time, share, shown, told)


def _limit_of_speed(
    time: Floats, name: str, speed: Floats, fastest: float, shown: Rows, *, hinge: bool
) -> Iterator[Limit]:
    """Yield how close a motor comes to its fastest speed, if it has one."""

    def told(k: int) -> str:
        return f"{speed[k]:.3g} of {fastest:.3g} {'rad/s' if hinge else 'm/s'}"

    if np.isfinite(fastest):
        share = speed / fastest
        yield from _worst(f"speed of {_in_words(name)}", "speed", time, share, shown, told)


def limit_of_range(
    time: Floats, name: str, angle: Floats, ends: tuple[float, float], shown: Rows, *, hinge: bool
) -> Iterator[Limit]:
    """Yield how close a joint comes to the ends of its range, if it has both."""
    low, high = ends
    if not (np.isfinite(low) and np.isfinite(high) and high > low):
        return
    share = np.abs(angle - 0.5 * (low + high)) / (0.5 * (high - low))

    def told(k: int) -> str:
        away = max(min(float(angle[k]) - low, high - float(angle[k])), 0.0)
        return f"{away:.3g} {'rad' if hinge else 'm'} from its stop"

    yield from _worst(f"range of {_in_words(name)}", "joint", time, share, shown, told)


def _worst(
    name: str, kind: str, time: Floats, share: Floats, shown: Rows, told: Callable[[int], str]
) -> Iterator[Limit]:
    """Yield the largest share (nt,) of a limit in some rows, if any has one.

    `told` says what it is in a row.
    """
    share = np.where(shown & np.isfinite(share), share, np.nan)
    if np.isnan(share).all():
        return
    k = int(np.nanargmax(share))
    there = np.flatnonzero(share >= REACHED)
    reached = float(time[there[0]]) if len(there) else math.inf
    detail = f"{told(k)} at {time[k]:.3g} s"
    yield Limit(name, kind, float(share[k]), float(time[k]), reached, detail)


def _in_words(name: str) -> str:
    return name.replace("_", " ")
