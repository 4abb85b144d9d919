"""Derivatives of motions on compliant ground: against matrix exponentials, differences, and others.

A point on a spring and damper obeys a linear equation, whose errors grow by its exponential; at the
first touch the damper presses at once, and an error of the height meets that earlier or later. Of
robots, runs with tight tolerances are compared; in the air, event-driven motions.
"""

from __future__ import annotations

from typing import Any

import mechanisms
import numpy as np
import pytest
from derivative_checks import ENOUGH, FINE, Floats, Torques, differences, hold
from scipy.linalg import expm

import heelstrike as hs
from heelstrike.sim import BristleFriction, FrictionLaw, RegularisedFriction

STIFFNESS, DAMPING, SPAN = 5e3, 50.0, 0.01
SOFT = hs.KelvinVoigt(stiffness=STIFFNESS, damping=DAMPING)


def simulated(
    robot: hs.Robot, x: Floats, method: hs.Compliant | hs.EventDriven, **how: Any
) -> hs.Simulation:
    """A simulation from a state."""
    state = hs.State(x[: robot.nq], x[robot.nq :])
    return hs.Simulation(robot, state=state, method=method, stop_when_fallen=False, **how)


def through_a_stop(mass: float, fall: Floats, push: float, speed: float, left: float) -> Floats:
    """Errors of a mass that comes to a spring and damper, and stays there for the time left.

    `fall` are those at the touch, where it has the speed, and the acceleration `push` before it.
    """
    rate = np.array([[0.0, 1.0], [-STIFFNESS / mass, -DAMPING / mass]])
    jump = np.outer([0.0, -DAMPING / mass * speed], [1.0, 0.0]) / speed
    return np.asarray(expm(rate * left) @ (np.eye(2) + jump) @ fall)


def test_a_point_that_lands_has_the_errors_of_its_linear_equation() -> None:
    """1 mm above the ground at 1 m/s, and 10 ms later."""
    robot, height, speed = mechanisms.point(mass=2.0), 1e-3, -1.0
    g, x = float(-robot.model.gravity[1]), robot.reference_state().vector.copy()
    x[1] += height - hs.contact_kinematics(robot, x[:2], x[2:]).gap[0]
    x[3] = speed
    found = hs.step_derivatives(simulated(robot, x, hs.Compliant(law=SOFT)), until=SPAN).state
    until = (speed + np.sqrt(speed**2 + 2.0 * g * height)) / g
    fall = np.array([[1.0, until], [0.0, 1.0]])
    seen = through_a_stop(2.0, fall, -g, speed - g * until, SPAN - until)
    np.testing.assert_allclose(found[np.ix_([1, 3], [1, 3])], seen, rtol=1e-9)


def test_a_joint_that_comes_to_its_stop_has_them_too() -> None:
    """A slide that moves freely until then."""
    build = hs.RobotBuilder("slide")
    build.slide("slide", None, mass=2.0, inertia=0.1, limits=(-1.0, 0.004), direction=(1.0, 0.0))
    robot, speed = build.build(), 0.8
    simulation = simulated(robot, np.array([0.0, speed]), hs.Compliant(stop=SOFT))
    found = hs.step_derivatives(simulation, until=SPAN).state
    until = 0.004 / speed
    seen = through_a_stop(2.0, np.array([[1.0, until], [0.0, 1.0]]), 0.0, speed, SPAN - until)
    np.testing.assert_allclose(found, seen, rtol=1e-9)


@pytest.mark.parametrize("friction", [BristleFriction(), RegularisedFriction()])
def test_friction_slows_what_slides_by_the_weight(friction: FrictionLaw) -> None:
    """v = v₀ - μ g t of a point that is as deep in the ground as its weight presses it."""
    robot = mechanisms.point(mass=2.0)
    g, x = float(-robot.model.gravity[1]), robot.reference_state().vector.copy()
    x[1] -= 2.0 * g / STIFFNESS + hs.contact_kinematics(robot, x[:2], x[2:]).gap[0]
    x[2] = 1.0
    simulation = simulated(
        robot, x, hs.Compliant(law=SOFT, friction=friction), ground=hs.Ground(friction=0.4)
    )
    simulation.advance(SPAN)  # a bristle has been bent by then
    found = hs.step_derivatives(simulation, until=2.0 * SPAN, numbers=("friction",))
    assert found.numbers["friction"][2, 0] == pytest.approx(-g * SPAN, rel=1e-6)


