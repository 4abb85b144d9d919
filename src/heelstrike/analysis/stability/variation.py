"""The variational equation of a smooth motion: what becomes of small errors between two events."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.queries.linearization import ActiveContacts, linearize_contact
from heelstrike.errors import SimulationError
from heelstrike.robot.state import State
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.law import law_of
from heelstrike.sim.simulation import Simulation

Floats = NDArray[np.float64]

PANEL = 0.02
"""Longest stretch of time (s) that is taken at once."""

STAGES = 6
"""Gauss's nodes in it: collocation of order 12."""

DISTURBANCE = 1e-3
"""Disturbance (m, rad, m/s, rad/s) of the law's derivative, by differences of fourth order."""

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
        self._remembered: dict[str, float] = {}
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
        simulation, robot = self._simulation, self._robot
        simulation.advance(time)
        state = simulation.state
        if self._asked is None:
            nothing = np.zeros(robot.nu)
            return linearize_contact(
                robot, state.q, state.v, nothing, active, ground=self._ground
            ).A
        kept = simulation.snapshot().part("control")
        numbers = np.concatenate((kept["parameters"], kept["kept"]))
        force = simulation.contacts.force
        self._check_memory(numbers, time, state, force)
        torque = self._torque(numbers, time, state, force)
        found = linearize_contact(robot, state.q, state.v, torque, active, ground=self._ground)
        return found.A + found.B @ self._gains(numbers, time, state, force)

    def _torque(self, numbers: Any, time: float, state: State, force: Floats) -> Floats:
        """What the law asks for, by what it remembers now; it forgets the call."""
        assert self._asked is not None
        at = contact_kinematics(self._robot, state.q, state.v, self._ground)
        seen = Contacts(position=at.position, normal=at.normal, gap=at.gap, force=force)
        self._asked.restore(numbers)
        return self._asked.torque(time, state, seen)

    def _gains(self, numbers: Any, time: float, state: State, force: Floats) -> Floats:
        """Derivative of the torques by the state, (nu, nq + nv)."""
        nq, size = self._robot.nq, self._robot.nq + self._robot.nv

        def torque(change: Floats) -> Floats:
            moved = State(state.q + change[:nq], state.v + change[nq:])
            return self._torque(numbers, time, moved, force)

        columns = [
            8.0 * (torque(e) - torque(-e)) - (torque(2.0 * e) - torque(-2.0 * e))
            for e in DISTURBANCE * np.eye(size)
        ]
        return np.array(columns).T / (12.0 * DISTURBANCE)

    def _check_memory(self, numbers: Any, time: float, state: State, force: Floats) -> None:
        """Refuse a law that acts on something that changes within the step: a state of its own."""
        assert self._asked is not None
        usual = self._torque(numbers, time, state, force)
        self._asked.restore(numbers)
        memory = self._asked.numbers.memory
        for name, member, values in memory.views():
            if member.kind is not float:
                continue
            for place in np.ndindex(values.shape):
                held = float(values[place])
                values[place] = held + PRESSED
                at = contact_kinematics(self._robot, state.q, state.v, self._ground)
                seen = Contacts(position=at.position, normal=at.normal, gap=at.gap, force=force)
                matters = not np.array_equal(self._asked.torque(time, state, seen), usual)
                self._asked.restore(numbers)
                label = f"{name}{list(place) if place else ''}"
                if matters and self._remembered.setdefault(label, held) != held:
                    raise SimulationError(
                        f"the controller's memory.{label} changes within a step and its torques "
                        "hang on it: it is a state of its own, which is not linearised here. "
                        "hs.floquet_multipliers takes differences of whole steps instead"
                    )
