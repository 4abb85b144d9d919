"""Floquet multipliers of whole closed loops against those of steps from touchdown to touchdown."""

from __future__ import annotations

from functools import cache

import mechanisms
import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.analysis.stability import returns
from heelstrike.analysis.stability.across import _with_consequence
from heelstrike.experiments.passive import METHOD, passive_walk

RAMP = hs.Ground(friction=3.0, slope=-0.05)


@cache
def compass() -> tuple[hs.Robot, hs.LimitCycle]:
    robot = hs.load_robot("compass_gait")
    return robot, passive_walk(robot, RAMP)


def test_two_steps_of_the_compass() -> None:
    """Squares of the multipliers of one step, and one of the walk itself."""
    robot, cycle = compass()
    found = hs.floquet_multipliers(
        robot, cycle.state, ground=RAMP, method=METHOD, settling=0, returns=2
    )
    wanted = np.sort_complex(cycle.multipliers**2)
    np.testing.assert_allclose(np.sort_complex(found.multipliers), wanted, atol=1e-6)
    assert found.steps == 2
    assert found.along == pytest.approx(1.0, abs=1e-5)
    assert found.largest == pytest.approx(np.abs(cycle.multipliers).max(), abs=1e-6)
    assert found.error < 1e-6
    assert found.stable
    assert found.period == pytest.approx(cycle.period, abs=1e-6)
    assert found.step_length == pytest.approx(cycle.step_length, abs=1e-6)
    assert found.residual < 1e-6
    assert found.repeats
    assert found.coordinates == ("robot 1", "robot 2", "robot 3", "robot 4")
    assert "stable" in repr(found)
    assert next(iter(found.slowest)) in found.coordinates


