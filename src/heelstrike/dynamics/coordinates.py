"""Positions and velocities: how the one moves the other."""

from __future__ import annotations

from numpy.typing import ArrayLike

from heelstrike.dynamics import kernels
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.query import of_position, of_state
from heelstrike.robot.model import Floats


@of_state("(nq,) float: In m and rad.")
def integrate(at: Evaluation, time: float) -> Floats:
    """Position after a time at a constant velocity."""
    return at.filled(at.q.shape, kernels.integrate, at.model, at.q, at.v, time)


@of_position("(nv,) float: In m and rad, in a unit of time.")
def difference(at: Evaluation, end: ArrayLike) -> Floats:
    """Velocity that takes a position to another, `end`, in a unit of time."""
    to = at.vector("end", end)
    return at.filled((at.model.nv,), kernels.difference, at.model, at.q, to)
