"""What a simulation in space does: rest, bounces, stops, dry friction, pushes, boxes, records."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import xarray
from spatial_robots import Maker

import heelstrike as hs
from heelstrike.errors import ControllerError, RunFileError, SimulationError
from heelstrike.sim.spatial.record import SpatialEventKind
from heelstrike.sim.spatial.run import SpatialRun, tangents_of

G = 9.81
BLOCK = (
    "<body name='block' pos='0 0 0.1'><freejoint/><geom type='box' size='0.2 0.15 0.1' mass='2'/>"
    "</body>"
)
BALL = "<body name='ball'><freejoint/><geom type='sphere' size='0.1' mass='1'/></body>"
ARM = (
    "<body name='arm' pos='0 0 1'><joint name='shoulder' axis='0 1 0' {joint}/>"
    "<geom type='capsule' fromto='0 0 0 0.4 0 0' size='0.02' mass='1'/></body>"
)
MOTOR = (
    "<actuator><motor name='motor' joint='shoulder' ctrlrange='-3 3' ctrllimited='true'/>"
    "</actuator>"
)


def moved(robot: hs.SpatialRobot, velocity: list[float], height: float | None = None) -> hs.State:
    """The reference state of a free body with a velocity, perhaps at another height."""
    q = robot.reference_state().q.copy()
    if height is not None:
        q[2] = height
    return hs.State(q, np.array(velocity, dtype=float))


def test_a_block_rests(made: Maker) -> None:
    """No penetration, no creep, and the ground bears the weight."""
    robot = made(BLOCK)
    run = hs.simulate(robot, state=robot.reference_state(), duration=0.5)
    assert isinstance(run, SpatialRun)
    assert run.completed
    assert run.events == ()
    assert run.certificates.penetration <= 1e-15
    assert np.max(np.abs(run.slip)) <= 1e-15
    assert np.sum(run.contact_force[:, :, 0], axis=1) == pytest.approx(2.0 * G, rel=1e-12)
    assert run.steps == 500
    assert len(run.time) == 501


def test_a_block_stays_on_a_slope_below_the_friction_angle_and_slides_above(made: Maker) -> None:
    """μ = 0.5 holds up to 26.6°: at 1e-3 rad less it stands still, at as much more it slides."""
    robot = made(BLOCK)
    for beyond, slides in ((-1e-3, False), (1e-3, True)):
        angle = np.arctan(0.5) + beyond
        ground = hs.SpatialGround(friction=0.5, normal=(-np.sin(angle), 0.0, np.cos(angle)))
        half = 0.5 * angle
        q = np.r_[0.1 * np.array(ground.normal), np.cos(half), 0.0, -np.sin(half), 0.0]
        run = hs.simulate(robot, state=hs.State(q, np.zeros(6)), ground=ground, duration=0.3)
        speed = np.linalg.norm(run.velocity[-1])
        wanted = 0.3 * G * (np.sin(angle) - 0.5 * np.cos(angle)) if slides else 0.0
        assert speed == pytest.approx(wanted, rel=1e-9, abs=1e-13)


def test_a_ball_bounces_with_its_restitution(made: Maker) -> None:
    """Newton's law within the step: behind it the speed is e times that with which it began."""
    robot = made(BALL)
    run = hs.simulate(
        robot, state=moved(robot, [0.0] * 6, 0.6), duration=0.45,
        ground=hs.SpatialGround(restitution=0.7),
    )  # fmt: skip
    down = [event for event in run.events if event.kind is SpatialEventKind.TOUCHDOWN]
    assert len(down) == 1
    place = int(np.argmin(np.abs(run.time - down[0].time)))
    assert run.velocity[place, 2] == pytest.approx(-0.7 * run.velocity[place - 1, 2])
    assert run.certificates.energy_gain == 0.0
    assert np.min(run.gap) >= -1e-12


def test_a_plastic_landing_is_whole_within_its_step(made: Maker) -> None:
    """After the step in which it lands the ball has no normal speed left."""
    robot = made(BALL)
    run = hs.simulate(robot, state=moved(robot, [0.0] * 6, 0.2), duration=0.3)
    (down,) = (event for event in run.events if event.kind is SpatialEventKind.TOUCHDOWN)
    place = int(np.argmin(np.abs(run.time - down.time)))
    assert abs(run.velocity[place, 2]) <= 1e-12
    assert down.impulse[0] == pytest.approx(-run.velocity[place - 1, 2] + 1e-3 * G, rel=1e-9)


