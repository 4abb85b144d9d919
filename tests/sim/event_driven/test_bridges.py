"""Bridges: where events pile up the run goes on, says so, and loses nothing that it should not."""

from __future__ import annotations

from pathlib import Path

import mechanisms
import numpy as np
import pytest
import walking
from scenes.event_judge import judge_events
from scenes.methods import Setting
from scenes.record import Rows
from scenes.scene import random_scene

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.robot import RobotBuilder
from heelstrike.sim import Event, EventKind, RunStatus, Simulation
from heelstrike.sim.event_driven.bridge import MOST_BRIDGES

# Random scenes that ended with events without end, or without a certified solution.
PILED_UP = (37, 48, 55, 66, 118)


def bridges(run: hs.Run) -> list[Event]:
    return [event for event in run.events if event.kind is EventKind.BRIDGE]


@pytest.mark.parametrize("seed", PILED_UP)
def test_a_robot_on_which_events_pile_up_arrives(seed: int) -> None:
    run = Setting.of(random_scene(seed)).run("event_driven")
    assert run.status is RunStatus.COMPLETED, run.message
    assert np.all(np.diff(run.time) >= 0.0)
    assert sum(event.impulse[0] for event in bridges(run)) <= 1e-3 * run.time[-1]


@pytest.mark.parametrize(
    "seed", [3, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (9, 10, 21, 26, 44, 59))]
)
def test_points_that_chatter_to_rest_need_no_bridge_and_no_leap(seed: int) -> None:
    """Several of them, within microseconds; every jump of the velocity is that of its impulses."""
    setting = Setting.of(random_scene(seed))
    run = setting.run("event_driven")
    assert run.status is RunStatus.COMPLETED
    assert not bridges(run)
    assert not setting.judge("event_driven", run).objections


def bridged(begin: float, longer: int) -> tuple[hs.Run, hs.Run]:
    """A walk of bravo7 with a bridge that nothing called for, and the same walk without."""
    law, state = hs.ComputedTorque(walking.bravo7(), walking.gait()), walking.gait().initial_state
    runs = []
    for forced in (True, False):
        simulation = Simulation(
            walking.bravo7(), law, state=state, method=hs.EventDriven(rtol=1e-11, atol=1e-13),
            ground=hs.Ground(friction=walking.FRICTION),
        )  # fmt: skip
        simulation.advance(begin)
        if forced:
            work = simulation._work
            work.decision.bridging, work.series.count = 1, longer
            work.series.begin = begin
        simulation.advance(begin + 1e-6 * 4.0**longer)
        runs.append(simulation.record)
    return runs[0], runs[1]


@pytest.mark.parametrize("begin", [0.02, 0.35, 0.6])
def test_how_wrong_a_bridge_may_be(begin: float) -> None:
    """Its estimate covers its error, and half the length is at least half the error."""
    errors = []
    for longer in (1, 2, 3):
        run, exact = bridged(begin, longer)
        (bridge,) = bridges(run)
        assert bridge.impulse[0] == pytest.approx(1e-6 * 4.0**longer, rel=1e-9)
        apart = max(
            np.abs(run.position[-1] - exact.position[-1]).max(),
            np.abs(run.velocity[-1] - exact.velocity[-1]).max(),
        )
        assert apart <= bridge.impulse[1] + 1e-11
        errors.append(apart)
    assert errors[1] <= 0.3 * errors[2]


