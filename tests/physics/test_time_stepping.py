"""Analytic and published results under time stepping."""

from __future__ import annotations

import mechanisms
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.robot import read_mjcf
from heelstrike.sim import EventKind, Scheme

G = 9.81


def body(geom: str, *, hinge: bool = False) -> hs.Robot:
    """Return one free body with the given geom."""
    turn = '<joint name="pitch" type="hinge" axis="0 1 0"/>' if hinge else ""
    return read_mjcf(
        '<mujoco><worldbody><body name="body">'
        '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
        f"{turn}{geom}</body></worldbody></mujoco>",
        name="body",
    )


POINT = '<geom type="sphere" size="0.1" mass="2"/>'
CUBE = '<geom type="box" size="0.05 0.05 0.05" mass="1"/>'
DISC = '<geom type="cylinder" size="0.2 0.05" euler="90 0 0" mass="3"/>'


def drop(scheme: Scheme, step: float, *, restitution: float, duration: float) -> hs.Run:
    return hs.simulate(
        body(POINT),
        state=hs.State(np.array([0.0, 1.1]), np.zeros(2)),
        duration=duration,
        method=hs.TimeStepping(step=step, scheme=scheme),
        ground=hs.Ground(restitution=restitution),
    )


def test_siconos_bouncing_ball() -> None:
    """Siconos' BouncingBallTS tutorial: h = 5 ms, e = 0.9, from 1 m, Moreau-Jean.

    Its first velocity after impact is 3.97305 m/s at t = 0.455 s, to the digits printed: the ball
    falls for 90 steps and bounces with 0.9 g 90 h.
    """
    run = drop(Scheme.MOREAU_JEAN, 5e-3, restitution=0.9, duration=1.0)
    first = int(np.flatnonzero(run.velocity[:, 1] > 0.0)[0])
    assert run.time[first] == pytest.approx(0.455, abs=1e-12)
    assert run.velocity[first, 1] == pytest.approx(3.97305, abs=5e-6)


def test_bounces_converge_to_e_squared_at_first_order() -> None:
    """The second apex of a point dropped from 1 m with e = 0.5 is at e² = 0.25 m."""
    errors = []
    for step in (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4):
        run = drop(Scheme.MOREAU_JEAN, step, restitution=0.5, duration=0.9)
        landed = run.time > 0.5
        errors.append(abs(run.gap[landed, 0].max() - 0.25))
    # Where in a step the impact falls makes single errors jump: fit the slope through all.
    slope = np.polyfit(np.log([4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4]), np.log(errors), 1)[0]
    assert slope >= 0.9, errors


def sprung(*, stiffness: float, damping: float) -> hs.Robot:
    """A mass of 2 kg on a rail, held by a spring and a damper."""
    builder = hs.RobotBuilder("sprung", gravity=G)
    builder.slide("x", None, direction=(1, 0), mass=2.0, stiffness=stiffness, damping=damping)
    return builder.build()


def test_spring_keeps_its_energy_under_moreau_jean() -> None:
    """Ten periods at h ω = 0.063: the work of a spring in a step is that of its mean length.

    With forces of the beginning it would gain (ω h)²/2 a step, 22 % in a period.
    """
    omega, mass = 2.0 * np.pi, 2.0
    run = hs.simulate(
        sprung(stiffness=mass * omega**2, damping=0.0),
        state=hs.State(np.array([0.1]), np.zeros(1)),
        duration=10.0,
        method=hs.TimeStepping(step=1e-2, scheme=Scheme.MOREAU_JEAN),
    )
    energy = 0.5 * mass * (run.velocity[:, 0] ** 2 + (omega * run.position[:, 0]) ** 2)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-11)
    # The period is longer by (ω h)²/12: tan(ω' h/2) = ω h/2.
    slower = 2.0 * np.arctan(0.5 * omega * 1e-2) / 1e-2
    np.testing.assert_allclose(run.position[:, 0], 0.1 * np.cos(slower * run.time), atol=1e-11)


def test_damper_under_moreau_jean_has_second_order() -> None:
    """A speed falls by (1 − θ h d/m) / (1 + θ h d/m), θ = 1/2, in every step."""
    run = hs.simulate(
        sprung(stiffness=0.0, damping=3.0),
        state=hs.State(np.zeros(1), np.ones(1)),
        duration=1.0,
        method=hs.TimeStepping(step=1e-2, scheme=Scheme.MOREAU_JEAN),
    )
    factor = (1.0 - 0.0075) / (1.0 + 0.0075)
    np.testing.assert_allclose(run.velocity[:, 0], factor ** np.arange(101), rtol=1e-12)


