"""simulate_batch(): the same runs to the last bit, however many threads; clear refusals."""

from __future__ import annotations

import dataclasses
import tracemalloc
import weakref
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control import ControlState
from heelstrike.robot.model import Floats, Model
from heelstrike.sim import BatchResult, Contacts, RunStatus
from heelstrike.sim.closed_sets import EventKind, Scheme
from heelstrike.sim.method import Method
from heelstrike.sim.setting import Setting

ROWS = ("time", "position", "velocity", "torque", "contact_force", "gap", "slip_velocity")
RUNS = 8


def controller() -> hs.ComputedTorque:
    return hs.ComputedTorque(walking.bravo7(), walking.gait())


def heavier(factor: float) -> hs.Robot:
    robot = walking.bravo7()
    model = robot.model.replaced(mass=factor * robot.model.mass)
    return dataclasses.replace(robot, model=model)


def everything() -> dict[str, list[Any]]:
    """Arguments that differ from run to run in every way there is."""
    rng = np.random.default_rng(1)
    start = walking.gait().initial_state
    state = []
    for _ in range(RUNS):
        # Small turns of the joints lift the sole off the ground instead of into it.
        v = start.v + 0.02 * rng.standard_normal(9)
        state.append(hs.State(start.q + np.eye(9)[1] * 1e-3, v))
    gains = rng.uniform(300.0, 500.0, RUNS)
    return {
        "robot": [heavier(f) for f in rng.uniform(0.9, 1.1, RUNS)],
        "controller": [
            hs.ComputedTorque(walking.bravo7(), walking.gait(), kp=kp, kd=0.1 * kp) for kp in gains
        ],
        "state": state,
        "duration": list(rng.uniform(0.2, 0.9, RUNS).round(3)),
        "ground": [hs.Ground(friction=mu) for mu in rng.uniform(0.5, 1.0, RUNS)],
        "pushes": [
            [hs.Push("trunk", force=(f, 0.0), start=0.1, duration=0.05)] * (i % 3)
            for i, f in enumerate(rng.uniform(-60.0, 60.0, RUNS))
        ],
    }


@pytest.mark.parametrize(
    "method",
    [
        hs.TimeStepping(step=1e-3),
        pytest.param(hs.EventDriven(rtol=1e-6), marks=pytest.mark.slow),
        pytest.param(hs.Compliant(), marks=pytest.mark.slow),
    ],
    ids=lambda method: type(method).__name__,
)
def test_runs_are_those_of_simulate_to_the_last_bit(method: Method) -> None:
    arguments = everything()
    batches = [
        hs.simulate_batch(**arguments, method=method, record_every=2, threads=threads)  # type: ignore[arg-type]
        for threads in (1, 2, 5)
    ]
    brief = hs.simulate_batch(**arguments, method=method, threads=3)  # type: ignore[arg-type]
    for i in range(RUNS):
        alone = hs.simulate(
            **{name: values[i] for name, values in arguments.items()},
            method=method,
            record_every=2,
        )
        for batch in batches:
            run = batch.run(i)
            for name in ROWS:
                np.testing.assert_array_equal(getattr(run, name), getattr(alone, name), name)
            assert run.events == alone.events
            assert run.certificates == alone.certificates
            assert run.solver == alone.solver
            assert (batch.status[i], batch.message[i]) == (alone.status, alone.message)
            np.testing.assert_array_equal(batch.position[i], alone.position[-1])
            np.testing.assert_array_equal(batch.velocity[i], alone.velocity[-1])
            assert batch.steps[i] == alone.steps
            assert batch.events[i].sum() == len(alone.events)
            assert batch.complementarity[i] == alone.certificates.complementarity
        # Event-driven rows are solved in passing, with the memory of the contact solver: between
        # runs with other rows the last digit may differ.
        unrecorded = hs.simulate(
            **{name: values[i] for name, values in arguments.items()},
            method=method,
            record_every=2**62,
        )
        np.testing.assert_array_equal(brief.position[i], unrecorded.position[-1])
        np.testing.assert_array_equal(brief.velocity[i], unrecorded.velocity[-1])
        if isinstance(method, hs.TimeStepping):
            np.testing.assert_array_equal(brief.position[i], alone.position[-1])
        assert brief.time[i] == batches[0].time[i]
        assert brief.steps[i] == alone.steps
        assert brief.events[i].sum() == len(alone.events)


