"""The five-link walker of OptimTraj: 0.5 m in 0.7 s at least ∫Σu² dt, no torque at the ankle.

M. Kelly, *An introduction to trajectory optimization: how to do your own direct collocation*, SIAM
Review 59 (2017), section 6: symmetric steps joined by a plastic impact, the swing foot above the
ground, the rear foot leaving as the other lands. Neither friction nor pulling was limited there:
here neither is in the way (the cone is opened wide). The costs that it converged to are in no
public source known to us; what is tested is that ours converges and is what inverse dynamics says.
"""

from __future__ import annotations

import pytest

import heelstrike as hs

# Of N²m²s. `benchmarks/five_link.py` gets it on 12, 24 and 48 intervals with changes below 1e-6.
COST = 469.502


def five_link_gait(intervals: int) -> hs.Gait:
    return hs.optimize_gait(
        hs.load_robot("rabbit_optimtraj"),
        step_length=0.5,
        step_duration=0.7,
        clearance=0.0,
        friction=5.0,
        force_margin=0.0,
        intervals=intervals,
        starts=1,
    )


def test_cost_converges_under_refinement() -> None:
    """The scheme's order is high: six intervals are within 0.1 % of twelve, and far closer."""
    coarse, fine = five_link_gait(6), five_link_gait(12)
    assert abs(fine.cost - coarse.cost) <= 1e-3 * fine.cost
    assert fine.cost == pytest.approx(COST, rel=1e-5)
    # None of the limits that OptimTraj does not know is reached.
    assert fine.margins.friction_use < 0.5
    assert fine.margins.normal_force > 0.0
    assert fine.margins.torque > 0.0
    assert fine.margins.joint_range > 0.0
    assert fine.margins.impulse_friction_use < 0.5
    assert fine.margins.lift_velocity > 0.0
    assert fine.margins.landing_velocity < 0.0
