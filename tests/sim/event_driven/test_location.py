"""Where in a step an event is: also long before the first place at which the step is looked at."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import heelstrike as hs
from heelstrike.sim import EventKind

GRAVITY, STIFFNESS = 9.81, 1e4


def hopper() -> hs.Robot:
    """A foot of 1 kg with another kilogram on a spring above it, which move up and down."""
    builder = hs.RobotBuilder("hopper")
    foot = builder.slide("foot", None, direction=(0, 1), mass=1.0)
    builder.slide("body", foot, direction=(0, 1), mass=1.0, stiffness=STIFFNESS)
    builder.contact(foot, (0.0, 0.0))
    return builder.build()


def test_a_foot_that_leaves_comes_back_and_leaves_within_a_quarter_of_a_step_is_seen() -> None:
    """It leaves with 2e-6 m/s under 0.5 m/s² downwards, which a jerk of 7500 m/s³ turns round.

    Left to itself it would be in the ground after 8 µs, by 1.2 nm, and be out of it after 0.2 ms:
    before the first sample of a step of 1 ms. It stands instead until the spring lifts it, of which
    the length obeys u'' = -g - u k/m.
    """
    pull, rise = (GRAVITY - 0.5) / STIFFNESS, 0.75
    run = hs.simulate(
        hopper(), state=hs.State([0.0, pull], [2e-6, rise]), duration=1e-3,
        method=hs.EventDriven(output_period=1e-5), stop_when_fallen=False,
    )  # fmt: skip
    turns, sag = np.sqrt(STIFFNESS), GRAVITY / STIFFNESS
    length = lambda t: (  # noqa: E731
        -sag + (pull + sag) * np.cos(turns * t) + rise / turns * np.sin(turns * t)
    )
    lifts = brentq(lambda t: STIFFNESS * length(t) - GRAVITY, 0.0, 2e-4, xtol=1e-15)
    assert run.certificates.penetration <= 1e-10
    assert [event.kind for event in run.events][-1] is EventKind.LIFTOFF
    # The spring lengthened by 2e-6 m/s for 8 µs less, which is 2e-10 s of its way.
    assert run.events[-1].time == pytest.approx(lifts, abs=1e-9)
