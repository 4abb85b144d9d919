"""Ground in space refuses numbers that are none."""

from __future__ import annotations

import math

import pytest

from heelstrike.contact.spatial.ground import Box, SpatialGround
from heelstrike.errors import SimulationError


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("name", ["height", "friction", "restitution"])
def test_numbers_of_the_ground_are_finite(name: str, number: float) -> None:
    with pytest.raises(SimulationError, match=name):
        SpatialGround(**{name: number})


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("name", ["yaw", "pitch", "friction", "restitution"])
def test_numbers_of_a_box_are_finite(name: str, number: float) -> None:
    with pytest.raises(SimulationError, match=name):
        Box(center=(0.0, 0.0, 0.1), size=(1.0, 1.0, 0.2), **{name: number})


@pytest.mark.parametrize("normal", [(0.0, 0.0, math.nan), (math.inf, 0.0, 1.0)])
def test_a_normal_is_finite(normal: tuple[float, float, float]) -> None:
    with pytest.raises(SimulationError, match="normal"):
        SpatialGround(normal=normal)


def test_a_normal_may_be_of_any_length() -> None:
    assert SpatialGround(normal=(1e200, 0.0, 1e200)).normal == pytest.approx(
        (math.sqrt(0.5), 0.0, math.sqrt(0.5))
    )
