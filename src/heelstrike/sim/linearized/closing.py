"""What putting positions back on the equations of loops and brakes does to small errors.

A time step moves positions to q′, where loops are a little open, φ(q′) ≠ 0, and then along the way
p that is shortest by the masses (:func:`heelstrike.sim.contacts.loops.close_loops`)::

    A(q′) p = Lᵀ(q′) λ,        φ(q′ + p) = 0,

which is differentiated as it stands, with L⁺ that of the closed pose::

    A dp − Lᵀ dλ = −∂(A p − Lᵀ λ),        L⁺ (dq′ + dp) = 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.contact.linearized.partials import find_partials
from heelstrike.dynamics.queries.linearization import solved
from heelstrike.robot.model import Floats, Model
from heelstrike.sim.contacts.loops import TAKES_HOLD
from heelstrike.sim.linearized.time_step import StepSlopes
from heelstrike.sim.memory import Memory
from heelstrike.sim.time_stepping.method import MOREAU_JEAN, PAPER_EXPLICIT, Stepping


def close_positions(model: Model, work: Stepping, memory: Memory, slopes: StepSlopes) -> None:
    """Put the derivatives of positions after a step back on loops and brakes, if there are any.

    After :func:`~heelstrike.sim.linearized.time_step.differentiate_step`, whose balance is looked
    at elsewhere then.
    """
    holding = model.brake_joint[memory.loops.braked >= TAKES_HOLD]
    count, nq, nv = len(slopes.balance.pull), model.nq, model.nv
    if count + len(holding) == 0:
        return
    balance, partials = slopes.balance, slopes.partials

    def look(q: Floats, going: Any, acceleration: Any = 0.0, pull: Any = 0.0) -> Floats:
        """Find derivatives at rest; return the Jacobian of loops and brakes."""
        balance.q[:], balance.going[:], balance.acceleration[:] = q, going, acceleration
        balance.v[:] = balance.ahead[:] = balance.push[:] = 0.0
        balance.pull[:] = pull
        find_partials(
            model, slopes.program, slopes.dated, slopes.tree, slopes.loops, balance, partials
        )
        return np.vstack((slopes.loops.jacobian, np.eye(nv)[holding]))

    opened = slopes.q + work.step * _moves_with(work, memory, slopes.v)
    way = memory.q - opened
    closed = look(memory.q, 0.0)
    rows = look(opened, way)
    system = np.zeros((nv + len(rows), nv + len(rows)))
    system[:nv, :nv], system[:nv, nv:], system[nv:, :nv] = balance.matrix, -rows.T, rows
    right = np.concatenate((np.zeros(nv), rows @ way))
    pull = solved(system, right[:, None], nv)[nv:, 0]
    by_q, by_numbers = partials.lacking_by_q.copy(), partials.lacking_by_numbers.copy()
    look(opened, way, way, pull[:count])
    by_q -= partials.lacking_by_q
    by_numbers -= partials.lacking_by_numbers
    state = slopes.state[:nq]
    first = nq + nv + model.nu
    right = np.zeros((len(system), state.shape[1]))
    right[:nv] = by_q @ state
    right[:nv, first : first + by_numbers.shape[1]] += by_numbers
    right[nv:] = -closed @ state
    system[nv:, :nv] = closed
    state += solved(system, right, nv)[:nv]


def _moves_with(work: Stepping, memory: Memory, before: Floats) -> Floats:
    """Velocity with which the positions of a step have moved."""
    if work.impact.happens == 1:
        return work.impact.arriving
    if work.scheme == MOREAU_JEAN:
        return np.asarray(0.5 * (before + memory.next_v))
    return before if work.scheme == PAPER_EXPLICIT else memory.next_v
