"""Families of gaits: on slopes, and with the hips held back or brought forward."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.gait.phased.family import Postures
from heelstrike.gait.phased.surface import Surface

pytestmark = pytest.mark.slow  # left to `make test` by continuous integration


@cache
def gait() -> hs.PhasedGait:
    """Half a metre in half a second, the knees always bent."""
    robot = hs.load_robot("rabbit_optimtraj")
    ranges = {"right_knee": (0.2, 2.6), "right_hip": (-0.8, 1.5)}
    in_time = hs.optimize_gait(
        robot, step_length=0.5, step_duration=0.5, clearance=0.05, friction=0.5, starts=1,
        joint_ranges=ranges,
    )  # fmt: skip
    return hs.PhasedGait.from_gait(robot, in_time)


@cache
def family() -> hs.StepFamily:
    return hs.StepFamily.around(gait())


@pytest.mark.parametrize(("slope", "shift"), [(-0.1, 0.0), (0.12, 0.05), (0.0, -0.06)])
def test_a_step_on_a_slope_ends_as_it_began(slope: float, shift: float) -> None:
    """Both feet are on the slope at either end, as far apart along x, and in mirrored postures."""
    changed = Postures(gait()).changed(slope, shift)
    surface = Surface(changed, hs.Ground(slope=float(np.arctan(slope))))
    mirror = gait().robot.mirror
    assert mirror is not None
    first, last = (surface.position(theta) for theta in changed.phase_range)
    for q, side in ((first, -1.0), (last, 1.0)):
        stance, swing = surface.feet(q)
        np.testing.assert_allclose(swing - stance, [side * 0.5, side * 0.5 * slope], atol=1e-5)
    np.testing.assert_allclose(mirror.position(last)[2:], first[2:], atol=1e-5)
    # The hips are where they were, but for the shift.
    before = Surface(gait()).position(gait().phase_range[0])
    assert first[0] == pytest.approx(before[0] - shift, abs=1e-5)
    assert first[2] == pytest.approx(before[2], abs=1e-5)


@pytest.mark.slow
def test_the_gait_in_the_middle_is_the_gait() -> None:
    middle = family().at(0.0)
    np.testing.assert_allclose(middle.coefficients, gait().coefficients, atol=1e-14)
    np.testing.assert_allclose(middle.phase_range, gait().phase_range, atol=1e-14)


@pytest.mark.parametrize("slope", [-0.15, -0.08, 0.08, 0.15])
def test_slopes_are_walked_with_the_energy_of_level_ground(slope: float) -> None:
    """At the nine gaits exactly, in between by interpolation."""
    ground = hs.Ground(slope=float(np.arctan(slope)))
    zero = hs.zero_dynamics(hs.make_invariant(family().at(slope), ground), ground)
    level = hs.zero_dynamics(gait())
    exact = abs(slope) == 0.15
    assert zero.fixed_point == pytest.approx(level.fixed_point, rel=0.01 if exact else 0.15)
    assert zero.stable


def test_hips_held_back_take_energy_off() -> None:
    gains = []
    for shift in (-0.05, 0.0, 0.05):
        changed = hs.make_invariant(family().at(0.0, shift))
        gains.append(hs.zero_dynamics(changed).gain)
    assert gains[0] > 1.2 * gains[1] > 1.4 * gains[2]


def test_the_energy_is_that_of_the_walk() -> None:
    """σ²/2 just after touchdown and just before it."""
    zero = hs.zero_dynamics(gait())
    level = family().energy[0]
    assert level.sum() == pytest.approx(zero.fixed_point, rel=1e-6)
    signs = (-1.0) ** np.arange(len(level))
    assert level @ signs == pytest.approx(zero.contraction * zero.fixed_point, rel=1e-6)
    assert family().rate == pytest.approx(zero.rate, rel=1e-6)


def test_the_other_foot_has_the_mirrored_family() -> None:
    """All gaits of the other foot are the mirrored ones, with the constants once only."""
    both = family().coefficients_on_both_feet()
    for powers in (np.array([1.0, 0.0, 0.0]), np.array([1.0, -0.6, 0.36])):
        weights = np.outer(powers, [1.0, 0.5, 0.25])
        gaits = np.tensordot(weights, both, axes=([0, 1], [1, 2]))
        slope, shift = powers[1] * family().slope, 0.5 * family().shift
        expected = family().at(slope, shift).coefficients_on_both_feet()
        np.testing.assert_allclose(gaits, expected, atol=1e-13)


def test_what_it_refuses() -> None:
    with pytest.raises(hs.GaitError, match="steepest slope between 0 and 1"):
        hs.StepFamily.around(gait(), slope=0.0)
    with pytest.raises(hs.GaitError, match="bent knees"):
        hs.StepFamily.around(gait(), slope=0.15, shift=0.5)
    with pytest.raises(hs.GaitError, match=r"slopes up to 0\.15"):
        family().at(0.2)
