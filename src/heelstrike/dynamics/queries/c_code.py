"""The equations of motion of one robot as a page of C99."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable
from typing import Any

import numpy as np

from heelstrike.compiler.recordings.c_text import c_text
from heelstrike.compiler.recordings.recording import Program, Recording
from heelstrike.dynamics.kernels import (
    bias_force,
    forward_dynamics,
    forward_kinematics,
    link_velocities,
    mass_matrix,
)
from heelstrike.dynamics.loops import LoopRows, count_rows, find_rows
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model

_HEAD = """Equations of motion of {name}, A(q) a + H(q, v) = force, written by heelstrike.

SI units. Coordinates in the order
{joints}.
x points forward, z upward, angles turn about +y: a positive pitch leans forward.
Matrices are stored row by row. Nothing is kept from call to call, and nothing is checked.
Passive joint forces (dampers, springs) belong to `force`, as actuators and contacts do.
The robot's numbers stand in tables; those that are 0, 1 or -1 are worked into the code as well."""


def _kinematics(model: Model, q: Floats, tree: Workspace, angle: Floats, origin: Floats) -> None:
    """Poses of the links: `angle` (rad) and `origin` (x, z of the link's frame, m) in the world."""
    forward_kinematics(model, q, tree)
    for i in range(model.nl):
        angle[i] = tree.angle[i]
        for k in range(model.axes):
            origin[i, k] = tree.origin[i, k]


def _mass_matrix(model: Model, q: Floats, tree: Workspace, matrix: Floats) -> None:
    """Mass matrix A(q)."""
    forward_kinematics(model, q, tree)
    mass_matrix(model, tree, matrix)


def _bias_force(model: Model, q: Floats, v: Floats, tree: Workspace, bias: Floats) -> None:
    """Centrifugal, Coriolis and gravitational forces H(q, v)."""
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    bias_force(model, tree, bias)


def _solve(
    model: Model, q: Floats, v: Floats, force: Floats, tree: Workspace, square: Floats,
    factor: Floats, acceleration: Floats,
) -> None:  # fmt: skip
    """Acceleration a under a generalised force: a = A(q)^-1 (force - H(q, v))."""
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    forward_dynamics(model, force, tree, square, factor, acceleration)


def _loops(
    model: Model, q: Floats, v: Floats, tree: Workspace, rows: LoopRows, open_by: Floats,
    jacobian: Floats, bias: Floats,
) -> None:  # fmt: skip
    """Closed loops and coupled joints: by how much they are open, J, and b of J a + b = 0."""
    forward_kinematics(model, q, tree)
    link_velocities(model, v, tree)
    find_rows(model, q, v, tree, rows)
    for row in range(rows.bias.shape[0]):
        open_by[row] = rows.displacement[row]
        bias[row] = rows.bias[row]
        for j in range(model.nv):
            jacobian[row, j] = rows.jacobian[row, j]


def c_code(model: Model, name: str, joints: tuple[str, ...]) -> str:
    """Return a page of C; see :meth:`heelstrike.Robot.c_code`."""
    count = count_rows(model)
    tree = Workspace.allocate(model.extents)
    square, vector = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
    arrays: dict[str, Any] = {
        "model": model, "tree": tree, "rows": LoopRows.allocate(loop_rows=count, nv=model.nv),
        "open_by": np.zeros(count), "jacobian": np.zeros((count, model.nv)),
        "angle": np.zeros(model.nl), "origin": np.zeros((model.nl, model.axes)),
        **dict.fromkeys(("q", "v", "force", "bias", "acceleration"), vector),
        **dict.fromkeys(("matrix", "square", "factor"), square),
    }  # fmt: skip
    parts = {"tree": tree, "rows": arrays["rows"]}
    members = (f"{part}.{member}" for part in parts for member in parts[part].members())
    scratch = (*members, "square", "factor")
    kernels: list[Callable[..., None]] = [_kinematics, _mass_matrix, _bias_force, _solve]
    kernels += [_loops] if count else []
    recordings = []
    for kernel in kernels:
        given = {name: arrays[name] for name in inspect.signature(kernel).parameters}
        if kernel is _loops:
            given["bias"] = np.zeros(count)
        program = Program(kernel, given, scratch, kernel.__name__[1:])
        recordings.append(Recording(program, {"tree.zero": vector}))
    return c_text(
        recordings,
        [str(recording.program.kernel.__doc__) for recording in recordings],
        prefix=re.sub(r"\W|^(?=\d)", "_", name, flags=re.ASCII),
        head=_HEAD.format(name=name, joints=textwrap.fill(", ".join(joints), 96)),
    )
