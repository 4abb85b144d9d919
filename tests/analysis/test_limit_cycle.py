"""Limit cycles and Floquet multipliers against closed forms and published ones.

Fixed points and periods hold to 1e-8, the digits that are published; multipliers to 1e-5, the
accuracy of central differences of a map known to 1e-11.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import mechanisms
import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.analysis.limit_cycle import HALVINGS, _moved_on

SPOKE = np.pi / 8.0  # half the angle between two spokes
SLOPE = np.deg2rad(3.0)
PASSIVE = hs.EventDriven(rtol=1e-12, atol=1e-13, swing_feet_pass=True)


def wheel_state(slope: float, speed: float) -> hs.State:
    """State of the wheel just after the impact of a spoke, rolling downhill."""
    hub = np.cos(SPOKE) * np.array([np.sin(slope), np.cos(slope)])
    arm = np.array([-np.sin(SPOKE - slope), np.cos(SPOKE - slope)])
    return hs.State(np.array([*hub, slope]), np.array([speed * arm[1], -speed * arm[0], speed]))


def wheel_cycle(gravity: float, slope: float, inertia: float) -> tuple[float, float]:
    """Speed just after an impact on the limit cycle, and multiplier, in closed form.

    An impact keeps the part (I + cos 2α)/(I + 1) of the speed; rolling adds 4 g sin α sin γ/(I + 1)
    to its square. The map of the square is linear, and so its slope the multiplier.
    """
    kept = (inertia + np.cos(2.0 * SPOKE)) / (inertia + 1.0)
    gain = 4.0 * gravity * np.sin(SPOKE) * np.sin(slope) / (inertia + 1.0)
    return float(kept * np.sqrt(gain / (1.0 - kept**2))), float(kept**2)


@cache
def roll(gravity: float, slope: float, inertia: float) -> hs.LimitCycle:
    """Limit cycle of a wheel that begins a tenth too fast."""
    speed, _ = wheel_cycle(gravity, slope, inertia)
    return hs.find_limit_cycle(
        mechanisms.rimless_wheel(inertia=inertia, gravity=gravity),
        wheel_state(slope, 1.1 * speed),
        ground=hs.Ground(friction=3.0, slope=-slope),
    )


@pytest.mark.parametrize(
    ("gravity", "slope", "speed", "period"),
    [(9.81, 0.08, 1.0954628396, 1.0345498114), (9.8, 0.15, 1.4972474413, 0.5266577771)],
)
def test_rimless_wheel(gravity: float, slope: float, speed: float, period: float) -> None:
    """A wheel with inertia in closed form; without, the published one by extrapolation.

    Without inertia about its hub the wheel has a singular mass matrix. All figures are smooth in
    the inertia, so that two small ones tell the limit up to their square, 1e-10.
    """
    cycle = roll(gravity, slope, 0.01)
    exact, multiplier = wheel_cycle(gravity, slope, 0.01)
    assert cycle.state.v[2] == pytest.approx(exact, abs=1e-8)
    np.testing.assert_allclose(cycle.multipliers, [multiplier], atol=1e-5)
    assert cycle.step_length == pytest.approx(2.0 * np.sin(SPOKE), abs=1e-12)
    assert cycle.residual <= 1e-10
    assert cycle.stable

    def figures(cycle: hs.LimitCycle) -> NDArray[np.float64]:
        return np.array([cycle.state.v[2], cycle.period, cycle.multipliers[0].real])

    limit = 2.0 * figures(roll(gravity, slope, 1e-5)) - figures(roll(gravity, slope, 2e-5))
    np.testing.assert_allclose(limit[:2], [speed, period], atol=1e-8)
    assert limit[2] == pytest.approx(np.cos(2.0 * SPOKE) ** 2, abs=1e-5)


def compass_state(stance: float, swing: float, stance_rate: float, swing_rate: float) -> hs.State:
    """State of the compass gait with its left foot at the origin."""
    hip = np.array([np.cos(stance), -np.sin(stance)]) * stance_rate
    return hs.State(
        np.array([np.sin(stance), np.cos(stance), stance, swing]),
        np.array([*hip, stance_rate, swing_rate]),
    )


@pytest.mark.parametrize(
    ("gravity", "rates", "period"),
    [
        (9.8, (1.091826677, 0.377181558), 0.734720962),
        (9.81, (1.092383590, 0.377373949), 0.734346391),
    ],
)
def test_compass_gait(gravity: float, rates: tuple[float, float], period: float) -> None:
    """The published passive walk, from a start a few hundredths away and in the middle of a step.

    Multipliers do not depend on gravity, which only scales time.
    """
    cycle = hs.find_limit_cycle(
        mechanisms.compass_gait(gravity),
        compass_state(-0.2, 0.34, 1.05, 0.35),
        ground=hs.Ground(friction=3.0, slope=-SLOPE),
        method=PASSIVE,
    )
    stance = int(np.argmin(cycle.state.q[2:]))  # uphill of the hip's foot is the leading one
    order = [2 + stance, 3 - stance]
    np.testing.assert_allclose(cycle.state.q[order], [-0.218668803, 0.323388558], atol=1e-8)
    np.testing.assert_allclose(cycle.state.v[order], rates, atol=1e-8)
    assert cycle.period == pytest.approx(period, abs=1e-8)
    assert cycle.step_length == pytest.approx(0.535445415, abs=1e-8)
    multipliers = np.sort_complex(cycle.multipliers)
    published = [-0.199726 - 0.544476j, -0.199726 + 0.544476j, 0.131573]
    np.testing.assert_allclose(multipliers, published, atol=1e-5)
    assert cycle.stable
    assert "stable" in repr(cycle)


def test_a_cycle_repeats_when_simulated() -> None:
    """Ten steps from the state found: touchdowns a period apart, as far as multipliers < 1 keep."""
    robot, ground = mechanisms.compass_gait(), hs.Ground(friction=3.0, slope=-SLOPE)
    cycle = hs.find_limit_cycle(
        robot, compass_state(-0.2, 0.34, 1.05, 0.35), ground=ground, method=PASSIVE
    )
    run = hs.simulate(
        robot, state=cycle.state, duration=10.1 * cycle.period, method=PASSIVE, ground=ground
    )
    times = [e.time for e in run.events if e.kind.name == "TOUCHDOWN" and e.time > 0.0]
    np.testing.assert_allclose(times, cycle.period * np.arange(1, 11), atol=1e-8)


def test_a_stride_of_two_steps_has_squared_multipliers() -> None:
    """Waiting for one foot alone needs no symmetry; both steps are the same."""
    robot, ground = mechanisms.compass_gait(), hs.Ground(friction=3.0, slope=-SLOPE)
    state = compass_state(-0.2186, 0.3233, 1.0918, 0.3771)
    step = hs.find_limit_cycle(robot, state, ground=ground, method=PASSIVE)
    stride = hs.find_limit_cycle(robot, state, ground=ground, method=PASSIVE, landing=[1])
    assert stride.period == pytest.approx(2.0 * step.period, abs=1e-8)
    assert stride.step_length == pytest.approx(2.0 * step.step_length, abs=1e-8)
    np.testing.assert_allclose(
        np.sort_complex(stride.multipliers), np.sort_complex(step.multipliers**2), atol=1e-5
    )


def test_bravo7_under_computed_torque() -> None:
    """The designed gait is a fixed point, and the controller undoes disturbances within a step.

    Joint errors die like (1 + c t) exp(-20 t) under kp = 400, kd = 40, that is by 1e-5 in 0.7 s.
    """
    gait = walking.gait()
    cycle = hs.find_limit_cycle(
        walking.bravo7(),
        gait.initial_state,
        hs.ComputedTorque(walking.bravo7(), gait),
        ground=hs.Ground(friction=walking.FRICTION),
    )
    assert cycle.period == pytest.approx(gait.step_duration, abs=1e-8)
    assert cycle.step_length == pytest.approx(gait.step_length, abs=1e-8)
    np.testing.assert_allclose(cycle.state.q[1:], gait.initial_state.q[1:], atol=1e-8)
    np.testing.assert_allclose(cycle.state.v, gait.initial_state.v, atol=1e-8)
    assert np.abs(cycle.multipliers).max() <= 1e-3


def test_a_robot_that_does_not_walk() -> None:
    with pytest.raises(hs.LimitCycleError, match="did not complete a step"):
        hs.find_limit_cycle(
            mechanisms.compass_gait(),
            compass_state(-0.2, 0.3, 0.0, 0.0),
            method=PASSIVE,
            ground=hs.Ground(friction=3.0, slope=-SLOPE),
            longest_step=0.3,
        )


def test_a_wheel_with_next_to_no_inertia_about_its_hub() -> None:
    """An impact keeps cos 2α of the speed, so that the multiplier is its square: α = π/8.

    The mass matrix is singular to working precision.
    """
    cycle = hs.find_limit_cycle(
        mechanisms.rimless_wheel(inertia=1e-12),
        wheel_state(0.15, 1.5),
        ground=hs.Ground(friction=3.0, slope=-0.15),
    )
    assert np.abs(cycle.multipliers).max() == pytest.approx(0.5, abs=1e-8)


def test_a_search_that_is_given_no_time() -> None:
    speed, _ = wheel_cycle(9.81, 0.08, 0.01)
    with pytest.raises(hs.LimitCycleError, match="in 0 iterations"):
        hs.find_limit_cycle(
            mechanisms.rimless_wheel(inertia=0.01),
            wheel_state(0.08, 1.1 * speed),
            ground=hs.Ground(friction=3.0, slope=-0.08),
            max_iterations=0,
        )


def test_usable_arguments() -> None:
    robot, state = mechanisms.compass_gait(), compass_state(-0.2, 0.34, 1.05, 0.35)
    with pytest.raises(hs.SimulationError, match="need EventDriven"):
        hs.find_limit_cycle(robot, state, method=hs.TimeStepping())  # type: ignore[arg-type]
    stairs = hs.Ground.stairs(rise=-0.01, tread=0.3, count=3)
    with pytest.raises(hs.SimulationError, match="flat or sloping"):
        hs.find_limit_cycle(robot, state, ground=stairs)
    with pytest.raises(hs.SimulationError, match="landing"):
        hs.find_limit_cycle(robot, state, landing=[7])
    with pytest.raises(hs.SimulationError, match="mirror image"):
        hs.find_limit_cycle(mechanisms.block(), mechanisms.block().reference_state())


def test_a_newton_step_is_halved_until_the_walk_goes_on() -> None:
    """From 0.8 by halves: 0.4 still falls, 0.2 walks; what never walks is left at its shortest."""
    tried: list[float] = []

    class Image:
        def at(self, newton: Any) -> float:
            return float(newton[0])

        def __call__(self, newton: Any) -> None:
            tried.append(self.at(newton))
            if self.at(newton) > limit:
                raise hs.LimitCycleError("fell")

    image: Any = Image()
    limit = 0.3
    assert _moved_on(image, np.array([0.8])) == pytest.approx(0.2)
    np.testing.assert_allclose(tried, [0.8, 0.4, 0.2])
    limit = 0.0
    shortest = 0.8 * 0.5**HALVINGS
    assert _moved_on(image, np.array([0.8])) == pytest.approx(shortest)


class Filtered(hs.Bundle):
    """The speed of a wheel, filtered, and a number that nobody asks about."""

    unused: float = hs.cell(float)
    speed: float = hs.cell(float)


@hs.controller
def listens(state, memory: Filtered, torque):
    """Follow the speed of the wheel by a tenth a call."""
    memory.speed += 0.1 * (state.v[2] - memory.speed)


def test_what_a_sampled_controller_remembers_has_multipliers() -> None:
    """A filter that does not act: its multiplier is what it forgets in the calls of a step.

    The step takes 1.035 s, so that a call every 0.1 s makes eleven of them. The multiplier of the
    wheel itself stays as it is.
    """
    gravity, slope, inertia = 9.81, 0.08, 0.5
    speed, multiplier = wheel_cycle(gravity, slope, inertia)
    forgotten: list[float] = []

    def relabelled(memory: Any, time: float) -> None:
        forgotten.append(time)

    cycle = hs.find_limit_cycle(
        mechanisms.rimless_wheel(inertia=inertia, gravity=gravity),
        wheel_state(slope, 1.02 * speed),
        listens(),
        ground=hs.Ground(friction=3.0, slope=-slope),
        control_period=0.1,
        memory=["speed"],
        relabelled=relabelled,
    )
    calls = np.ceil(cycle.period / 0.1)
    assert min(cycle.period % 0.1, 0.1 - cycle.period % 0.1) > 1e-3
    wanted = sorted([multiplier, 0.9**calls], reverse=True)
    np.testing.assert_allclose(cycle.multipliers, wanted, atol=1e-5)
    assert cycle.residual <= 1e-10
    assert "carries memory" in cycle.differences
    assert 0.3 * speed < cycle.memory[0] < speed
    assert forgotten[-1] == pytest.approx(cycle.period, abs=1e-3)
    with pytest.raises(hs.SimulationError, match="has no sped; it has unused, speed"):
        hs.find_limit_cycle(
            mechanisms.rimless_wheel(inertia=inertia, gravity=gravity), wheel_state(slope, speed),
            listens(), ground=hs.Ground(friction=3.0, slope=-slope), memory=["sped"],
        )  # fmt: skip


def test_ctrl_c_ends_the_search() -> None:
    """It is no step that was not completed, after which the search would go on elsewhere."""
    calls = []

    class Interrupted:
        def torque(self, t: float, state: hs.State, contacts: object) -> NDArray[np.float64]:
            calls.append(t)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hs.find_limit_cycle(
            mechanisms.rimless_wheel(inertia=0.5, gravity=9.81),
            wheel_state(0.08, 1.0),
            Interrupted(),
            ground=hs.Ground(friction=3.0, slope=-0.08),
        )
    assert len(calls) == 1


def test_a_walk_that_goes_on_repeats_after_two_steps() -> None:
    """By samples of no kind: how long it lasts is found, too. Multipliers are those of one squared.

    From a start that is a hundredth too fast.
    """
    robot, ground = mechanisms.compass_gait(), hs.Ground(friction=3.0, slope=-SLOPE)
    setup: dict[str, Any] = {"ground": ground, "method": PASSIVE}
    step = hs.find_limit_cycle(robot, compass_state(-0.2, 0.34, 1.05, 0.35), **setup)
    begin = hs.State(step.state.q, 1.01 * step.state.v)
    found = hs.find_limit_cycle(robot, begin, afresh=False, **setup)
    assert found.steps == 2
    assert found.period == pytest.approx(step.period, abs=1e-9)
    assert found.step_length == pytest.approx(step.step_length, abs=1e-9)
    multipliers = np.sort_complex(found.multipliers)
    np.testing.assert_allclose(multipliers, np.sort_complex(step.multipliers**2), atol=1e-6)
    assert "in 2 steps: stable" in repr(found)
    again = hs.find_limit_cycle(robot, found.snapshot, afresh=False, **setup)  # type: ignore[arg-type]
    assert again.period == pytest.approx(step.period, abs=1e-9)


@pytest.mark.slow
def test_footstep_feedback_repeats_with_its_samples_and_its_memory() -> None:
    """Time stepping at 1 ms, the controller called at every step.

    The walk found is the same after three returns, but for what rounding grows to, and errors die
    in it as those of a walk that has settled are measured to.
    """
    gait, method = walking.gait(), hs.TimeStepping()
    robot, law = walking.bravo7(), hs.FootstepFeedback(walking.bravo7(), gait)
    cycle = hs.find_limit_cycle(robot, gait.initial_state, law, afresh=False, method=method)
    assert cycle.residual <= 1e-10
    assert cycle.steps == 2
    assert cycle.period * 2.0e3 == pytest.approx(round(cycle.period * 2.0e3), abs=1e-6)
    assert cycle.snapshot is not None
    simulation = hs.Simulation(robot, law, state=cycle.snapshot, method=method)
    simulation.advance(simulation.time + 6.0 * cycle.period)
    np.testing.assert_allclose(simulation.state.q[1:], cycle.state.q[1:], atol=1e-9)
    np.testing.assert_allclose(simulation.state.v, cycle.state.v, atol=1e-8)
    for size in (1e-5, 1e-4):  # less than what moves in a sample
        settled = hs.floquet_multipliers(
            robot, cycle.snapshot, law, method=method, settling=0, returns=1, disturbance=size
        )
        largest = float(np.abs(cycle.multipliers[0]))
        assert settled.largest**2 == pytest.approx(largest, rel=5e-3)
        assert settled.along == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(
        hs.LimitCycleError, match=r"is too large: the controller is called.*disturbance=1e-05"
    ):
        hs.floquet_multipliers(
            robot, cycle.snapshot, law, method=method, settling=0, returns=1, disturbance=2e-3
        )


@pytest.mark.slow
def test_a_walk_that_does_not_keep_step_with_its_samples() -> None:
    """The wheel takes a spoke in 1.035 s, and its filter is called every 0.1 s."""
    gravity, slope, inertia = 9.81, 0.08, 0.5
    speed, _ = wheel_cycle(gravity, slope, inertia)
    with pytest.raises(hs.LimitCycleError, match=r"every 0.1 s: it does not keep step with them"):
        hs.find_limit_cycle(
            mechanisms.rimless_wheel(inertia=inertia, gravity=gravity), wheel_state(slope, speed),
            listens(), ground=hs.Ground(friction=3.0, slope=-slope), control_period=0.1,
            afresh=False,
        )  # fmt: skip
    with pytest.raises(hs.LimitCycleError, match=r"between two steps of the method, every 0.001 s"):
        hs.find_limit_cycle(
            mechanisms.rimless_wheel(inertia=inertia, gravity=gravity), wheel_state(slope, speed),
            ground=hs.Ground(friction=3.0, slope=-slope), method=hs.TimeStepping(), afresh=False,
        )  # fmt: skip


def test_arguments_of_controllers_that_begin_afresh() -> None:
    robot, state = mechanisms.compass_gait(), compass_state(-0.2, 0.34, 1.05, 0.35)
    for points in ([0], np.array([0, 1])):
        with pytest.raises(hs.SimulationError, match="landing is for controllers that restart"):
            hs.find_limit_cycle(robot, state, landing=points, afresh=False)  # type: ignore[arg-type]
    kept = hs.Simulation(robot, state=state).snapshot()
    with pytest.raises(hs.SimulationError, match="from a Snapshot use afresh=False"):
        hs.find_limit_cycle(robot, kept)


@pytest.mark.parametrize("afresh", [True, False])
def test_how_long_and_how_closely_it_searches(afresh: bool) -> None:
    robot, state = mechanisms.compass_gait(), compass_state(-0.2, 0.34, 1.05, 0.35)
    for wrong in ({"max_iterations": -1}, {"tolerance": 0.0}, {"tolerance": float("nan")}):
        with pytest.raises(hs.SimulationError, match="max_iterations must not be negative and the"):
            hs.find_limit_cycle(robot, state, afresh=afresh, **wrong)  # type: ignore[arg-type]