def test_one_entry_serves_all_runs() -> None:
    start = walking.gait().initial_state
    speeds = start.v + np.linspace(0.0, 0.05, 4)[:, None] * np.eye(9)[0]
    batch = hs.simulate_batch(
        walking.bravo7(), controller(), state=hs.State(start.q, speeds), duration=0.3
    )
    assert len(batch) == 4
    assert np.all(batch.completed)
    assert batch.position.shape == (4, 9)
    assert batch.events.shape == (4, len(EventKind))
    for speed, position in zip(speeds, batch.position, strict=True):
        run = hs.simulate(
            walking.bravo7(), controller(), state=hs.State(start.q, speed), duration=0.3
        )
        np.testing.assert_array_equal(position, run.position[-1])


class Gains(hs.Bundle):
    kp: float = hs.number(float)
    kd: float = hs.number(float)


class Calls(hs.Bundle):
    number: int = hs.cell(int)


@hs.controller
def spring(state: ControlState, parameters: Gains, memory: Calls, torque: Floats) -> None:
    """A user's own controller: springs and dampers on the joints, which it counts the calls of."""
    memory.number += 1
    for i in range(torque.shape[0]):
        torque[i] = -parameters.kp * state.joint_position[i]
        torque[i] -= parameters.kd * state.joint_velocity[i]


class PlainSpring:
    """The same in Python."""

    def torque(self, t: float, state: hs.State, contacts: Contacts) -> Floats:
        return -300.0 * state.q[3:] - 10.0 * state.v[3:]


def test_a_users_compiled_controller_joins_the_loop_and_its_numbers_vary() -> None:
    robot = walking.bravo7()
    start = robot.reference_state()
    gains = [Gains(kp=300.0, kd=10.0), Gains(kp=200.0, kd=5.0), Gains(kp=100.0, kd=1.0)]
    own = spring(gains[0])
    named = {"kp": [300.0, 200.0, 100.0], "kd": [10.0, 5.0, 1.0]}
    batch, same = (
        hs.simulate_batch(robot, own, state=start, duration=0.5, parameters=parameters)
        for parameters in (gains, named)
    )
    np.testing.assert_array_equal(same.position, batch.position)
    for each, position in zip(gains, batch.position, strict=True):
        alone = hs.simulate(robot, spring(each), state=start, duration=0.5)
        np.testing.assert_array_equal(position, alone.position[-1])
    python = hs.simulate(robot, PlainSpring(), state=start, duration=0.5)
    np.testing.assert_allclose(batch.position[0], python.position[-1], atol=1e-12)


def test_a_run_that_fails_leaves_the_others_alone() -> None:
    robot = walking.bravo7()
    start = walking.gait().initial_state
    wild = hs.State(start.q, start.v + 1e5)
    batch = hs.simulate_batch(
        robot, controller(), state=[start, wild, start], duration=0.1, stop_when_fallen=False
    )
    assert batch.status[0] is batch.status[2] is RunStatus.COMPLETED
    assert batch.status[1] in (RunStatus.DIVERGED, RunStatus.CONTROLLER_FAILED)
    np.testing.assert_array_equal(batch.position[0], batch.position[2])
    assert list(batch.completed) == [True, False, True]
    assert "2 completed" in str(batch)


def test_memory_does_not_grow_with_the_duration() -> None:
    """A run ten times as long, unrecorded, takes no more memory: rows would take 10 MB."""

    def peak(duration: float) -> int:
        tracemalloc.start()
        hs.simulate_batch(
            walking.bravo7(), controller(), state=walking.gait().initial_state, duration=duration
        )
        highest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return highest

    peak(0.7)
    assert peak(14.0) <= 1.2 * peak(1.4)


def test_ctrl_c_returns_what_there_is() -> None:
    def interrupt(done: int, total: int) -> None:
        if done >= 1:
            raise KeyboardInterrupt

    start = walking.gait().initial_state
    durations = np.full(40, 7.0)
    durations[0] = 0.01
    batch = hs.simulate_batch(
        walking.bravo7(), controller(), state=start, duration=durations, threads=2,
        progress=interrupt, record_every=1000,
    )  # fmt: skip
    assert batch.status[0] is RunStatus.COMPLETED
    assert batch.status[-1] is RunStatus.INTERRUPTED
    np.testing.assert_array_equal(batch.position[-1], start.q)
    assert batch.time[-1] == 0.0
    with pytest.raises(hs.SimulationError, match="before run 39 began"):
        batch.run(39)


