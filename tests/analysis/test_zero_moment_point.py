"""Where the zero moment point is (paper eq. 44, 45)."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from synthetic_runs import make_run, pushes

import heelstrike as hs
from heelstrike.analysis import (
    foot_wrenches,
    soles,
    zero_moment_point,
    zero_moment_point_limits,
)
from heelstrike.dynamics import inverse_dynamics, link_poses

HALF_SOLE = 0.1  # bravo7's heel and toe are 0.1 m from the ankle's projection


def one_row(force: np.ndarray, **others: object) -> hs.Run:
    return make_run(walking.bravo7(), [0.0, 1e-3], force=force, **others)  # type: ignore[arg-type]


@pytest.mark.parametrize(("heel", "toe"), [(300.0, 100.0), (1.0, 1.0), (0.0, 5.0), (7.0, 0.0)])
def test_lever_rule(heel: float, toe: float) -> None:
    """Two forces balance at the point that divides their distance in inverse proportion."""
    force = np.zeros((4, 2))
    force[:2] = [[heel, 0.2 * heel], [toe, -0.1 * toe]]
    zmp = zero_moment_point(one_row(force))
    expected = HALF_SOLE * (toe - heel) / (toe + heel)
    np.testing.assert_allclose(zmp.foot[:, 0], expected, atol=1e-15)
    np.testing.assert_allclose(zmp.foot_margin[:, 0], HALF_SOLE - abs(expected), atol=1e-15)
    assert np.isnan(zmp.foot[:, 1]).all()
    assert np.isnan(zmp.foot_margin[:, 1]).all()
    assert zmp.single_support.all()
    np.testing.assert_array_equal(zmp.stance, zmp.foot[:, 0])
    np.testing.assert_allclose(zmp.total, [[expected, 0.0]] * 2, atol=1e-15)


def test_equation_44_with_our_sign() -> None:
    """On a flat foot p = −m_y / f_z, with the foot's wrench about the ankle over the sole."""
    force = np.array([[300.0, 40.0], [120.0, -10.0], [50.0, 5.0], [80.0, 60.0]])
    run = one_row(force)
    wrench = foot_wrenches(run)[0]
    np.testing.assert_allclose(wrench[:, 0], [30.0, 65.0])
    np.testing.assert_allclose(wrench[:, 1], [420.0, 130.0])
    # Forces at z = 0 have the moment −x f_z about +y.
    np.testing.assert_allclose(wrench[:, 2], [0.1 * 300.0 - 0.1 * 120.0, 0.1 * 50.0 - 0.1 * 80.0])
    zmp = zero_moment_point(run)
    np.testing.assert_allclose(zmp.foot[0], -wrench[:, 2] / wrench[:, 1], atol=1e-15)
    # Eq. 45: no moment about the zero moment point.
    residual = wrench[:, 2] + wrench[:, 1] * zmp.foot[0]
    np.testing.assert_allclose(residual, 0.0, atol=1e-12)


def test_the_moment_is_about_the_foot_wherever_the_robot_is() -> None:
    """Far from the origin and above the ground; forces act at heel and toe, 0.1 m off the ankle."""
    robot = walking.bravo7()
    q = robot.model.reference.copy()
    q[:2] += [3.0, 0.5]
    force = np.array([[300.0, 40.0], [120.0, -10.0], [50.0, 5.0], [80.0, 60.0]])
    wrench = foot_wrenches(one_row(force, position=q))[0]
    np.testing.assert_allclose(wrench, [[30.0, 420.0, 18.0], [65.0, 130.0, -3.0]], atol=1e-12)


def test_two_feet_balance_between_them() -> None:
    robot = walking.bravo7()
    q = robot.model.reference.copy()
    q[[3, 6]] = [-0.3, 0.3]  # right leg forward, left leg back,
    q[[5, 8]] = [0.3, -0.3]  # soles level
    run = make_run(
        robot, [0.0], position=q, force=[[90.0, 0.0], [90.0, 0.0], [30.0, 0.0], [30.0, 0.0]]
    )
    ahead = (0.441 + 0.4428) * np.sin(0.3)
    zmp = zero_moment_point(run)
    assert zmp.total[0, 0] == pytest.approx(0.75 * ahead - 0.25 * ahead, abs=1e-12)
    assert not zmp.single_support[0]
    assert np.isnan(zmp.stance[0])


