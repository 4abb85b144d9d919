"""A person who is known, seen through markers: lengths, angles, strides, moments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.dynamics import center_of_mass, contact_positions, link_poses
from heelstrike.errors import GaitError
from heelstrike.experiments.people.body import BodyMotion, body_of_joints
from heelstrike.experiments.people.fitting import fit_markers
from heelstrike.experiments.people.mimicry import LIBRARY
from heelstrike.experiments.people.moments import moments_of
from heelstrike.experiments.people.person import person_of
from heelstrike.experiments.people.retarget import retargeted
from heelstrike.experiments.people.stride import Stride, stride_of
from heelstrike.gait.recordings.forces import RecordedForces
from heelstrike.gait.recordings.markers import RecordedMarkers, load_markers
from heelstrike.gait.recordings.motion import RecordedMotion

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration

THIGH, SHANK, ANKLE, TRUNK = 0.41, 0.43, 0.07, 0.48
HEEL, TOE = np.array([-0.05, -0.04]), np.array([0.13, -0.05])
PERIOD, SPEED, RATE = 1.1, 1.25, 100.0
SEED = 11
NOISE = 0.002
"""Standard deviation of a marker (m), in each direction."""


def angles(time: np.ndarray) -> dict[str, np.ndarray]:
    """Directions of the segments of a made-up walk, about +y (rad), of both legs."""
    found = {"trunk": 0.05 + 0.03 * np.cos(4.0 * np.pi * time / PERIOD)}
    for side, shift in (("right", 0.0), ("left", 0.5)):
        phase = 2.0 * np.pi * (time / PERIOD + shift)
        found[f"{side}_thigh"] = -0.06 - 0.38 * np.cos(phase)
        found[f"{side}_shank"] = 0.27 - 0.35 * np.cos(phase + 0.6) - 0.12 * np.cos(2.0 * phase)
        raised = np.maximum(0.0, np.sin(phase - 0.7 * np.pi)) ** 3
        found[f"{side}_foot"] = 0.9 * raised - 0.3 * np.exp(6.0 * (np.cos(phase) - 1.0)) * (
            1.0 - raised
        )
    return found


def turned(place: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Places (2,) on segments turned about +y, (n, 2): written out, and no kernel's."""
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * place[0] + s * place[1], c * place[1] - s * place[0]])


def markers(noise: float, *, seconds: float = 3.6) -> RecordedMarkers:
    """Markers on that person; the hip moves evenly."""
    time = np.arange(round(seconds * RATE) + 1) / RATE
    directions = angles(time)
    hip = np.column_stack([SPEED * time, 0.9 + 0.02 * np.cos(4.0 * np.pi * time / PERIOD)])
    places = {"trunk": hip + turned(np.array([0.0, TRUNK]), directions["trunk"])}
    for side in ("right", "left"):
        knee = hip + turned(np.array([0.0, -THIGH]), directions[f"{side}_thigh"])
        ankle = knee + turned(np.array([0.0, -SHANK]), directions[f"{side}_shank"])
        places |= {f"{side}_hip": hip, f"{side}_knee": knee, f"{side}_ankle": ankle}
        for name, place in (("heel", HEEL), ("toe", TOE)):
            places[f"{side}_{name}"] = ankle + turned(place, directions[f"{side}_foot"])
    position = np.stack(list(places.values()), axis=1)
    random = np.random.default_rng(SEED)
    return RecordedMarkers(
        time, tuple(places), position + noise * random.normal(size=position.shape)
    )


@pytest.fixture(scope="module")
def fitted() -> BodyMotion:
    seen = markers(NOISE)
    return fit_markers(person_of(seen, mass=70.0, height=1.75), seen)


def test_lengths_of_a_person() -> None:
    """Medians of noisy distances: 2 mm of noise moves them by less than 1 mm."""
    robot = person_of(markers(NOISE), mass=70.0).robot
    height = (THIGH + SHANK) / (0.245 + 0.246)
    assert robot.model.mass.sum() == pytest.approx(70.0)
    q = robot.reference_state().q
    assert q[1] == pytest.approx(THIGH + SHANK + 0.039 * height, abs=2e-3)


def test_angles_are_recovered_without_noise() -> None:
    seen = markers(0.0)
    motion = fit_markers(person_of(seen, mass=70.0, height=1.75), seen)
    assert max(motion.residual.values()) < 1e-3
    assert_near(motion, 0.2)


def test_angles_are_recovered_through_noise(fitted: BodyMotion) -> None:
    """0.5 degrees: 2 mm over a thigh of 0.4 m are 0.3 degrees a sample, which splines average."""
    assert_near(fitted, 0.5)
    assert all(each < 2.0 * NOISE for each in fitted.residual.values())


def assert_near(motion: BodyMotion, most: float) -> None:
    told = angles(motion.time)
    inner = slice(10, -10)  # at the ends a spline has neighbours on one side only
    for side in ("right", "left"):
        before = told["trunk"]
        for joint, segment in (("hip", "thigh"), ("knee", "shank"), ("ankle", "foot")):
            after = told[f"{side}_{segment}"]
            away = np.rad2deg(motion.joint(f"{side}_{joint}") - (after - before))[inner]
            # Where a foot is flat is a matter of its markers: an offset of its own.
            away -= away.mean() if joint == "ankle" else 0.0
            assert np.sqrt((away**2).mean()) < most, (side, joint)
            before = after


def test_derivatives_are_those_of_the_curves(fitted: BodyMotion) -> None:
    step = 1.0 / RATE
    between = np.diff(fitted.q, axis=0) / step
    middle = 0.5 * (fitted.v[1:] + fitted.v[:-1])
    curved = np.abs(fitted.acceleration).max()
    assert np.abs(between - middle).max() < step * curved


