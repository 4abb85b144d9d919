"""Virtual constraints: outputs obey their law, on either foot, under any robot that they fit."""

from __future__ import annotations

import math

import numpy as np
import published_walkers as published
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.control.virtual_constraints import finite_time, series
from heelstrike.sim import Contacts

Floats = NDArray[np.float64]


gait = walking.rabbit_phased


def state_near(gait: hs.PhasedGait, draw: np.random.Generator) -> hs.State:
    """State in a step with its foot at rest at the origin, off the constraints."""
    robot = gait.robot
    contact = robot.feet[gait.stance_foot].contacts[0]
    theta = draw.uniform(*gait.phase_range)
    rate = draw.uniform(0.5, 1.5)
    q, v = np.zeros(robot.nq), np.zeros(robot.nv)
    driven = robot.model.actuator_joint
    q[driven] = gait.joints(theta) + 0.02 * draw.normal(size=robot.nu)
    v[driven] = rate * gait.joints(theta, order=1) + 0.1 * draw.normal(size=robot.nu)
    q[2] = (theta - gait.phase[3:] @ q[3:]) / gait.phase[2]
    v[2] = (rate - gait.phase[3:] @ v[3:]) / gait.phase[2]
    q[:2] -= dynamics.contact_positions(robot, q)[contact]
    rows = dynamics.contact_jacobian(robot, q)[contact]
    v[:2] = -np.linalg.solve(rows[:, :2], rows @ v)
    return hs.State(q, v)


def torque_and_acceleration(
    gait: hs.PhasedGait, law: hs.VirtualConstraints, state: hs.State
) -> tuple[Floats, Floats]:
    """Torques of a law, and what forward dynamics with contact makes of them."""
    robot = gait.robot
    contacts = Contacts(
        position=dynamics.contact_positions(robot, state.q),
        normal=np.tile([0.0, 1.0], (2, 1)),
        gap=np.zeros(2),
        force=np.zeros((2, 2)),
    )
    torque = law.torque(0.0, state, contacts)
    found = hs.contact_forward_dynamics(
        robot, state.q, state.v, torque, ground=hs.Ground(friction=50.0)
    )
    contact = robot.feet[gait.stance_foot].contacts[0]
    np.testing.assert_allclose(found.contact_acceleration[contact], 0.0, atol=1e-8)
    return torque, found.acceleration


def output_acceleration(gait: hs.PhasedGait, state: hs.State, acceleration: Floats) -> Floats:
    """Second derivative of q_a − h_d(θ), by the chain rule."""
    driven = gait.robot.model.actuator_joint
    theta, rate = gait.phase @ state.q, gait.phase @ state.v
    return np.asarray(
        acceleration[driven]
        - gait.joints(theta, order=1) * (gait.phase @ acceleration)
        - gait.joints(theta, order=2) * rate**2
    )


def errors(gait: hs.PhasedGait, state: hs.State) -> tuple[Floats, Floats]:
    driven = gait.robot.model.actuator_joint
    theta = gait.phase @ state.q
    slope = gait.joints(theta, order=1)
    rate = gait.phase @ state.v
    return state.q[driven] - gait.joints(theta), state.v[driven] - slope * rate


