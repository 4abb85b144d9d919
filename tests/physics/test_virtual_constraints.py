"""Walkers with virtual constraints against published numbers, and what is asked of them.

Numbers printed with ten digits here and not in the sources are ours: of two tolerances of the
integrator, the digits on which both agree.
"""

from __future__ import annotations

import warnings

import numpy as np
import published_walkers as published
import pytest
from numpy.typing import NDArray
from scipy.integrate import simpson

import heelstrike as hs
from heelstrike import dynamics

Floats = NDArray[np.float64]

FIVE_LINK_GROUND = hs.Ground(friction=3.0)  # the landing impulse needs 2.433


def three_link_after_impact(rate: float) -> hs.State:
    """State after the impact at π/8, on the constraints before it, by impulse and momentum."""
    robot, gait = published.three_link(), published.three_link_gait()
    angle = published.SPREAD
    q, v = np.zeros(5), np.zeros(5)
    q[3:], v[3:] = gait.joints(angle), rate * gait.joints(angle, order=1)
    q[2], v[2] = angle - q[3], rate - v[3]
    q[:2] = -dynamics.contact_positions(robot, q)[0]
    rows = dynamics.contact_jacobian(robot, q)[:, ::-1]
    v[:2] = -rows[0] @ v
    mass = dynamics.mass_matrix(robot, q)
    impulse = np.linalg.solve(rows[1] @ np.linalg.solve(mass, rows[1].T), -rows[1] @ v)
    after = hs.State(q, v + np.linalg.solve(mass, rows[1].T @ impulse))
    assert robot.mirror is not None
    after = robot.mirror.state(after)
    after.q[:2] -= dynamics.contact_positions(robot, after.q)[0]
    return after


def three_link_step(rate: float) -> tuple[float, float]:
    """Rate of the stance leg before the next impact, and the duration of the step.

    Scuffing is ignored, as in the source, by a swing leg whose contact point is drawn in; the step
    ends where the stance leg is at π/8.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hs.RobotWarning)  # left and right differ
        robot = published.three_link(0.9)
    law = hs.VirtualConstraints(
        published.three_link_gait(), finite_time=0.1, exponent=0.9, outputs=published.OUTPUTS
    )
    start, duration = three_link_after_impact(rate), 1.4
    for attempt in range(8):
        run = hs.simulate(
            robot, law, state=start, duration=duration, ground=hs.Ground(friction=3.0),
            method=hs.EventDriven(rtol=1e-10, atol=1e-11, output_period=None),
        )  # fmt: skip
        angle = run.position[:, 2] + run.position[:, 3]
        speed = run.velocity[:, 2] + run.velocity[:, 3]
        row = int(np.argmax(angle > published.SPREAD)) if attempt == 0 else -1
        missing = (published.SPREAD - angle[row]) / speed[row]
        duration = run.time[row] + missing
        if attempt and abs(missing) < 1e-13:
            break
    return float(speed[-1]), duration


def test_three_links_leave_the_constraints_at_the_impact() -> None:
    """The source's gait is not invariant: y₁ = −0.0418618 behind the impact, y₂ = 0."""
    gait = published.three_link_gait()
    after = three_link_after_impact(1.0)
    errors = after.q[3:] - gait.joints(-published.SPREAD)
    np.testing.assert_allclose(published.OUTPUTS @ errors, [-0.0418618, 0.0], atol=5e-8)


@pytest.mark.parametrize(("rate", "image"), [(1.5, 1.5212925973), (1.8, 1.6984989856)])
def test_the_return_map_of_three_links(rate: float, image: float) -> None:
    """Printed digits, of which rounding leaves 1e-10; the law is not smooth where y vanishes."""
    assert three_link_step(rate)[0] == pytest.approx(image, abs=2e-10)


