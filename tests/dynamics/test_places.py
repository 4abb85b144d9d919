"""Points, contact frames, positions and velocities: kernels against what defines them."""

from __future__ import annotations

import numpy as np
import pytest
from robot_cases import NAMED, RANDOM, RobotCase

from heelstrike import dynamics
from heelstrike.dynamics import kernels
from heelstrike.dynamics.frames import into_frame, out_of_frame
from heelstrike.dynamics.places import add_point_force, write_point_rows
from heelstrike.dynamics.queries.evaluation import Evaluation

CASES = [*NAMED[:2], *RANDOM[:3]]
ROUNDING = 1e-12
NORMAL = np.array([np.sin(0.3), np.cos(0.3)])
FRAME = np.array([NORMAL, [NORMAL[1], -NORMAL[0]]])  # normal, tangent


def test_a_frame_is_a_normal_and_the_tangent_forward_of_it() -> None:
    vector = (0.7, -0.2)
    np.testing.assert_allclose(into_frame(NORMAL, vector), FRAME @ vector, rtol=1e-15)
    np.testing.assert_allclose(out_of_frame(NORMAL, vector), FRAME.T @ vector, rtol=1e-15)
    level = np.array([0.0, 1.0])
    assert into_frame(level, (3.0, 4.0)) == (4.0, 3.0)  # up, forward
    assert out_of_frame(level, (4.0, 3.0)) == (3.0, 4.0)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_rows_and_forces_of_a_point(case: RobotCase) -> None:
    """The rows are the frame times the Jacobian, a force acts by the Jacobian's transpose."""
    robot = case.robot()
    link, local = robot.nl - 1, (0.1, -0.3)
    for q, v in case.states(3):
        work = Evaluation(robot, q, v).work
        jacobian = dynamics.point_jacobian(robot, q, link, local)
        position = dynamics.point_position(robot, q, link, local)
        rows = np.full((4, robot.nv), 7.0)
        write_point_rows(robot.model, work, link, position, NORMAL, 1, rows)
        np.testing.assert_allclose(rows[1:3], FRAME @ jacobian[:2], atol=ROUNDING)
        assert np.all(rows[[0, 3]] == 7.0)
        total = np.ones(robot.nv)
        add_point_force(robot.model, work, link, position, (3.0, -5.0), total)
        np.testing.assert_allclose(total - 1.0, jacobian[:2].T @ [3.0, -5.0], atol=100 * ROUNDING)
        velocity = np.zeros(3)
        kernels.point_velocity(work, link, position, velocity)
        np.testing.assert_allclose(velocity, jacobian @ v, atol=10 * ROUNDING)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_positions_move_with_velocities(case: RobotCase) -> None:
    """What takes q to q' in one second takes it there; points move as their velocity says."""
    robot = case.robot()
    model, link, local = robot.model, robot.nl - 1, (0.1, 0.2)
    (q, v), (other, _) = case.states(2)
    way, there = np.zeros(robot.nv), np.zeros(robot.nq)
    kernels.difference(model, q, other, way)
    kernels.integrate(model, q, way, 1.0, there)
    np.testing.assert_allclose(there, other, atol=1e-14)
    ends = []
    for time in (-1e-6, 1e-6):
        kernels.integrate(model, q, v, time, there)
        ends.append(dynamics.point_position(robot, there, link, local))
    speed = dynamics.point_velocity(robot, q, v, link, local)[:2]
    np.testing.assert_allclose((ends[1] - ends[0]) / 2e-6, speed, atol=1e-7)
    kernels.integrate(model, q, v, 1e-6, q)  # in its own place
    np.testing.assert_array_equal(q, there)