def test_what_a_bridge_in_free_fall_is_wrong_by() -> None:
    """It falls with the velocity of its end, too far by ½ g h², and says exactly that."""
    simulation = Simulation(
        mechanisms.rimless_wheel(), state=hs.State([0.0, 3.0, 0.0], [0.0, 0.0, 0.0]),
        method=hs.EventDriven(), stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(0.01)
    length, phase = 1e-6 * 4.0**4, simulation._work
    phase.decision.bridging = 1
    phase.series.count, phase.series.begin = 4, simulation.time
    simulation.advance(0.0105)
    (bridge,) = bridges(simulation.record)
    assert bridge.impulse[0] == pytest.approx(length)
    assert bridge.impulse[1] == pytest.approx(0.5 * 9.81 * length**2, rel=1e-6)


def test_a_bridge_says_how_wrong_it_may_be_with_the_doubt_about_that() -> None:
    """Of a pendulum, q̈ = −ω² sin q, each bridge moves on with the velocity of its end.

    The error of order one from halves, 2 (whole − halves), and what that from quarters,
    4 (halves − quarters), differs from it by: the largest of each.
    """
    build = hs.RobotBuilder("pendulum")
    build.hinge("hinge", None, mass=1.0, inertia=0.05, center_of_mass=(0, -0.5))
    simulation = Simulation(
        build.build(), state=hs.State([1.2], [9.0]), method=hs.EventDriven(),
        stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(0.01)
    begin = simulation.state
    phase, length = simulation._work, 1e-6 * 4.0**4
    phase.decision.bridging = 1
    phase.series.count, phase.series.begin = 4, simulation.time
    simulation.advance(0.01 + length)
    (bridge,) = bridges(simulation.record)

    def reached(parts: int) -> np.ndarray:
        q, v = begin.q[0], begin.v[0]
        for _ in range(parts):
            v -= length / parts * 9.81 * 0.5 / (0.05 + 0.25) * np.sin(q)
            q += length / parts * v
        return np.array([q, v])

    whole, halves, quarters = (reached(parts) for parts in (1, 2, 4))
    first, second = 2.0 * (whole - halves), 4.0 * (halves - quarters)
    doubt = np.abs(first - second).max()
    assert bridge.impulse == pytest.approx((length, np.abs(first).max() + doubt), rel=1e-7)
    assert doubt >= 1e-5 * np.abs(first).max()


def test_loops_hold_at_the_end_of_a_bridge() -> None:
    """Their rows turn on the way: velocities behind it would tear at them by ½ h J̇ v."""
    robot = mechanisms.four_bar()
    simulation = Simulation(
        robot, state=robot.closed(hs.State([0.5, 0.0, 0.0], [4.0, 0.0, 0.0]), keep=["crank"]),
        method=hs.EventDriven(), stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(0.01)
    phase, length = simulation._work, 1e-6 * 4.0**4
    phase.decision.bridging = 1
    phase.series.count, phase.series.begin = 4, simulation.time
    simulation.advance(0.01 + length)
    run, reached = simulation.record, phase.bridge.end  # before the next phase puts it right
    (bridge,) = bridges(run)
    assert run.completed
    assert np.abs(dynamics.loop_displacement(robot, reached[:3])).max() <= 1e-12
    assert np.abs(dynamics.loop_jacobian(robot, reached[:3]) @ reached[3:]).max() <= 1e-6
    assert bridge.impulse[1] <= 1e-4


def test_a_bridge_obeys_the_laws_and_is_kept_in_files(tmp_path: Path) -> None:
    run, _ = bridged(0.35, 2)
    assert len(bridges(run)) == 1
    found = judge_events(run)
    assert found.figures["bridges"] == 1
    assert not [one for one in found.objections if "bridge" in one.law or "impact" in one.law]
    run.save(tmp_path / "run.nc")
    assert hs.load_run(tmp_path / "run.nc").events == run.events


def test_who_carries_a_robot_that_slides_on_stiff_legs_does_not_flicker() -> None:
    """Straight legs that coincide, at their stops, on two heels: one row too many.

    Which heel carries how much turns the free ankle, by friction; the shortest forces that only
    press decide it, not the rounding that elimination pivots on. The record shows these forces:
    they explain how fast the ankle turns, to the second order of the time between rows.
    """
    robot, ground = hs.load_robot("walker2d"), hs.Ground(friction=0.5)
    q = np.array([0.0, 0.0, 4.1, 0.0, 0.0, robot.model.upper[5], 0.0, 0.0, -0.7])
    v = np.array([1.95, 0.0, -4.09, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    at = contact_kinematics(robot, q, v, ground)
    q[1] -= at.gap.min()
    v[1] -= at.velocity[np.argmin(at.gap), 0]
    run = hs.simulate(
        robot, state=hs.State(q, v), duration=0.01, method=hs.EventDriven(), ground=ground,
        stop_when_fallen=False,
    )  # fmt: skip
    assert {event.kind for event in run.events} == {EventKind.SLIP}
    assert run.contact_force[5, 0, 0] > 50.0
    assert run.contact_force[5, 2, 0] > 50.0
    rows = Rows(run, instants=True)
    said = rows.metric.accelerated(rows.smooth + rows.contact_force())[5]
    turned = (run.velocity[6] - run.velocity[4]) / (run.time[6] - run.time[4])
    np.testing.assert_allclose(said, turned, rtol=1e-3, atol=1e-2)


def test_points_on_two_steps_of_a_stair_are_no_group() -> None:
    """A link that leans on the risers of two steps sticks there (a thousand bridges long, once)."""
    run = Setting.of(random_scene(4018)).run("event_driven")
    assert run.status is RunStatus.COMPLETED
    assert not bridges(run)


def test_a_jam_that_steps_get_no_nearer_to_ends_in_a_jump() -> None:
    """Forces grow to a pole; the velocity jumps there, without a bridge that takes its place."""
    run = Setting.of(random_scene(11334)).run("event_driven")
    assert any(e.kind is EventKind.PAINLEVE and e.impulse[0] > 0.0 for e in run.events)
    assert not bridges(run)


def test_a_bridge_in_a_corner_has_the_frame_of_its_row() -> None:
    """A disc between two faces: what is said of two bridges explains how velocities jump."""
    setting = Setting.of(random_scene(11021))
    run = setting.run("event_driven")
    assert bridges(run)
    assert "balance of an impact" not in judge_events(run).broken()


def test_a_robot_that_no_bridge_helps_is_given_up_in_words() -> None:
    """Ten that grew are behind it, and it has not got any further."""
    simulation = Simulation(
        mechanisms.rimless_wheel(inertia=1e-6), state=hs.State([0.0, 1.0, 0.0], [0.0, 0.0, 0.0]),
        method=hs.EventDriven(), stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(0.01)
    phase = simulation._work
    phase.decision.bridging = 1
    phase.series.count, phase.series.begin = MOST_BRIDGES, simulation.time
    simulation.advance(0.02)
    run = simulation.record
    assert run.status is RunStatus.SOLVER_FAILED
    assert run.time[-1] == pytest.approx(0.01)
    assert "each four times as long as the one before" in run.message


# Random scenes on ground with corners in which an impulse was told in one frame and shown in
# another: a bridge, or a second impact, followed an impact in the same instant.
TWO_FRAMES = ((6311, 0.7363), (6884, 0.6266))
# Those that ended a bridge beside the ground, with speeds that its rows had no more: what came down
# there was stopped without an impulse, and friction drove what was still to come to rest.
OFF_THE_GROUND = ((6726, 0.7786), (6877, 0.7408))


@pytest.mark.parametrize(("seed", "duration"), TWO_FRAMES + OFF_THE_GROUND)
def test_bridges_and_impacts_of_one_instant_balance(seed: int, duration: float) -> None:
    setting = Setting.of(random_scene(seed))
    run = setting.run("event_driven", duration=duration)
    assert run.status is RunStatus.COMPLETED
    assert not setting.judge("event_driven", run).objections


def test_what_slides_under_a_torque_that_switches_does_not_jam_forever() -> None:
    """Steps as short as before a pole of the forces, and nothing that a jump could end."""
    build = hs.RobotBuilder("slider")
    cart = build.slide(
        "z", build.slide("x", None, direction=(1, 0), mass=0.0), direction=(0, 1), mass=2.0
    )
    build.contact(cart, (0.0, 0.0))
    build.hinge("arm", cart, at=(0.0, 0.1), mass=0.5, inertia=0.01, torque=1e3)

    @hs.controller
    def switch(t, state, contacts, robot, torque):  # type: ignore[no-untyped-def]
        torque[0] = -800.0 * np.tanh(1e12 * state.v[2])

    run = hs.simulate(
        build.build(), switch(), state=hs.State([0.0, 0.0, 0.3], [3.0, 0.0, 1e-9]), duration=2e-8,
        method=hs.EventDriven(), ground=hs.Ground(friction=0.3), stop_when_fallen=False,
    )  # fmt: skip
    assert run.completed
    assert len(bridges(run)) == 1
    assert sum(event.kind is EventKind.PAINLEVE for event in run.events) < 20


def test_a_bridge_refuses_impulses_that_make_energy() -> None:
    """A rod whose end strikes the ground askew: Newton's restitution alone would make energy.

    With the normal velocity after the impact 0.9 times that before, and friction 1, the impulses of
    the velocity-level problem multiply its kinetic energy by 2.49; without restitution they cannot
    add to it: ½ p·(w⁻ + w⁺) ≤ 0 where w⁺ is perpendicular to what presses, and friction opposes it.
    """
    build = RobotBuilder("rod")
    build.floating_base("rod", mass=1.0, inertia=1.0 / 12.0)
    build.contact("rod", (0.0, -1.0))
    robot = build.build()
    simulation = Simulation(
        robot, state=hs.State([0.0, 3.0, -0.5613], [0.0, 0.0, 0.0]), method=hs.EventDriven(),
        ground=hs.Ground(friction=1.0, restitution=0.9), stop_when_fallen=False,
    )  # fmt: skip
    simulation.advance(1e-3)
    work, memory = simulation._work, simulation._memory
    struck = np.array([0.0, np.cos(0.5613), -0.5613, 0.2336, -0.3435, 2.586])
    assert abs(contact_kinematics(robot, struck[:3], struck[3:]).gap[0]) < 1e-12
    work.step.begin[:], memory.q[:], memory.v[:] = struck, struck[:3], struck[3:]
    work.decision.bridging, work.series.count, work.series.begin = 1, 1, simulation.time
    simulation.advance(1e-3 + 4e-6)
    (bridge,) = bridges(simulation.record)
    assert bridge.time == 1e-3
    mass = dynamics.mass_matrix(robot, struck[:3])
    before, after = (0.5 * v @ mass @ v for v in (struck[3:], work.bridge.after[3:]))
    assert after < before
    assert simulation.record.events[-1].impulse[0] > 0.0  # it was struck
