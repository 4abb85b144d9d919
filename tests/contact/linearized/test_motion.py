"""Derivatives of motions under contacts and of impacts against differences, and saltations."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike import dynamics

Floats = NDArray[np.float64]

RAMP = hs.Ground(slope=-0.1, friction=0.4, restitution=0.3)
ACTIVE = hs.ActiveContacts(resting=(0,), sliding=((2, -1),), joints=(4,))
STEP = 1e-5


def somewhere() -> tuple[Floats, Floats, Floats]:
    """A state of bravo7 near its reference, and torques."""
    robot, random = walking.bravo7(), np.random.default_rng(0)
    q = robot.reference_state().q + 0.1 * random.standard_normal(robot.nq)
    return q, random.standard_normal(robot.nv), 10.0 * random.standard_normal(robot.nu)


def test_flat_feet_on_level_ground_are_those_of_linearize() -> None:
    robot, (q, v, torque) = walking.bravo7(), somewhere()
    mine = hs.linearize_contact(robot, q, v, torque, hs.ActiveContacts(resting=(0, 1)))
    other = dynamics.linearize(robot, q, v, torque, contacts=[0, 1])
    np.testing.assert_allclose(mine.A, other.A, atol=1e-9 * np.abs(other.A).max())
    np.testing.assert_allclose(mine.B, other.B, atol=1e-9 * np.abs(other.B).max())
    np.testing.assert_allclose(mine.rate, other.state_derivative, atol=1e-9)


def test_slopes_sliding_points_and_stops_have_exact_derivatives() -> None:
    """Central differences have an error of the square of their step, some 1e-7 here."""
    robot, (q, v, torque) = walking.bravo7(), somewhere()
    found = hs.linearize_contact(robot, q, v, torque, ACTIVE, ground=RAMP)

    def rate(x: Floats, gamma: Floats = torque) -> Floats:
        moved = x[: robot.nq], x[robot.nq :], gamma
        return hs.linearize_contact(robot, *moved, ACTIVE, ground=RAMP).rate

    x, ones = np.concatenate((q, v)), np.eye(robot.nq + robot.nv)
    by_state = [(rate(x + STEP * e) - rate(x - STEP * e)) / (2.0 * STEP) for e in ones]
    np.testing.assert_allclose(found.A, np.transpose(by_state), atol=1e-8 * 400.0)
    by_torque = [rate(x, torque + e) - rate(x, torque) for e in np.eye(robot.nu)]
    np.testing.assert_allclose(found.B, np.transpose(by_torque), atol=1e-9)


def test_accelerations_under_contacts_are_those_of_the_contact_problem() -> None:
    """All points at rest, all sliding forward on less friction, and none on the ground."""
    robot = walking.bravo7()
    state = robot.reference_state()
    rest = hs.contact_inverse_dynamics(robot, state.q, state.v, 0.0 * state.v).torque
    pushed = rest + np.tile([40.0, 0.0, 0.0], 2)
    raised = state.q + np.array([0.0, 1.0] + [0.0] * (robot.nq - 2))
    for q, torque, mu, mode, active in (
        (state.q, rest + 1.0, 0.75, "STICK", hs.ActiveContacts(resting=(0, 1, 2, 3))),
        (state.q, pushed, 0.01, "SLIP_FORWARD",
         hs.ActiveContacts(sliding=tuple((i, 1) for i in range(4)))),
        (raised, pushed, 0.75, "OPEN", hs.ActiveContacts()),
    ):  # fmt: skip
        ground = hs.Ground(friction=mu)
        solved = hs.contact_forward_dynamics(robot, q, state.v, torque, ground=ground)
        assert {each.name for each in solved.mode} == {mode}
        found = hs.linearize_contact(robot, q, state.v, torque, active, ground=ground)
        scale = np.abs(solved.acceleration).max()
        np.testing.assert_allclose(found.rate[9:], solved.acceleration, atol=1e-9 * scale)


def test_impacts_have_exact_derivatives() -> None:
    """Points bounce by the ground's restitution; what slides is left to slide; stops hold."""
    robot, (q, v, _) = walking.bravo7(), somewhere()
    found = hs.linearize_impact(robot, q, v, ACTIVE, ground=RAMP)
    before = hs.contact_kinematics(robot, q, v, RAMP).velocity
    after = hs.contact_kinematics(robot, q, found.velocity, RAMP).velocity
    np.testing.assert_allclose(after[[0, 2], 0], -0.3 * before[[0, 2], 0], atol=1e-12)
    assert abs(after[0, 1]) < 1e-12
    assert abs(found.velocity[4]) < 1e-12

    def image(x: Floats) -> Floats:
        struck = hs.linearize_impact(robot, x[: robot.nq], x[robot.nq :], ACTIVE, ground=RAMP)
        return np.concatenate((x[: robot.nq], struck.velocity))

    x, ones = np.concatenate((q, v)), np.eye(robot.nq + robot.nv)
    by_state = [(image(x + STEP * e) - image(x - STEP * e)) / (2.0 * STEP) for e in ones]
    np.testing.assert_allclose(found.reset, np.transpose(by_state), atol=1e-6)


