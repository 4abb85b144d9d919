"""Pinned dynamics and impact in symbols against the compiled kernels."""

from __future__ import annotations

from typing import NamedTuple

import casadi
import numpy as np
import pytest
from gait_motion import contact_rates, foot_jacobian, place, selection, standing

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.dynamics.queries.following import drive_of
from heelstrike.dynamics.queries.symbolic import expression, symbols
from heelstrike.gait.sole import sole
from heelstrike.gait.support import Impact, Support


class Evaluated(NamedTuple):
    """Numbers of the symbolic expressions at one random motion."""

    q: np.ndarray
    v: np.ndarray
    torque: np.ndarray
    wrench: np.ndarray
    after: np.ndarray
    impulse: np.ndarray
    joint_impulse: np.ndarray


@pytest.fixture(params=["bravo7", "spring_flamingo"])
def robot(request: pytest.FixtureRequest) -> hs.Robot:
    return hs.load_robot(request.param)


def evaluated(robot: hs.Robot, *motion: np.ndarray) -> Evaluated:
    names = ("position", "velocity", "acceleration", "velocity_after")
    inputs = [casadi.SX.sym(name, robot.nv - 3) for name in names]
    q, v, a, after = (symbols(part) for part in inputs)
    support = Support(robot, sole(robot, 0), drive_of(robot), q, v, a)
    impact = Impact(support, sole(robot, 1), after)
    function = casadi.Function(
        "evaluate",
        inputs,
        [
            expression(support.q),
            expression(support.v),
            expression(support.torque),
            expression(support.wrench),
            expression(impact.v),
            expression(impact.impulse),
            expression(impact.rest),
        ],
    )
    return Evaluated(*(np.array(part).ravel() for part in function(*motion)))


def random_motion(robot: hs.Robot, seed: int) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).normal(size=(4, robot.nv - 3)))


@pytest.mark.parametrize("seed", range(5))
def test_the_stance_foot_lies_flat_at_the_origin_and_rests(robot: hs.Robot, seed: int) -> None:
    motion = random_motion(robot, seed)
    found = evaluated(robot, *motion)
    np.testing.assert_allclose(place(robot, found.q, 0), 0.0, atol=1e-14)
    np.testing.assert_allclose(foot_jacobian(robot, found.q, 0) @ found.v, 0.0, atol=1e-13)
    np.testing.assert_allclose(found.q, standing(robot, motion[0], 0), atol=1e-14)
    np.testing.assert_array_equal(found.v[3:], motion[1])


@pytest.mark.parametrize("seed", range(5))
def test_torques_and_wrench_satisfy_the_equations_of_motion(robot: hs.Robot, seed: int) -> None:
    # Eq. 27 with the accelerations that forward dynamics gives, and eq. 30 for the pinned foot.
    motion = random_motion(robot, seed)
    found = evaluated(robot, *motion)
    jacobian = foot_jacobian(robot, found.q, 0)
    force = selection(robot) @ found.torque + jacobian.T @ found.wrench
    force += dynamics.passive_force(robot, found.q, found.v)
    acceleration = dynamics.forward_dynamics(robot, found.q, found.v, force)
    scale = np.abs(acceleration).max()
    np.testing.assert_allclose(acceleration[3:], motion[2], atol=1e-10 * scale)
    link, point = robot.feet[0].link, sole(robot, 0).point
    drift = dynamics.point_bias_acceleration(robot, found.q, found.v, link, point)
    np.testing.assert_allclose(jacobian @ acceleration, -drift, atol=1e-10 * scale)


@pytest.mark.parametrize("seed", range(5))
def test_the_momentum_balance_of_the_impact(robot: hs.Robot, seed: int) -> None:
    # A (v⁺ − v⁻) = Jᵀ Λ + joint impulses (eq. 22), the landing foot at rest afterwards.
    found = evaluated(robot, *random_motion(robot, seed))
    jacobian = foot_jacobian(robot, found.q, 1)
    np.testing.assert_allclose(jacobian @ found.after, 0.0, atol=1e-12)
    momentum = dynamics.mass_matrix(robot, found.q) @ (found.after - found.v)
    exerted = jacobian.T @ found.impulse + selection(robot) @ found.joint_impulse
    np.testing.assert_allclose(momentum, exerted, atol=1e-11 * np.abs(momentum).max())


@pytest.mark.parametrize("seed", range(5))
def test_without_joint_impulses_it_is_the_plastic_impact(robot: hs.Robot, seed: int) -> None:
    """The closed form v⁺ = v⁻ − A⁻¹Jᵀ(JA⁻¹Jᵀ)⁻¹J v⁻ needs no impulse of the joints."""
    position, velocity, acceleration, _ = random_motion(robot, seed)
    before = evaluated(robot, position, velocity, acceleration, velocity)
    jacobian = foot_jacobian(robot, before.q, 1)
    inverse = np.linalg.inv(dynamics.mass_matrix(robot, before.q))
    delassus = jacobian @ inverse @ jacobian.T
    impulse = -np.linalg.solve(delassus, jacobian @ before.v)
    after = before.v + inverse @ jacobian.T @ impulse
    found = evaluated(robot, position, velocity, acceleration, after[3:])
    np.testing.assert_allclose(found.after, after, atol=1e-10 * np.abs(after).max())
    np.testing.assert_allclose(found.impulse, impulse, atol=1e-10 * np.abs(impulse).max())
    np.testing.assert_allclose(found.joint_impulse, 0.0, atol=1e-10 * np.abs(impulse).max())
    mass = dynamics.mass_matrix(robot, before.q)
    lost = before.v @ mass @ before.v - after @ mass @ after
    # What is lost is the energy of the difference (a projection in the metric of A): never a gain.
    difference = before.v - after
    assert lost == pytest.approx(difference @ mass @ difference, rel=1e-9)
    assert lost > 0.0
    np.testing.assert_allclose(contact_rates(robot, before.q, after, 1), 0.0, atol=1e-11)
