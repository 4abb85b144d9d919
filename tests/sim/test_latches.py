"""Latches: stops that hold, and let go as a foot comes down or on command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.robot import Robot, RobotBuilder, RobotWarning, inspect_robot
from heelstrike.robot.inspection import facts
from heelstrike.robot.model import NUMBERS
from heelstrike.sim.closed_sets import EventKind

METHODS = [
    hs.EventDriven(rtol=1e-10, atol=1e-12),
    *(hs.TimeStepping(scheme=scheme) for scheme in hs.Scheme),
    hs.Compliant(),
]


def gate(gravity: float = 9.81) -> Robot:
    """Pendulum of 1 kg at 0.5 m with a latch at its upper stop, an angle of 0.3 rad."""
    build = RobotBuilder("gate", gravity=gravity)
    build.hinge("hinge", None, mass=1.0, inertia=0.02, center_of_mass=(0, -0.5), limits=(-1.0, 0.3))
    build.latch("hinge", "upper")
    return build.build()


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_stop_that_is_reached_holds(method: Any) -> None:
    """Gravity pulls the pendulum off its stop with m g l sin 0.3; the latch bears that."""
    robot = gate()
    state = robot.state({"hinge": -0.3}, {"hinge": 5.0})
    run = hs.simulate(robot, state=state, duration=0.6, method=method)
    stops = [event for event in run.events if event.kind is EventKind.JOINT_STOP]
    soft = isinstance(method, hs.Compliant)  # there it may bounce once before it is held
    assert len(stops) == 1 or soft
    late = run.time > stops[0].time + 0.3
    # Schemes that go by the gap alone overshoot the stop by up to two steps, and are held there.
    scheme = getattr(method, "scheme", hs.Scheme.IMPACT_RESOLVED)
    linear = scheme in (
        hs.Scheme.IMPACT_RESOLVED, hs.Scheme.GAP_LINEARISED, hs.Scheme.LINEARLY_IMPLICIT
    )  # fmt: skip
    error = 1e-3 if soft else 1e-8 if linear else 1.5e-2
    np.testing.assert_allclose(run.position[late, 0], 0.3, rtol=0, atol=error)
    # A positive angle is on the left: gravity turns it back, the stop pulls forward.
    expected = 9.81 * 0.5 * np.sin(run.position[late, 0])
    np.testing.assert_allclose(run.stop_torque[late, 0], expected, rtol=1e-2 if soft else 1e-6)
    assert run.completed


@pytest.mark.parametrize("method", [hs.EventDriven(), hs.TimeStepping()], ids=str)
def test_a_controller_in_python_lets_go_what_it_does_not_name(method: Any) -> None:
    class Opens:
        latched: tuple[str, ...] = ("hinge",)

        def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
            self.latched = ("hinge",) if t < 0.05 else ()
            return np.zeros(0)

    robot = gate()
    start = robot.state({"hinge": 0.3})
    run = hs.simulate(robot, Opens(), state=start, duration=0.1, method=method)
    assert run.completed, run.message
    np.testing.assert_allclose(run.position[run.time <= 0.05, 0], 0.3, atol=1e-12)
    fallen = 0.5 * 9.81 * 0.5 * np.sin(0.3) / (0.02 + 0.5**2) * 0.05**2
    assert 0.3 - run.position[-1, 0] == pytest.approx(fallen, rel=0.05)


def test_a_controller_that_names_a_joint_without_a_latch_ends_the_run() -> None:
    class Opens:
        latched = ("hinge", "free")

        def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
            return np.zeros(0)

    build = RobotBuilder("gate")
    hinge = build.hinge(
        "hinge", None, mass=1.0, inertia=0.02, center_of_mass=(0, -0.5), limits=(-1.0, 0.3)
    )
    build.hinge("free", hinge, at=(0, -1.0), mass=1.0, inertia=0.02, center_of_mass=(0, -0.5))
    build.latch("hinge", "upper")
    robot = build.build()
    run = hs.simulate(robot, Opens(), state=robot.state({"hinge": 0.3}), duration=0.01)
    assert run.status is hs.RunStatus.CONTROLLER_FAILED
    assert "joint 'free' of robot 'gate' has no latch; hinge has" in run.message


def test_without_a_latch_it_falls_back() -> None:
    robot = gate()
    free = Robot(
        **{
            **vars(robot),
            "model": robot.model.replaced(
                **{
                    name: getattr(robot.model, name)[:0]
                    for name in ("latch_joint", "latch_side", "latch_release")
                }
            ),
        }
    )
    state = robot.state({"hinge": -0.3}, {"hinge": 5.0})
    run = hs.simulate(free, state=state, duration=0.6, method=METHODS[0])
    assert run.final_state.q[0] < 0.2


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_it_lets_go_on_command(method: Any) -> None:
    """From 0.3 rad at rest the pendulum begins as θ'' = −m g l sin θ / (I + m l²) says."""
    robot = gate()
    state = robot.state({"hinge": 0.3})
    simulation = hs.Simulation(robot, state=state, method=method)
    assert simulation.latched == ("hinge",)
    simulation.advance(0.1)
    soft = isinstance(method, hs.Compliant)
    assert abs(simulation.state.q[0] - 0.3) < (1e-3 if soft else 1e-9)
    simulation.latched = ()
    simulation.advance(0.2)
    push = -9.81 * 0.5 * np.sin(0.3) / (0.02 + 0.25)
    fallen = 0.3 + 0.5 * push * 0.1**2
    assert simulation.state.q[0] == pytest.approx(fallen, abs=1e-3)
    simulation.advance(0.3)
    kept = simulation.snapshot()
    again = hs.Simulation(robot, state=kept, method=method)
    assert again.latched == ()
    np.testing.assert_array_equal(again.state.q, simulation.state.q)


def test_what_is_held_is_a_state_of_the_simulation() -> None:
    robot = gate()
    state = robot.state({"hinge": 0.3})
    held = hs.Simulation(robot, state=state)
    held.advance(0.01)
    loose = hs.Simulation(robot, state=state, latched=())
    loose.advance(0.01)
    assert loose.state.q[0] < 0.2999 < held.state.q[0]
    again = hs.Simulation(robot, state=held.snapshot())
    assert again.latched == ("hinge",)
    assert hs.Simulation(robot, state=held.snapshot(), latched=()).latched == ()
    with pytest.raises(hs.SimulationError, match=r"latch of joint 'hinge' holds it at 0\.3, where"):
        loose.latched = ("hinge",)
    with pytest.raises(hs.RobotError, match="no joint 'knee'"):
        hs.simulate(robot, state=state, latched=["knee"], duration=0.1)
    moving = robot.state({"hinge": 0.3}, {"hinge": -1.0})
    assert hs.Simulation(robot, state=moving).latched == ()


def walking() -> tuple[Robot, hs.LimitCycle, hs.Ground]:
    robot, ground = hs.load_robot("kneed_walker"), hs.Ground(slope=-0.0504)
    state = start(robot)
    method = hs.EventDriven(rtol=1e-12, atol=1e-13)
    return robot, hs.find_limit_cycle(robot, state, ground=ground, method=method), ground


def start(robot: Robot) -> hs.State:
    """Near the walk: angles of both legs just after the right one has come down, as published.

    V. F. Hsu Chen (2007) begins a simulation of this walker at 0.1877 and 0.2884 rad, at 1.1014 and
    0.0399 rad/s.
    """
    stance, swing, rate = -0.1877, 0.1877 + 2 * 0.0504, 1.1014
    hip = np.array([np.cos(stance), -np.sin(stance)]) * rate
    return robot.state(
        {
            "root_x": np.sin(stance), "root_z": np.cos(stance), "right_hip": stance,
            "left_hip": swing,
        },
        {"root_x": hip[0], "root_z": hip[1], "right_hip": rate, "left_hip": 0.0399},
    )  # fmt: skip


def test_a_kneed_walker_walks_with_knees_that_lock() -> None:
    """State and multipliers to ten digits, by two tolerances; what was measured once besides."""
    robot, cycle, ground = walking()
    assert cycle.residual < 1e-10
    coarser = hs.find_limit_cycle(
        robot, cycle.state, ground=ground, method=hs.EventDriven(rtol=1e-11, atol=1e-12),
        tolerance=1e-11,
    )  # fmt: skip
    both = [np.concatenate([c.state.q, c.state.v, [c.period]]) for c in (cycle, coarser)]
    np.testing.assert_allclose(both[1], both[0], rtol=0, atol=1e-10)
    multipliers = [np.sort_complex(each.multipliers) for each in (cycle, coarser)]
    np.testing.assert_allclose(multipliers[1], multipliers[0], rtol=0, atol=1e-8)
    expected = [0.1438226740, 0.3525737384 - 0.5522114551j, 0.3525737384 + 0.5522114551j]
    np.testing.assert_allclose(multipliers[0], expected, rtol=0, atol=1e-9)
    assert cycle.stable
    assert cycle.period == pytest.approx(0.564328166, abs=1e-9)
    # Nearly as it was published.
    legs = np.sort(cycle.state.q[[2, 4]])
    np.testing.assert_allclose(legs, [-0.1877, 0.2884], atol=1e-3)


def test_knees_lock_and_let_go_in_order_under_all_methods() -> None:
    robot, cycle, ground = walking()
    kinds = (EventKind.JOINT_STOP, EventKind.TOUCHDOWN, EventKind.JOINT_RELEASE)
    exact = hs.simulate(
        robot, state=cycle.state, duration=2.2 * cycle.period, ground=ground,
        method=hs.EventDriven(rtol=1e-10, atol=1e-12),
    )  # fmt: skip
    told = [event for event in exact.events if event.kind in kinds]
    released = [e.contact for e in told if e.kind is EventKind.JOINT_RELEASE]
    assert sorted(released) == sorted(robot.joint_index(f"{s}_knee") for s in ("left", "right"))
    knees = {robot.joint_index(f"{side}_knee") for side in ("left", "right")}
    for knee in knees:
        straight = exact.position[:, knee]
        assert straight.min() > -1e-9
        assert straight.max() > 0.3
    first = next(e.time for e in told if e.kind is EventKind.JOINT_STOP)
    stepped = hs.simulate(
        robot, state=cycle.state, duration=2.2 * cycle.period, ground=ground,
        method=hs.TimeStepping(step=1e-4),
    )  # fmt: skip
    stops = [e.time for e in stepped.events if e.kind is EventKind.JOINT_STOP]
    assert stops[0] == pytest.approx(first, abs=1e-3)
    assert np.abs(stepped.final_state.q - exact.final_state.q).max() < 5e-2
    assert {e.kind for e in stepped.events} >= set(kinds)


def test_latches_go_through_files_and_mirrors(tmp_path: Path) -> None:
    robot = hs.load_robot("kneed_walker")
    assert robot.mirror is not None
    back = hs.load_robot(robot.save(tmp_path / "walker.xml"))
    for name in NUMBERS:
        np.testing.assert_array_equal(getattr(back.model, name), getattr(robot.model, name))
    with pytest.warns(RobotWarning, match="latches of right_knee, left_knee"):
        robot.save(tmp_path / "walker.urdf")
    words = "left_knee at its lower end, until right_shank touches down"
    assert words in inspect_robot(robot).text()
    assert words in facts(inspect_robot(robot))["latches"]
    lame = robot.model.replaced(
        latch_joint=robot.model.latch_joint[:1],
        latch_side=robot.model.latch_side[:1],
        latch_release=robot.model.latch_release[:1],
    )
    found = inspect_robot(Robot(**{**vars(robot), "model": lame})).findings
    assert any("latch of right_knee has no mirror image" in str(each) for each in found)
    run = hs.simulate(robot, state=start(robot), ground=hs.Ground(slope=-0.0504), duration=0.6)
    assert EventKind.JOINT_RELEASE in {event.kind for event in run.events}
    again = hs.load_run(run.save(tmp_path / "run.nc"))
    np.testing.assert_array_equal(again.robot.model.latch_release, robot.model.latch_release)
    assert again.events == run.events


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (("knee", "upper", None), "no joint 'knee' to latch"),
        (("hinge", "top", None), "is at an end, 'lower' or 'upper', not 'top'"),
        (("free", "upper", None), "holds it at its upper limit: give the joint limits"),
        (("hinge", "upper", "foot"), "lets go by link 'foot', which there is not"),
    ],
)
def test_latches_that_cannot_be_are_refused(wrong: tuple[str, str, str], words: str) -> None:
    build = RobotBuilder("gate")
    build.hinge("hinge", None, mass=1.0, inertia=0.1, limits=(0, 1))
    build.hinge("free", None, mass=1.0, inertia=0.1)
    with pytest.raises(hs.RobotError, match=words):
        build.latch(wrong[0], wrong[1], release=wrong[2])
    build.latch("hinge", "upper")
    with pytest.raises(hs.RobotError, match="has a latch already"):
        build.latch("hinge", "lower")


def test_a_file_with_an_impossible_latch_is_refused(tmp_path: Path) -> None:
    path = hs.load_robot("kneed_walker").save(tmp_path / "walker.xml")
    text = path.read_text(encoding="utf-8")
    for old, new in (
        ('data="-1"', 'data="0"'),
        ("latch:right_knee:", "latch:right_elbow:"),
        (":left_shank", ":left_foot"),
    ):
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        with pytest.raises(hs.RobotError, match="latch:JOINT:LINK"):
            hs.load_robot(path)
