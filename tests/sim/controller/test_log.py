"""What controllers tell of themselves, recorded with every row."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.sim.method import Method

METHODS = [hs.TimeStepping(), hs.EventDriven(rtol=1e-6), hs.Compliant()]


class Steps(hs.Bundle):
    """What the law remembers."""

    calls: int = hs.cell(int)


class Told(hs.Bundle):
    """What it tells."""

    calls: int = hs.cell(int, label="calls for good")
    asked_at: float = hs.cell(float, unit="s", label="time of the last call")
    error: Any = hs.array("nu", unit="rad", label="distance of the joints from zero")
    pair: Any = hs.array(2)


@hs.controller
def tells(t, state, robot, memory: Steps, log: Told, torque):
    """Stand on springs, and say so."""
    memory.calls += 1
    log.calls = memory.calls
    log.asked_at = t
    log.pair[1] = robot.period
    for i in range(robot.nu):
        log.error[i] = -state.joint_position[i]
        torque[i] = 600.0 * log.error[i] - 10.0 * state.joint_velocity[i]


class TellsInPython:
    """The same as an object."""

    def __init__(self) -> None:
        self.log = Told.allocate(nu=6)

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        self.log.calls += 1
        self.log.asked_at = t
        self.log.pair[1] = 0.001
        self.log.error[:] = -state.q[3:]
        return 600.0 * self.log.error - 10.0 * state.v[3:]


def run_of(controller: Any, method: Method, **options: Any) -> hs.Run:
    robot = walking.bravo7()
    given = {"duration": 0.02, "control_period": 1e-3} | options
    return hs.simulate(robot, controller, state=robot.reference_state(), method=method, **given)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
@pytest.mark.parametrize("kind", ["compiled", "in Python", "checked", "object"])
def test_a_log_is_recorded_with_every_row(kind: str, method: Method) -> None:
    controller: Any = tells()
    if kind == "in Python":
        controller = hs.controller(compile=False)(tells.python)()
    if kind == "object":
        controller = TellsInPython()
    run = run_of(controller, method, checked=kind == "checked")
    assert run.completed, run.message
    told = {name: each.values for name, each in run.log.items()}
    assert set(told) == {"calls", "asked_at", "error", "pair"}
    assert told["calls"].dtype == np.int64
    # Rows of dense output are of the step behind them: the torque in them is that of its beginning.
    late = run.time - told["asked_at"]
    assert np.all((late > -1e-12) & (late < 1e-3 + 1e-12))
    np.testing.assert_allclose(told["asked_at"], (told["calls"] - 1) * 1e-3, atol=1e-12)
    wanted = 600.0 * told["error"] - 10.0 * run.velocity[:, 3:]
    asked = late < 1e-12
    assert asked[0]
    np.testing.assert_allclose(told["error"][asked], -run.position[asked, 3:], atol=1e-9)
    np.testing.assert_allclose(run.torque[asked], wanted[asked], atol=1e-6)
    if not isinstance(method, hs.EventDriven):
        assert np.all(asked)
    np.testing.assert_allclose(told["pair"][:, 1], 1e-3)
    assert run.log["asked_at"].unit == "s"
    assert run.log["error"].extents == ("nu",)


def test_what_is_only_tried_is_not_logged() -> None:
    run = run_of(tells(), hs.EventDriven(rtol=1e-6), control_period=None)
    calls = run.log["calls"].values
    # Continuous: called at the ends of steps for good, and six times within each for trial.
    assert calls[-1] <= run.steps + 2
    assert np.all(np.diff(calls) >= 0)
    assert np.all(run.log["pair"].values[:, 1] == 0.0)


def test_a_log_is_kept_in_dataset_file_and_snapshot(tmp_path: Path) -> None:
    run = run_of(tells(), hs.TimeStepping())
    dataset = run.to_dataset()
    assert dataset["log_error"].dims == ("time", "actuator")
    assert dataset["log_error"].attrs == {
        "units": "rad", "long_name": "distance of the joints from zero"
    }  # fmt: skip
    again = hs.load_run(run.save(tmp_path / "run.nc"))
    assert set(again.log) == set(run.log)
    for name, each in run.log.items():
        its = again.log[name]
        np.testing.assert_array_equal(its.values, each.values)
        assert its.values.dtype == each.values.dtype
        assert (its.unit, its.label, its.extents) == (each.unit, each.label, each.extents)
    assert again.plot("error").axes[0].get_ylabel() == "rad"
    assert len(again.plot("asked_at").axes[0].lines) == 1
    with pytest.raises(hs.ViewError, match="asked_at"):
        again.plot("asked")
    robot = walking.bravo7()
    on = hs.simulate(robot, tells(), state=run.final, duration=0.002, control_period=1e-3)
    np.testing.assert_array_equal(on.log["calls"].values, [21, 22, 23])


def test_a_controller_set_later_cannot_log_other_things() -> None:
    robot = walking.bravo7()
    simulation = hs.Simulation(robot, state=robot.reference_state())
    simulation.step()
    with pytest.raises(hs.SimulationError, match=r"state=simulation\.state"):
        simulation.controller = tells()
    assert simulation.step().value == "completed"


@pytest.mark.parametrize("compiles", [True, False])
def test_what_a_law_remembers_and_tells_can_be_looked_at(compiles: bool) -> None:
    robot = walking.bravo7()
    law = (tells if compiles else hs.controller(compile=False)(tells.python))()
    simulation: Any = hs.Simulation(robot, law, state=robot.reference_state())
    simulation.advance(0.005)
    assert simulation.memory.calls == 5
    assert simulation.log.calls == 5
    assert simulation.log.asked_at == pytest.approx(0.004)
    simulation.memory.calls = 100
    simulation.step()
    assert simulation.log.calls == 101
