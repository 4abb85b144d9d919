"""Controllers that do what they may not: the run ends with its data, and says what was done."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control import ControllerFunction as Function
from heelstrike.control import Law
from heelstrike.sim import Compliant, EventDriven, RunStatus, TimeStepping
from heelstrike.sim.method import Method

METHODS = [TimeStepping(), EventDriven(max_step=1e-3), Compliant()]
AFTER = 0.02
"""When the controllers below go wrong, in s; a sampled instant of every method."""

# What they do then.
WELL = 0
WRITE_TORQUE = 1
WRITE_MEMORY = 2
WRITE_PARAMETERS = 3
WRITE_BEFORE = 4
WRITE_FAR = 5
READ_MEMORY = 6
RAISE = 7
CHANGE_ROBOT = 8
CHANGE_STATE = 9
CHANGE_CONTACTS = 10


class Fault(hs.Bundle):
    """What it shall do wrong."""

    which: np.ndarray = hs.array(1)


class Calls(hs.Bundle):
    """How often it was called, and something else."""

    number: np.ndarray = hs.array(1)
    more: np.ndarray = hs.array("nu")


def misbehave(  # type: ignore[no-untyped-def]
    t, state, contacts, robot, parameters: Fault, memory: Calls, torque
):
    """Brake the joints, and misbehave when it is time."""
    fault = int(parameters.which[0])
    if t < AFTER:
        fault = WELL
    for i in range(robot.nu):
        torque[i] = -state.joint_velocity[i]
    memory.number[0] += 1.0
    if fault == WRITE_TORQUE:
        torque[torque.shape[0] + 1] = 1.0
    elif fault == WRITE_MEMORY:
        memory.number[memory.number.shape[0]] = 1.0
    elif fault == WRITE_PARAMETERS:
        parameters.which[parameters.which.shape[0] + 2] = 1.0
    elif fault == WRITE_BEFORE:
        torque[-torque.shape[0] - 1] = 1.0
    elif fault == WRITE_FAR:
        torque[torque.shape[0] + 40] = 1.0
    elif fault == READ_MEMORY:
        torque[2] = memory.number[memory.number.shape[0] + 1]
    elif fault == RAISE:
        raise ValueError("battery empty")
    elif fault == CHANGE_ROBOT:
        robot.model.mass[3] *= 2.0
    elif fault == CHANGE_STATE:
        state.q[2] += 1e-3
        state.kinematics.origin[2, 1] += 1e-3
    elif fault == CHANGE_CONTACTS:
        contacts.force[1, 0] += 1.0


@pytest.fixture(scope="module")
def careless() -> Function:
    """The controller as somebody compiles it who leaves Numba's defaults as they are."""
    return hs.controller(numba.njit(misbehave))


@pytest.fixture(scope="module")
def careful() -> Function:
    return hs.controller(misbehave)


def run(controller: Any, method: Method, **options: Any) -> hs.Run:
    return hs.simulate(
        walking.bravo7(),
        controller,
        state=walking.gait().initial_state,
        duration=0.1,
        method=method,
        on_error="stop",
        **options,
    )


def faulty(function: Function, fault: int) -> Law:
    return function(Fault(which=np.array([float(fault)])))


def check(found: hs.Run, *words: str, until: float = 0.1) -> None:
    """A run that a fault ended keeps all rows before it, and no other number is spoilt."""
    assert found.status is RunStatus.CONTROLLER_FAILED, found.message
    for word in words:
        assert word in found.message
    assert AFTER - 2e-3 <= found.time[-1] <= until
    assert np.all(np.diff(found.time) >= 0.0)
    assert np.all(np.isfinite(found.position))
    assert np.all(np.isfinite(found.torque[:-1]))


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize(
    ("fault", "place"),
    [
        (WRITE_TORQUE, "torque[7] of shape (6,)"),
        (WRITE_MEMORY, "memory.number[1] of shape (1,)"),
        (WRITE_PARAMETERS, "parameters.which[3] of shape (1,)"),
        (WRITE_BEFORE, "torque[-1] of shape (6,)"),
    ],
)
@pytest.mark.slow
def test_what_is_written_next_to_an_array_ends_the_run_at_once(
    careless: Function, fault: int, place: str, method: Method
) -> None:
    found = run(faulty(careless, fault), method)
    check(
        found, "'misbehave'", "wrote beyond its arrays", place, "checked=True", until=AFTER + 2e-3
    )


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_what_is_written_farther_off_is_seen_when_the_loop_comes_back(
    careless: Function, method: Method
) -> None:
    check(run(faulty(careless, WRITE_FAR), method), "torque[46] of shape (6,)")


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_what_is_read_beyond_an_array_is_no_number(careless: Function, method: Method) -> None:
    found = run(faulty(careless, READ_MEMORY), method)
    actuator = walking.bravo7().actuator_names[2]
    check(found, "not finite", repr(actuator), until=AFTER + 2e-3)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_what_compiled_code_raises_ends_the_run(careful: Function, method: Method) -> None:
    found = run(faulty(careful, RAISE), method)
    check(found, "controller 'misbehave' raised ValueError: battery empty", until=AFTER + 2e-3)
    assert isinstance(found.error, ValueError)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_a_changed_robot_is_noticed_and_put_right(careful: Function, method: Method) -> None:
    mass = walking.bravo7().model.mass.copy()
    found = run(faulty(careful, CHANGE_ROBOT), method)
    check(found, "changed the robot: model.mass[3] from")
    assert f"{mass[3]:.9g}" in found.message
    np.testing.assert_array_equal(walking.bravo7().model.mass, mass)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("fault", [CHANGE_STATE, CHANGE_CONTACTS])
