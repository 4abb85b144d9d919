"""Distances to the faces of the ground, which of them is nearest, and which is the second one.

A floor, a wall that it turns up to, a landing, and a drop: by elementary geometry. Kernels run as
plain Python here.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.sim.contacts import faces
from heelstrike.sim.contacts.faces import NO_FACE, Located

along_segment, height_over = uncompiled(faces.along_segment), uncompiled(faces.height_over)
distance_to, room_to = uncompiled(faces.distance_to), uncompiled(faces.room_to)
nearest_face, second_face = uncompiled(faces.nearest_face), uncompiled(faces.second_face)
is_beside, is_concave = uncompiled(faces.is_beside), uncompiled(faces.is_concave)

# Segments: 0 floor, 1 wall up at x = 1, 2 landing at z = 2, 3 drop at x = 4, 4 floor again.
STAIR = hs.Ground(
    profile=[(-1.0, 0.0), (1.0, 0.0), (1.0, 2.0), (4.0, 2.0), (4.0, 0.0), (9.0, 0.0)],
    friction=[0.1, 0.2, 0.3, 0.4, 0.5], restitution=[0.0, 0.1, 0.2, 0.3, 0.4],
).model()  # fmt: skip
SLOPE = hs.Ground(profile=[(0.0, 0.0), (4.0, 3.0), (8.0, 3.0)]).model()


def test_places_along_and_over_a_slope() -> None:
    """3-4-5: 5 m along it from (0, 0) to (4, 3); a place 1 m over it and 2 m along."""
    x, z = 2.0 * 0.8 - 0.6, 2.0 * 0.6 + 0.8
    assert along_segment(SLOPE, 0, x, z) == pytest.approx((2.0, 3.0))
    assert height_over(SLOPE, 0, x, z) == pytest.approx(1.0)
    assert height_over(SLOPE, 0, x + 1.2, z - 1.6) == pytest.approx(-1.0)
    assert along_segment(SLOPE, 1, 9.0, 7.0) == pytest.approx((5.0, -1.0))
    assert height_over(SLOPE, 1, 9.0, 7.0) == pytest.approx(4.0)


def test_distances_end_at_corners_but_for_the_outermost_segments() -> None:
    assert distance_to(STAIR, 0, -9.0, 0.5) == pytest.approx(0.5)  # it goes on
    assert distance_to(STAIR, 4, 99.0, -0.5) == pytest.approx(0.5)
    assert distance_to(STAIR, 0, 1.3, 0.4) == pytest.approx(0.5)  # to the corner (1, 0)
    assert distance_to(STAIR, 4, 3.6, 0.3) == pytest.approx(0.5)  # to (4, 0)
    assert distance_to(STAIR, 2, 0.7, 2.4) == pytest.approx(0.5)  # to (1, 2)
    assert distance_to(STAIR, 2, 4.3, 1.6) == pytest.approx(0.5)  # to (4, 2)
    assert distance_to(STAIR, 1, 0.5, 1.0) == pytest.approx(0.5)
    assert distance_to(STAIR, 1, 1.5, 1.0) == pytest.approx(0.5)  # of the line, behind it
    assert distance_to(STAIR, 2, 2.0, 1.0) == pytest.approx(1.0)


def test_room_is_left_to_a_line_or_to_a_corner() -> None:
    """Face 2 i is segment i, face 2 i + 1 its left corner."""
    assert room_to(STAIR, 0, 0.0, 0.5, 0.2) == pytest.approx(0.3)
    assert room_to(STAIR, 2, 0.5, 1.0, 0.1) == pytest.approx(0.4)
    assert room_to(STAIR, 5, 0.7, 2.4, 0.1) == pytest.approx(0.4)  # corner 2 is (1, 2)
    assert room_to(STAIR, 7, 4.3, 2.4, 0.1) == pytest.approx(0.4)  # corner 3 is (4, 2)


@pytest.mark.parametrize(
    ("x", "z", "radius", "face"),
    [
        (-3.0, 0.1, 0.2, 0), (0.0, 0.1, 0.2, 0), (0.9, 0.5, 0.2, 2), (0.5, 0.4, 0.2, 0),
        (0.8, 2.2, 0.2, 5), (0.8, 2.2, 0.0, 2), (2.0, 2.1, 0.2, 4), (4.1, 2.2, 0.2, 7),
        (4.2, 1.0, 0.2, 6), (4.2, 0.1, 0.2, 8), (99.0, 0.1, 0.2, 8),
    ],
)  # fmt: skip
def test_the_nearest_face(x: float, z: float, radius: float, face: int) -> None:
    """Of a disc a corner that sticks out is a face of its own; of a point none is."""
    assert nearest_face(STAIR, x, z, radius) == face


def test_lines_are_beside_their_corners() -> None:
    """Segment i, face 2 i, ends at corners i and i + 1, faces 2 i + 1 and 2 i + 3."""
    beside = [(a, b) for a in range(10) for b in range(10) if is_beside(a, b)]
    ends = [(2 * i, 2 * i + side) for i in range(5) for side in (1, 3) if 2 * i + side < 10]
    assert sorted(beside) == sorted(ends + [(b, a) for a, b in ends])


def test_the_ground_turns_upwards_where_two_segments_face_each_other() -> None:
    assert [is_concave(STAIR, corner) for corner in range(7)] == [
        False, True, False, False, True, False, False
    ]  # fmt: skip
    bump = hs.Ground(profile=[(0.0, 0.0), (1.0, 0.0), (2.0, 1e-12), (3.0, 2e-12)]).model()
    assert [is_concave(bump, corner) for corner in (1, 2)] == [False, False]


@pytest.mark.parametrize(
    ("face", "besides", "x", "z", "radius", "gap", "second"),
    [
        # A point on the floor and the wall next to it; nothing next to a convex corner.
        (0, NO_FACE, 0.7, 0.0, 0.0, 0.3, 2),
        (2, NO_FACE, 1.0, 0.4, 0.0, 0.4, 0),
        (8, NO_FACE, 4.3, 0.0, 0.0, 0.3, 6),
        (6, NO_FACE, 4.0, 0.4, 0.0, 0.4, 8),
        (4, NO_FACE, 2.0, 2.0, 0.0, np.inf, NO_FACE),
        (0, 2, 0.7, 0.0, 0.0, np.inf, NO_FACE),
        # A disc: the wall itself, or the corner over it.
        (0, NO_FACE, 0.7, 0.2, 0.2, 0.1, 2),
        (0, NO_FACE, 0.7, 2.4, 2.4, 0.5 - 2.4, 5),
        (2, NO_FACE, 0.8, 0.5, 0.2, 0.3, 0),
        (5, NO_FACE, 0.9, 2.1, 0.1, 2.1 - 0.1, 0),
        (7, NO_FACE, 4.2, 2.0, 0.2, 2.0 - 0.2, 8),
    ],
)
def test_the_second_face_that_could_be_touched(
    face: int, besides: int, x: float, z: float, radius: float, gap: float, second: int
) -> None:
    found = second_face(STAIR, face, besides, x, z, radius)
    assert found == (pytest.approx(gap), second)


SHAFT = hs.Ground(
    profile=[(-1.0, 1.0), (0.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0)]
).model()


def test_a_disc_in_a_shaft_may_touch_its_floor_and_both_walls() -> None:
    """Walls are faces 2 and 6, the floor is face 4; edges above them are faces 3 and 9."""
    assert second_face(SHAFT, 4, NO_FACE, 0.4, 0.3, 0.3) == (pytest.approx(0.1), 2)
    assert second_face(SHAFT, 4, NO_FACE, 0.6, 0.3, 0.3) == (pytest.approx(0.1), 6)
    assert second_face(SHAFT, 4, 2, 0.4, 0.3, 0.3) == (pytest.approx(0.3), 6)
    assert second_face(SHAFT, 4, 6, 0.6, 0.3, 0.3) == (pytest.approx(0.3), 2)
    assert second_face(SHAFT, 2, NO_FACE, 0.4, 0.5, 0.4) == (pytest.approx(0.1), 4)
    # Above the shaft: on one edge, the other is the second face; not the lines next to its own.
    assert second_face(SHAFT, 3, NO_FACE, 0.5, 1.2, 0.5) == (
        pytest.approx(math.hypot(0.5, 0.2) - 0.5), 9
    )  # fmt: skip
    assert second_face(SHAFT, 9, NO_FACE, 0.5, 1.2, 0.5) == (
        pytest.approx(math.hypot(0.5, 0.2) - 0.5), 3
    )  # fmt: skip
    # A third one is beside neither of the two.
    gap, third = second_face(SHAFT, 3, 9, 0.5, 1.2, 0.5)
    assert (gap, third) == (pytest.approx(1.2 - 0.5), 4)


def test_a_disc_is_located_on_a_line_and_on_a_corner() -> None:
    """Its contact point is where its rim is nearest, the gap what is left; its centre stays."""
    contacts = Located(np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)))
    model = SimpleNamespace(
        contact_radius=np.array([0.0, 0.1]), contact_link=[0, 3], contact_position=[None, "place"]
    )

    def point_position(_: object, link: int, place: str, at: np.ndarray) -> None:
        assert (link, place) == (3, "place")
        at[:] = 0.7, 2.4

    replace = {faces.point_position: point_position}
    locate = uncompiled(faces.locate_on_face, replace=replace)
    for face, normal, distance in ((0, (0.0, 1.0), 2.4), (2, (-1.0, 0.0), 0.3),
                                   (5, (-0.6, 0.8), 0.5)):  # fmt: skip
        locate(model, STAIR, None, 1, face, 0, contacts)
        np.testing.assert_allclose(contacts.normal[0], normal, atol=1e-15)
        assert contacts.gap[0] == pytest.approx(distance - 0.1)
        np.testing.assert_allclose(
            contacts.position[0], np.array([0.7, 2.4]) - 0.1 * contacts.normal[0]
        )
        moved = Located(contacts.gap[::-1], contacts.position[::-1], contacts.normal[::-1])
        assert uncompiled(faces.center_of)(model, moved, 1) == pytest.approx((0.7, 2.4))
    assert not contacts.gap[1]
    assert not contacts.position[1].any()


def test_a_contact_has_the_coefficients_of_its_face_and_its_point() -> None:
    """Those of a corner are the left segment's."""
    model = SimpleNamespace(friction_scale=[1.0, 2.0], restitution_scale=[1.0, 0.5])
    surface = SimpleNamespace(friction=np.zeros(4), restitution=np.zeros(4))
    for face, segment in ((0, 0), (2, 1), (5, 1), (6, 3), (7, 2)):
        uncompiled(faces.take_surface)(model, STAIR, 1, 3, face, surface)
        assert surface.friction[3] == pytest.approx(2.0 * 0.1 * (segment + 1))
        assert surface.restitution[3] == pytest.approx(0.5 * 0.1 * segment)
    assert not surface.friction[:3].any()