def slide(mu: float, angle: float, *, step: float = 1e-3, duration: float = 1.0) -> hs.Run:
    """Return a cube that starts at rest, flat on a slope."""
    normal = np.array([-np.sin(angle), np.cos(angle)])
    # A positive pitch leans forward, down a slope that climbs along +x it is negative.
    state = hs.State(np.array([*(0.05 * normal), -angle]), np.zeros(3))
    return hs.simulate(
        body(CUBE, hinge=True),
        state=state,
        duration=duration,
        method=hs.TimeStepping(step=step),
        ground=hs.Ground(friction=mu, slope=angle),
    )


@pytest.mark.parametrize("angle", [0.1, 0.5])
def test_cube_on_a_slope_sticks_just_above_the_critical_friction(angle: float) -> None:
    run = slide(np.tan(angle) + 1e-2, angle)
    assert np.abs(run.velocity).max() <= 1e-12


@pytest.mark.parametrize("angle", [0.1, 0.5])
def test_cube_on_a_slope_slides_just_below_the_critical_friction(angle: float) -> None:
    """It accelerates by g (sin θ − μ cos θ), which Euler steps reproduce exactly."""
    mu = np.tan(angle) - 1e-2
    run = slide(mu, angle)
    speed = np.hypot(*run.velocity[-1, :2])
    assert speed == pytest.approx(G * (np.sin(angle) - mu * np.cos(angle)), rel=1e-9)


def test_sliding_stop() -> None:
    """From 2 m/s with μ = 0.5 a body slides v²/(2 μ g) = 0.407747 m; first order in h."""
    exact = 2.0**2 / (2.0 * 0.5 * G)
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        run = hs.simulate(
            body(CUBE, hinge=True),
            state=hs.State(np.array([0.0, 0.05, 0.0]), np.array([2.0, 0.0, 0.0])),
            duration=0.6,
            method=hs.TimeStepping(step=step),
            ground=hs.Ground(friction=0.5),
        )
        errors.append(abs(run.position[-1, 0] - exact))
        # It slides without lifting or tilting, and then stays.
        assert np.abs(run.gap[:, :].min(axis=1)).max() <= 1e-9
        assert np.abs(run.velocity[-1]).max() <= 1e-12
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 0.9), errors


def test_cube_launched_flat_never_lifts() -> None:
    """6 m/s, μ = 0.5: the friction's moment is less than the weight's, so no corner lifts."""
    run = hs.simulate(
        body(CUBE, hinge=True),
        state=hs.State(np.array([0.0, 0.05, 0.0]), np.array([6.0, 0.0, 0.0])),
        duration=2.0,
        method=hs.TimeStepping(step=1e-3),
        ground=hs.Ground(friction=0.5),
    )
    assert np.abs(run.gap).max() <= 1e-9
    assert run.position[-1, 0] == pytest.approx(6.0**2 / (2 * 0.5 * G), abs=6.0 * 1e-3)


def test_disc_rolls_down_a_slope() -> None:
    """No slip below tan θ = 3 μ: acceleration ⅔ g sin θ for a solid disc (I = ½ m r²)."""
    angle, radius = 0.2, 0.2
    normal = np.array([-np.sin(angle), np.cos(angle)])
    run = hs.simulate(
        body(DISC, hinge=True),
        state=hs.State(np.array([*(radius * normal), 0.0]), np.zeros(3)),
        duration=1.0,
        method=hs.TimeStepping(step=1e-3),
        ground=hs.Ground(friction=0.5, slope=angle),
    )
    acceleration = G * np.sin(angle) / 1.5
    assert np.hypot(*run.velocity[-1, :2]) == pytest.approx(acceleration, rel=1e-9)
    assert abs(run.velocity[-1, 2]) == pytest.approx(acceleration / radius, rel=1e-9)
    # Friction along the slope: ⅓ m g sin θ, uphill.
    force = run.contact_force[500].sum(axis=0)
    assert abs(force[1]) == pytest.approx(3.0 * G * np.sin(angle) / 3.0, rel=1e-6)


STEPS = np.array([2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4])


def order(errors: list[float]) -> float:
    """Slope of the errors at `STEPS`: where in a step an impact falls makes single ones jump."""
    return float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


