"""Distances to a polyline that one can work out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scenes.terrain import Terrain

STEP = Terrain(
    np.array([[-1, 0], [0, 0], [0, 0.5], [2, 0.5]]), np.array([0.1, 0.2, 0.3]), np.zeros(3)
)
RIDGE = Terrain(np.array([[-1.0, -1], [0, 0], [1, -1]]), np.array([0.5, 0.5]), np.array([0, 0.4]))
VALLEY = Terrain(np.array([[-1.0, 1], [0, 0], [1, 1]]), np.array([0.5, 0.8]), np.zeros(2))


@pytest.mark.parametrize(
    ("terrain", "point", "distance"),
    [
        (STEP, (-0.5, 0.3), 0.3),
        (STEP, (-0.2, 0.3), 0.2),  # the wall is nearer than the floor
        (STEP, (-0.3, 0.9), 0.5),  # the edge of the step: a 3-4-5 triangle
        (STEP, (1.0, 0.7), 0.2),
        (STEP, (0.1, 0.3), -0.1),  # inside, behind the wall
        (STEP, (-9.0, 0.3), 0.3),  # the ends go on forever
        (STEP, (9.0, 0.3), -0.2),
        (RIDGE, (0.0, 0.7), 0.7),
        (RIDGE, (0.0, -0.5), -0.5 / np.sqrt(2)),
        (VALLEY, (0.0, 0.5), 0.5 / np.sqrt(2)),
    ],
)
def test_distance(terrain: Terrain, point: tuple[float, float], distance: float) -> None:
    assert terrain.measure(np.array(point)).distance == pytest.approx(distance, abs=1e-14)


def test_coefficients_of_ties() -> None:
    """In the middle of the valley both sides are as near, and either friction may hold."""
    middle = VALLEY.measure(np.array([0.0, 0.5]))
    assert (middle.lowest_friction, middle.highest_friction) == (0.5, 0.8)
    aside = VALLEY.measure(np.array([-0.1, 0.5]))
    assert (aside.lowest_friction, aside.highest_friction) == (0.5, 0.5)
    assert not middle.at_corner
    assert RIDGE.measure(np.array([0.0, 0.5])).at_corner


@pytest.mark.parametrize(
    ("terrain", "point", "normal", "right"),
    [
        (STEP, (-0.5, 0.3), (0.0, 1.0), True),
        (STEP, (-0.5, 0.3), (0.1, np.sqrt(0.99)), False),
        (STEP, (-0.5, 0.3), (0.0, 1.1), False),
        (STEP, (-0.2, 0.3), (-1.0, 0.0), True),
        (STEP, (-0.3, 0.9), (-0.6, 0.8), True),
        (STEP, (-0.3, 0.9), (0.0, 1.0), False),
        (RIDGE, (0.0, 0.0), (0.0, 1.0), True),  # on the ridge: anything between its sides
        (RIDGE, (0.0, 0.0), (1.0, 0.0), False),
        (VALLEY, (0.0, 0.5), (-np.sqrt(0.5), np.sqrt(0.5)), True),
        (VALLEY, (0.0, 0.5), (0.0, 1.0), False),
    ],
)
def test_normals(
    terrain: Terrain, point: tuple[float, float], normal: tuple[float, float], right: bool
) -> None:
    wrong = terrain.measure(np.array(point)).disagreement(np.array(normal))
    assert (wrong < 1e-9) == right


def test_how_near_a_second_face_is() -> None:
    """The floor beside the wall: 0.1 m from it, 0.02 m a step later; in both, 3 cm deep."""
    at = np.array([[[-0.1, 0.05]], [[-0.02, 0.05]], [[-0.3, 0.05]]])
    assert STEP.to_corner(at)[:, 0] == pytest.approx([0.1, 0.05, 0.3])
    assert STEP.to_corner(at[:1], at[1:2]) == pytest.approx(0.02)
    assert STEP.to_corner(at[1:2], at[2:]) == pytest.approx(0.05)
    assert STEP.to_corner(np.array([[[0.01, -0.03]]])) == pytest.approx(-0.01)
    assert RIDGE.to_corner(np.array([[[0.2, 0.1]]])) == np.inf