@pytest.mark.parametrize("seed", range(6))
def test_outputs_obey_the_linear_law(seed: int) -> None:
    """Against forward dynamics with contact, which knows nothing of the law."""
    draw = np.random.default_rng(seed)
    state = state_near(gait(), draw)
    kp, kd = draw.uniform(50.0, 400.0, 4), draw.uniform(5.0, 40.0, 4)
    law = hs.VirtualConstraints(gait(), kp=kp, kd=kd)
    _, acceleration = torque_and_acceleration(gait(), law, state)
    y, rate = errors(gait(), state)
    found = output_acceleration(gait(), state, acceleration)
    np.testing.assert_allclose(found, -kp * y - kd * rate, atol=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_outputs_obey_the_finite_time_law(seed: int) -> None:
    """The three links of Grizzle, Abba and Plestan, with outputs that mix the joints."""
    draw = np.random.default_rng(seed)
    walk = published.three_link_gait()
    state = state_near(walk, draw)
    law = hs.VirtualConstraints(walk, finite_time=0.1, exponent=0.9, outputs=published.OUTPUTS)
    _, acceleration = torque_and_acceleration(walk, law, state)
    y, rate = (published.OUTPUTS @ each for each in errors(walk, state))
    scaled = 0.1 * rate
    surface = y + np.sign(scaled) * np.abs(scaled) ** 1.1 / 1.1
    wanted = -np.sign(scaled) * np.abs(scaled) ** 0.9
    wanted -= np.sign(surface) * np.abs(surface) ** (0.9 / 1.1)
    found = published.OUTPUTS @ output_acceleration(walk, state, acceleration)
    np.testing.assert_allclose(found, wanted / 0.01, atol=1e-7)


def test_the_finite_time_law_comes_to_rest() -> None:
    """A double integrator from (1, 0) is at rest after 20 ε, but for the ripple of the steps."""
    y, rate, h = 1.0, 0.0, 1e-3
    for _ in range(20_000):
        rate += h * finite_time(y, rate, 1.0, 0.5)
        y += h * rate
    assert math.hypot(y, rate) < 1e-5


@pytest.mark.parametrize("seed", range(3))
def test_the_other_foot_has_the_mirrored_law(seed: int) -> None:
    """Torques of the mirrored state, while the other foot stands, are the mirrored torques."""
    state = state_near(gait(), np.random.default_rng(seed))
    robot = gait().robot
    mirror = robot.mirror
    assert mirror is not None
    law = hs.VirtualConstraints(gait())
    torque, _ = torque_and_acceleration(gait(), law, state)
    law.memory["stance"] = 1 - gait().stance_foot
    law.reset()
    image = mirror.state(state)
    contacts = Contacts(
        position=dynamics.contact_positions(robot, image.q),
        normal=np.tile([0.0, 1.0], (2, 1)),
        gap=np.zeros(2),
        force=np.zeros((2, 2)),
    )
    found = law.torque(0.0, image, contacts)
    np.testing.assert_allclose(
        found, mirror.among(robot.model.actuator_joint).velocity(torque), atol=1e-8
    )


def test_series_is_smooth_near_the_ends_and_straight_far_beyond() -> None:
    coefficients = np.random.default_rng(1).normal(size=(7, 1))
    exact = np.polynomial.Chebyshev(coefficients[:, 0])
    for x in (-1.005, -0.3, 0.0, 0.8, 1.0, 1.009):
        value, slope, curvature = series(coefficients, 0, x)
        assert value == pytest.approx(exact(x))
        assert slope == pytest.approx(exact.deriv()(x))
        assert curvature == pytest.approx(exact.deriv(2)(x))
    h = 1e-5
    for x in (-1.6, -1.11, -1.05, -1.01, 1.01, 1.06, 1.11, 1.4):
        (below, low, _), (value, slope, bend), (above, high, _) = (
            series(coefficients, 0, x + d) for d in (-h, 0.0, h)
        )
        assert slope == pytest.approx((above - below) / (2.0 * h), rel=1e-6, abs=1e-3)
        assert bend == pytest.approx((high - low) / (2.0 * h), rel=1e-6, abs=2e-2 * abs(bend) + 1.0)
        assert below - 2.0 * value + above == pytest.approx(bend * h**2, abs=1e-9)
    assert series(coefficients, 0, 1.5)[2] == 0.0
    far, farther = series(coefficients, 0, 2.0), series(coefficients, 0, 3.0)
    assert farther[0] - far[0] == pytest.approx(far[1])


@pytest.mark.parametrize("method", [hs.TimeStepping(step=1e-3), hs.EventDriven(output_period=0.1)])
def test_rabbit_walks(method: hs.TimeStepping | hs.EventDriven) -> None:
    """Twenty steps; under computed torque, which knows the time, it falls after three."""
    zero = hs.zero_dynamics(gait())
    run = hs.simulate(
        gait().robot, hs.VirtualConstraints(gait()), state=zero.initial_state,
        duration=20.5 * zero.period, method=method, ground=hs.Ground(friction=0.75),
    )  # fmt: skip
    assert run.completed, run.message
    walked = run.position[-1, 0] - run.position[0, 0]
    assert walked == pytest.approx(20.5 * zero.step_length, rel=0.03)


def test_speed_comes_back_by_the_factor_of_the_zero_dynamics() -> None:
    """Three per cent too slow at first: θ̇² comes back by δ² a step, exactly, whatever the size."""
    zero = hs.zero_dynamics(gait())
    start = zero.initial_state
    run = hs.simulate(
        gait().robot, hs.VirtualConstraints(gait()), state=hs.State(start.q, 0.97 * start.v),
        duration=4.5 * zero.period, ground=hs.Ground(friction=0.75),
        method=hs.EventDriven(rtol=1e-11, atol=1e-12, output_period=None),
    )  # fmt: skip
    missing = [0.97**2 - 1.0]
    mirror = gait().robot.mirror
    assert mirror is not None
    landed = [event.time for event in run.events if event.kind.name == "TOUCHDOWN"]
    for step, time in enumerate(landed[:4]):
        row = np.flatnonzero(run.time <= time)[-1]
        v = run.velocity[row] if step % 2 else mirror.velocity(run.velocity[row])
        missing.append((gait().phase @ v / zero.rate) ** 2 - 1.0)
    np.testing.assert_allclose(np.divide(missing[1:], missing[:-1]), zero.contraction, atol=1e-6)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"kp": -1.0}, "kp must not be negative"),
        ({"kd": [1.0, 2.0]}, "kd must be one finite number or 4"),
        ({"finite_time": 0.0}, "finite_time must be a positive number"),
        ({"exponent": 1.0}, "between 0 and 1"),
        ({"outputs": np.ones((2, 2))}, r"shape \(4, 4\)"),
        ({"outputs": np.ones((4, 4))}, "singular"),
    ],
)
def test_what_it_refuses(options: dict[str, object], said: str) -> None:
    with pytest.raises(hs.ControllerError, match=said):
        hs.VirtualConstraints(gait(), **options)  # type: ignore[arg-type]


def test_a_robot_on_other_feet_is_refused() -> None:
    """It would be asked for a foot that it has not."""
    build = hs.RobotBuilder("one_legged")
    trunk = build.floating_base("torso", (0.0, 0.8), mass=12.0, inertia=1.0)
    for name in ("a", "b", "c", "d"):
        trunk = build.hinge(name, trunk, at=(0.0, -0.2), mass=1.0, inertia=0.1, torque=10.0)
    build.contact(trunk, (0.0, -0.2))
    robot = build.build()
    with pytest.raises(hs.ControllerError, match="structure differs from that of 'one_legged'"):
        hs.simulate(
            robot, hs.VirtualConstraints(gait()), state=robot.reference_state(), duration=0.01
        )
