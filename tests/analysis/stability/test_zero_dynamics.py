"""Zero dynamics against simulation, against the inverted pendulum, and where no walk repeats."""

from __future__ import annotations

import dataclasses

import numpy as np
import published_walkers as published
import pytest

import heelstrike as hs
from heelstrike.gait.phased.surface import Surface


def test_momentum_and_moment_belong_together() -> None:
    """σ̇ = κ₂: a simulated step, torques and all, changes σ as gravity's moment alone says."""
    gait = published.five_link_gait()
    zero, surface = hs.zero_dynamics(gait), Surface(gait)
    run = hs.simulate(
        gait.robot, hs.VirtualConstraints(gait), state=zero.initial_state,
        duration=0.9 * zero.period, ground=hs.Ground(friction=3.0),
        method=hs.EventDriven(rtol=1e-11, atol=1e-12, output_period=0.9 * zero.period / 200),
    )  # fmt: skip
    theta, rate = run.position @ gait.phase, run.velocity @ gait.phase
    momentum = rate * np.array([surface.inertia(each) for each in theta])
    moment = np.array([surface.tipping(each) for each in theta])
    change = np.gradient(momentum, run.time, edge_order=2)
    np.testing.assert_allclose(change[3:-3], moment[3:-3], atol=1e-3 * np.abs(moment).max())
    # Before the end of the step σ² is what the line of the return map says.
    added = np.trapezoid(momentum * moment, run.time)
    assert 0.5 * (momentum[-1] ** 2 - momentum[0] ** 2) == pytest.approx(added, rel=1e-4)
    assert 0.5 * momentum[0] ** 2 == pytest.approx(zero.contraction * zero.fixed_point, rel=1e-9)


def test_locked_legs_are_a_compass_on_its_stance_leg() -> None:
    """With all joints at rest but for the exchange, κ₁ is one over the inertia about the foot."""
    gait = published.five_link_gait()
    still = dataclasses.replace(gait, coefficients=gait.coefficients[:1])
    surface = Surface(still)
    q = surface.position(0.1)
    turning = surface.turning(q)
    inertia = turning @ hs.dynamics.mass_matrix(gait.robot, q) @ turning
    assert surface.inertia(0.1) == pytest.approx(inertia, rel=1e-12)
    center = hs.dynamics.center_of_mass(gait.robot, q)
    weight = 30.0 * 9.8062
    assert surface.tipping(0.1) == pytest.approx(weight * center[0], rel=1e-12)


def test_walks_that_do_not_repeat() -> None:
    """ζ → δ² ζ + gain has a fixed point ≥ 0 only if gravity gives while δ² < 1, takes if not."""
    zero = hs.zero_dynamics(published.five_link_gait())
    assert zero.fixed_point == pytest.approx(zero.gain / (1.0 - zero.contraction), rel=1e-14)
    for change in ({"gain": -1.0}, {"contraction": 1.1}):
        with pytest.raises(hs.LimitCycleError, match="no walk over this phase repeats"):
            _ = dataclasses.replace(zero, **change).fixed_point
    hill = dataclasses.replace(zero, barrier=zero.contraction * zero.fixed_point + 1.0)
    with pytest.raises(hs.LimitCycleError, match="does not come over its highest point"):
        _ = hill.fixed_point


def test_too_steep_a_slope() -> None:
    steep = hs.Ground(slope=np.deg2rad(-10.0))
    with pytest.raises(hs.GaitError, match=r"it is 0\.06135 m above"):
        hs.zero_dynamics(published.five_link_gait(), steep)


def test_words() -> None:
    zero = hs.zero_dynamics(published.five_link_gait())
    assert repr(zero) == "ZeroDynamics('five_link': contraction 0.758657525, invariant)"
    assert zero.stable
