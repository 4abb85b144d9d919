"""The flat sole found from contact points, whatever their place and radius."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait.sole import sole


def with_contacts(robot: hs.Robot, position: list[list[float]], radius: list[float]) -> hs.Robot:
    """Return the robot with other contact points on its first foot, and none elsewhere."""
    count = len(position)
    model = robot.model.replaced(
        contact_link=np.full(count, robot.feet[0].link),
        contact_position=np.array(position),
        contact_radius=np.array(radius),
        friction_scale=np.ones(count),
        restitution_scale=np.ones(count),
    )
    foot = dataclasses.replace(robot.feet[0], contacts=tuple(range(count)))
    return dataclasses.replace(robot, model=model, feet=(foot, robot.feet[1]))


def test_sole_of_bravo7(bravo7: hs.Robot) -> None:
    for index in range(2):
        found = sole(bravo7, index)
        assert found.angle == 0.0
        assert found.half_length == pytest.approx(0.1, abs=1e-12)
        np.testing.assert_allclose(found.point, [0.0, -0.07], atol=1e-12)


def test_sole_of_spring_flamingo_lies_ahead_of_the_ankle(spring_flamingo: hs.Robot) -> None:
    found = sole(spring_flamingo, 0)
    np.testing.assert_allclose(found.point, [0.06, 0.0], atol=1e-12)
    assert found.half_length == pytest.approx(0.1125, abs=1e-12)


def test_discs_of_different_radius_tilt_the_foot(bravo7: hs.Robot) -> None:
    # Centres 0.2 m apart at one height, radii 0.03 and 0.05: the tangent under both descends
    # towards the larger one by asin(0.02 / 0.2); the foot is level when turned back by it.
    robot = with_contacts(bravo7, [[-0.1, 0.0], [0.1, 0.0]], [0.03, 0.05])
    found = sole(robot, 0)
    assert found.angle == pytest.approx(-np.arcsin(0.1), abs=1e-12)
    assert found.half_length == pytest.approx(0.1 * np.cos(np.arcsin(0.1)), abs=1e-12)
    c, s = np.cos(found.angle), np.sin(found.angle)
    heights = [
        -s * x + c * z - r
        for (x, z), r in zip(robot.model.contact_position, robot.model.contact_radius, strict=True)
    ]
    np.testing.assert_allclose(heights, -s * found.point[0] + c * found.point[1], atol=1e-12)


def test_points_above_the_sole_do_not_count(bravo7: hs.Robot) -> None:
    box = [[-0.1, -0.07], [-0.1, -0.05], [0.0, -0.07], [0.1, -0.05], [0.1, -0.07]]
    found = sole(with_contacts(bravo7, box, [0.0] * 5), 0)
    assert found.angle == 0.0
    assert found.half_length == pytest.approx(0.1, abs=1e-12)
    assert found.contacts == (0, 1, 2, 3, 4)


def test_a_single_disc_is_a_point_that_bears_no_moment(bravo7: hs.Robot) -> None:
    found = sole(with_contacts(bravo7, [[0.01, -0.05]], [0.02]), 0)
    assert (found.flat, found.held, found.half_length) == (False, 2, 0.0)
    np.testing.assert_array_equal(found.point, [0.01, -0.05])
    assert found.radius == 0.02
    flat = sole(bravo7, 0)
    assert (flat.flat, flat.held, flat.radius) == (True, 3, 0.0)


def test_a_foot_without_extent_is_refused(bravo7: hs.Robot) -> None:
    robot = with_contacts(bravo7, [[0.0, -0.07], [0.0, -0.07]], [0.0, 0.0])
    with pytest.raises(GaitError, match="cannot rest flat"):
        sole(robot, 0)
