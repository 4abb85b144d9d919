"""Brakes, which hold a joint wherever it is, under every method."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mechanisms import braked
from scipy.optimize import brentq

import heelstrike as hs
from heelstrike.analysis import energy_balance
from heelstrike.errors import RobotError, SimulationError
from heelstrike.gait.gait import fingerprint
from heelstrike.robot import Robot, RobotBuilder
from heelstrike.sim.batch.planning import _joints as runs_of
from heelstrike.sim.closed_sets import EventKind, RunStatus
from heelstrike.sim.files.robot_dataset import robot_to_dataset, stored_robot
from heelstrike.sim.memory import allocate_memory
from heelstrike.sim.time_stepping.impact import allocate_impact

MASS, LENGTH, INERTIA = 2.0, 0.8, 0.05
ABOUT_PIVOT = INERTIA + MASS * LENGTH**2

METHODS = {
    "time stepping": hs.TimeStepping(step=1e-3),
    "linearised gap": hs.TimeStepping(step=1e-3, scheme=hs.Scheme.GAP_LINEARISED),
    "Moreau-Jean": hs.TimeStepping(step=1e-3, scheme=hs.Scheme.MOREAU_JEAN),
    "event-driven": hs.EventDriven(rtol=1e-10, atol=1e-12),
    "compliant": hs.Compliant(rtol=1e-8, atol=1e-10),
}
QUICK = "time stepping"
"""The method that stands for all where time is short."""
EACH = [
    pytest.param(method, id=name, marks=() if name == QUICK else pytest.mark.slow)
    for name, method in METHODS.items()
]


def pendulum() -> Robot:
    return braked(MASS, LENGTH, INERTIA)


def swinging(method: Any) -> hs.Simulation:
    robot = pendulum()
    state = robot.state({"swing": 1.2})
    return hs.Simulation(robot, state=state, method=method, stop_when_fallen=False)


@pytest.mark.parametrize("method", EACH)
def test_a_pendulum_braked_in_mid_swing_stays_where_it_is(method: Any) -> None:
    """It is held with m g l sin θ, and has lost what it moved with, ½ I ω²."""
    simulation = swinging(method)
    simulation.advance(0.3)
    angle, speed = float(simulation.state.q[0]), float(simulation.state.v[0])
    assert abs(speed) > 1.0
    simulation.braked = ["swing"]
    assert simulation.braked == ("swing",)
    simulation.advance(0.6)
    run = simulation.record
    after = run.time > 0.305
    assert run.status is RunStatus.COMPLETED
    np.testing.assert_allclose(run.position[after, 0], angle, rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.velocity[after, 0], 0.0, atol=1e-12)
    weight = MASS * 9.81 * LENGTH * np.sin(angle)
    np.testing.assert_allclose(run.brake_torque[after, 0], weight, rtol=1e-9)
    assert not np.any(run.brake_torque[run.time < 0.299])
    balance = energy_balance(run)
    lost = 0.5 * ABOUT_PIVOT * speed**2
    # The row in which it takes hold is 1 ms long, and the brake bears the weight over it, too.
    more = 1e-9 if isinstance(method, hs.EventDriven) else abs(weight * speed) * 1e-3
    assert balance.brakes[-1] == pytest.approx(-lost, abs=more)
    (taken,) = (e for e in run.events if e.kind is EventKind.JOINT_BRAKE)
    assert taken.time == pytest.approx(0.3, abs=1e-9)
    assert taken.impulse[0] == pytest.approx(-ABOUT_PIVOT * speed, rel=2e-2)
    if isinstance(method, hs.EventDriven):
        assert taken.impulse[0] == pytest.approx(-ABOUT_PIVOT * speed, rel=1e-9)
        assert np.abs(balance.residual).max() < 1e-6


@pytest.mark.parametrize("method", EACH)
def test_a_brake_lets_go_on_command(method: Any) -> None:
    """From rest where it was held, as a pendulum that begins there."""
    simulation = swinging(method)
    simulation.advance(0.3)
    simulation.braked = ["swing"]
    simulation.advance(0.5)
    held = float(simulation.state.q[0])
    simulation.braked = []
    simulation.advance(0.7)
    robot = pendulum()
    alone = hs.simulate(robot, state=robot.state({"swing": held}), duration=0.2, method=method)
    np.testing.assert_allclose(simulation.state.q, alone.final_state.q, rtol=0, atol=1e-8)
    assert not np.any(simulation.record.brake_torque[-1])


@pytest.mark.parametrize("method", [hs.TimeStepping(), hs.EventDriven(), hs.Compliant()])
def test_a_braked_simulation_is_taken_up_again(method: Any, tmp_path: Path) -> None:
    simulation = swinging(method)
    simulation.advance(0.3)
    simulation.braked = ["swing"]
    put_on = simulation.snapshot().save(tmp_path / "put_on.npz")
    simulation.advance(0.4)
    holding = simulation.snapshot()
    for snapshot in (hs.load_snapshot(put_on), holding):
        other = swinging(method)
        other.restore(snapshot)
        assert other.braked == ("swing",)
        other.advance(0.5)
        simulation.restore(snapshot)
        simulation.advance(0.5)
        assert np.array_equal(other.state.q, simulation.state.q)
        assert other.state.v[0] == pytest.approx(0.0, abs=1e-12)


LIMIT = 20.0  # N m: 4.8 more than the weight takes where the pendulum begins


def slipping(limit: float = LIMIT, dry_friction: float = 0.0) -> Robot:
    build = RobotBuilder("pendulum")
    build.hinge(
        "swing", None, mass=MASS, inertia=INERTIA, center_of_mass=(0.0, -LENGTH),
        dry_friction=dry_friction,
    )  # fmt: skip
    build.brake("swing", limit=limit)
    return build.build()


@pytest.mark.parametrize("method", EACH)
def test_a_brake_that_slips_slows_down_and_holds_then(method: Any) -> None:
    """It stops where ½ I ω² and the weight's work are τ Δθ, and holds it with m g l sin θ then.

    Time stepping is of first order; smoothed friction creeps.
    """
    robot = slipping(dry_friction=5.0)
    simulation = hs.Simulation(robot, state=robot.state({"swing": 1.2}), method=method)
    simulation.advance(0.3)
    angle, speed = float(simulation.state.q[0]), float(simulation.state.v[0])
    simulation.braked = ["swing"]
    simulation.advance(0.4)
    put_off = simulation.snapshot()
    simulation.advance(0.8)
    run = simulation.record

    def missing(q: float) -> float:
        fallen = MASS * 9.81 * LENGTH * (np.cos(q) - np.cos(angle))
        return 0.5 * ABOUT_PIVOT * speed**2 + fallen - (LIMIT + 5.0) * (angle - q)

    rest = float(brentq(missing, angle - 3.0, angle - 1e-3))
    error = 1e-3 * abs(speed) if isinstance(method, hs.TimeStepping) else 1e-8
    error = 1e-4 if isinstance(method, hs.Compliant) else error
    assert simulation.state.q[0] == pytest.approx(rest, abs=error)
    slips = (run.time > 0.301) & (run.velocity[:, 0] < -0.1)
    np.testing.assert_allclose(run.brake_torque[slips, 0], LIMIT, rtol=1e-4)
    np.testing.assert_allclose(run.friction_torque[slips, 0], 5.0, rtol=1e-4)
    weight = MASS * 9.81 * LENGTH * np.sin(simulation.state.q[0])
    assert run.brake_torque[-1, 0] == pytest.approx(0.8 * weight, rel=1e-3)
    assert run.brake_torque[-1, 0] == pytest.approx(4.0 * run.friction_torque[-1, 0])
    assert not np.any(run.brake_torque[run.time < 0.299])
    balance = energy_balance(run)
    assert balance.brakes[-1] == pytest.approx(-LIMIT * (angle - rest), abs=50.0 * error + 1e-4)
    (taken,) = (e for e in run.events if e.kind is EventKind.JOINT_BRAKE)
    assert (taken.time, taken.impulse) == (pytest.approx(0.3, abs=1e-9), (0.0, 0.0))
    other = hs.Simulation(robot, state=put_off, method=method)
    other.advance(0.8)
    assert other.braked == ("swing",)
    assert np.array_equal(other.state.q, simulation.state.q)
    simulation.braked = []
    simulation.advance(0.81)
    assert not simulation.record.brake_torque[-1].any()
    assert simulation.record.friction_torque[-1, 0] == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize("method", EACH)
def test_a_brake_that_slips_holds_up_to_its_limit(method: Any) -> None:
    """One per cent above the weight, and one below."""
    weight = MASS * 9.81 * LENGTH * np.sin(0.7)
    moved = []
    for limit in (1.01 * weight, 0.99 * weight):
        robot = slipping(limit)
        run = hs.simulate(
            robot, state=robot.state({"swing": 0.7}), duration=0.2, method=method, braked="swing"
        )
        assert run.completed
        moved.append(0.7 - run.final_state.q[0])
        bears = min(limit, weight)
        assert run.brake_torque[-1, 0] == pytest.approx(bears, rel=1e-3)
        assert not run.friction_torque.any()
    creep = 8e-4 if isinstance(method, hs.Compliant) else 1e-12  # as any dry friction
    assert moved[0] < creep
    pulls = 0.01 * weight  # and the weight has less of a lever as it falls
    stiffness = weight / np.tan(0.7)
    falls = pulls / stiffness * (1.0 - np.cos(np.sqrt(stiffness / ABOUT_PIVOT) * 0.2))
    assert moved[1] == pytest.approx(falls, rel=0.01, abs=max(creep, 1e-5))


class Halting:
    """Put a brake on at a position, and let it go a while later."""

    def __init__(self) -> None:
        self.braked: tuple[str, ...] = ()
        self.since = np.inf

    def torque(self, t: float, state: hs.State, contacts: Any) -> Any:
        if np.isinf(self.since) and state.q[0] < 0.5:
            self.braked, self.since = ("swing",), t
        elif t > self.since + 0.1:
            self.braked = ()
        return np.zeros(0)


@pytest.mark.parametrize("method", [hs.TimeStepping(), hs.EventDriven(), hs.Compliant()])
def test_a_controller_in_python_brakes_where_it_likes(method: Any) -> None:
    robot = pendulum()
    run = hs.simulate(
        robot, Halting(), state=robot.state({"swing": 1.2}), duration=0.6, method=method
    )
    assert run.completed, run.message
    (taken,) = (e for e in run.events if e.kind is EventKind.JOINT_BRAKE)
    assert run.position[np.searchsorted(run.time, taken.time - 1e-3 - 1e-9), 0] >= 0.5
    held = (run.time > taken.time + 2e-3) & (run.time < taken.time + 0.099)
    assert np.ptp(run.position[held, 0]) < 1e-12
    assert 0.49 < run.position[held, 0].mean() < 0.5
    assert not np.any(run.brake_torque[run.time > taken.time + 0.103])
    assert run.velocity[-1, 0] < -0.5


def test_a_controller_that_names_no_joint_ends_the_run() -> None:
    class Wrong(Halting):
        braked = ("swnig",)

        def __init__(self) -> None:
            self.since = np.inf

    robot = pendulum()
    run = hs.simulate(robot, Wrong(), state=robot.state({"swing": 1.2}), duration=0.1)
    assert run.status is RunStatus.CONTROLLER_FAILED
    assert "no joint 'swnig'. Did you mean 'swing'" in run.message


def test_a_batch_begins_with_brakes_on() -> None:
    robots = [slipping(), slipping(3.0), pendulum()]
    for robot, joints in [(robots[:2], "swing"), (robots[:2], [["swing"], []]), (robots[2:], [0])]:
        states = [each.state({"swing": 0.7}) for each in robot]
        batch = hs.simulate_batch(robot, state=states, duration=0.05, braked=joints)
        for i, each in enumerate(robot):
            own = joints[i] if isinstance(joints[0], list) else joints
            alone = hs.simulate(each, state=states[i], duration=0.05, braked=own)
            np.testing.assert_array_equal(batch.position[i], alone.final_state.q)
            assert (alone.final_state.q[0] == 0.7) == (own != [] and each is not robots[1])
    for wrong, words in [
        ([["swing"], "swing"], "mixes the two"),
        ([[], ["swnig"]], "run 1: .*no joint 'swnig'"),
        (3.0, "braked must be names of joints, got 3.0"),
    ]:
        with pytest.raises(hs.HeelstrikeError, match=words):
            hs.simulate_batch(robots[0], state=robots[0].state(), duration=0.05, braked=wrong)  # type: ignore[arg-type]
    with pytest.raises(SimulationError, match=r"braked must be .*, got 3\.0"):
        hs.simulate(robots[0], state=robots[0].state(), duration=0.05, braked=3.0)  # type: ignore[arg-type]
    snapshot = hs.simulate(robots[0], state=robots[0].state(), duration=0.01).final
    with pytest.raises(SimulationError, match=r"use simulate\(state=snapshot\)"):
        hs.simulate_batch(robots[0], state=snapshot, duration=0.05)  # type: ignore[arg-type]


def test_joints_may_be_an_array() -> None:
    """An array is several joints, though it has an ``__index__``; a number of numpy is one."""
    robot = pendulum()
    state = robot.state({"swing": 0.4})
    for joints in (np.array([0]), np.array(["swing"]), np.int64(0)):
        simulation = hs.Simulation(robot, state=state, braked=joints)  # type: ignore[arg-type]
        assert simulation.braked == ("swing",)
    assert runs_of("braked", np.array([0])) == [(0,)]
    assert runs_of("braked", np.array([[0], [0]])) == [(0,), (0,)]


def test_a_run_may_begin_with_a_brake_on(tmp_path: Path) -> None:
    robot = pendulum()
    run = hs.simulate(robot, state=robot.state({"swing": 0.4}), duration=0.01, braked=["swing"])
    assert np.all(run.position == 0.4)
    again = hs.load_run(run.save(tmp_path / "braked.nc"))
    np.testing.assert_array_equal(again.brake_torque, run.brake_torque)
    assert again.robot.brake_names == ("swing",)


def contents_of(robot: Robot) -> dict[str, Any]:
    """Return a robot as a run file has it."""
    data = robot_to_dataset(robot)
    found = {str(name): np.array(each.values) for name, each in data.variables.items()}
    found |= {f"@{name}": np.array(value) for name, value in data.attrs.items()}
    return {name: v.astype(str) if v.dtype.kind == "O" else v for name, v in found.items()}


def test_left_and_right_brakes_that_slip_otherwise_are_told() -> None:
    build = RobotBuilder("two")
    trunk = build.floating_base("trunk", (0, 1), mass=5, inertia=0.1)
    for side, limit in (("right", 3.0), ("left", 4.0)):
        build.hinge(f"{side}_hip", trunk, mass=2.0, inertia=0.2)
        build.brake(f"{side}_hip", limit=limit)
    with pytest.warns(hs.RobotWarning, match=r"brakes of right_hip and left_hip \(3, 4\)"):
        assert build.build().mirror is None


def standing_leg() -> Robot:
    """A trunk on a leg with a knee, on a point foot that is held by friction."""
    build = RobotBuilder("leg")
    trunk = build.floating_base("trunk", (0.0, 1.0), mass=5.0, inertia=0.2)
    thigh = build.hinge("hip", trunk, mass=1.0, inertia=0.02, center_of_mass=(0.0, -0.25))
    shank = build.hinge("knee", thigh, at=(0.0, -0.5), mass=1.0, inertia=0.02)
    build.contact(shank, (0.0, -0.5))
    build.brake("knee")
    build.brake("hip")
    return build.build()


def test_a_brake_takes_hold_with_the_ground_under_the_foot() -> None:
    """One impact of brake and ground: the foot stays, and time stepping converges to it."""
    robot = standing_leg()
    state = robot.state({"knee": 0.6, "hip": -0.3}, {"knee": 3.0})
    found = {}
    for name, method in {
        "event-driven": hs.EventDriven(rtol=1e-10, atol=1e-12),
        "coarse": hs.TimeStepping(step=1e-3),
        "fine": hs.TimeStepping(step=1e-5),
    }.items():
        ground = hs.Ground(friction=5.0)
        start = robot.placed(state, ground)
        jacobian = hs.contact_kinematics(robot, start.q, start.v, ground).jacobian[0]
        at_rest = -np.linalg.solve(jacobian[:, :2], jacobian[:, 2:] @ start.v[2:])  # the foot
        begin = hs.State(start.q, [*at_rest, *start.v[2:]])
        simulation = hs.Simulation(robot, state=begin, method=method, ground=ground)
        simulation.advance(0.02)
        simulation.braked = ["knee", "hip"]
        simulation.advance(0.04)
        found[name] = simulation.state.v.copy()
        assert np.abs(simulation.state.v[3:]).max() < 1e-10
        # What rests and goes on resting has no energy to tell rounding by; the brakes have.
        kinds = {event.kind for event in simulation.record.events}
        assert EventKind.ENERGY_GAIN not in kinds
    away = {name: np.abs(found[name] - found["event-driven"]).max() for name in ("coarse", "fine")}
    assert away["fine"] < 0.05 * away["coarse"] < 0.05


@pytest.mark.parametrize("method", EACH)
def test_two_brakes_stop_a_loop_that_one_would_stop(method: Any) -> None:
    """Four bars have one way to move: brakes of crank and rocker are told the same twice."""
    build = RobotBuilder("four_bar")
    crank = build.hinge("crank", None, mass=1.0, inertia=0.02, center_of_mass=(0, 0.1))
    coupler = build.hinge("coupler", crank, at=(0, 0.2), mass=1.5, inertia=0.08)
    rocker = build.hinge("rocker", None, at=(0.5, 0), mass=1.2, inertia=0.05)
    build.loop(coupler, rocker, at=(0.5, 0.3))
    build.brake("crank")
    build.brake("rocker")
    robot = build.build()
    start = robot.closed(robot.state({}, {"crank": 4.0}))
    simulation = hs.Simulation(robot, state=start, method=method)
    simulation.advance(0.02)
    before = simulation.state
    assert np.abs(before.v).min() > 0.5
    simulation.braked = ["crank", "rocker"]
    simulation.advance(0.03)
    np.testing.assert_allclose(simulation.state.q, before.q, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(simulation.state.v, 0.0, atol=1e-9)


def test_an_impact_has_room_for_all_that_can_touch_and_all_brakes() -> None:
    """Compiled code writes beyond what has no room, and says nothing."""
    for robot in (pendulum(), standing_leg()):
        impact, candidates = allocate_impact(robot), allocate_memory(robot).assembly.candidate
        assert impact.member.shape == candidates.shape
        assert impact.problem.set.shape == candidates.shape


def arm() -> RobotBuilder:
    build = RobotBuilder("one")
    build.hinge("arm", None, mass=1.0, inertia=0.1)
    return build


def test_brakes_are_named_where_there_are_none(tmp_path: Path) -> None:
    robot = standing_leg()
    with pytest.raises(
        SimulationError, match="'root_pitch' of robot 'leg' has no brake; knee, hip"
    ):
        hs.Simulation(robot, state=robot.reference_state(), braked=["root_pitch"])
    build = arm()
    build.brake("arm")
    with pytest.raises(RobotError, match="joint 'arm' has a brake already"):
        build.brake("arm")
    with pytest.raises(RobotError, match="no joint 'leg' to brake"):
        build.brake("leg")
    with pytest.raises(RobotError, match="brake of joint 'arm' must be positive, got 0"):
        arm().brake("arm", limit=0)


def test_a_brake_goes_through_files(tmp_path: Path) -> None:
    robot = standing_leg()
    back = hs.load_robot(robot.save(tmp_path / "leg.xml"))
    assert back.brake_names == robot.brake_names == ("knee", "hip")
    assert "brake: knee" in hs.inspect_robot(robot).text()
    with pytest.warns(hs.RobotWarning, match="brakes of knee, hip"):
        robot.save(tmp_path / "leg.urdf")
    slips = slipping(12.5)
    assert fingerprint(slips) != fingerprint(slipping()) != fingerprint(pendulum())
    assert "brake: swing, slips beyond 12.5 N m" in hs.inspect_robot(slips).text()
    again = hs.load_robot(slips.save(tmp_path / "slips.xml"))
    assert again.model.brake_limit == slips.model.brake_limit == [12.5]
    (tmp_path / "slips.xml").write_text(
        (tmp_path / "slips.xml").read_text().replace('data="1 12.5"', 'data="1 -2"')
    )
    with pytest.raises(RobotError, match=r"brake 'swing' in <custom> needs a positive limit.*-2"):
        hs.load_robot(tmp_path / "slips.xml")
    held = contents_of(slips)
    assert stored_robot(held).model.brake_limit == [12.5]
    with pytest.raises(ValueError, match="brake_limit must be 0 or more"):
        stored_robot({**held, "brake_limit": np.array([-1.0])})
    del held["brake_limit"]  # files that are older
    assert stored_robot(held).model.brake_limit == [np.inf]
    text = (tmp_path / "leg.xml").read_text().replace("brake:knee", "brake:neck")
    (tmp_path / "leg.xml").write_text(text)
    with pytest.raises(RobotError, match="brake 'neck' in <custom>"):
        hs.load_robot(tmp_path / "leg.xml")
