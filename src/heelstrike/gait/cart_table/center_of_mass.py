"""How the centre of mass moves for the zero moment point to be where it is wanted.

Both planners take the robot for a cart on a table (an inverted pendulum of constant height): all
its mass in one point at a height h, p = x − (h/g) ẍ.
"""

from __future__ import annotations

import enum
from collections.abc import Callable

import numpy as np

from heelstrike.gait.cart_table.preview import preview_control
from heelstrike.robot.model import Floats

PREVIEW = 1.6
"""Time that preview control looks ahead (s), as in the paper."""

Motion = Callable[[Floats], Floats]
"""Takes times of a step (N,), in s; returns position, velocity and acceleration, (3, N)."""


class Planner(enum.Enum):
    """How the motion of the centre of mass is planned.

    ``PREVIEW``
        Preview control: the jerk that brings the zero moment point to where it is wanted next.
    ``CAPTURE_POINT``
        The capture point ξ = x + ẋ/ω diverges from the zero moment point, ξ̇ = ω (ξ − p): of all its
        motions one repeats, which the centre of mass follows (Englsberger, Ott, Albu-Schäffer 2015,
        *Three-dimensional bipedal walking control based on divergent component of motion*).
    """

    PREVIEW = "preview"
    CAPTURE_POINT = "capture_point"


def followed(
    planner: Planner, times: Floats, wanted: Floats, height: float, gravity: float
) -> Motion:
    """Return the motion of the centre of mass that repeats from step to step.

    Parameters
    ----------
    planner : Planner
        How it is planned.
    times : (n + 1,) array
        Times of a step at equal distances, from 0 to its duration (s).
    wanted : (n + 1,) array
        Zero moment point (m) at those, linear in between. From step to step it moves on by the
        distance between its ends.
    height, gravity : float
        Height of the centre of mass above the ground (m); gravity (m/s²).
    """
    if planner is Planner.PREVIEW:
        return _previewed(times, wanted, height, gravity)
    return _captured(times, wanted, height, gravity)


def _previewed(times: Floats, wanted: Floats, height: float, gravity: float) -> Motion:
    period = float(times[1])
    servo = preview_control(
        height=height, gravity=gravity, period=period, horizon=round(PREVIEW / period)
    )
    states, jerks = servo.repeated(wanted)

    def motion(t: Floats) -> Floats:
        k = np.clip((t / period).astype(np.int64), 0, len(jerks) - 1)
        s, u = t - times[k], jerks[k]
        x, v, a = states[k].T
        return np.stack(
            [x + s * (v + s * (a / 2.0 + s * u / 6.0)), v + s * (a + s * u / 2.0), a + s * u]
        )

    return motion


def _captured(times: Floats, wanted: Floats, height: float, gravity: float) -> Motion:
    """Between samples p is linear and y = x − p obeys ÿ = ω² y: 2 y = a exp(ωs) + b exp(−ωs).

    Where the slope of p jumps by Δ, a falls by Δ/ω, and b rises by that. The motion that repeats
    has the a that comes of what is ahead, and the b that is left of what was before.
    """
    rate, period = float(np.sqrt(gravity / height)), float(times[1])
    decay, slope = float(np.exp(-rate * period)), np.diff(wanted) / period
    jump = (np.roll(slope, -1) - slope) / rate
    b = _repeating(decay, jump)
    a = decay * np.roll(_repeating(decay, jump[::-1])[::-1], 1)

    def motion(t: Floats) -> Floats:
        k = np.clip((t / period).astype(np.int64), 0, len(slope) - 1)
        s = t - times[k]
        up, down = 0.5 * a[k] * np.exp(rate * s), 0.5 * b[k] * np.exp(-rate * s)
        p = wanted[k] + slope[k] * s
        return np.stack([p + up + down, slope[k] + rate * (up - down), rate**2 * (up + down)])

    return motion


def _repeating(decay: float, inputs: Floats) -> Floats:
    """Solve x(k + 1) = decay x(k) + u(k) with an end that is the beginning, (n,)."""
    x = 0.0
    for u in inputs:
        x = decay * x + u
    x /= 1.0 - decay ** len(inputs)
    found = []
    for u in inputs:
        found.append(x)
        x = decay * x + u
    return np.array(found)
