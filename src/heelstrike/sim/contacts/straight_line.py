"""Which kernels of a simulation run as straight-line code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.recording import Program
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.dynamics.kernels import solve_factorized, state_equations
from heelstrike.dynamics.workspace import workspace
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.points import point_delassus, point_velocities, push_points

# Places in ``Memory.programs``; an address of zero means that there is none.
EQUATIONS = 0
SOLVE = 1
DELASSUS = 2
VELOCITIES = 3
PUSH = 4

KERNELS: tuple[Callable[..., None], ...] = (
    state_equations,
    solve_factorized,
    point_delassus,
    point_velocities,
    push_points,
)

MOST_COORDINATES = 12
"""Robots with more are left to the loops: straight-line code grows with the cube of the depth."""

MOST_POINTS = 8
"""The same for contact points, which straight-line code takes all together."""


def usual_points(robot: Robot) -> NDArray[np.int64]:
    """Return the contact points that carry the robot usually: its feet, or all it has."""
    points = sorted(point for foot in robot.feet for point in foot.contacts) or range(robot.nc)
    return np.array(points if len(points) <= MOST_POINTS else [], dtype=np.int64)


_known: WeakKeyDictionary[Model, dict[bytes, NDArray[np.int64]]] = WeakKeyDictionary()


def straight_line_programs(model: Model, points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the addresses of the straight-line programs of a robot, one for each kernel.

    `points` are the contact points that the last three kernels are for.
    """
    known = _known.setdefault(model, {})
    key = points.tobytes()
    if key not in known:
        known[key] = _programs(model, points)
    return known[key].copy()


def _programs(model: Model, points: NDArray[np.int64]) -> NDArray[np.int64]:
    nv, nc, size = len(model.parent), len(model.contact_link), len(points)
    count = len(KERNELS) if size > 0 else DELASSUS
    programs = np.zeros(len(KERNELS), dtype=np.int64)
    if not 0 < nv <= MOST_COORDINATES:
        return programs
    matrix, vector, pairs = np.zeros((nv, nv)), np.zeros(nv), np.zeros((nc, 2))
    tree = workspace(nv)
    arguments: list[dict[str, Any]] = [
        {
            "model": model, "q": vector, "v": vector, "tree": tree,
            "matrix": matrix, "factor": matrix, "bias": vector,
        },
        {"model": model, "factor": matrix, "x": vector},
        {
            "model": model, "points": points, "tree": tree, "position": pairs, "normal": pairs,
            "factor": matrix, "rows": np.zeros((2 * size, nv)),
            "delassus": np.zeros((2 * size, 2 * size)),
        },
        {
            "model": model, "points": points, "tree": tree, "position": pairs, "normal": pairs,
            "v": vector, "velocity": pairs,
        },
        {
            "model": model, "points": points, "tree": tree, "position": pairs, "normal": pairs,
            "factor": matrix, "impulse": pairs, "force": vector, "v": vector,
        },
    ][:count]  # fmt: skip
    scratch = tuple(f"tree.{name}" for name in ("acceleration", "force", "composite", "zero"))
    programs[:count] = straight_line_code(
        [
            Program(kernel, values, scratch=(*scratch, "matrix", "rows", "force"))
            for kernel, values in zip(KERNELS, arguments, strict=False)
        ],
        known={"tree.zero": np.zeros(nv)},
    )
    return programs