def test_a_joint_stops_at_the_end_of_its_range(made: Maker) -> None:
    robot = made(ARM.format(joint="range='-1 0.5' limited='true'"))
    run = hs.simulate(robot, state=robot.reference_state(), duration=1.5)
    assert np.max(run.position[:, 0]) <= 0.5 + 1e-9
    assert run.position[-1, 0] == pytest.approx(0.5, abs=1e-9)
    assert [event.kind for event in run.events] == [SpatialEventKind.JOINT_STOP]
    # It presses back with the weight: m g l cos q.
    assert run.stop_torque[-1, 0] == pytest.approx(-1.0 * G * 0.2 * np.cos(0.5), rel=1e-6)


def test_a_ball_joint_stops_at_its_cone(made: Maker) -> None:
    """A pendulum on a ball joint of 0.4 rad does not swing beyond it."""
    robot = made(
        "<body name='bob' pos='0 0 1'><joint type='ball' range='0 0.4' limited='true'/>"
        "<geom type='sphere' pos='0 0 -0.3' size='0.05' mass='1'/></body>"
    )
    state = hs.State(robot.reference_state().q, np.array([3.0, 1.0, 0.0]))
    run = hs.simulate(robot, state=state, duration=1.0)
    turn = 2.0 * np.arccos(np.clip(np.abs(run.position[:, 0]), 0.0, 1.0))
    assert np.max(turn) == pytest.approx(0.4, abs=1e-4)
    assert any(event.kind is SpatialEventKind.JOINT_STOP for event in run.events)


def test_the_stop_of_a_ball_joint_turns_it_straight_back(made: Maker) -> None:
    """What is recorded acts along the turn of the instant before the step, and only back."""
    robot = made(
        "<body name='bob' pos='0 0 1'><joint type='ball' range='0 0.4' limited='true'/>"
        "<geom type='box' pos='0.02 0.01 -0.3' size='0.05 0.02 0.1' mass='1'/></body>"
    )
    state = hs.State(robot.reference_state().q, np.array([3.0, 1.0, 6.0]))
    run = hs.simulate(robot, state=state, duration=0.6)
    pressed = np.flatnonzero(np.linalg.norm(run.stop_torque, axis=1) > 0.1)
    assert len(pressed) > 20
    way = run.position[pressed, 1:] * np.sign(run.position[pressed, :1])
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    torque = run.stop_torque[pressed]
    back = -np.einsum("ij,ij->i", torque, way)
    np.testing.assert_allclose(back, np.linalg.norm(torque, axis=1), rtol=1e-9)


def test_dry_friction_of_a_joint_holds_and_brakes(made: Maker) -> None:
    """Held against gravity by more than m g l; with less it moves, braked by just that."""
    weight = 1.0 * G * 0.2
    for part, moves in ((1.01, False), (0.5, True)):
        robot = made(ARM.format(joint=f"frictionloss='{part * weight}'"))
        run = hs.simulate(robot, state=robot.reference_state(), duration=0.2)
        assert bool(abs(run.velocity[-1, 0]) > 0.1) is moves
        if moves:
            assert run.friction_torque[-1, 0] == pytest.approx(-part * weight, rel=1e-9)
        else:
            assert np.max(np.abs(run.velocity)) <= 1e-13


def test_a_push_gives_its_impulse(made: Maker) -> None:
    """(x, y, z) at the centre of mass, over a window that is no whole number of steps."""
    robot = made(BALL)
    push = hs.Push("ball", force=(3.0, -2.0, G), start=0.0105, duration=0.0203)
    run = hs.simulate(robot, state=moved(robot, [0.0] * 6, 2.0), duration=0.1, pushes=push)
    assert run.velocity[-1, :2] == pytest.approx([3.0 * 0.0203, -2.0 * 0.0203], rel=1e-12)


def test_a_push_of_the_plane_is_refused_in_space_and_the_other_way_round(made: Maker) -> None:
    robot = made(BALL)
    with pytest.raises(SimulationError, match=r"three numbers \(x, y, z\)"):
        hs.simulate(
            robot, state=robot.reference_state(), duration=0.1,
            pushes=hs.Push("ball", force=(1.0, 2.0), start=0.0, duration=0.1),
        )  # fmt: skip
    flat = hs.load_robot("compass_gait")
    with pytest.raises(SimulationError, match=r"two numbers \(x, z\)"):
        hs.simulate(
            flat, state=flat.reference_state(), duration=0.1,
            pushes=hs.Push(0, force=(1.0, 2.0, 3.0), start=0.0, duration=0.1),
        )  # fmt: skip


