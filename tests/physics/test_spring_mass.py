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
    with pytest.raises(hs.LimitCycleError, match="falls or flies on"):
        run.running(0.5)


def test_the_course_of_a_run() -> None:
    """Three steps from apex to apex; energy is kept, and the mass is where steps take it."""
    model = SpringMass(stiffness=20_000.0, angle=np.deg2rad(68.0), energy=1784.8)
    cycle = model.running(0.94)
    time, motion = model.course(cycle, steps=3)
    assert len(time) == len(motion)
    assert np.all(np.diff(time) > 0.0)
    assert time[-1] == pytest.approx(3.0 * cycle.period, abs=1e-9)
    np.testing.assert_allclose(motion[-1, :2], [3.0 * cycle.length, cycle.state[0]], atol=1e-8)
    flies = motion[:, 1] > model.touchdown_height
    energy = 0.5 * 80.0 * np.sum(motion[:, 2:] ** 2, axis=1) + 80.0 * 9.81 * motion[:, 1]
    np.testing.assert_allclose(energy[flies], 1784.8, rtol=1e-10)


def test_the_course_of_a_walk() -> None:
    model = SpringMass(stiffness=14_000.0, angle=np.deg2rad(69.0), energy=816.0)
    cycle = model.walking((0.9708, 0.0))
    time, motion = model.course(cycle, steps=2)
    assert time[-1] == pytest.approx(2.0 * cycle.period, abs=1e-9)
    np.testing.assert_allclose(motion[-1, :2], [2.0 * cycle.length, cycle.state[0]], atol=1e-8)


def test_numbers_that_make_no_model() -> None:
    with pytest.raises(hs.SimulationError, match="stiffness of a spring-mass model"):
        SpringMass(stiffness=-1.0, angle=1.2, energy=800.0)
    with pytest.raises(hs.SimulationError, match="below π/2 rad, got 69"):
        SpringMass(stiffness=14_000.0, angle=69.0, energy=816.0)
    with pytest.raises(hs.LimitCycleError, match="816 J are not enough"):
        SpringMass(stiffness=14_000.0, angle=1.2, energy=816.0).running(2.0)
