"""What a plan may ask of the swing foot."""

from __future__ import annotations

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control.balance.footsteps import Plan, consider


@pytest.mark.parametrize(("speed", "remaining"), [(0.0, 0.1), (0.4, 0.1), (-0.3, 0.08)])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_foot_reaches_what_least_effort_brings_it_to(
    speed: float, remaining: float, side: float
) -> None:
    """To rest in T with least effort it begins at 6 d/T² − 4 v/T, of which a is the most.

    That is d = aT²/6 + 2vT/3 ahead at most, and as much less behind.
    """
    law = hs.FootstepFeedback(walking.bravo7(), walking.gait())
    planning, reference = law.parameters.planning, law.parameters.reference
    planning = planning.replaced(
        foothold_weight=1.0, capture_weight=0.0, shortest=-9.0, longest=9.0
    )
    swing, most = 0.05, planning.acceleration
    plan = Plan.allocate(cost=1e30, swing=swing, speed=speed, length=5.0 * side)
    consider(planning, reference, 0.0, 0.0, remaining, plan)
    ahead = swing + 2.0 / 3.0 * speed * remaining
    assert plan.foothold == pytest.approx(ahead + side * most * remaining**2 / 6.0, rel=1e-12)
    # Begun with the largest acceleration, which falls evenly, the foot comes to rest there.
    time = np.linspace(0.0, remaining, 2001)
    fall = -2.0 * (speed + side * most * remaining) / remaining**2
    rate = speed + side * most * time + 0.5 * fall * time**2
    assert rate[-1] == pytest.approx(0.0, abs=1e-12)
    assert swing + np.trapezoid(rate, time) == pytest.approx(plan.foothold, abs=1e-6)
