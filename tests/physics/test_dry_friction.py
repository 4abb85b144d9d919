"""Dry friction of joints: Coulomb's law with a known normal force, under every simulation method.

Event-driven figures hold to 1e-8, the relative tolerance of the integration, unless a test says
otherwise; time stepping converges to them at first order; on compliant ground the friction is
smoothed, and what should rest creeps at 1e-4 rad/s at most.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq, linprog

import heelstrike as hs
from heelstrike.analysis.energy import energy_balance
from heelstrike.dynamics import bias_force, contact_positions, point_jacobian
from heelstrike.robot import read_mjcf
from heelstrike.sim import Event, EventKind, Scheme

Floats = NDArray[np.float64]

G = 9.81
MASS = 2.0  # of the sled, kg
FRICTION = 3.0  # N
SPEED = 2.0  # m/s
STOP_TIME = MASS * SPEED / FRICTION
STOP_PLACE = MASS * SPEED**2 / (2.0 * FRICTION)

EXACT = hs.EventDriven(rtol=1e-10, atol=1e-12)
METHODS = (EXACT, hs.TimeStepping(step=1e-3), hs.Compliant())


def sled(stiffness: float = 0.0, friction: float = FRICTION, mass: float = MASS) -> hs.Robot:
    """Mass on a dry slide, without gravity, perhaps on a spring; a motor pushes it."""
    return read_mjcf(
        f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="sled">
          <joint name="x" type="slide" axis="1 0 0" frictionloss="{friction}"
            stiffness="{stiffness}"/>
          <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
        </body></worldbody><actuator><motor joint="x"/></actuator></mujoco>""",
        name="sled",
    )


def slide(
    robot: hs.Robot,
    place: float,
    speed: float,
    duration: float,
    method: object,
    controller: hs.control.Law | None = None,
) -> hs.Run:
    run = hs.simulate(
        robot,
        controller,
        state=hs.State(np.array([place]), np.array([speed])),
        duration=duration,
        method=method,  # type: ignore[arg-type]
    )
    assert run.completed, run.message
    assert max(dataclasses.astuple(run.certificates)[1:]) <= 1e-9
    return run


def joint_events(run: hs.Run) -> list[tuple[EventKind, float]]:
    kinds = (EventKind.JOINT_SLIP, EventKind.JOINT_STICK)
    return [(event.kind, event.time) for event in run.events if event.kind in kinds]


def test_a_sled_comes_to_rest() -> None:
    """m v / F = 4/3 s and m v² / 2F = 4/3 m; then it stays."""
    run = slide(sled(), 0.0, SPEED, 2.0, EXACT)
    ((kind, time),) = joint_events(run)
    assert kind is EventKind.JOINT_STICK
    assert time == pytest.approx(STOP_TIME, abs=1e-8)
    resting = run.time >= time
    np.testing.assert_allclose(run.position[resting, 0], STOP_PLACE, atol=1e-8)
    assert np.abs(run.velocity[resting]).max() <= 1e-12
    np.testing.assert_array_equal(run.friction_torque[~resting, 0], -FRICTION)
    np.testing.assert_allclose(run.friction_torque[resting, 0], 0.0, atol=1e-12)


@pytest.mark.parametrize("scheme", list(Scheme))
def test_time_stepping_converges_to_the_stop_at_first_order(scheme: Scheme) -> None:
    step = np.array([8e-3, 4e-3, 2e-3, 1e-3])
    runs = [slide(sled(), 0.0, SPEED, 1.6, hs.TimeStepping(step=h, scheme=scheme)) for h in step]
    errors = [abs(run.position[-1, 0] - STOP_PLACE) for run in runs]
    if scheme is Scheme.MOREAU_JEAN:
        # The mean velocity moves the position: exact but for the step in which it comes to rest.
        assert np.all(errors <= FRICTION / MASS * step**2), errors
    else:
        assert np.polyfit(np.log(step), np.log(errors), 1)[0] >= 0.9, errors
    for run, h in zip(runs, step, strict=True):
        ((kind, time),) = joint_events(run)
        assert kind is EventKind.JOINT_STICK
        assert time == pytest.approx(STOP_TIME, abs=1.5 * h)
        assert np.abs(run.velocity[run.time >= time]).max() <= 1e-12