FINEST: dict[str, Any] = {"rtol": 1e-11, "atol": 1e-13}


@pytest.mark.slow
@pytest.mark.parametrize(
    "friction",
    [BristleFriction(), pytest.param(RegularisedFriction(speed=1e-3), marks=pytest.mark.slow)],
)
def test_a_landing_robot_has_the_derivatives_that_differences_show(friction: FrictionLaw) -> None:
    """Toes come down, and slip or stick."""
    robot, draw = hs.load_robot("compass_gait"), np.random.default_rng(4)
    q = robot.reference_state().q + 0.05 * draw.normal(size=robot.nq)
    v = 0.3 * draw.normal(size=robot.nv)
    v[1] = -0.5
    state = robot.placed(hs.State(q, v), hs.Ground())
    x, nq = hs.State(state.q + 5e-4 * np.eye(robot.nq)[1], v).vector, robot.nq
    method, span = hs.Compliant(friction=friction, **FINEST), 0.005

    def after(change: Floats) -> Floats:
        ground = hs.Ground(friction=0.5 + change[-1])
        simulation = simulated(robot, x + change[:-1], method, ground=ground)
        simulation.advance(span)
        return simulation.state.vector

    simulation = simulated(robot, x, method, ground=hs.Ground(friction=0.5))
    found = hs.step_derivatives(simulation, until=span, numbers=("friction",))
    assert simulation.contacts.gap.min() < -1e-6
    told = np.hstack([found.state, found.numbers["friction"]])
    scale = np.repeat([1.0, 100.0, 2e3], [nq, nq, 1])
    tries = [
        differences(after, np.eye(len(scale)), size * scale, [True] * len(scale))
        for size in (1e-6, 2.5e-6)
    ]
    for rows in (slice(0, nq), slice(nq, None)):
        for columns in (slice(0, nq), slice(nq, 2 * nq), slice(2 * nq, None)):
            block = told[rows, columns]
            off = min(np.linalg.norm(block - seen[rows, columns]) for seen in tries)
            assert off <= ENOUGH * np.linalg.norm(block)


class Gains(hs.Bundle):
    """Numbers of a law that holds joints."""

    stiffness: Floats = hs.array("nu")


@hs.controller
def spring(state: Any, torque: Floats, parameters: Gains) -> None:
    """Pull every joint back, and damp it."""
    for i in range(torque.shape[0]):
        torque[i] = -parameters.stiffness[i] * state.joint_position[i]
        torque[i] -= 2.0 * state.joint_velocity[i]


def in_the_air() -> tuple[hs.Robot, Floats]:
    """A robot that moves above the ground."""
    robot = hs.load_robot("rabbit")
    state = robot.perturbed(robot.reference_state(), position=0.1, velocity=1.0, seed=2)
    x = state.vector.copy()
    x[1] += 1.0
    return robot, x


def test_in_the_air_all_is_as_event_driven() -> None:
    """By state, torques, masses and gains of a law that acts all the time, under a push."""
    robot, x = in_the_air()
    law = spring(Gains(stiffness=np.full(robot.nu, 30.0)))
    push = hs.Push("torso", force=(40.0, 10.0), start=-1.0, duration=2.0, point=(0.1, 0.2))
    told = [
        hs.step_derivatives(
            simulated(robot, x, method, controller=law, pushes=(push,)),
            until=0.02, numbers=("mass", "inertia"), gains=("stiffness",), answers=answers,
        )
        for answers in (True, False)
        for method in (hs.Compliant(), FINE)
    ]  # fmt: skip
    for own, other in (told[:2], told[2:]):
        pairs = [(own.state, other.state), (own.torque, other.torque)]
        pairs += [(own.numbers[name], other.numbers[name]) for name in ("mass", "inertia")]
        pairs += [(own.gains["stiffness"], other.gains["stiffness"])]
        for one, two in pairs:
            assert np.linalg.norm(one - two) <= ENOUGH * np.linalg.norm(two)
    assert np.any(told[0].gains["stiffness"])
    assert not np.any(told[2].gains["stiffness"])


