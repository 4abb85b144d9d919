"""Ground in space: numbers that it refuses, and faces of boxes that nothing can touch."""

from __future__ import annotations

import math

import numpy as np
import pytest

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.ground import Ground
from heelstrike.contact.spatial.ground import (
    Box,
    SpatialGround,
    distance_to_box,
    distance_to_face,
    is_beside,
)
from heelstrike.errors import SimulationError


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("name", ["height", "friction", "restitution"])
def test_numbers_of_the_ground_are_finite(name: str, number: float) -> None:
    with pytest.raises(SimulationError, match=name):
        SpatialGround(**{name: number})


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("name", ["yaw", "pitch", "friction", "restitution"])
def test_numbers_of_a_box_are_finite(name: str, number: float) -> None:
    with pytest.raises(SimulationError, match=name):
        Box(center=(0.0, 0.0, 0.1), size=(1.0, 1.0, 0.2), **{name: number})


@pytest.mark.parametrize("name", ["center", "size"])
@pytest.mark.parametrize("values", [(0.1, 0.2), (0.1, math.nan, 0.2), (math.inf, 0.1, 0.2)])
def test_places_and_sizes_of_a_box_are_three_finite_numbers(
    name: str, values: tuple[float, ...]
) -> None:
    usual = {"center": (0.0, 0.0, 0.1), "size": (1.0, 1.0, 0.2)}
    with pytest.raises(SimulationError, match=f"{name} of a box must be three numbers"):
        Box(**usual | {name: values})


def test_a_box_has_some_size() -> None:
    with pytest.raises(SimulationError, match="size of a box"):
        Box(center=(0.0, 0.0, 0.1), size=(1.0, 0.0, 0.2))


def test_the_plane_is_as_far_as_its_normal_tells() -> None:
    """n · p − h, of a slope that climbs along x and y."""
    draw = np.random.default_rng(3)
    for _ in range(5):
        x, y, height = draw.normal(size=3)
        point = draw.normal(size=3)
        ground = SpatialGround(normal=(x, y, 1.0), height=height)
        n = np.array([x, y, 1.0]) / math.sqrt(x * x + y * y + 1.0)
        there = np.array([0.0, 0.0, height])  # a point of the plane
        gap, normal = distance_to_face(ground.model(), 0, tuple(point.tolist()))
        assert gap == pytest.approx(n @ (point - there), abs=1e-14)
        assert normal == pytest.approx(n)


@pytest.mark.parametrize("normal", [(0.0, 0.0, math.nan), (math.inf, 0.0, 1.0)])
def test_a_normal_is_finite(normal: tuple[float, float, float]) -> None:
    with pytest.raises(SimulationError, match="normal"):
        SpatialGround(normal=normal)


def test_a_normal_may_be_of_any_length() -> None:
    assert SpatialGround(normal=(1e200, 0.0, 1e200)).normal == pytest.approx(
        (math.sqrt(0.5), 0.0, math.sqrt(0.5))
    )


def test_only_covered_faces_are_left_out() -> None:
    """Of stairs the bottoms; treads that the next step covers in part stay, as do all sides."""
    exposed = SpatialGround.stairs(rise=0.1, tread=0.3, count=3).model().exposed
    assert np.array_equal(exposed, [[1, 1, 1, 1, 1, 0]] * 3)
    floating = Box(center=(0.0, 0.0, 0.2), size=(0.2, 0.2, 0.2))
    assert np.all(SpatialGround(boxes=(floating,)).model().exposed == 1.0)


def test_depth_counts_to_faces_that_can_be_left_by() -> None:
    """A point on the plane, 1 mm within a wall, is 1 mm deep and pushed out of its side."""
    ground = SpatialGround(boxes=(Box(center=(0.7, 0.0, 0.1), size=(0.4, 2.0, 0.2)),))
    depth, normal = distance_to_box(ground.model(), 0, (0.501, 0.0, 0.0))
    assert depth == pytest.approx(-1e-3, abs=1e-15)
    assert normal == pytest.approx((-1.0, 0.0, 0.0))