def test_nothing_pushes() -> None:
    zmp = zero_moment_point(one_row(np.zeros((4, 2))))
    for values in (zmp.foot, zmp.foot_margin, zmp.total, zmp.margin, zmp.stance):
        assert np.isnan(values).all()
    assert not zmp.single_support.any()


def test_tiptoe() -> None:
    """On its toe alone a foot has the zero moment point at the toe, with no margin left."""
    robot = walking.bravo7()
    tilt = 0.2
    q = robot.model.reference.copy()
    q[5] = tilt  # toe down
    ankle_to_toe = np.hypot(0.1, 0.07)
    below = ankle_to_toe * np.sin(np.arctan2(0.07, 0.1) + tilt)
    q[1] += below - 0.07
    run = make_run(robot, [0.0], position=q, force=[[0.0, 0.0], [700.0, 100.0], [0, 0], [0, 0]])
    assert run.gap[0, 1] == pytest.approx(0.0, abs=1e-12)
    zmp = zero_moment_point(run)
    # The reference point, ankle over sole, comes down on the ground at its own x.
    reference = 0.07 * -np.sin(tilt)
    toe = ankle_to_toe * np.cos(np.arctan2(0.07, 0.1) + tilt)
    assert zmp.foot[0, 0] == pytest.approx(toe - reference, abs=1e-12)
    assert zmp.foot_margin[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_slope_changes_nothing_for_a_foot_that_lies_on_it() -> None:
    robot = walking.bravo7()
    slope = 0.2
    q = robot.model.reference.copy()
    height = q[1]
    q[:3] = [-height * np.sin(slope), height * np.cos(slope), -slope]  # the whole robot turned back
    run = make_run(
        robot,
        [0.0],
        position=q,
        force=[[300.0, 20.0], [100.0, 5.0], [0.0, 0.0], [0.0, 0.0]],
        ground=hs.Ground(slope=slope),
    )
    np.testing.assert_allclose(run.gap, 0.0, atol=1e-12)
    zmp = zero_moment_point(run)
    assert zmp.foot[0, 0] == pytest.approx(-0.05, abs=1e-12)
    # In the world the same distance is measured along the slope, from the ankle at the origin.
    np.testing.assert_allclose(
        zmp.total[0], [-0.05 * np.cos(slope), -0.05 * np.sin(slope)], atol=1e-12
    )


def test_both_feet_at_an_impact_are_no_single_support() -> None:
    robot = walking.bravo7()
    run = make_run(robot, [0.0, 1e-3, 2e-3], force=pushes(robot, [[0], [0, 1], [1]]))
    zmp = zero_moment_point(run)
    np.testing.assert_array_equal(zmp.single_support, [True, False, True])
    np.testing.assert_array_equal(np.isfinite(zmp.stance), [True, False, True])


def test_limits_are_the_ends_of_the_sole() -> None:
    assert zero_moment_point_limits(walking.bravo7()) == pytest.approx((-0.1, 0.1))
    flamingo = hs.load_robot("spring_flamingo")
    assert zero_moment_point_limits(flamingo) == pytest.approx((-0.0525, 0.1725))
    for sole in soles(flamingo):
        np.testing.assert_allclose(sole.reference, 0.0, atol=1e-12)  # the sole runs through it


def test_zero_moment_point_of_a_walk_follows_from_its_motion() -> None:
    """D'Alembert: it is where the ground must push to accelerate the robot as it was accelerated.

    The trunk's rows of A v̇ + H are the resultant of all contact forces and their moment about the
    hip, because no actuator acts on the trunk. In time stepping v̇ is (v⁺ − v) / h at the old
    position, so that the two sides agree to round-off, impacts included.
    """
    robot, run = walking.bravo7(), walking.walk(steps=2)
    zmp = zero_moment_point(run)
    for row in range(0, len(run.time) - 1, 7):
        rate = (run.velocity[row + 1] - run.velocity[row]) / (run.time[row + 1] - run.time[row])
        q, v = run.position[row], run.velocity[row]
        fx, fz, moment = inverse_dynamics(robot, q, v, rate)[:3]
        hip = link_poses(robot, q).origin[2]
        # The moment about the hip of a force at (p, 0) is (0 − z) f_x − (p − x) f_z.
        p = hip[0] - (moment + hip[1] * fx) / fz
        assert zmp.total[row, 0] == pytest.approx(p, abs=1e-7)
        assert zmp.total[row, 1] == pytest.approx(0.0, abs=1e-6)
