"""Derivatives of steps and runs through contact, against differences of what is simulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations

import mechanisms
import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.sim import Scheme
from heelstrike.sim.whole_run import whole

Floats = NDArray[np.float64]

# Blocks by position, velocity, torque and every number, each of positions and velocities after.
ENOUGH = 1e-7
FORWARD = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0
NEAR, SLIPS = 1e-5, 1e-8


class Torques(hs.Bundle):
    """Torques that a law asks for, whatever happens."""

    torque: Floats = hs.array("nu")


@hs.controller
def hold(torque: Floats, parameters: Torques) -> None:
    """Ask for the same torques all the time."""
    for i in range(torque.shape[0]):
        torque[i] = parameters.torque[i]


def differences(
    function: Callable[[Floats], Floats], ways: Floats, size: Floats, two_sided: Sequence[bool]
) -> Floats:
    """Derivatives of a function along some ways at zero: of order four, to one side or to both."""
    columns = []
    for way, change, both in zip(ways.T, size, two_sided, strict=True):
        if both:
            near, far = (
                (function(k * change * way) - function(-k * change * way)) / (2.0 * k * change)
                for k in (1, 2)
            )
            columns.append((4.0 * near - far) / 3.0)
        else:
            seen = [function(k * change * way) for k in range(5)]
            columns.append(FORWARD @ np.array(seen) / change)
    return np.array(columns).T


def allowed(simulation: hs.Simulation) -> tuple[Floats, list[bool]]:
    """Ways in which positions may change without a foot in the ground or a joint beyond its stop.

    The first leave all gaps that are closed as they are; the others open one each.
    """
    robot, q = simulation.robot, simulation.state.q
    gap = simulation.contacts.gap
    normal = hs.dynamics.contact_jacobian(robot, q)[np.abs(gap) < NEAR, 0]
    model = robot.model
    lower, upper = np.abs(q - model.lower) < NEAR, np.abs(q - model.upper) < NEAR
    rows = np.vstack([normal, np.eye(robot.nv)[lower], -np.eye(robot.nv)[upper]])
    if not len(rows):
        return np.eye(robot.nq), [True] * robot.nq
    _, singular, across = np.linalg.svd(rows)
    rank = int(np.sum(singular > 1e-9 * singular[0]))
    still, lift = across[rank:].T, np.linalg.pinv(rows)
    opens = (rows @ lift).min(axis=0) > -1e-9
    return np.hstack([still, lift[:, opens]]), [True] * still.shape[1] + [False] * opens.sum()


def modes_of(simulation: hs.Simulation) -> tuple[object, ...]:
    """What contacts and stops did in the last step, and whether an impact fell into it.

    Of two points of a foot that turns by next to nothing one slips by next to nothing.
    """
    reaction = simulation._memory.reaction
    slips = np.sign(reaction.slip) * (np.abs(reaction.slip) > SLIPS)
    return (reaction.mode > 0).tolist(), slips.tolist(), int(simulation._work.impact.happens)


def worst_of(simulation: hs.Simulation) -> float | None:
    """Largest error of a block of the derivatives of the next step, in parts of the block.

    None if disturbed steps have other contact modes: there is no derivative to all sides then; or
    if differences of several sizes are farther apart, where the solver's tolerance of 1e-9 shows.
    """
    robot, begin = simulation.robot, simulation.snapshot()
    nq, size = robot.nq, robot.nq + robot.nv
    torque = simulation.parameters.torque.copy() if robot.nu else np.zeros(0)
    ways, two_sided = allowed(simulation)
    found = hs.step_derivatives(simulation, answers=False)
    modes, changed = modes_of(simulation), False

    def after(change: Floats) -> Floats:
        nonlocal changed
        state = hs.State(begin.state.q + change[:nq], begin.state.v + change[nq:size])
        simulation.restore(begin.moved(state))
        if robot.nu:
            simulation.parameters.torque[:] = torque + change[size:]
        simulation.step()
        changed = changed or modes_of(simulation) != modes
        return simulation.state.vector

    every = np.zeros((size + robot.nu, ways.shape[1] + robot.nv + robot.nu))
    every[:nq, : ways.shape[1]] = ways
    every[nq:, ways.shape[1] :] = np.eye(robot.nv + robot.nu)
    sides = two_sided + [True] * (robot.nv + robot.nu)
    blocks = np.split(np.arange(len(sides)), np.cumsum([ways.shape[1], robot.nv]))
    told = np.hstack([found.state, found.torque]) @ every
    sizes = np.repeat([1e-6, 1e-5, 1e-3], [len(block) for block in blocks])
    sizes[: ways.shape[1]][~np.array(two_sided, dtype=bool)] = 1e-7
    tries = []
    for factor in (1.0, 2.5, 100.0):
        changed = False
        seen = differences(after, every, factor * sizes, sides)
        tries += [] if changed else [seen]
    simulation.restore(begin)
    if robot.nu:
        simulation.parameters.torque[:] = torque
    worst = 0.0
    for rows in (slice(0, nq), slice(nq, None)):
        for block in blocks:
            scale = np.linalg.norm(told[rows, block]) or 1.0
            apart = [
                np.linalg.norm((one - other)[rows, block]) / scale
                for one, other in combinations(tries, 2)
            ]
            if min(apart, default=1.0) > ENOUGH:  # differences do not know better themselves
                return None
            off = [np.linalg.norm((told - seen)[rows, block]) / scale for seen in tries]
            worst = max(worst, min(off))
    return worst


@cache
def falling(robot: str, scheme: Scheme) -> tuple[int, float, set[int]]:
    """Check derivatives along a fall under random torques: how many, the worst, contact modes."""
    built, ground = hs.load_robot(robot), hs.Ground(friction=0.5)
    draw = np.random.default_rng(3)
    activation = 0.0 if scheme in (Scheme.IMPACT_RESOLVED, Scheme.GAP_LINEARISED) else 1e-3
    law = hold(Torques(torque=draw.normal(size=built.nu))) if built.nu else None
    state = built.placed(
        built.perturbed(built.reference_state(), position=0.05, velocity=0.3, seed=1), ground
    )
    simulation = hs.Simulation(
        built, law, state=state, ground=ground, stop_when_fallen=False,
        method=hs.TimeStepping(step=1e-3, scheme=scheme, activation=activation),
    )  # fmt: skip
    checked, worst, modes = 0, 0.0, set()
    for _ in range(12):
        simulation.advance(simulation.time + 0.023)
        error = worst_of(simulation)
        if error is not None:
            checked, worst = checked + 1, max(worst, error)
            modes |= set(simulation._memory.reaction.mode.tolist())
    return checked, worst, modes


@pytest.mark.parametrize("robot", hs.builtin_robots())
def test_a_time_step_of_every_robot_has_the_derivatives_that_differences_show(robot: str) -> None:
    """Along a fall onto the ground and onto stops, wherever disturbed steps keep contact modes."""
    checked, worst, _ = falling(robot, Scheme.IMPACT_RESOLVED)
    assert checked >= 3
    assert worst <= ENOUGH


@pytest.mark.parametrize("scheme", Scheme)
def test_so_has_one_of_every_scheme(scheme: Scheme) -> None:
    checked, worst, modes = falling("bravo7", scheme)
    assert {0, 1} <= modes
    assert checked >= 3
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


FINE = hs.EventDriven(rtol=1e-13, atol=1e-14)


def blocks_of(
    robot: hs.Robot, x: Floats, span: float, ground: hs.Ground, *, size: float
) -> tuple[hs.StepDerivatives, Floats, hs.Run]:
    """Derivatives of an event-driven interval, differences by its beginning, and the run."""

    def simulated(begin: Floats) -> hs.Simulation:
        state = hs.State(begin[: robot.nq], begin[robot.nq :])
        return hs.Simulation(robot, state=state, method=FINE, ground=ground, stop_when_fallen=False)

    def after(change: Floats) -> Floats:
        simulation = simulated(x + change)
        simulation.advance(span)
        return simulation.state.vector

    found = hs.step_derivatives(simulated(x), until=span, numbers=("friction", "mass"))
    seen = differences(after, np.eye(len(x)), np.full(len(x), size), [True] * len(x))
    simulation = simulated(x)
    simulation.advance(span)
    return found, seen, whole(simulation.record)


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
