"""A gait as a function of time, step after step."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait import Footing
from heelstrike.gait.gait import fingerprint


def test_ends_of_the_step(gait: hs.Gait) -> None:
    np.testing.assert_allclose(gait.position(0.0), gait.start_position, atol=1e-15)
    np.testing.assert_allclose(gait.velocity(0.0), gait.start_velocity, atol=1e-15)
    just_before = np.nextafter(gait.step_duration, 0.0)
    np.testing.assert_allclose(gait.position(just_before), gait.end_position, atol=1e-12)
    np.testing.assert_allclose(gait.velocity(just_before), gait.end_velocity, atol=1e-12)


def test_every_step_mirrors_the_one_before(gait: hs.Gait, bravo7: hs.Robot) -> None:
    """Eq. 13: what the left leg did, the right leg does one step later."""
    swapped = [3, 4, 5, 0, 1, 2]
    assert [name.replace("right", "left") for name in gait.joint_names[:3]] == list(
        gait.joint_names[3:]
    )
    t = np.linspace(0.0, 0.699, 50)
    for evaluate in (gait.position, gait.velocity, gait.acceleration):
        first = evaluate(t)
        np.testing.assert_allclose(evaluate(t + 0.7), first[:, swapped], atol=1e-9)
        np.testing.assert_allclose(evaluate(t + 1.4), first, atol=1e-9)
        np.testing.assert_allclose(evaluate(t - 0.7), first[:, swapped], atol=1e-9)
    np.testing.assert_allclose(
        gait.mirrored_coefficients(bravo7), gait.coefficients[:, swapped], atol=1e-14
    )


def test_positions_are_continuous_and_velocities_jump_at_the_touchdown(gait: hs.Gait) -> None:
    T = gait.step_duration
    before, after = np.nextafter(T, 0.0), np.nextafter(T, 1.0)
    np.testing.assert_allclose(gait.position(before), gait.position(after), atol=1e-12)
    assert np.abs(gait.velocity(after) - gait.velocity(before)).max() > 0.1


def test_derivatives_agree_with_differences(gait: hs.Gait) -> None:
    t, h = np.array([0.2, 0.9, 1.5]), 1e-5
    slope = (gait.position(t + h) - gait.position(t - h)) / (2.0 * h)
    np.testing.assert_allclose(gait.velocity(t), slope, atol=1e-8)
    bend = (gait.velocity(t + h) - gait.velocity(t - h)) / (2.0 * h)
    np.testing.assert_allclose(gait.acceleration(t), bend, atol=1e-7)


def test_any_shape_of_times(gait: hs.Gait) -> None:
    assert gait.position(0.3).shape == (6,)
    assert gait.position([0.3]).shape == (1, 6)
    assert gait.velocity(np.zeros((4, 5))).shape == (4, 5, 6)
    np.testing.assert_array_equal(gait.position([[0.3, 0.9]])[0, 1], gait.position(0.9))


def test_a_gait_does_not_fit_another_robot(gait: hs.Gait, bravo7: hs.Robot) -> None:
    joints = tuple(name.replace("knee", "elbow") for name in bravo7.joint_names)
    other = dataclasses.replace(bravo7, joint_names=joints)
    with pytest.raises(GaitError, match="right_elbow"):
        gait.mirrored_coefficients(other)


def test_fingerprint_tells_robots_apart(bravo7: hs.Robot, spring_flamingo: hs.Robot) -> None:
    assert fingerprint(bravo7) == fingerprint(hs.load_robot("bravo7"))
    assert fingerprint(bravo7) != fingerprint(spring_flamingo)
    heavier = bravo7.model.replaced(mass=bravo7.model.mass * (1.0 + 1e-6))
    assert fingerprint(dataclasses.replace(bravo7, model=heavier)) != fingerprint(bravo7)
    rounded = bravo7.model.replaced(mass=bravo7.model.mass * (1.0 + 1e-14))
    assert fingerprint(dataclasses.replace(bravo7, model=rounded)) == fingerprint(bravo7)


@pytest.mark.parametrize(
    "change",
    [
        {"step_length": 0.0},
        {"friction": np.nan},
        {"cost": np.inf},
        {"phases": ()},
        {"mirror_joint": np.zeros(6, dtype=int)},
        {"mirror_sign": np.full(6, 0.5)},
        {"touchdown_impulse": np.zeros(2)},
        {"initial_state": hs.State(np.zeros(3), np.zeros(3))},
        {"initial_state": hs.State(np.zeros(9), np.zeros(8))},
    ],
)
def test_contradictory_numbers_are_refused(gait: hs.Gait, change: dict[str, Any]) -> None:
    with pytest.raises(GaitError, match="gait: "):
        dataclasses.replace(gait, **change)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"contacts": {2: Footing.FLAT}}, "stance_foot must be 0 or 1"),
        ({"contacts": {}}, "at least one foot"),
        ({"breakpoints": [0.0]}, "breakpoints need pieces"),
        ({"breakpoints": [[0.0, 0.7]]}, "breakpoints need pieces"),
        ({"pieces": np.zeros((1, 0, 6))}, "breakpoints need pieces"),
        ({"breakpoints": [0.0, -0.7]}, "must rise from 0"),
        ({"breakpoints": [0.1, 0.7]}, "must rise from 0"),
        ({"breakpoints": [0.0, 0.3, 0.7]}, "breakpoints need pieces"),
        ({"pieces": np.zeros((1, 4, 5))}, "pieces of 6 joints"),
        ({"pieces": np.zeros((4, 6))}, "breakpoints need pieces"),
        ({"pieces": np.full((1, 4, 6), np.nan)}, "pieces must hold finite numbers"),
        ({"pitch_pieces": np.zeros((1, 3))}, "pitch_pieces must have shape"),
    ],
)
def test_contradictory_phases_are_refused(gait: hs.Gait, change: dict[str, Any], said: str) -> None:
    with pytest.raises(GaitError, match=f"gait: .*{said}"):
        dataclasses.replace(gait, phases=(dataclasses.replace(gait.phases[0], **change),))


def test_a_step_of_several_phases(gait: hs.Gait) -> None:
    """Cut in two where the same joints go on: the same walk, and one with more of it to tell."""
    (whole,), cut = gait.phases, 0.3
    later = np.array([[1.0, cut, cut**2, cut**3], [0.0, 1.0, 2.0 * cut, 3.0 * cut**2]])
    later = np.vstack([later, [[0.0, 0.0, 1.0, 3.0 * cut], [0.0, 0.0, 0.0, 1.0]]])
    second = np.zeros((1, 6, 6))  # of degree 5, of which it needs three
    second[0, :4] = later @ whole.pieces[0]
    parts = (
        dataclasses.replace(whole, breakpoints=[0.0, cut]),
        dataclasses.replace(whole, breakpoints=[0.0, 0.7 - cut], pieces=second),
    )
    other = dataclasses.replace(gait, phases=parts)
    assert other.step_duration == pytest.approx(0.7, rel=1e-15)
    np.testing.assert_allclose(other.breakpoints, [0.0, cut, 0.7], atol=1e-15)
    times = np.linspace(0.01, 1.39, 47)
    for name in ("position", "velocity", "acceleration"):
        expected = getattr(gait, name)(times)
        np.testing.assert_allclose(getattr(other, name)(times), expected, atol=1e-10)
    assert not other.point_feet
    with pytest.raises(GaitError, match="no single set of coefficients"):
        _ = other.coefficients
    tiptoe = dataclasses.replace(parts[1], contacts={0: Footing.POINT})
    assert not dataclasses.replace(gait, phases=(parts[0], tiptoe)).point_feet
    assert dataclasses.replace(gait, phases=(tiptoe,)).point_feet


def test_the_pitch_is_told_where_it_is_free(gait: hs.Gait) -> None:
    with pytest.raises(GaitError, match="follows from the joints"):
        gait.pitch(0.1)


def test_repr_tells_the_step_and_its_cost(gait: hs.Gait) -> None:
    assert repr(gait).startswith("Gait('bravo7': 0.3 m in 0.7 s, cost 89.4")
