"""Tests of what two faces can do to a disc between them."""

from __future__ import annotations

import numpy as np
import pytest
from scenes.wedge import excess_over_cones

FACES = np.array([[0.0, 1.0], [-1.0, 0.0]])
FRICTION = np.array([1.5, 1.5])
RADIUS = 0.1


def wrench(*forces: float) -> tuple[np.ndarray, float]:
    """Resultant and moment about the centre of (normal, tangent) forces of both faces."""
    force, moment = np.zeros(2), 0.0
    for face, (normal, tangent) in zip(FACES, np.reshape(forces, (2, 2)), strict=True):
        one = normal * face + tangent * np.array([face[1], -face[0]])
        arm = -RADIUS * face
        force += one
        moment += float(arm[0] * one[1] - arm[1] * one[0])
    return force, moment


@pytest.mark.parametrize("forces", [(3.0, 1.0, 2.0, -2.9), (1.0, 1.4, 1.0, 1.4), (5.0, 0.0, 0, 0)])
def test_forces_in_both_cones_are_found(forces: tuple[float, ...]) -> None:
    """Whether or not the line of the resultant meets the disc."""
    force, moment = wrench(*forces)
    assert excess_over_cones(force, moment, RADIUS, FACES, FRICTION) < 1e-12


def test_line_of_the_resultant_may_miss_the_disc() -> None:
    force, moment = wrench(1.0, 1.4, 1.4, -0.9)
    assert abs(moment) > RADIUS * np.linalg.norm(force)
    assert excess_over_cones(force, moment, RADIUS, FACES, FRICTION) < 1e-12


@pytest.mark.parametrize("forces", [(1.0, 0.4, 1.0, 0.4), (1.0, 0.1, -0.5, 0.0)])
def test_forces_beyond_the_cones_are_not(forces: tuple[float, ...]) -> None:
    """Too much friction, or a pull, where friction is too small to jam."""
    force, moment = wrench(*forces)
    slippery = np.array([0.3, 0.3])
    assert excess_over_cones(force, moment, RADIUS, FACES, slippery) > 0.01


def test_no_moment_without_friction() -> None:
    force, moment = wrench(2.0, 0.1, 1.0, 0.1)
    smooth = np.zeros(2)
    assert excess_over_cones(force, moment, RADIUS, FACES, smooth) > 0.01
