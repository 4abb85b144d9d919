"""Which kernels of a simulation run as straight-line code."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.recordings.recording import Program
from heelstrike.compiler.straight_line import straight_line_code
from heelstrike.contact.ground import Ground
from heelstrike.contact.workspace import PROGRAM_ROWS
from heelstrike.dynamics.kernels import (
    acceleration_without_contact,
    solve_factorized,
    state_equations,
)
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.points import (
    locate_points,
    point_delassus,
    point_velocities,
    push_points,
)
from heelstrike.sim.controller.interface import Contacts

# Places in ``Equations.programs``; an address of zero means that there is none.
EQUATIONS = 0
SOLVE = 1
DELASSUS = 2
VELOCITIES = 3
PUSH = 4
FREE = 5
LOCATE = 6

KERNELS: tuple[Callable[..., None], ...] = (
    state_equations,
    solve_factorized,
    point_delassus,
    point_velocities,
    push_points,
    acceleration_without_contact,
    locate_points,
)

SIDE_BY_SIDE = (point_delassus, point_velocities, locate_points)
"""Those that do the same with many numbers."""

MOST_COORDINATES = 12
"""Robots with more are left to the loops: straight-line code grows with the cube of the depth."""

MOST_POINTS = 8
"""The same for contact points, which straight-line code takes all together."""


def room_of(points: int) -> int:
    """Rows of the Delassus matrix of so many usual points: there is room for stops beside them."""
    return max(PROGRAM_ROWS, 2 * points)


def usual_points(robot: Robot) -> NDArray[np.int64]:
    """Return the contact points that carry the robot usually: its feet, or all it has."""
    points = sorted(point for foot in robot.feet for point in foot.contacts) or range(robot.nc)
    return np.array(points if len(points) <= MOST_POINTS else [], dtype=np.int64)


_known: WeakKeyDictionary[Model, dict[bytes, NDArray[np.int64]]] = WeakKeyDictionary()


def straight_line_programs(model: Model, points: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the addresses of the straight-line programs of a robot, one for each kernel.

    `points` are the contact points that programs of points are for; the last of these is for all.
    """
    known = _known.setdefault(model, {})
    key = points.tobytes()
    if key not in known:
        known[key] = _programs(model, points)
    return known[key].copy()


def has_programs(nv: int) -> bool:
    """Whether robots of so many coordinates get straight-line code."""
    return 0 < nv <= MOST_COORDINATES


def _programs(model: Model, points: NDArray[np.int64]) -> NDArray[np.int64]:
    nv, size = model.nv, len(points)
    left_out: tuple[Any, ...] = () if size > 0 else (point_delassus, point_velocities, push_points)
    if model.nc == 0 or model.nc > MOST_POINTS:
        left_out += (locate_points,)
    kernels = [each for each in KERNELS if each not in left_out]
    programs = np.zeros(len(KERNELS), dtype=np.int64)
    if not has_programs(nv):
        return programs
    extents = {**model.extents, "components": 2}
    pairs = np.zeros((model.nc, 2))
    known: dict[str, Any] = {
        "model": model, "q": np.zeros(model.nq), "v": np.zeros(nv), "x": np.zeros(nv),
        "tree": Workspace.allocate(extents),
        "matrix": np.zeros((nv, nv)), "factor": np.zeros((nv, nv)), "bias": np.zeros(nv),
        "points": points, "contacts": Contacts.allocate(extents),
        "rows": np.zeros((2 * size, nv)), "delassus": np.zeros((room_of(size), room_of(size))),
        "velocity": pairs, "impulse": pairs, "force": np.zeros(nv), "torque": np.zeros(model.nu),
        "v_dot": np.zeros(nv), "ground": Ground().model(), "friction": np.zeros(model.nc),
        "restitution": np.zeros(model.nc),
    }  # fmt: skip
    scratch = [f"tree.{name}" for name in ("acceleration", "force", "composite", "zero")]
    programs[[KERNELS.index(each) for each in kernels]] = straight_line_code(
        [
            Program(
                kernel,
                {name: known[name] for name in inspect.signature(kernel).parameters},
                scratch=(*scratch, "matrix", "rows", "force"),
                side_by_side=kernel in SIDE_BY_SIDE,
            )
            for kernel in kernels
        ],
        known={"tree.zero": np.zeros(nv)},
    )
    return programs