def test_the_walk_of_three_links() -> None:
    """Fixed point 1.549891129 rad/s, slope 0.5770613, period 1.121632700 s, 0.682368537 m/s."""
    fixed = 1.549891129037
    rate, period = three_link_step(fixed)
    assert rate == pytest.approx(fixed, abs=1e-9)
    assert period == pytest.approx(1.1216327004, abs=1e-9)
    speed = 2.0 * np.sin(published.SPREAD) / period
    assert speed == pytest.approx(0.6823685369, abs=1e-9)
    h = 1e-3
    slope = (three_link_step(fixed + h)[0] - three_link_step(fixed - h)[0]) / (2.0 * h)
    assert slope == pytest.approx(0.5770613, abs=1e-6)


def test_scuffing_legs_have_no_zero_dynamics() -> None:
    """Their swing foot comes up through the ground at the end of the step: no touchdown there."""
    with pytest.raises(hs.GaitError, match="does not come down near the end"):
        hs.zero_dynamics(published.three_link_gait())


def test_five_links_are_where_the_source_says() -> None:
    """State after impact as printed, 1e-12 in positions; step length; friction of the landing."""
    zero = hs.zero_dynamics(published.five_link_gait(), FIVE_LINK_GROUND)
    state = zero.initial_state
    np.testing.assert_allclose(
        state.q[2:],
        [-0.808403569813, -0.024029029449, 1.364893077529, 0.470234974413, 1.276325478931],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        state.v[2:],
        [-0.621364800079, 2.563054057440, 0.419009892074, 3.710724740820, -1.983488489267],
        atol=1e-11,
    )
    assert zero.invariant
    assert zero.step_length == pytest.approx(0.353313, abs=5e-7)
    assert 2.43 < zero.landing_friction < 2.44
    assert zero.contraction == pytest.approx(0.7586575253, abs=1e-10)
    assert zero.period == pytest.approx(0.3005558323, abs=1e-10)


@pytest.mark.slow
def test_five_links_have_the_multiplier_of_their_zero_dynamics() -> None:
    """Invariance makes δ² an eigenvalue of the closed loop's return map, whatever the gains.

    Two theories of the same number: a quadrature over the phase, and differences of simulated
    steps, good to some 1e-9.
    """
    gait = published.five_link_gait()
    zero = hs.zero_dynamics(gait, FIVE_LINK_GROUND)
    for kp, kd in ((400.0, 40.0), (2500.0, 100.0)):
        cycle = hs.find_limit_cycle(
            gait.robot,
            zero.initial_state,
            hs.VirtualConstraints(gait, kp=kp, kd=kd),
            ground=FIVE_LINK_GROUND,
        )
        assert cycle.iterations == 0
        assert cycle.period == pytest.approx(zero.period, abs=1e-10)
        assert cycle.step_length == pytest.approx(zero.step_length, abs=1e-10)
        assert cycle.multipliers[0] == pytest.approx(zero.contraction, abs=1e-7)
        assert np.all(np.abs(cycle.multipliers[1:]) < 0.01)


def test_the_effort_of_five_links() -> None:
    """∫Σu² dt = 2383.32859 N²m²s and peaks of 67.7749, 107.9258, 75.5776 and 49.7722 N m."""
    gait = published.five_link_gait()
    zero = hs.zero_dynamics(gait, FIVE_LINK_GROUND)
    rows = 2000  # Simpson's rule on as many: 1e-10 of the integral
    run = hs.simulate(
        gait.robot, hs.VirtualConstraints(gait), state=zero.initial_state,
        duration=zero.period * (1.0 - 1e-12), ground=FIVE_LINK_GROUND,
        method=hs.EventDriven(rtol=1e-11, atol=1e-12, output_period=zero.period / rows),
    )  # fmt: skip
    effort = simpson(np.sum(run.torque**2, axis=1), x=run.time)
    assert effort == pytest.approx(2383.328593, rel=1e-9)
    peaks = np.abs(run.torque).max(axis=0)
    np.testing.assert_allclose(peaks, [67.774935, 107.925778, 75.577649, 49.772247], rtol=1e-5)
