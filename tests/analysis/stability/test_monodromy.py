"""Products of flows and saltation matrices against closed forms and differences of whole steps."""

from __future__ import annotations

from functools import cache
from typing import Any

import mechanisms
import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.analysis.poincare_map import PoincareMap, Section
from heelstrike.analysis.step_image import StepImage
from heelstrike.experiments.passive import METHOD, passive_walk
from heelstrike.sim import EventKind
from heelstrike.sim.linearized.flow import Variation

SLOPE = 0.06


@cache
def passive(name: str) -> tuple[hs.Robot, hs.Ground, hs.LimitCycle]:
    robot, ramp = hs.load_robot(name), hs.Ground(friction=3.0, slope=-SLOPE)
    return robot, ramp, passive_walk(robot, ramp)


FINE = hs.EventDriven(rtol=1e-12, atol=1e-13)


def agree(
    step: hs.Monodromy, cycle: hs.LimitCycle, tolerance: float, robot: hs.Robot, ground: hs.Ground,
    *, law: hs.Controller | None = None, method: hs.EventDriven = FINE,
) -> NDArray[np.complex128]:  # fmt: skip
    """Compare with differences of whole steps, of fourth order, and return their multipliers."""
    assert step.period == pytest.approx(cycle.period, abs=1e-9)
    assert cycle.differences == ""
    np.testing.assert_allclose(cycle.multipliers, step.multipliers, atol=1e-7)
    section = Section(robot, ground)
    walked = PoincareMap(section, law, method, None, None, 3.0)
    image = StepImage(walked, section.chart(cycle.state), cycle.memory)
    other = np.linalg.eigvals(image.sharp_differences())
    mine, other = np.sort_complex(step.multipliers), np.sort_complex(other)
    np.testing.assert_allclose(mine, other, atol=tolerance)
    return other


def test_rimless_wheel_in_closed_form() -> None:
    """The multiplier is ((I + cos 2α)/(I + 1))², here of eight spokes of 1 m and 1 kg."""
    inertia, slope = 0.1, 0.15
    robot = mechanisms.rimless_wheel(inertia=inertia)
    ramp, spoke = hs.Ground(friction=3.0, slope=-slope), np.pi / 8.0
    kept = (inertia + np.cos(2.0 * spoke)) / (inertia + 1.0)
    gain = 4.0 * 9.81 * np.sin(spoke) * np.sin(slope) / (inertia + 1.0)
    rate = kept * np.sqrt(gain / (1.0 - kept**2))
    hub = np.cos(spoke) * np.array([np.sin(slope), np.cos(slope)])
    arm = np.array([-np.sin(spoke - slope), np.cos(spoke - slope)])
    state = hs.State(np.array([*hub, slope]), rate * np.array([arm[1], -arm[0], 1.0]))
    cycle = hs.find_limit_cycle(robot, state, ground=ramp)  # tells the spokes apart as it does
    step = hs.monodromy(robot, cycle.state, ground=ramp)
    np.testing.assert_allclose(step.multipliers, [kept**2], atol=1e-9)
    assert "1 events" in repr(step)


@pytest.mark.parametrize(
    ("name", "events"),
    [
        ("compass_gait", [(EventKind.TOUCHDOWN, EventKind.LIFTOFF)]),
        # The knee strikes its stop and is latched, then the foot strikes and lets the knee go.
        ("kneed_walker", [
            (EventKind.IMPACT, EventKind.JOINT_STOP),
            (EventKind.TOUCHDOWN, EventKind.JOINT_STOP, EventKind.JOINT_RELEASE, EventKind.LIFTOFF),
        ]),
    ],
)  # fmt: skip
def test_passive_walkers(name: str, events: list[tuple[EventKind, ...]]) -> None:
    """Differences of fourth order leave some 1e-9 of a multiplier."""
    robot, ramp, cycle = passive(name)
    step = hs.monodromy(robot, cycle.state, ground=ramp, method=METHOD)
    agree(step, cycle, 2e-8, robot, ramp, method=METHOD)
    assert [each.kinds for each in step.saltations] == events
    assert all(each.spread == 0.0 for each in step.saltations)


def test_round_feet_roll() -> None:
    """Where a foot stands moves on as it rolls, and not with the point that touches the ground.

    No published walk: the multipliers are those of differences of whole steps, of fourth order.
    """
    robot = mechanisms.compass_gait(radius=0.2)
    ramp = hs.Ground(friction=3.0, slope=-np.deg2rad(2.0))
    q = np.array([-0.18185358, 0.97727248, -0.23829057, 0.30810374])
    v = np.array([1.21196193, 0.22552524, 1.2401474, 0.84603571])
    cycle = hs.find_limit_cycle(robot, hs.State(q, v), ground=ramp, method=METHOD)
    step = hs.monodromy(robot, cycle.state, ground=ramp, method=METHOD)
    agree(step, cycle, 5e-8, robot, ramp, method=METHOD)
    assert not cycle.stable
    # What a step makes of errors that the foot on the ground allows are such errors.
    moved = step.matrix @ step.tangent
    np.testing.assert_allclose(step.tangent @ (step.tangent.T @ moved), moved, atol=1e-9)


