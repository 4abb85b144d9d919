"""A robot that is held: rods and pendulums in closed form, dependent rows, loops, symbols."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest
from mechanisms import parallel_ankles

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.held import HeldRobot, Place
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols
from heelstrike.robot import Robot, RobotBuilder

G = 9.81
LENGTH, MASS = 0.8, 3.0


def rod(radius: float = 0.0) -> Robot:
    """A uniform rod that stands upright on a contact at its lower end."""
    build = RobotBuilder("rod")
    trunk = build.floating_base(
        "rod", (0, 0.5 * LENGTH), mass=MASS, inertia=MASS * LENGTH**2 / 12.0
    )
    build.contact(trunk, (0, -0.5 * LENGTH), radius=radius)
    return build.build()


def moving_on(robot: Robot, q: Any, v: Any, contacts: Any) -> tuple[np.ndarray, np.ndarray]:
    """Acceleration and forces of the held rows under weight and springs alone."""
    torque = np.zeros(robot.nu)
    force = dynamics.applied_force(robot, q, v, torque) - dynamics.bias_force(robot, q, v)
    return HeldRobot.on(Evaluation(robot, q, v), contacts).accelerated(force)


def test_a_rod_held_at_its_end_is_a_pendulum() -> None:
    """θ̈ = (3g/2L) sin θ from the vertical; the pivot bears m (a + g) of the middle."""
    robot, angle, rate = rod(), 0.4, 1.3
    v = HeldRobot.on(Evaluation(robot, [0.1, 0.2, angle]), [0]).velocity(np.array([9.0, 9.0, rate]))
    half = 0.5 * LENGTH
    # A positive angle leans forward: the middle goes to x.
    np.testing.assert_allclose(
        v, [half * rate * np.cos(angle), -half * rate * np.sin(angle), rate], rtol=1e-14
    )
    acceleration, force = moving_on(robot, [0.1, 0.2, angle], v, [0])
    turn = 1.5 * G / LENGTH * np.sin(angle)
    x = half * (turn * np.cos(angle) - rate**2 * np.sin(angle))
    z = -half * (turn * np.sin(angle) + rate**2 * np.cos(angle))
    np.testing.assert_allclose(acceleration, [x, z, turn], rtol=1e-13)
    np.testing.assert_allclose(force, [MASS * x, MASS * (z + G)], rtol=1e-13)


def test_the_trunks_own_coordinates_follow_a_place() -> None:
    """Far above it turning moves the place by more than one, and is no better a pivot for that."""
    robot = rod()
    held = HeldRobot.on(Evaluation(robot, [0.0, 5.0, 0.3]), [0])
    assert np.abs(held.rows.rows[:, 2]).max() < 1.0
    far = HeldRobot(
        Evaluation(robot, [0.0, 0.0, 0.3]), [Place(2, np.array([0.0, -3.0]), np.zeros(2), 2)]
    )
    assert np.abs(far.rows.rows[:, 2]).max() > 1.0
    for each in (held, far):
        assert each.rows.coordinate.tolist() == [0, 1]
        assert each.rows.mix.tolist() == [[1.0, 0.0], [0.0, 1.0]]


def test_a_struck_rod_turns_about_the_end_that_stops() -> None:
    """Falling flat at u it turns on at 3u/2L, three quarters of its momentum left to the pivot."""
    robot, speed = rod(), 2.0
    q = np.array([0.0, 0.0, 0.5 * np.pi])  # it lies, its contact behind
    after, impulse = HeldRobot.on(Evaluation(robot, q), [0]).stopped(np.array([0.0, -speed, 0.0]))
    rate = 1.5 * speed / LENGTH
    np.testing.assert_allclose(after, [0.0, -0.5 * LENGTH * rate, rate], atol=1e-14)
    np.testing.assert_allclose(impulse, [0.0, 0.25 * MASS * speed], atol=1e-14)


def test_a_rolling_disc_holds_its_centre_not_what_touches() -> None:
    """At rest below, the middle goes round the disc's centre, which moves evenly: ω²(½L − r)."""
    radius, rate = 0.1, 2.0
    robot = rod(radius)
    q = np.array([0.0, 0.0, 0.0])
    v = HeldRobot.on(Evaluation(robot, q), [0]).velocity(np.array([0.0, 0.0, rate]))
    np.testing.assert_allclose(v, [(0.5 * LENGTH + radius) * rate, 0.0, rate], rtol=1e-14)
    acceleration, _ = moving_on(robot, q, v, [0])
    np.testing.assert_allclose(acceleration, [0.0, -0.5 * LENGTH * rate**2, 0.0], atol=1e-14)