def test_a_ball_lands_on_a_box_and_rolls_off_its_edge(made: Maker) -> None:
    """On top it stands at the height of the box; beyond the edge it falls to the plane."""
    robot = made(BALL)
    box = hs.Box(center=(0.0, 0.0, 0.1), size=(1.0, 1.0, 0.2))
    ground = hs.SpatialGround(boxes=(box,))
    run = hs.simulate(robot, state=moved(robot, [0.0] * 6, 0.5), duration=0.6, ground=ground)
    assert run.position[-1, 2] == pytest.approx(0.3, abs=1e-9)
    run = hs.simulate(
        robot, state=moved(robot, [1.0, 0.0, 0.0, 0.0, 10.0, 0.0], 0.3), duration=1.5, ground=ground
    )
    assert run.position[-1, 0] > 0.7
    assert run.position[-1, 2] == pytest.approx(0.1, abs=1e-9)
    assert np.min(run.gap) >= -2e-5  # the way round the edge bends by (h v)² / r in a step


@pytest.mark.slow
@pytest.mark.parametrize("beyond", [2e-3, -2e-3])
def test_a_ball_meets_the_edge_of_a_box_along_the_line_to_its_middle(
    made: Maker, beyond: float
) -> None:
    """Before the edge as in it: the gap is what is left of the way to the edge."""
    robot = made(BALL)
    ground = hs.SpatialGround(boxes=(hs.Box(center=(0.0, 0.0, 0.1), size=(1.0, 1.0, 0.2)),))
    slant = np.array([0.6, 0.0, 0.8])
    q = robot.reference_state().q
    q[:3] = np.array([0.5, 0.0, 0.2]) + (0.1 + beyond) * slant
    seen = hs.Simulation(robot, state=hs.State(q, np.zeros(6)), ground=ground).contacts
    assert seen.gap[0] == pytest.approx(beyond, abs=1e-12)
    np.testing.assert_allclose(seen.normal[0], slant, atol=1e-12)


def test_a_controller_in_python_is_asked_every_period(made: Maker) -> None:
    robot = made(ARM.format(joint=""), MOTOR)
    times = []

    class Law:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            times.append(t)
            assert state.q.shape == (1,)
            return np.array([2.0])

    run = hs.simulate(
        robot, Law(), state=robot.reference_state(), duration=0.01, control_period=0.005
    )
    assert times == pytest.approx([0.0, 0.005, 0.01])
    assert run.torque[:, 0] == pytest.approx(2.0)


def test_torques_keep_to_their_limits(made: Maker) -> None:
    robot = made(ARM.format(joint=""), MOTOR)

    class Law:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.array([5.0])

    run = hs.simulate(robot, Law(), state=robot.reference_state(), duration=0.01)
    assert run.torque[:, 0] == pytest.approx(3.0)
    assert run.saturations == 11


class Gain(hs.Bundle):
    """Of the law below."""

    kp: np.ndarray = hs.array("nu")


@hs.controller(endings=("high enough",))
def weigh(t, state, robot, parameters: Gain, torque):  # type: ignore[no-untyped-def]
    robot.gravity_force(state, torque)
    for i in range(robot.nu):
        torque[i] -= parameters.kp[i] * state.joint_position[i]
    if t > 0.05:
        robot.stop(0)


def test_a_law_runs_compiled_in_space(made: Maker) -> None:
    """Gravity is borne exactly, so that nothing moves; and the law ends the run in its words."""
    robot = made(ARM.format(joint=""), MOTOR)
    run = hs.simulate(
        robot, weigh(Gain(kp=np.ones(1))), state=robot.reference_state(), duration=0.1
    )
    assert run.status is hs.RunStatus.STOPPED
    assert "high enough" in run.message
    assert run.time[-1] == pytest.approx(0.051)
    assert np.max(np.abs(run.velocity)) <= 1e-14
    assert run.torque[0, 0] == pytest.approx(-1.0 * G * 0.2, rel=1e-12)


def test_a_posture_is_held(made: Maker) -> None:
    robot = made(ARM.format(joint="damping='0.1'"), MOTOR)
    law = hs.HoldPosture(robot, kp=20.0, kd=1.0, posture=[0.2])
    run = hs.simulate(robot, law, state=robot.reference_state(), duration=2.0)
    assert run.position[-1, 0] == pytest.approx(0.2, abs=1e-3)
    with pytest.raises(ControllerError, match="must not be negative"):
        hs.HoldPosture(robot, kp=-1.0, kd=1.0)


