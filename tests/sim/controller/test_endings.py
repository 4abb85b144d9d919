"""Laws that end their run: with a status, a reason, and the last instant recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control import RandomNumbers, controlled_robot
from heelstrike.sim import RunStatus
from heelstrike.sim.method import Method

METHODS = [hs.TimeStepping(), hs.EventDriven(max_step=1e-3), hs.Compliant()]


class When(hs.Bundle):
    """When it ends the run (s), and for which of its reasons; how much noise it makes (N m)."""

    time: float = hs.number(float)
    ending: int = hs.number(int)
    tried: int = hs.number(int)
    noise: float = hs.number(float)


class Memory(hs.Bundle):
    """What it draws from."""

    random: RandomNumbers = hs.part(RandomNumbers)


class Told(hs.Bundle):
    """When it was called."""

    called: float = hs.cell(float)


@hs.controller(endings=("stood long enough", "leaned too far"))
def patient(t, state, robot, parameters: When, memory: Memory, log: Told, torque):  # type: ignore[no-untyped-def]
    """Brake the joints with some noise, and end the run when it is time."""
    log.called = t
    for i in range(robot.nu):
        torque[i] = t - state.joint_velocity[i]
        if parameters.noise > 0.0:
            torque[i] += parameters.noise * memory.random.normal()
    if t >= parameters.time or (parameters.tried == 1 and robot.trial == 1):
        robot.stop(parameters.ending)


def law(
    time: float = 0.02, ending: int = 1, tried: int = 0, noise: float = 0.0, **more: Any
) -> Any:
    return patient(When(time=time, ending=ending, tried=tried, noise=noise), **more)


class Watching:
    """An object that ends the run."""

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        if t >= 0.02 - 1e-9:
            raise hs.EndOfRun("leaned too far")
        return -state.v[3:] + t


def run_of(controller: Any, *, duration: float = 0.05, **options: Any) -> hs.Run:
    options = {"state": walking.gait().initial_state} | options
    return hs.simulate(walking.bravo7(), controller, duration=duration, **options)


def in_python() -> Any:
    return hs.controller(compile=False, endings=patient.endings)(patient.python)(law().parameters)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_law_ends_its_run(method: Method) -> None:
    run = run_of(law(), method=method, control_period=1e-3)
    assert run.status is RunStatus.STOPPED
    assert run.message == "the controller ended the run at t = 0.02 s: leaned too far"
    assert run.error is None
    assert run.time[-1] == pytest.approx(0.02, abs=1e-12)
    if isinstance(method, hs.TimeStepping):  # others write their rows as a step ends
        assert run.log["called"].values[-1] == run.time[-1]
        np.testing.assert_allclose(run.torque[-1], run.time[-1] - run.velocity[-1, 3:], atol=1e-9)
    rare = run_of(law(), method=method, control_period=1e-3, record_every=7)
    assert rare.time[-1] == run.time[-1]
    assert len(rare.time) < len(run.time)
    for other in (
        run_of(law(), method=method, control_period=1e-3, checked=True),
        run_of(in_python(), method=method, control_period=1e-3),
        run_of(Watching(), method=method, control_period=1e-3),
    ):
        assert (other.status, other.message) == (run.status, run.message)
        np.testing.assert_allclose(other.position, run.position, atol=1e-9)


@pytest.mark.parametrize("method", METHODS[1:], ids=lambda method: type(method).__name__)
def test_what_is_tried_within_a_step_ends_nothing(method: Method) -> None:
    assert run_of(law(time=1.0, tried=1), method=method, duration=0.01).completed
    stopped = run_of(law(time=0.0055), method=method, duration=0.01)
    assert stopped.status is RunStatus.STOPPED
    assert 0.0055 <= stopped.time[-1] <= 0.0075


@pytest.mark.slow
def test_shells_hand_it_on() -> None:
    for controller in (law(period=1e-3), Watching()):
        run = run_of(hs.Actuated(hs.Sensed(controller)))
        assert run.status is RunStatus.STOPPED
        assert run.message.endswith("at t = 0.02 s: leaned too far")


def test_an_ending_without_words_has_a_number() -> None:
    assert run_of(law(ending=7)).message.endswith("at t = 0.02 s: ending 7")
    assert run_of(law(ending=-1)).completed


def test_each_run_of_a_batch_ends_by_itself() -> None:
    batch = hs.simulate_batch(
        walking.bravo7(), law(), parameters={"time": [1.0, 0.02, 0.03], "ending": [0, 1, 0]},
        state=walking.gait().initial_state, duration=0.05, threads=2,
    )  # fmt: skip
    stopped = RunStatus.STOPPED
    assert batch.status == (RunStatus.COMPLETED, stopped, stopped)
    assert batch.message[2].endswith("at t = 0.03 s: stood long enough")
    np.testing.assert_allclose(batch.time, [0.05, 0.02, 0.03])
    assert str(batch) == "3 runs: 1 completed, 2 stopped"


def test_it_is_saved_and_can_be_taken_back(tmp_path: Any) -> None:
    start = walking.gait().initial_state
    simulation = hs.Simulation(walking.bravo7(), law(), state=start)
    simulation.advance(0.01)
    before = simulation.snapshot()
    for _ in range(2):
        assert simulation.advance(0.05) is RunStatus.STOPPED
        assert simulation.time == pytest.approx(0.02)
        with pytest.raises(hs.SimulationError, match="leaned too far"):
            simulation.step()
        simulation.restore(before)
        assert simulation.advance(0.015) is RunStatus.COMPLETED
        assert simulation.record.completed  # whose last call is forgotten
    run = run_of(law())
    run.save(tmp_path / "run.nc")
    loaded = hs.load_run(tmp_path / "run.nc")
    assert (loaded.status, loaded.message) == (run.status, run.message)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_what_its_law_has_ended_goes_on_from_its_end(method: Method) -> None:
    run = run_of(law(), method=method, control_period=1e-3)
    simulation = hs.Simulation(
        walking.bravo7(), law(), state=run.final, method=method, control_period=1e-3
    )
    simulation.parameters.time = 1.0
    assert simulation.advance(0.03) is RunStatus.COMPLETED
    assert simulation.time == pytest.approx(0.03, abs=1e-12)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_its_last_instant_is_not_decided_twice(method: Method) -> None:
    """Noise that a law draws tells how often it was called."""
    start: dict[str, Any] = {"method": method, "control_period": 1e-3}
    whole = run_of(law(time=1.0, noise=1.0), duration=0.03, **start)
    ended = run_of(law(noise=1.0), **start)
    simulation = hs.Simulation(walking.bravo7(), law(noise=1.0), state=ended.final, **start)
    simulation.parameters.time = 1.0
    assert simulation.advance(simulation.time) is RunStatus.COMPLETED
    for _ in range(2):  # a look at the last instant is forgotten
        assert set(simulation.record.time) <= {ended.time[-1]}
    simulation.advance(0.03)
    rest = simulation.record
    assert rest.time[0] > ended.time[-1]
    np.testing.assert_array_equal(rest.position, whole.position[whole.time > ended.time[-1]])


def test_a_view_of_the_robot_ends_the_run_of_a_controller_in_python() -> None:
    class Asking:
        def __init__(self) -> None:
            self.robot = controlled_robot(walking.bravo7())

        def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
            if t >= 0.02 - 1e-9:
                self.robot.stop(2)
            return np.zeros(6)

    run = run_of(Asking())
    assert run.status is RunStatus.STOPPED
    assert run.message == "the controller ended the run at t = 0.02 s: ending 2"


def test_a_look_at_the_record_does_not_end_it() -> None:
    simulation = hs.Simulation(walking.bravo7(), law(), state=walking.gait().initial_state)
    simulation.advance(0.02)
    assert simulation.record.status is RunStatus.STOPPED
    assert simulation.status is RunStatus.COMPLETED
    simulation.parameters.time = 1.0
    assert simulation.advance(0.03) is RunStatus.COMPLETED


def test_random_numbers_are_kept_with_the_memory() -> None:
    noisy = law(time=1.0, noise=1.0)
    whole = run_of(noisy, duration=0.02)
    half = run_of(noisy, duration=0.01)
    rest = run_of(noisy, duration=0.01, state=half.final)
    np.testing.assert_array_equal(rest.torque, whole.torque[-len(rest.torque) :])
    python = run_of(noisy, duration=0.02, checked=True)
    np.testing.assert_allclose(python.torque, whole.torque, atol=1e-9)
    assert np.std(whole.torque - run_of(law(time=1.0), duration=0.02).torque) > 0.5


def test_seeds_tell_random_numbers_apart() -> None:
    seeds = [
        {},
        {"random": RandomNumbers.seeded(0)},
        {"random": RandomNumbers.seeded(1)},
    ]
    torques = [
        run_of(law(time=1.0, noise=1.0, memory=memory), duration=0.005).torque for memory in seeds
    ]
    np.testing.assert_array_equal(torques[0], torques[1])
    assert np.abs(torques[2] - torques[0]).min() > 0.0
    drawn = RandomNumbers.seeded(3)
    numbers = np.array([drawn.uniform() for _ in range(2000)])
    assert 0.0 < numbers.min() < 0.01
    assert 0.99 < numbers.max() < 1.0
    assert abs(numbers.mean() - 0.5) < 0.02
    with pytest.raises(hs.ControllerError, match="a seed is a whole number"):
        RandomNumbers.seeded(-1)
