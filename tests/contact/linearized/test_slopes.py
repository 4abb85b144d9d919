"""Derivatives of gaps, places and velocities against differences; who follows a standing foot."""

from __future__ import annotations

from collections.abc import Callable

import mechanisms
import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.contact.linearized.slopes import (
    along_the_ground,
    both,
    contact_slopes,
    exchanged,
    following,
)
from heelstrike.dynamics import loop_displacement, loop_jacobian

Floats = NDArray[np.float64]

STEP = 1e-5


def somewhere(robot: hs.Robot) -> Floats:
    random = np.random.default_rng(3)
    q = robot.reference_state().q + 0.1 * random.standard_normal(robot.nq)
    return np.concatenate((q, random.standard_normal(robot.nv)))


def differences(function: Callable[[Floats], Floats], x: Floats) -> Floats:
    """Central differences, whose error is the square of their step."""
    columns = [(function(x + e) - function(x - e)) / (2.0 * STEP) for e in STEP * np.eye(len(x))]
    return np.array(columns).T


@pytest.mark.parametrize(
    "robot",
    [
        walking.bravo7(),
        mechanisms.compass_gait(radius=0.2),  # whose feet roll
        mechanisms.parallel_ankles(),  # with closed loops
        mechanisms.four_bar(),  # without contact points
    ],
    ids=lambda robot: robot.name,
)
def test_slopes_are_those_of_what_is_seen(robot: hs.Robot) -> None:
    ramp, x = hs.Ground(slope=-0.2), somewhere(robot)

    def seen(x: Floats) -> Floats:
        q, v = x[: robot.nq], x[robot.nq :]
        at = hs.contact_kinematics(robot, q, v, ramp)
        loops = loop_displacement(robot, q), loop_jacobian(robot, q) @ v
        place = at.position @ along_the_ground(ramp)
        return np.concatenate((place, at.gap, at.velocity.ravel(), *loops))

    found = contact_slopes(robot, x[: robot.nq], x[robot.nq :], ramp)
    rows = (
        found.place, found.gap, found.velocity.reshape(-1, len(x)), found.loop, found.loop_velocity
    )  # fmt: skip
    np.testing.assert_allclose(np.vstack(rows), differences(seen, x), atol=1e-8)


def test_stairs_have_no_slopes() -> None:
    robot = walking.bravo7()
    x, stairs = somewhere(robot), hs.Ground.stairs(rise=0.1, tread=0.3, count=3)
    with pytest.raises(hs.SimulationError, match="the same everywhere"):
        contact_slopes(robot, x[: robot.nq], x[robot.nq :], stairs)


def test_a_robot_follows_its_flat_foot() -> None:
    """Errors of six joints leave heel and toe where they are and at rest, those of nine do not."""
    robot = walking.bravo7()
    state = walking.gait().initial_state
    sole = robot.feet[walking.gait().stance_foot].contacts
    driven = robot.model.actuator_joint
    errors = following(robot, state.q, state.v, sole, driven)
    np.testing.assert_array_equal(errors[both(robot, driven)], np.eye(2 * robot.nu))
    slopes = contact_slopes(robot, state.q, state.v)
    for rows in (slopes.place[list(sole)], slopes.gap[list(sole)]):
        np.testing.assert_allclose(rows @ errors, 0.0, atol=1e-12)
    np.testing.assert_allclose(slopes.velocity[list(sole)].reshape(-1, 18) @ errors, 0.0, atol=1e-9)


def test_errors_in_the_mirror_are_those_of_states_in_the_mirror() -> None:
    robot = walking.bravo7()
    mirror, x = robot.mirror, somewhere(robot)
    assert mirror is not None

    def image(x: Floats) -> Floats:
        return mirror.state(hs.State(x[: robot.nq], x[robot.nq :])).vector

    np.testing.assert_allclose(exchanged(robot, np.eye(len(x))), differences(image, x), atol=1e-9)
