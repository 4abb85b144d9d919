"""The variational equation of a smooth motion: what becomes of small errors between two events."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from heelstrike.contact.queries.kinematics import ContactKinematics, contact_kinematics
from heelstrike.contact.queries.linearization import ActiveContacts, linearize_contact
from heelstrike.errors import SimulationError
from heelstrike.robot.state import State
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.law import law_of
from heelstrike.sim.simulation import Simulation

Floats = NDArray[np.float64]

PANEL = 0.005
"""Longest stretch of time (s) that is taken at once: gaits are smooth by pieces only."""

STAGES = 4
"""Gauss's nodes in it: collocation of order 8."""

DISTURBANCE = 3e-6
"""Disturbance (m, rad, m/s, rad/s) of the law's derivative: small, as laws have kinks."""

PRESSED = 1e-3
"""Change of a number that a law remembers, by which is seen whether torques hang on it."""


def _collocation() -> tuple[Floats, Floats, Floats]:
    """Nodes in [0, 1], matrix and weights of Gauss's collocation."""
    nodes, weights = legendre.leggauss(STAGES)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    matrix = np.zeros((STAGES, STAGES))
    for j in range(STAGES):
        others = np.delete(nodes, j)
        one = Polynomial.fromroots(others) / np.prod(nodes[j] - others)
        matrix[:, j] = one.integ()(nodes)
    return nodes, matrix, weights


NODES, MATRIX, WEIGHTS = _collocation()


class Variation:
    """A motion gone through once more, with its variational equation.

    Parameters
    ----------
    simulation : Simulation
        At its beginning; it is advanced from one node to the next.
    controller : object with ``torque(t, state, contacts)``, or None
        That of the simulation.

    Raises
    ------
    SimulationError
        If the controller does not act continuously.
    """

    def __init__(self, simulation: Simulation, controller: Controller | None) -> None:
        self._simulation = simulation
        self._robot, self._ground = simulation.robot, simulation.ground
        self._asked: AskedLaw | None = None
        self._constant: dict[str, float] = {}
        if controller is None:
            return
        law = law_of(controller)
        if law is None or not law.function.compiles or law.period is not None:
            raise SimulationError(
                "only a compiled controller that acts continuously can be linearised along a step; "
                "this one is sampled. hs.find_limit_cycle takes differences instead"
            )
        if law.commands_voltage:
            raise SimulationError(
                "a controller that commands voltages cannot be linearised along a step; "
                "hs.find_limit_cycle takes differences instead"
            )
        self._asked = AskedLaw(self._robot, law, compiled=True)

    def flow(self, begin: float, end: float, active: ActiveContacts) -> Floats:
        """Return what the motion from one time to another does to errors, (nq + nv, nq + nv)."""
        size = self._robot.nq + self._robot.nv
        error = np.eye(size)
        panels = max(1, int(np.ceil((end - begin) / PANEL)))
        span = (end - begin) / panels
        for panel in range(panels):
            start = begin + panel * span
            self._check_memory(start + span * NODES[0])
            slopes = [self._slope(start + span * node, active) for node in NODES]
            system = np.eye(STAGES * size)
            for i, j in np.ndindex(STAGES, STAGES):
                block = span * MATRIX[i, j] * slopes[i]
                system[i * size : (i + 1) * size, j * size : (j + 1) * size] -= block
            rates = np.linalg.solve(system, np.vstack([slope @ error for slope in slopes]))
            stages = rates.reshape(STAGES, size, size)
            error = error + span * np.tensordot(WEIGHTS, stages, axes=1)
        return error

    def _slope(self, time: float, active: ActiveContacts) -> Floats:
        """Derivative of the closed loop's rate by the state."""
        self._simulation.advance(time)
        state, nothing = self._simulation.state, np.zeros(self._robot.nu)
        instant = None if self._asked is None else self._instant()
        torque = nothing if instant is None else instant.torque()
        found = linearize_contact(
            self._robot, state.q, state.v, torque, active, ground=self._ground
        )
        return found.A if instant is None else found.A + found.B @ instant.gains()

    def _instant(self) -> _Instant:
        simulation, state = self._simulation, self._simulation.state
        assert self._asked is not None
        kept = simulation.snapshot().part("control")
        numbers = np.concatenate((kept["parameters"], kept["kept"]))
        at = contact_kinematics(self._robot, state.q, state.v, self._ground)
        force = simulation.contacts.force
        return _Instant(self._asked, numbers, simulation.time, state, at, force)

    def _check_memory(self, time: float) -> None:
        """Refuse a law that acts on something that changes within the step: a state of its own."""
        if self._asked is None:
            return
        self._simulation.advance(time)
        instant, asked = self._instant(), self._asked
        usual = instant.torque()
        asked.restore(instant.numbers)
        for name, member, values in asked.numbers.memory.views():
            if member.kind is not float:
                continue
            for place in np.ndindex(values.shape):
                label = f"{name}{list(place) if place else ''}"
                held = float(values[place])
                if self._constant.setdefault(label, held) == held:
                    continue
                values[place] = held + PRESSED
                pressed = replace(instant, numbers=asked.snapshot())
                if not np.array_equal(pressed.torque(), usual):
                    raise SimulationError(
                        f"the controller's memory.{label} changes within a step and its torques "
                        "hang on it: it is a state of its own, which is not linearised here. "
                        "hs.floquet_multipliers takes differences of whole steps instead"
                    )
                asked.restore(instant.numbers)


@dataclass(frozen=True)
class _Instant:
    """A law at an instant: what it remembers, and what it sees."""

    asked: AskedLaw
    numbers: Any
    time: float
    state: State
    at: ContactKinematics
    force: Floats

    def torque(self, change: Floats | None = None) -> Floats:
        """What it asks for in a state changed by so little; it forgets the call."""
        nq = len(self.state.q)
        change = np.zeros(nq + len(self.state.v)) if change is None else change
        moved = self.at.jacobian @ change[:nq]
        tangent = np.column_stack((self.at.normal[:, 1], -self.at.normal[:, 0]))
        seen = Contacts(
            position=self.at.position + moved[:, :1] * self.at.normal + moved[:, 1:] * tangent,
            normal=self.at.normal, gap=self.at.gap + moved[:, 0], force=self.force,
        )  # fmt: skip
        self.asked.restore(self.numbers)
        there = State(self.state.q + change[:nq], self.state.v + change[nq:])
        return self.asked.torque(self.time, there, seen)

    def gains(self) -> Floats:
        """Derivative of the torques by the state, (nu, nq + nv)."""
        changes = DISTURBANCE * np.eye(len(self.state.q) + len(self.state.v))
        columns = [self.torque(each) - self.torque(-each) for each in changes]
        return np.array(columns).T / (2.0 * DISTURBANCE)
