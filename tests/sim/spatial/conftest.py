"""Robots in space that several tests simulate."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import pytest

import heelstrike as hs

sys.path.insert(0, str(Path(__file__).resolve().parent))

from spatial_robots import Maker


@pytest.fixture
def made(tmp_path: Path) -> Maker:
    """Make a robot of what is within the ``worldbody`` of a file, and what follows it."""

    def make(inner: str, after: str = "") -> hs.SpatialRobot:
        path = tmp_path / "robot.xml"
        world = f"<compiler angle='radian'/><worldbody>{inner}</worldbody>"
        path.write_text(f"<mujoco model='robot'>{world}{after}</mujoco>")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            robot = hs.load_robot(path, dimension=3)
        assert isinstance(robot, hs.SpatialRobot)
        return robot

    return make