@cache
def rabbit() -> tuple[hs.Robot, hs.VirtualConstraints, hs.ZeroDynamics]:
    robot, phased = walking.rabbit(), walking.rabbit_phased()
    return robot, hs.VirtualConstraints(phased), hs.zero_dynamics(phased)


def test_virtual_constraints_have_the_multiplier_of_their_zero_dynamics() -> None:
    robot, law, zero = rabbit()
    step = hs.monodromy(robot, zero.initial_state, law)
    assert step.multipliers[0] == pytest.approx(zero.contraction, abs=1e-7)


@pytest.mark.slow
def test_a_foot_that_slips_in_the_impact_and_comes_to_rest() -> None:
    """On little friction the new foot slides on for a while: an event of its own.

    The largest multiplier by differences has an error of 1e-9; the smallest, of 1e-5, of some 1e-5,
    as the law's disturbances reach beyond the time at which the foot rests.
    """
    robot, law, zero = rabbit()
    ground = hs.Ground(friction=0.3)
    cycle = hs.find_limit_cycle(robot, zero.initial_state, law, ground=ground)
    step = hs.monodromy(robot, cycle.state, law, ground=ground)
    other = agree(step, cycle, 2e-5, robot, ground, law=law)
    assert step.multipliers[0].real == pytest.approx(other.real.max(), abs=1e-8)
    assert [each.kinds[0] for each in step.saltations] == [EventKind.STICK, EventKind.TOUCHDOWN]


def test_bravo7_under_computed_torque() -> None:
    """Heel and toe come down together; errors of which first die out before they matter."""
    robot, gait = walking.bravo7(), walking.gait()
    law = hs.ComputedTorque(robot, gait)
    ground = hs.Ground(friction=walking.FRICTION)
    step = hs.monodromy(robot, gait.initial_state, law, ground=ground)
    assert np.abs(step.multipliers).max() <= 1e-3
    (touchdown,) = step.saltations
    assert touchdown.spread > 1.0


class Lag(hs.Bundle):
    usual: float = hs.cell(float)
    told: float = hs.cell(float)
    rate: float = hs.cell(float)


@hs.controller
def lags(t, state, memory: Lag, torque):
    """Brake by what the rate was, and by what never changes; note the time for nothing."""
    memory.told = t
    memory.rate += 0.01 * (state.joint_velocity[0] - memory.rate)
    torque[0] = -1e-4 * (memory.rate + memory.usual)


class Note(hs.Bundle):
    begun: int = hs.cell(int)
    told: float = hs.cell(float)


@hs.controller
def notes(state, memory: Note, torque):
    """Brake by what the rate was as the step began."""
    if memory.begun == 0:
        memory.begun = 1
        memory.told = state.joint_velocity[0]
    torque[0] = -1e-4 * memory.told


class Silent:
    """A controller in Python, which is called every millisecond."""

    def torque(self, t: float, state: hs.State, contacts: object) -> NDArray[np.float64]:
        return np.zeros(6)


@hs.controller
def stiff(state, torque):
    torque[0] = -1e6 * state.joint_position[0]


def test_a_stiff_law() -> None:
    """A spring of 1000 rad/s swings thrice in 20 ms, of which a usual stretch is too long."""
    build = hs.RobotBuilder("spring")
    build.hinge("joint", None, mass=1.0, inertia=1.0, center_of_mass=(0.0, 0.0), torque=1e3)
    robot = build.build()
    law, still = stiff(), hs.State(np.zeros(1), np.zeros(1))
    rest = hs.Simulation(robot, law, state=still, method=hs.EventDriven())
    found = Variation(rest, law).flow(0.0, 0.02, hs.ActiveContacts())
    cosine, sine = np.cos(20.0), np.sin(20.0)
    turned = [[cosine, 1e-3 * sine], [-1e3 * sine, cosine]]
    np.testing.assert_allclose(found, turned, rtol=1e-7)


def vary(controller: Any) -> None:
    """Begin to go through a flight of bravo7."""
    robot, high = walking.bravo7(), walking.bravo7().reference_state().q
    high[1] += 1.0
    state = hs.State(high, np.full(robot.nv, 0.1))
    flight = hs.Simulation(robot, controller, state=state, method=hs.EventDriven())
    Variation(flight, controller).flow(0.0, 0.02, hs.ActiveContacts())


def test_what_cannot_be_linearised() -> None:
    robot, ramp, cycle = passive("compass_gait")
    moved = hs.State(cycle.state.q, 1.01 * cycle.state.v)
    with pytest.raises(hs.LimitCycleError, match="does not repeat"):
        hs.monodromy(robot, moved, ground=ramp, method=METHOD)
    with pytest.raises(hs.SimulationError, match="is sampled"):
        vary(Silent())
    with pytest.raises(hs.SimulationError, match=r"memory\.rate changes within a step"):
        vary(lags())
    with pytest.raises(hs.SimulationError, match=r"memory\.told keeps something of the state"):
        vary(notes())
