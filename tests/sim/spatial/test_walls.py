"""Walls of boxes: what slides against one stands before it, judged by the corners of the robot."""

from __future__ import annotations

import numpy as np
import pytest
from spatial_robots import Maker

import heelstrike as hs

CRATE = (
    "<body name='crate' pos='0 0 0.3'><freejoint/>"
    "<geom type='box' size='0.15 0.15 0.3' mass='5'/></body>"
)
FEELER = (
    "<body name='feeler' pos='0 0 0.1'><freejoint/>"
    "<geom type='box' size='0.2 0.15 0.1' mass='2'/></body>"
)


def depth_in(run: object, half: tuple[float, ...], box: hs.Box) -> float:
    """Deepest corner of a robot of one box in a box that is not turned, by all its faces."""
    deepest = 0.0
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * half
    low = np.array(box.center) - 0.5 * np.array(box.size)
    high = np.array(box.center) + 0.5 * np.array(box.size)
    for row in run.position:  # type: ignore[attr-defined]
        w, x, y, z = row[3:]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        at = row[:3] + corners @ turn.T
        # Below its bottom there is the plane: only the way to the other faces counts.
        out = np.min(np.c_[at[:, :2] - low[:2], high - at], axis=1)
        deepest = max(deepest, float(np.max(out)))
    return deepest