def double_pendulum() -> Robot:
    """Two bars without weight and two points: the first bar floats, its upper end is held."""
    build = RobotBuilder("double_pendulum")
    first = build.floating_base("first", (0, 0), mass=2.0, inertia=1e-9, center_of_mass=(0, -0.5))
    second = build.hinge(
        "elbow", first, at=(0, -0.5), mass=1.0, inertia=1e-9, center_of_mass=(0, -0.3)
    )
    build.contact(first, (0, 0))
    build.contact(second, (0, -0.3))
    return build.build()


def test_a_held_chain_is_a_double_pendulum() -> None:
    """Textbook equations of two point masses; angles from hanging, here about −y."""
    m1, m2, l1, l2, a1, a2, w1, w2 = 2.0, 1.0, 0.5, 0.3, 0.7, -0.4, 1.1, 2.3
    robot = double_pendulum()
    q = np.array([0.0, 0.0, -a1, -(a2 - a1)])
    v = HeldRobot.on(Evaluation(robot, q), [0]).velocity(np.array([5.0, 5.0, -w1, -(w2 - w1)]))
    acceleration, _ = moving_on(robot, q, v, [0])
    d = a1 - a2
    matrix = [[(m1 + m2) * l1, m2 * l2 * np.cos(d)], [l1 * np.cos(d), l2]]
    right = [
        -m2 * l2 * w2**2 * np.sin(d) - (m1 + m2) * G * np.sin(a1),
        l1 * w1**2 * np.sin(d) - G * np.sin(a2),
    ]
    turn1, turn2 = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(
        acceleration, [0.0, 0.0, -turn1, turn1 - turn2], rtol=1e-7, atol=1e-7
    )