def test_progress_that_raises_ends_all_runs_and_they_say_so() -> None:
    def progress(done: int, total: int) -> None:
        if done >= 1:
            raise OSError("the terminal is gone")

    durations = np.full(40, 7.0)
    durations[0] = 0.01
    batch = hs.simulate_batch(
        walking.bravo7(), controller(), state=walking.gait().initial_state, duration=durations,
        threads=2, progress=progress,
    )  # fmt: skip
    assert batch.status[0] is RunStatus.COMPLETED
    assert batch.status[-1] is RunStatus.INTERRUPTED
    assert "progress raised OSError: the terminal is gone" in batch.message[-1]


def test_progress_that_raises_when_all_is_done_is_only_told() -> None:
    def progress(done: int, total: int) -> None:
        if done == total:
            raise OSError("the terminal is gone")

    with pytest.warns(UserWarning, match="the terminal is gone"):
        batch = hs.simulate_batch(
            walking.bravo7(), controller(), state=walking.gait().initial_state, duration=0.01,
            progress=progress,
        )  # fmt: skip
    assert batch.completed.all()


class Fault(hs.Bundle):
    place: int = hs.number(int)
    time: float = hs.number(float)


@hs.controller
def failing(t: float, parameters: Fault, torque: Floats) -> None:
    """A controller of which some raise, and some write beyond their arrays."""
    if t >= parameters.time:
        torque[parameters.place] = 1.0


def test_a_controller_that_fails_ends_its_own_run_only() -> None:
    faults = {"place": [0, 7, 0, 7], "time": [0.05, 0.05, 0.05, 0.02]}
    batch = hs.simulate_batch(
        walking.bravo7(),
        failing(Fault(place=0, time=0.0)),
        state=walking.gait().initial_state,
        duration=0.1,
        parameters=faults,
        threads=1,
    )
    failed = RunStatus.CONTROLLER_FAILED
    assert batch.status == (RunStatus.COMPLETED, failed, RunStatus.COMPLETED, failed)
    assert "'failing' raised IndexError" in batch.message[1]
    np.testing.assert_allclose(batch.time, [0.1, 0.05, 0.1, 0.02])
    np.testing.assert_array_equal(batch.position[0], batch.position[2])


def test_progress_counts_and_a_pipe_stays_quiet(capfd: pytest.CaptureFixture[str]) -> None:
    seen = []
    start = walking.gait().initial_state
    hs.simulate_batch(
        walking.bravo7(), controller(), state=[start] * 5, duration=0.01,
        progress=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert seen[-1] == (5, 5)
    hs.simulate_batch(walking.bravo7(), controller(), state=[start] * 5, duration=0.01)
    assert capfd.readouterr() == ("", "")


PLASTIC = hs.TimeStepping(scheme=Scheme.GAP_LINEARISED)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"ground": [hs.Ground()] * 3, "duration": [0.1] * 4}, "duration for 4, ground for 3"),
        ({"duration": []}, "duration"),
        ({"duration": [[0.1]]}, "duration must be one number"),
        ({"duration": [0.1, -1.0]}, "run 1: duration"),
        ({"state": hs.State(np.zeros((2, 9)), np.zeros((3, 9)))}, "2 runs and state.v for 3"),
        ({"state": hs.State(np.zeros((2, 8)), np.zeros((2, 9)))}, "run 0: state.q must have 9"),
        ({"state": 3.0}, "State"),
        ({"parameters": np.zeros((2, 2, 2))}, "parameters"),
        ({"parameters": {"kp": np.zeros((2, 3))}}, "k[pd] has shape"),
        ({"parameters": {"gain": np.zeros(2)}}, "has no gain"),
        ({"parameters": {"kp": np.zeros((2, 6)), "kd": np.zeros((3, 6))}}, "one entry a run"),
        ({"parameters": {"latest": [1.0, np.nan]}}, "latest must be finite"),
        ({"pushes": [hs.Push(0, force=(1, 0), start=0, duration=1), []]}, "mixes"),
        ({"pushes": 3.0}, "Push"),
        ({"record_every": 0}, "record_every"),
        ({"threads": 0}, "threads"),
        ({"ground": [hs.Ground(), hs.Ground(restitution=0.5)], "method": PLASTIC}, "restitution"),
        ({"robot": []}, "robot is empty"),
        ({"robot": ["bravo7"]}, "robot must be"),
        ({"method": "fast"}, "simulation method"),
    ],
)
def test_arguments_are_checked_before_anything_runs(options: dict[str, Any], words: str) -> None:
    arguments: dict[str, Any] = {
        "robot": walking.bravo7(),
        "controller": controller(),
        "state": walking.gait().initial_state,
        "duration": 0.1,
    }
    with pytest.raises(hs.SimulationError, match=words):
        hs.simulate_batch(**arguments | options)


