"""Summary, zero moment point and support polygon of runs in space, against figures known before."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.analysis.spatial import summarize_in_space
from heelstrike.analysis.spatial.friction import face_friction
from heelstrike.analysis.spatial.links import link_motion
from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point

G = 9.81
BLOCK = """<mujoco model="block"><worldbody><body name="block" pos="0 0 0.05"><freejoint/>
  <geom type="box" size="0.1 0.075 0.05" mass="2"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def slide(tmp_path_factory: pytest.TempPathFactory) -> hs.sim.spatial.SpatialRun:
    """A block slides to rest: speed 0.5 m/s along (0.8, 0.6), friction 0.3."""
    path = tmp_path_factory.mktemp("block") / "block.xml"
    path.write_text(BLOCK)
    robot = hs.load_robot(path, dimension=3)
    state = robot.reference_state()
    state.v[:2] = 0.4, 0.3
    return hs.simulate(robot, state=state, duration=0.3, ground=hs.SpatialGround(friction=0.3))


def test_the_figures_of_a_slide(slide: hs.sim.spatial.SpatialRun) -> None:
    """v²/(2 μ g) far, along the velocity; the cone is used whole while it slides."""
    summary = slide.summary()
    way = 0.25 / (2.0 * 0.3 * G)
    # A step of 1 ms ends each millisecond with the lower speed: half a step of way less.
    assert summary.distance_m == pytest.approx(way, abs=0.5 * 0.5e-3 + 1e-6)
    assert summary.forward_m == pytest.approx(0.8 * summary.distance_m, rel=1e-6)
    assert summary.left_m == pytest.approx(0.6 * summary.distance_m, rel=1e-6)
    assert summary.slip_max_m == pytest.approx(summary.distance_m, abs=1e-6)
    assert summary.friction_use_max == pytest.approx(1.0, abs=1e-9)
    assert summary.turn_rad == pytest.approx(0.0, abs=1e-9)
    assert summary.status == "completed"
    assert summary.torque_cost_N2m2s == 0.0
    assert summary.duration_s == pytest.approx(0.3)
    assert summary.residual_max == slide.certificates.residual
    told = json.loads(summary.to_json())
    assert told["solver"]["solves"] == slide.solver.solves
    for word in ("distance", "slip", "penetration", "computing time"):
        assert word in str(summary)


def test_friction_is_that_of_the_box_under_a_point(tmp_path: Path) -> None:
    """It slides on a box of μ = 0.2 over ground of 0.9, until it hits a wall, where none counts."""
    path = tmp_path / "block.xml"
    path.write_text(BLOCK)
    robot = hs.load_robot(path, dimension=3)
    state = robot.reference_state()
    state.q[2] += 0.1
    state.v[0] = 0.4
    boxes = (
        hs.Box(center=(0.0, 0.0, 0.05), size=(2.0, 2.0, 0.1), friction=0.2),
        hs.Box(center=(0.3, 0.0, 0.5), size=(0.37, 2.0, 1.0), friction=0.5),
    )
    run = hs.simulate(
        robot, state=state, duration=0.1, ground=hs.SpatialGround(friction=0.9, boxes=boxes)
    )
    friction = face_friction(run)[:, run.contact_point[0, :, 2] < 0.11]  # the upper meet the wall
    np.testing.assert_array_equal(friction[0], 0.2)
    at_wall = np.isnan(friction).any(axis=1)
    hit = run.world_force[..., 0].sum(axis=1) < -0.3 * robot.weight  # more than friction
    assert hit.any()
    assert at_wall[hit].all()
    assert not at_wall[: int(np.argmax(at_wall))].any()
    assert run.summary().friction_use_max == pytest.approx(1.0, abs=1e-6)


def test_the_zero_moment_point_of_a_slide(slide: hs.sim.spatial.SpatialRun) -> None:
    """Friction at the ground and inertia above it: it lies μ h ahead of the centre of mass."""
    found = spatial_zero_moment_point(slide)
    row = 50
    center = link_motion(slide, np.array([row])).center_of_mass[0]
    ahead = found.total[row] - center
    np.testing.assert_allclose(ahead[:2], 0.3 * 0.05 * np.array([0.8, 0.6]), atol=1e-5)
    assert found.total[row, 2] == pytest.approx(0.0, abs=1e-9)
    corners = found.polygon[row] - [*center[:2], 0.0]
    assert len(corners) == 4
    np.testing.assert_allclose(np.abs(corners), np.tile([0.1, 0.075, 0.0], (4, 1)), atol=1e-9)
    x, y = corners[:, :2].T
    area = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    assert area == pytest.approx(0.2 * 0.15, abs=1e-9)  # anticlockwise from above
    assert found.margin[row] == pytest.approx(0.075 - 0.3 * 0.05 * 0.6, abs=1e-5)


def test_no_moment_about_the_zero_moment_point(slide: hs.sim.spatial.SpatialRun) -> None:
    row = 20
    point = spatial_zero_moment_point(slide, np.array([row])).total[0]
    arm = slide.contact_point[row] - slide.gap[row][:, None] * slide.contact_normal[row] - point
    moment = np.cross(arm, slide.world_force[row]).sum(axis=0)
    np.testing.assert_allclose(moment[:2], 0.0, atol=1e-12)


def test_nothing_pushes(slide: hs.sim.spatial.SpatialRun) -> None:
    high = replace(slide, gap=slide.gap + 1.0, contact_force=np.zeros_like(slide.contact_force))
    found = spatial_zero_moment_point(high)
    assert np.isnan(found.total).all()
    assert np.isnan(found.margin).all()
    assert all(len(corners) == 0 for corners in found.polygon)
    assert np.isnan(summarize_in_space(high).friction_use_max)


def test_a_turn_is_counted_whole(slide: hs.sim.spatial.SpatialRun) -> None:
    angle = np.linspace(0.0, 7.0, len(slide.time))
    position = slide.position.copy()
    position[:, 3:7] = 0.0
    position[:, 3], position[:, 6] = np.cos(angle / 2.0), np.sin(angle / 2.0)
    turned = replace(slide, position=position)
    assert turned.summary().turn_rad == pytest.approx(7.0, abs=1e-9)


def test_the_work_of_motors(tmp_path: Path) -> None:
    """A motor of 2 N m on a wheel of 0.5 kg m² in space: ∫τ² = 4 t, and W = (τ t)² / 2I."""
    path = tmp_path / "wheel.xml"
    path.write_text(
        """<mujoco model="wheel"><option gravity="0 0 -9.81"/><worldbody><body name="cart">
        <joint name="x" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1"
        diaginertia="1 1 1"/>
        <body name="wheel"><joint name="w" axis="0 0 1"/><inertial pos="0 0 0" mass="1"
        diaginertia="0.5 0.5 0.5"/></body></body></worldbody>
        <actuator><motor name="m" joint="w"/></actuator></mujoco>"""
    )
    robot = hs.load_robot(path, dimension=3)

    class Two:
        def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
            return np.array([2.0])

    state = robot.state(velocity={"x": 1.0})
    run = hs.simulate(robot, Two(), state=state, duration=0.5, stop_when_fallen=False)
    summary = run.summary()
    assert summary.torque_cost_N2m2s == pytest.approx(4.0 * 0.5)
    work, way = (2.0 * 0.5) ** 2 / (2.0 * 0.5), 0.5
    assert summary.distance_m == pytest.approx(way)
    assert summary.cost_of_transport == pytest.approx(work / (2.0 * G * way), rel=1e-9)
    assert np.isnan(summary.turn_rad)  # it does not float
