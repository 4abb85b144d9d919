"""Closed loops and coupled joints: what holds between coordinates that the tree leaves free.

A closed loop joins two links by a hinge: the point of one is where the point of the other is. A
coupled joint follows another along a polynomial. Each is an equation φ(q) = 0 with a row J of the
Jacobian; while it holds, ``J v = 0`` and ``J v̇ + J̇ v = 0``. The rows go loop by loop, along x
before z, then coupling by coupling::

    loop       φ = p₁(q) − p₂(q)                              points of the two links, world axes
    coupling   φ = q₁ − reference₁ − Σ cₖ (q₂ − reference₂)ᵏ     follower and leader

A force λ along a row acts on the coordinates as Jᵀ λ: on the first link as it is, on the second
reversed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.places import point_at, point_bias, velocity_at
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Model

Floats = NDArray[np.float64]


class LoopRows(Bundle):
    """The equations of loops and couplings in a state."""

    displacement: Floats = array("loop_rows")
    """φ, by how much each does not hold (m, rad)."""
    jacobian: Floats = array("loop_rows", "nv")
    bias: Floats = array("loop_rows")
    """J̇ v."""


def count_rows(model: Model) -> int:
    """How many equations the loops and couplings of a robot are."""
    return 2 * model.loops + model.couplings


@kernel
def find_rows(model: Model, q: Floats, v: Floats, work: Workspace, rows: LoopRows) -> None:
    """Write displacements, Jacobian and bias of a state whose kinematics and velocities are in."""
    displacement, jacobian, bias = rows.displacement, rows.jacobian, rows.bias
    for row in range(displacement.shape[0]):
        displacement[row] = 0.0
        bias[row] = 0.0
        for j in range(model.nv):
            jacobian[row, j] = 0.0
    for loop in range(model.loops):
        for end in range(2):
            add_end(model, work, loop, end, rows)
    for coupling in range(model.couplings):
        row = 2 * model.loops + coupling
        write_coupling(model, q, v, coupling, row, rows)


@kernel
def add_end(model: Model, work: Workspace, loop: int, end: int, rows: LoopRows) -> None:
    """Add what the point at one end of a loop brings to its rows."""
    displacement, jacobian, bias = rows.displacement, rows.jacobian, rows.bias
    along_x, along_z = 2 * loop, 2 * loop + 1
    sign = 1.0 - 2.0 * end
    link, position = model.loop_link[loop, end], model.loop_position[loop, end]
    at = point_at(work, link, position[0], position[1])
    displacement[along_x] += sign * at[0]
    displacement[along_z] += sign * at[1]
    bias_x, bias_z = point_bias(work, link, at)
    bias[along_x] += sign * bias_x
    bias[along_z] += sign * bias_z
    place = at[0] - work.pivot[0], at[1] - work.pivot[1]
    j = link
    while j >= 0:
        column_x, column_z = velocity_at(work.motion, j, place)
        jacobian[along_x, j] += sign * column_x
        jacobian[along_z, j] += sign * column_z
        j = model.parent[j]


@kernel
def write_coupling(
    model: Model, q: Floats, v: Floats, coupling: int, row: int, rows: LoopRows
) -> None:
    """Write the row of a coupling."""
    follower, leader = model.coupling_joint[coupling, 0], model.coupling_joint[coupling, 1]
    factors = model.coupling_polynomial[coupling]
    value, slope, curvature = factors[0], 0.0, 0.0
    if leader >= 0:
        way = q[leader] - model.reference[leader]
        value = factors[4]
        for k in range(3, -1, -1):  # Horner's rule, with both derivatives
            curvature = curvature * way + 2.0 * slope
            slope = slope * way + value
            value = value * way + factors[k]
        rows.jacobian[row, leader] = -slope
        rows.bias[row] = -curvature * v[leader] * v[leader]
    rows.jacobian[row, follower] = 1.0
    rows.displacement[row] = q[follower] - model.reference[follower] - value
