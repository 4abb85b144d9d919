"""Derivatives of steps and runs through contact, against differences of what is simulated."""

from __future__ import annotations

from dataclasses import replace

import mechanisms
import numpy as np
import pytest
import walking
from derivative_checks import (
    ENOUGH,
    FINE,
    Floats,
    Torques,
    blocks_of,
    differences,
    hold,
    interval,
    time_steps,
)

import heelstrike as hs
from heelstrike.sim import Scheme

QUICK = ("bravo7",)
"""The robot that stands for all where time is short."""
ROBOTS = [
    robot if robot in QUICK else pytest.param(robot, marks=pytest.mark.slow)
    for robot in hs.builtin_robots()
]
SCHEMES = [
    scheme if scheme is Scheme.GAP_LINEARISED else pytest.param(scheme, marks=pytest.mark.slow)
    for scheme in Scheme
]


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_time_step_of_every_robot_has_the_derivatives_that_differences_show(robot: str) -> None:
    """Along a fall onto the ground and onto stops, wherever disturbed steps keep contact modes."""
    found = time_steps(hs.load_robot(robot))
    assert found.count >= 3
    assert found.worst <= ENOUGH


@pytest.mark.parametrize("scheme", SCHEMES)
def test_so_has_one_of_every_scheme(scheme: Scheme) -> None:
    found = time_steps(hs.load_robot("bravo7"), scheme)
    assert {0, 1} <= found.modes
    assert found.count >= 3
    assert found.worst <= ENOUGH


def lifted(robot: hs.Robot) -> hs.State:
    """A robot in the air, moving, with its loops closed."""
    moving = robot.perturbed(robot.reference_state(), position=0.02, velocity=0.2, seed=1)
    state = robot.closed(robot.placed(moving, hs.Ground()))
    return hs.State(state.q + 0.01 * np.eye(robot.nq)[1], state.v)


def test_closed_loops_are_kept_by_steps_that_are_differentiated() -> None:
    """Fast ones too, whose positions are put back by what matters; and coupled joints."""
    robot = mechanisms.four_bar()
    for scheme in (Scheme.IMPACT_RESOLVED, Scheme.MOREAU_JEAN):
        turning = hs.State(robot.reference_state().q, [8.0, 0.0, 0.0])
        found = time_steps(robot, scheme, state=turning, tries=3)
        assert found.count == 3
        assert found.worst <= ENOUGH
    legs = mechanisms.parallel_ankles()
    found = time_steps(legs, state=lifted(legs), tries=4)
    assert {0, 1} <= found.modes
    assert found.worst <= ENOUGH
    geared = mechanisms.geared((0.1, 2.0, 0.4))
    state = geared.closed(hs.State([0.4, 0.3], [3.0, 1.0]))
    found = time_steps(geared, state=state, tries=3)
    assert found.count == 3
    assert found.worst <= ENOUGH


def test_a_heavier_link_closes_a_loop_another_way() -> None:
    """By masses, against differences of robots with other masses, in a step and over several."""
    robot = mechanisms.four_bar()
    state = robot.closed(hs.State(robot.reference_state().q, [8.0, 0.0, 0.0]))

    def simulated(mass: Floats) -> hs.Simulation:
        heavier = replace(robot, model=robot.model.replaced(mass=robot.model.mass + mass))
        return hs.Simulation(heavier, state=state, stop_when_fallen=False)

    def after(mass: Floats) -> Floats:
        simulation = simulated(mass)
        simulation.advance(0.02)
        return simulation.state.vector

    found = hs.step_derivatives(simulated(np.zeros(3)), until=0.02, numbers=("mass",))
    seen = differences(after, np.eye(3), np.full(3, 1e-3), [True] * 3)
    for rows in (slice(0, 3), slice(3, None)):
        error = np.linalg.norm((found.numbers["mass"] - seen)[rows])
        assert error <= ENOUGH * np.linalg.norm(seen[rows])


def test_brakes_take_hold_and_hold_in_steps_that_are_differentiated() -> None:
    """Where a brake takes hold the joint stops; then it stays."""
    robot = mechanisms.braked()
    simulation = hs.Simulation(robot, state=hs.State([0.3], [2.0]), stop_when_fallen=False)
    simulation.step()
    simulation.braked = ("swing",)
    for _ in range(2):
        np.testing.assert_allclose(hs.step_derivatives(simulation).state, 0.0, atol=1e-12)


