"""Which intervals are differentiated, what ends them, and what a law is asked on the way: by hand.

Simulations and laws are played by a script here, but for the smallest robots.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mechanisms
import numpy as np
import pytest

import heelstrike as hs
from heelstrike.contact.linearized.motion import ActiveContacts
from heelstrike.errors import SimulationError
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.linearized import derivatives as its
from heelstrike.sim.linearized import law
from heelstrike.sim.linearized.derivatives import RunDerivatives, StepDerivatives
from heelstrike.sim.linearized.flow import Variation
from heelstrike.sim.linearized.inputs import LAW, TORQUE, Inputs
from heelstrike.sim.linearized.law import AskedAlong, Instant

STEP = 1e-3


# Chains of steps.


def drawn(seed: int, end: float = 0.0) -> StepDerivatives:
    draw = np.random.default_rng(seed)
    return StepDerivatives(
        begin=0.0, end=end, state=draw.normal(size=(4, 4)), torque=draw.normal(size=(4, 2)),
        numbers={"mass": draw.normal(size=(4, 3))}, gains={"kp": draw.normal(size=(4, 1))},
    )  # fmt: skip


def test_changes_go_forward_and_gradients_back_through_all_steps() -> None:
    """Written out for two steps; sums of numbers and gains, torques of each."""
    one, two = drawn(1), drawn(2)
    run, draw = RunDerivatives((one, two)), np.random.default_rng(3)
    state, torque, mass, kp = (draw.normal(size=n) for n in (4, (2, 2), 3, 1))
    found = run.forward(state, torque, numbers={"mass": mass}, gains={"kp": kp})
    first = one.state @ state + one.torque @ torque[0] + one.numbers["mass"] @ mass
    first = first + one.gains["kp"] @ kp
    second = two.state @ first + two.torque @ torque[1] + two.numbers["mass"] @ mass
    second = second + two.gains["kp"] @ kp
    np.testing.assert_allclose(found, [state, first, second])
    np.testing.assert_allclose(one.forward(state), one.state @ state)
    np.testing.assert_allclose(one.forward(torque=1.0), one.torque.sum(axis=1))
    last = draw.normal(size=4)
    back = run.adjoint(last)
    np.testing.assert_allclose(back.state, last @ two.state @ one.state)
    np.testing.assert_allclose(back.torque, [last @ two.state @ one.torque, last @ two.torque])
    for name, each in (("mass", "numbers"), ("kp", "gains")):
        by = [getattr(step, each)[name] for step in (one, two)]
        expected = last @ two.state @ by[0] + last @ by[1]
        np.testing.assert_allclose(getattr(back, each)[name], expected)
    along = draw.normal(size=(3, 4))
    back = run.adjoint(along)
    middle = along[2] @ two.state + along[1]
    np.testing.assert_allclose(back.state, middle @ one.state + along[0])
    np.testing.assert_allclose(back.torque, [middle @ one.torque, along[2] @ two.torque])


# Intervals.


def asked(
    monkeypatch: pytest.MonkeyPatch, until: float, *, every: float | None = None,
    method: Any = None, period: float = 0.0, control_every: int = 1, index: int = 0,
) -> list[float]:  # fmt: skip
    """Ends of the intervals that `run_derivatives` asks for, from 2 s on."""
    simulation: Any = SimpleNamespace(
        time=2.0, _instant=lambda time: time, control_period=period,
        method=method or hs.TimeStepping(step=STEP),
        _clock=SimpleNamespace(control_every=control_every, index=index),
    )  # fmt: skip
    stepper = SimpleNamespace(until=lambda end: drawn(1, end))
    monkeypatch.setattr(its, "_stepper", lambda *_: stepper)
    found = its.run_derivatives.__wrapped__(simulation, until, every=every)
    return [round(each.end - 2.0, 12) for each in found.steps]


def test_a_run_is_cut_into_steps_or_periods_or_what_is_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert asked(monkeypatch, 2.003) == [0.001, 0.002, 0.003]
    assert asked(monkeypatch, 2.0034) == [0.001, 0.002, 0.003, 0.0034]
    assert asked(monkeypatch, 2.003 + 5e-10) == [0.001, 0.002, 0.003]  # that is its end
    assert len(asked(monkeypatch, 2.003 + 5e-9)) == 4
    assert asked(monkeypatch, 2.005, every=2e-3) == [0.002, 0.004, 0.005]
    assert asked(monkeypatch, 2.004, every=2e-3) == [0.002, 0.004]
    assert asked(monkeypatch, 2.006, period=3e-3, control_every=3) == [0.003, 0.006]
    # One step after a call two are left until the next.
    assert asked(monkeypatch, 2.008, period=3e-3, control_every=3, index=4) == [0.002, 0.005, 0.008]
    assert asked(monkeypatch, 2.008, period=3e-3, control_every=3, index=4, every=6e-3) == [
        0.002, 0.008
    ]  # fmt: skip
    assert asked(monkeypatch, 2.001, period=3e-3, control_every=3, index=4) == [0.001]
    assert asked(monkeypatch, 2.3, method=hs.EventDriven()) == [0.3]
    assert asked(monkeypatch, 2.3, method=hs.EventDriven(), every=0.1) == [0.1, 0.2, 0.3]
    assert asked(monkeypatch, 2.3, method=hs.Compliant()) == [0.3]
    assert asked(monkeypatch, 2.0, method=hs.EventDriven()) == [0.0]


@pytest.mark.parametrize("every", [0.0, -1e-3, 1.5e-3, 1e-3 + 2e-9, 3e-3 - 2e-9, np.nan])
def test_intervals_that_cut_a_step_are_refused(
    every: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SimulationError, match=r"a multiple of 0.001 s; got"):
        asked(monkeypatch, 2.01, every=every)
    assert asked(monkeypatch, 2.003, every=1e-3 + 2e-10)[0] == pytest.approx(1e-3)
    if not every > 0.0:
        with pytest.raises(SimulationError, match=r"every must be positive; got"):
            asked(monkeypatch, 2.01, every=every, method=hs.EventDriven())


def test_a_controller_is_called_again_after_so_many_steps() -> None:
    def left(every: int, index: int) -> float:
        return its._to_the_next_call(
            SimpleNamespace(  # type: ignore[arg-type]
                _clock=SimpleNamespace(control_every=every, index=index),
                method=SimpleNamespace(step_length=STEP),
            )
        )

    assert [left(3, index) for index in range(4)] == pytest.approx([0.0, 2e-3, 1e-3, 0.0])
    assert left(1, 5) == left(0, 5) == 0.0
    assert left(2, 1) == pytest.approx(1e-3)


def test_columns_are_told_apart_by_their_names() -> None:
    inputs = Inputs(
        ("mass", "friction"),
        {
            TORQUE: slice(0, 2),
            "mass": slice(2, 3),
            "friction": slice(3, 4),
            LAW + "kp": slice(4, 6),
        },
        ("kp",),
    )  # fmt: skip
    simulation: Any = SimpleNamespace(robot=SimpleNamespace(nq=1, nv=1), time=3.0)
    change = np.arange(64.0).reshape(8, 8)
    found = its._told(simulation, 2.0, change, inputs, ("change",), 0.7)  # type: ignore[arg-type]
    assert (found.begin, found.end, found.changes, found.spread) == (2.0, 3.0, ("change",), 0.7)
    np.testing.assert_array_equal(found.state, change[:2, :2])
    np.testing.assert_array_equal(found.torque, change[:2, 2:4])
    np.testing.assert_array_equal(found.numbers["mass"], change[:2, 4:5])
    np.testing.assert_array_equal(found.numbers["friction"], change[:2, 5:6])
    np.testing.assert_array_equal(found.gains["kp"], change[:2, 6:8])


def test_torques_that_limits_changed_are_told() -> None:
    """By more than 1e-9 of them and of 1 N m."""
    command = np.array([0.0, 0.0, 100.0, 100.0])
    off = np.array([0.9e-9, 1.1e-9, 100e-9, -102e-9])
    simulation: Any = SimpleNamespace(_memory=SimpleNamespace(torque=command + off))
    assert its._at_limits(simulation, command).tolist() == [False, True, False, True]


def test_steps_that_end_a_run_are_refused() -> None:
    for status in (RunStatus.COMPLETED, RunStatus.FELL):
        simulation: Any = SimpleNamespace(step=lambda status=status: status, message="it fell")
        if status is RunStatus.COMPLETED:
            its._one_step(simulation)
        else:
            with pytest.raises(SimulationError, match="has no derivative: it fell"):
                its._one_step(simulation)


@pytest.mark.parametrize("until", [None, 2.5])
@pytest.mark.parametrize("ends", [False, True])
def test_a_motion_is_gone_through_beside_the_simulation(
    until: float | None, ends: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """First to its end, then event by event; then the simulation goes there itself."""
    advanced: list[tuple[str, float]] = []

    def beside(name: str) -> Any:
        it = SimpleNamespace(
            time=2.0, status=RunStatus.FELL if ends else RunStatus.COMPLETED, message="it fell",
            record="record", advance=lambda end: advanced.append((name, end)),
        )  # fmt: skip

        def step() -> RunStatus:
            it.time = 2.25
            return RunStatus.COMPLETED

        it.step = step
        return it

    names = iter(["one step", "run", "again"] if until is None else ["run", "again"])
    monkeypatch.setattr(its, "_again", lambda *_: beside(next(names)))
    monkeypatch.setattr(its, "whole", lambda record: record)
    monkeypatch.setattr(its, "Variation", lambda *given, **how: (given, how))
    asked: list[Any] = []

    def linearized(run: Any, end: float, variation: Any, **how: Any) -> Any:
        asked.append((run, end, how))
        events = [SimpleNamespace(spread=0.3), SimpleNamespace(spread=0.7)]
        return SimpleNamespace(matrix=np.eye(4), saltations=events if until else [])

    monkeypatch.setattr(its, "linearized", linearized)
    simulation: Any = SimpleNamespace(
        time=2.0, snapshot=lambda: "now", controller=None, robot=SimpleNamespace(nq=2, nv=2),
        advance=lambda end: advanced.append(("itself", end)),
    )  # fmt: skip
    inputs = Inputs((), {TORQUE: slice(0, 0)})
    flows = its._Flows(simulation, inputs, True)
    end = until or 2.25
    if ends:
        with pytest.raises(SimulationError, match="has no derivative: it fell"):
            flows.until(until)
        return
    found = flows.until(until)
    assert advanced == [("run", end), ("itself", end)]
    assert asked == [("record", end, {"section": False, "begin": 2.0})]
    assert found.spread == (0.7 if until else 0.0)


def test_modes_are_for_one_step_of_time_stepping_only() -> None:
    robot = mechanisms.point()
    state = robot.reference_state()
    for method, until in ((hs.TimeStepping(), 0.002), (hs.EventDriven(), None)):
        simulation = hs.Simulation(robot, state=state, method=method, stop_when_fallen=False)
        with pytest.raises(SimulationError, match="modes is for one step of time stepping only"):
            hs.step_derivatives(simulation, until=until, modes={})


# Laws.


def test_parameters_are_counted_by_their_names() -> None:
    class Gains(hs.Bundle):
        kp: Any = hs.array(2, 3)
        kd: Any = hs.array(4)
        count: int = hs.number(int)

    @hs.controller
    def hold(torque: Any, parameters: Gains) -> None:
        """Ask for nothing."""
        torque[0] = parameters.kd[0]

    given = hold(Gains(kp=np.ones((2, 3)), kd=np.ones(4), count=2))
    assert law.parameter_sizes(given, ("kp",)) == {"kp": 6}
    assert law.parameter_sizes(given, ("kd", "kp")) == {"kd": 4, "kp": 6}
    assert law.parameter_sizes(given, ()) == law.parameter_sizes(None, ()) == {}
    with pytest.raises(SimulationError, match="no parameter 'ki'; it has kp, kd"):
        law.parameter_sizes(given, ("kp", "ki"))
    with pytest.raises(SimulationError, match="no parameter 'kp'; it has none"):
        law.parameter_sizes(None, ("kp",))


def remembering(depends: set[str], changes: dict[str, list[float]]) -> Any:
    """A law that remembers numbers, some of which its torques depend on."""
    it: Any = object.__new__(AskedAlong)
    it._constant, turn = {}, [0]
    instant = SimpleNamespace(numbers=None)
    it.now = lambda: instant
    it._asked = SimpleNamespace(restore=lambda _: None)
    it._check_forces = lambda _: None

    def remembered() -> dict[str, float]:
        turn[0] += 1
        return {name: values[turn[0] - 1] for name, values in changes.items()}

    it._remembered = remembered
    it._acts_on = lambda label, _: label in depends
    return it


def test_memory_that_changes_and_acts_is_refused_along_a_step() -> None:
    """Whatever it remembers besides: numbers that stay, or on which nothing depends."""
    changes = {"still": [1.0, 1.0], "idle": [1.0, 2.0], "state": [1.0, 1.5]}
    it = remembering({"still"}, changes)
    it.check_memory()
    it.check_memory()
    it = remembering({"state"}, changes)
    it.check_memory()
    with pytest.raises(SimulationError, match=r"memory.state changes within a step"):
        it.check_memory()


@pytest.mark.parametrize(("depends", "refused"), [("state", True), ("still", False)])
def test_memory_of_the_state_of_a_call_is_refused_if_it_acts(depends: str, refused: bool) -> None:
    """It is asked where it is, and 3e-6 beside it in every coordinate."""
    it = remembering({depends}, {"still": [1.0] * 3, "state": [1.0, 1.0, 1.1]})
    asked: list[Any] = []
    it._asked.snapshot = lambda: "then"
    seen = SimpleNamespace()
    instant: Any = Instant(
        it._asked,
        None,
        0.0,
        SimpleNamespace(vector=np.zeros(2)),
        seen,
        None,  # type: ignore[arg-type]
    )
    object.__setattr__(instant, "torques", lambda changes: asked.append(changes[0].tolist()) or [0])
    if refused:
        with pytest.raises(SimulationError, match=r"memory.state keeps something of the state"):
            it.check_call(instant)
    else:
        it.check_call(instant)
    assert asked == [[0.0, 0.0], [3e-6, 0.0], [0.0, 3e-6]]


def test_the_beginning_is_looked_at_once() -> None:
    it: Any = object.__new__(AskedAlong)
    calls: list[Any] = []
    it.check_call = calls.append
    it._first = "first"
    it.check_beginning()
    it.check_beginning()
    assert calls == ["first"]


# On compliant ground.


def test_masses_and_torques_act_on_compliant_ground_as_in_closed_form() -> None:
    """A slide of constant force: q = τ t² / 2 m and v = τ t / m."""
    build = hs.RobotBuilder("slide", gravity=0.0)
    build.slide("one", None, mass=2.0, inertia=0.1, direction=(1.0, 0.0), torque=100.0)
    simulation = hs.Simulation(
        build.build(), push(), state=hs.State([0.0], [0.0]), method=hs.Compliant(),
        stop_when_fallen=False,
    )  # fmt: skip
    t, tau, m = 0.003, 3.0, 2.0
    found = hs.step_derivatives(simulation, until=t, numbers=("mass",))
    expected = np.array([[-tau * t**2 / 2.0 / m**2], [-tau * t / m**2]])
    np.testing.assert_allclose(found.numbers["mass"], expected, rtol=1e-9)
    np.testing.assert_allclose(found.torque, [[t**2 / 2.0 / m], [t / m]], rtol=1e-9)
    np.testing.assert_allclose(found.state, [[1.0, t], [0.0, 1.0]], atol=1e-12)
    step = simulation.method.step_length
    assert step is not None
    after = hs.step_derivatives(simulation)  # one step
    assert after.end - after.begin == pytest.approx(step)
    np.testing.assert_allclose(after.state, [[1.0, step], [0.0, 1.0]], atol=1e-12)


@hs.controller
def push(torque: Any) -> None:
    """Ask for 3 N."""
    torque[0] = 3.0


def test_a_law_answers_along_a_motion_unless_it_is_told_not_to() -> None:
    """A spring k on a slide m: errors turn at √(k / m); held, they move evenly."""
    build = hs.RobotBuilder("slide", gravity=0.0)
    build.slide("one", None, mass=2.0, inertia=0.1, direction=(1.0, 0.0), torque=1e3)
    robot, t = build.build(), 0.004

    def simulated() -> hs.Simulation:
        return hs.Simulation(
            robot, spring(), state=hs.State([0.01], [0.0]), method=hs.EventDriven(),
            stop_when_fallen=False,
        )  # fmt: skip

    rate = np.sqrt(800.0 / 2.0)
    turns = [[np.cos(rate * t), np.sin(rate * t) / rate],
             [-rate * np.sin(rate * t), np.cos(rate * t)]]  # fmt: skip
    simulation = simulated()
    for given, expected in (({}, turns), ({"answers": False}, [[1.0, t], [0.0, 1.0]])):
        variation = Variation(simulated(), simulation.controller, **given)
        found = variation.flow(0.0, t, ActiveContacts())
        np.testing.assert_allclose(found, expected, atol=1e-7)
    found = hs.step_derivatives(simulated(), until=t)
    np.testing.assert_allclose(found.state, turns, atol=1e-7)


@hs.controller
def spring(state: Any, torque: Any) -> None:
    """Pull back with 800 N/m."""
    torque[0] = -800.0 * state.joint_position[0]
