"""What of a controller's memory is an instant, and what a place."""

from __future__ import annotations

import mechanisms
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.analysis.stability.loop import ClosedLoop
from heelstrike.analysis.stability.section import Section

RAMP = hs.Ground(friction=3.0, slope=-np.deg2rad(3.0))
METHOD = hs.EventDriven(rtol=1e-12, atol=1e-13, swing_feet_pass=True)
SPEED = 0.535445415 / 0.734720962
"""Of the compass gait at 9.8 m/s², m/s; it grows as the root of that."""


class Memory(hs.Bundle):
    """When the controller was called, and how high and where the hip was, all of them late."""

    since: float = hs.cell(float)
    hip: np.ndarray = hs.array(2)
    speed: float = hs.cell(float)


@hs.controller
def remembers(t, state, memory: Memory, torque):
    memory.since += 0.01 * (t - memory.since)
    memory.hip[0] += 0.01 * (state.q[0] - memory.hip[0])
    memory.hip[1] += 0.01 * (state.q[1] - memory.hip[1])
    memory.speed += 0.01 * (state.v[0] - memory.speed)


@pytest.mark.parametrize("speed", [0.97, 1.0])
def test_places_are_no_instants_at_one_metre_a_second(speed: float) -> None:
    """They grow alike. A walk that begins elsewhere tells: heights go down a ramp with it."""
    faster = speed / SPEED
    robot = mechanisms.compass_gait(9.8 * faster**2)
    angles = (-0.218668803, 0.323388558)
    rates = faster * 1.091826677, faster * 0.377181558
    hip = np.array([np.cos(angles[0]), -np.sin(angles[0])]) * rates[0]
    height = np.array([np.sin(angles[0]), np.cos(angles[0])])
    state = hs.State(np.array([*height, *angles]), np.array([*hip, *rates]))
    loop = ClosedLoop(robot, remembers(), state, method=METHOD, ground=RAMP, control_period=2e-3)
    words = Section(loop, loop.follow(8, 2, 3.0), 1e-4, None).words
    assert words.names == ["memory.since", "memory.hip[0]", "memory.hip[1]", "memory.speed"]
    np.testing.assert_array_equal(words.instants, [1.0, 0.0, 0.0, 0.0])
    across, up = np.cos(RAMP.slope), np.sin(RAMP.slope)
    np.testing.assert_allclose(words.places, [0.0, across, up, 0.0], atol=2e-3)
