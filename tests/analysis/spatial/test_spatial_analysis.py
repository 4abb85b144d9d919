"""What a run in space says: momentum, support polygon, zero moment point, capture point."""

from __future__ import annotations

import numpy as np
import pytest
from spatial_cases import in_space

import heelstrike as hs
from heelstrike import analysis, dynamics
from heelstrike.analysis.spatial import SupportPolygon, centroidal_motion, support_polygon
from heelstrike.sim.spatial.run import SpatialRun

G = 9.81
BLOCK = (
    "<mujoco><worldbody><body name='block' pos='0 0 0.1'><freejoint/>"
    "<geom type='box' size='0.2 0.15 0.1' mass='2'/></body></worldbody></mujoco>"
)
STICKS = (  # two bodies on a free one, which swing in the air
    "<mujoco><worldbody><body name='trunk' pos='0 0 2'><freejoint/><geom size='0.1' mass='2'/>"
    "<body name='arm' pos='0.1 0 0'><joint name='a' axis='0 0.6 0.8'/>"
    "<geom type='capsule' fromto='0 0 0 0.3 0.1 0' size='0.02' mass='1'/></body>"
    "<body name='leg' pos='0 0.1 0'><joint name='b' type='ball'/>"
    "<geom type='capsule' fromto='0 0 0 0 0.1 -0.4' size='0.02' mass='1'/></body></body>"
    "</worldbody></mujoco>"
)


def block_under(force: tuple[float, float, float]) -> SpatialRun:
    """A block of 2 kg that stands while a force acts on its middle, 0.1 m above the ground."""
    robot = in_space(BLOCK)
    push = hs.Push("block", force=force, start=0.0, duration=1.0)
    run = hs.simulate(
        robot, state=robot.reference_state(), duration=0.05, pushes=[push],
        ground=hs.Ground(friction=1.0),
    )  # fmt: skip
    assert isinstance(run, SpatialRun)
    return run


def test_the_zero_moment_point_of_a_block_that_is_pushed() -> None:
    """Moments about the ground: the centre of pressure goes ahead by 0.1 m · force / weight."""
    run = block_under((3.0, -2.0, 0.0))
    found = analysis.zero_moment_point(run)
    expected = np.array([0.1 * 3.0 / (2 * G), -0.1 * 2.0 / (2 * G), 0.0])
    np.testing.assert_allclose(found.total[5], expected, atol=1e-12)
    assert found.margin[5] == pytest.approx(0.15 - abs(expected[1]), abs=1e-12)
    assert found.foot.shape == (len(run.time), len(run.robot.feet), 3)
    np.testing.assert_allclose(found.foot[5, 0], expected, atol=1e-12)
    np.testing.assert_allclose(found.capture_point[5], [0.0, 0.0, 0.0], atol=1e-9)


def test_the_support_polygon_of_a_block() -> None:
    polygon = support_polygon(block_under((0.0, 0.0, 0.0)), 3)
    assert len(polygon.corners) == 4
    assert polygon.area == pytest.approx(0.4 * 0.3)
    world = sorted(polygon.world.round(9).tolist())
    assert world == sorted([x, y, 0.0] for x in (-0.2, 0.2) for y in (-0.15, 0.15))
    assert polygon.margin(np.array([0.19, 0.0, 5.0])) == pytest.approx(0.01)
    assert polygon.margin(np.array([0.23, 0.19, 0.0])) == pytest.approx(-0.05)


def test_polygons_of_few_points() -> None:
    axes = np.roll(np.eye(3), 1, axis=0)
    line = SupportPolygon(np.zeros(3), axes, np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert line.margin(np.array([0.5, 0.2, 0.0])) == pytest.approx(-0.2)
    assert line.margin(np.array([0.5, 0.0, 0.0])) == 0.0
    assert line.area == 0.0
    point = SupportPolygon(np.zeros(3), axes, np.array([[1.0, 1.0]]))
    assert point.margin(np.array([1.0, 3.0, 0.0])) == -2.0
    nothing = SupportPolygon(np.zeros(3), axes, np.zeros((0, 2)))
    assert np.isnan(nothing.margin(np.zeros(3)))
    assert nothing.area == 0.0


def test_nothing_carries_in_the_air() -> None:
    robot = in_space(BLOCK)
    q = robot.reference_state().q
    q[2] = 1.0
    run = hs.simulate(robot, state=hs.State(q, np.zeros(6)), duration=0.01)
    found = analysis.zero_moment_point(run)
    assert np.isnan(found.total).all()
    assert np.isnan(found.margin).all()
    assert len(support_polygon(run, 0).corners) == 0


def test_centroidal_motion_is_that_of_the_queries_and_conserved_in_the_air() -> None:
    robot = in_space(STICKS)
    state = hs.State(robot.reference_state().q, np.linspace(-1.0, 1.5, robot.nv))
    run = hs.simulate(robot, state=state, duration=0.1)
    motion = centroidal_motion(run)
    for row in (0, 40, 100):
        q, v = run.position[row], run.velocity[row]
        np.testing.assert_allclose(
            motion.center_of_mass[row], dynamics.center_of_mass(robot, q), rtol=1e-13
        )
        np.testing.assert_allclose(motion.momentum[row], dynamics.momentum(robot, q, v), rtol=1e-12)
        energies = dynamics.energy(robot, q, v)
        np.testing.assert_allclose((motion.kinetic[row], motion.potential[row]), energies)
    # Time stepping of 1 ms keeps momentum to some parts in 10 000 over 0.1 s of fast swings.
    turned = motion.momentum[:, 3:] - motion.momentum[0, 3:]
    assert np.abs(turned).max() < 5e-3 * np.abs(motion.momentum[0, 3:]).max()
    fallen = motion.momentum[0, 2] - robot.weight * run.time
    np.testing.assert_allclose(motion.momentum[:, 2], fallen, atol=1e-3)


def test_the_capture_point_leads_the_mass() -> None:
    robot = in_space(BLOCK)
    velocity = np.array([0.3, -0.2, 0.0, 0.0, 0.0, 0.0])
    run = hs.simulate(
        robot, state=hs.State(robot.reference_state().q, velocity), duration=0.01,
        ground=hs.Ground(friction=0.0),
    )  # fmt: skip
    found = analysis.zero_moment_point(run)
    ahead = found.capture_point[2] - run.position[2, :3]
    expected = [0.3 * np.sqrt(0.1 / G), -0.2 * np.sqrt(0.1 / G), -0.1]
    np.testing.assert_allclose(ahead, expected, atol=1e-12)
