"""Loops beside contact, stops and dry friction, under all methods and on all ways through them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mechanisms import four_bar, geared, parallel_ankles

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.robot import Robot, RobotBuilder
from heelstrike.sim import memory
from heelstrike.sim.closed_sets import EventKind

ONE = ("left",)


def falling(robot: Robot) -> hs.State:
    """Return a state a little above the ground, with bent knees and moving."""
    pose = {"left_hip": -0.2, "left_knee": 0.3, "right_knee": 0.2}
    known = {name: value for name, value in pose.items() if name in robot.joint_names}
    state = robot.closed(robot.state(known, {"root_x": 0.3, "left_knee": -1.0}))
    state = robot.placed(state, hs.Ground())
    return robot.state({"root_z": state.q[1] + 0.02}, start=state)


def test_methods_agree_on_a_leg_with_a_parallel_ankle_that_lands() -> None:
    """The sole lands with its toe, then its heel. Time stepping converges with order one."""
    robot = parallel_ankles(ONE, dry_friction=1.0)
    start: Any = {"state": falling(robot), "duration": 0.2}
    exact = hs.simulate(robot, method=hs.EventDriven(rtol=1e-9, atol=1e-11), **start)
    assert {e.kind for e in exact.events} >= {EventKind.TOUCHDOWN, EventKind.STICK}
    errors = []
    for step in (1e-4, 1e-5):
        run = hs.simulate(robot, method=hs.TimeStepping(step=step), **start)
        assert run.completed
        assert run.gap.min() > -1e-7
        errors.append(np.abs(run.final_state.q - exact.final_state.q).max())
        drift = [np.abs(dynamics.loop_displacement(robot, q)).max() for q in run.position[::99]]
        assert max(drift) < 1e-13
    assert errors[1] < 2e-4
    assert errors[1] < 0.2 * errors[0]
    soft = hs.simulate(robot, method=hs.Compliant(), **start)
    np.testing.assert_allclose(soft.final_state.q, exact.final_state.q, rtol=0, atol=1e-2)
    assert np.abs(dynamics.loop_displacement(robot, soft.final_state.q)).max() < 1e-13


def test_straight_line_code_and_loops_over_links_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = parallel_ankles(ONE, dry_friction=1.0)
    start: Any = {"state": falling(robot), "duration": 0.12}
    straight = hs.simulate(robot, **start)
    monkeypatch.setattr(memory, "usual_points", lambda _: np.zeros(0, dtype=np.int64))
    looped = hs.simulate(robot, **start)
    assert len(straight.events) > 1
    np.testing.assert_allclose(looped.final_state.q, straight.final_state.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(looped.loop_force, straight.loop_force, rtol=1e-6, atol=1e-6)


def hanging_chain() -> tuple[Robot, hs.State]:
    """Chain of 14 links that hangs from both ends: too long for straight-line code."""
    build, last = hs.RobotBuilder("chain"), None
    x = 0.1 * np.arange(15)
    corners = np.column_stack([x, -0.35 * x * (1.4 - x)])
    for i, way in enumerate(np.diff(corners, axis=0)):
        at = corners[0] if i == 0 else corners[i] - corners[i - 1]
        last = build.hinge(
            f"joint_{i}", last, at=at, mass=0.1 + 0.01 * i, inertia=1e-4, center_of_mass=0.5 * way
        )
    assert last is not None
    build.loop(last, None, at=np.diff(corners, axis=0)[-1])
    robot = build.build()
    return robot, robot.closed(robot.state(velocity={"joint_0": 2.0}))


def test_a_long_chain_keeps_its_energy_and_its_end() -> None:
    robot, state = hanging_chain()
    before = sum(dynamics.energy(robot, state.q, state.v))
    method = hs.EventDriven(rtol=1e-9, atol=1e-11)
    run = hs.simulate(robot, state=state, duration=0.3, method=method)
    after = sum(dynamics.energy(robot, run.final_state.q, run.final_state.v))
    assert abs(after - before) < 1e-9
    assert np.abs(run.final_state.q - state.q).max() > 0.1
    assert np.abs(dynamics.loop_displacement(robot, run.final_state.q)).max() < 1e-13
    stepped = hs.simulate(robot, state=state, duration=0.3, method=hs.TimeStepping(step=1e-4))
    np.testing.assert_allclose(stepped.final_state.q, run.final_state.q, rtol=0, atol=2e-3)
    # Nothing but the loop pulls at the joints: Jᵀ λ = A v̇ + H.
    row = len(run.time) // 2
    q, v = run.position[row], run.velocity[row]
    rate = dynamics.forward_dynamics(robot, q, v, np.zeros(robot.nv))
    np.testing.assert_allclose(
        dynamics.loop_jacobian(robot, q).T @ run.loop_force[row].ravel(),
        dynamics.inverse_dynamics(robot, q, v, rate),
        rtol=0,
        atol=1e-8,
    )


def test_redundant_loops_share_their_force_by_least_norm() -> None:
    """A loop that is there twice carries half of the force each time."""
    once = four_bar()
    model = once.model
    twice = Robot(
        **{
            **{name: getattr(once, name) for name in once.__dataclass_fields__},
            "model": model.replaced(
                loop_link=np.repeat(model.loop_link, 2, axis=0),
                loop_position=np.repeat(model.loop_position, 2, axis=0),
            ),
        }
    )
    state = once.closed(once.state({"crank": 0.3}, {"crank": 1.0}), keep=["crank"])
    for method in (hs.TimeStepping(), hs.EventDriven()):
        runs = [
            hs.simulate(robot, state=state, duration=0.05, method=method) for robot in (once, twice)
        ]
        np.testing.assert_allclose(runs[1].position, runs[0].position, rtol=0, atol=1e-9)
        each, both = runs[1].loop_force, runs[0].loop_force[:, 0]
        np.testing.assert_allclose(each[:, 0], 0.5 * both, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(each[:, 1], 0.5 * both, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("lean", [1e-6, 0.25])
@pytest.mark.parametrize(
    "method", [hs.TimeStepping(), hs.EventDriven(), hs.Compliant()], ids=lambda each: each.name
)
def test_a_loop_between_a_link_and_its_parent_locks_the_joint(lean: float, method: Any) -> None:
    """Of its two rows one says what the other does, and next to nothing along the lever.

    What spins with ω as one body and falls freely needs m ω² r to hold the arm, whose moment about
    the joint, m ω² r_z l, the loop bears over its lever, at right angles to it.
    """
    build = RobotBuilder("locked")
    trunk = build.floating_base("trunk", (0, 1), mass=3.0, inertia=0.2)
    arm = build.hinge("arm", trunk, at=(0.1, 0.2), mass=1.0, inertia=0.02, center_of_mass=(0.2, 0))
    build.loop(arm, trunk, at=(0.25, lean))
    robot = build.build()
    start = robot.state({"root_pitch": 0.3}, {"root_x": 0.4, "root_pitch": 2.0})
    run = hs.simulate(robot, state=start, duration=0.2, method=method)
    assert run.completed
    np.testing.assert_allclose(run.position[:, 3], 0.0, atol=1e-13)
    np.testing.assert_allclose(run.velocity[:, 2], 2.0, rtol=1e-9)
    lever = np.hypot(0.25, lean)
    force = run.loop_force[20]
    assert np.linalg.norm(force) == pytest.approx(1.0 * 2.0**2 * 0.15 * 0.2 / lever, rel=1e-3)
    angle = run.position[20, 2] - np.arctan2(lean, 0.25)
    assert abs(force @ [np.cos(angle), -np.sin(angle)]) < 2e-2 * np.linalg.norm(force)


METHODS = [hs.TimeStepping(), hs.EventDriven(), hs.Compliant()]


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_snapshot_goes_on_bit_by_bit(method: Any) -> None:
    robot = four_bar()
    state = robot.closed(robot.state(velocity={"crank": 2.0}), keep=["crank"])
    whole = hs.Simulation(robot, state=state, method=method)
    whole.advance(0.05)
    kept = whole.snapshot()
    whole.advance(0.1)
    again = hs.Simulation(robot, state=kept, method=method)
    again.advance(0.1)
    np.testing.assert_array_equal(again.state.q, whole.state.q)
    np.testing.assert_array_equal(again.state.v, whole.state.v)


def test_forces_of_loops_go_through_files(tmp_path: Path) -> None:
    robot = geared()
    state = robot.closed(robot.state({"front": 0.5}), keep=["front"])
    run = hs.simulate(robot, state=state, duration=0.02)
    assert np.abs(run.coupling_force).min() > 0.05
    again = hs.load_run(run.save(tmp_path / "run.nc"))
    np.testing.assert_array_equal(again.coupling_force, run.coupling_force)
    assert again.loop_force.shape == (len(run.time), 0, 2)
    np.testing.assert_array_equal(
        again.robot.model.coupling_polynomial, robot.model.coupling_polynomial
    )
    assert run.to_dataset()["coupling_force"].coords["coupling"].values.tolist() == ["rear"]


def test_open_loops_are_refused_with_what_closes_them() -> None:
    robot = four_bar()
    state = robot.state({"crank": 0.3})
    with pytest.raises(
        hs.SimulationError, match=r"loop coupler-rocker .* is open by 0\.\d+; robot"
    ):
        hs.simulate(robot, state=state, duration=0.1)
    assert hs.simulate(robot, state=robot.closed(state), duration=0.01).completed
    pair = geared()
    with pytest.raises(hs.SimulationError, match="coupling of rear"):
        hs.simulate(pair, state=pair.state({"front": 0.3}), duration=0.1)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_velocity_that_tears_at_a_loop_is_changed_as_by_an_impact(method: Any) -> None:
    """The pendulum at the front turns at 1 rad/s, the rear one at ½: L = (1 + 2² ) I ω after it."""
    robot = geared()
    run = hs.simulate(
        robot, state=robot.state(velocity={"front": 1.0, "rear": 0.5}), duration=1e-3, method=method
    )
    expected = (1.0 + 2.0 * 0.5) / 5.0
    np.testing.assert_allclose(run.velocity[0], [expected, 2.0 * expected], rtol=0, atol=1e-12)


def test_many_robots_with_loops_run_at_once() -> None:
    robot = four_bar()
    states = [
        robot.closed(robot.state(velocity={"crank": speed}), keep=["crank"]) for speed in (1.0, 2.0)
    ]
    batch = hs.simulate_batch(robot, state=states, duration=0.05)
    for state, q in zip(states, batch.position, strict=True):
        alone = hs.simulate(robot, state=state, duration=0.05)
        np.testing.assert_array_equal(q, alone.final_state.q)
