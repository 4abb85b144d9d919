"""Whole-body control and footstep feedback: they walk, recover, and keep what they promise."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.analysis.recovery import recovery
from heelstrike.control.balance.controllers import WholeBody
from heelstrike.control.balance.reference import reference_of, slope_at, value_at
from heelstrike.dynamics import contact_positions, link_poses
from heelstrike.errors import ControllerError


@cache
def law(**options: Any) -> hs.FootstepFeedback:
    return hs.FootstepFeedback(walking.bravo7(), walking.gait(), **options)


def walked(controller: WholeBody, duration: float, **options: Any) -> hs.Run:
    begin = options.pop("state", walking.gait().initial_state)
    return hs.simulate(walking.bravo7(), controller, state=begin, duration=duration, **options)


def pushed(impulse: float, start: float) -> hs.Push:
    return hs.Push("trunk", force=(10.0 * impulse, 0.0), start=start, duration=0.1)


def effort(run: hs.Run) -> float:
    return float(np.mean(np.sum(run.torque**2, axis=1)))


def test_the_reference_is_the_gait() -> None:
    """Where the swing sole is, and that rates are derivatives."""
    robot, gait = walking.bravo7(), walking.gait()
    reference = reference_of(robot, gait)
    assert value_at(reference.swing_x, 0.0) == pytest.approx(-gait.step_length, abs=1e-9)
    assert value_at(reference.swing_x, 1.0) == pytest.approx(gait.step_length, abs=1e-9)
    assert value_at(reference.swing_z, 1.0) == pytest.approx(0.0, abs=1e-9)
    for table in (reference.hip, reference.capture, reference.joints[1, :, 2]):
        rate = (value_at(table, 0.61) - value_at(table, 0.59)) / 0.02
        assert slope_at(table, 0.6) == pytest.approx(rate, abs=2e-3 * max(1.0, abs(rate)))
    mirrored = gait.mirrored(gait.in_step(0.3 * gait.step_duration))
    for i in range(robot.nu):
        assert value_at(reference.joints[1, :, i], 0.3) == pytest.approx(mirrored[i], abs=1e-5)


@pytest.mark.parametrize("kind", [hs.WholeBody, hs.FootstepFeedback])
def test_undisturbed_it_is_the_gait_at_its_price(kind: type[WholeBody]) -> None:
    """Length and duration of the step to 2 %; torques no more than computed torque's by half."""
    robot, gait = walking.bravo7(), walking.gait()
    run = walked(kind(robot, gait), 5.0 * gait.step_duration)
    assert run.completed
    steps = 4
    now = np.searchsorted(run.time, (5.0 - steps) * gait.step_duration)
    length = (run.position[-1, 0] - run.position[now, 0]) / steps
    assert length == pytest.approx(gait.step_length, rel=0.02)
    usual = walked(hs.ComputedTorque(robot, gait), 2.0 * gait.step_duration)  # type: ignore[arg-type]
    assert effort(run) < 1.5 * effort(usual)


@pytest.mark.parametrize("phase", [0.1, 0.7])
def test_a_small_push_is_answered_within_a_step_and_alarms_nobody(phase: float) -> None:
    """The capture point at the second landing is off by a tenth of the push's own 12 mm."""
    step = walking.gait().step_duration

    def landings(run: hs.Run) -> np.ndarray:
        ends = np.nonzero(np.diff(run.log["phase"].values) < -0.5)[0]
        found: np.ndarray = run.log["capture_point"].values[ends - 1]
        return found[3:]

    run = walked(law(), 9.5 * step, pushes=pushed(3.0, (2.0 + phase) * step))
    off = landings(run) - landings(walked(law(), 9.5 * step))
    assert np.abs(off).max() < 1.5e-3
    assert run.log["alarm"].values[run.time > 3.5 * step].max() == 0.0


def test_small_errors_die_out_from_step_to_step() -> None:
    """Those of the robot, of the slope that is believed and of the clock, by a fifth and less.

    A slope that is estimated from a foot still in the air confirms itself: 0.5 a step.
    """
    found = hs.floquet_multipliers(
        walking.bravo7(), walking.gait().initial_state, law(), settling=10, returns=1,
        memory=["slope", "phase", "start"],
    )  # fmt: skip
    assert found.largest < 0.2


def test_an_alarm_ends() -> None:
    """Also that of a large push, after which the gait itself goes on."""
    step = walking.gait().step_duration
    run = walked(law(), 16.0 * step, pushes=pushed(50.0, 2.3 * step))
    assert run.log["alarm"].values.max() == 1.0
    assert run.log["alarm"].values[-1] == 0.0


