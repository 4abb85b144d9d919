"""Passive walkers of the library: walks down a slope, without motors, that repeat."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from heelstrike.analysis.limit_cycle import LimitCycle, find_limit_cycle
from heelstrike.contact.ground import Ground
from heelstrike.errors import LimitCycleError
from heelstrike.robot import Robot, State
from heelstrike.sim import EventDriven

METHOD = EventDriven(rtol=1e-12, atol=1e-13, swing_feet_pass=True)
"""How steps of a search are taken; legs of one length scuff the ground at mid-stance."""

COMPASS = (
    (0.7094, 0.0757, -0.1796, 0.2269),
    (3.6618, 0.7549, -9.457, 5.7268),
    (3.632, 1.5454, -30.7392, 21.0734),
)
"""Half the angle between the legs of the compass gait at touchdown (rad) and the rates (rad/s) of
the leg that stands and of the one that swings: coefficients of the first four powers of the cube
root of the slope (rad). They fit the walks that :func:`find_limit_cycle` finds from 0.05 to 11
degrees, beginning with that of Goswami, Thuilot and Espiau (1998) at 3, to 2e-3. On mild slopes all
three grow as the cube root (Garcia, Chatterjee, Ruina and Coleman 1998)."""

KNEED = (
    (0.4979, 1.0343, -2.5113, 2.1547),
    (7.1529, -20.2919, 33.8375, -25.2039),
    (16.7358, -81.9301, 138.2479, -102.7759),
)
"""The same of the kneed walker, from 2 to 6.5 degrees, to 5e-3. On milder slopes no walk was found;
beyond 6.1 degrees the one that repeats is not stable."""

USUAL_SLOPES = {"compass_gait": -3.0, "kneed_walker": -3.0, "rimless_wheel": -8.0}
"""Slopes (degrees) on which walkers of the library have a walk that repeats and is stable."""

HALF_SPOKE = np.pi / 8.0
"""Half the angle between two spokes of the rimless wheel, in rad."""


def passive_walk(robot: Robot, ground: Ground) -> LimitCycle:
    """Find the walk of a passive walker of the library that repeats on a slope.

    Parameters
    ----------
    robot : Robot
        A robot without motors, known by its name: ``compass_gait``, ``kneed_walker`` or
        ``rimless_wheel``.
    ground : Ground
        One slope that descends along +x.

    Returns
    -------
    LimitCycle
        The walk, with a state to start on.

    Raises
    ------
    LimitCycleError
        If no walk of this robot is known, or it has none that repeats on this ground.
    """
    start = _STARTS.get(robot.name)
    if start is None:
        raise LimitCycleError(
            f"robot {robot.name!r} has no motors, and no start of its walk is known, as "
            f"for {', '.join(_STARTS)}. Find a walk that repeats with "
            "hs.find_limit_cycle, from a state near it, and simulate from there with "
            "hs.simulate."
        )
    descent = -ground.slope
    if ground.profile is not None or ground.shape is not None or not descent > 0.0:
        raise LimitCycleError(
            f"robot {robot.name!r} has no motors and walks down a slope only: give it ground that "
            f"descends along +x, {_ground_for(robot)}."
        )
    friction = float(ground.model().friction.min())
    try:
        return find_limit_cycle(robot, start(robot, descent), ground=ground, method=METHOD)
    except LimitCycleError as error:
        raise LimitCycleError(
            f"found no walk of {robot.name!r} that repeats on a slope of "
            f"-{np.rad2deg(descent):.4g} degrees with friction {friction:g}: "
            f"{str(error).rstrip('.')}. There is one on {_ground_for(robot)}, with friction 0.75."
        ) from error


def _ground_for(robot: Robot) -> str:
    """Ground on which a walker of the library walks, for Python and for the command line."""
    degrees = USUAL_SLOPES[robot.name]
    return f"Ground(slope={np.deg2rad(degrees):.3g}), or --ground slope:{degrees:g}"


def _compass_gait(robot: Robot, descent: float) -> State:
    return _on_two_legs(robot, descent, ("right_leg", "left_leg"), COMPASS)


def _kneed_walker(robot: Robot, descent: float) -> State:
    return _on_two_legs(robot, descent, ("right_hip", "left_hip"), KNEED)


def _on_two_legs(
    robot: Robot, descent: float, legs: tuple[str, str], fit: Sequence[Sequence[float]]
) -> State:
    """State just after touchdown, legs of 1 m straight, the right foot at the origin."""
    powers = np.cbrt(descent) ** np.arange(1, 5)
    half, stance_rate, swing_rate = np.array(fit) @ powers
    stance, swing = descent - half, descent + half
    hip = np.array([np.cos(stance), -np.sin(stance)]) * stance_rate
    return robot.state(
        {
            **{"root_x": np.sin(stance), "root_z": np.cos(stance)},
            **dict(zip(legs, (stance, swing), strict=True)),
        },
        {
            **{"root_x": hip[0], "root_z": hip[1]},
            **dict(zip(legs, (stance_rate, swing_rate), strict=True)),
        },
    )


def _rimless_wheel(robot: Robot, descent: float) -> State:
    """State just after a spoke has met the ground at the origin, at the speed of the closed form.

    Rolling over a spoke of length r adds 4 g/r sin α sin γ to the square of the speed, of which an
    impact keeps cos² 2α (Coleman 1998), for the spokes α = 22.5° apart from the middle between two.
    """
    gravity = float(np.hypot(*robot.model.gravity))
    kept = np.cos(2.0 * HALF_SPOKE) ** 2
    gained = 4.0 * gravity * np.sin(HALF_SPOKE) * np.sin(descent)
    rate = float(np.sqrt(gained * kept / (1.0 - kept)))
    lean = descent - HALF_SPOKE
    return robot.state(
        {"root_x": np.sin(lean), "root_z": np.cos(lean), "root_pitch": descent},
        {"root_x": np.cos(lean) * rate, "root_z": -np.sin(lean) * rate, "root_pitch": rate},
    )


_STARTS: dict[str, Callable[[Robot, float], State]] = {
    "compass_gait": _compass_gait,
    "kneed_walker": _kneed_walker,
    "rimless_wheel": _rimless_wheel,
}
"""States near the walk of the library's passive walkers, by the slope's descent (rad)."""
