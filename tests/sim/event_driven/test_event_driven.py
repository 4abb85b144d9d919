"""EventDriven as a simulation method: its options, controllers, records, and bravo7's walk."""

from __future__ import annotations

import dataclasses
from typing import Any

import mechanisms
import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.control.joint_feedback import JointFeedback
from heelstrike.robot import read_mjcf
from heelstrike.sim import (
    Contacts,
    EventKind,
    RunStatus,
)
from heelstrike.sim.event_driven.deciding import LOOKS
from heelstrike.sim.event_driven.moving import NO_BRIDGE
from heelstrike.sim.event_driven.phase import allocate_motion
from heelstrike.sim.frame import Outcome

Floats = NDArray[np.float64]


def walk(**options: object) -> hs.Run:
    settings: dict[str, object] = {
        "state": walking.gait().initial_state,
        "duration": 7.0,
        "method": hs.EventDriven(),
        "ground": hs.Ground(friction=walking.FRICTION),
        "controller": hs.ComputedTorque(walking.bravo7(), walking.gait()),
    }
    settings.update(options)
    return hs.simulate(walking.bravo7(), **settings)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rtol": 0.0}, "rtol"),
        ({"rtol": 1e-20}, "floating point"),
        ({"atol": -1.0}, "atol"),
        ({"atol": np.nan}, "atol"),
        ({"max_step": 0.0}, "max_step"),
        ({"output_period": np.inf}, "output_period"),
        ({"solver": "dantzig"}, "unknown contact solver"),
    ],
)
def test_options_are_checked(options: dict[str, object], words: str) -> None:
    with pytest.raises(hs.SimulationError, match=words):
        hs.EventDriven(**options)  # type: ignore[arg-type]


def test_bravo7_walks_twenty_steps() -> None:
    run = walk(duration=14.05)  # the last touchdown is at 14 s but for rounding
    summary = run.summary(gait=walking.gait())
    assert run.status is RunStatus.COMPLETED
    assert summary.steps == 20
    assert summary.friction_use_max <= 1.0
    assert summary.tracking_rms_rad <= 1e-6  # the gait is an exact solution of the closed loop
    assert run.certificates.penetration <= 1e-10
    assert run.certificates.complementarity <= 1e-9
    assert run.solver.failures == 0
    touchdowns = [e for e in run.events if e.kind is EventKind.TOUCHDOWN and e.time > 0.0]
    times = np.array([e.time for e in touchdowns]).reshape(20, 2)
    np.testing.assert_allclose(times, np.outer(np.arange(1, 21) * 0.7, [1, 1]), atol=1e-6)


def test_feet_on_the_ground_do_not_drift() -> None:
    run = walk(duration=2.0)
    loaded = run.contact_force[..., 0] > 0.0
    assert np.abs(run.gap[loaded]).max() <= 1e-10
    assert np.abs(run.slip_velocity[loaded]).max() <= 1e-12
    for contact in range(walking.bravo7().nc):
        stance = np.flatnonzero(loaded[:, contact] & (run.time > 0.01) & (run.time < 0.69))
        if len(stance):
            place = run.contact_point[stance, contact]
            assert np.ptp(place, axis=0).max() <= 1e-12


def test_error_falls_with_the_tolerance() -> None:
    ends = [
        walk(duration=1.0, method=hs.EventDriven(rtol=rtol, atol=1e-2 * rtol)).position[-1]
        for rtol in (1e-13, 1e-6, 1e-8, 1e-10)
    ]
    errors = [np.abs(end - ends[0]).max() for end in ends[1:]]
    assert errors[0] <= 1e-5
    assert errors[1] <= 1e-7
    assert errors[2] <= 1e-9


def test_time_stepping_converges_to_it() -> None:
    """First order in the step: the touchdowns of time stepping are known to within a step."""
    exact = walk(duration=2.0)
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        run = walk(duration=2.0, method=hs.TimeStepping(step=step))
        errors.append(np.abs(run.position[-1] - exact.position[-1]).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 0.8), (errors, orders)