def test_smoothed_friction_stops_it_nearly() -> None:
    """Smoothing over v_s prolongs the way by about m v_s² / F = 1e-8 m: below the tolerance."""
    run = slide(sled(), 0.0, SPEED, 1.6, hs.Compliant(rtol=1e-7, atol=1e-9))
    assert run.position[-1, 0] == pytest.approx(STOP_PLACE, abs=1e-5)
    assert abs(run.velocity[-1, 0]) <= 1e-6


def pendulum(friction: float) -> hs.Robot:
    """Pendulum of 1 kg, 0.5 m below its hinge."""
    return read_mjcf(
        f"""<mujoco><worldbody><body name="arm" pos="0 0 2">
          <joint name="swing" type="hinge" axis="0 1 0" frictionloss="{friction}"/>
          <inertial pos="0 0 -0.5" mass="1" diaginertia="0.02 0.02 0.02"/>
        </body></worldbody></mujoco>""",
        name="pendulum",
    )


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_pendulum_is_held_up_to_the_breakaway_torque(method: object) -> None:
    """m g l sin θ against τ_c, one per cent below and above."""
    angle = 0.7
    weight = G * 0.5 * np.sin(angle)
    held = slide(pendulum(1.01 * weight), angle, 0.0, 1.0, method)
    # Smoothed friction that is used to r = 1/1.01 creeps at v_s r / √(1 − r²) = 7 v_s.
    creep = 8e-4 if isinstance(method, hs.Compliant) else 1e-12
    assert np.abs(held.velocity).max() <= creep
    np.testing.assert_allclose(held.position[:, 0], angle, atol=creep)
    # Smoothed friction takes some milliseconds to get there: at rest it has no force.
    np.testing.assert_allclose(held.friction_torque[held.time >= 0.02, 0], weight, rtol=1e-3)
    assert not joint_events(held)

    # Released, it comes to rest where gravity's work is that of friction, and stays there.
    friction = 0.99 * weight
    rest = brentq(
        lambda x: G * 0.5 * (np.cos(x) - np.cos(angle)) - friction * (angle - x), 0.0, angle - 1e-3
    )
    run = slide(pendulum(friction), angle, 0.0, 1.0, method)
    error = {"EventDriven": 1e-8, "TimeStepping": 1e-4, "Compliant": 1e-3}[type(method).__name__]
    assert run.position[-1, 0] == pytest.approx(rest, abs=error)
    assert angle - rest > 0.01


@hs.controller
def growing(t: float, torque: Floats) -> None:
    """Push with a force that grows by 1 N/s."""
    torque[0] = t