@pytest.mark.parametrize("height", [0.0, 0.2], ids=["on the plane", "on a box"])
def test_what_is_in_the_floor_of_a_wall_is_pushed_out_of_its_side(height: float) -> None:
    """The bottom of a box that stands on something is no way out; that of one in the air is."""
    boxes = (
        Box(center=(0.0, 0.0, 0.1), size=(2.0, 2.0, 0.2)),
        Box(center=(0.7, 0.0, height + 0.1), size=(0.4, 0.5, 0.2)),
    )
    ground = SpatialGround(boxes=boxes[1:] if height == 0.0 else boxes).model()
    box = ground.half.shape[0] - 1
    depth, normal = distance_to_box(ground, box, (0.5 + 3e-5, 0.0, height - 5e-5))
    assert depth == pytest.approx(-3e-5, abs=1e-12)
    assert normal == pytest.approx((-1.0, 0.0, 0.0))
    assert is_beside(ground, box, (0.5 + 3e-5, 0.0, height - 5e-5))
    before, away = distance_to_box(ground, box, (0.5 - 3e-5, 0.0, height - 5e-5))
    assert before == pytest.approx(3e-5, abs=1e-12)
    assert away == pytest.approx((-1.0, 0.0, 0.0))
    floating = SpatialGround(boxes=(Box(center=(0.7, 0.0, 0.4), size=(0.4, 0.5, 0.2)),)).model()
    below, down = distance_to_box(floating, 0, (0.6, 0.0, 0.3 - 5e-5))
    assert below == pytest.approx(5e-5, abs=1e-12)
    assert down == pytest.approx((0.0, 0.0, -1.0))