@pytest.mark.parametrize("impulse", [40.0, -40.0])
def test_it_recovers_from_a_push(impulse: float) -> None:
    begin = 2.3 * walking.gait().step_duration
    run = walked(law(), begin + 5.1, pushes=pushed(impulse, begin), record_every=5)
    found = recovery(run, after=5.0)
    assert found, found.reason


def test_the_law_that_does_not_step_elsewhere_falls_of_such_a_push() -> None:
    """So that the test above tests the footsteps."""
    fixed = hs.WholeBody(walking.bravo7(), walking.gait())
    run = walked(fixed, 7.0, pushes=pushed(40.0, 1.61))
    assert run.status == hs.RunStatus.FELL


def test_torques_cone_and_sole_are_never_left() -> None:
    """Of the programme's answers, while they are told to keep them all."""
    robot = walking.bravo7()
    simulation = hs.Simulation(
        robot, law(), state=walking.gait().initial_state, pushes=pushed(60.0, 0.9)
    )
    memory = simulation._numbers.memory
    numbers = simulation.parameters
    seen = 0
    while simulation.time < 2.1:
        simulation.advance(simulation.time + 0.004)
        asked = simulation.state.q
        simulation.step()  # the torques of this one are for the state before it
        program, on = memory.program, memory.on
        torque = on.torque @ program.x + on.hold
        assert np.all(np.abs(torque) <= 300.0 * (1.0 + 1e-9))
        if program.relaxed:
            continue
        seen += 1
        link = robot.feet[memory.stance].link
        tilt = link_poses(robot, asked).angle[link]
        x, z, moment = on.wrench @ program.x + on.load
        along, normal = x * np.cos(tilt) - z * np.sin(tilt), x * np.sin(tilt) + z * np.cos(tilt)
        assert normal >= numbers.least_force * (1.0 - 1e-9)
        assert abs(along) <= numbers.friction * normal * (1.0 + 1e-9)
        assert numbers.planning.heel - 1e-9 <= -moment / normal <= numbers.planning.toe + 1e-9
    assert seen > 200


def test_it_stands_starts_and_stops_on_command() -> None:
    robot = walking.bravo7()
    simulation = hs.Simulation(robot, law(speed=0.0), state=robot.reference_state())
    memory = simulation._numbers.memory
    simulation.advance(0.5)
    assert (memory.stands, memory.steps) == (1, 0)
    simulation.parameters.speed = 0.3
    simulation.advance(4.0)
    assert memory.stands == 0
    assert simulation.state.v[0] > 0.1
    assert simulation.state.q[0] > 0.6
    simulation.parameters.speed = 0.0
    simulation.advance(7.0)
    assert memory.stands == 1
    assert np.abs(simulation.state.v).max() < 0.05
    assert simulation.state.q[1] > 0.9


def test_it_stands_still() -> None:
    """Both feet on the ground, for as long as it likes."""
    robot = walking.bravo7()
    simulation = hs.Simulation(robot, law(speed=0.0), state=robot.reference_state())
    simulation.advance(6.0)
    stood = simulation.state.q
    simulation.advance(20.0)
    assert simulation.state.q == pytest.approx(stood, abs=1e-3)
    assert contact_positions(robot, simulation.state.q)[:, 1] == pytest.approx(0.0, abs=1e-4)


def test_it_stands_with_bent_knees() -> None:
    """A straight one could not be bent in time: there it moves the hip hardly at all."""
    simulation = hs.Simulation(
        walking.bravo7(), law(speed=0.0), state=walking.bravo7().reference_state()
    )
    simulation.advance(3.0)
    legs = simulation.parameters.legs
    joints = simulation.state.q[walking.bravo7().model.actuator_joint]
    bent = legs.bend * (joints[legs.knee] - legs.straight)
    assert np.all(bent > 0.19)


@pytest.mark.parametrize(
    ("impulse", "steps"),
    [(15.0, False), (-16.0, False), (60.0, True), (100.0, True), (-95.0, True)],
)
def test_pushed_as_it_stands_it_stands_again(impulse: float, steps: bool) -> None:
    """Without a step as long as the sole is long enough for the capture point."""
    robot = walking.bravo7()
    begin = robot.reference_state()
    run = walked(law(speed=0.0), 9.1, state=begin, pushes=pushed(impulse, 1.0), record_every=5)
    found = recovery(run, after=8.0)
    assert found, found.reason
    assert (run.log["phase"].values.max() > 0.0) == steps