@pytest.mark.parametrize(
    ("inner", "half"),
    [(CRATE, (0.15, 0.15, 0.3)), (FEELER, (0.2, 0.15, 0.1))],
    ids=["tall", "flat"],
)
def test_a_box_stops_at_a_wall_that_stands_on_the_plane(
    made: Maker, inner: str, half: tuple[float, float, float]
) -> None:
    robot = made(inner)
    box = hs.Box(center=(0.7, 0.0, 0.1), size=(0.4, 2.0, 0.2))
    ground = hs.SpatialGround(friction=0.0, boxes=(box,))
    state = hs.State(robot.reference_state().q, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    run = hs.simulate(robot, state=state, duration=0.6, ground=ground)
    assert run.certificates.uncertified == 0
    assert depth_in(run, half, box) <= 1e-6
    assert np.max(run.position[:, 0]) > 0.5 - half[0] - 1e-3
    assert run.velocity[-1, 0] < 0.9


def test_the_first_riser_of_stairs_is_felt(made: Maker) -> None:
    robot = made(FEELER)
    ground = hs.SpatialGround.stairs(rise=0.08, tread=0.3, count=3, start=0.4, friction=0.0)
    state = hs.State(robot.reference_state().q, np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    run = hs.simulate(robot, state=state, duration=0.5, ground=ground)
    assert depth_in(run, (0.2, 0.15, 0.1), ground.boxes[0]) <= 1e-6
    assert np.max(run.position[:, 0]) > 0.2 - 1e-3


def test_points_slide_from_box_to_box_of_one_height(made: Maker) -> None:
    """The rim of the next box, wider than the first, is no wall."""
    robot = made(FEELER)
    boxes = (
        hs.Box(center=(0.0, 0.0, 0.1), size=(1.0, 1.0, 0.2)),
        hs.Box(center=(1.0, 0.0, 0.1), size=(1.0, 2.0, 0.2)),
    )
    ground = hs.SpatialGround(friction=0.0, boxes=boxes)
    q = robot.reference_state().q.copy()
    q[2] = 0.3
    run = hs.simulate(
        robot, state=hs.State(q, np.r_[1.0, np.zeros(5)]), duration=0.6, ground=ground
    )
    assert run.velocity[-1] == pytest.approx(np.r_[1.0, np.zeros(5)], abs=1e-9)


def test_what_is_in_the_floor_meets_the_wall_that_stands_on_it(made: Maker) -> None:
    """Corners 50 µm in the floor do not pass below the wall half a millimetre ahead of them."""
    robot = made(FEELER)
    box = hs.Box(center=(0.7, 0.0, 0.1), size=(0.4, 2.0, 0.2))
    q = robot.reference_state().q.copy()
    q[0], q[2] = 0.3 - 5e-4, 0.1 - 5e-5
    state = hs.State(q, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    ground = hs.SpatialGround(friction=0.0, boxes=(box,))
    run = hs.simulate(robot, state=state, duration=0.05, ground=ground)
    assert np.max(run.position[:, 0]) <= 0.3 + 1e-6


def test_points_that_are_in_the_floor_and_in_a_wall_come_out_of_both(made: Maker) -> None:
    """Deeper in the floor, 50 µm, than in the wall that stands on it, 30 µm: not downwards."""
    robot = made(FEELER)
    box = hs.Box(center=(0.7, 0.0, 0.1), size=(0.4, 2.0, 0.2))
    q = robot.reference_state().q.copy()
    q[0], q[2] = 0.3 + 3e-5, 0.1 - 5e-5
    run = hs.simulate(
        robot, state=hs.State(q, np.zeros(6)), duration=0.02,
        ground=hs.SpatialGround(friction=0.0, boxes=(box,)),
    )  # fmt: skip
    assert run.position[-1, 0] <= 0.3 + 1e-9
    assert run.position[-1, 2] == pytest.approx(0.1, abs=1e-9)


def test_a_ball_in_a_corner_touches_all_three_faces(made: Maker) -> None:
    """It comes to rest where floor and two walls meet, and is in none of them on its way."""
    robot = made(
        "<body name='ball' pos='0.2 0.25 0.1'><freejoint/>"
        "<geom type='sphere' size='0.1' mass='1'/></body>"
    )
    walls = (
        hs.Box(center=(0.7, 0.0, 0.2), size=(0.4, 2.0, 0.4)),
        hs.Box(center=(0.0, 0.7, 0.2), size=(2.0, 0.4, 0.4)),
    )
    state = hs.State(robot.reference_state().q, np.r_[1.3, 1.1, np.zeros(4)])
    run = hs.simulate(
        robot, state=state, duration=0.3, ground=hs.SpatialGround(friction=0.0, boxes=walls)
    )
    assert np.max(run.position[:, :2]) <= 0.4 + 1e-9
    assert np.min(run.position[:, 2]) >= 0.1 - 1e-9
    assert run.position[-1, :3] == pytest.approx([0.4, 0.4, 0.1], abs=1e-9)
    assert run.velocity[-1] == pytest.approx(np.zeros(6), abs=1e-9)


BALL = (
    "<body name='ball' pos='0 0 0.1'><freejoint/><geom type='sphere' size='0.1' mass='1'/></body>"
)


def test_a_ball_rolls_along_a_wall_of_two_boxes(made: Maker) -> None:
    """The edge of the next box is no second wall, although its normal is a little askew there."""
    robot = made(BALL)
    walls = tuple(hs.Box(center=(x, 0.3, 0.25), size=(1.0, 0.4, 0.5)) for x in (-0.5, 0.5))
    state = hs.State(
        robot.reference_state().q + np.r_[-0.0503, np.zeros(6)], np.r_[1.0, np.zeros(5)]
    )
    ground = hs.SpatialGround(friction=0.0, boxes=walls)
    run = hs.simulate(robot, state=state, duration=0.1, ground=ground)
    assert run.position[-1, 0] > 0.04
    assert run.velocity == pytest.approx(np.tile(state.v, (len(run.time), 1)), abs=1e-9)


def test_a_bounce_off_one_wall_takes_none_off_the_other(made: Maker) -> None:
    """A ball flies into a corner of two walls: it comes back from both with half of its speeds.

    Before the first bounce it is nearer to the wall that it meets a step later.
    """
    robot = made(BALL)
    walls = (
        hs.Box(center=(0.7, 0.0, 0.5), size=(0.4, 2.0, 1.0)),
        hs.Box(center=(0.0, 0.7, 0.5), size=(2.0, 0.4, 1.0)),
    )
    ground = hs.SpatialGround(friction=0.0, restitution=0.5, boxes=walls)
    q = robot.reference_state().q.copy()
    for gaps, speeds in (((0.9e-3, 0.5e-3), (1.0, 0.3)), ((0.5e-3, 0.9e-3), (0.3, 1.0))):
        q[:3] = 0.4 - gaps[0], 0.4 - gaps[1], 0.5
        state = hs.State(q, np.r_[speeds, np.zeros(4)])
        run = hs.simulate(robot, state=state, duration=0.01, ground=ground)
        assert run.velocity[-1, :2] == pytest.approx([-0.5 * each for each in speeds], abs=1e-9)


def test_sides_within_boxes_that_cross_are_no_walls(made: Maker) -> None:
    """Feet a few micrometres in two platforms of one height that cross: they go up only."""
    robot = made(FEELER)
    boxes = (
        hs.Box(center=(0.0, 0.0, 0.1), size=(2.0, 0.6, 0.2)),
        hs.Box(center=(0.0, 0.0, 0.1), size=(0.4 - 6e-6, 2.0, 0.2)),
    )
    q = robot.reference_state().q.copy()
    q[2] = 0.3 - 5e-6
    run = hs.simulate(
        robot, state=hs.State(q, np.zeros(6)), duration=0.01,
        ground=hs.SpatialGround(friction=0.0, boxes=boxes),
    )  # fmt: skip
    q[0] += 6e-6
    askew = hs.simulate(
        robot, state=hs.State(q, np.zeros(6)), duration=0.01,
        ground=hs.SpatialGround(friction=0.0, boxes=boxes),
    )  # fmt: skip
    for each in (run, askew):
        assert each.position[-1, 2] == pytest.approx(0.3, abs=1e-9)
        assert np.abs(each.position[:, :2] - each.position[0, :2]).max() <= 1e-9
