"""hs.Batch: lanes are simulations to the last bit, end by themselves, and start again."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control import ControlState
from heelstrike.robot.model import Floats
from heelstrike.sim import RunStatus
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.method import Method

LANES = 6


def heavier(factor: float) -> hs.Robot:
    robot = walking.bravo7()
    model = robot.model.replaced(mass=factor * robot.model.mass)
    return dataclasses.replace(robot, model=model)


def everything(seed: int = 0) -> dict[str, Any]:
    """Arguments that differ from lane to lane; the robots stand on, or fall onto, their feet."""
    rng = np.random.default_rng(seed)
    robots = [heavier(factor) for factor in rng.uniform(0.9, 1.1, LANES)]
    start = walking.bravo7().reference_state()
    return {
        "robot": robots,
        "controller": [hs.HeldTorque(robots[0], torque) for torque in rng.uniform(-5, 5, LANES)],
        "state": [
            hs.State(start.q + np.eye(9)[1] * 0.01 * i, rng.normal(0.0, 0.3, 9))
            for i in range(LANES)
        ],
        "ground": [hs.Ground(friction=mu) for mu in rng.uniform(0.3, 1.0, LANES)],
        "pushes": [
            [hs.Push("trunk", force=(80.0, 0.0), start=0.01, duration=0.02)] * (i % 3)
            for i in range(LANES)
        ],
    }


def alone(arguments: dict[str, Any], lane: int, **more: Any) -> hs.Simulation:
    own = {name: values[lane] for name, values in arguments.items()}
    return hs.Simulation(**own, **more, record_every=2**40)


def assert_same(batch: hs.Batch, lane: int, single: hs.Simulation) -> None:
    np.testing.assert_array_equal(batch.position[lane], single.state.q)
    np.testing.assert_array_equal(batch.velocity[lane], single.state.v)
    np.testing.assert_array_equal(batch.contact_force[lane], single.contacts.force)
    assert batch.time[lane] == single.time


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize(
    "method", [hs.TimeStepping(step=2e-3), hs.EventDriven(rtol=1e-6)], ids=lambda m: m.name
)
def test_lanes_are_simulations_to_the_last_bit(method: Method, threads: int) -> None:
    arguments = everything()
    batch = hs.Batch(**arguments, method=method, threads=threads, stop_when_fallen=False)
    singles = [alone(arguments, i, method=method, stop_when_fallen=False) for i in range(LANES)]
    rng = np.random.default_rng(1)
    for _ in range(8):
        batch.command[:] = rng.uniform(-40.0, 40.0, batch.command.shape)
        batch.step(3)
        for lane, single in enumerate(singles):
            single.parameters.torque[:] = batch.command[lane]  # type: ignore[attr-defined]
            for _ in range(3):
                single.step()
            assert_same(batch, lane, single)
    assert batch.going.all()
    assert (batch.complementarity < 1e-9).all()
    # Some start again, on the ground and with the pushes that they have; the others go on.
    mask = np.arange(LANES) % 2 == 0
    batch.reset(mask)
    for lane in np.flatnonzero(mask).tolist():
        singles[lane] = alone(arguments, lane, method=method, stop_when_fallen=False)
        singles[lane].parameters.torque[:] = batch.command[lane]  # type: ignore[attr-defined]
    batch.advance(batch.time + 0.01)
    for lane, single in enumerate(singles):
        single.advance(single.time + 0.01)
        assert_same(batch, lane, single)
        # Its record tells of this instant, too, from which the batch has not moved on yet.
        kinds = [each.kind for each in single.record.events if each.time <= single.time]
        assert batch.events[lane, EventKind.TOUCHDOWN] == kinds.count(EventKind.TOUCHDOWN)


def test_a_lane_that_ends_stops_alone_and_begins_anew() -> None:
    robot, start = walking.bravo7(), walking.bravo7().reference_state()
    bent = hs.State(start.q, start.v)
    bent.v[2] = 8.0  # it turns over
    batch = hs.Batch(robot, hs.HeldTorque(robot), state=[start, bent, start])
    batch.step(800)
    single = hs.Simulation(robot, hs.HeldTorque(robot), state=bent)
    single.advance(0.8)
    assert single.status is RunStatus.FELL
    assert batch.status[1] is RunStatus.FELL
    assert (batch.message(1), batch.time[1]) == (single.message, single.time)
    assert batch.going.tolist() == [True, False, True] or batch.time[1] < batch.time[0]
    ended = batch.time[1]
    batch.step()
    assert batch.time[1] == ended
    batch.reset(np.array([False, True, False]), start)
    assert batch.going[1]
    assert batch.time[1] == 0.0
    batch.step(5)
    fresh = hs.Simulation(robot, hs.HeldTorque(robot), state=start)
    fresh.advance(0.005)
    assert_same(batch, 1, fresh)


def test_arrays_are_views_of_what_moves_and_can_only_be_looked_at() -> None:
    robot = walking.bravo7()
    batch = hs.Batch(robot, hs.HeldTorque(robot), state=robot.reference_state(), lanes=2)
    position, force = batch.position, batch.contact_force
    before = position.copy()
    batch.command[0] = 30.0
    batch.step(20)
    assert not np.array_equal(position, before)
    assert force.shape == (2, robot.nc, 2)
    assert batch.steps.tolist() == [20, 20]
    for name in ("position", "velocity", "time", "torque", "gap", "contact_force", "steps"):
        assert not getattr(batch, name).flags.writeable
    assert batch.lane(0).state.q.tolist() == position[0].tolist()
    assert not np.array_equal(position[0], position[1])


class Gain(hs.Bundle):
    gain: float = hs.number(float)


@hs.controller
def spring(state: ControlState, parameters: Gain, torque: Floats) -> None:
    if state.joint_position[0] > 0.4:
        torque[100] = 1.0  # beyond: ends this lane only
    for i in range(torque.shape[0]):
        torque[i] = -parameters.gain * state.joint_position[i]


def test_each_lane_has_parameters_of_its_own_and_errors_end_one() -> None:
    robot, start = walking.bravo7(), walking.bravo7().reference_state()
    far = hs.State(start.q, start.v)
    far.q[robot.model.actuator_joint[0]] = 0.5
    gains = np.array([100.0, 50.0, 50.0])
    batch = hs.Batch(
        robot, spring(Gain(gain=0.0)), state=[start, start, far], parameters={"gain": gains},
        stop_when_fallen=False, on_error="stop",
    )  # fmt: skip
    batch.step(30)
    assert batch.status[2] is RunStatus.CONTROLLER_FAILED
    assert "IndexError" in batch.message(2)
    for lane in (0, 1):
        single = hs.Simulation(
            robot, spring(Gain(gain=gains[lane])), state=start, stop_when_fallen=False
        )
        single.advance(0.03)
        assert_same(batch, lane, single)


def test_lanes_can_be_taken_in_hand_laid_anew_and_kept() -> None:
    robot, start = walking.bravo7(), walking.bravo7().reference_state()
    batch = hs.Batch(robot, hs.HeldTorque(robot), state=start, lanes=3, stop_when_fallen=False)
    batch.step(10)
    kept = batch.snapshot()
    batch.command[:] = 10.0
    push = hs.Push("trunk", force=(100.0, 0.0), start=0.01, duration=0.01)
    batch.lane(1).apply(push)
    batch.step(20)
    single = hs.Simulation(
        robot, hs.HeldTorque(robot), state=start, stop_when_fallen=False, record_every=2**62
    )
    single.advance(0.01)
    single.parameters.torque[:] = 10.0  # type: ignore[attr-defined]
    single.apply(push)
    single.advance(0.03)
    assert_same(batch, 1, single)
    assert not np.array_equal(batch.position[1], batch.position[0])

    moved = batch.position.copy()
    batch.restore(kept)
    assert batch.time.tolist() == [0.01] * 3
    assert batch.command.tolist() == [[0.0] * 6] * 3
    batch.command[:] = 10.0
    batch.step(20)
    np.testing.assert_array_equal(batch.position[0], moved[0])

    other = heavier(1.5)
    batch.lay(2, robot=other, ground=hs.Ground(friction=0.2), controller=hs.HeldTorque(other, 3.0))
    assert batch.time[2] == 0.0
    batch.step(15)
    single = hs.Simulation(
        other, hs.HeldTorque(other, 3.0), state=start, ground=hs.Ground(friction=0.2),
        stop_when_fallen=False,
    )  # fmt: skip
    single.advance(0.015)
    assert_same(batch, 2, single)


def test_refusals() -> None:
    robot, start = walking.bravo7(), walking.bravo7().reference_state()
    batch = hs.Batch(robot, state=start, lanes=2)
    with pytest.raises(TypeError, match="snapshot"):
        pickle.dumps(batch)
    for steps in (0, 1.5, "2"):
        with pytest.raises(hs.SimulationError, match="steps"):
            batch.step(steps)  # type: ignore[arg-type]
    with pytest.raises(hs.SimulationError, match=r"\(2,\) bool"):
        batch.reset(np.array([1, 0]))
    wrong = hs.State(np.full(9, np.nan), start.v)
    with pytest.raises(hs.SimulationError, match="lane 1 is not finite"):
        batch.reset(np.array([False, True]), wrong)
    with pytest.raises(hs.SimulationError, match="shape"):
        batch.reset(None, hs.State(np.zeros(8), np.zeros(9)))
    with pytest.raises(hs.SimulationError, match="finite"):
        batch.advance(np.inf)
    with pytest.raises(hs.SimulationError, match="run 1: ground must be"):
        batch.lay(1, ground=0.5)  # type: ignore[arg-type]
    with pytest.raises(hs.SimulationError, match="as many snapshots"):
        batch.restore(batch.snapshot()[:1])
    with pytest.raises(hs.SimulationError, match="lanes is 3"):
        hs.Batch(robot, state=[start, start], lanes=3)
    with pytest.raises(hs.SimulationError, match="another controller"):
        batch.lane(0).controller = hs.HeldTorque(robot)
    with pytest.raises(IndexError, match="no lane 2"):
        batch.lane(2)
