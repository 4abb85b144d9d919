"""Runs and simulations in space that are kept: files, tables, snapshots, and going on with them."""

from __future__ import annotations

import csv
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fresh_python import fresh_python
from spatial_robots import Maker

import heelstrike as hs
from heelstrike.errors import RunFileError, SimulationError
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.run import AnyRun
from heelstrike.sim.spatial.run import RECORDED

TOPPLE = (
    "<body name='trunk' pos='0 0 0.6'><freejoint/><geom type='box' size='0.1 0.1 0.2' mass='3'/>"
    "<body name='arm' pos='0 0 0.2'><joint name='shoulder' axis='0 1 0' range='-0.5 0.5' "
    "limited='true' frictionloss='0.05'/>"
    "<geom type='capsule' fromto='0 0 0 0 0 0.3' size='0.02' mass='0.5'/></body></body>"
)
MOTOR = (
    "<actuator><motor name='motor' joint='shoulder' ctrlrange='-3 3' ctrllimited='true'/>"
    "</actuator>"
)
GROUND = hs.SpatialGround(
    friction=0.6,
    restitution=0.2,
    normal=(0.05, -0.02, 1.0),
    boxes=(
        hs.Box(center=(0.4, 0.0, 0.05), size=(0.3, 1.0, 0.1), yaw=0.1, friction=0.3),
        hs.Box(center=(-0.5, 0.0, 0.05), size=(0.3, 1.0, 0.1), pitch=0.2),
    ),
)
PUSH = hs.Push("trunk", force=(25.0, 5.0, 0.0), start=0.05, duration=0.1, point=(0.0, 0.0, 0.1))


class Gains(hs.Bundle):
    kp: np.ndarray = hs.array("nu")


class Seen(hs.Bundle):
    swing: np.ndarray = hs.array("nu", unit="rad", label="what the spring saw")
    calls: int = hs.cell(int)


@hs.controller
def spring(state, parameters: Gains, log: Seen, torque):  # type: ignore[no-untyped-def]
    for i in range(torque.shape[0]):
        log.swing[i] = state.joint_position[i]
        torque[i] = -parameters.kp[i] * state.joint_position[i]
    log.calls += 1


def begin(robot: hs.SpatialRobot) -> dict[str, Any]:
    return {
        "state": robot.state(velocity={"trunk_vx": 0.4, "trunk_wz": 1.0}), "ground": GROUND,
        "pushes": PUSH, "stop_when_fallen": False,
    }  # fmt: skip


@pytest.fixture
def robot(made: Maker) -> hs.SpatialRobot:
    return made(TOPPLE, MOTOR)


@pytest.fixture
def run(robot: hs.SpatialRobot) -> AnyRun:
    law = spring(Gains(kp=np.array([8.0])))
    return hs.simulate(robot, law, duration=0.6, record_every=3, **begin(robot))


def alike(one: Any, other: Any) -> None:
    """Two runs are the same in everything that a file holds, to the last bit."""
    for name in ("time", *RECORDED):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    for name in ("status", "message", "events", "certificates", "solver", "steps", "saturations",
                 "timing", "pushes", "method"):  # fmt: skip
        assert getattr(one, name) == getattr(other, name), name
    for name, values in one.ground.numbers().items():
        assert np.array_equal(values, other.ground.numbers()[name], equal_nan=True), name
    mine, its = one.robot, other.robot
    for name, values in mine.model.members().items():
        assert np.array_equal(values, getattr(its.model, name)), name
    for each in fields(mine):
        if each.name not in ("model", "solids"):
            assert getattr(mine, each.name) == getattr(its, each.name), each.name
    for solid, again in zip(mine.solids, its.solids, strict=True):
        assert (solid.link, solid.radius) == (again.link, again.radius)
        assert np.array_equal(solid.corners, again.corners)
    assert one.log.keys() == other.log.keys()
    for name, logged in one.log.items():
        assert np.array_equal(logged.values, other.log[name].values)
        assert (logged.unit, logged.label) == (other.log[name].unit, other.log[name].label)


def test_a_run_comes_back_from_its_file(run: AnyRun, tmp_path: Path) -> None:
    """Everything, and what is made of it goes the same way."""
    assert {event.kind for event in run.events} >= {
        EventKind.TOUCHDOWN, EventKind.SLIP, EventKind.JOINT_STOP, EventKind.JOINT_SLIP,
    }  # fmt: skip
    again = hs.load_run(run.save(tmp_path / "run.nc"))
    assert type(again) is type(run)
    pushed = (*run.pushes,)
    assert again.pushes[0].force == pushed[0].force
    assert again.pushes[0].place(again.robot) == pushed[0].place(run.robot)
    from dataclasses import replace

    alike(run, replace(again, pushes=run.pushes))
    alike(again, hs.load_run(again.save(tmp_path / "again.nc")))
    law = spring(Gains(kp=np.array([8.0])))
    there = hs.simulate(
        again.robot, law, duration=0.6, record_every=3, ground=again.ground, pushes=again.pushes,
        method=again.method, state=hs.State(run.position[0], run.velocity[0]),
        stop_when_fallen=False,
    )  # fmt: skip
    assert np.array_equal(there.position, run.position)
    assert str(again.summary()) == str(run.summary())


