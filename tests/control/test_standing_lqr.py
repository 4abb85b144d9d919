"""The regulator of standing: simulations decay as its poles say, and it stands pushes."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import walking
from scipy.linalg import expm
from scipy.signal import cont2discrete

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.errors import ControllerError


@cache
def crouch() -> np.ndarray:
    """bravo7 with its trunk 10 cm lower, feet flat."""
    robot = walking.bravo7()
    q = robot.reference_state().q.copy()
    q[1] -= 0.10
    for foot in ("right_foot", "left_foot"):
        q = dynamics.inverse_kinematics(robot, q, foot, (0.0, 0.0, 0.0)).q
    return q


def transition(law: Any, time: float) -> np.ndarray:
    """What the linear model makes of (y, ẏ) in a time."""
    A, B = law.linear.A, law.linear.B
    if law.period is None:
        return expm((A - B @ law.gain) * time)
    A, B, *_ = cont2discrete((A, B, np.eye(len(A)), np.zeros(B.shape)), law.period)
    return np.linalg.matrix_power(A - B @ law.gain, round(time / law.period))


@pytest.mark.parametrize("period", [2e-3, None])
def test_simulations_decay_as_the_poles_say(period: float | None) -> None:
    """The simulated response to each disturbance is that of the linear model.

    Differences are of first order in a disturbance of 1e-5, central ones of second: what is left is
    the integration's error over the disturbance. A law that acts continuously is integrated, one
    with a period held meanwhile; either is exact.
    """
    robot, q = walking.bravo7(), crouch()
    law: Any = hs.StandingLQR(robot, q, period=period)
    basis, small, time = law.linear.basis, 1e-5, 0.2
    k = basis.shape[1]
    assert k == 3  # nine coordinates, six held by two flat feet of four points
    expected = transition(law, time)
    # What decays slowest, disturbed in velocity alone and along the poles.
    for direction in np.eye(k):
        ends = []
        for sign in (1.0, -1.0):
            start = hs.State(q, sign * small * basis @ direction)
            run = hs.simulate(
                robot, law, state=start, duration=time,
                method=hs.EventDriven(rtol=1e-10, atol=1e-12),
            )  # fmt: skip
            end = run.final_state
            ends.append(np.concatenate([basis.T @ (end.q - q), basis.T @ end.v]))
        found = (ends[0] - ends[1]) / (2.0 * small)
        np.testing.assert_allclose(found, expected[:, k:] @ direction, atol=1e-6)
    values, poles = np.linalg.eigvals(expected), np.exp(law.poles * time)
    np.testing.assert_allclose(np.poly(values).real, np.poly(poles).real, atol=1e-9)
    assert law.poles.real.max() < -1.0


def test_torques_of_least_cost_press_no_feet_apart() -> None:
    """Where both feet stand alike, both legs do the same, in feedforward and feedback."""
    law = hs.StandingLQR(walking.bravo7(), crouch())
    for numbers in (law.parameters.feedforward, law.parameters.by_position):
        np.testing.assert_allclose(numbers[:3], numbers[3:], atol=1e-6)
    weight = np.full(6, 1.0)
    weight[3:] = 100.0  # the left leg's torques cost ten times as much
    dear: Any = hs.StandingLQR(walking.bravo7(), crouch(), torque_weight=weight)
    np.testing.assert_allclose(100.0 * dear.gain[3:], dear.gain[:3], rtol=1e-6)


@pytest.mark.parametrize("impulse", [12.0, -12.0])
def test_it_stands_pushes_anywhere(impulse: float) -> None:
    robot, q = walking.bravo7(), crouch().copy()
    law = hs.StandingLQR(robot, q)
    q[0] += 3.0
    push = hs.Push("trunk", force=(10.0 * impulse, 0.0), start=0.1, duration=0.1)
    run = hs.simulate(robot, law, state=hs.State(q, np.zeros(9)), duration=4.0, pushes=push)
    assert run.completed
    assert abs(run.final_state.q[2] - q[2]) < 0.01
    assert np.abs(run.final_state.v).max() < 0.01


@pytest.mark.parametrize("name", ["geyer7", "spring_flamingo", "rabbit"])
def test_other_robots_stand(name: str) -> None:
    """Point feet apart carry no moments; two of them still hold four coordinates of seven."""
    robot = hs.load_robot(name)
    q = robot.reference_state().q.copy()
    if name == "rabbit":
        legs = [robot.joint_names.index(f"{side}_hip") for side in ("right", "left")]
        q[legs] += [0.2, -0.2]
        q[1] -= dynamics.contact_positions(robot, q)[:, 1].min() - robot.model.contact_radius.min()
    law: Any = hs.StandingLQR(robot, q)
    assert law.poles.real.max() < 0.0
    v = np.zeros(robot.nv)
    run = hs.simulate(robot, law, state=hs.State(q, v), duration=1.0)
    assert run.completed
    np.testing.assert_allclose(run.final_state.q, q, atol=1e-4)


def in_the_air(q: np.ndarray, height: float = 0.01) -> np.ndarray:
    return q + height * np.eye(9)[1]


def leaning(q: np.ndarray) -> np.ndarray:
    """The body turned about the ankles, feet flat, so that the weight is before the toes."""
    tilted = q.copy()
    tilted[2] += 0.3
    tilted[0] += 0.25
    tilted[1] -= 0.03
    for foot in ("right_foot", "left_foot"):
        tilted = dynamics.inverse_kinematics(walking.bravo7(), tilted, foot, (0.0, 0.0, 0.0)).q
    return tilted


@pytest.mark.parametrize(
    ("posture", "options", "said"),
    [
        (in_the_air, {}, "does not stand in this posture: .* 0.01 m above the ground"),
        (lambda q: in_the_air(q, -0.01), {}, "0.01 m below the ground"),
        (lambda q: np.nan * q, {}, "a posture is of 9 finite numbers"),
        (leaning, {}, "cannot rest in this posture.*centre of mass over its feet"),
        (None, {"torque_weight": 0.0}, "torque_weight must be positive"),
        (None, {"position_weight": [1.0, 2.0]}, "position_weight must be one number"),
        (None, {"velocity_weight": -1.0}, "velocity_weight must be one number"),
        (None, {"period": 0.0}, "period must be a positive number"),
    ],
)
def test_what_cannot_stand_is_refused(posture: Any, options: Any, said: str) -> None:
    q = crouch() if posture is None else posture(crouch())
    with pytest.raises(ControllerError, match=said):
        hs.StandingLQR(walking.bravo7(), q, **options)


def test_advice_is_true() -> None:
    """The state that a refusal names stands; joints that are too weak crouched hold straight."""
    robot = walking.bravo7()
    with pytest.raises(ControllerError, match=re.escape("robot.standing(hs.Ground()).q")):
        hs.StandingLQR(robot, in_the_air(crouch()))
    assert hs.StandingLQR(robot, robot.standing(hs.Ground()).q).poles.real.max() < 0.0
    most = np.full(robot.nu, 40.0)
    weak = replace(robot, model=robot.model.replaced(torque_upper=most, torque_lower=-most))
    with pytest.raises(ControllerError, match=r"torque limit.*Bring its joints nearer to straight"):
        hs.StandingLQR(weak, crouch())
    assert hs.StandingLQR(weak).poles.real.max() < 0.0


@pytest.mark.parametrize("period", [1e-3, None])
def test_without_motors_nothing_stands(period: float | None) -> None:
    robot = hs.load_robot("compass_gait")
    with pytest.raises(ControllerError, match="has no motors"):
        hs.StandingLQR(robot, period=period)


def test_motors_that_do_not_reach_what_falls_are_refused() -> None:
    """Two pendulums upright beside each other, of which one has a motor."""
    build = hs.RobotBuilder("apart")
    for name, torque in (("free", None), ("driven", 100.0)):
        build.hinge(name, None, mass=1.0, inertia=0.1, center_of_mass=(0.0, 0.5), torque=torque)
    with pytest.raises(ControllerError, match="do not control the fall"):
        hs.StandingLQR(build.build())
