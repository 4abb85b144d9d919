"""Joint stops: plastic impacts at the end of a joint's range, forces there, release.

Event-driven figures hold to 1e-8, the relative tolerance of the integration, unless a test says
otherwise; time stepping converges to them at first order.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

import heelstrike as hs
from heelstrike.robot import read_mjcf
from heelstrike.sim import Event, EventKind

Floats = NDArray[np.float64]

G = 9.81
LEVER = 0.5  # from the hinge to the centre of mass, m
INERTIA = 0.02 + LEVER**2  # about the hinge, for 1 kg
MOMENT = G * LEVER
TIGHT = hs.EventDriven(rtol=1e-10, atol=1e-12)


def pendulum(low: float, high: float) -> hs.Robot:
    """Pendulum of 1 kg, hanging down at 0 rad, with stops at two angles in degrees."""
    return read_mjcf(
        f"""<mujoco><worldbody><body name="arm" pos="0 0 2">
          <joint name="swing" type="hinge" axis="0 1 0" range="{low} {high}"/>
          <inertial pos="0 0 {-LEVER}" mass="1" diaginertia="0.02 0.02 0.02"/>
        </body></worldbody></mujoco>""",
        name="pendulum",
    )


def swing(
    robot: hs.Robot, angle: float, speed: float, duration: float, method: object = TIGHT
) -> hs.Run:
    run = hs.simulate(
        robot,
        state=hs.State(np.array([angle]), np.array([speed])),
        duration=duration,
        method=method,  # type: ignore[arg-type]
    )
    assert run.completed, run.message
    assert run.certificates.complementarity <= 1e-9
    return run


def speed_at(angle: float, begin: float, speed: float) -> float:
    """Angular speed from the conservation of energy."""
    return float(np.sqrt(speed**2 + 2.0 * MOMENT / INERTIA * (np.cos(angle) - np.cos(begin))))


def stops(run: hs.Run) -> list[Event]:
    return [event for event in run.events if event.kind is EventKind.JOINT_STOP]


def test_a_pendulum_falls_onto_its_stop_and_stays() -> None:
    """From rest at 60° onto the stop at 10°: time, impulse I ω, then the torque m g l sin 10°."""
    begin, end = np.deg2rad(60.0), np.deg2rad(10.0)
    run = swing(pendulum(10.0, 90.0), begin, 0.0, 1.0)
    # The integrand is singular at the beginning: with θ = θ0 - s² it is smooth.
    time, _ = quad(
        lambda s: 2.0 * s / speed_at(begin - s**2, begin, 0.0) if s > 0.0 else
        2.0 / np.sqrt(2.0 * MOMENT / INERTIA * np.sin(begin)),
        0.0, np.sqrt(begin - end), epsabs=1e-13, epsrel=1e-13,
    )  # fmt: skip
    (hit,) = stops(run)
    assert hit.contact == 0
    assert hit.time == pytest.approx(time, abs=1e-8)
    assert hit.impulse == (pytest.approx(INERTIA * speed_at(end, begin, 0.0), abs=1e-8), 0.0)
    resting = run.time > hit.time
    np.testing.assert_allclose(run.position[resting, 0], end, atol=1e-12)
    assert np.abs(run.velocity[resting]).max() <= 1e-12
    np.testing.assert_allclose(run.stop_torque[resting, 0], MOMENT * np.sin(end), rtol=1e-12)
    falling = run.time < hit.time
    assert np.all(run.stop_torque[falling] == 0.0)


def bounce_off(duration: float, method: object = TIGHT) -> hs.Run:
    """Swing up into the stop at 30°."""
    return swing(pendulum(-90.0, 30.0), 0.0, 4.0, duration, method)


def test_a_pendulum_swings_back_from_a_stop_without_speed() -> None:
    """The stop takes all of the speed; gravity then takes the pendulum away from it at once."""
    run = bounce_off(2.0)
    end = np.deg2rad(30.0)
    (hit, *more) = stops(run)
    assert hit.impulse[0] == pytest.approx(INERTIA * speed_at(end, 0.0, 4.0), abs=1e-8)
    assert run.position.max() <= end + 1e-10
    # From then on it has the energy of the stop, and returns to it with no speed to speak of.
    after = run.time > hit.time
    energy = 0.5 * INERTIA * run.velocity[after, 0] ** 2 - MOMENT * np.cos(run.position[after, 0])
    np.testing.assert_allclose(energy, -MOMENT * np.cos(end), atol=1e-8)
    assert all(event.impulse[0] <= 1e-4 for event in more)
    assert np.all(run.stop_torque[after] <= 0.0)


def test_time_stepping_converges_to_the_stop_at_first_order() -> None:
    exact = bounce_off(0.8).position[-1, 0]
    step = np.array([4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4])
    errors = [abs(bounce_off(0.8, hs.TimeStepping(step=h)).position[-1, 0] - exact) for h in step]
    # Where in a step the impact falls makes single errors jump: fit the order through all.
    assert np.polyfit(np.log(step), np.log(errors), 1)[0] >= 0.9, errors


@hs.controller
def growing(t: float, torque: Floats) -> None:
    """Exert a force that grows by 1 N/s from -1 N."""
    torque[0] = t - 1.0


def test_a_stop_lets_go_when_its_force_vanishes() -> None:
    """2 kg held at a stop by t - 1 N leave it at 1 s: x = (t - 1)³ / 12."""
    robot = read_mjcf(
        """<mujoco><option gravity="0 0 0"/><worldbody><body name="sled">
          <joint name="x" type="slide" axis="1 0 0" range="0 5" limited="true"/>
          <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
        </body></worldbody><actuator><motor joint="x"/></actuator></mujoco>""",
        name="sled",
    )
    run = hs.simulate(
        robot,
        growing(),
        state=hs.State(np.zeros(1), np.zeros(1)),
        duration=2.0,
        method=TIGHT,
    )
    held = run.time <= 1.0
    np.testing.assert_allclose(run.position[held, 0], 0.0, atol=1e-15)  # rounding of the force
    np.testing.assert_allclose(run.stop_torque[held, 0], 1.0 - run.time[held], atol=1e-9)
    # Found where the force is below zero by 1e-10 of the weight: x is then off by far less.
    np.testing.assert_allclose(
        run.position[~held, 0], (run.time[~held] - 1.0) ** 3 / 12.0, atol=1e-9
    )
    assert not stops(run)  # it began there


def telescope() -> hs.Robot:
    """Foot of 1 kg below a body of 3 kg, which may slide 0 to 0.5 m up from it."""
    return read_mjcf(
        """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="foot">
          <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
          <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
          <geom type="sphere" size="1e-12"/>
          <body name="body"><joint name="length" type="slide" axis="0 0 1" range="0 0.5"
            limited="true"/><inertial pos="0 0 1" mass="3" diaginertia="1 1 1"/></body>
        </body></worldbody></mujoco>""",
        name="telescope",
    )


def test_an_impact_goes_through_a_closed_stop() -> None:
    """Dropped with its body on the stop, the telescope lands as one: 4 v at the foot, 3 v above."""
    run = hs.simulate(
        telescope(),
        state=hs.State(np.array([0.0, 0.2, 0.0]), np.zeros(3)),
        duration=1.0,
        method=TIGHT,
        stop_when_fallen=False,
    )
    assert run.completed, run.message
    speed = np.sqrt(2.0 * G * 0.2)
    (landing,) = [event for event in run.events if event.kind is EventKind.TOUCHDOWN]
    (pressed,) = stops(run)
    assert landing.time == pressed.time == pytest.approx(speed / G, abs=1e-12)
    assert landing.impulse[0] == pytest.approx(4.0 * speed, rel=1e-10)
    assert pressed.contact == 2
    assert pressed.impulse[0] == pytest.approx(3.0 * speed, rel=1e-10)
    assert run.contact_force[-1, 0, 0] == pytest.approx(4.0 * G, rel=1e-10)
    assert run.stop_torque[-1, 2] == pytest.approx(3.0 * G, rel=1e-10)
    assert np.abs(run.velocity[-1]).max() <= 1e-12


def test_an_impact_at_a_stop_lifts_the_foot() -> None:
    """The body flies up to the upper stop and takes the resting foot along: 3 v / 4."""
    run = hs.simulate(
        telescope(),
        state=hs.State(np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, 5.0])),
        duration=0.3,
        method=TIGHT,
        stop_when_fallen=False,
    )
    (hit,) = stops(run)
    speed = np.sqrt(25.0 - 2.0 * G * 0.5)
    assert hit.time == pytest.approx((5.0 - speed) / G, abs=1e-10)
    row = np.flatnonzero(np.abs(run.time - hit.time) < 1e-11)[-1]
    np.testing.assert_allclose(run.velocity[row], [0.0, 0.75 * speed, 0.0], atol=1e-9)
    assert [e.kind for e in run.events] == [EventKind.JOINT_STOP, EventKind.LIFTOFF]


@pytest.mark.parametrize("method", [hs.EventDriven(), hs.TimeStepping()])
def test_what_rests_at_the_beginning_makes_no_event(method: object) -> None:
    """Neither a foot that stands nor a joint at its stop; a foot that comes down does."""
    resting = hs.State(np.zeros(3), np.zeros(3))
    falling = hs.State(np.zeros(3), np.array([0.0, -1.0, 0.0]))
    still, landing = (
        hs.simulate(
            telescope(),
            state=state,
            duration=0.05,
            method=method,  # type: ignore[arg-type]
            stop_when_fallen=False,
        )
        for state in (resting, falling)
    )
    assert still.events == ()
    assert still.contact_force[-1, 0, 0] == pytest.approx(4.0 * G, rel=1e-9)
    assert landing.events[0].kind is EventKind.TOUCHDOWN
    assert landing.events[0].impulse[0] == pytest.approx(4.0, rel=2e-2)


def test_a_joint_that_begins_beyond_its_stop_is_refused() -> None:
    with pytest.raises(hs.SimulationError, match="joint 'swing' begins at 1, beyond its range"):
        swing(pendulum(-30.0, 30.0), 1.0, 0.0, 0.1)
