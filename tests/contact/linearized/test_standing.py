"""Charts of the states in which a robot stands as it does in one."""

from __future__ import annotations

import numpy as np
import pytest
import walking
from numpy.typing import NDArray

import heelstrike as hs
from heelstrike.contact.linearized.standing import Chart, Standing

Floats = NDArray[np.float64]


def stance() -> tuple[Standing, Floats]:
    """bravo7 at the beginning of a step, flat on its right foot."""
    robot, state = walking.bravo7(), walking.gait().initial_state
    touching = np.isin(np.arange(robot.nc), robot.feet[walking.gait().stance_foot].contacts)
    at_rest = np.column_stack((touching, touching))
    nothing = np.zeros(0, dtype=np.int64)
    return Standing(robot, hs.Ground(), touching, at_rest, 0, nothing), state.vector


def test_directions_are_what_the_equations_leave() -> None:
    """Six joints move and no trunk, as a sole holds three coordinates by four rows."""
    standing, x = stance()
    chart = Chart(standing, x)
    assert chart.directions.shape == (18, 12)
    np.testing.assert_allclose(chart.directions.T @ chart.directions, np.eye(12), atol=1e-12)
    np.testing.assert_allclose(standing.gradient(x) @ chart.directions, 0.0, atol=1e-9)


@pytest.mark.parametrize("scale", [None, np.r_[np.ones(9), np.full(9, 0.2)]])
def test_states_of_a_chart_stand_as_its_origin_does(scale: Floats | None) -> None:
    """However far they are: by 0.2 rad, and rates as large; also seen from beside the origin."""
    standing, x = stance()
    chart = Chart(standing, x, scale)
    coordinates = 0.2 * np.random.default_rng(1).standard_normal(12)
    moved = chart.moved(coordinates)
    assert chart.off(x + chart.directions @ coordinates) > 1e-3
    assert chart.off(moved) < 1e-12
    farther = x + np.r_[0.25, np.zeros(17)]  # along the ground, which is no matter but for place
    beside = chart.moved(coordinates, farther)
    np.testing.assert_allclose(beside - farther, moved - x, atol=1e-10)


def test_coordinates_are_those_of_the_state() -> None:
    standing, x = stance()
    chart = Chart(standing, x)
    coordinates = 0.05 * np.random.default_rng(2).standard_normal(12)
    np.testing.assert_allclose(chart.coordinates(chart.moved(coordinates)), coordinates, atol=1e-9)


def test_directions_do_not_hang_on_rounding() -> None:
    """A sole's four rows hold three coordinates: what is left over is known to rounding only."""
    standing, x = stance()
    noise = np.random.default_rng(4)

    class Noisy(Standing):
        def gradient(self, x: Floats) -> Floats:
            exact = super().gradient(x)
            return exact + 1e-12 * noise.standard_normal(exact.shape)

    noisy = Noisy(**vars(standing))
    found = [Chart(each, x).directions for each in (standing, noisy, noisy)]
    np.testing.assert_allclose(found[1], found[0], atol=1e-10)
    np.testing.assert_allclose(found[2], found[0], atol=1e-10)
