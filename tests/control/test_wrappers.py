"""What stands between a controller and its robot: sensors, actuators, an estimator."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control.noise import normal, seeded, uniform


class Gains(hs.Bundle):
    """Springs and dampers."""

    kp: Any = hs.array("nu")
    kd: Any = hs.array("nu")


class Counted(hs.Bundle):
    """How often it was called."""

    calls: int = hs.cell(int)


class Told(hs.Bundle):
    """What it saw."""

    seen: Any = hs.array("nu", unit="rad")
    count: int = hs.cell(int)
    period: float = hs.cell(float)


@hs.controller
def stand(state, robot, parameters: Gains, memory: Counted, log: Told, torque):
    """Stand on springs."""
    memory.calls += 1
    log.count = memory.calls
    log.period = robot.period
    for i in range(robot.nu):
        log.seen[i] = state.joint_position[i]
        torque[i] = -parameters.kp[i] * state.joint_position[i]
        torque[i] -= parameters.kd[i] * state.joint_velocity[i]


class StandInPython:
    """The same as an object; it takes part in snapshots."""

    def __init__(self) -> None:
        self.calls = 0

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        self.calls += 1
        return -600.0 * state.q[3:] - 10.0 * state.v[3:]

    def snapshot(self) -> Any:
        return [float(self.calls)]

    def restore(self, numbers: Any) -> None:
        self.calls = int(numbers[0])


def law(**options: Any) -> Any:
    return stand(Gains(kp=np.full(6, 600.0), kd=np.full(6, 10.0)), **options)


def run_of(controller: Any, duration: float = 0.02, **options: Any) -> hs.Run:
    robot = walking.bravo7()
    q, v = robot.reference_state().q + 0.01 * np.arange(9), np.full(9, 0.1)
    q[1], v[1] = q[1] + 0.005, -0.1  # just above the ground, and falling
    start = hs.State(q, v)
    options = {"method": hs.TimeStepping(), "stop_when_fallen": False} | options
    run = hs.simulate(robot, controller, state=start, duration=duration, **options)
    assert run.completed, run.message
    return run


def wrapped(controller: Any, **options: Any) -> Any:
    sensors = {"encoders": hs.Encoders(bits=12, noise=1e-3), "seed": 7} | options
    return hs.Sensed(controller, **sensors)


@pytest.mark.slow
def test_shells_that_do_nothing_change_nothing() -> None:
    plain = run_of(law(), control_period=1e-3)
    for wrapper in (hs.Sensed(law()), hs.Actuated(law())):
        run = run_of(wrapper)
        np.testing.assert_allclose(run.torque, plain.torque, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(run.position, plain.position, rtol=0.0, atol=1e-12)
        np.testing.assert_array_equal(run.log["count"].values, np.arange(1, 22))


@pytest.mark.parametrize("method", [hs.TimeStepping(), hs.EventDriven(rtol=1e-6)])
def test_compiled_checked_and_an_object_see_the_same(method: Any) -> None:
    runs = [
        run_of(wrapped(law()), method=method),
        run_of(wrapped(law()), method=method, checked=True),
        run_of(
            wrapped(hs.controller(compile=False)(stand.python)(law().parameters)), method=method
        ),
        run_of(wrapped(StandInPython()), method=method),
    ]
    for run in runs[1:]:
        np.testing.assert_allclose(run.torque, runs[0].torque, rtol=1e-9, atol=1e-9)
        measured = run.log["measured_position"].values
        np.testing.assert_allclose(measured, runs[0].log["measured_position"].values, atol=1e-12)
    error = runs[0].log["measured_position"].values - runs[0].position
    assert np.abs(error[:, 3:]).max() > 1e-3
    if isinstance(method, hs.TimeStepping):
        assert np.all(error[:, :3] == 0.0)  # what no sensor measures is true


def test_encoders_round_wander_and_differ() -> None:
    step = 2.0 * np.pi / 2**12
    exact = run_of(wrapped(law(), encoders=hs.Encoders(bits=12)))
    seen = exact.log["measured_position"].values[:, 3:]
    np.testing.assert_allclose(seen / step, np.round(seen / step), atol=1e-9)
    assert 0.4 * step < np.abs(seen - exact.position[:, 3:]).max() <= 0.5 * step + 1e-12
    np.testing.assert_allclose(
        exact.log["measured_velocity"].values[1:, 3:], np.diff(seen, axis=0) / 1e-3, atol=1e-9
    )
    noisy = run_of(wrapped(law(), encoders=hs.Encoders(noise=1e-3)), duration=0.2)
    error = noisy.log["measured_position"].values[:, 3:] - noisy.position[:, 3:]
    assert error.std() == pytest.approx(1e-3, rel=0.1)  # 1206 numbers: 2 % is one deviation
    assert abs(error.mean()) < 1.5e-4
    wrong = run_of(wrapped(law(), encoders=hs.Encoders(bias=0.01)))
    error = wrong.log["measured_position"].values[:, 3:] - wrong.position[:, 3:]
    assert np.ptp(error, axis=0).max() < 1e-12
    assert 1e-3 < error[0].std() < 0.03
    slow = run_of(wrapped(law(), encoders=hs.Encoders(rate=250.0)))
    seen = slow.log["measured_position"].values[:, 3:]
    changed = np.flatnonzero(np.abs(np.diff(seen[:, 0])) > 0.0) + 1
    np.testing.assert_array_equal(changed, [4, 8, 12, 16, 20])
    np.testing.assert_allclose(seen[changed], slow.position[changed, 3:], atol=1e-12)
    smooth = run_of(wrapped(law(), encoders=hs.Encoders(cutoff=20.0)))
    seen, told = smooth.position[:, 3:], smooth.log["measured_velocity"].values[:, 3:]
    turned = 2.0 * np.pi * 20.0 * 1e-3
    wanted = told[:-1] + turned / (1.0 + turned) * (np.diff(seen, axis=0) / 1e-3 - told[:-1])
    np.testing.assert_allclose(told[1:], wanted, atol=1e-9)


def test_pitch_forces_and_switches() -> None:
    unit = hs.InertialUnit(noise=1e-3, rate_bias=0.1)
    feet = hs.FootSensors(switches=True, threshold=1.0)
    run = run_of(wrapped(law(), encoders=None, imu=unit, feet=feet), duration=0.05)
    position, velocity = (run.log[f"measured_{name}"].values for name in ("position", "velocity"))
    error = position - run.position
    assert 2e-4 < error[:, 2].std() < 3e-3
    assert np.all(np.delete(error, 2, axis=1) == 0.0)
    drift = (velocity - run.velocity)[:, 2]
    assert np.ptp(drift) < 1e-12
    assert drift[0] != 0.0
    force = run.log["measured_force"].values
    pressed = run.contact_force[:-1, :, 0] > 1.0  # what is seen is the force of the step before
    np.testing.assert_array_equal(force[1:, :, 0], pressed.astype(float))
    assert pressed.any()
    assert not pressed.all()
    assert np.all(force[..., 1] == 0.0)
    weighed = run_of(wrapped(law(), encoders=None, feet=hs.FootSensors(noise=2.0)), duration=0.05)
    error = weighed.log["measured_force"].values[1:, :, 0] - weighed.contact_force[:-1, :, 0]
    pressed = weighed.contact_force[:-1, :, 0] > 20.0
    assert error[pressed].std() == pytest.approx(2.0, rel=0.4)
    in_the_air = weighed.contact_force[:-1, :, 0] == 0.0
    assert np.all(error[in_the_air] == 0.0)


def test_everything_is_seen_late() -> None:
    run = run_of(wrapped(law(), encoders=None, delay=3e-3))
    seen = run.log["measured_position"].values
    np.testing.assert_allclose(seen[3:], run.position[:-3], atol=1e-12)
    np.testing.assert_allclose(seen[:3], run.position[[0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(run.log["seen"].values, seen[:, 3:], atol=1e-12)


class Looks:
    """What it was shown of contact points, call by call."""

    def __init__(self) -> None:
        self.seen: list[Any] = []

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        shown = contacts.position, contacts.normal, contacts.gap[:, None]
        self.seen.append(np.hstack(shown))
        return np.zeros(6)


def test_contact_points_are_seen_late_as_well() -> None:
    now, then = Looks(), Looks()
    ground = hs.Ground(friction=0.7, profile=np.array([[-9.0, -0.5], [0.05, 0.0], [9.0, 0.5]]))
    run_of(hs.Sensed(now), ground=ground)
    run_of(hs.Sensed(then, delay=3e-3), ground=ground)
    assert np.abs(now.seen[9] - now.seen[6])[:, [0, 1, 4]].max(axis=0).min() > 1e-6
    np.testing.assert_array_equal(then.seen[3:], now.seen[:-3])
    np.testing.assert_array_equal(then.seen[:3], [now.seen[0]] * 3)


def test_gains_behind_a_delay_are_no_gains_of_this_instant() -> None:
    stiff = {"stiffness": np.full(6, 600.0), "damping": np.full(6, 10.0)}
    kept = hs.Sensed(law(**stiff), encoders=hs.Encoders(bits=14))
    np.testing.assert_array_equal(kept.stiffness, stiff["stiffness"])
    np.testing.assert_array_equal(hs.Actuated(kept).damping, stiff["damping"])
    for late in (
        hs.Sensed(law(**stiff), delay=1e-3),
        hs.Actuated(law(**stiff), delay=1e-3),
        hs.Actuated(kept, bandwidth=50.0),
        pickle.loads(pickle.dumps(hs.Actuated(law(**stiff), delay=1e-3))),
    ):
        assert late.stiffness is None
        assert late.damping is None


def test_actuators_are_late_and_slow() -> None:
    run = run_of(hs.Actuated(law(), delay=2e-3, bandwidth=30.0))
    asked, given = run.log["asked_torque"].values, run.log["given_torque"].values
    np.testing.assert_array_equal(run.torque, given)
    assert np.all(given[:2] == 0.0)
    # The lag of first order, integrated finely under the torques that came two periods late.
    left, fine = 0.0 * asked[0], 1000
    for row in range(2, len(given)):
        mean = 0.0
        for _ in range(fine):
            before = left
            left = left + (asked[row - 2] - left) * (1.0 - np.exp(-2e-3 * np.pi * 30.0 / fine))
            mean = mean + 0.5 * (before + left) / fine
        np.testing.assert_allclose(given[row], mean, rtol=1e-5, atol=1e-9)


def test_gears_take_their_share() -> None:
    run = run_of(hs.Actuated(law(), efficiency=0.8))
    asked, speed = run.log["asked_torque"].values, run.velocity[:, 3:]
    wanted = np.where(asked * speed > 0.0, 0.8 * asked, asked / 0.8)
    np.testing.assert_allclose(run.log["given_torque"].values, wanted, rtol=1e-9)
    assert (asked * speed > 0.0).any()


def test_a_slower_controller_is_held() -> None:
    run = run_of(wrapped(law(period=4e-3)), duration=0.02)
    np.testing.assert_array_equal(run.log["count"].values, np.arange(21) // 4 + 1)
    assert np.all(run.log["period"].values == 4e-3)
    assert len(np.unique(run.torque[:, 0])) == 6


@pytest.mark.slow
def test_shells_in_shells() -> None:
    inner = hs.Estimated(law())
    both = hs.Actuated(hs.Sensed(inner, encoders=hs.Encoders(bits=14)), delay=1e-3)
    run = run_of(both)
    names = {"measured_position", "estimated_position", "asked_torque", "seen"}
    assert names <= set(run.log)
    np.testing.assert_array_equal(
        run.log["seen"].values, run.log["estimated_position"].values[:, 3:]
    )
    np.testing.assert_array_equal(run.torque[1:], run.log["asked_torque"].values[:-1])


def test_the_same_seed_gives_the_same_run() -> None:
    first, again, other = (run_of(wrapped(law(), seed=seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.torque, again.torque)
    assert np.abs(first.torque - other.torque).max() > 0.1


@pytest.mark.parametrize("inside", [law, StandInPython])
def test_a_snapshot_keeps_all_of_it(inside: Any) -> None:
    robot = walking.bravo7()
    whole = hs.Simulation(robot, wrapped(inside()), state=robot.reference_state())
    whole.advance(0.005)
    kept = whole.snapshot()
    whole.advance(0.01)
    later = hs.Simulation(robot, wrapped(inside()), state=kept)
    later.advance(0.01)
    np.testing.assert_array_equal(later.state.q, whole.state.q)
    if inside is StandInPython:
        assert later.controller.inside.function.partner.calls == 10  # type: ignore[union-attr]


@pytest.mark.slow
def test_a_shell_is_copied_by_pickle() -> None:
    wrapper = wrapped(hs.ComputedTorque(walking.bravo7(), walking.gait()))
    again = pickle.loads(pickle.dumps(wrapper))
    assert again.function is wrapper.function
    start = walking.gait().initial_state
    runs = [
        hs.simulate(walking.bravo7(), each, state=start, duration=0.003)
        for each in (wrapper, again)
    ]
    np.testing.assert_array_equal(runs[0].torque, runs[1].torque)


class TellsInPython(StandInPython):
    """The same with a log."""

    def __init__(self) -> None:
        super().__init__()
        self.log = Told.allocate(nu=6)

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        self.log.seen[:] = state.q[3:]
        self.log.count += 1
        return super().torque(t, state, contacts)


@pytest.mark.parametrize("checked", [False, True])
def test_an_object_in_a_shell_keeps_its_log(checked: bool) -> None:
    run = run_of(hs.Actuated(wrapped(TellsInPython(), delay=1e-3)), checked=checked)
    np.testing.assert_array_equal(run.log["count"].values, np.arange(1, 22))
    np.testing.assert_array_equal(
        run.log["seen"].values, run.log["measured_position"].values[:, 3:]
    )
    assert run.log["seen"].unit == "rad"


def test_an_object_in_a_shell_is_copied_by_pickle() -> None:
    wrapper = wrapped(TellsInPython())
    before = run_of(wrapper)
    again = run_of(pickle.loads(pickle.dumps(wrapper)))
    np.testing.assert_array_equal(again.torque, before.torque)
    assert again.log["count"].values[0] == 22  # an object goes on from what it remembers


def test_voltages_are_no_torques() -> None:
    with pytest.raises(hs.ControllerError, match="needs torques to predict with"):
        hs.Estimated(law(commands_voltage=True))
    with pytest.raises(hs.ControllerError, match="efficiency does not apply"):
        hs.Actuated(law(commands_voltage=True), efficiency=0.9)
    assert hs.Actuated(law(commands_voltage=True), delay=1e-3).commands_voltage


def test_what_cannot_be() -> None:
    robot = walking.bravo7()
    with pytest.raises(hs.ControllerError, match="whole number of periods"):
        hs.Sensed(law(), delay=1.5e-3)
    with pytest.raises(hs.ControllerError, match=r"300\.0 readings a second"):
        hs.Sensed(law(), encoders=hs.Encoders(rate=300.0))
    with pytest.raises(hs.ControllerError, match="noise must be ≥ 0"):
        hs.Encoders(noise=-1.0)
    with pytest.raises(hs.ControllerError, match="bits"):
        hs.Encoders(bits=0)
    with pytest.raises(hs.ControllerError, match="seed"):
        hs.Sensed(law(), seed=-1)
    with pytest.raises(hs.ControllerError, match="bandwidth"):
        hs.Actuated(law(), bandwidth=0.0)
    with pytest.raises(hs.ControllerError, match="efficiency"):
        hs.Actuated(law(), efficiency=1.1)
    with pytest.raises(hs.ControllerError, match="has its own period"):
        hs.simulate(
            robot, wrapped(law()), state=robot.reference_state(), duration=0.1, control_period=2e-3
        )
    with pytest.raises(hs.ControllerError, match="not a multiple of"):
        hs.Sensed(law(period=1e-3), period=7e-4)
    with pytest.raises(hs.ControllerError, match="parameters yet"):
        hs.Sensed(stand)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrapper", [hs.Actuated, hs.Sensed, hs.Estimated])
@pytest.mark.parametrize("period", [0.0, -1e-3, float("nan"), float("inf")])
def test_a_period_is_a_time(wrapper: Any, period: float) -> None:
    with pytest.raises(hs.ControllerError, match=r"the period of .* must be a positive number"):
        wrapper(law(), period=period)


def test_a_robot_without_pitch_has_no_imu() -> None:
    build = hs.RobotBuilder("wheel")
    build.hinge("axle", None, inertia=0.5, torque=10.0)
    wheel = build.build()

    class Still:
        def torque(self, t: float, state: Any, contacts: Any) -> Any:
            return np.zeros(1)

    wrapper = hs.Sensed(Still(), imu=hs.InertialUnit(noise=1e-3))
    with pytest.raises(hs.ControllerError, match="no pitch for an imu"):
        hs.simulate(wheel, wrapper, state=wheel.reference_state(), duration=0.01)
    estimated = hs.Sensed(hs.Estimated(Still()), encoders=hs.Encoders(noise=1e-3))
    run = hs.simulate(wheel, estimated, state=wheel.reference_state(), duration=0.01)
    assert run.completed, run.message
    assert np.abs(run.log["estimated_velocity"].values).max() < 0.1


def test_noise_is_normal_and_the_same_uncompiled() -> None:
    seeds = np.array(seeded(5))
    drawn = np.array([normal(seeds) for _ in range(4000)])
    assert abs(drawn.mean()) < 4.0 / np.sqrt(4000)
    assert drawn.std() == pytest.approx(1.0, abs=0.05)
    assert np.mean(np.abs(drawn) < 1.0) == pytest.approx(0.6827, abs=0.03)
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.06
    one, two = np.array(seeded(9)), np.array(seeded(9))
    from heelstrike.compiler.compilation import uncompiled

    for _ in range(50):
        assert uniform(one) == uncompiled(uniform)(two)