def moving(robot: Robot, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(seed)
    q = robot.closed(robot.reference_state()).q
    q[3:] += 0.1 * draw.normal(size=robot.nq - 3)
    q = robot.closed(hs.State(q, np.zeros(robot.nv))).q
    return q, draw.normal(size=robot.nv)


def test_two_feet_hold_more_than_what_has_no_motor() -> None:
    """Six rows that say something, three coordinates without a motor: three joints follow, too."""
    robot = hs.load_robot("bravo7")
    q, v = moving(robot)
    found = HeldRobot.on(Evaluation(robot, q, v), range(robot.nc)).velocity(v)
    assert np.abs(dynamics.contact_jacobian(robot, q).reshape(-1, robot.nv) @ found).max() <= 1e-12
    assert np.abs(found).max() > 0.1


@pytest.mark.parametrize("make", [lambda: hs.load_robot("bravo7"), parallel_ankles])
def test_heel_and_toe_are_one_foot_and_forces_the_shortest(make: Any) -> None:
    """Four rows of rank three, and loops: the optimality system, its forces by pseudo-inverse."""
    robot = make()
    q, v = moving(robot)
    points = list(robot.feet[0].contacts)
    held = HeldRobot.on(Evaluation(robot, q, v), points)
    rows = np.concatenate(
        [
            dynamics.contact_jacobian(robot, q, points)[:, ::-1].reshape(-1, robot.nv),
            dynamics.loop_jacobian(robot, q),
        ]
    )
    bias = np.concatenate(
        [
            dynamics.contact_bias_acceleration(robot, q, v, points)[:, ::-1].ravel(),
            dynamics.loop_bias_acceleration(robot, q, v),
        ]
    )
    force = np.random.default_rng(4).normal(size=robot.nv)
    matrix = dynamics.mass_matrix(robot, q)
    response = np.linalg.solve(matrix, rows.T)
    free = np.linalg.solve(matrix, force)
    # The disturbed foot's v is not that of a foot at rest: J̇v of its rows may contradict itself.
    still = held.velocity(v)
    np.testing.assert_allclose(rows @ still, 0.0, atol=1e-13)
    held = HeldRobot.on(Evaluation(robot, q, still), points)
    bias = np.concatenate(
        [
            dynamics.contact_bias_acceleration(robot, q, still, points)[:, ::-1].ravel(),
            dynamics.loop_bias_acceleration(robot, q, still),
        ]
    )
    exerted = np.linalg.pinv(rows @ response, rcond=1e-11) @ (-bias - rows @ free)
    shortest = np.linalg.pinv(rows.T, rcond=1e-11) @ (rows.T @ exerted)
    acceleration, found = held.accelerated(force)
    np.testing.assert_allclose(acceleration, free + response @ exerted, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found, shortest, rtol=1e-9, atol=1e-9)
    assert np.linalg.matrix_rank(rows, tol=1e-9) == len(rows) - 1
    after, impulse = held.stopped(v)
    np.testing.assert_allclose(rows @ after, 0.0, atol=1e-12)
    np.testing.assert_allclose(matrix @ (after - v), rows.T @ impulse, atol=1e-11)
    lost = v @ matrix @ v - after @ matrix @ after
    assert lost == pytest.approx((v - after) @ matrix @ (v - after), rel=1e-12)
    assert lost > 0.0
    np.testing.assert_allclose(held.stopped(after)[0], after, atol=1e-13)


@pytest.mark.parametrize("make", [lambda: hs.load_robot("bravo7"), parallel_ankles])
def test_forces_of_rows_do_no_work_and_are_told_apart(make: Any) -> None:
    """A sole's three rows, and loops: of f + Cᵀ λ the motors are left what they were of f."""
    robot = make()
    q, v = moving(robot)
    at = Evaluation(robot, q, v)
    link, place = at.point(robot.feet[0].link, [0.02, -0.05])
    held = HeldRobot(at, [Place(link, place, place, 3)])
    rows = np.concatenate([at.jacobian(link, place), dynamics.loop_jacobian(robot, q)])
    draw = np.random.default_rng(8)
    force, exerted = draw.normal(size=robot.nv), draw.normal(size=len(rows))
    before, after = held.reaction(force), held.reaction(force + rows.T @ exerted)
    np.testing.assert_allclose(after[1], before[1], atol=1e-11)
    np.testing.assert_allclose(after[0] - before[0], exerted, atol=1e-11)
    np.testing.assert_allclose(before[1] + rows.T @ before[0], force, atol=1e-11)
    motion = held.velocity(v)
    assert motion @ force == pytest.approx(v @ before[1], rel=1e-11)
    driven = robot.model.actuator_joint
    np.testing.assert_array_equal(motion[driven], v[driven])
    drift = np.concatenate(
        [at.bias_acceleration(link, place), dynamics.loop_bias_acceleration(robot, q, v)]
    )
    np.testing.assert_allclose(rows @ held.acceleration(v), -drift, atol=1e-11)


@pytest.mark.parametrize("make", [lambda: hs.load_robot("bravo7"), parallel_ankles])
def test_symbols_are_given_the_same_answers(make: Any) -> None:
    """The kernels over CasADi's symbols, with the pivots that numbers have found; loops too."""
    robot = make()
    q, v = moving(robot)
    force = np.random.default_rng(9).normal(size=robot.nv)
    at = Evaluation(robot, q, v)
    link, place = at.point(robot.feet[0].link, [0.02, -0.05])
    held = HeldRobot(at, [Place(link, place, place, 3)])
    arguments = [casadi.SX.sym(name, robot.nv) for name in ("q", "v", "force")]
    traced = TracedDynamics(robot, symbols(arguments[0]), symbols(arguments[1]))
    _, there = traced.point(link, np.array([0.02, -0.05]))
    same = HeldRobot(
        traced, [Place(link, there, there, 3)], dependent=held.rows.coordinate.tolist()
    )
    push = symbols(arguments[2])
    answers = [
        same.velocity(traced.v), same.acceleration(traced.v), *same.reaction(push),
        *same.stopped(traced.v), *same.accelerated(push),
    ]  # fmt: skip
    function = casadi.Function("held", arguments, [expression(each) for each in answers])
    expected = [
        held.velocity(v), held.acceleration(v), *held.reaction(force), *held.stopped(v),
        *held.accelerated(force),
    ]  # fmt: skip
    for found, wanted in zip(function(q, v, force), expected, strict=True):
        np.testing.assert_allclose(np.array(found).ravel(), wanted, rtol=1e-9, atol=1e-9)