def touchdowns(run: hs.Run) -> list[float]:
    return [event.time for event in run.events if event.kind is EventKind.TOUCHDOWN]


def test_bounces_end_at_their_limit_at_first_order() -> None:
    """A point from 1 m with e = 0.5 rests from 1.35457092 s on."""
    errors = []
    for step in STEPS:
        run = drop(Scheme.MOREAU_JEAN, step, restitution=0.5, duration=1.6)
        moving = np.flatnonzero(np.abs(run.velocity[:, 1]) > 1e-9)
        errors.append(abs(run.time[moving[-1]] - 1.35457092))
        assert abs(run.velocity[-1, 1]) <= 1e-12
    assert order(errors) >= 0.9, errors


def test_sliding_disc_comes_to_roll_at_first_order() -> None:
    """From v without spin it slides for v / (3 μ g), then rolls on at 2 v / 3.

    Steps are such that sliding ends in the middle of one.
    """
    speed, mu = 3.0, 0.2
    end = speed / (3.0 * mu * G)
    errors, steps = [], []
    for count in (250, 500, 1000, 2000):
        step = end / (count + 0.5)
        run = hs.simulate(
            mechanisms.disc(0.2),
            state=hs.State(np.array([0.0, 0.2, 0.0]), np.array([speed, 0.0, 0.0])),
            duration=(2 * count + 1) * step,
            method=hs.TimeStepping(step=step),
            ground=hs.Ground(friction=mu),
        )
        exact = (speed - 0.5 * mu * G * end) * end + 2.0 / 3.0 * speed * end
        errors.append(abs(run.position[-1, 0] - exact))
        steps.append(step)
        np.testing.assert_allclose(run.velocity[-1], [2.0, 0.0, 10.0], atol=1e-9)
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] >= 0.9, errors


def test_rimless_wheel_at_first_order() -> None:
    """Speed after the third impact of a wheel that starts on its limit cycle."""
    inertia, slope, spoke = 0.1, 0.08, np.pi / 8.0
    kept = (inertia + np.cos(2.0 * spoke)) / (inertia + 1.0)
    gain = 4.0 * G * np.sin(spoke) * np.sin(slope) / (inertia + 1.0)
    speed = kept * np.sqrt(gain / (1.0 - kept**2))
    hub = np.cos(spoke) * np.array([np.sin(slope), np.cos(slope)])
    arm = np.array([-np.sin(spoke - slope), np.cos(spoke - slope)])
    start = hs.State(np.array([*hub, slope]), np.array([speed * arm[1], -speed * arm[0], speed]))
    errors = []
    for step in STEPS:
        run = hs.simulate(
            mechanisms.rimless_wheel(inertia=inertia),
            state=start,
            duration=3.5,
            method=hs.TimeStepping(step=step),
            ground=hs.Ground(friction=3.0, slope=-slope),
            stop_when_fallen=False,
        )
        after = int(np.searchsorted(run.time, touchdowns(run)[2] + 1e-9)) + 1
        errors.append(abs(run.velocity[after, 2] - speed))
    assert order(errors) >= 0.9, errors


def test_rocking_block_at_first_order() -> None:
    """An impact leaves 1 - (3/2) sin² α of the angular speed (Housner 1963)."""
    width, height = 0.2, 1.0
    angle = np.arctan(width / height)
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
    corner = 0.5 * np.array([c * width - s * height, -s * width - c * height])
    start = np.array([0.5 * width - corner[0], -corner[1], 0.5 * angle])
    errors = []
    for step in STEPS:
        run = hs.simulate(
            mechanisms.block(width, height),
            state=hs.State(start, np.zeros(3)),
            duration=0.5,
            method=hs.TimeStepping(step=step),
            ground=hs.Ground(friction=5.0),
            stop_when_fallen=False,
        )
        impact = int(np.searchsorted(run.time, touchdowns(run)[0] - 1e-9))
        ratio = run.velocity[impact + 2, 2] / run.velocity[impact - 2, 2]
        errors.append(abs(ratio - (1.0 - 1.5 * np.sin(angle) ** 2)))
    assert order(errors) >= 0.9, errors