def test_robots_must_be_built_alike() -> None:
    robots = [walking.bravo7(), hs.load_robot("walker2d"), hs.load_robot("rabbit")]
    state = robots[0].reference_state()
    with pytest.raises(hs.SimulationError, match="robot 2 has 7 coordinates, the first has 9"):
        hs.simulate_batch(robots, state=state, duration=0.1)


def test_python_controllers_are_sent_to_simulate() -> None:
    with pytest.raises(hs.ControllerError, match="a function"):
        hs.simulate_batch(
            walking.bravo7(), PlainSpring(), state=walking.gait().initial_state, duration=0.1
        )
    with pytest.raises(hs.ControllerError, match="torque"):
        hs.simulate_batch(
            walking.bravo7(),
            object(),
            state=walking.gait().initial_state,
            duration=0.1,  # type: ignore[arg-type]
        )


def test_a_batch_without_records_says_how_to_have_them() -> None:
    batch = hs.simulate_batch(
        walking.bravo7(), controller(), state=walking.gait().initial_state, duration=0.01
    )
    with pytest.raises(hs.SimulationError, match="record_every"):
        batch.run(0)
    with pytest.raises(IndexError):
        batch.run(1)


@pytest.mark.parametrize("threads", [1, 2])
def test_robots_of_one_size_and_another_structure(threads: int) -> None:
    """Numbers that are 0 or 1 are so in the code; dry joints are contacts that others lack."""
    robot = hs.load_robot("compass_gait")

    def other(leg: float, dry: float) -> hs.Robot:
        model: Model = robot.model.replaced(
            mass=np.array([0.0, 10.0, leg, leg]),
            dry_friction=np.array([0.0, 0.0, 0.0, dry]),
        )
        return dataclasses.replace(robot, model=model)

    robots = [other(1.0, 0.0), other(5.0, 0.0), other(5.0, 2.0), other(5.0, 0.0)]
    state = robot.state(velocity={3: 1.0, 0: 0.5})
    batch = hs.simulate_batch(robots, state=state, duration=0.05, threads=threads)
    for i, each in enumerate(robots):
        alone = hs.simulate(each, state=state, duration=0.05)
        np.testing.assert_array_equal(batch.position[i], alone.position[-1])
        np.testing.assert_array_equal(batch.velocity[i], alone.velocity[-1])


class Careful(hs.TimeStepping):
    def check(self, setting: Setting) -> None:
        if setting.state.q[0] > 1.0:
            raise hs.SimulationError("too far")


def test_what_only_the_method_refuses_comes_before_the_first_run() -> None:
    start, seen = walking.gait().initial_state, []
    with pytest.raises(hs.SimulationError, match="run 2: too far"):
        hs.simulate_batch(
            walking.bravo7(),
            controller(),
            state=hs.State(start.q + np.outer([0.0, 0.5, 2.0], np.eye(9)[0]), start.v),
            duration=0.01,
            method=Careful(),
            progress=lambda done, total: seen.append(done),
        )
    assert not seen


def test_runs_are_let_go_when_they_are_finished(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, alive = [], []

    def watched(simulation: hs.Simulation, *arguments: Any, **options: Any) -> None:
        begun.append(weakref.ref(simulation))
        begin(simulation, *arguments, **options)

    def count(done: int, total: int) -> None:
        if done == total:
            alive[:] = [simulation for simulation in begun if simulation() is not None]

    begin = hs.Simulation._begin
    monkeypatch.setattr(hs.Simulation, "_begin", watched)
    start = walking.gait().initial_state
    hs.simulate_batch(
        walking.bravo7(), controller(), state=[start] * 3, duration=0.01, progress=count,
        record_every=1,
    )  # fmt: skip
    assert len(begun) == 3
    assert not alive


def test_a_run_that_never_began_is_no_run() -> None:
    """What an interrupted batch has of it; see the test of the interruption for the rest."""
    nothing: dict[str, Any] = {field.name: np.zeros(2) for field in dataclasses.fields(BatchResult)}
    status = (RunStatus.INTERRUPTED, RunStatus.INTERRUPTED)
    batch = BatchResult(**nothing | {"status": status, "_runs": (None, None)})
    assert not batch.completed.any()
    with pytest.raises(hs.SimulationError, match="interrupted before run 1 began"):
        batch.run(1)
    with pytest.raises(IndexError, match="no run 2"):
        batch.run(2)