def test_loops_turn_as_event_driven() -> None:
    robot = mechanisms.four_bar()
    state = robot.closed(hs.State(robot.reference_state().q, np.array([8.0, 0.0, 0.0])))
    own, other = (
        hs.step_derivatives(
            simulated(robot, state.vector, method),
            until=0.01,
            numbers=("mass",),
        )
        for method in (hs.Compliant(rtol=1e-10, atol=1e-12), FINE)
    )
    assert np.linalg.norm(own.state - other.state) <= ENOUGH * np.linalg.norm(other.state)
    off = np.linalg.norm(own.numbers["mass"] - other.numbers["mass"])
    assert off <= ENOUGH * np.linalg.norm(other.numbers["mass"])


def test_a_sampled_law_answers_at_its_calls() -> None:
    """Every second sample, against differences of the closed loop."""
    robot, x = in_the_air()
    law, span = spring(Gains(stiffness=np.full(robot.nu, 30.0))), 0.006
    method = hs.Compliant(**FINEST)

    def begun(change: Floats) -> hs.Simulation:
        return simulated(robot, x + change, method, controller=law, control_period=2e-3)

    def after(change: Floats) -> Floats:
        simulation = begun(change)
        simulation.advance(span)
        return simulation.state.vector

    found = hs.step_derivatives(begun(np.zeros(len(x))), until=span).state
    seen = differences(after, np.eye(len(x)), np.full(len(x), 1e-3), [True] * len(x))
    nq = robot.nq
    for rows in (slice(0, nq), slice(nq, None)):
        for columns in (slice(0, nq), slice(nq, None)):
            off = np.linalg.norm((found - seen)[rows, columns])
            assert off <= ENOUGH * np.linalg.norm(seen[rows, columns])


def test_what_cannot_be_differentiated_is_told() -> None:
    """Brakes that hold; and a run in parts between which bristles are bent."""
    braked = simulated(mechanisms.braked(), np.array([0.3, 0.0]), hs.Compliant())
    braked.braked = ("swing",)
    with pytest.raises(hs.SimulationError, match="brakes on compliant ground"):
        hs.step_derivatives(braked)
    robot = mechanisms.point()
    x = robot.reference_state().vector.copy()
    x[1] -= 1e-3 + hs.contact_kinematics(robot, x[:2], x[2:]).gap[0]
    x[2] = 0.1
    rubbing = hs.Compliant(friction=RegularisedFriction(), law=SOFT)
    run = hs.run_derivatives(simulated(robot, x, rubbing), 0.004, every=0.002)
    whole = hs.run_derivatives(simulated(robot, x, rubbing), 0.004)
    assert len(run.steps) == 2
    assert len(whole.steps) == 1
    product = run.steps[1].state @ run.steps[0].state
    np.testing.assert_allclose(product, whole.steps[0].state, rtol=1e-6, atol=1e-9)
    with pytest.raises(hs.SimulationError, match="leave every out"):
        hs.run_derivatives(simulated(robot, x, hs.Compliant(law=SOFT)), 0.004, every=0.002)


@pytest.mark.parametrize("how", [{}, {"control_period": 2e-3}])
def test_torques_at_their_limits_are_refused(how: dict[str, float]) -> None:
    """Of a law that acts all the time, and of a sampled one, whose limited torque is held."""
    build = hs.RobotBuilder("slide")
    build.slide("slide", None, mass=2.0, inertia=0.1, direction=(1.0, 0.0), torque=9.0)
    robot = build.build()
    law = spring(Gains(stiffness=np.array([3000.0])))
    for place, limited in ((0.002, False), (0.004, True)):  # 6 N and 12 N
        simulation = simulated(robot, np.array([place, 0.0]), hs.Compliant(), controller=law, **how)
        if not limited:
            hs.step_derivatives(simulation, until=0.004)
            continue
        with pytest.raises(hs.SimulationError, match="torques reached the limits of the motors"):
            hs.step_derivatives(simulation, until=0.004)


def test_torques_that_are_held_are_those_that_a_law_asks_for() -> None:
    """By what is added to the torques, and by the parameter that is the torque."""
    robot, x = in_the_air()
    law = hold(Torques(torque=np.linspace(-1.0, 1.0, robot.nu)))
    simulation = simulated(robot, x, hs.Compliant(), controller=law)
    found = hs.step_derivatives(simulation, until=0.003, gains=("torque",))
    np.testing.assert_allclose(found.gains["torque"], found.torque, rtol=1e-6, atol=1e-12)
