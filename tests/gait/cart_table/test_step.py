"""What a planned step is before any joint is found: its swing foot, its heels, robots it is for."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.gait.cart_table.step import Step, lowest
from heelstrike.robot.sole import sole

LENGTH, DURATION, BOTH, CLEARANCE = 0.3, 0.7, 0.14, 0.05


def step(robot: hs.Robot) -> Step:
    return Step(robot, LENGTH, DURATION, BOTH, CLEARANCE)


def test_the_swing_foot_goes_from_behind_to_ahead(bravo7: hs.Robot) -> None:
    """At rest on the ground at both ends and until it lifts; half-way it is as high as is asked."""
    swing = step(bravo7).swing
    for t in (0.0, 0.07, BOTH):
        np.testing.assert_allclose(swing(t), [[-LENGTH, 0.0], [0.0, 0.0], [0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(swing(DURATION), [[LENGTH, 0.0], [0.0, 0.0], [0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(swing(0.5 * (BOTH + DURATION))[0], [0.0, CLEARANCE], atol=1e-12)
    h = 1e-5
    for t in (0.2, 0.35, 0.61):
        low, now, high = swing(t - h), swing(t), swing(t + h)
        np.testing.assert_allclose(now[1:], (high[:2] - low[:2]) / (2.0 * h), rtol=1e-6, atol=1e-7)


def test_the_zero_moment_point_goes_from_foot_to_foot_while_both_stand(bravo7: hs.Robot) -> None:
    wanted = step(bravo7).wanted(np.array([0.0, 0.5 * BOTH, BOTH, 0.4, DURATION]))
    np.testing.assert_allclose(wanted, [-LENGTH, -0.5 * LENGTH, 0.0, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(step(bravo7).samples, np.arange(141) * 5e-3, atol=1e-15)


def test_the_lowest_heel_is_that_of_the_foot_that_stands(bravo7: hs.Robot) -> None:
    soles = [sole(bravo7, foot) for foot in bravo7.feet]
    q = bravo7.reference_state().q.copy()
    standing = lowest(bravo7, q, soles)
    for name in ("left_hip", "right_hip"):  # either leg forward, and so higher
        lifted = q.copy()
        lifted[bravo7.joint_names.index(name)] -= 0.6
        assert lowest(bravo7, lifted, soles) == pytest.approx(standing, abs=1e-12)
        heels = [
            dynamics.point_position(bravo7, lifted, each.foot.link, each.ends[0])[1]
            for each in soles
        ]
        assert max(heels) > standing + 0.01


def biped(joints: int, *, flat: bool) -> hs.Robot:
    """A trunk on two legs of so many driven joints, on soles or points."""
    build = hs.RobotBuilder("biped")
    trunk = build.floating_base("trunk", (0.0, 1.0), mass=20.0, inertia=1.0)
    for side in ("right", "left"):
        link = trunk
        for k in range(joints):
            at = (0.0, 0.0 if k == 0 else -0.4)
            link = build.hinge(
                f"{side}_{k}", link, at=at, mass=2.0, inertia=0.1, torque=100.0
            )  # fmt: skip
        if flat:
            build.sole(link, heel=(-0.1, -0.2), toe=(0.1, -0.2))
        else:
            build.contact(link, (0.0, -0.2))
    return build.build()


@pytest.mark.parametrize(("joints", "flat"), [(3, False), (2, True), (2, False)])
def test_only_flat_feet_on_legs_of_three_joints_are_planned(joints: int, flat: bool) -> None:
    with pytest.raises(hs.GaitError, match="robot 'biped' differs"):
        hs.plan_motion(biped(joints, flat=flat), step_length=0.2, step_duration=0.6)
