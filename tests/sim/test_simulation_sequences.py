"""Simulations that are used in odd orders: what is kept goes on as what was left alone."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import walking
from synthetic_runs import box

import heelstrike as hs
from heelstrike.sim import RunStatus

METHODS = {
    "time stepping": hs.TimeStepping(),
    "event driven": hs.EventDriven(),
    "compliant": hs.Compliant(),
}


class Sway:
    """Torques that depend on all calls before."""

    def __init__(self) -> None:
        self.calls: list[float] = []

    def torque(self, t: float, state: hs.State, contacts: Any) -> np.ndarray:
        self.calls.append(t)
        return 0.1 * np.sin(0.7 * len(self.calls)) - 0.5 * state.v[3:]

    def snapshot(self) -> np.ndarray:
        return np.array(self.calls)

    def restore(self, numbers: np.ndarray) -> None:
        self.calls = numbers.tolist()


def computed_torque() -> hs.ComputedTorque:
    return hs.ComputedTorque(walking.bravo7(), walking.gait(), encoder=hs.Encoder())


CONTROLLERS: dict[str, Callable[[], Any]] = {
    "stock": computed_torque, "python": Sway, "none": lambda: None,
}  # fmt: skip


def begun(method: str, controller: str = "none", **options: Any) -> hs.Simulation:
    given = {"state": walking.gait().initial_state, "stop_when_fallen": False} | options
    return hs.Simulation(
        walking.bravo7(), CONTROLLERS[controller](), method=METHODS[method], **given
    )


# What may be done to a simulation: each with a random number from 0 to 1.


def advanced(simulation: hs.Simulation, x: float) -> None:
    simulation.advance(simulation.time + 0.02 * x)


def stepped(simulation: hs.Simulation, x: float) -> None:
    for _ in range(int(8 * x)):
        simulation.step()


def pushed(simulation: hs.Simulation, x: float) -> None:
    start = simulation.time + 0.02 * x - 0.005
    simulation.apply(hs.Push("trunk", force=(30 * x, -9.0), start=start, duration=0.01))


def slippery(simulation: hs.Simulation, x: float) -> None:
    simulation.ground = hs.Ground(friction=0.4 + 0.5 * x, profile=simulation.ground.profile)


def lowered(simulation: hs.Simulation, x: float) -> None:
    depth = float(np.min(simulation.contacts.gap, initial=0.0)) - 0.01 * x
    deepest = float(simulation.ground.height(simulation.state.q[0])) + depth
    simulation.ground = hs.Ground(profile=[[-9.0, deepest], [9.0, deepest]])


def controlled(simulation: hs.Simulation, x: float) -> None:
    simulation.controller = list(CONTROLLERS.values())[int(3 * x)]()


def looked_at(simulation: hs.Simulation, x: float) -> None:
    before = simulation.state
    run, again = simulation.record, simulation.record
    np.testing.assert_array_equal(run.position, again.position)
    assert run.pushes == again.pushes
    assert run.ground is simulation.ground
    np.testing.assert_array_equal(before.q, simulation.state.q)


class Stiffness(hs.Bundle):
    kp: np.ndarray = hs.array("nu")


@hs.controller(compile=False)
def springs(state: Any, parameters: Stiffness, torque: Any) -> None:
    torque[:] = -parameters.kp * state.joint_position


DEEDS = (advanced, advanced, stepped, stepped, pushed, slippery, lowered, controlled, looked_at)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(4))
def test_what_was_kept_goes_on_as_what_was_left_alone(method: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    one = begun(method, list(CONTROLLERS)[seed % 3])

    def do(simulation: hs.Simulation, deed: Any, x: float) -> None:
        if simulation.status in (RunStatus.COMPLETED, RunStatus.INTERRUPTED):
            time = simulation.time
            deed(simulation, x)
            assert simulation.time >= time

    for deed, x in zip(random.choice(DEEDS, 10), random.random(10), strict=True):
        do(one, deed, x)
    kept = one.snapshot()
    again = hs.Simulation(
        walking.bravo7(), copy.deepcopy(one.controller), method=METHODS[method], state=kept
    )
    assert again.time == one.time
    for deed, x in zip(random.choice(DEEDS, 10), random.random(10), strict=True):
        for each in (one, again):
            do(each, deed, x)
        if again.status is RunStatus.COMPLETED:
            looked_at(again, x)
        assert (one.time, one.status) == (again.time, again.status)
        for part in ("q", "v"):
            np.testing.assert_array_equal(getattr(one.state, part), getattr(again.state, part))
    rows = [run.contact_force[run.time > kept.time] for run in (one.record, again.record)]
    np.testing.assert_array_equal(*rows)
    assert np.all(np.diff(one.record.time) >= 0.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("period", [None, 0.01])
def test_a_controller_that_is_set_is_asked_at_once(method: str, period: float | None) -> None:
    for time in (0.004, 0.1):
        simulation = begun(method, control_period=period)
        simulation.advance(time)
        sway = Sway()
        simulation.controller = sway
        simulation.advance(time + 0.015)
        assert sway.calls[0] == pytest.approx(time)
        assert np.all(np.diff(sway.calls) > 0.0)
        assert len(sway.calls) == (15 if period is None else 2)
        assert np.all(np.diff(simulation.record.time) >= 0.0)


def test_without_the_controller_that_was_called_by_time_steps_are_long_again() -> None:
    simulation = begun("event driven", "python")
    simulation.advance(0.002)
    simulation.controller = None
    assert simulation._clock.control_period == 0.0


def test_ground_that_is_taken_away_lets_the_robot_fall() -> None:
    block = box()
    for method in METHODS.values():
        start = hs.State(block.model.reference, np.zeros(3))
        simulation = hs.Simulation(block, state=start, method=method)
        simulation.advance(0.5)
        simulation.ground = hs.Ground(profile=[[-9.0, -0.5], [9.0, -0.5]])
        simulation.advance(0.6)
        assert simulation.contacts.gap == pytest.approx(0.5 - 9.81 * 0.1**2 / 2, abs=2e-3)
        simulation.advance(1.5)
        assert simulation.contacts.gap == pytest.approx(0.0, abs=1e-3)


def test_ground_is_laid_under_the_robot_where_it_is_now() -> None:
    """Higher ground where it began does not matter to a method that begins outside the ground."""
    block = box()
    start = hs.State(block.model.reference + np.array([0.0, 0.5, 0.0]), np.array([4.0, 0.0, 0.0]))
    simulation = hs.Simulation(block, state=start, method=hs.EventDriven())
    simulation.advance(0.25)
    behind = hs.Ground(profile=[[-9.0, 2.0], [0.3, 2.0], [0.31, -0.5], [9.0, -0.5]])
    simulation.ground = behind
    assert simulation.ground is behind


def test_a_snapshot_on_low_ground_begins_a_simulation() -> None:
    block, low = box(), hs.Ground(profile=[[-9.0, -1.0], [9.0, -1.0]])
    start = hs.State(block.model.reference + np.array([0.0, -0.9, 0.0]), np.zeros(3))
    one = hs.Simulation(block, state=start, method=hs.EventDriven(), ground=low)
    one.advance(0.1)
    again = hs.Simulation(block, state=one.snapshot(), method=hs.EventDriven())
    assert again.time == one.time


def test_advancing_to_now_does_nothing() -> None:
    simulation = begun("time stepping")
    for k in (9, 9, 35, 35):  # steps of 1e-3 s, whose sum is not quite these
        assert simulation.advance(k / 1000) is RunStatus.COMPLETED
    assert simulation.record.steps == 35


def test_the_record_goes_on_with_what_was_set_last() -> None:
    simulation = begun("event driven")
    simulation.advance(0.02)
    push = hs.Push("trunk", force=(5.0, 0.0), start=0.02, duration=0.01)
    simulation.apply(push)
    run = simulation.record
    assert run.pushes == simulation.record.pushes == (push,)
    again = begun("event driven", state=run.final)
    for each in (simulation, again):
        each.advance(0.04)
    np.testing.assert_array_equal(simulation.state.q, again.state.q)


def test_a_restore_that_fails_changes_nothing() -> None:
    simulation, kept = begun("time stepping"), begun("time stepping")
    kept.advance(0.02)
    snapshot = kept.snapshot()
    before = simulation.snapshot()
    for name in ("control.cells", "time", "ground.friction", "memory.tally.cells"):
        arrays = {key: value for key, value in snapshot.arrays.items() if key != name}
        with pytest.raises(hs.SimulationError, match="damaged"):
            simulation.restore(hs.Snapshot(arrays, snapshot.identity))
        after = simulation.snapshot()
        assert all(np.array_equal(after.arrays[key], before.arrays[key]) for key in before.arrays)
    with pytest.raises(hs.SimulationError, match="restore takes a Snapshot"):
        simulation.restore(simulation.state)  # type: ignore[arg-type]


def test_stopping_when_fallen_can_be_given_up_with_a_snapshot() -> None:
    kept = begun("time stepping", stop_when_fallen=True).snapshot()
    assert begun("time stepping", state=kept).advance(5.0) is RunStatus.COMPLETED
    lasting = begun("time stepping").snapshot()
    fallen = begun("time stepping", state=lasting, stop_when_fallen=True)
    assert fallen.advance(5.0) is RunStatus.FELL


def test_a_push_that_is_over_is_refused() -> None:
    simulation = begun("time stepping")
    simulation.advance(0.02)
    with pytest.raises(
        hs.SimulationError, match=r"ends at t = 0.015 s, before the present time, t = 0.02 s"
    ):
        simulation.apply(hs.Push("trunk", force=(5.0, 0.0), start=0.005, duration=0.01))
    assert simulation.record.pushes == ()


def test_a_controller_that_cannot_be_used_leaves_the_one_before() -> None:
    simulation = begun("time stepping", "python")
    before = simulation.controller
    with pytest.raises(hs.ControllerError):
        simulation.controller = springs(Stiffness(kp=np.ones(3)))
    with pytest.raises(hs.ControllerError):
        simulation.controller = object()  # type: ignore[assignment]
    assert simulation.controller is before
    assert simulation.step() is RunStatus.COMPLETED


def test_an_error_that_is_over_is_forgotten() -> None:
    def fail(time: float) -> None:
        raise ValueError(time)

    simulation = begun("time stepping")
    assert simulation.advance(1.0, progress=fail) is RunStatus.INTERRUPTED
    assert isinstance(simulation.record.error, ValueError)
    simulation.advance(1.0)
    assert simulation.record.error is None


def test_a_simulation_refuses_to_be_copied() -> None:
    simulation = begun("time stepping")
    for way in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match=r"state=simulation.snapshot\(\)"):
            way(simulation)  # type: ignore[operator]


def test_runs_of_a_batch_can_be_continued() -> None:
    robot, start = walking.bravo7(), walking.gait().initial_state
    for method in METHODS.values():
        batch = hs.simulate_batch(
            robot, state=start, duration=0.05, method=method, record_every=1, threads=1
        )
        run = hs.simulate(robot, state=start, duration=0.05, method=method)
        mine, its = batch.run(0).final, run.final
        assert mine is not None
        assert its is not None
        np.testing.assert_array_equal(mine.state.q, its.state.q)
