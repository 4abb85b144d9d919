"""Gaits over a phase: where they come from, what they keep of it, what is refused."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import published_walkers as published
import pytest
import walking

import heelstrike as hs
from heelstrike.gait.phased.surface import Surface


@cache
def rabbit() -> hs.Robot:
    return hs.load_robot("rabbit")


@cache
def in_time() -> hs.Gait:
    return hs.optimize_gait(
        rabbit(), step_length=0.21, step_duration=0.58, clearance=0.02, friction=0.6, starts=1
    )


@pytest.mark.parametrize(("degree", "error"), [(12, 1e-3), (24, 5e-6), (36, 2e-7)])
def test_a_gait_in_time_is_read_over_the_phase(degree: int, error: float) -> None:
    """Same joints at the same phase; the ends, on which invariance hangs, to rounding."""
    gait = hs.PhasedGait.from_gait(rabbit(), in_time(), degree=degree)
    time = np.linspace(0.0, in_time().step_duration, 400)
    joints = in_time().in_step(time)
    theta = in_time().pitch(time) + joints @ gait.phase[3:]
    np.testing.assert_allclose(gait.joints(theta), joints, atol=error)
    np.testing.assert_allclose(gait.joints(theta[[0, -1]]), joints[[0, -1]], atol=1e-13)
    speed = in_time().in_step(time[[0, -1]], order=1)
    rate = in_time().pitch(time[[0, -1]], order=1) + speed @ gait.phase[3:]
    slope = gait.joints(theta[[0, -1]], order=1)
    np.testing.assert_allclose(slope, speed / rate[:, None], rtol=1e-9, atol=1e-9)


def test_the_phase_is_the_angle_of_the_leg() -> None:
    """Femur and tibia of rabbit are 0.4 m each: pitch + hip + knee/2, of the foot that stands."""
    gait = hs.PhasedGait.from_gait(rabbit(), in_time())
    names = dict(zip(rabbit().joint_names, gait.phase, strict=True))
    side = ("right", "left")[gait.stance_foot]
    wanted = {"root_pitch": 1.0, f"{side}_hip": 1.0, f"{side}_knee": 0.5}
    for name, factor in names.items():
        assert factor == pytest.approx(wanted.get(name, 0.0), abs=1e-12)
    q = gait.robot.reference_state().q
    assert gait.phase_at(q) == pytest.approx(0.0, abs=1e-12)


def test_bezier_curves_are_those_of_de_casteljau() -> None:
    gait = published.five_link_gait()
    first, last = published.PHASE_RANGE
    for s in (0.0, 0.3, 1.0):
        points = np.array(published.BEZIER)
        while points.shape[1] > 1:
            points = (1.0 - s) * points[:, :-1] + s * points[:, 1:]
        np.testing.assert_allclose(
            gait.joints(first + s * (last - first)), points[:, 0], atol=1e-13
        )


def test_on_the_surface_the_foot_stands_and_the_joints_obey() -> None:
    """Position at a phase has that phase; the tangent is its derivative."""
    surface, h = Surface(published.five_link_gait()), 1e-6
    for theta in (-0.1, 0.0, 0.2):
        q = surface.position(theta)
        assert surface.gait.phase_at(q) == pytest.approx(theta, abs=1e-14)
        np.testing.assert_allclose(surface.feet(q)[0], 0.0, atol=1e-15)
        change = (surface.position(theta + h) - surface.position(theta - h)) / (2.0 * h)
        np.testing.assert_allclose(surface.tangent(theta), change, atol=1e-8)


def test_a_spoilt_gait_is_made_invariant() -> None:
    """Another beginning, and a slope under it: the impact leads off the gait, then onto it."""
    good = published.five_link_gait()
    first = good.phase_range[0]
    spoilt = good.with_start(first, good.joints(first) + 0.05, good.joints(first, order=1) - 0.3)
    assert hs.zero_dynamics(spoilt).position_defect == pytest.approx(0.05, abs=1e-9)
    assert not hs.zero_dynamics(spoilt).invariant
    mended = hs.make_invariant(spoilt)
    assert hs.zero_dynamics(mended).invariant
    np.testing.assert_allclose(mended.joints(first), good.joints(first), atol=1e-9)
    uphill = hs.Ground(slope=np.deg2rad(1.0))
    assert not hs.zero_dynamics(good, uphill).invariant
    assert hs.zero_dynamics(hs.make_invariant(good, uphill), uphill).invariant


def test_robots_that_are_refused() -> None:
    with pytest.raises(hs.GaitError, match="for point feet; foot 'right_foot'"):
        hs.PhasedGait.from_gait(walking.bravo7(), walking.gait())
    with pytest.raises(hs.GaitError, match="two mirrored feet; robot 'compass_gait' is not one"):
        hs.PhasedGait.from_bezier(hs.load_robot("compass_gait"), [], phase_range=(0.0, 1.0))
    model = rabbit().model
    driven = dataclasses.replace(
        rabbit(),
        model=model.replaced(
            actuator_joint=model.actuator_joint[:3],
            torque_lower=model.torque_lower[:3],
            torque_upper=model.torque_upper[:3],
        ),
    )
    with pytest.raises(hs.GaitError, match="'rabbit' has none at left_knee"):
        hs.PhasedGait.from_bezier(driven, np.zeros((3, 4)), phase_range=(0.0, 1.0))
    knees = tuple(rabbit().joint_names.index(f"{side}_knee") for side in ("left", "right"))
    coupled = dataclasses.replace(
        rabbit(),
        model=model.replaced(
            coupling_joint=np.array([knees]),
            coupling_polynomial=np.array([[0.0, 1.0, 0.0, 0.0, 0.0]]),
        ),
    )
    with pytest.raises(hs.GaitError, match="'rabbit' has coupling of left_knee"):
        hs.PhasedGait.from_bezier(coupled, np.zeros((4, 4)), phase_range=(-0.1, 0.1))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"phase": {"right_hop": 1.0}}, "phase names right_hop; the coordinates"),
        ({"phase": {"root_pitch": 1.0, "root_x": 1.0}}, "not its x or z"),
        ({"phase": {"right_hip": 1.0}}, "must contain the trunk's pitch"),
        ({"phase_range": (1.0, 0.0)}, "must rise"),
        ({"points": np.zeros((3, 4))}, "each of the 4 actuators"),
        ({"stance_foot": 2}, "0 or 1"),
        ({"points": np.full((4, 4), np.nan)}, "finite"),
    ],
)
def test_numbers_that_are_refused(options: dict[str, object], said: str) -> None:
    given = {"points": np.zeros((4, 4)), "phase_range": (-0.1, 0.1)} | options
    with pytest.raises(hs.GaitError, match=said):
        hs.PhasedGait.from_bezier(rabbit(), **given)  # type: ignore[arg-type]


def test_gaits_that_are_refused() -> None:
    with pytest.raises(hs.GaitError, match="does not rise at 0 s"):
        hs.PhasedGait.from_gait(rabbit(), in_time(), phase={"root_pitch": -1.0, "right_hip": -1.0})
    with pytest.raises(hs.GaitError, match="degree must be a whole number, 3 or more"):
        hs.PhasedGait.from_gait(rabbit(), in_time(), degree=2)
    with pytest.raises(hs.GaitError, match="level or sloping"):
        hs.make_invariant(
            published.five_link_gait(), hs.Ground.stairs(rise=0.1, tread=0.3, count=2)
        )
