"""A four-bar linkage against its one coordinate, written out by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from mechanisms import four_bar, geared
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import heelstrike as hs
from heelstrike import dynamics

Floats = NDArray[np.float64]

G = 9.81
CRANK, COUPLER, ROCKER = np.array([0.0, 0.2]), np.array([0.5, 0.3]), np.array([0.0, 0.5])
PIVOT = np.array([0.5, 0.0])  # of the rocker
MASS, INERTIA = np.array([1.0, 1.5, 1.2]), np.array([0.02, 0.08, 0.05])
CENTER = np.array([[0.0, 0.1], [0.3, 0.15], [0.0, 0.2]])
DURATION = 1.0
START, SPEED = 0.3, 4.0
"""Crank angle (rad) and speed (rad/s) at the beginning."""


def turned(angle: float, vector: Floats) -> Floats:
    """Turn a vector (x, z) about +y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])


def lever(angle: float, vector: Floats) -> Floats:
    """Derivative of a turned vector by the angle."""
    return turned(angle + 0.5 * np.pi, vector)


@dataclass
class OneCoordinate:
    """Angles of coupler and rocker that go with one of the crank; all are absolute, about +y.

    The loop ``crank + coupler = pivot + rocker`` is solved for two angles, b and c, and
    differentiated twice by the first, a.
    """

    near: Floats

    def angles(self, a: float) -> Floats:
        x = self.near.copy()
        for _ in range(30):
            error = turned(a, CRANK) + turned(x[0], COUPLER) - PIVOT - turned(x[1], ROCKER)
            x -= np.linalg.solve(self.matrix(x), error)
        self.near = x
        return np.array([a, *x])

    def matrix(self, x: Floats) -> Floats:
        return np.column_stack([lever(x[0], COUPLER), -lever(x[1], ROCKER)])

    def rates(self, angle: Floats) -> tuple[Floats, Floats]:
        """First and second derivatives of the three angles by the first."""
        matrix = self.matrix(angle[1:])
        first = np.array([1.0, *-np.linalg.solve(matrix, lever(angle[0], CRANK))])
        curved = (
            -turned(angle[0], CRANK)
            - turned(angle[1], COUPLER) * first[1] ** 2
            + turned(angle[2], ROCKER) * first[2] ** 2
        )
        return first, np.array([0.0, *-np.linalg.solve(matrix, curved)])

    def centers(self, angle: Floats) -> tuple[Floats, Floats]:
        """First and second derivatives of the centres of mass by the crank's angle, (3, 2)."""
        first, second = self.rates(angle)
        once = np.array([lever(angle[i], CENTER[i]) * first[i] for i in range(3)])
        twice = np.array(
            [
                lever(angle[i], CENTER[i]) * second[i] - turned(angle[i], CENTER[i]) * first[i] ** 2
                for i in range(3)
            ]
        )
        once[1] += lever(angle[0], CRANK)
        twice[1] -= turned(angle[0], CRANK)
        return once, twice

    def acceleration(self, a: float, speed: float) -> float:
        """Of the crank, by Lagrange: I a'' + I' a'² / 2 = −V'."""
        angle = self.angles(a)
        (first, second), (once, twice) = self.rates(angle), self.centers(angle)
        inertia = INERTIA @ first**2 + MASS @ np.sum(once**2, axis=1)
        slope = 2.0 * (INERTIA @ (first * second) + MASS @ np.sum(once * twice, axis=1))
        return float((-G * MASS @ once[:, 1] - 0.5 * slope * speed**2) / inertia)

    def state(self, a: float, speed: float) -> hs.State:
        angle = self.angles(a)
        first, _ = self.rates(angle)
        relative = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        return hs.State(relative @ angle, relative @ first * speed)

    def force(self, a: float, speed: float) -> Floats:
        """Of the rocker on the coupler, by the moments about the other hinge of each."""
        angle = self.angles(a)
        (first, second), (once, twice) = self.rates(angle), self.centers(angle)
        push = self.acceleration(a, speed)
        turn = first * push + second * speed**2
        weight = np.array([0.0, -G])
        arms = [turned(angle[i], CENTER[i]) for i in range(3)]
        ends = [turned(angle[1], COUPLER), turned(angle[2], ROCKER)]
        missing = []
        for i in (1, 2):
            motion = once[i] * push + twice[i] * speed**2
            pull = MASS[i] * (motion - weight)
            missing.append(INERTIA[i] * turn[i] + arms[i][1] * pull[0] - arms[i][0] * pull[1])
        # A force (x, z) at an arm has the moment z_arm x − x_arm z about +y.
        matrix = [[ends[0][1], -ends[0][0]], [-ends[1][1], ends[1][0]]]
        return np.linalg.solve(matrix, missing)


