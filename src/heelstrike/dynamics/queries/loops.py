"""Closed loops and coupled joints in one state: by how much they are open, and which way they pull.

Rows go loop by loop (x, then z, in world axes), then coupling by coupling; see
:mod:`heelstrike.dynamics.loops`.
"""

from __future__ import annotations

from heelstrike.dynamics.loops import LoopRows, count_rows, find_rows
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.query import of_position, of_state
from heelstrike.robot.model import Floats


def rows_of(at: Evaluation) -> LoopRows:
    """Return the equations of the loops and couplings in a state."""
    dtype = object if at.symbolic else None
    extents = {"loop_rows": count_rows(at.model), "nv": at.model.nv}
    rows = LoopRows.allocate(extents, dtype=dtype)
    at.run(find_rows, at.model, at.q, at.v, at.work, rows)
    return rows


@of_position("(2 loops + couplings,) float: In m and rad.")
def loop_displacement(at: Evaluation) -> Floats:
    """How far the ends of closed loops are apart, and coupled joints from where they belong."""
    return rows_of(at).displacement


@of_position("(2 loops + couplings, nv) float: Per unit of every velocity.")
def loop_jacobian(at: Evaluation) -> Floats:
    """Jacobian J of :func:`loop_displacement`; a force λ of the loops acts as Jᵀ λ."""
    return rows_of(at).jacobian


@of_state("(2 loops + couplings,) float: In m/s² and rad/s².")
def loop_bias_acceleration(at: Evaluation) -> Floats:
    """J̇ v of :func:`loop_jacobian`: while the loops hold, J v̇ + J̇ v is zero."""
    return rows_of(at).bias