def test_a_push_turns_with_the_link_that_it_acts_on() -> None:
    """Its force keeps its direction, its lever does not."""
    robot = hs.load_robot("bravo7")
    state = robot.perturbed(robot.reference_state(), position=0.05, velocity=0.3, seed=1)
    pushes = (
        hs.Push("trunk", force=(300.0, 80.0), start=0.0, duration=0.1, point=(0.3, 0.4)),
        hs.Push("right_foot", force=(30.0, -80.0), start=0.0, duration=0.1, point=(0.1, 0.0)),
    )
    high = hs.State(state.q + np.eye(robot.nq)[1], state.v)
    found = time_steps(robot, state=high, pushes=pushes, tries=2)
    assert found.count == 2
    assert found.worst <= ENOUGH


def test_pushes_and_brakes_are_gone_through_in_an_event_driven_motion() -> None:
    """A push begins and ends within a fall in which a foot comes down; a brake holds a knee."""
    legs = hs.RobotBuilder("legs")
    trunk = legs.floating_base("trunk", (0.0, 0.8), mass=10.0, inertia=0.5)
    for side in ("right", "left"):
        thigh = legs.hinge(f"{side}_hip", trunk, mass=3.0, inertia=0.05, center_of_mass=(0, -0.2))
        shank = legs.hinge(
            f"{side}_knee", thigh, at=(0, -0.4), mass=2.0, inertia=0.03, center_of_mass=(0, -0.2)
        )
        legs.contact(shank, (0.0, -0.4))
        legs.brake(f"{side}_knee")
    robot = legs.build()
    push = hs.Push("trunk", force=(60.0, -20.0), start=0.02, duration=0.05, point=(0.1, 0.3))
    found = interval(robot, seed=2, pushes=(push,))
    assert found is not None
    worst, events = found
    assert "TOUCHDOWN" in events
    assert worst <= ENOUGH
    # As a simulation begins, velocities are made to fit the brake, the shortest way by the masses.
    state, nq = (
        robot.perturbed(robot.reference_state(), position=0.1, velocity=1.0, seed=3),
        robot.nq,
    )
    state = robot.placed(state, hs.Ground())
    x, knee = state.vector.copy(), robot.joint_index("right_knee")
    x[1], x[nq + knee] = x[1] + 0.01, 0.0
    held = np.linalg.solve(hs.dynamics.mass_matrix(robot, x[:nq]), np.eye(nq)[knee])
    fitted = np.eye(2 * nq)
    fitted[nq:, nq + knee] -= held / held[knee]
    told, seen, run = blocks_of(
        robot, x, 0.2, hs.Ground(friction=0.5), size=1e-5, pushes=(push,), braked=("right_knee",)
    )
    assert any(event.kind.name == "TOUCHDOWN" for event in run.events)
    error = np.linalg.norm(told.state @ fitted - seen)
    assert error <= ENOUGH * np.linalg.norm(seen)


@pytest.mark.parametrize(("robot", "seed"), [("compass_gait", 7), ("rabbit", 3)])
def test_an_event_driven_fall_has_the_derivatives_that_differences_show(
    robot: str, seed: int
) -> None:
    """Touchdowns, slips and quick light legs; ``benchmarks/derivatives.py`` has all robots."""
    found = interval(hs.load_robot(robot), seed=seed)
    assert found is not None
    worst, events = found
    assert "TOUCHDOWN" in events
    assert worst <= ENOUGH