@pytest.fixture(scope="module")
def by_hand() -> tuple[OneCoordinate, Floats]:
    """Return the linkage, and angle and speed of its crank at the end."""
    linkage = OneCoordinate(np.zeros(2))
    linkage.angles(START)
    motion = solve_ivp(
        lambda _, y: [y[1], linkage.acceleration(*y)], (0.0, DURATION), [START, SPEED],
        method="DOP853", rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    return linkage, motion.y[:, -1]


def begin() -> tuple[hs.Robot, hs.State]:
    robot = four_bar()
    state = robot.state({"crank": START}, {"crank": SPEED})
    return robot, robot.closed(state, keep=["crank"])


def test_a_state_is_closed_as_it_is_by_hand() -> None:
    state = begin()[1]
    expected = OneCoordinate(np.zeros(2)).state(START, SPEED)
    np.testing.assert_allclose(state.q, expected.q, rtol=0, atol=1e-13)
    np.testing.assert_allclose(state.v, expected.v, rtol=0, atol=1e-12)


def test_event_driven_motion_and_forces(by_hand: tuple[OneCoordinate, Floats]) -> None:
    """The crank has turned once round by then. Both integrators leave some 1e-11."""
    linkage, end = by_hand
    robot, state = begin()
    method = hs.EventDriven(rtol=1e-11, atol=1e-13)
    run = hs.simulate(robot, state=state, duration=DURATION, method=method)
    expected = linkage.state(*end)
    np.testing.assert_allclose(run.final_state.q, expected.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.final_state.v, expected.v, rtol=0, atol=1e-8)
    linkage = OneCoordinate(np.zeros(2))
    for row in range(0, len(run.time), 50):
        force = linkage.force(run.position[row, 0], run.velocity[row, 0])
        np.testing.assert_allclose(run.loop_force[row, 0], force, rtol=1e-9, atol=1e-9)


def test_time_stepping_converges_to_it_with_order_one(
    by_hand: tuple[OneCoordinate, Floats],
) -> None:
    linkage, end = by_hand
    robot, state = begin()
    expected = linkage.state(*end)
    errors, forces = [], []
    for step in (1e-4, 1e-5):
        method = hs.TimeStepping(step=step)
        run = hs.simulate(robot, state=state, duration=DURATION, method=method)
        errors.append(np.abs(run.final_state.q - expected.q).max())
        forces.append(np.abs(run.loop_force[-1, 0] - linkage.force(*end)).max())
    assert errors[1] < 4e-3
    assert np.log10(errors[0] / errors[1]) > 0.95
    assert np.log10(forces[0] / forces[1]) > 0.95


def test_compliant_ground_keeps_loops_exactly_too(by_hand: tuple[OneCoordinate, Floats]) -> None:
    linkage, end = by_hand
    robot, state = begin()
    method = hs.Compliant(rtol=1e-8, atol=1e-10)
    run = hs.simulate(robot, state=state, duration=DURATION, method=method)
    expected = linkage.state(*end)
    np.testing.assert_allclose(run.final_state.q, expected.q, rtol=0, atol=2e-6)
    assert np.abs(run.loop_force[-1, 0] - linkage.force(*end)).max() < 1e-3


METHODS = [
    hs.EventDriven(),
    hs.Compliant(),
    *(hs.TimeStepping(scheme=scheme) for scheme in hs.Scheme),
]


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_loops_do_not_drift_in_a_minute(method: object) -> None:
    """Rounding is 1e-16 m; a minute of this linkage is some fifty turns of the crank."""
    robot, state = begin()
    run = hs.simulate(robot, state=state, duration=60.0, method=method, record_every=97)
    assert run.completed
    drift = [np.abs(dynamics.loop_displacement(robot, q)).max() for q in run.position]
    assert max(drift) < 1e-12


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_coupled_joint_is_one_pendulum_with_its_leader(method: object) -> None:
    """θ₂ = ρ θ₁ makes (I₁ + ρ² I₂) θ₁'' = −m g l (sin θ₁ + ρ sin ρ θ₁), I = I_c + m l²."""
    ratio, inertia, weight = 2.0, 0.01 + 0.09, 9.81 * 0.3
    robot = geared((0.0, ratio))
    motion = solve_ivp(
        lambda _, y: [
            y[1],
            -weight * (np.sin(y[0]) + ratio * np.sin(ratio * y[0])) / (inertia * (1 + ratio**2)),
        ],
        (0.0, 0.5), [0.4, 0.0], rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    angle, rate = motion.y[:, -1]
    run = hs.simulate(
        robot, state=robot.state({"front": 0.4, "rear": 0.8}), duration=0.5, method=method
    )
    error = {"EventDriven": 1e-7, "Compliant": 1e-4}.get(type(method).__name__, 1e-2)
    np.testing.assert_allclose(run.final_state.q, [angle, ratio * angle], rtol=0, atol=error)
    # What turns the rear one: its own equation of motion, moment of the coupling besides weight.
    push = -weight * (np.sin(angle) + ratio * np.sin(ratio * angle)) / (inertia * (1 + ratio**2))
    moment = inertia * ratio * push + weight * np.sin(ratio * angle)
    assert run.coupling_force[-1, 0] == pytest.approx(moment, abs=10.0 * error)
    assert abs(rate) > 1.0
