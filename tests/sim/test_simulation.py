"""simulate(): what it refuses, and how runs end; what was simulated is never lost."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.sim import RunStatus, Scheme, simulation


class Constant:
    """The same answer whenever asked, of any shape."""

    def __init__(self, answer: object, *, after: float = 0.0) -> None:
        self.answer = answer
        self.after = after

    def torque(self, t: float, state: hs.State, contacts: object) -> object:
        if t < self.after:
            return np.zeros(6)
        if isinstance(self.answer, BaseException):
            raise self.answer
        return self.answer


def start() -> hs.State:
    return walking.gait().initial_state


def run(controller: object, **options: object) -> hs.Run:
    return hs.simulate(walking.bravo7(), controller, state=start(), duration=0.1, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"duration": -1.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"record_every": 0}, "record_every"),
        ({"control_period": -1e-3}, "control_period must be a positive number"),
        ({"control_period": 1.5e-3}, "whole number of steps"),
        ({"method": "fast"}, "simulation method"),
        ({"ground": 0.5}, "Ground"),
        ({"state": hs.State(np.zeros(8), np.zeros(9))}, "9 entries"),
        ({"state": hs.State(np.zeros(9), np.full(9, np.nan))}, "root_x"),
    ],
)
def test_arguments_are_checked_before_anything_runs(options: dict[str, object], words: str) -> None:
    arguments: dict[str, object] = {"state": start(), "duration": 0.1, **options}
    with pytest.raises(hs.SimulationError, match=words):
        hs.simulate(walking.bravo7(), None, **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"step": 0.0}, "time step"),
        ({"step": -1e-3}, "time step"),
        ({"step": np.nan}, "time step"),
        ({"scheme": 17}, "unknown scheme"),
        ({"solver": "magic"}, "unknown contact solver"),
        ({"activation": -1.0}, "activation"),
    ],
)
def test_time_stepping_is_checked(options: dict[str, object], words: str) -> None:
    with pytest.raises(hs.SimulationError, match=words):
        hs.TimeStepping(**options)  # type: ignore[arg-type]


def test_unknown_keywords_raise() -> None:
    with pytest.raises(TypeError, match="stp"):
        hs.TimeStepping(stp=1e-3)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="grund"):
        run(None, grund=None)


def test_restitution_needs_a_scheme_that_knows_it() -> None:
    scheme = hs.TimeStepping(scheme=Scheme.GAP_LINEARISED)
    with pytest.raises(hs.SimulationError, match=r"IMPACT_RESOLVED or Scheme\.MOREAU_JEAN"):
        run(None, ground=hs.Ground(restitution=0.5), method=scheme)


def test_a_torque_of_the_wrong_shape_ends_the_run_and_keeps_it() -> None:
    result = run(Constant(np.zeros(5), after=0.05))
    assert result.status is RunStatus.CONTROLLER_FAILED
    assert "(5,)" in result.message
    assert "left_ankle" in result.message
    assert result.time[-1] == pytest.approx(0.049)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_torque_that_is_not_finite_names_time_and_joint(bad: float) -> None:
    torque = np.zeros(6)
    torque[4] = bad
    result = run(Constant(torque, after=0.05))
    assert result.status is RunStatus.CONTROLLER_FAILED
    assert "left_knee" in result.message
    assert "0.05" in result.message
    assert len(result.time) == 50
    assert np.all(np.isfinite(result.position))


def test_an_exception_in_a_controller_is_kept_with_the_run() -> None:
    error = RuntimeError("battery empty")
    result = run(Constant(error, after=0.03))
    assert result.status is RunStatus.CONTROLLER_FAILED
    assert result.error is error
    assert "battery empty" in result.message
    assert len(result.time) == 30


def test_ctrl_c_keeps_what_was_simulated() -> None:
    result = run(Constant(KeyboardInterrupt(), after=0.04))
    assert result.status is RunStatus.INTERRUPTED
    assert len(result.time) == 40


def test_ctrl_c_between_chunks_of_the_compiled_loop() -> None:
    def interrupt(t: float) -> None:
        raise KeyboardInterrupt

    result = hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), walking.gait()),
        state=start(),
        duration=20.0,
        progress=interrupt,
    )
    assert result.status is RunStatus.INTERRUPTED
    assert 0.0 < result.time[-1] < 20.0


def test_something_that_is_no_controller() -> None:
    with pytest.raises(hs.ControllerError, match="torque"):
        run(object())


def test_a_robot_left_alone_falls() -> None:
    result = hs.simulate(walking.bravo7(), None, state=start(), duration=5.0)
    assert result.status is RunStatus.FELL
    assert 0.2 < result.time[-1] < 2.0
    # The gap is linear in the step, so that a vertex r from the ankle may sink by r (ω h)² / 2.
    turning = np.abs(result.velocity[:, 2:]).sum(axis=1).max()
    assert result.certificates.penetration <= 0.5 * 0.13 * (turning * 1e-3) ** 2


def test_torques_stay_within_their_limits_and_say_so() -> None:
    robot = walking.bravo7()
    result = run(Constant(np.full(6, 1e4)))
    np.testing.assert_array_equal(
        result.torque, np.broadcast_to(robot.model.torque_upper, result.torque.shape)
    )
    assert result.saturations >= 6


def test_thinned_records_keep_the_certificates_of_every_step() -> None:
    controller = hs.ComputedTorque(walking.bravo7(), walking.gait())
    full = run(controller)
    thin = run(controller, record_every=10)
    np.testing.assert_array_equal(thin.time, full.time[::10])
    np.testing.assert_array_equal(thin.position, full.position[::10])
    assert thin.certificates == full.certificates
    assert thin.steps == full.steps


def test_zero_duration_records_the_first_instant() -> None:
    result = hs.simulate(walking.bravo7(), None, state=start(), duration=0.0)
    assert result.completed
    np.testing.assert_array_equal(result.position, [start().q])


@pytest.mark.parametrize("scheme", list(Scheme))
def test_every_scheme_says_what_it_is(scheme: Scheme) -> None:
    assert hs.TimeStepping(scheme=scheme).scheme is scheme


def test_a_run_introduces_itself_in_a_line() -> None:
    found = run(None, stop_when_fallen=False)
    assert repr(found) == "Run(bravo7, TimeStepping, 0.1 s, completed, 100 steps)"


def test_what_is_not_a_robot_state_or_method_is_refused_in_words() -> None:
    robot = hs.load_robot("compass_gait")
    state = robot.reference_state()
    wrong: list[tuple[Any, dict[str, Any], str]] = [
        ("bravo7", {"state": state}, r"robot must be a Robot, got 'bravo7' .*load_robot"),
        (robot, {"state": (state.q, state.v)}, r"\(tuple\); hs.State\(q, v\)"),
        (robot, {"state": state, "method": hs.TimeStepping}, r"write TimeStepping\(\)"),
    ]
    for given, options, words in wrong:
        with pytest.raises(hs.SimulationError, match=words):
            hs.simulate(given, duration=0.1, **options)


def test_an_unknown_scheme_is_answered_with_names() -> None:
    with pytest.raises(hs.SimulationError, match=r"Scheme\.GAP_LINEARISED, .*Scheme\.MOREAU_JEAN"):
        hs.TimeStepping(scheme="moreau-jean")  # type: ignore[arg-type]


def test_computing_time_is_without_compiling(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that goes on while something is compiled, by 100 s, and at no other time."""
    now = [0.0]

    def slow(*arguments: Any) -> Any:
        now[0] += 100.0
        return compiled_loop(*arguments)[0], 100.0

    compiled_loop = simulation.compiled_loop
    monkeypatch.setattr(simulation, "compiled_loop", slow)
    monkeypatch.setattr(simulation, "clock_time", SimpleNamespace(perf_counter=lambda: now[0]))
    timing = run(None).timing
    assert (timing.compile_s, timing.wall_s) == (100.0, 0.0)