def test_painleve_rod_is_stopped_by_an_impulse() -> None:
    """Beyond μ = 5/3 at 45° no force will do; the first step's impulse stops the sliding end."""
    pitch = 0.25 * np.pi
    a, b = 0.5 * np.sin(pitch), 0.5 * np.cos(pitch)
    inverse_mass = np.diag([1.0, 1.0, 12.0])
    rows = np.array([[0.0, 1.0, a], [1.0, 0.0, -b]])
    impulse = np.linalg.solve(rows @ inverse_mass @ rows.T, [0.0, 1.0])
    before = np.array([-1.0, 0.0, 0.0])
    exact = before + inverse_mass @ rows.T @ impulse
    errors = []
    for step in STEPS:
        run = hs.simulate(
            mechanisms.rod(),
            state=hs.State(np.array([a, b, pitch]), before),
            duration=10.0 * step,
            method=hs.TimeStepping(step=step),
            ground=hs.Ground(friction=5.0 / 3.0 + 1e-2),
        )
        assert run.completed
        assert run.solver.failures == 0
        errors.append(np.abs(run.velocity[1] - exact).max())
    assert order(errors) >= 0.9, errors


PENDULUM = """
<mujoco><worldbody><body name="arm" pos="0 0 2">
  <joint name="swing" type="hinge" axis="0 1 0" range="{low} {high}" {more}/>
  <geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02" mass="1" contype="0" conaffinity="0"/>
</body></worldbody></mujoco>
"""


def test_a_joint_stop_holds_and_never_pulls() -> None:
    """A pendulum let go against its stop comes to rest on it, held by the moment of gravity."""
    robot = read_mjcf(PENDULUM.format(low=-90, high=30, more=""), name="pendulum")
    run = hs.simulate(robot, state=hs.State(np.array([1.2]) - 0.9, np.array([4.0])), duration=3.0)
    stop = np.deg2rad(30.0)
    assert run.position.max() <= stop + 1e-9
    pushed = run.stop_torque[:, 0]
    assert np.all(pushed <= 0.0)  # the upper end pushes down only
    stops = [event for event in run.events if event.kind is EventKind.JOINT_STOP]
    assert stops
    # The first hit is plastic: the pendulum loses all its speed there.
    first = int(np.searchsorted(run.time, stops[0].time + 1e-9))
    assert abs(run.velocity[first, 0]) <= 1e-9 or run.velocity[first, 0] < 0.0
    assert run.certificates.complementarity <= 1e-9


def test_linearly_implicit_steps_survive_springs_that_euler_does_not() -> None:
    """A joint spring of frequency ω is stable for any h; semi-implicit Euler needs h ω < 2."""
    stiff = PENDULUM.format(low=-90, high=90, more='stiffness="1e7" damping="1"')
    robot = read_mjcf(stiff, name="pendulum")
    state = hs.State(np.array([0.1]), np.zeros(1))

    def run(scheme: Scheme) -> hs.Run:
        return hs.simulate(
            robot, state=state, duration=0.5, method=hs.TimeStepping(step=1e-3, scheme=scheme)
        )

    implicit = run(Scheme.LINEARLY_IMPLICIT)
    assert implicit.completed
    assert np.abs(implicit.position[-100:]).max() < 1e-3
    with pytest.warns(hs.SimulationWarning, match="'swing' is too stiff for a step of 0.001 s"):
        euler = run(Scheme.GAP_LINEARISED)
    assert not euler.completed or np.abs(euler.position).max() > 0.5


def test_linearly_implicit_is_first_order() -> None:
    """Damped oscillator under gravity against the exact solution of its linear equation."""
    robot = read_mjcf(
        '<mujoco><worldbody><body name="mass"><joint name="z" type="slide" axis="0 0 1" '
        'stiffness="200" damping="4"/><geom type="sphere" size="0.1" mass="2" contype="0" '
        'conaffinity="0"/></body></worldbody></mujoco>',
        name="oscillator",
    )
    rest = -2.0 * G / 200.0
    decay, frequency = 1.0, np.sqrt(100.0 - 1.0)
    start, t = 0.05, 0.7
    amplitude = start - rest
    exact = rest + amplitude * np.exp(-decay * t) * (
        np.cos(frequency * t) + decay / frequency * np.sin(frequency * t)
    )
    errors = [
        abs(
            hs.simulate(
                robot,
                state=hs.State(np.array([start]), np.zeros(1)),
                duration=t,
                method=hs.TimeStepping(step=step, scheme=Scheme.LINEARLY_IMPLICIT),
            ).position[-1, 0]
            - exact
        )
        for step in (2e-3, 1e-3, 5e-4)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 1.0) < 0.15), errors
