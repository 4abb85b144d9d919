"""What becomes of an error in a controller: told with its traceback, raised, or left in the run."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.sim import OnError, RunStatus
from heelstrike.sim.method import Method
from heelstrike.view.live.live_simulation import LiveSimulation

METHODS = [hs.TimeStepping(), hs.EventDriven(max_step=1e-3), hs.Compliant()]
Action = Callable[[], Any]


class Acting:
    """A controller that brakes the joints, and at one of its calls does something else."""

    def __init__(self, action: Action, at: int) -> None:
        self.action, self.at, self.calls = action, at, 0

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        self.calls += 1
        if self.calls == self.at:
            return self.action()
        return -state.v[3:]


def out_of_power() -> Any:
    raise RuntimeError("battery empty")


class Fault(hs.Bundle):
    """When it raises (s)."""

    after: float = hs.number(float)


@hs.controller
def raising(t, state, parameters: Fault, torque):  # type: ignore[no-untyped-def]
    """Brake the joints, and raise when it is time."""
    for i in range(torque.shape[0]):
        torque[i] = -state.joint_velocity[i]
    if t >= parameters.after:
        raise ValueError("law without power")


def run_of(controller: Any, *, duration: float = 0.05, **options: Any) -> hs.Run:
    robot = walking.bravo7()
    start = walking.gait().initial_state
    return hs.simulate(robot, controller, state=start, duration=duration, **options)


def faulty(after: float = 0.02, **options: Any) -> Any:
    return raising(Fault(after=after), **options)


CONTROLLERS: dict[str, Callable[[], tuple[Any, dict[str, Any]]]] = {
    "object": lambda: (Acting(out_of_power, 21), {}),
    "object, at once": lambda: (Acting(out_of_power, 1), {}),
    "sensed object": lambda: (hs.Sensed(Acting(out_of_power, 21), period=1e-3), {}),
    "actuated object": lambda: (hs.Actuated(Acting(out_of_power, 21), period=1e-3), {}),
    "compiled": lambda: (faulty(), {}),
    "compiled, at once": lambda: (faulty(0.0), {}),
    "checked": lambda: (faulty(), {"checked": True}),
    "in Python": lambda: (hs.controller(compile=False)(raising.python)(Fault(after=0.02)), {}),
}


@pytest.mark.parametrize("name", CONTROLLERS)
def test_an_error_is_told_with_the_traceback_of_the_controller(name: str) -> None:
    controller, options = CONTROLLERS[name]()
    with pytest.warns(hs.ControllerWarning) as told:
        run = run_of(controller, **options)
    assert run.status is RunStatus.CONTROLLER_FAILED
    assert run.error is not None
    (warning,) = told
    words = str(warning.message)
    assert words.startswith(run.message)
    assert warning.filename == __file__
    error, line = (
        ("RuntimeError", "out_of_power") if "object" in name else ("ValueError", "raising")
    )
    assert f"in {line}\n    raise {error}(" in words, words
    assert words.count("Traceback") == 1, words
    assert "simulation.py" not in words, words


def test_a_package_whose_name_begins_likewise_is_another() -> None:
    file = str(Path(hs.__file__).parent) + "_laws.py"
    theirs: dict[str, Any] = {"simulate": hs.simulate}
    text = "def run(*given, **options):\n    return simulate(*given, **options)"
    exec(compile(text, file, "exec"), theirs)
    with pytest.warns(hs.ControllerWarning) as told:
        theirs["run"](
            walking.bravo7(), Acting(out_of_power, 2), state=walking.gait().initial_state,
            duration=0.01,
        )  # fmt: skip
    assert told[0].filename == file


@pytest.mark.parametrize("name", CONTROLLERS)
def test_what_is_recorded_does_not_hang_on_who_is_told(name: str) -> None:
    runs = []
    for on_error in (OnError.WARN, "stop"):
        controller, options = CONTROLLERS[name]()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore" if on_error is OnError.WARN else "error")
            runs.append(run_of(controller, on_error=on_error, **options))
    one, other = runs
    assert one.message == other.message
    assert one.status is other.status is RunStatus.CONTROLLER_FAILED
    np.testing.assert_array_equal(one.position, other.position)
    assert len(one.time) == (0 if "at once" in name else 20)

    controller, options = CONTROLLERS[name]()
    with pytest.raises((RuntimeError, ValueError), match=r"power|battery") as raised:
        run_of(controller, on_error="raise", **options)
    assert one.message in raised.value.__notes__


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_it_is_told_under_every_method(method: Method) -> None:
    for controller in (Acting(out_of_power, 5), faulty()):
        with pytest.warns(hs.ControllerWarning, match=r"power|battery"):
            assert run_of(controller, method=method).status is RunStatus.CONTROLLER_FAILED


def test_it_is_told_each_time() -> None:
    """Python shows a warning of one line once; a cell of a notebook is run again."""
    with warnings.catch_warnings(record=True) as told:
        warnings.resetwarnings()
        for _ in range(2):
            run_of(Acting(out_of_power, 1))
    assert len(told) == 2


def test_torques_of_a_wrong_shape_are_an_error_and_no_numbers_are_none() -> None:
    with pytest.warns(hs.ControllerWarning, match=r"returned shape \(3,\)") as told:
        run = run_of(Acting(lambda: np.zeros(3), 5))
    assert isinstance(run.error, hs.ControllerError)
    assert str(told[0].message) == run.message
    with pytest.raises(hs.ControllerError, match="returned shape"):
        run_of(Acting(lambda: np.zeros(3), 5), on_error="raise")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = run_of(Acting(lambda: np.full(6, np.nan), 5), on_error="raise")
    assert run.status is RunStatus.CONTROLLER_FAILED
    assert run.error is None
    assert "not finite at t = 0.004 s" in run.message


def test_a_simulation_that_raises_keeps_its_record() -> None:
    start = walking.gait().initial_state
    simulation = hs.Simulation(
        walking.bravo7(), Acting(out_of_power, 21), state=start, on_error="raise"
    )
    simulation.advance(0.01)
    with pytest.raises(RuntimeError, match="battery empty"):
        simulation.advance(0.05)
    assert simulation.status is RunStatus.CONTROLLER_FAILED
    assert len(simulation.record.time) == 20
    with pytest.raises(hs.SimulationError, match="has ended"):
        simulation.step()


def test_a_look_at_the_record_tells_nothing() -> None:
    """It asks for the torques of this instant and forgets them: the error is told when it comes."""
    start = walking.gait().initial_state
    simulation = hs.Simulation(walking.bravo7(), faulty(), state=start)
    simulation.advance(0.02)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert simulation.record.status is RunStatus.CONTROLLER_FAILED
    assert simulation.status is RunStatus.COMPLETED
    with pytest.warns(hs.ControllerWarning, match="law without power"):
        simulation.step()


def test_the_last_call_of_a_run_is_told_of_too() -> None:
    with pytest.warns(hs.ControllerWarning, match="law without power"):
        run = run_of(faulty(0.05))
    assert run.status is RunStatus.CONTROLLER_FAILED


def test_ctrl_c_is_no_error_of_the_controller() -> None:
    def interrupt() -> Any:
        raise KeyboardInterrupt

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = run_of(Acting(interrupt, 5), on_error="raise")
    assert run.status is RunStatus.INTERRUPTED


def batch_of(threads: int, **options: Any) -> hs.Batch:
    return hs.simulate_batch(
        walking.bravo7(),
        faulty(),
        parameters={"after": [1.0, 0.03, 1.0, 0.01]},
        state=walking.gait().initial_state,
        duration=0.05,
        threads=threads,
        **options,
    )


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_tells_at_its_end(threads: int) -> None:
    with pytest.warns(hs.ControllerWarning) as told:
        batch = batch_of(threads)
    (warning,) = told
    assert warning.filename == __file__
    words = str(warning.message)
    assert words.startswith("run 1: controller 'raising' raised ValueError: law without power")
    assert "Errors ended 1 more: 3" in words
    assert "in raising\n" in words
    assert list(batch.completed) == [True, False, True, False]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        quiet = batch_of(threads, on_error="stop")
        with pytest.raises(ValueError, match="law without power"):
            batch_of(threads, on_error="raise")
    assert quiet.message == batch.message
    np.testing.assert_array_equal(quiet.position, batch.position)


def test_compare_hands_it_on() -> None:
    options: dict[str, Any] = {
        "methods": {"one": METHODS[0], "other": METHODS[0]},
        "state": walking.gait().initial_state,
        "duration": 0.05,
    }
    with pytest.warns(hs.ControllerWarning) as told:
        hs.compare(walking.bravo7(), faulty(), **options)
    assert len(told) == 2
    with pytest.raises(ValueError, match="law without power"):
        hs.compare(walking.bravo7(), faulty(), on_error="raise", **options)


def test_a_simulation_that_is_watched_warns_instead_of_raising() -> None:
    simulation = hs.Simulation(
        walking.bravo7(), faulty(), state=walking.gait().initial_state, on_error="raise"
    )
    live = LiveSimulation(simulation)
    with pytest.warns(hs.ControllerWarning, match="law without power"):
        live.advance(0.05)
    assert not live.can_go_on


def test_a_word_that_is_none_is_refused() -> None:
    with pytest.raises(hs.SimulationError, match="on_error must be one of 'warn', 'stop', 'raise'"):
        run_of(faulty(), on_error="ignore")
    with pytest.raises(hs.SimulationError, match="on_error must be one of"):
        batch_of(1, on_error="ignore")


def test_a_run_with_an_error_is_pickled_and_saved(tmp_path: Any) -> None:
    run = run_of(faulty(), on_error="stop")
    again = pickle.loads(pickle.dumps(run))
    assert repr(again.error) == repr(run.error)
    path = tmp_path / "run.nc"
    run.save(path)
    assert hs.load_run(path).message == run.message