@pytest.mark.parametrize("corner", [1.1, 1.17, 1.2])
def test_a_foot_that_hits_a_riser_steps_over_it(corner: float) -> None:
    """It does not jam with its toe at the edge: the heel comes to stand on top, too."""
    robot = walking.bravo7()
    profile = [[-1.0, 0.0], [corner, 0.0], [corner, 0.04], [9.0, 0.04]]
    simulation = hs.Simulation(
        robot, law(), state=walking.gait().initial_state, ground=hs.Ground(profile=profile)
    )
    memory = simulation._numbers.memory
    hit = 0
    while simulation.time < 7.0:
        steps = memory.steps
        simulation.advance(simulation.time + 0.002)
        hit += memory.lifting
        if memory.steps > steps:
            link = robot.feet[memory.stance].link
            assert abs(link_poses(robot, simulation.state.q).angle[link]) < 0.3
    assert hit > 0
    assert simulation.status == hs.RunStatus.COMPLETED
    assert simulation.state.q[0] > 2.3


def test_a_slight_slope_is_believed_at_once() -> None:
    """All but an eighth of it after a landing, and what is left of that after the next."""
    slope = hs.Ground(profile=[[-1.0, 0.0], [0.6, 0.0], [5.6, 0.15]])
    told = walked(law(), 5.6, ground=slope).log["slope"].values
    steep = told[np.nonzero(np.diff(told))[0] + 1]
    assert np.sum((steep > 1e-3) & (steep < 0.029)) <= 2


def test_it_finds_the_ground_where_it_is_not_expected() -> None:
    """A step down, a step up and a slope that nobody told it of."""
    for rise, ends in ((-0.06, 1.05), (0.04, 1.05)):
        profile = [[-1.0, 0.0], [ends, 0.0], [ends, rise], [4.0, rise]]
        run = walked(law(), 5.6, ground=hs.Ground(profile=profile), record_every=10)
        assert run.completed, run.message
        assert run.position[-1, 0] > 1.8
        assert run.position[:, 1].min() > 0.65 * run.position[0, 1]
    slope = hs.Ground(profile=[[-1.0, 0.0], [0.6, 0.0], [3.6, 0.3]])
    run = walked(law(), 5.6, ground=slope, record_every=10)
    assert run.completed
    assert run.log["slope"].values[-1] == pytest.approx(0.1, abs=0.02)


def test_it_looks_for_the_ground_at_the_end_of_a_step_only() -> None:
    """What it remembers of being late is a small error before: no foot is thrown down for it."""
    found = []
    for late in (0.0, 1e-3):
        simulation = hs.Simulation(walking.bravo7(), law(), state=walking.gait().initial_state)
        simulation.advance(0.3)
        simulation.memory.late = late
        simulation.advance(0.32)
        found.append(simulation.state.v)
    np.testing.assert_array_equal(*found)


def test_feet_that_do_not_lie_flat_are_not_thrown_about() -> None:
    """Ground with corners at random heights of ±30 mm: feet stand on one end before they turn."""
    rng = np.random.default_rng(5)
    x = 0.6 + 0.15 * np.arange(40)
    z = rng.uniform(-0.03, 0.03, len(x))
    profile = np.column_stack(([-9.0, 0.6, *x, 9.0], [0.0, 0.0, *z, 0.0]))
    run = walked(law(), 12.0 * 0.7, ground=hs.Ground(profile=profile), record_every=10)
    assert run.completed, run.message
    assert np.abs(run.position[:, 2]).max() < 0.6
    assert run.position[-1, 0] > 2.5


@pytest.mark.parametrize("corner", [0.985, 1.283])
def test_a_foot_whose_toe_is_beyond_an_edge_makes_the_next_one_lift(corner: float) -> None:
    """It turns over the edge, its middle sinks, and a swing foot held as ever would scuff."""
    profile = [[-9.0, 0.0], [corner, 0.0], [corner, -0.06], [9.0, -0.06]]
    run = walked(law(), 7.0, ground=hs.Ground(profile=profile), record_every=10)
    assert run.completed, run.message
    assert np.abs(run.position[:, 2]).max() < 0.4


