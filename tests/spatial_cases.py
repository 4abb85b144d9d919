"""Robots in space that tests run on, each with random states."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from random_spatial_trees import random_spatial_tree, unit
from robot_cases import builtin_xml

from heelstrike.robot import RobotWarning, SpatialRobot, load_robot
from heelstrike.robot.spatial.robot import quaternion_places


@dataclass(frozen=True)
class SpatialCase:
    """A robot in space given by its MJCF text, which is written when it is asked for."""

    name: str
    write: Callable[[], str]

    @property
    def xml(self) -> str:
        """The text."""
        return _written(self.name, self.write)

    def robot(self) -> SpatialRobot:
        """Read the robot."""
        return in_space(self.xml)

    def states(self, count: int, seed: int = 1) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield random positions and velocities of order one."""
        draw = np.random.default_rng(seed)
        robot = self.robot()
        for _ in range(count):
            yield random_position(robot, draw), draw.normal(size=robot.nv)


def random_position(robot: SpatialRobot, draw: np.random.Generator) -> np.ndarray:
    """Return a random position of a robot."""
    q = draw.normal(size=robot.nq)
    for first in quaternion_places(robot.model):
        q[first : first + 4] = unit(draw, 4)
    return q


@cache
def _written(name: str, write: Callable[[], str]) -> str:
    return write()


@cache
def in_space(xml: str, **how: bool) -> SpatialRobot:
    """Read a robot in space from the text of a file, without its warnings."""
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as folder:
        warnings.simplefilter("ignore", RobotWarning)
        path = Path(folder) / "robot.xml"
        path.write_text(xml, encoding="utf-8")
        return load_robot(path, dimension=3, **how)  # type: ignore[call-overload, no-any-return]


NAMED = [SpatialCase(name, partial(builtin_xml, name)) for name in ("bravo7", "kneed_walker")]
RANDOM = [SpatialCase(f"tree{seed}", partial(random_spatial_tree, seed)) for seed in range(20)]
FREE = [
    SpatialCase(f"free{seed}", partial(random_spatial_tree, seed, base="free", springs=False))
    for seed in range(100, 104)
]