def test_an_impact_throws_only_what_comes_down() -> None:
    """One end of a bar comes down, the other is on its way up and is held by the impact."""
    builder = hs.RobotBuilder("bar")
    bar = builder.floating_base("bar", (0.0, 0.1), mass=2.0, inertia=0.02)
    for x in (-0.1, 0.1):
        builder.contact(bar, (x, -0.1))
    robot, q, v = builder.build(), np.array([0.0, 0.1, 0.0]), np.array([0.0, -0.2, -6.0])
    ground = hs.Ground(friction=0.0, restitution=0.5)
    np.testing.assert_allclose(
        hs.contact_kinematics(robot, q, v, ground).velocity[:, 0], [-0.8, 0.4], atol=1e-12
    )
    struck = hs.ActiveContacts(sliding=((0, 1), (1, 1)))
    found = hs.linearize_impact(robot, q, v, struck, ground=ground)
    after = hs.contact_kinematics(robot, q, found.velocity, ground)
    np.testing.assert_allclose(after.velocity[:, 0], [0.4, 0.0], atol=1e-12)
    before = hs.contact_kinematics(robot, q, v, ground)
    thrown = after.jacobian[:, 0] @ found.reset[3:, 3:]
    np.testing.assert_allclose(thrown[0], -0.5 * before.jacobian[0, 0], atol=1e-12)
    np.testing.assert_allclose(thrown[1], 0.0, atol=1e-12)


def test_a_point_that_slides_pulls_against_its_motion() -> None:
    """Sliding forward, the friction of a foot gives less to the trunk than rolling without it."""
    robot = walking.bravo7()
    state, nothing = robot.reference_state(), np.zeros(robot.nu)
    forward, backward = (
        hs.linearize_contact(
            robot, state.q, state.v, nothing, hs.ActiveContacts(sliding=((0, way), (1, way))),
            ground=hs.Ground(friction=0.4),
        ).rate[robot.nq]
        for way in (1, -1)
    )  # fmt: skip
    assert forward < -0.5 < 0.5 < backward


def test_what_cannot_be_linearised() -> None:
    robot, (q, v, torque) = walking.bravo7(), somewhere()
    stairs = hs.Ground.stairs(rise=0.01, tread=0.3, count=2)
    with pytest.raises(hs.SimulationError, match="level or sloping"):
        hs.linearize_contact(robot, q, v, torque, hs.ActiveContacts(), ground=stairs)
    with pytest.raises(hs.RobotError, match="joints 0 to 8"):
        hs.linearize_impact(robot, q, v, hs.ActiveContacts(joints=(9,)))
    with pytest.raises(hs.RobotError):
        hs.linearize_contact(robot, q, v, torque, hs.ActiveContacts(resting=(4,)))


def test_the_saltation_of_a_bouncing_ball() -> None:
    """In closed form: errors of height are mirrored, and shift the time of the bounce.

    x⁺(t) = e (v₀ (t − τ)) with the fall's end τ(x, v): differentiated by hand.
    """
    e, g, speed = 0.7, 9.81, 3.0
    found = hs.saltation_matrix(np.diag([1.0, -e]), [1.0, 0.0], [-speed, -g], [e * speed, -g])
    np.testing.assert_allclose(found, [[-e, 0.0], [(1.0 + e) * g / speed, -e]], atol=1e-12)


def test_events_without_a_saltation() -> None:
    with pytest.raises(hs.SimulationError, match="grazes"):
        hs.saltation_matrix(np.eye(2), [1.0, 0.0], [1e-12, 1.0], [0.0, 1.0])
    with pytest.raises(hs.SimulationError, match="shapes"):
        hs.saltation_matrix(np.eye(2), [1.0, 0.0, 0.0], [1.0, 1.0], [0.0, 1.0])
