"""The spring-loaded inverted pendulum against Geyer, Seyfarth and Blickhan (2006).

Published with ten digits of states and seven or eight of multipliers. Ours hold to 1e-10 and 1e-8:
phases are integrated with rtol 1e-13 and end at their events to rounding.
"""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.experiments.spring_mass import SpringMass


@pytest.mark.parametrize(
    ("degrees", "height", "multiplier"),
    [(69.0, 0.9708346674, 0.8039863 + 0.5568592j), (68.0, 0.9707858459, 0.6292295 + 0.7993641j)],
)
def test_walking(degrees: float, height: float, multiplier: complex) -> None:
    """At 816 J; one angle of attack walks stably, one degree less does not."""
    walk = SpringMass(stiffness=14_000.0, angle=np.deg2rad(degrees), energy=816.0)
    cycle = walk.walking((0.9708, 0.0))
    np.testing.assert_allclose(cycle.state, [height, 0.0], atol=6e-11)
    wanted = [np.conj(multiplier), multiplier]
    np.testing.assert_allclose(np.sort_complex(cycle.multipliers), wanted, atol=6e-8)
    assert (abs(multiplier) < 1.0) == (degrees == 69.0)
    if degrees == 69.0:
        assert cycle.length == pytest.approx(0.514236, abs=5e-7)
        assert cycle.period == pytest.approx(0.444533, abs=5e-7)
        assert cycle.contact == pytest.approx(0.166563, abs=5e-7)


def test_running() -> None:
    """Apex, contact and period as printed; the multiplier is −0.161307631, printed ….62."""
    run = SpringMass(stiffness=20_000.0, angle=np.deg2rad(68.0), energy=1784.8)
    cycle = run.running(0.94)
    assert cycle.state[0] == pytest.approx(0.9402671444, abs=6e-11)
    assert cycle.multipliers[0] == pytest.approx(-0.161307631, abs=3e-9)
    assert cycle.multipliers[0] == pytest.approx(-0.16130762, abs=2e-8)
    assert cycle.contact == pytest.approx(0.149240, abs=5e-7)
    assert cycle.period == pytest.approx(0.252533, abs=5e-7)


def test_a_step_that_is_not_completed() -> None:
    """Below the height of touchdown no leg has room."""
    run = SpringMass(stiffness=20_000.0, angle=np.deg2rad(68.0), energy=1784.8)
    with pytest.raises(hs.LimitCycleError, match="falls, or flies on"):
        run.running(0.5)