@pytest.mark.parametrize("method", METHODS[:2], ids=lambda method: type(method).__name__)
def test_a_growing_force_breaks_it_away(method: object) -> None:
    """At t = F; from then on x = (t − F)³ / 6 m."""
    controller = growing()
    run = slide(sled(friction=0.5), 0.0, 0.0, 1.0, method, controller)
    ((kind, time),) = joint_events(run)
    assert kind is EventKind.JOINT_SLIP
    exact = isinstance(method, hs.EventDriven)
    # The instant at which the force is beyond its limit by 1e-10 of the mass; or, in time stepping,
    # when (t − F)² / 2 m exceeds 1e-6 m/s, after 2 ms, and the step in which it does is over.
    assert time == pytest.approx(0.5, abs=1e-9 if exact else 4e-3)
    held = run.time < 0.5 - 1e-9
    np.testing.assert_allclose(run.position[held, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(run.friction_torque[held, 0], -run.time[held], atol=2e-3)
    assert run.position[-1, 0] == pytest.approx(0.5**3 / 12.0, abs=1e-8 if exact else 1e-4)


OSCILLATOR = {"stiffness": 100.0, "friction": 10.0, "mass": 1.0}
FIRST, LAST = 1.03, -0.03


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_an_oscillation_dies_by_equal_steps(method: object) -> None:
    """The amplitude falls by 4 F / k a period: 1.03, -0.83, 0.63, -0.43, 0.23, -0.03, and rests.

    Between turns the spring swings about ± F / k, for half a period π / ω each. There it stays,
    since k · 0.03 is less than F.
    """
    run = slide(sled(**OSCILLATOR), FIRST, 0.0, 2.0, method)
    error = {"EventDriven": 1e-8, "TimeStepping": 0.03, "Compliant": 1e-3}[type(method).__name__]
    half = np.pi / 10.0
    turns = [np.interp(k * half, run.time, run.position[:, 0]) for k in range(6)]
    # Rows are 1 ms apart, next to a turning point that is quadratic: ω² A dt² / 8.
    np.testing.assert_allclose(turns, [1.03, -0.83, 0.63, -0.43, 0.23, LAST], atol=error + 1.3e-5)
    if isinstance(method, hs.Compliant):
        return
    assert run.position[-1, 0] == pytest.approx(LAST, abs=error)
    assert abs(run.velocity[-1, 0]) <= 1e-12
    assert run.friction_torque[-1, 0] == pytest.approx(100.0 * run.position[-1, 0], abs=1e-9)
    if isinstance(method, hs.EventDriven):
        kinds, times = zip(*joint_events(run), strict=True)
        assert kinds == (EventKind.JOINT_SLIP,) * 5 + (EventKind.JOINT_STICK,)
        np.testing.assert_allclose(times, half * np.arange(6), atol=1e-8)


def test_the_oscillation_converges_at_first_order() -> None:
    step = np.array([2e-3, 1e-3, 5e-4, 2.5e-4])
    errors = []
    for h in step:
        run = slide(sled(**OSCILLATOR), FIRST, 0.0, 2.0, hs.TimeStepping(step=h))
        errors.append(abs(run.position[-1, 0] - LAST))
    assert np.polyfit(np.log(step), np.log(errors), 1)[0] >= 0.9, errors


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_its_work_is_in_the_energy_balance(method: object) -> None:
    """All of m v² / 2 = 4 J goes into friction.

    Time stepping balances to rounding. The others sum the power at 1 ms: exact where it is linear,
    and wrong by F² dt² / 4 m = 1e-6 J in the interval in which it vanishes.
    """
    run = slide(sled(), 0.0, SPEED, 1.6, method)
    balance = energy_balance(run)
    tolerance = {"EventDriven": 2e-6, "TimeStepping": 1e-12, "Compliant": 1e-4}
    assert balance.dry_friction[-1] == pytest.approx(-4.0, abs=tolerance[type(method).__name__])
    np.testing.assert_allclose(balance.residual, 0.0, atol=tolerance[type(method).__name__])
    assert np.all(np.diff(balance.dry_friction) <= 1e-12)


def telescope(friction: float) -> hs.Robot:
    """Foot of 1 kg below a body of 3 kg on a dry slide of 0 to 0.5 m."""
    return read_mjcf(
        f"""<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="foot">
          <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
          <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
          <geom type="sphere" size="1e-12"/>
          <body name="body"><joint name="length" type="slide" axis="0 0 1" range="0 0.5"
            limited="true" frictionloss="{friction}"/>
            <inertial pos="0 0 1" mass="3" diaginertia="1 1 1"/></body>
        </body></worldbody></mujoco>""",
        name="telescope",
    )


def landings(run: hs.Run) -> list[Event]:
    return [event for event in run.events if event.kind is EventKind.TOUCHDOWN]


def test_friction_transmits_no_impulse() -> None:
    """Dropped, the foot of 1 kg lands alone; friction then brings the 3 kg above it to rest.

    They fall together without force in the joint. Landing at v they part, for a finite force has no
    impulse; the body sinks by v² / 2a with a = F / m − g, on a foot that carries F and itself.
    """
    friction, height, length = 50.0, 0.2, 0.45
    run = hs.simulate(
        telescope(friction),
        state=hs.State(np.array([0.0, height, length]), np.zeros(3)),
        duration=1.0,
        method=EXACT,
        stop_when_fallen=False,
    )
    assert run.completed, run.message
    speed = np.sqrt(2.0 * G * height)
    braking = friction / 3.0 - G
    (landing,) = landings(run)
    assert landing.time == pytest.approx(speed / G, abs=1e-10)
    assert landing.impulse[0] == pytest.approx(speed, rel=1e-10)
    (broke, slip), (kind, stop) = joint_events(run)
    assert (broke, kind) == (EventKind.JOINT_SLIP, EventKind.JOINT_STICK)
    assert slip == landing.time
    assert stop == pytest.approx(speed / G + speed / braking, abs=1e-8)
    sinking = (run.time > landing.time) & (run.time < stop)
    np.testing.assert_allclose(run.contact_force[sinking, 0, 0], G + friction, rtol=1e-10)
    assert run.position[-1, 2] == pytest.approx(length - speed**2 / (2.0 * braking), abs=1e-8)
    assert run.contact_force[-1, 0, 0] == pytest.approx(4.0 * G, rel=1e-10)
    assert run.friction_torque[-1, 2] == pytest.approx(3.0 * G, rel=1e-10)


def test_stops_and_friction_share_a_joint() -> None:
    """With less friction than weight the body slides to its lower stop; both then carry it."""
    friction = 20.0
    for method in (EXACT, hs.TimeStepping(step=1e-3)):
        run = hs.simulate(
            telescope(friction),
            state=hs.State(np.array([0.0, 0.0, 0.3]), np.zeros(3)),
            duration=1.0,
            method=method,
            stop_when_fallen=False,
        )
        assert run.completed, run.message
        assert run.certificates.complementarity <= 1e-9
        (hit,) = [event for event in run.events if event.kind is EventKind.JOINT_STOP]
        fall = np.sqrt(2.0 * 0.3 / (G - friction / 3.0))
        exact = isinstance(method, hs.EventDriven)
        assert hit.time == pytest.approx(fall, abs=1e-8 if exact else 3e-3)
        assert abs(run.position[-1, 2]) <= 1e-12
        carried = run.stop_torque[-1, 2] + run.friction_torque[-1, 2]
        assert carried == pytest.approx(3.0 * G, rel=1e-9)
        assert abs(run.friction_torque[-1, 2]) <= friction * (1.0 + 1e-9)


def crouching() -> tuple[hs.Robot, hs.State]:
    """bravo7 with bent knees, both feet flat beside each other."""
    robot = hs.load_robot("bravo7")
    q = robot.reference_state().q.copy()
    for part, angle in (("hip", -0.3), ("knee", 0.6), ("ankle", -0.3)):
        q[[part in name for name in robot.joint_names]] += angle
    q[1] -= contact_positions(robot, q)[:, 1].min()
    return robot, hs.State(q, np.zeros(robot.nv))


def least_breakaway_torque(robot: hs.Robot, state: hs.State) -> float:
    """Breakaway torque of all joints that just holds a robot at rest: a linear program.

    Of all joint torques τ and contact forces λ in their cones with τ + Jᵀ λ = H, those with the
    smallest |τ|.
    """
    nv, nc = robot.nv, robot.nc
    places = zip(robot.model.contact_link, robot.model.contact_position, strict=True)
    rows = [point_jacobian(robot, state.q, link, local)[[1, 0]] for link, local in places]
    moving = np.eye(nv)[3:]  # all but the trunk
    count = len(moving)
    equal = np.hstack((moving.T, np.concatenate(rows).T, np.zeros((nv, 1))))
    bounds = np.zeros((2 * (count + nc), count + 2 * nc + 1))
    for i in range(count):
        for k, sign in enumerate((1.0, -1.0)):
            bounds[2 * i + k, [i, -1]] = sign, -1.0
    for i in range(nc):
        for k, sign in enumerate((1.0, -1.0)):
            place = count + 2 * i
            bounds[2 * count + 2 * i + k, [place, place + 1]] = -0.75, sign
    found = linprog(
        np.eye(count + 2 * nc + 1)[-1],
        A_ub=bounds,
        b_ub=np.zeros(len(bounds)),
        A_eq=equal,
        b_eq=bias_force(robot, state.q, state.v),
        bounds=(None, None),
    )
    assert found.success
    return float(found.fun)


@pytest.mark.parametrize("method", METHODS[:2], ids=lambda method: type(method).__name__)
def test_a_biped_stands_on_its_dry_joints(method: object) -> None:
    """Six joints that stick above two feet that stick: three times statically indeterminate.

    Which joint carries what is open, but not whether they can: up to the least breakaway torque
    that balances the weight nothing moves, however the loads are shared; below it knees give way.
    """
    robot, state = crouching()
    least = least_breakaway_torque(robot, state)
    weight = G * robot.model.mass.sum()
    for share in (5.0, 1.5, 1.01, 0.99):
        friction = np.concatenate((np.zeros(3), np.full(6, share * least)))
        model = robot.model.replaced(dry_friction=friction)
        dry = dataclasses.replace(robot, model=model)
        run = hs.simulate(dry, state=state, duration=0.2, method=method)  # type: ignore[arg-type]
        assert run.completed, run.message
        assert max(dataclasses.astuple(run.certificates)) <= 1e-9
        assert np.abs(run.friction_torque).max() <= share * least * (1.0 + 1e-9)
        if share > 1.0:
            assert np.abs(run.velocity).max() <= 1e-10
            assert not run.events
            np.testing.assert_allclose(run.contact_force[1:, :, 0].sum(axis=1), weight, rtol=1e-9)
        else:
            assert np.abs(run.velocity[-1]).max() > 1e-3
            assert joint_events(run)