def test_returns_without_memory_are_those_that_differences_show(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a walk on two legs, in the middle of its steps."""
    robot, cycle = compass()
    walked = {"ground": RAMP, "method": METHOD, "settling": 0, "returns": 1}
    exact = hs.floquet_multipliers(robot, cycle.state, **walked)
    monkeypatch.setattr(returns, "_linearised", lambda *_: None)
    differences = hs.floquet_multipliers(robot, cycle.state, **walked)
    assert not np.array_equal(exact.matrix, differences.matrix)
    np.testing.assert_allclose(exact.matrix, differences.matrix, atol=1e-6)


@cache
def rabbit() -> tuple[hs.Robot, hs.VirtualConstraints, hs.ZeroDynamics]:
    robot, phased = walking.rabbit(), walking.rabbit_phased()
    return robot, hs.VirtualConstraints(phased), hs.zero_dynamics(phased)


def test_virtual_constraints_have_the_multiplier_of_their_zero_dynamics() -> None:
    """The same law goes on from step to step, and knows by its memory which foot stands."""
    robot, law, zero = rabbit()
    method = hs.EventDriven(rtol=1e-10, atol=1e-11)
    found = hs.floquet_multipliers(
        robot, zero.initial_state, law, method=method, settling=1, returns=1
    )
    assert found.largest == pytest.approx(zero.contraction, abs=1e-6)


def test_the_same_law_called_every_millisecond() -> None:
    """Samples fall anywhere in a step. The walk does not repeat; errors die as they did."""
    robot, law, zero = rabbit()
    found = hs.floquet_multipliers(
        robot, zero.initial_state, law, method=hs.EventDriven(), control_period=1e-3, settling=4,
        returns=3,
    )  # fmt: skip
    assert found.repeats  # but for being late
    assert found.along == pytest.approx(1.0, abs=0.05)
    assert found.largest == pytest.approx(zero.contraction, abs=0.02)
    assert found.error < 0.02


def test_a_walk_whose_returns_take_different_numbers_of_steps() -> None:
    """Time stepping at 1 ms: 1160 to 1173 steps a return, and an uneven map.

    The contraction is measured to a tenth or so, by disturbances of 0.01 and eight returns. Those
    of 1e-5 find 5, of the unevenness and of being late.
    """
    robot, law, zero = rabbit()
    found = hs.floquet_multipliers(
        robot, zero.initial_state, law, method=hs.TimeStepping(step=1e-3), settling=6, returns=8
    )
    assert found.disturbance == pytest.approx(0.01)
    assert found.repeats
    assert found.along == pytest.approx(1.0, abs=0.3)
    assert found.largest == pytest.approx(zero.contraction, abs=0.12)
    assert 0.0 < found.error < 0.12
    assert "stable" in repr(found)
    assert len(found.multipliers) == len(found.coordinates) - 1


class Filtered(hs.Bundle):
    speed: float = hs.cell(float)
    scratch: float = hs.cell(float)
    silent: float = hs.cell(float)
    calls: int = hs.cell(int)


@hs.controller
def listens(state, memory: Filtered, torque):
    """Follow the speed of the hip by a hundredth a call."""
    memory.scratch = state.v[0]
    memory.speed += 0.01 * (memory.scratch - memory.speed)
    memory.calls += 1


def test_what_a_controller_remembers_is_in_the_loop() -> None:
    """A filter that acts on nothing: its multiplier is what it forgets in the calls of a return."""
    robot, cycle = compass()
    found = hs.floquet_multipliers(
        robot, cycle.state, listens(), ground=RAMP, method=METHOD, control_period=5e-3, settling=0,
        returns=1, disturbance=1e-5,
    )  # fmt: skip
    assert found.coordinates[-1] == "memory.speed"
    assert found.neutral == ("memory.silent",)
    assert not any("scratch" in name for name in found.coordinates)
    calls = round(2.0 * found.period / 5e-3)
    nearest = found.multipliers[np.argmin(np.abs(found.multipliers - 0.99**calls))]
    assert nearest == pytest.approx(0.99**calls, rel=0.02)


class Remembers:
    """A controller in Python: a count, a speed that it follows, and what it does not know."""

    def __init__(self) -> None:
        self.count, self.speed = 0.0, 0.0

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        self.count += 1.0
        self.speed += 0.01 * (float(state.v[0]) - self.speed)
        return np.zeros(0)

    def snapshot(self) -> list[float]:
        return [self.count, self.speed, float("nan")]

    def restore(self, numbers: np.ndarray) -> None:
        self.count, self.speed = map(float, numbers[:2])


def test_a_controller_in_python_that_takes_part() -> None:
    robot, cycle = compass()
    found = hs.floquet_multipliers(
        robot, cycle.state, Remembers(), ground=RAMP, method=METHOD, control_period=5e-3,
        settling=0, returns=1, disturbance=1e-5,
    )  # fmt: skip
    assert found.coordinates[-1] == "controller[1]"
    calls = round(2.0 * found.period / 5e-3)
    assert np.abs(found.multipliers - 0.99**calls).min() < 0.005


class Forgetful:
    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        return np.zeros(0)


def test_what_cannot_be_measured() -> None:
    robot, cycle = compass()
    setup = {"ground": RAMP, "method": METHOD}
    with pytest.raises(hs.ControllerError, match="snapshot"):
        hs.floquet_multipliers(robot, cycle.state, Forgetful(), **setup)
    with pytest.raises(hs.SimulationError, match=r"no numbers sped; it has memory\.speed"):
        hs.floquet_multipliers(
            robot, cycle.state, listens(), control_period=5e-3, memory=["sped"], settling=0,
            returns=1, **setup,
        )  # fmt: skip
    with pytest.raises(hs.SimulationError, match="between 0 and 1"):
        hs.floquet_multipliers(robot, cycle.state, disturbance=0.0, **setup)
    with pytest.raises(hs.SimulationError, match="at least one"):
        hs.floquet_multipliers(robot, cycle.state, returns=0, **setup)
    with pytest.raises(hs.LimitCycleError, match="takes no step"):
        hs.floquet_multipliers(mechanisms.rod(), mechanisms.rod().reference_state())
    still = hs.State(cycle.state.q, 0.0 * cycle.state.v)
    with pytest.raises(hs.LimitCycleError, match=r"takes no step|ends after"):
        hs.floquet_multipliers(robot, still, longest_step=0.2, **setup)


def test_numbers_on_which_nothing_hangs() -> None:
    """The last is written again from the second; the third only from itself, and matters."""
    matrix = np.array(
        [[0.5, 0.1, 0.0, 0.0], [0.0, 0.2, 0.0, 0.0], [0.0, 0.0, 0.7, 0.0], [0.0, 9.0, 0.0, 0.0]]
    )
    assert _with_consequence([matrix], 1) == ([0, 1, 2], [3])
