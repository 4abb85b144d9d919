"""The ground as geometry: distances, normals, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heelstrike.compiler.compilation import uncompiled
from heelstrike.contact.ground import Ground, ground_contact, second_contact
from heelstrike.errors import SimulationError

contact = uncompiled(ground_contact)


def gap_and_normal(
    ground: Ground, x: float, z: float, radius: float = 0.0
) -> tuple[float, np.ndarray]:
    normal = np.zeros(2)
    gap, _, _ = contact(ground.model(), x, z, radius, normal)
    return gap, normal


def test_flat_ground_is_the_height() -> None:
    gap, normal = gap_and_normal(Ground(), 3.0, 0.25, radius=0.05)
    assert gap == pytest.approx(0.2, abs=1e-15)
    np.testing.assert_array_equal(normal, [0.0, 1.0])


def test_slope_measures_along_its_normal() -> None:
    angle = 0.3
    gap, normal = gap_and_normal(Ground(slope=angle), 1.0, np.tan(angle) + 0.1)
    assert gap == pytest.approx(0.1 * np.cos(angle), rel=1e-12)
    np.testing.assert_allclose(normal, [-np.sin(angle), np.cos(angle)], rtol=1e-12)


@given(
    x=st.floats(-0.5, 3.0),
    height=st.floats(1e-3, 0.2),
    seed=st.integers(0, 20),
)
def test_distance_to_rough_ground_is_the_least_over_all_points(
    x: float, height: float, seed: int
) -> None:
    """The nearest of many sampled ground points is never nearer, and at most a sample further."""
    ground = Ground.rough(amplitude=0.03, spacing=0.1, length=2.0, seed=seed)
    z = float(ground.height(x)) + height
    gap, normal = gap_and_normal(ground, x, z)
    samples = np.linspace(x - 0.3, x + 0.3, 60_001)
    distance = np.hypot(samples - x, ground.height(samples) - z).min()
    assert gap <= distance + 1e-12
    assert gap >= distance - 1e-5
    assert np.hypot(*normal) == pytest.approx(1.0)
    # The foot of the normal lies on the ground.
    foot = np.array([x, z]) - gap * normal
    assert float(ground.height(foot[0])) == pytest.approx(foot[1], abs=1e-9)


def test_stair_nose_pushes_away_from_the_corner() -> None:
    stairs = Ground.stairs(rise=-0.1, tread=0.3, count=2, start=0.0)
    gap, normal = gap_and_normal(stairs, 0.03, 0.04)
    assert gap == pytest.approx(0.05)
    np.testing.assert_allclose(normal, [0.6, 0.8])
    # Beside the riser, the riser is nearest and pushes forwards.
    gap, normal = gap_and_normal(stairs, 0.01, -0.05)
    assert gap == pytest.approx(0.01)
    np.testing.assert_allclose(normal, [1.0, 0.0], atol=1e-15)


def test_inside_the_ground_the_gap_is_negative_and_the_normal_leads_out() -> None:
    stairs = Ground.stairs(rise=0.1, tread=0.3, count=1, start=0.0)
    gap, normal = gap_and_normal(stairs, 0.004, 0.05)
    assert gap == pytest.approx(-0.004)
    np.testing.assert_allclose(normal, [-1.0, 0.0], atol=1e-15)
    gap, normal = gap_and_normal(stairs, 0.2, 0.09)
    assert gap == pytest.approx(-0.01)
    np.testing.assert_allclose(normal, [0.0, 1.0], atol=1e-15)


def test_coefficients_belong_to_segments() -> None:
    ground = Ground(friction=[0.2, 0.9], profile=[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    normal = np.zeros(2)
    assert contact(ground.model(), 0.5, 0.1, 0.0, normal)[1] == 0.2
    assert contact(ground.model(), 1.5, 0.1, 0.0, normal)[1] == 0.9


def test_height_of_stairs() -> None:
    stairs = Ground.stairs(rise=-0.1, tread=0.3, count=2, start=0.0)
    np.testing.assert_allclose(stairs.height([-5.0, 0.1, 0.4, 9.0]), [0.0, -0.1, -0.2, -0.2])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"friction": -0.1}, "friction coefficient"),
        ({"friction": np.nan}, "friction coefficient"),
        ({"friction": [0.1, 0.2]}, "segments"),
        ({"restitution": 1.5}, "restitution"),
        ({"slope": 2.0}, "slope"),
        ({"slope": 0.1, "profile": [[0, 0], [1, 0]]}, "not both"),
        ({"profile": [[0, 0]]}, "at least two corners"),
        ({"profile": [[0, 0], [1, np.inf]]}, r"finite everywhere; corner 1 is \[1.0, inf\]"),
        ({"profile": [[1, 0], [0, 0]]}, "left to right"),
        ({"profile": [[0, 0], [0, 1], [1, 1]]}, "vertical"),
    ],
)
def test_refusals_say_what_is_wrong(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        Ground(**arguments)  # type: ignore[arg-type]


def test_unknown_keyword_raises() -> None:
    with pytest.raises(TypeError):
        Ground(mu=0.3)  # type: ignore[call-arg]


second = uncompiled(second_contact)

FLOOR_AND_CURB = Ground(
    friction=(0.1, 0.2, 0.3), profile=[[-1.0, 0.0], [0.0, 0.0], [0.0, 0.2], [1.0, 0.2]]
)


def other_face(ground: Ground, x: float, z: float, radius: float = 0.0) -> tuple[float, float]:
    """Gap to the second face, and its friction; checks that the normal is a unit vector."""
    normal = np.zeros(2)
    gap, friction, _ = second(ground.model(), x, z, radius, normal)
    if np.isfinite(gap):
        assert np.hypot(*normal) == pytest.approx(1.0)
    return gap, friction


def test_second_face_of_a_corner_is_the_one_that_is_not_nearest() -> None:
    assert other_face(FLOOR_AND_CURB, -0.05, 0.02) == pytest.approx((0.05, 0.2))
    assert other_face(FLOOR_AND_CURB, -0.02, 0.05) == pytest.approx((0.05, 0.1))
    gap, friction = other_face(FLOOR_AND_CURB, -0.15, 0.1, 0.1)
    assert (gap, friction) == pytest.approx((0.05, 0.2))


def test_second_face_ends_at_its_far_corner() -> None:
    """A disc higher than the curb meets its edge, 3-4-5 away."""
    gap, friction = other_face(FLOOR_AND_CURB, -0.3, 0.2 + 0.04, 0.24)
    assert gap == pytest.approx(np.hypot(0.3, 0.04) - 0.24)
    assert friction == pytest.approx(0.2)


def test_convex_ground_has_no_second_face() -> None:
    roof = Ground(profile=[[-1.0, 0.0], [0.0, 0.5], [1.0, 0.0]])
    assert other_face(roof, -0.01, 0.6)[0] == np.inf
    assert other_face(FLOOR_AND_CURB, 0.1, 0.25)[0] == np.inf
    concave = [
        ground.model().concave for ground in (Ground(), Ground(slope=0.2), roof, FLOOR_AND_CURB)
    ]
    assert concave == [0, 0, 0, 1]


def test_second_face_is_not_the_line_through_one_that_the_disc_has_rolled_past() -> None:
    """A ramp that turns up a little and then falls away: over its edge the ramp's line is nothing.

    The disc pivots on the edge at (1, 1.1), so far down that the line of the first ramp is nearer
    than the disc's radius.
    """
    ramps = Ground(profile=[[-1.0, -1.0], [0.0, 0.0], [1.0, 1.1], [1.4, 0.0], [3.0, 0.0]])
    x, z = 1.0 + 0.3 * np.sin(0.6), 1.1 + 0.3 * np.cos(0.6)
    assert (x - z) / np.sqrt(2.0) > -0.3
    for ground, at in ((ramps, x), (mirrored(ramps), -x)):
        assert other_face(ground, at, z, 0.3)[0] > 0.3
        assert other_face(ground, at, z)[0] > 0.3


def mirrored(ground: Ground) -> Ground:
    """The same ground, seen from behind."""
    return Ground(profile=ground.model().vertices[::-1] * [-1.0, 1.0])
