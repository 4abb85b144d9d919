"""Compliant ground as a simulation method: walks, events, endings, arguments."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.errors import SimulationError
from heelstrike.robot import read_mjcf
from heelstrike.sim import (
    Contacts,
    EventKind,
    RunStatus,
)
from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)
from heelstrike.sim.compliant.method import PATIENCE, Compliant


@cache
def walk(method: Compliant, *, steps: int = 20, control_period: float | None = None) -> hs.Run:
    return hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=walking.gait().initial_state,
        duration=steps * walking.STEP_DURATION,
        method=method,
        ground=hs.Ground(friction=walking.FRICTION),
        control_period=control_period,
    )


@pytest.mark.parametrize("law", [HuntCrossley(), KelvinVoigt()])
@pytest.mark.parametrize("friction", [RegularisedFriction(), BristleFriction()])
def test_twenty_steps(
    law: HuntCrossley | KelvinVoigt, friction: RegularisedFriction | BristleFriction
) -> None:
    """Both laws carry the paper's walk, with either friction, on what they were given to stand on.

    The static sink is below 0.1 mm; a touchdown presses deeper.
    """
    run = walk(Compliant(law=law, friction=friction))
    summary = run.summary(gait=walking.gait())
    assert run.status is RunStatus.COMPLETED
    assert summary.steps == 20
    assert summary.friction_use_max <= 1.0 + 1e-12
    assert summary.distance_m == pytest.approx(6.0, abs=0.05)
    assert 1e-5 < run.certificates.penetration < 1e-3
    assert run.certificates.cone <= 1e-15
    assert run.contact_force[..., 0].min() >= 0.0
    assert run.solver.name == f"{type(law).__name__}, {type(friction).__name__}"
    standing = run.contact_force[..., 0].sum(axis=1).mean()
    assert standing == pytest.approx(75.0 * 9.81, rel=0.02)


def test_tightening_the_tolerance_changes_nothing_that_matters() -> None:
    coarse = walk(Compliant(law=KelvinVoigt()), steps=4)
    fine = walk(Compliant(law=KelvinVoigt(), rtol=1e-8, atol=1e-10), steps=4)
    assert np.abs(coarse.position[-1] - fine.position[-1]).max() <= 1e-5
    assert len(coarse.events) == len(fine.events)


def test_stiffer_ground_converges_to_hard_contact() -> None:
    """Against time stepping extrapolated to h = 0: first order in 1 / k while one foot stands.

    Damping grows with the stiffness (c = 6 ms · k), so that the impact, too, becomes plastic as
    the sink vanishes. After it the runs also differ by when the phase restarts, which both know to
    a step only: 1e-4 s at some 3 rad/s.
    """

    def states(method: hs.TimeStepping | Compliant) -> np.ndarray:
        run = hs.simulate(
            walking.bravo7(),
            hs.ComputedTorque(walking.bravo7(), walking.gait()),
            state=walking.gait().initial_state,
            duration=0.8,
            method=method,
            ground=hs.Ground(friction=walking.FRICTION),
            record_every=round(0.05 / method.step),
        )
        assert run.completed
        return run.position

    reference = 2.0 * states(hs.TimeStepping(step=5e-5)) - states(hs.TimeStepping(step=1e-4))
    stiffness = np.array([1e6, 1e7, 1e8])
    before, after = [], []
    for k in stiffness:
        law = KelvinVoigt(stiffness=k, damping=6e-3 * k)
        friction = BristleFriction(stiffness=k, damping=6e-3 * k)
        off = np.abs(states(Compliant(law=law, friction=friction, step=1e-4)) - reference)
        before.append(off[13].max())  # at 0.65 s
        after.append(off[-1].max())
    order = -np.polyfit(np.log(stiffness), np.log(before), 1)[0]
    assert 0.9 <= order <= 1.3, before
    assert before[-1] <= 1e-5, before
    assert after[1] < 0.3 * after[0], after
    assert after[-1] <= 1e-3, after


def test_the_same_run_twice_is_the_same_to_the_bit() -> None:
    method = Compliant(law=HuntCrossley())
    first = walk(method, steps=2)
    again = walk.__wrapped__(method, steps=2)
    for name in ("position", "velocity", "torque", "contact_force", "gap"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert first.events == again.events


def test_a_sampled_controller_is_held_between_its_samples() -> None:
    """With a period of 10 ms the torques change at every tenth sample only."""
    run = walk(Compliant(law=KelvinVoigt()), steps=1, control_period=1e-2)
    held = run.torque[: len(run.torque) // 10 * 10].reshape(-1, 10, run.torque.shape[1])
    assert np.all(held == held[:, :1])


class Watcher:
    """No torque; remembers what it was shown."""

    def __init__(self, nu: int) -> None:
        self.nu = nu
        self.seen: list[tuple[float, np.ndarray]] = []

    def torque(self, t: float, state: hs.State, contacts: Contacts) -> np.ndarray:
        self.seen.append((t, contacts.force.copy()))
        return np.zeros(self.nu)


def test_python_controllers_see_the_forces_of_the_step_before() -> None:
    robot = walking.bravo7()
    watcher = Watcher(robot.nu)
    run = hs.simulate(
        robot,
        watcher,
        state=walking.gait().initial_state,
        duration=0.01,
        method=Compliant(),
    )
    assert [t for t, _ in watcher.seen] == pytest.approx(run.time)
    assert np.all(watcher.seen[0][1] == 0.0)
    for (_, seen), acted in zip(watcher.seen[1:], run.contact_force[:-1], strict=True):
        np.testing.assert_array_equal(seen, acted)


POINT = read_mjcf(
    '<mujoco><worldbody><body name="body"><joint name="x" type="slide" axis="1 0 0"/>'
    '<joint name="z" type="slide" axis="0 0 1"/><geom type="sphere" size="0.1" mass="2"/>'
    "</body></worldbody></mujoco>",
    name="point",
)


def drop(method: Compliant, *, speed: float = 0.0, duration: float = 1.0) -> hs.Run:
    return hs.simulate(
        POINT,
        state=hs.State(np.array([0.0, 0.2]), np.array([speed, 0.0])),
        duration=duration,
        method=method,
    )


def test_events_of_a_bouncing_point() -> None:
    """Dropped from 0.1 m at t = √(2 · 0.1 / g), whatever the samples; then ever lower."""
    run = drop(Compliant(law=HuntCrossley(stiffness=1e8, dissipation=0.5), step=1e-2))
    kinds = [event.kind for event in run.events]
    assert kinds[0] is EventKind.TOUCHDOWN
    assert run.events[0].time == pytest.approx(np.sqrt(0.2 / 9.81), abs=1e-7)
    assert run.events[0].impulse[0] > 2.0 * 1.4
    flight = [
        up.time - down.time
        for down, up in zip(run.events, run.events[1:], strict=False)
        if down.kind is EventKind.LIFTOFF and up.kind is EventKind.TOUCHDOWN
    ]
    assert len(flight) >= 2
    assert np.all(np.diff(flight) < 0.0)
    # A bounce within one sample leaves both its events.
    assert kinds[:2] == [EventKind.TOUCHDOWN, EventKind.LIFTOFF]


@pytest.mark.parametrize("friction", [RegularisedFriction(), BristleFriction()])
def test_slip_and_stick(friction: RegularisedFriction | BristleFriction) -> None:
    law = KelvinVoigt(stiffness=1e6, damping=3e3)
    run = hs.simulate(
        POINT,
        state=hs.State(np.array([0.0, 0.1 - law.sink(2.0 * 9.81)]), np.array([1.0, 0.0])),
        duration=0.5,
        method=Compliant(law=law, friction=friction),
        ground=hs.Ground(friction=0.5),
    )
    assert [event.kind for event in run.events] == [EventKind.SLIP, EventKind.STICK]
    assert run.events[1].time == pytest.approx(1.0 / (0.5 * 9.81), abs=2e-3)


def switched_arm(step: float) -> hs.Run:
    """Two links in the air whose torques jump at v + 4 q = 0, and hold both of them there."""
    build = hs.RobotBuilder("arm")
    link = {"mass": 1.0, "inertia": 0.02, "center_of_mass": (0, -0.25), "torque": 1e3}
    build.hinge("elbow", build.hinge("shoulder", None, at=(0, 1), **link), at=(0, -0.5), **link)

    @hs.controller
    def switch(t, state, contacts, robot, torque):  # type: ignore[no-untyped-def]
        for i in range(2):
            torque[i] = -30.0 * np.sign(state.v[i] + 4.0 * state.q[i])

    return hs.simulate(
        build.build(), switch(), state=hs.State([0.3, 0.5], [-1.2, -2.0]), duration=0.1,
        method=Compliant(step=step), stop_when_fallen=False, record_every=round(1e-2 / step),
    )  # fmt: skip


def test_a_law_that_switches_to_and_fro_is_crossed_and_the_run_says_so() -> None:
    """Where v = −4 q attracts from both sides q decays as exp(−4 t), whatever the masses.

    They begin on it, where the law asks for nothing. Torques are held for a hundredth of a sample,
    and everything is wrong by that in the first order. Followed, each millisecond took a million
    steps.
    """
    errors = []
    for step in (2e-3, 1e-3):
        run = switched_arm(step)
        told = [event.impulse for event in run.events if event.kind is EventKind.BRIDGE]
        assert run.completed
        assert run.steps <= 2 * PATIENCE + 500 * round(0.1 / step)
        assert 0 < len(told) <= round(0.1 / step)
        assert 0.02 <= sum(length for length, _ in told) <= 0.1 + 1e-12
        wrong = max(wrong for _, wrong in told)
        off = run.velocity + 4.0 * run.position
        assert 0.0 < np.abs(off).max() <= wrong <= 100.0 * step
        exact = np.exp(-4.0 * run.time)[:, None] * run.position[0]
        errors.append(np.abs(run.position - exact).max())
    assert errors[1] <= 0.6 * errors[0] <= 0.6e-2, errors


def test_a_law_that_jumps_once_is_followed() -> None:
    """Torques that jump within a sample, and stay: no torque is held, and it is as exact."""
    build = hs.RobotBuilder("wheel", gravity=0.0)
    build.hinge("axle", None, mass=1.0, inertia=0.5, torque=1e3)

    @hs.controller
    def late(t, state, contacts, robot, torque):  # type: ignore[no-untyped-def]
        torque[0] = 100.0 if t > 0.00537 else -100.0

    run = hs.simulate(
        build.build(), late(), state=hs.State([0.0], [0.0]), duration=0.01, method=Compliant(),
        stop_when_fallen=False,
    )  # fmt: skip
    assert not run.events
    assert run.velocity[-1, 0] == pytest.approx(200.0 * (0.01 - 2.0 * 0.00537), abs=5e-5)


def test_joint_stops_push_back() -> None:
    """A pendulum falls on its stop and comes to rest on it, where the stop carries its moment."""
    pendulum = read_mjcf(
        '<mujoco><compiler angle="radian"/><worldbody><body name="rod">'
        '<joint name="hinge" type="hinge" axis="0 1 0" limited="true" range="-1 0.5"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 1" size="0.01" mass="1" contype="0"'
        ' conaffinity="0"/></body></worldbody></mujoco>',
        name="pendulum",
    )
    stop = KelvinVoigt(stiffness=1e4, damping=1e2)
    run = hs.simulate(
        pendulum,
        state=hs.State(np.array([0.2]), np.zeros(1)),
        duration=3.0,
        method=Compliant(stop=stop),
    )
    angle = run.position[-1, 0]
    moment = 9.81 * 0.5 * np.sin(angle)
    assert run.velocity[-1, 0] == pytest.approx(0.0, abs=1e-9)
    assert angle - 0.5 == pytest.approx(moment / 1e4, rel=1e-6)
    assert run.stop_torque[-1, 0] == pytest.approx(-moment, rel=1e-6)
    assert run.events[0].kind is EventKind.JOINT_STOP


def test_thinned_records_keep_the_worst_of_every_step() -> None:
    every = drop(Compliant(step=1e-3))
    method = Compliant(step=1e-3)
    thin = hs.simulate(
        POINT,
        state=hs.State(np.array([0.0, 0.2]), np.zeros(2)),
        duration=1.0,
        method=method,
        record_every=100,
    )
    assert len(thin.time) == 11
    assert thin.certificates == every.certificates
    np.testing.assert_array_equal(thin.position, every.position[::100])


def test_a_torque_that_is_not_finite_ends_the_run() -> None:
    class Bad:
        def torque(self, t: float, state: hs.State, contacts: Contacts) -> np.ndarray:
            return np.full(walking.bravo7().nu, np.nan if t > 0.005 else 0.0)

    run = hs.simulate(
        walking.bravo7(),
        Bad(),
        state=walking.gait().initial_state,
        duration=0.1,
        method=Compliant(),
    )
    assert run.status is RunStatus.CONTROLLER_FAILED
    assert run.time[-1] == pytest.approx(0.005)


def test_a_robot_left_alone_falls() -> None:
    run = hs.simulate(
        walking.bravo7(), state=walking.gait().initial_state, duration=5.0, method=Compliant()
    )
    assert run.status is RunStatus.FELL


class Calls(hs.Bundle):
    """How often a controller has been asked."""

    number: int = hs.cell(int)


@hs.controller
def counting(memory: Calls, torque: np.ndarray) -> None:
    """Ask for as many 1/1024 newton metres as it remembers calls."""
    memory.number += 1
    for i in range(torque.shape[0]):
        torque[i] = memory.number / 1024.0


def test_a_controller_remembers_one_call_for_every_step() -> None:
    """However often the integration asks within its steps and in those that it rejects."""
    run = hs.simulate(
        walking.bravo7(),
        counting(),
        state=walking.gait().initial_state,
        duration=0.05,
        method=Compliant(),
    )
    assert run.steps > 50
    assert 1024.0 * run.torque[-1, 0] == run.steps + 1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"law": "hunt_crossley"}, "law must be"),
        ({"law": RegularisedFriction()}, "law must be"),
        ({"stop": 3.0}, "stop must be"),
        ({"friction": 0.7}, "friction must be"),
        ({"step": 0.0}, "step"),
        ({"step": float("nan")}, "step"),
        ({"rtol": -1e-3}, "rtol"),
        ({"atol": float("inf")}, "atol"),
    ],
)
def test_arguments_are_checked(options: dict[str, object], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        Compliant(**options)  # type: ignore[arg-type]


def test_restitution_belongs_to_the_law() -> None:
    with pytest.raises(SimulationError, match="restitution"):
        hs.simulate(
            POINT,
            state=hs.State(np.array([0.0, 0.2]), np.zeros(2)),
            duration=0.1,
            method=Compliant(),
            ground=hs.Ground(restitution=0.5),
        )


def test_control_period_must_fit_the_step() -> None:
    with pytest.raises(SimulationError, match="control_period"):
        walk(Compliant(step=1e-3), steps=1, control_period=1.5e-3)
