"""Springs and dampers about a gait, with none, some and all of the dynamics fed forward."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.errors import ControllerError


def walk(feedforward: str) -> hs.Run:
    law = hs.JointPD(walking.bravo7(), walking.gait(), kp=1000.0, kd=20.0, feedforward=feedforward)
    return hs.simulate(walking.bravo7(), law, state=walking.gait().initial_state, duration=0.6)


def error(run: hs.Run) -> float:
    """Largest error of a joint in the first step (rad)."""
    wanted = walking.gait().position(run.time)
    return float(np.abs(run.position[:, 3:] - wanted).max())


def test_what_is_fed_forward_is_not_left_to_the_springs() -> None:
    errors = {known: error(walk(known)) for known in ("none", "gravity", "full")}
    assert errors["full"] < 0.002
    assert errors["none"] > 5.0 * errors["full"]
    assert errors["gravity"] > 5.0 * errors["full"]


def test_torques_are_those_of_the_law() -> None:
    """At the beginning, on the gait, full feedforward is all there is: that of computed torque."""
    robot, gait = walking.bravo7(), walking.gait()
    full = hs.JointPD(robot, gait, kp=800.0, kd=40.0)
    usual = hs.ComputedTorque(robot, gait)
    contacts = hs.Simulation(robot, state=gait.initial_state).contacts
    expected = usual.torque(0.0, gait.initial_state, contacts)
    np.testing.assert_allclose(
        full.torque(0.0, gait.initial_state, contacts), expected, rtol=1e-6, atol=1e-4
    )
    bent = hs.State(gait.initial_state.q + 0.01 * np.eye(9)[4], gait.initial_state.v)
    none = hs.JointPD(robot, gait, kp=800.0, kd=40.0, feedforward="none")
    np.testing.assert_allclose(
        none.torque(0.0, bent, contacts), -8.0 * np.eye(6)[1], rtol=1e-6, atol=1e-4
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"kp": -1.0}, "must not be negative"),
        ({"feedforward": "most"}, "one of 'none', 'gravity', 'full', got 'most'"),
        ({"kp": [1.0, 2.0]}, "one finite number or 6"),
    ],
)
def test_wrong_numbers_are_named(options: dict[str, Any], said: str) -> None:
    given = {"kp": 1.0, "kd": 1.0} | options
    with pytest.raises(ControllerError, match=said):
        hs.JointPD(walking.bravo7(), walking.gait(), **given)
