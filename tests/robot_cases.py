"""Robots that the tests of the dynamics run on, each with random states."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files

import numpy as np
from random_trees import random_tree

from heelstrike.robot import Robot, RobotWarning, builtin_robots, read_mjcf


def walker2d_xml() -> str:
    """Return Gymnasium's Walker2d-v5 file."""
    return (files("gymnasium") / "envs/mujoco/assets/walker2d_v5.xml").read_text()


def builtin_xml(name: str) -> str:
    """Return the MJCF of a built-in robot."""
    return (files("heelstrike.robot.library") / f"{name}.xml").read_text()


@dataclass(frozen=True)
class RobotCase:
    """A robot given by its MJCF text, which is written when it is asked for."""

    name: str
    write: Callable[[], str]

    @property
    def xml(self) -> str:
        """The text."""
        return _written(self.name, self.write)

    def robot(self) -> Robot:
        """Read the robot."""
        return _read(self.name, self.xml)

    def states(self, count: int, seed: int = 1) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield random positions and velocities of order one."""
        draw = np.random.default_rng(seed)
        n = self.robot().nv
        for _ in range(count):
            yield draw.normal(size=n), draw.normal(size=n)


@cache
def _written(name: str, write: Callable[[], str]) -> str:
    return write()


@cache
def _read(name: str, xml: str) -> Robot:
    with warnings.catch_warnings():
        # Random trees wear geoms that make no contact points; that is not what is tested here.
        warnings.simplefilter("ignore", RobotWarning)
        return read_mjcf(xml, name=name)


NAMED = [
    *(RobotCase(name, partial(builtin_xml, name)) for name in builtin_robots()),
    RobotCase("walker2d_v5", walker2d_xml),
]
RANDOM = [RobotCase(f"tree{seed}", partial(random_tree, seed)) for seed in range(20)]
ROBOTS = [*NAMED, *RANDOM[:4]]

# Trees of 2 to 30 joints, for checks that need few states of many robots.
MANY = [
    RobotCase(f"forest{k}", partial(random_tree, 1000 + k, bodies=2 + k * 14 // 200))
    for k in range(200)
]
