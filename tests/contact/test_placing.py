"""Robots put on the ground: they touch it, and are nowhere in it."""

from __future__ import annotations

import numpy as np
import pytest

from heelstrike import RobotBuilder, contact_kinematics, dynamics
from heelstrike.contact import Ground
from heelstrike.contact.queries.placing import touching_height
from heelstrike.errors import RobotError
from heelstrike.robot import Robot, State, load_robot

GROUNDS = {
    "level": Ground(),
    "uphill": Ground(slope=0.1),
    "downhill": Ground(slope=np.radians(-3.0)),
    "stairs": Ground.stairs(rise=0.02, tread=0.3, count=5, start=-0.4),
    "edge": Ground.stairs(rise=0.15, tread=0.3, count=3),
    "rough": Ground.rough(amplitude=0.01, spacing=0.07, length=3.0, seed=7, start=-1.0),
}


def heights(ground: Ground, robot: Robot, state: State) -> np.ndarray:
    """Vertical distance of each disc to the ground, by laying a fine comb over the ground."""
    result = []
    centers = dynamics.contact_positions(robot, state.q)
    for (x, z), radius in zip(centers, robot.model.contact_radius, strict=True):
        corners = ground.numbers()["corner"][:, 0]
        comb = np.concatenate((np.linspace(x - radius, x + radius, 4001), corners))
        comb = comb[np.abs(comb - x) <= radius] if radius else np.array([x])
        reach = np.sqrt(np.maximum(radius**2 - (comb - x) ** 2, 0.0))
        before = ground.height(np.nextafter(comb, -np.inf)) if radius else ground.height(comb)
        result.append(z - float((np.maximum(ground.height(comb), before) + reach).max()))
    return np.array(result)


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("name", ["bravo7", "compass_gait", "walker2d", "rimless_wheel"])
def test_a_placed_robot_touches_and_is_not_in_the_ground(name: str, ground: str) -> None:
    """The comb misses the highest point by less than 1e-6 of the radius."""
    robot, terrain = load_robot(name), GROUNDS[ground]
    draw = np.random.default_rng(3)
    for _ in range(4):
        q = robot.model.reference + 0.3 * draw.normal(size=robot.nq)
        before = State(q, draw.normal(size=robot.nv))
        after = robot.placed(before, terrain)
        np.testing.assert_array_equal(after.v, before.v)
        assert np.count_nonzero(after.q != before.q) == 1
        assert np.abs(heights(terrain, robot, after).min()) < 1e-6
        assert contact_kinematics(robot, after.q, after.v, terrain).gap.min() > -1e-12


@pytest.mark.parametrize("ground", ["level", "uphill", "downhill", "rough", "stairs"])
@pytest.mark.parametrize("name", ["bravo7", "spring_flamingo", "human7"])
def test_a_standing_robot_has_its_soles_on_the_ground(name: str, ground: str) -> None:
    robot, terrain = load_robot(name), GROUNDS[ground]
    state = robot.standing(terrain)
    gap = contact_kinematics(robot, state.q, state.v, terrain).gap
    assert gap.min() > -1e-12
    soles = [contact for foot in robot.feet for contact in (foot.contacts[0], foot.contacts[-1])]
    np.testing.assert_allclose(gap[soles], 0.0, atol=1e-10)
    np.testing.assert_array_equal(state.v, 0.0)
    np.testing.assert_array_equal(state.q[[0, 2]], robot.model.reference[[0, 2]])
    if ground == "level":
        change = state.q - robot.placed(robot.reference_state(), terrain).q
        np.testing.assert_allclose(change, 0.0, atol=1e-12)


def test_ankles_follow_the_slope() -> None:
    """Of all changes of the legs the one that moves least mass: the ankles turn."""
    robot = load_robot("bravo7")
    state = robot.standing(Ground(slope=0.1))
    pose = robot.positions(state)
    for side in ("left", "right"):
        turn = sum(pose[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle"))
        assert abs(turn) == pytest.approx(0.1, abs=1e-9)
        assert abs(pose[f"{side}_ankle"]) > 2.0 * abs(pose[f"{side}_hip"])


def test_where_no_foot_fits_the_posture_stays() -> None:
    """A notch as wide as the foot is long, and as deep as it is wide."""
    robot = load_robot("bravo7")
    notch = Ground(profile=[(-1, 0), (-0.02, 0), (0.0, -0.5), (0.02, 0), (1, 0)])
    tilted = Ground(slope=-1.1)
    for ground in (notch, tilted):
        state = robot.standing(ground)
        np.testing.assert_array_equal(state.q[2:], robot.model.reference[2:])
        assert heights(ground, robot, state).min() == pytest.approx(0.0, abs=1e-12)


def test_a_disc_on_a_slope_touches_uphill_of_its_centre() -> None:
    slope = 0.2
    height = touching_height(Ground(slope=slope), 1.0, 0.1)
    assert height == pytest.approx(np.tan(slope) + 0.1 / np.cos(slope), rel=1e-14)


def test_who_cannot_be_placed() -> None:
    fixed = RobotBuilder("arm")
    arm = fixed.hinge("a", None, mass=1, inertia=1)
    robot = fixed.build()
    with pytest.raises(RobotError, match="no contact points"):
        robot.standing(Ground())
    fixed.contact(arm, (0, -1))
    with pytest.raises(RobotError, match="no joint that lifts all of it"):
        fixed.build().placed(fixed.build().reference_state(), Ground())