def test_runs_repeat_bit_by_bit() -> None:
    first, second = walk(duration=1.5), walk(duration=1.5)
    for name in ("time", "position", "velocity", "torque", "contact_force"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.events == second.events


def test_the_record_does_not_change_the_motion() -> None:
    runs = [
        walk(duration=1.5, method=hs.EventDriven(output_period=period), record_every=every)
        for period, every in ((1e-3, 1), (1e-4, 1), (1e-3, 7), (None, 1), (None, 5))
    ]
    for run in runs:
        np.testing.assert_array_equal(run.position[-1], runs[0].position[-1])
        assert run.events == runs[0].events
        assert np.all(np.diff(run.time) >= 0.0)
        assert run.time[0] == 0.0
        assert run.time[-1] == 1.5
    assert len(runs[1].time) > 15000  # more rows than one chunk of the record holds
    # Rows lie where they were asked for, but for the events.
    regular = runs[0].time[np.abs(runs[0].time * 1e3 - np.round(runs[0].time * 1e3)) < 1e-9]
    assert len(np.unique(np.round(regular * 1e3))) == 1501


def test_impacts_have_a_row_before_and_after() -> None:
    run = walk(duration=1.0)
    touchdown = next(e for e in run.events if e.kind is EventKind.TOUCHDOWN and e.time > 0.0)
    rows = np.flatnonzero(np.abs(run.time - touchdown.time) < 1e-11)
    assert len(rows) >= 2
    np.testing.assert_allclose(run.position[rows[0]], run.position[rows[-1]], atol=1e-9)
    change = run.velocity[rows[-1]] - run.velocity[rows[0]]
    assert np.abs(change).max() > 1e-2


def test_a_sampled_controller_holds_its_torques() -> None:
    run = walk(duration=0.3, control_period=1e-2, method=hs.EventDriven(output_period=1e-3))
    assert run.status is RunStatus.COMPLETED
    index = np.floor(run.time * 100.0 + 1e-6).astype(int)
    inside = np.abs(run.time * 100.0 - np.round(run.time * 100.0)) > 1e-6
    for sample in range(30):
        torque = run.torque[inside & (index == sample)]
        assert len(torque) > 0
        assert np.ptp(torque, axis=0).max() == 0.0


class Plain:
    """A stock controller called as a Python object."""

    def __init__(self) -> None:
        self.controller = hs.ComputedTorque(walking.bravo7(), walking.gait())

    def torque(self, t: float, state: hs.State, contacts: Contacts) -> Floats:
        return self.controller.torque(t, state, contacts)


def test_python_and_compiled_controllers_agree_when_sampled() -> None:
    compiled = walk(duration=1.5, control_period=1e-3)
    plain = walk(duration=1.5, control_period=1e-3, controller=Plain())
    assert plain.status is RunStatus.COMPLETED
    np.testing.assert_allclose(plain.position[-1], compiled.position[-1], atol=1e-12)
    default = walk(duration=1.5, controller=Plain())
    np.testing.assert_array_equal(default.position[-1], plain.position[-1])


class Calls(hs.Bundle):
    """How often a controller has been asked."""

    number: int = hs.cell(int)


@hs.controller
def counting(memory: Calls, torque: Floats) -> None:
    """Exert what it remembers having been asked, plus one."""
    memory.number += 1
    for i in range(torque.shape[0]):
        torque[i] = 1e-6 * memory.number


def test_a_controller_remembers_only_accepted_steps() -> None:
    """Within a step every call sees the memory of its beginning, so the torque is that of row 0."""
    controller = counting()
    run = hs.simulate(
        walking.bravo7(),
        controller,
        state=hs.State(walking.bravo7().reference_state().q + np.eye(9)[1], np.zeros(9)),
        duration=0.1,
        method=hs.EventDriven(output_period=None),
        stop_when_fallen=False,
    )
    assert run.status is RunStatus.COMPLETED
    counts = np.round(run.torque[:, 0] * 1e6)
    # Rows are trial calls at the ends of steps: one more than the calls remembered so far.
    np.testing.assert_array_equal(counts, np.arange(len(counts)) + 2)


def test_bad_torques_end_the_run_with_time_and_joint() -> None:
    class Bad:
        def torque(self, t: float, state: hs.State, contacts: Contacts) -> Floats:
            return np.full(6, np.nan if t >= 0.05 else 0.0)

    run = walk(controller=Bad(), duration=1.0)
    assert run.status is RunStatus.CONTROLLER_FAILED
    assert "t = 0.05" in run.message
    assert run.time[-1] == pytest.approx(0.05, abs=2e-3)


def test_a_robot_left_alone_falls() -> None:
    run = walk(controller=None, duration=5.0)
    assert run.status is RunStatus.FELL
    assert run.certificates.complementarity <= 1e-9


def test_zero_duration_records_the_first_instant() -> None:
    run = walk(duration=0.0)
    assert run.status is RunStatus.COMPLETED
    assert len(run.time) >= 1
    np.testing.assert_array_equal(run.position[0], run.position[-1])


def test_pushed_walks_end_with_certificates() -> None:
    """Perturbed starts slip, lift and land in all orders; every solve is certified."""
    generator = np.random.default_rng(7)
    start = walking.gait().initial_state
    for size in (1e-3, 1e-2, 0.1, 0.5, 1.0):
        v = start.v.copy()
        v[3:] += size * generator.standard_normal(6)
        run = walk(state=hs.State(start.q, v), duration=3.0)
        assert run.status in (RunStatus.COMPLETED, RunStatus.FELL), run.message
        assert run.certificates.complementarity <= 1e-9
        assert run.certificates.penetration <= 1e-9
        assert run.solver.failures == 0
        assert all(0.0 <= event.time <= 3.0 for event in run.events)


def test_zeno_does_not_hang() -> None:
    """Bounces that shrink slowly: some hundred thousand in a second would be too many."""
    run = hs.simulate(
        mechanisms.point(),
        state=hs.State(np.array([0.0, 1e-3]), np.zeros(2)),
        duration=30.0,
        method=hs.EventDriven(output_period=0.1),
        ground=hs.Ground(restitution=0.99),
    )
    assert run.status is RunStatus.COMPLETED
    assert run.timing.wall_s < 10.0
    (end,) = [e for e in run.events if e.kind is EventKind.ZENO]
    assert end.time == pytest.approx(np.sqrt(2e-3 / 9.81) * 1.99 / 0.01, abs=1e-7)
    assert np.abs(run.velocity[-1]).max() == 0.0


FORWARD = hs.Push("block", force=(20.0, 0.0), start=0.1, duration=0.2)
BACK = hs.Push("block", force=(-10.0, 0.0), start=0.3, duration=0.1)


@pytest.mark.parametrize(
    ("speed", "options"),
    [
        (0.4, {"pushes": [FORWARD], "control_period": 1e-3, "duration": 0.5}),
        (0.3, {"pushes": [FORWARD, BACK], "duration": 0.5}),
        (0.4, {"pushes": [FORWARD], "control_period": 1e-3, "duration": 0.1 + 0.2}),
    ],
    ids=["a push and a sample", "two pushes", "a sample and the end"],
)
def test_instants_that_differ_by_rounding_are_one(speed: float, options: dict[str, Any]) -> None:
    """Pushes, samples of the controller and the end may fall on 0.3 s and on 0.1 s + 0.2 s.

    No friction: the velocity of the block, of 10 kg, is what the pushes give it.
    """
    assert FORWARD.end > 300 * 1e-3
    builder = hs.RobotBuilder("block")
    builder.floating_base("block", (0.0, 0.1), mass=10.0, inertia=0.5)
    builder.sole("block", heel=(-0.2, -0.1), toe=(0.2, -0.1))
    block = builder.build()
    run = hs.simulate(
        block, state=block.reference_state(), ground=hs.Ground(friction=0.0),
        method=hs.EventDriven(), **options,
    )  # fmt: skip
    assert run.status is RunStatus.COMPLETED, run.message
    assert run.time[-1] == options["duration"]
    np.testing.assert_allclose(run.velocity[-1], [speed, 0.0, 0.0], atol=1e-9)


def test_why_it_could_not_go_on_is_told() -> None:
    simulation = hs.Simulation(
        walking.bravo7(), state=walking.gait().initial_state, method=hs.EventDriven()
    )
    simulation._work.series.reason = NO_BRIDGE
    status, message = simulation._ending(Outcome.SOLVER_FAILED)
    assert status is RunStatus.SOLVER_FAILED
    assert "events followed each other" in message
    assert message.endswith("TimeStepping() asks less of an instant")


def test_a_robot_sunk_in_the_ground_is_refused_whatever_swing_feet_may_do() -> None:
    robot = hs.load_robot("compass_gait")
    sunk = robot.state({"root_z": robot.model.reference[1] - 0.05})
    with pytest.raises(hs.SimulationError, match="deep in the ground"):
        hs.simulate(robot, state=sunk, duration=0.1, method=hs.EventDriven(swing_feet_pass=True))


def test_the_events_of_an_instant_have_room() -> None:
    """Compiled code checks once an instant, not at every event."""
    robot = walking.bravo7()
    model = robot.model.replaced(
        lower=np.full(9, -9.0), upper=np.full(9, 9.0), dry_friction=np.ones(9)
    )
    robot = dataclasses.replace(robot, model=model)
    simulation = hs.Simulation(robot, state=walking.gait().initial_state, method=hs.EventDriven())
    simulation.step()
    contacts = len(allocate_motion(robot).phase.modes.closed)
    assert contacts == 2 * robot.nc + 3 * robot.nv
    assert len(simulation._records[0].told.event_time) > 2 * ((LOOKS + 6) * contacts + 8)


@pytest.mark.parametrize("turn", [0.0, -3.0])
def test_a_run_may_begin_while_a_swing_foot_passes_below_the_ground(turn: float) -> None:
    """The left foot is 15 mm deep and moves down, or slowly up: neither lands it."""
    robot = hs.load_robot("compass_gait")
    start = robot.state(
        {"root_x": np.sin(0.2), "root_z": np.cos(0.2), "right_leg": 0.2, "left_leg": -0.1},
        {
            "root_x": np.cos(0.2), "root_z": -np.sin(0.2), "right_leg": 1.0, "left_leg": turn,
        },
    )  # fmt: skip
    run = hs.simulate(
        robot, state=start, duration=0.02, method=hs.EventDriven(swing_feet_pass=True)
    )
    assert run.status is RunStatus.COMPLETED
    assert not run.events
    np.testing.assert_array_equal(run.position[0], start.q)
    assert np.all(run.gap[:, 1] < -0.01)


PUSHED = """
<mujoco model="pushed">
  <worldbody>
    <geom type="plane" size="10 1 0.1"/>
    <body name="box" pos="0 0 0.05">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <joint name="pitch" type="hinge" axis="0 1 0"/>
      <geom type="box" size="0.1 0.1 0.05" mass="2"/>
    </body>
  </worldbody>
  <actuator><motor name="force" joint="x"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_block_holds_until_the_force_is_all_of_its_friction(direction: float) -> None:
    """A force that grows by 20 N/s moves 2 kg on friction 0.5 from t = 9.81 N / (20 N/s) on.

    Until then the ground holds against it; after that x = (20 N/s) (t − t₀)³ / (6 · 2 kg).
    """
    robot, rate = read_mjcf(PUSHED), 20.0 * direction
    law = JointFeedback(robot, [0.0], torque=[[[0.0, rate]]], kp=0.0, kd=0.0)
    run = hs.simulate(
        robot,
        law,
        state=robot.reference_state(),
        duration=0.6,
        method=hs.EventDriven(output_period=0.05),
        ground=hs.Ground(friction=0.5),
    )
    begins = 0.5 * 2.0 * 9.81 / 20.0
    slips = [event.time for event in run.events if event.kind is EventKind.SLIP]
    np.testing.assert_allclose(slips, begins, atol=1e-7)
    assert slips
    holds = run.time < begins - 1e-6
    tangent = run.contact_force[..., 1].sum(axis=1)
    np.testing.assert_allclose(tangent[holds], -rate * run.time[holds], atol=1e-7)
    assert run.position[-1, 0] == pytest.approx(rate * (0.6 - begins) ** 3 / 12.0, rel=1e-5)


def chain() -> hs.Robot:
    build, link = hs.RobotBuilder("chain"), None
    for index in range(3):
        link = build.hinge(
            f"joint {index}", link, at=(0, -0.5), mass=1.0, inertia=0.02, center_of_mass=(0, -0.25)
        )
    return build.build()


def test_rows_between_steps_are_as_exact_as_the_steps() -> None:
    """Errors are measured as the integration measures them: by the larger value at the two ends."""

    def swings(**options: float | None) -> hs.Run:
        return hs.simulate(
            chain(), state=hs.State([0.3, -0.8, 0.5], [5.0, -9.0, 14.0]), duration=0.25,
            method=hs.EventDriven(**options), stop_when_fallen=False,
        )  # fmt: skip

    exact, rows = swings(rtol=1e-13, atol=1e-14), swings()
    ends = swings(output_period=None)
    after = np.clip(np.searchsorted(ends.time, rows.time - 1e-12), 1, len(ends.time) - 1)
    between = np.min(np.abs(rows.time[:, None] - ends.time), axis=1) > 1e-9
    assert between.sum() >= 200
    for name in ("position", "velocity"):
        size = np.abs(getattr(ends, name))
        scale = 1e-10 + 1e-8 * np.maximum(size[after - 1], size[after])
        off = np.abs(getattr(rows, name) - getattr(exact, name)) / scale
        assert off.max() <= 2.0, name


def test_no_step_is_longer_than_the_longest() -> None:
    """In the air, where nothing asks for a step; and so it is behind a first one of its own."""
    run = hs.simulate(
        chain(), state=hs.State(np.zeros(3), np.zeros(3)), duration=0.1,
        method=hs.EventDriven(max_step=4e-3, output_period=None), stop_when_fallen=False,
    )  # fmt: skip
    assert np.diff(run.time).max() == pytest.approx(4e-3, rel=1e-9)
    assert run.steps == pytest.approx(26, abs=2)
