"""A and B are the derivatives of the equations of motion, to 1e-8 and better.

The reference is the complex step through the plain Python twins of the kernels, which knows nothing
of CasADi: f'(x) = Im f(x + ih)/h with h = 1e-30, without any error but rounding.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from robot_cases import NAMED, RANDOM, RobotCase

from heelstrike import dynamics
from heelstrike.compiler.compilation import uncompiled
from heelstrike.dynamics import kernels
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import RobotError
from heelstrike.robot import Robot

# What the issue asks; rounding of a few hundred products stays far below.
TOLERANCE = 1e-8


def free_acceleration(
    robot: Robot, q: Any, v: Any, torque: Any, dtype: Any, functions: dict[Any, Any]
) -> Any:
    """Acceleration without contact by the uncompiled kernels, in any arithmetic."""

    def run(kernel: Callable[..., Any], *arguments: Any) -> None:
        uncompiled(kernel, replace=functions)(*arguments)

    n = robot.nv
    work = Workspace.allocate(robot.model.extents, dtype=dtype)
    force, acceleration = np.zeros(n, dtype=dtype), np.zeros(n, dtype=dtype)
    run(kernels.forward_kinematics, robot.model, q, work)
    run(kernels.link_velocities, robot.model, v, work)
    run(kernels.passive_force, robot.model, q, v, force)
    for place, joint in enumerate(robot.model.actuator_joint):
        force[joint] = force[joint] + torque[place]
    matrix, factor = np.zeros((n, n), dtype=dtype), np.zeros((n, n), dtype=dtype)
    run(kernels.forward_dynamics, robot.model, matrix, factor, force, work, acceleration)
    return acceleration


def complex_step(function: Callable[[Any], Any], x: np.ndarray) -> np.ndarray:
    step = 1e-30
    columns = [np.imag(function(x + 1j * step * unit)) / step for unit in np.eye(x.size)]
    return np.array(columns).T.reshape(-1, x.size)


def relative(ours: np.ndarray, theirs: np.ndarray) -> float:
    return float(np.abs(ours - theirs).max(initial=0.0) / np.abs(theirs).max(initial=1.0))


@pytest.mark.parametrize("case", [*NAMED, *RANDOM[:8]], ids=lambda case: case.name)
def test_equals_complex_step(case: RobotCase) -> None:
    robot = case.robot()
    n, nu = robot.nv, robot.nu
    functions = {math.sin: cmath.sin, math.cos: cmath.cos}

    def acceleration(x: np.ndarray) -> Any:
        q, v, torque = np.split(x, [n, 2 * n])
        return free_acceleration(robot, q, v, torque, np.complex128, functions)

    for q, v in case.states(2):
        torque = 10.0 * np.cos(np.arange(nu))
        linear = dynamics.linearize(robot, q, v, torque)
        expected = complex_step(acceleration, np.concatenate([q, v, torque]).astype(complex))
        assert relative(np.hstack([linear.A[n:], linear.B[n:]]), expected) <= TOLERANCE
        np.testing.assert_array_equal(linear.A[:n], np.hstack([np.zeros((n, n)), np.eye(n)]))
        np.testing.assert_array_equal(linear.B[:n], 0.0)
        force = dynamics.applied_force(robot, q, v, torque)
        rate = np.concatenate([v, dynamics.forward_dynamics(robot, q, v, force)])
        assert relative(linear.state_derivative, rate) <= TOLERANCE


def held_state(robot: Robot, contacts: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """State with the given points at rest and everything else in motion."""
    draw = np.random.default_rng(5)
    q = robot.model.reference + 0.0
    v = draw.normal(size=robot.nv)
    rows = dynamics.contact_jacobian(robot, q)[list(contacts)].reshape(-1, robot.nv)
    return q, v - np.linalg.pinv(rows) @ (rows @ v)


@pytest.mark.parametrize(
    ("name", "contacts", "independent"),
    [("rabbit", (0,), (0, 1)), ("bravo7", (0, 1), (0, 1, 2)), ("walker2d", (2, 3), (0, 1, 2))],
)
def test_held_contacts_equal_complex_step(
    name: str, contacts: tuple[int, ...], independent: tuple[int, ...]
) -> None:
    """With heel and toe down one of the four rows says nothing new; the reference leaves it out."""
    robot = next(case for case in NAMED if case.name == name).robot()
    model, n = robot.model, robot.nv
    q, v = held_state(robot, contacts)
    torque = 5.0 * np.sin(np.arange(robot.nu) + 1.0)
    linear = dynamics.linearize(robot, q, v, torque, contacts=contacts)
    functions = {math.sin: cmath.sin, math.cos: cmath.cos}

    def run(kernel: Callable[..., Any], *arguments: Any) -> None:
        uncompiled(kernel, replace=functions)(*arguments)

    def acceleration(x: np.ndarray) -> Any:
        position, velocity, gamma = np.split(x, [n, 2 * n])
        work = Workspace.allocate(model.extents, dtype=np.complex128)
        run(kernels.forward_kinematics, model, position, work)
        run(kernels.link_velocities, model, velocity, work)
        matrix = np.zeros((n, n), dtype=complex)
        bias, force = np.zeros(n, dtype=complex), np.zeros(n, dtype=complex)
        run(kernels.mass_matrix, model, work, matrix)
        run(kernels.bias_force, model, work, bias)
        run(kernels.passive_force, model, position, velocity, force)
        for place, joint in enumerate(model.actuator_joint):
            force[joint] += gamma[place]
        rows, drift = [], []
        for contact in contacts:
            link, center = int(model.contact_link[contact]), np.zeros(2, dtype=complex)
            run(kernels.point_position, work, link, model.contact_position[contact], center)
            rate, jacobian = np.zeros(3, dtype=complex), np.zeros((3, n), dtype=complex)
            run(kernels.point_bias_acceleration, work, link, center, rate)
            lowest = center - np.array([0.0, model.contact_radius[contact]])
            run(kernels.point_jacobian, model, work, link, lowest, jacobian)
            rows += [jacobian[1], jacobian[0]]
            drift += [rate[1], rate[0]]
        held = np.array(rows)[list(independent)]
        zero = np.zeros((len(independent), len(independent)))
        system = np.block([[matrix, -held.T], [held, zero]])
        right = np.concatenate([force - bias, -np.array(drift)[list(independent)]])
        return np.linalg.solve(system, right)[:n]

    expected = complex_step(acceleration, np.concatenate([q, v, torque]).astype(complex))
    assert relative(np.hstack([linear.A[n:], linear.B[n:]]), expected) <= TOLERANCE
    rows = dynamics.contact_jacobian(robot, q)[list(contacts)].reshape(-1, n)
    drift = dynamics.contact_bias_acceleration(robot, q, v)[list(contacts)].ravel()
    assert np.abs(rows @ linear.state_derivative[n:] + drift).max() <= 1e-9
    # The forces that go with it satisfy the equations of motion, and so do their derivatives.
    motion = dynamics.inverse_dynamics(robot, q, v, linear.state_derivative[n:])
    applied = dynamics.applied_force(robot, q, v, torque)
    assert relative(applied + rows.T @ linear.contact_force.ravel(), motion) <= 1e-10
    mass = dynamics.mass_matrix(robot, q)
    push = np.zeros((n, robot.nu))
    push[model.actuator_joint, np.arange(robot.nu)] = 1.0
    ground = rows.T @ linear.contact_force_torque.reshape(-1, robot.nu)
    assert relative(mass @ linear.B[n:], push + ground) <= 1e-10


def test_wrong_arguments_are_named() -> None:
    robot = NAMED[0].robot()
    nothing = np.zeros(robot.nv)
    with pytest.raises(RobotError, match="right_hip"):
        dynamics.linearize(robot, nothing, nothing, np.zeros(robot.nv))
    with pytest.raises(RobotError, match="right_foot_heel"):
        dynamics.linearize(robot, nothing, nothing, np.zeros(robot.nu), contacts=["heel"])
