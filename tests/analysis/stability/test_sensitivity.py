"""The gait sensitivity norm against sums of responses, on paper and simulated."""

from __future__ import annotations

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.experiments.passive import METHOD, passive_walk

SLOPE = 0.05


def test_a_sum_of_responses() -> None:
    """√(Σ ‖C Aᵏ⁻¹ B‖² + ‖D‖²) of a random system, of which 400 terms are all."""
    random = np.random.default_rng(3)
    a = random.standard_normal((4, 4))
    a *= 0.9 / np.abs(np.linalg.eigvals(a)).max()
    b, c, d = (random.standard_normal(shape) for shape in ((4, 2), (3, 4), (3, 2)))
    total, power = np.sum(d**2), b
    for _ in range(400):
        total, power = total + np.sum((c @ power) ** 2), a @ power
    assert hs.gait_sensitivity_norm(a, b, c, d) == pytest.approx(np.sqrt(total), rel=1e-9)


def test_a_walk_that_is_not_stable() -> None:
    assert hs.gait_sensitivity_norm([[1.1]], [1.0], [1.0], 0.0) == np.inf


def test_shapes() -> None:
    with pytest.raises(hs.SimulationError, match=r"got shapes \(2, 2\), \(2, 1\), \(1, 3\)"):
        hs.gait_sensitivity_norm(np.eye(2), [1.0, 0.0], [1.0, 0.0, 0.0], 0.0)


def walked(robot: hs.Robot, cycle: hs.LimitCycle, height: float, steps: int) -> np.ndarray:
    """Durations of steps of the compass, the first of which ends on ground that is higher."""
    slope = np.tan(-SLOPE)
    edge = 0.93 * cycle.step_length  # the foot that stands is at the origin, the other passes it
    x = np.array([-5.0, edge, edge + 1e-3, edge + 60.0])
    corners = np.column_stack((x, slope * x + height * np.array([0.0, 0.0, 1.0, 1.0])))
    run = hs.simulate(
        robot, state=cycle.state, duration=(steps + 0.5) * cycle.period, method=METHOD,
        ground=hs.Ground(friction=3.0, profile=corners),
    )  # fmt: skip
    times = [e.time for e in run.events if e.kind.name == "TOUCHDOWN" and e.time > 0.0]
    return np.diff([0.0, *times])[:steps]


def test_the_compass_on_one_higher_foothold() -> None:
    """Durations of simulated steps after a rise of 0.01 mm, up and down, are what is predicted.

    Errors of differences: the square of the height, and 1e-12 s over it, some 1e-6 s/m.
    """
    robot, ramp = hs.load_robot("compass_gait"), hs.Ground(friction=3.0, slope=-SLOPE)
    cycle = passive_walk(robot, ramp)
    step = hs.monodromy(robot, cycle.state, ground=ramp, method=METHOD)
    higher, count = 1e-5, 20
    change = walked(robot, cycle, higher, count) - walked(robot, cycle, -higher, count)
    # Heights are counted along the normal of the slope.
    measured = change / (2.0 * higher * np.cos(SLOPE))
    predicted, error = [step.step_height.duration], step.step_height.state
    for _ in range(count - 1):
        predicted.append(float(step.step_height.duration_state @ error))
        error = step.matrix @ error
    np.testing.assert_allclose(measured, predicted, atol=1e-4)
    assert step.gait_sensitivity_norm == pytest.approx(np.linalg.norm(measured), rel=1e-5)


@pytest.mark.parametrize("place", range(4))
def test_numbers_that_are_not_finite(place: int) -> None:
    given = [np.array([[0.5]]) for _ in range(4)]
    given[place][...] = np.nan
    with pytest.raises(hs.SimulationError, match="finite numbers"):
        hs.gait_sensitivity_norm(*given)
