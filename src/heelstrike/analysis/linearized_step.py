"""A step linearised event by event: the derivative of the map from touchdown to touchdown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heelstrike.analysis.poincare_map import Landing, PoincareMap, derivative
from heelstrike.contact.linearized.slopes import along_the_ground, contact_slopes
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State
from heelstrike.sim.linearized.flow import Variation
from heelstrike.sim.linearized.step import SAME_INSTANT, Motion, linearized
from heelstrike.sim.whole_run import whole

BEYOND = 1.02
"""How much longer than a step is simulated."""


@dataclass(frozen=True, eq=False)
class LinearizedStep:
    """A step, whether or not it repeats, and its linearisation."""

    motion: Motion
    """Until the touchdown that ends it."""
    relabelling: Floats
    """(nq + nv, nq + nv) Exchange of the legs and the way back along the ground."""

    @property
    def matrix(self) -> Floats:
        """Error (δq, δv) at the next touchdown, relabelled, of one at this; (nq + nv, nq + nv)."""
        matrix: Floats = self.relabelling @ self.motion.matrix
        return matrix


def linearized_step(step: PoincareMap, state: State, landed: Landing) -> LinearizedStep:
    """Linearise a step from a state, which is known to land.

    Raises
    ------
    SimulationError
        If a controller or an event cannot be linearised; the message says which and why.
    """
    recorded = step.simulation(state)
    recorded.advance(BEYOND * landed.time)
    run = whole(recorded.record)
    simulation = step.simulation(state)
    motion = linearized(run, landed.time, Variation(simulation, simulation.controller))
    row = np.flatnonzero(run.time <= landed.time + SAME_INSTANT)[-1]
    end = State(run.position[row], run.velocity[row])
    return LinearizedStep(motion, _relabelling(step, end, landed.contact))


def _relabelling(step: PoincareMap, end: State, contact: int) -> Floats:
    """Derivative of the exchange of the legs and the way back, which is affine."""
    section, nq, size = step.section, len(end.q), len(end.vector)

    def image(change: Floats) -> Floats:
        moved = State(end.q + change[:nq], end.v + change[nq:])
        return step.relabelled(moved, contact).vector

    exchange, after = derivative(image, size, 1.0), step.relabelled(end, contact)
    way = np.zeros(size)
    way[:2] = along_the_ground(section.ground)
    slopes = contact_slopes(section.robot, after.q, after.v, section.ground)
    back: Floats = exchange - np.outer(way, slopes.place[section.foothold(after)] @ exchange)
    return back
