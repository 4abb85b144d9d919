"""Newton's restitution with friction may make energy (Kane's paradox): it is measured and told.

An inclined rod strikes the ground with one end. With a = −w_n and t = w_t its velocities before,
and g the inverse of the Delassus matrix, an elastic impact that stops the end from sliding makes
the energy (2 a t g_nt − t² g_tt) / 2: positive for slow sliding towards the side it leans to.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mechanisms import rod

import heelstrike as hs
from heelstrike.analysis import summarize
from heelstrike.sim import EventKind, Run, Scheme
from heelstrike.view.page.verdict import judge

PITCH = 0.25 * np.pi
MASS = np.array([1.0, 1.0, 1.0 / 12.0])
SCHEMES = (Scheme.IMPACT_RESOLVED, Scheme.MOREAU_JEAN)


def strike(sliding: float, method: Any, above: float = 1.05e-3) -> Run:
    """Let the end of a rod without weight strike the ground at 1 m/s."""
    return hs.simulate(
        rod(gravity=0.0),
        state=hs.State(
            [0.5 * np.sin(PITCH), 0.5 * np.cos(PITCH) + above, PITCH], [sliding, -1.0, 0.0]
        ),
        duration=3e-3,
        method=method,
        ground=hs.Ground(friction=1.0, restitution=1.0),
        stop_when_fallen=False,
    )


def energy(run: Run) -> np.ndarray:
    return 0.5 * run.velocity**2 @ MASS


def told(run: Run) -> list[float]:
    return [event.impulse[0] for event in run.events if event.kind is EventKind.ENERGY_GAIN]


def formula(sliding: float) -> float:
    """Energy (J) that the impact makes if the end stops."""
    half = 0.5 * np.array([np.cos(PITCH), np.sin(PITCH)])  # lever of tangent and normal
    jacobian = np.array([[0.0, 1.0, half[1]], [1.0, 0.0, -half[0]]])
    stiffness = np.linalg.inv(jacobian @ np.diag(1.0 / MASS) @ jacobian.T)
    before = jacobian @ [sliding, -1.0, 0.0]
    after = np.array([-before[0], 0.0])
    return float(0.5 * (after @ stiffness @ after - before @ stiffness @ before))


METHODS = [*(hs.TimeStepping(step=2e-4, scheme=scheme) for scheme in SCHEMES), hs.EventDriven()]


@pytest.mark.parametrize("method", METHODS, ids=["impact-resolved", "moreau-jean", "event-driven"])
def test_what_an_impact_makes_is_told_to_the_joule(method: Any) -> None:
    gains = []
    for sliding in (-0.3, 0.3, 2.0):
        run = strike(sliding, method)
        made = energy(run)[-1] - energy(run)[0]
        gain = run.certificates.energy_gain
        assert run.completed
        assert (gain > 0.0) == bool(told(run)) == (made > 1e-9)
        assert gain == pytest.approx(max(made, 0.0), abs=1e-12)
        assert ("energy created by impacts" in str(summarize(run))) == (gain > 0.0)
        assert any("bounded_restitution" in line for line in judge(run).advice) == (gain > 0.0)
        if gain > 0.0:
            gains.append(gain)
            assert gain == pytest.approx(formula(sliding), rel=2e-2)  # it has turned a little
    assert len(gains) == 1


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_gain_is_told_at_the_end_of_its_step(scheme: Scheme) -> None:
    """Which is the beginning of the next, to the bit: 6 h + h is another number than 7 h."""
    run = strike(0.3, hs.TimeStepping(step=2e-4, scheme=scheme), above=1.25e-3)
    assert told(run)
    times = [event.time for event in run.events]
    assert times == sorted(times)
    assert np.isin(times, run.time).all()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_bounded_restitution_makes_none(scheme: Scheme) -> None:
    """As much of it is left as makes no energy, to a thousandth; elsewhere nothing changes."""
    plain = hs.TimeStepping(step=2e-4, scheme=scheme)
    bounded = hs.TimeStepping(step=2e-4, scheme=scheme, bounded_restitution=True)
    for sliding in (-0.3, 0.3, 2.0):
        asked, run = strike(sliding, plain), strike(sliding, bounded)
        if not told(asked):
            np.testing.assert_array_equal(run.velocity, asked.velocity)
            continue
        assert len(told(run)) == 1
        assert run.certificates.energy_gain == 0.0
        made = energy(run)[-1] - energy(run)[0]
        assert -2e-3 * energy(run)[0] <= made <= 1e-9
        assert run.solver.failures == 0
