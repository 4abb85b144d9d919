"""The five-link walker of OptimTraj: 0.5 m in 0.7 s at least ∫Σu² dt, no torque at the ankle.

M. Kelly, *An introduction to trajectory optimization: how to do your own direct collocation*, SIAM
Review 59 (2017), section 6: symmetric steps joined by a plastic impact, the rear foot leaving as
the other lands, knees that do not bend back. Neither friction nor the height of the swing foot was
limited there: here neither is in the way. The costs that it converged to are in no public source
known to us; `published_five_link` poses the problem once more, as it was published.
"""

from __future__ import annotations

import numpy as np
import published_five_link
import pytest

import heelstrike as hs

HUMAN_KNEES = {"right_knee": (0.0, 2.5)}

# Of N²m²s, by `benchmarks/gaits.py meshes`: what 24, 48 and 96 intervals agree on.
COST = 469.65014
COST_OF_FREE_KNEES = 469.50198


def five_link_gait(intervals: int, joint_ranges: dict[str, tuple[float, float]] | None) -> hs.Gait:
    return hs.optimize_gait(
        hs.load_robot("rabbit_optimtraj"),
        step_length=0.5,
        step_duration=0.7,
        clearance=0.0,
        friction=5.0,
        force_margin=0.0,
        joint_ranges=joint_ranges,
        intervals=intervals,
        starts=1,
    )


def least_knee(gait: hs.Gait) -> float:
    knees = [k for k, name in enumerate(gait.joint_names) if "knee" in name]
    return float(gait.in_step(np.linspace(0.0, gait.step_duration, 10_001))[:, knees].min())


def test_cost_converges_under_refinement() -> None:
    """Where a knee stretches out, the scheme loses some of its order; the cost falls to a limit."""
    coarse, fine = five_link_gait(6, HUMAN_KNEES), five_link_gait(24, HUMAN_KNEES)
    assert abs(fine.cost - COST) <= 0.1 * abs(coarse.cost - COST)
    assert fine.cost == pytest.approx(COST, rel=1e-6)
    # A limit is reached, not only approached: the coarse mesh loses nothing at a knee's stop.
    assert coarse.cost == pytest.approx(COST, rel=2e-6)
    for gait in (coarse, fine):
        assert least_knee(gait) >= 0.0
        # None of the limits that OptimTraj does not know is reached; nor are its other bounds.
        assert gait.margins.friction_use < 0.5
        assert gait.margins.normal_force > 0.0
        assert gait.margins.clearance >= 0.0
        assert gait.margins.peak_torque < published_five_link.TORQUE
        assert gait.margins.impulse_friction_use < 0.5
        assert gait.margins.lift_velocity > 0.0
        assert gait.margins.landing_velocity < 0.0


@pytest.mark.slow
def test_a_fine_mesh_loses_no_digits() -> None:
    """Pieces of 7 ms: accelerations that were differences of positions would be too rough."""
    gait = five_link_gait(96, HUMAN_KNEES)
    assert gait.cost == pytest.approx(COST, rel=1e-7)


@pytest.mark.parametrize(
    ("joint_ranges", "cost"),
    [(HUMAN_KNEES, COST), (None, COST_OF_FREE_KNEES)],
    ids=["as published", "free knees"],
)
def test_cost_is_that_of_the_published_problem(
    joint_ranges: dict[str, tuple[float, float]] | None, cost: float
) -> None:
    """Other coordinates, other equations, another transcription: one optimum.

    Both have their errors: of 20 segments 1e-5, of 12 intervals 2e-6. What the knees cost, 3.2e-4,
    is far above: left free, they bend back by almost a degree.
    """
    gait = five_link_gait(12, joint_ranges)
    published = published_five_link.solve(20, knees=joint_ranges is not None)
    assert gait.cost == pytest.approx(published.cost, rel=2e-5)
    assert gait.cost == pytest.approx(cost, rel=5e-6)
    assert least_knee(gait) == pytest.approx(-published.bent_back, abs=1e-4)
    assert (least_knee(gait) < -0.016) == (joint_ranges is None)