@pytest.mark.slow
def test_markers_that_were_not_seen_are_bridged() -> None:
    seen = markers(NOISE)
    position = seen.position.copy()
    position[40:48, 3] = np.nan
    gap = replace(seen, position=position)
    motion = fit_markers(person_of(gap, mass=70.0, height=1.75), gap)
    assert_near(motion, 0.6)


@pytest.fixture(scope="module")
def stride(fitted: BodyMotion) -> Stride:
    return stride_of(fitted)


def test_a_stride(stride: Stride) -> None:
    assert stride.duration == pytest.approx(PERIOD, abs=0.01)
    assert stride.speed == pytest.approx(SPEED, rel=0.01)
    assert stride.strides >= 2


def test_a_stride_averages_left_and_right(stride: Stride) -> None:
    """Whatever phase it begins at: some shift of the made-up leg is the mean leg."""
    time = np.arange(0.0, PERIOD, 0.01)
    mean = np.array([stride.directions(t / PERIOD)[1] for t in time])
    shifts = [angles(time + shift)["right_thigh"] for shift in np.arange(0.0, PERIOD, 0.005)]
    assert min(np.sqrt(((mean - each) ** 2).mean()) for each in shifts) < np.deg2rad(0.3)


def test_accelerations_of_the_reference_are_exact(stride: Stride) -> None:
    wanted = retargeted(stride, hs.load_robot("bravo7"))
    h = 1e-4
    for t in (0.1, 0.4, 0.9):
        before, now, after = (np.array(wanted.position(t + k * h)) for k in (-1, 0, 1))
        second = (before - 2.0 * now + after) / h**2
        np.testing.assert_allclose(wanted.acceleration(t), second, atol=1e-4 * np.abs(second).max())


def test_segments_of_a_robot_point_as_the_person_s_do(stride: Stride) -> None:
    """Places of hip, knee, ankle of bravo7 against directions, half a stride apart on the left."""
    robot = hs.load_robot("bravo7")
    wanted = retargeted(stride, robot)
    q = wanted.whole(0.3 * wanted.duration)
    origin = link_poses(robot, q).origin
    for leg, phase in zip(wanted.legs, (0.3, 0.8), strict=True):
        _, thigh, shank, _ = stride.directions(phase)
        for first, last, angle in ((leg[0], leg[1], thigh), (leg[1], leg[2], shank)):
            along = origin[last] - origin[first]
            assert np.arctan2(-along[0], -along[1]) == pytest.approx(angle, abs=1e-12)
    assert contact_positions(robot, q)[:, 1].min() == pytest.approx(0.0, abs=1e-12)


def test_robots_that_cannot(stride: Stride) -> None:
    with pytest.raises(GaitError, match="hip, knee and ankle"):
        retargeted(stride, hs.load_robot("rabbit"))


def test_moments_of_one_who_stands() -> None:
    """One leg ahead, a force under each ankle: what an ankle bears is the weight of its foot."""
    robot = hs.human(70.0, 1.75)
    time = np.arange(50) / 50.0
    posture = np.array([-0.3, 0.0, 0.3, 0.3, 0.0, -0.3])
    still = body_of_joints(robot, RecordedMotion(time, np.tile(posture, (50, 1)), ()), None)
    origin = link_poses(robot, still.q[0]).origin[[foot.link for foot in robot.feet], 0]
    center = float(center_of_mass(robot, still.q[0])[0])
    share = (center - origin[1]) / (origin[0] - origin[1])
    loads = robot.weight * np.array([share, 1.0 - share])
    force = np.tile(np.column_stack([np.zeros(2), loads]), (50, 1, 1))
    point = np.tile(np.column_stack([origin, np.zeros(2)]), (50, 1, 1))
    moments = moments_of(still, RecordedForces(time, force, point))
    assert np.abs(moments.residual).max() < 1e-7
    model = robot.model
    for ankle, foot in zip((2, 5), robot.feet, strict=True):
        lever = model.center_of_mass[foot.link, 0]
        borne = model.mass[foot.link] * lever * np.hypot(*model.gravity)
        # About +y a weight ahead of the ankle would turn the toes down: the ankle holds them up.
        np.testing.assert_allclose(moments.torque[:, ankle], -borne, rtol=1e-6)
    late = RecordedForces(time + 9.0, force, point)
    with pytest.raises(GaitError, match="the forces last"):
        moments_of(still, late)


def test_recordings_that_say_too_little() -> None:
    seen = markers(0.0)
    few = RecordedMarkers(seen.time, seen.names[:3], seen.position[:, :3])
    with pytest.raises(GaitError, match="no whole leg"):
        person_of(few)
    headless = RecordedMarkers(seen.time, seen.names[1:], seen.position[:, 1:])
    with pytest.raises(GaitError, match="no marker on the trunk"):
        person_of(headless)
    short = markers(0.0, seconds=1.0)
    with pytest.raises(GaitError, match="no whole stride"):
        stride_of(fit_markers(person_of(seen), short))


def test_winter_s_person() -> None:
    """Heel contacts in frames 28 and 97 of 69.9 a second, as Winter's book has them."""
    seen = load_markers(LIBRARY / "winter_table_a1.csv")
    assert (len(seen.time), seen.names[0]) == (106, "trunk")
    person = person_of(seen, mass=56.7)
    motion = fit_markers(person, seen)
    assert motion.sides == ("right",)
    assert max(motion.residual.values()) < 0.01
    stride = stride_of(motion)
    assert stride.duration == pytest.approx(69 / 69.9, abs=0.01)
    assert stride.speed == pytest.approx(1.43, abs=0.03)
    assert stride.flat == pytest.approx(0.1, abs=0.05)
    assert stride.raised == pytest.approx(0.35, abs=0.06)
