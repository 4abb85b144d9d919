"""What docs/methods.md says of bravo7 under methods that are not made for it."""

from __future__ import annotations

import pytest
import walking

import heelstrike as hs
from heelstrike.sim import HuntCrossley, KelvinVoigt, RunStatus, Scheme


def walk(method: hs.TimeStepping | hs.Compliant, *, control_period: float | None = None) -> hs.Run:
    gait = walking.gait()
    return hs.simulate(
        walking.bravo7(),
        hs.ComputedTorque(walking.bravo7(), gait),
        state=gait.initial_state,
        duration=20 * gait.step_duration,
        method=method,
        ground=hs.Ground(friction=walking.FRICTION),
        control_period=control_period,
        record_every=10,
    )


@pytest.mark.parametrize("scheme", [Scheme.PAPER_EXPLICIT, Scheme.PAPER_SYMPLECTIC])
def test_the_papers_ordering_falls_at_a_millisecond(scheme: Scheme) -> None:
    """At a tenth of it, it walks (test_walking)."""
    run = walk(hs.TimeStepping(step=1e-3, scheme=scheme))
    assert run.status is RunStatus.FELL


@pytest.mark.parametrize("law", [HuntCrossley(), KelvinVoigt()], ids=lambda law: type(law).__name__)
def test_on_soft_ground_sampled_torques_fall_where_continuous_ones_walk(
    law: HuntCrossley | KelvinVoigt,
) -> None:
    assert walk(hs.Compliant(law=law)).completed
    assert walk(hs.Compliant(law=law), control_period=1e-3).status is RunStatus.FELL