def test_a_foot_on_its_heel_has_the_cone_of_the_ground_under_it() -> None:
    """Turned by 0.9 rad it may be pushed forwards: that of its sole would be atan 0.6 wide."""
    robot, begin = walking.bravo7(), walking.gait().initial_state
    foot = robot.feet[walking.gait().stance_foot]
    q = begin.q.copy()
    q[foot.link] -= robot.model.axis[foot.link, 0] * 0.9
    heel, toe = sorted(contact_positions(robot, q)[list(foot.contacts)], key=lambda end: end[1])
    assert toe[0] > heel[0]
    q[1] -= heel[1]
    simulation = hs.Simulation(robot, law(), state=hs.State(q, np.zeros(robot.nv)))
    simulation.advance(0.002)
    program, on = simulation.memory.program, simulation.memory.on
    ahead, upwards, _ = on.wrench @ program.x + on.load
    assert upwards > 0.5 * simulation.parameters.weight
    assert 0.0 < ahead < 0.6 * upwards


@pytest.mark.parametrize("height", [-0.5e-3, -1.5e-3])
def test_a_wall_beside_a_toe_is_no_ground_under_it(height: float) -> None:
    """Just beyond an edge the nearest ground is the riser: its cone would bear no weight."""
    robot, begin = walking.bravo7(), walking.gait().initial_state
    foot = robot.feet[walking.gait().stance_foot]
    q = begin.q.copy()
    q[foot.link] += robot.model.axis[foot.link, 0] * 0.3  # on its toe
    heel, toe = sorted(contact_positions(robot, q)[list(foot.contacts)], key=lambda end: end[0])
    assert toe[1] < heel[1] - 0.02
    q[1] += height - toe[1]
    edge = toe[0] - 0.5e-3
    ground = hs.Ground(profile=[[-9.0, 0.0], [edge, 0.0], [edge, -0.06], [9.0, -0.06]])
    state = hs.State(q, np.zeros(robot.nv))
    simulation = hs.Simulation(robot, law(), state=state, ground=ground)
    simulation.advance(0.001)
    program, on = simulation.memory.program, simulation.memory.on
    ahead, upwards, _ = on.wrench @ program.x + on.load
    assert upwards > 0.0
    assert abs(ahead) < upwards


def test_it_logs_what_it_plans() -> None:
    run = walked(law(), 0.35)
    assert run.log["phase"].values[-1] == pytest.approx(0.5, abs=0.01)
    assert run.log["foothold"].values[-1] == pytest.approx(walking.gait().step_length, abs=0.005)
    assert run.log["remaining"].values[-1] == pytest.approx(0.35, abs=0.01)


def test_numbers_are_those_of_the_robot_by_its_size() -> None:
    parameters = law().parameters
    assert parameters.weight == pytest.approx(75.0 * 9.81)
    assert parameters.planning.toe == pytest.approx(0.09)
    assert parameters.legs.bend.tolist() == [1.0, 1.0]
    assert parameters.legs.length == pytest.approx(0.8838)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"numbers": {"crouching": 0.1}}, "no number 'crouching'; there are .*crouch, "),
        ({"numbers": {"crouch": np.nan}}, "crouch must be a finite number"),
        ({"friction": 0.0}, "friction must be positive"),
    ],
)
def test_wrong_numbers_are_named(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ControllerError, match=said):
        law.__wrapped__(**options)


def test_robots_it_cannot_control_are_refused() -> None:
    rabbit = hs.load_robot("rabbit")
    with pytest.raises(ControllerError, match="moves the joints"):
        hs.FootstepFeedback(rabbit, walking.gait())


def test_motors_are_asked_for_what_their_lines_leave_at_their_speed() -> None:
    """A motor that already turns the way it pushes gives less: τ ≤ τ₀ (1 − ω/ω₀), and as much more
    against its speed."""
    robot = walking.bravo7()
    n, joints = robot.nv, robot.model.actuator_joint
    lines = {"stall_torque": np.full(n, 60.0), "no_load_speed": np.full(n, 8.0)}
    weak = dataclasses.replace(robot, model=robot.model.replaced(**lines))
    whole = hs.WholeBody(weak, walking.gait())
    start, driving = walking.gait().initial_state, 0
    contacts = hs.Simulation(weak, state=start).contacts
    for seed in range(6):
        v = start.v.copy()
        v[joints] = np.random.default_rng(seed).uniform(-6.0, 6.0, robot.nu)
        torque = np.asarray(whole.torque(0.0, hs.State(start.q, v), contacts))
        part = v[joints] / 8.0
        least, most = 60.0 * (-1.0 - part), 60.0 * (1.0 - part)
        assert np.all(torque >= least - 1e-9), seed
        assert np.all(torque <= most + 1e-9), seed
        at_line = np.isclose(torque, most) | np.isclose(torque, least)
        driving += int(np.sum(at_line & (torque * part > 0.0)))
    assert driving > 0  # the line bites where motors drive