def test_what_goes_wrong_in_a_controller_ends_the_run_in_words(made: Maker) -> None:
    robot = made(ARM.format(joint=""), MOTOR)

    class Raises:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            raise ValueError("no idea")

    class Wrong:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.zeros(2)

    class Infinite:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.array([np.nan])

    for law, words in ((Raises(), "no idea"), (Wrong(), "shape"), (Infinite(), "not finite")):
        run = hs.simulate(robot, law, state=robot.reference_state(), duration=0.1, on_error="stop")
        assert run.status is hs.RunStatus.CONTROLLER_FAILED
        assert words in run.message


def test_other_methods_refuse_and_say_why(made: Maker) -> None:
    robot = made(BALL)
    begin = {"state": robot.reference_state(), "duration": 0.1}
    for method, words in (
        (hs.EventDriven(), "chooses among all directions"), (hs.Compliant(), "springs"),
        (hs.TimeStepping(scheme=hs.Scheme.MOREAU_JEAN), "IMPACT_RESOLVED"),
    ):  # fmt: skip
        with pytest.raises(SimulationError, match=words):
            hs.simulate(robot, method=method, **begin)


def test_unknown_options_are_refused(made: Maker) -> None:
    robot = made(BALL)
    with pytest.raises(TypeError, match="'colour'"):
        hs.simulate(robot, state=robot.reference_state(), duration=0.1, colour="red")


def test_a_simulation_goes_step_by_step_as_in_one_go(made: Maker) -> None:
    robot = made(BLOCK)
    state = moved(robot, [0.5, 0.2, 0.0, 0.1, 0.0, 2.0])
    whole = hs.simulate(robot, state=state, duration=0.1)
    simulation = hs.Simulation(robot, state=state)
    for _ in range(40):
        assert simulation.step() is hs.RunStatus.COMPLETED
    simulation.advance(0.1)
    assert simulation.time == pytest.approx(0.1)
    assert np.array_equal(simulation.state.q, whole.position[-1])
    assert np.array_equal(simulation.record.position, whole.position)


def test_a_fall_ends_the_run(made: Maker) -> None:
    """A free body with two feet whose centre of mass sinks below half its height."""
    robot = made(
        "<body name='trunk' pos='0 0 1'><freejoint/><geom type='sphere' size='0.1' mass='5'/>"
        "<body name='left'><joint axis='0 1 0'/><geom type='capsule' fromto='0 0.1 0 0 0.1 -0.9' "
        "size='0.02' mass='1'/></body><body name='right'><joint axis='0 1 0'/><geom type='capsule' "
        "fromto='0 -0.1 0 0 -0.1 -0.9' size='0.02' mass='1'/></body></body>"
    )
    state = moved(robot, [0.3, 0.1, 0.0, 0.0, 0.2, 0.0, 0.1, -0.1])
    run = hs.simulate(robot, state=state, duration=3.0, stop_when_fallen=True)
    assert run.status is hs.RunStatus.FELL
    assert run.certificates.uncertified == 0


def test_the_dataset_has_labels_and_units(made: Maker, tmp_path: Path) -> None:
    robot = made(BLOCK)
    run = hs.simulate(robot, state=moved(robot, [0.5, 0.2, 0, 0, 0, 0]), duration=0.05)
    data = run.to_dataset()
    assert data["contact_force"].dims == ("time", "contact", "component")
    assert list(data["component"].values) == ["normal", "t1", "t2"]
    assert data["contact_force"].attrs["units"] == "N"
    assert list(data["q"].values) == list(robot.position_names)
    path = run.save(tmp_path / "run.nc")
    with xarray.open_dataset(path, engine="h5netcdf") as again:
        assert np.array_equal(again["position"].values, run.position)
        assert again.attrs["status"] == "completed"
    with pytest.raises(RunFileError, match=r"\.nc"):
        run.save(tmp_path / "run.txt")


def test_world_forces_are_those_of_contact_axes_turned(made: Maker) -> None:
    """On a slope the forces of a block at rest add up to its weight, upwards."""
    robot = made(BLOCK)
    angle = 0.2
    ground = hs.SpatialGround(friction=0.5, normal=(0.0, -np.sin(angle), np.cos(angle)))
    q = np.r_[0.1 * np.array(ground.normal), np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0, 0.0]
    run = hs.simulate(robot, state=hs.State(q, np.zeros(6)), ground=ground, duration=0.05)
    total = np.sum(run.world_force[-1], axis=0)
    assert total == pytest.approx([0.0, 0.0, 2.0 * G], abs=1e-9)


