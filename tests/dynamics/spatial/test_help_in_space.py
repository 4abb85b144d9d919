"""Queries in space tell what they return there, and refuse robots of the plane."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.dynamics import spatial

QUERIES = {name: each for name, each in vars(spatial).items() if hasattr(each, "returns")}


def answer(query: Callable[..., Any], robot: Any) -> Any:
    """What a query answers of a robot at rest in its reference configuration."""
    at_rest = robot.reference_state()
    values = {
        "robot": robot, "q": at_rest.q, "v": at_rest.v, "time": 0.1, "end": at_rest.q,
        "acceleration": at_rest.v, "force": at_rest.v, "torque": np.zeros(robot.nu), "link": 0,
        "local": np.zeros(3 if isinstance(robot, hs.SpatialRobot) else 2),
    }  # fmt: skip
    return query(*(values[name] for name in inspect.signature(query).parameters if name in values))


def told_shapes(query: Callable[..., Any], robot: Any, where: str) -> tuple[int, ...] | str:
    """The shape, or class, that the help of a query tells: the one in space if it tells two."""
    (kind, meaning) = re.findall(r"Returns\n-------\n(.*)\n    (.*)", inspect.getdoc(query) or "")[
        0
    ]
    first = kind.removesuffix(" float")
    if where == "in space" and (other := re.search(r"; (.*?)(?: float)? in space\.$", meaning)):
        first = other[1]
    if not first.startswith("("):
        return "float" if first == "tuple of" else first
    sizes = {"nq": robot.nq, "nv": robot.nv, "nu": robot.nu, "k": robot.nc}
    return tuple(sizes.get(each) or int(each) for each in re.findall(r"\w+", first))


def found_shape(value: Any) -> tuple[int, ...] | str:
    if isinstance(value, np.ndarray):
        return value.shape
    return "float" if isinstance(value, float | tuple) else type(value).__name__


def space() -> hs.SpatialRobot:
    robot = hs.load_robot("bravo7", dimension=3)
    assert isinstance(robot, hs.SpatialRobot)
    return robot


def test_help_tells_the_shape_of_the_answer() -> None:
    """In both packages, which share queries, and of both kinds of robots."""
    both = {name: getattr(dynamics, name) for name in QUERIES if hasattr(dynamics, name)}
    assert len(both) == len(QUERIES) - 1 > 20  # lowest_positions is of space alone
    wrong = []
    for queries, robot, where in (
        (both, walking.bravo7(), "of the plane"), (both, space(), "in space"),
        (QUERIES, space(), "in space"),
    ):  # fmt: skip
        for name, query in queries.items():
            told, found = told_shapes(query, robot, where), found_shape(answer(query, robot))
            if told != found:
                wrong.append(f"{name} {where}: told {told}, found {found}")
    assert wrong == []


def test_help_in_space_is_that_of_the_function_there() -> None:
    assert "Where the centres of the contact spheres and rims are." in str(
        spatial.contact_positions.__doc__
    )
    assert "(6, nv) float\n    Rows x, y, z" in str(spatial.point_jacobian.__doc__)


def test_queries_of_space_refuse_robots_of_the_plane() -> None:
    for query in QUERIES.values():
        with pytest.raises(hs.RobotError, match="robot must be a SpatialRobot, got "):
            answer(query, walking.bravo7())
    with pytest.raises(hs.RobotError, match="robot must be a SpatialRobot, got 'g1'"):
        spatial.lowest_positions("g1", np.zeros(7))  # type: ignore[arg-type]