def test_state_and_contacts_are_copies(careful: Function, fault: int, method: Method) -> None:
    well, changed = (run(faulty(careful, each), method) for each in (WELL, fault))
    assert changed.completed, changed.message
    np.testing.assert_array_equal(changed.position, well.position)
    np.testing.assert_array_equal(changed.contact_force, well.contact_force)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("fault", [WRITE_TORQUE, WRITE_FAR, READ_MEMORY])
def test_indices_are_checked_unless_one_opts_out(
    careful: Function, fault: int, method: Method
) -> None:
    found = run(faulty(careful, fault), method)
    check(found, "IndexError", "checked=True", until=AFTER + 2e-3)
    assert isinstance(found.error, IndexError)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (WRITE_TORQUE, "writes to torque[7], beyond its shape (6,)"),
        (WRITE_MEMORY, "writes to memory.number[1], beyond its shape (1,)"),
        (WRITE_PARAMETERS, "writes to parameters.which[3]"),
        (WRITE_BEFORE, "writes to torque[-7], beyond its shape (6,)"),
        (WRITE_FAR, "writes to torque[46], beyond its shape (6,)"),
        (READ_MEMORY, "reads memory.number[2], beyond its shape (1,)"),
        (CHANGE_ROBOT, "writes to robot.model.mass[3]"),
        (CHANGE_STATE, "writes to state.q[2]"),
        (CHANGE_CONTACTS, "writes to contacts.force[1, 0]"),
        (RAISE, "battery empty"),
    ],
)
def test_the_checked_mode_names_controller_array_and_index(
    careless: Function, fault: int, words: str, method: Method
) -> None:
    found = run(faulty(careless, fault), method, checked=True)
    check(found, words, "t = 0.02", until=AFTER + 2e-3)
    assert "'misbehave'" in found.message or fault == RAISE


def test_the_checked_mode_computes_the_same(careless: Function) -> None:
    """Compiled and in Python: the same law, called at the same instants."""
    plain = run(faulty(careless, WELL), TimeStepping())
    checked = run(faulty(careless, WELL), TimeStepping(), checked=True)
    assert plain.completed
    assert checked.completed
    np.testing.assert_allclose(checked.position, plain.position, rtol=0.0, atol=1e-12)


def test_the_checked_mode_takes_stock_controllers() -> None:
    law = hs.ComputedTorque(walking.bravo7(), walking.gait())
    plain, checked = (
        hs.simulate(
            walking.bravo7(),
            law,
            state=walking.gait().initial_state,
            duration=0.02,
            checked=each,
        )
        for each in (False, True)
    )
    assert checked.completed, checked.message
    np.testing.assert_allclose(checked.torque, plain.torque, rtol=1e-9, atol=1e-9)


class Plain:
    """A controller in Python that does something when it is time."""

    def __init__(self, act: Callable[[Any], None]) -> None:
        self.act = act

    def torque(self, t: float, state: hs.State, contacts: Any) -> np.ndarray[Any, Any]:
        if t >= AFTER:
            self.act(contacts)
        return np.zeros(6)


def throw(error: BaseException) -> Callable[[Any], None]:
    def act(_: Any) -> None:
        raise error

    return act


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize(
    "error", [SystemExit(3), GeneratorExit(), StopIteration("over"), RuntimeError("no")]
)
def test_whatever_python_raises_ends_the_run(error: BaseException, method: Method) -> None:
    found = run(Plain(throw(error)), method)
    check(found, f"Plain.torque raised {type(error).__name__}", "t = 0.02", until=AFTER)
    assert found.error is error


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_python_changes_neither_contacts_nor_robot(method: Method) -> None:
    def write(contacts: Any) -> None:
        contacts.force[0, 0] = 1.0

    check(run(Plain(write), method), "read-only", until=AFTER)
    robot = walking.bravo7()
    before = robot.model.inertia.copy()

    def fatten(_: Any) -> None:
        robot.model.inertia[4] += 1.0

    check(run(Plain(fatten), method), "Plain.torque changed the robot: model.inertia[4]")
    np.testing.assert_array_equal(robot.model.inertia, before)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("plain", [False, True])
def test_progress_that_raises_ends_the_run_with_its_data(
    careful: Function, plain: bool, method: Method
) -> None:
    error = OSError("the terminal is gone")

    def progress(_: float) -> None:
        raise error

    controller = Plain(lambda _: None) if plain else faulty(careful, WELL)
    found = hs.simulate(
        walking.bravo7(),
        controller,
        state=walking.gait().initial_state,
        duration=300.0,
        method=method,
        stop_when_fallen=False,
        progress=progress,
    )
    assert found.status is RunStatus.INTERRUPTED
    assert "progress raised OSError: the terminal is gone" in found.message
    assert found.error is error
    assert 0.0 < found.time[-1] < 300.0


def test_a_finished_run_is_finished_though_progress_raises(careful: Function) -> None:
    def progress(time: float) -> None:
        if time >= 0.1:
            raise OSError("the terminal is gone")

    found = run(faulty(careful, WELL), TimeStepping(), progress=progress)
    assert found.completed
    assert "the terminal is gone" in found.message


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_looking_up_more_often_changes_no_digit(
    careful: Function, method: Method, monkeypatch: pytest.MonkeyPatch
) -> None:
    def walk() -> hs.Run:
        return run(hs.ComputedTorque(walking.bravo7(), walking.gait()), method)

    usual = walk()
    monkeypatch.setattr("heelstrike.sim.simulation.FIRST_LOOK", 1)
    monkeypatch.setattr("heelstrike.sim.simulation.LOOK_EVERY", 0.0)
    often = walk()
    assert often.completed
    for name in ("time", "position", "velocity", "torque", "contact_force"):
        np.testing.assert_array_equal(getattr(often, name), getattr(usual, name))
    assert often.events == usual.events