def test_ground_of_the_plane_is_taken_for_all_y(made: Maker) -> None:
    """A slope that climbs along x is the same ground; one with a profile is refused."""
    robot = made(BALL)
    state = moved(robot, [0.0, 0.5, 0.0, 0.0, 0.0, 0.0], 0.3)
    slope = 0.2
    normal = (-np.sin(slope), 0.0, np.cos(slope))
    flat = hs.simulate(
        robot, state=state, duration=0.4, ground=hs.Ground(friction=0.4, slope=slope)
    )
    space = hs.simulate(
        robot, state=state, duration=0.4, ground=hs.SpatialGround(friction=0.4, normal=normal)
    )
    assert flat.position[-1] == pytest.approx(space.position[-1], abs=1e-12)
    assert flat.velocity[-1, 0] < -0.1  # it rolls down
    with pytest.raises(SimulationError, match="profile"):
        hs.simulate(
            robot, state=state, duration=0.1,
            ground=hs.Ground.stairs(rise=0.1, tread=0.3, count=2),
        )  # fmt: skip


def test_the_first_tangent_is_that_of_the_conventions() -> None:
    """World x less its part along the normal; world y where the normal is along x."""
    normal = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
    first, second = tangents_of(normal)
    wanted = [[1.0, 0.0, 0.0], [0.8, 0.0, -0.6], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert first == pytest.approx(np.array(wanted), abs=1e-15)
    assert second == pytest.approx(np.cross(normal, first), abs=1e-15)


def test_a_snapshot_is_taken_up_exactly(made: Maker) -> None:
    """In the middle of sliding, with what a compiled law remembers; others are refused."""
    robot = made(BLOCK)
    state = moved(robot, [0.5, 0.2, 0.0, 0.1, 0.0, 2.0])
    simulation = hs.Simulation(robot, state=state)
    simulation.advance(0.02)
    kept = simulation.snapshot()
    assert kept.time == pytest.approx(0.02)
    simulation.advance(0.05)
    there = simulation.state
    simulation.restore(kept)
    assert simulation.time == pytest.approx(0.02)
    simulation.advance(0.05)
    assert np.array_equal(simulation.state.q, there.q)
    assert np.array_equal(simulation.state.v, there.v)
    other = made(BALL)
    with pytest.raises(SimulationError, match="another robot"):
        hs.Simulation(other, state=other.reference_state()).restore(kept)


def test_pushes_and_another_friction_while_it_goes_on(made: Maker) -> None:
    """A push acts from now on and is forgotten when it is over; a snapshot brings both back."""
    robot = made(BLOCK)
    simulation = hs.Simulation(robot, state=robot.reference_state(), ground=hs.SpatialGround())
    simulation.advance(0.05)
    push = hs.Push("block", force=(0.0, 1e3, 0.0), start=0.05, duration=0.02)
    simulation.apply(push)
    kept = simulation.snapshot()
    simulation.advance(0.07)
    there = simulation.state
    assert there.v[1] > 1.0
    assert simulation.record.pushes == (push,)
    simulation.advance(0.08)
    simulation.forget()
    assert simulation.record.time == pytest.approx([0.08])
    assert simulation.record.pushes == ()
    simulation.ground = dataclasses.replace(simulation.ground, friction=0.0)
    before = simulation.state.v[1]
    simulation.advance(0.1)
    assert simulation.state.v[1] == pytest.approx(before, rel=1e-9)  # nothing brakes
    simulation.restore(kept)
    assert simulation.ground.friction == 0.75
    simulation.advance(0.07)
    assert np.array_equal(simulation.state.v, there.v)
    simulation.advance(0.08)
    with pytest.raises(SimulationError, match="before the present time"):
        simulation.apply(push)
    with pytest.raises(SimulationError, match="three numbers"):
        simulation.apply(hs.Push("block", force=(1.0, 0.0), start=1.0, duration=0.1))


def test_a_controller_in_python_takes_part_in_snapshots_or_is_asked_to(made: Maker) -> None:
    robot = made(ARM.format(joint=""), MOTOR)

    class Counts:
        calls = 0

        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            self.calls += 1
            return np.array([0.1 * self.calls])

    class Remembers(Counts):
        def snapshot(self) -> list[float]:
            return [self.calls]

        def restore(self, numbers: np.ndarray) -> None:
            self.calls = int(numbers[0])

    simulation = hs.Simulation(robot, Counts(), state=robot.reference_state())
    with pytest.raises(ControllerError, match="takes no part in snapshots"):
        simulation.snapshot()
    law = Remembers()
    simulation = hs.Simulation(robot, law, state=robot.reference_state())
    simulation.advance(0.005)
    kept, calls = simulation.snapshot(), law.calls
    simulation.advance(0.01)
    there = simulation.state
    simulation.restore(kept)
    assert law.calls == calls
    simulation.advance(0.01)
    assert np.array_equal(simulation.state.q, there.q)