def test_a_ground_is_made_of_its_numbers_again_to_the_last_bit() -> None:
    """Files and snapshots hold it: normals that are unit already are not made unit again."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        x, y = rng.normal(size=2)
        box = Box(center=rng.normal(size=3), size=rng.uniform(0.1, 1.0, 3), yaw=x, friction=0.4)
        ground = SpatialGround(normal=(x, y, 1.0), height=y, boxes=(box, Box((0, 0, 1), (1, 1, 1))))
        again = SpatialGround.of_numbers(ground.numbers())
        assert again.boxes == ground.boxes
        for name, values in ground.model().members().items():
            assert np.array_equal(values, getattr(again.model(), name)), name


TURNED = Box(center=(0.3, -0.2, 0.5), size=(0.4, 0.6, 0.2), yaw=0.7, pitch=-0.3)
HALF = np.array([0.2, 0.3, 0.1])


def axes_of_turned() -> np.ndarray:
    """Axes of the box above, one a row: about z by its yaw, then about its own y by its pitch."""
    c, s = math.cos(0.7), math.sin(0.7)
    about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    c, s = math.cos(-0.3), math.sin(-0.3)
    about_y = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return (about_z @ about_y).T


def test_distances_to_a_box_that_is_turned() -> None:
    """Outside to its nearest point, inside to its nearest face; away from it in either case."""
    ground = SpatialGround(height=-5.0, boxes=(TURNED,)).model()
    axes, center = axes_of_turned(), np.array(TURNED.center)
    assert ground.rotation[0] == pytest.approx(axes.ravel())
    rng = np.random.default_rng(21)
    inside = 0
    for own in rng.uniform(-1.0, 1.0, (200, 3)) * 1.6 * HALF:
        point = center + own @ axes
        distance, away = uncompiled(distance_to_box)(ground, 0, tuple(point.tolist()))
        if np.all(np.abs(own) <= HALF):
            inside += 1
            face = int(np.argmax(np.abs(own) - HALF))
            wanted = np.sign(own[face]) * axes[face]
            assert distance == pytest.approx(np.max(np.abs(own) - HALF), abs=1e-14)
        else:
            off = (own - np.clip(own, -HALF, HALF)) @ axes
            assert distance == pytest.approx(np.linalg.norm(off), abs=1e-14)
            wanted = off / np.linalg.norm(off)
        assert away == pytest.approx(wanted, abs=1e-12)
        assert uncompiled(distance_to_face)(ground, 1, tuple(point.tolist())) == (distance, away)
    assert 20 < inside < 180


@pytest.mark.parametrize(
    ("point", "beside"),
    [
        ((0.6, 0.0, 0.5), True),  # before the side, below the rim
        ((0.6, 0.0, 1.0 - 1e-7), False),  # at the rim
        ((0.6, 0.0, 1.2), False),  # above it
        ((0.0, 0.0, 1.1), True),  # above the top, which is one face
        ((0.6, 0.6, 0.5), False),  # before an edge
        ((0.2, 0.1, 0.5), True),  # inside: it has to get out
        ((0.5, 0.1, 0.5), True),  # on the side
        ((0.6, 0.0, -0.5e-3), True),  # in the floor, a little
        ((0.6, 0.0, -2e-3), False),  # below the floor on which the box stands
    ],
)
def test_what_is_beside_a_face_of_a_box(point: tuple[float, float, float], beside: bool) -> None:
    ground = SpatialGround(boxes=(Box(center=(0.0, 0.0, 0.5), size=(1.0, 1.0, 1.0)),)).model()
    assert bool(uncompiled(is_beside)(ground, 0, point)) is beside


def test_a_box_that_nothing_can_touch_is_as_any_other() -> None:
    """It lies wholly in another one: points that begin in it are pushed out somewhere."""
    inner = Box(center=(0.0, 0.0, 0.5), size=(0.2, 0.2, 0.2))
    outer = Box(center=(0.0, 0.0, 0.5), size=(1.0, 1.0, 1.0))
    exposed = SpatialGround(boxes=(inner, outer)).model().exposed
    assert np.array_equal(exposed, [[1] * 6, [1, 1, 1, 1, 1, 0]])


def test_boxes_have_friction_and_restitution_of_their_own_or_the_ground_s() -> None:
    own = Box(center=(0, 0, 1), size=(1, 1, 1), friction=0.0, restitution=1.0)
    usual = Box(center=(3, 0, 1), size=(1, 1, 1))
    model = SpatialGround(friction=0.4, restitution=0.2, boxes=(own, usual)).model()
    assert model.friction.tolist() == [0.4, 0.0, 0.4]
    assert model.restitution.tolist() == [0.2, 1.0, 0.2]
    for wrong in ({"friction": -0.1}, {"restitution": -0.1}, {"restitution": 1.1}):
        (name,) = wrong
        with pytest.raises(SimulationError, match=f"{name} of the ground cannot be"):
            SpatialGround(**wrong)
        with pytest.raises(SimulationError, match=f"{name} of the ground cannot be"):
            SpatialGround(boxes=(Box(center=(0, 0, 1), size=(1, 1, 1), **wrong),))


def test_the_height_of_the_ground_is_where_it_meets_the_z_axis() -> None:
    ground = SpatialGround(normal=(1.0, 2.0, 2.0), height=0.6).model()
    assert ground.normal == pytest.approx([1 / 3, 2 / 3, 2 / 3])
    assert ground.height == pytest.approx(0.4)
    for normal in ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0)):
        with pytest.raises(SimulationError, match="the last positive"):
            SpatialGround(normal=normal)


def test_stairs_are_made_of_boxes() -> None:
    """Each as long as all that is left of the flight, one on the other."""
    ground = SpatialGround.stairs(
        rise=0.2, tread=0.3, count=2, width=1.5, start=1.0, friction=0.4, restitution=0.1
    )
    first, second = ground.boxes
    assert first.size == pytest.approx((0.6, 1.5, 0.2))
    assert first.center == pytest.approx((1.3, 0.0, 0.1))
    assert second.size == pytest.approx((0.3, 1.5, 0.2))
    assert second.center == pytest.approx((1.45, 0.0, 0.3))
    assert (ground.friction, ground.restitution) == (0.4, 0.1)
    good = {"rise": 0.2, "tread": 0.3, "count": 2, "width": 1.0}
    for name, value in (("rise", 0.0), ("tread", -0.1), ("count", 0), ("width", 0.0)):
        with pytest.raises(SimulationError, match=f"{name}={value}"):
            SpatialGround.stairs(**(good | {name: value}))


@pytest.mark.parametrize("slope", [-0.3, 0.2])
def test_a_slope_of_the_plane_climbs_as_it_does_there(slope: float) -> None:
    ground = SpatialGround.of_plane(Ground(slope=slope, friction=0.3, restitution=0.2))
    x = 2.0
    gap, _ = uncompiled(distance_to_face)(ground.model(), 0, (x, 5.0, x * math.tan(slope)))
    assert gap == pytest.approx(0.0, abs=1e-15)
    assert (ground.friction, ground.restitution) == (0.3, 0.2)
    with pytest.raises(SimulationError, match="profile"):
        SpatialGround.of_plane(Ground.stairs(rise=0.1, tread=0.3, count=2))