def test_friction_and_masses_of_a_sliding_block_are_those_of_its_equation() -> None:
    """v⁺ = v − μ g h and q⁺ = q + h v⁺, whatever the mass; a torque-free block slides forward."""
    robot, step = mechanisms.block(width=0.3, height=0.1), 1e-3
    state = hs.State(np.array([0.0, 0.05, 0.0]), np.array([0.5, 0.0, 0.0]))
    simulation = hs.Simulation(robot, state=state, ground=hs.Ground(friction=0.4))
    run = hs.run_derivatives(simulation, 5 * step, numbers=("friction", "mass"))
    own = np.abs(robot.model.gravity[1])
    found = run.steps[0].numbers
    np.testing.assert_allclose(found["friction"][[0, 3], 0], [-(step**2) * own, -step * own])
    np.testing.assert_allclose(found["mass"][:, 2], 0.0, atol=1e-12)
    changes = run.forward(numbers={"friction": 1e-3})
    after = simulation.state.v[0]
    assert after == pytest.approx(0.5 - 0.4 * own * 5 * step, abs=1e-12)
    assert changes[-1, 3] == pytest.approx(-1e-3 * own * 5 * step, rel=1e-9)
    gradient = run.adjoint([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    assert gradient.numbers["friction"][0] == pytest.approx(-own * 5 * step, rel=1e-9)


def test_the_adjoint_of_a_run_is_the_transpose_of_its_forward_derivative() -> None:
    """⟨g, forward(x)⟩ = ⟨adjoint(g), x⟩: gradients at every state, changes of every input."""
    robot, draw = walking.bravo7(), np.random.default_rng(5)
    law = hold(Torques(torque=draw.normal(size=robot.nu)))
    simulation = hs.Simulation(robot, law, state=walking.gait().initial_state)
    run = hs.run_derivatives(simulation, 0.006, numbers=("friction", "mass"), gains=("torque",))
    size, steps = robot.nq + robot.nv, len(run.steps)
    assert steps == 6
    state, torque = draw.normal(size=size), draw.normal(size=(steps, robot.nu))
    first = run.steps[0]
    numbers = {name: draw.normal(size=each.shape[1]) for name, each in first.numbers.items()}
    gains = {"torque": draw.normal(size=robot.nu)}
    gradient = draw.normal(size=(steps + 1, size))
    forward = float(np.sum(gradient * run.forward(state, torque, numbers=numbers, gains=gains)))
    back = run.adjoint(gradient)
    backward = float(back.state @ state + np.sum(back.torque * torque))
    backward += sum(float(back.numbers[name] @ each) for name, each in numbers.items())
    backward += float(back.gains["torque"] @ gains["torque"])
    # A torque that the law is asked for is one that is added.
    np.testing.assert_allclose(back.gains["torque"], back.torque.sum(axis=0), rtol=1e-6, atol=1e-9)
    assert forward == pytest.approx(backward, rel=1e-12)


def test_a_law_that_answers_closes_the_loop() -> None:
    """Feedback, sampled every third step: against differences of the closed loop, and its gains."""
    built, gait = walking.bravo7(), walking.gait()
    law = hs.ComputedTorque(built, gait)
    simulation = hs.Simulation(
        built, law, state=gait.initial_state, method=hs.TimeStepping(step=1e-3), control_period=3e-3
    )
    simulation.advance(0.3)
    begin, n = simulation.snapshot(), built.nq
    found = hs.step_derivatives(simulation, until=0.306, gains=("kp",))
    kp = simulation.parameters.kp.copy()
    scale = np.append(np.ones(built.nv), 1e3)  # of gains in N m/rad

    def after(change: Floats) -> Floats:
        v = begin.state.v + change[: built.nv]
        simulation.restore(begin.moved(hs.State(begin.state.q, v)))
        simulation.parameters.kp[...] = kp
        simulation.parameters.kp.flat[0] += change[built.nv]
        simulation.advance(0.306)
        return simulation.state.vector

    size = built.nv + 1
    seen = differences(after, np.diag(scale), np.full(size, 1e-5), [True] * size)
    told = np.hstack([found.state[:, n:], scale[-1] * found.gains["kp"][:, :1]])
    for rows in (slice(0, n), slice(n, None)):
        error = np.linalg.norm(told[rows] - seen[rows]) / np.linalg.norm(seen[rows])
        assert error <= ENOUGH


@pytest.mark.parametrize("late", [1, 2, 3])
def test_a_run_that_begins_between_two_calls_loses_no_answer(late: int) -> None:
    """Derivatives of its intervals, multiplied, are those of the closed loop as differences see it.

    The law is asked every third step. An interval that ended between two calls would leave what was
    answered in it to act in the next, where nothing told of it.
    """
    built, gait = walking.bravo7(), walking.gait()
    simulation = hs.Simulation(
        built, hs.ComputedTorque(built, gait), state=gait.initial_state,
        method=hs.TimeStepping(step=1e-3), control_period=3e-3,
    )  # fmt: skip
    simulation.advance(0.3 + 1e-3 * late)
    begin, n, until = simulation.snapshot(), built.nq, 0.3 + 1e-3 * late + 0.01

    def after(change: Floats) -> Floats:
        moved = hs.State(begin.state.q, begin.state.v + change)
        simulation.restore(begin.moved(moved))
        simulation.advance(until)
        return simulation.state.vector

    seen = differences(after, np.eye(n), np.full(n, 1e-5), [True] * n)
    for every in (None, 6e-3):
        simulation.restore(begin)
        run = hs.run_derivatives(simulation, until, every=every)
        first = 3e-3 - 1e-3 * (late % 3)
        second = first + (every or 3e-3)
        if late % 3 == 0:
            first = every or 3e-3
            second = 2.0 * first
        ends = [each.end - begin.time for each in run.steps]
        assert ends[:2] == pytest.approx([first, min(second, 0.01)], abs=1e-12)
        assert ends[-1] == pytest.approx(0.01, abs=1e-12)
        told = np.linalg.multi_dot([each.state for each in run.steps[::-1]])[:, n:]
        for rows in (slice(0, n), slice(n, None)):
            error = np.linalg.norm(told[rows] - seen[rows]) / np.linalg.norm(seen[rows])
            assert error <= ENOUGH


def test_a_point_that_bounces_within_a_step_leaves_with_a_part_of_its_speed() -> None:
    """v⁺ = −e v, wherever it was; positions arrive on the ground, whatever the speed."""
    robot, nq = mechanisms.point(), mechanisms.point().nq
    x = robot.reference_state().vector.copy()
    x[1] += 1e-4 - hs.contact_kinematics(robot, x[:nq], x[nq:]).gap[0]
    x[nq + 1] = -1.0
    simulation = hs.Simulation(
        robot, state=hs.State(x[:nq], x[nq:]), ground=hs.Ground(restitution=0.5),
        method=hs.TimeStepping(step=1e-3), stop_when_fallen=False,
    )  # fmt: skip
    found = hs.step_derivatives(simulation).state
    assert simulation.state.v[1] == pytest.approx(0.5, abs=1e-12)
    assert found[nq + 1, nq + 1] == pytest.approx(-0.5, abs=1e-12)
    assert found[nq + 1, 1] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(found[1, [1, nq + 1]], 0.0, atol=1e-12)


def test_an_interval_with_touchdown_slip_and_rest_inside_has_exact_derivatives() -> None:
    """A block lands on one corner, slides, lands on the other, and comes to rest."""
    robot, ground = mechanisms.block(width=0.3, height=0.1), hs.Ground(friction=0.4)
    x = np.array([0.0, 0.08, 0.1, 0.5, -0.1, 0.2])
    found, seen, run = blocks_of(robot, x, 0.25, ground, size=1e-4)
    kinds = {event.kind.name for event in run.events}
    assert {"TOUCHDOWN", "SLIP", "STICK"} <= kinds
    assert np.linalg.norm(found.state[:3] - seen[:3]) <= ENOUGH * np.linalg.norm(seen[:3])
    np.testing.assert_allclose(found.state[3:], 0.0, atol=1e-9)  # it rests

    def rests(friction: float) -> Floats:
        simulation = hs.Simulation(
            robot, state=hs.State(x[:3], x[3:]), method=FINE, ground=hs.Ground(friction=friction)
        )
        simulation.advance(0.25)
        return simulation.state.vector

    by_friction = differences(
        lambda change: rests(0.4 + change[0]), np.ones((1, 1)), np.array([1e-4]), [True]
    )
    error = np.linalg.norm(found.numbers["friction"] - by_friction)
    assert error <= ENOUGH * np.linalg.norm(by_friction)


def test_a_joint_that_comes_to_its_stop_is_gone_through() -> None:
    """A walker in the air, whose knee comes to its stop at 5 rad/s and stays there."""
    robot = hs.load_robot("walker2d")
    knee, state = robot.joint_index("right_knee"), robot.reference_state()
    x = state.vector.copy()
    x[1] += 1.0
    middle = 0.5 * (robot.model.lower[3:] + robot.model.upper[3:])
    x[3 : robot.nq] = np.clip(middle, -0.2, 0.2)
    x[knee], x[robot.nq + knee] = -0.3, 5.0
    found, seen, run = blocks_of(robot, x, 0.1, hs.Ground(), size=1e-4)
    assert any(event.kind.of_joint for event in run.events)
    for rows in (slice(0, robot.nq), slice(robot.nq, None)):
        for columns in (slice(0, robot.nq), slice(robot.nq, None)):
            off = np.linalg.norm((found.state - seen)[rows, columns])
            assert off <= ENOUGH * np.linalg.norm(seen[rows, columns])


def test_at_a_change_of_mode_each_side_has_its_own_derivative() -> None:
    """A point that falls and just arrives at the end of a step: it is caught, or just not.

    Free, v⁺ = v − g h. Caught, its gap is closed by the step: v⁺ = −z/h. Differences to either
    side show the two.
    """
    robot, step = mechanisms.point(), 1e-3
    g = float(-robot.model.gravity[1])
    v = -0.5
    z = -step * (v - g * step)
    nq = robot.nq

    def stepped(
        change: float, modes: dict[str, str] | None = None
    ) -> tuple[hs.StepDerivatives, float]:
        x = robot.reference_state().vector.copy()
        low = hs.contact_kinematics(robot, x[:nq], x[nq:]).gap[0]
        x[1] += z - low
        x[nq + 1] = v + change
        simulation = hs.Simulation(
            robot, state=hs.State(x[:nq], x[nq:]), stop_when_fallen=False,
            method=hs.TimeStepping(step=step, scheme=Scheme.GAP_LINEARISED),
        )  # fmt: skip
        found = hs.step_derivatives(simulation, modes=modes)
        return found, float(simulation.state.v[1])

    found, at = stepped(0.0)
    (change,) = found.changes
    sides = {change.mode: found}
    for mode in change.others:
        sides[mode], _ = stepped(0.0, {change.contact: mode})
    free, caught = sides["open"].state[nq + 1], sides["stick"].state[nq + 1]
    assert free[nq + 1] == pytest.approx(1.0)
    assert caught[nq + 1] == pytest.approx(0.0, abs=1e-12)
    assert caught[1] == pytest.approx(-1.0 / step)
    up, down = (stepped(side * 1e-6)[1] - at for side in (1, -1))
    assert up == pytest.approx(1e-6, rel=1e-6)
    assert down == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(hs.SimulationError, match="not at a change"):
        stepped(-1e-3, {change.contact: "open"})


@pytest.mark.parametrize(
    ("scheme", "ahead"), [(Scheme.MOREAU_JEAN, 0.5), (Scheme.LINEARLY_IMPLICIT, 1.0)]
)
def test_springs_that_a_scheme_takes_ahead_are_so_in_its_derivative(
    scheme: Scheme, ahead: float
) -> None:
    """(m + θ h d + θ² h² k) Δv = −h (k q + d v + θ h k v), in closed form."""
    build = hs.RobotBuilder("swing")
    m, k, d, h = 2.0, 900.0, 7.0, 1e-2
    build.slide("x", None, direction=(1, 0), mass=m, stiffness=k, damping=d)
    simulation = hs.Simulation(
        build.build(), state=hs.State([0.1], [0.3]), stop_when_fallen=False,
        method=hs.TimeStepping(step=h, scheme=scheme),
    )  # fmt: skip
    with pytest.raises(hs.SimulationError, match="stiffness into the mass matrix"):
        hs.step_derivatives(simulation, numbers=("stiffness",))
    found = hs.step_derivatives(simulation)
    heavy = m + ahead * h * d + (ahead * h) ** 2 * k
    by_q, by_v = -h * k / heavy, 1.0 - h * (d + ahead * h * k) / heavy
    np.testing.assert_allclose(found.state[1], [by_q, by_v], rtol=1e-12)


@pytest.mark.parametrize("method", [hs.TimeStepping(step=1e-3), hs.Compliant(step=1e-3)])
def test_an_end_within_a_step_is_rounded_as_a_simulation_rounds_it(
    method: hs.TimeStepping | hs.Compliant,
) -> None:
    """And a run goes on until its end, whatever part of it the last state comes after."""
    robot = mechanisms.point()
    high = robot.reference_state().q + np.array([0.0, 1.0])

    def begun() -> hs.Simulation:
        return hs.Simulation(robot, state=hs.State(high, np.zeros(2)), method=method)

    for until in (0.0024, 0.0025, 0.0026):
        simulation = begun()
        simulation.advance(until)
        found = hs.step_derivatives(begun(), until=until)
        assert found.end == pytest.approx(simulation.time, abs=1e-12)
        assert found.state[1, 3] == pytest.approx(simulation.time)
        assert hs.run_derivatives(begun(), until).steps[-1].end == found.end
    run = hs.run_derivatives(begun(), 0.0054, every=0.004)
    assert [each.end for each in run.steps] == pytest.approx([0.004, 0.005])
    for every in (0.0025, 0.0, -0.001, np.nan):
        with pytest.raises(hs.SimulationError, match="every must be positive, and a multiple of"):
            hs.run_derivatives(begun(), 0.01, every=every)
    late = begun()
    late.advance(0.01)
    with pytest.raises(hs.SimulationError, match="until must not be before"):
        hs.step_derivatives(late, until=0.005)