def test_what_the_controller_told_is_recorded(run: AnyRun) -> None:
    assert np.array_equal(run.log["swing"].values[:, 0], run.position[:, -1])
    assert run.log["calls"].values.tolist() == [1 + 3 * i for i in range(len(run.time))]


@pytest.mark.slow
def test_a_table_has_a_column_a_number(run: AnyRun, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.csv")
    with path.open(encoding="utf-8", newline="") as file:
        headings, *rows = list(csv.reader(file))
    assert len(rows) == len(run.time)
    for heading in (
        "position trunk_x [m]", "position trunk_qw", "velocity trunk_wy [rad/s]",
        "position shoulder [rad]", "torque motor [N m]", "stop_torque shoulder [N m]",
        "stop_torque trunk_vx [N]", "log_swing motor [rad]",
    ):  # fmt: skip
        assert heading in headings, headings
    place = headings.index("velocity trunk_wy [rad/s]")
    assert [float(row[place]) for row in rows] == run.velocity[:, 4].tolist()
    told = "; ".join(row[-1] for row in rows)
    assert "joint stop shoulder" in told
    assert "joint slip shoulder" in told


def spoilt(path: Path, name: str, value: Any) -> Path:
    """Change a variable of a file, without its seal."""
    import h5netcdf

    there = path.with_name("spoilt.nc")
    there.write_bytes(path.read_bytes())
    with h5netcdf.File(there, "a") as file:
        file["robot"][name][...] = value
    content = there.read_bytes()
    there.write_bytes(
        content[: content.rfind(b"\nheelstrike run")] if b"\nheelstrike run" in content else content
    )
    return there


@pytest.mark.parametrize(
    ("name", "value"),
    [("parent", [-1, 5]), ("joint_kind", [0, 0]), ("joint_kind", [0, 9]), ("mass", [-1.0, 1.0]),
     ("actuator_velocity", [7]), ("solid_link", 2), ("contact_foot", 5)],
)  # fmt: skip
def test_numbers_that_cannot_be_are_refused(
    run: AnyRun, tmp_path: Path, name: str, value: Any
) -> None:
    """They would send compiled code outside its arrays."""
    path = run.save(tmp_path / "run.nc")
    with pytest.raises(RunFileError, match="damaged"):
        hs.load_run(spoilt(path, name, value))


def test_a_run_is_not_attached_to_a_robot_of_the_plane(run: AnyRun, tmp_path: Path) -> None:
    path = run.save(tmp_path / "run.nc")
    with pytest.raises(RunFileError, match="SpatialRobot"):
        hs.load_run(path, hs.load_robot("compass_gait"))
    assert hs.load_run(path, run.robot).robot is run.robot


@pytest.mark.slow
def test_a_run_goes_on_from_its_end(robot: hs.SpatialRobot) -> None:
    law = spring(Gains(kp=np.array([8.0])))
    whole = hs.simulate(robot, law, duration=0.4, **begin(robot))
    first = hs.simulate(robot, law, duration=0.2, **begin(robot))
    assert first.final is not None
    rest = hs.simulate(robot, law, state=first.final, duration=0.2)
    assert rest.time[0] == pytest.approx(0.2)
    for name in RECORDED:
        assert np.array_equal(getattr(rest, name), getattr(whole, name)[200:]), name
    assert [each for each in whole.events if each.time > 0.2005] == [
        each for each in rest.events if each.time > 0.2005
    ]
    assert rest.pushes[0].force == PUSH.force


GO_ON = """
import sys
import numpy as np
import heelstrike as hs
run = hs.load_run(sys.argv[1])
simulation = hs.Simulation(run.robot, state=hs.load_snapshot(sys.argv[2]), method=run.method,
                           record_every=3, stop_when_fallen=False)
simulation.advance(0.6)
np.save(sys.argv[3], np.concatenate((simulation.state.q, simulation.state.v)))
"""


@pytest.mark.slow
def test_a_snapshot_goes_on_in_another_process(robot: hs.SpatialRobot, tmp_path: Path) -> None:
    """Ground, pushes and all that contact remembers come along."""
    whole = hs.simulate(robot, duration=0.6, record_every=3, **begin(robot))
    simulation = hs.Simulation(robot, record_every=3, **begin(robot))
    simulation.advance(0.1)
    kept = simulation.snapshot().save(tmp_path / "kept.npz")
    file, there = whole.save(tmp_path / "run.nc"), tmp_path / "there.npy"
    fresh_python("-c", GO_ON, str(file), str(kept), str(there))
    assert np.array_equal(np.load(there), np.r_[whole.position[-1], whole.velocity[-1]])


def test_a_push_that_is_applied_later_acts_as_one_given_at_first(robot: hs.SpatialRobot) -> None:
    given = begin(robot)
    whole = hs.simulate(robot, duration=0.3, **given)
    simulation = hs.Simulation(robot, **given | {"pushes": ()})
    simulation.advance(0.02)
    simulation.apply(PUSH)
    simulation.advance(0.3)
    assert np.array_equal(simulation.state.q, whole.position[-1])
    assert simulation.record.pushes == (PUSH,)
    with pytest.raises(SimulationError, match="before the present time"):
        simulation.apply(PUSH)
    with pytest.raises(SimulationError, match="does not have; its links are trunk, arm"):
        simulation.apply(hs.Push("tail", force=(1.0, 0.0, 0.0), start=1.0, duration=1.0))


def test_what_is_forgotten_changes_nothing(robot: hs.SpatialRobot) -> None:
    given = begin(robot)
    whole = hs.simulate(robot, duration=0.3, **given)
    simulation = hs.Simulation(robot, **given)
    for until in (0.1, 0.2, 0.3):
        simulation.advance(until)
        record = simulation.record
        assert record.time[0] == pytest.approx(max(until - 0.1, 0.0))
        simulation.forget()
    assert simulation.record.pushes == ()
    assert np.array_equal(simulation.state.q, whole.position[-1])


def test_the_record_shows_this_instant_and_leaves_it(robot: hs.SpatialRobot) -> None:
    simulation = hs.Simulation(robot, **begin(robot))
    simulation.advance(0.2)
    seen = simulation.record
    assert seen.time[-1] == pytest.approx(0.2)
    assert np.array_equal(seen.position[-1], simulation.state.q)
    assert seen.steps == 200
    alike(seen, simulation.record)
    simulation.advance(0.3)
    whole = hs.simulate(robot, duration=0.3, **begin(robot))
    assert np.array_equal(simulation.record.contact_force, whole.contact_force)


def test_neither_robot_nor_ground_is_set_into_the_other(robot: hs.SpatialRobot) -> None:
    simulation = hs.Simulation(robot, state=robot.reference_state())
    low = robot.state({"trunk_z": 0.1})
    with pytest.raises(SimulationError, match="in the ground"):
        simulation.state = low
    with pytest.raises(SimulationError, match="above contact point"):
        simulation.ground = hs.SpatialGround(height=0.5)
    with pytest.raises(SimulationError, match="boxes"):
        simulation.ground = hs.SpatialGround(boxes=(hs.Box((5.0, 0.0, 0.1), (1.0, 1.0, 0.2)),))
    simulation.ground = hs.Ground(friction=0.1)
    assert simulation.ground.friction == 0.1
    assert simulation.advance(0.5) is hs.RunStatus.COMPLETED


@hs.controller(compile=False)
def in_python(state, robot, parameters: Gains, torque):  # type: ignore[no-untyped-def]
    robot.gravity_force(state, torque)
    torque -= parameters.kp * state.joint_position


@hs.controller
def compiled(state, robot, parameters: Gains, torque):  # type: ignore[no-untyped-def]
    robot.gravity_force(state, torque)
    for i in range(torque.shape[0]):
        torque[i] -= parameters.kp[i] * state.joint_position[i]


@hs.controller
def oversteps(torque):  # type: ignore[no-untyped-def]
    write_beyond(torque)


@hs.sim.kernel
def write_beyond(torque):  # type: ignore[no-untyped-def]
    torque[torque.shape[0]] = 1.0


def test_a_law_in_python_does_what_the_compiled_one_does(robot: hs.SpatialRobot) -> None:
    gains = Gains(kp=np.array([3.0]))
    one, other = (
        hs.simulate(robot, law(gains), duration=0.05, **begin(robot))
        for law in (compiled, in_python)
    )
    assert np.array_equal(one.position, other.position)


def test_a_law_that_writes_beyond_its_torques_ends_the_run(robot: hs.SpatialRobot) -> None:
    run = hs.simulate(robot, oversteps(), duration=0.05, on_error="stop", **begin(robot))
    assert run.status is hs.RunStatus.CONTROLLER_FAILED
    assert "wrote beyond its arrays, to torque[1]" in run.message


@pytest.mark.slow
def test_files_of_many_points_are_small(made: Maker, tmp_path: Path) -> None:
    """Where they are follows from the positions and is not written: found again, it is the same.

    Normals of the plane and forces of points in the air compress to nothing. 12 numbers a point
    and row would be 96 bytes.
    """
    box = "<geom type='box' size='0.05 0.05 0.05' pos='{x} 0 {z}' mass='0.1'/>"
    boxes = "".join(box.format(x=0.11 * (i % 5), z=0.11 * (i // 5)) for i in range(15))
    robot = made(f"<body name='pile' pos='0 0 0.3'><freejoint/>{boxes}</body>")
    assert robot.nc == 120
    state = robot.state(velocity={"pile_wy": 1.0, "pile_vx": 0.3})
    run = hs.simulate(robot, state=state, duration=0.3)
    path = run.save(tmp_path / "pile.nc")
    assert path.stat().st_size < 10 * run.gap.size
    again = hs.load_run(path)
    for name in RECORDED:
        assert getattr(again, name) == pytest.approx(getattr(run, name), abs=1e-14), name
    assert "contact_point" in again.to_dataset()
