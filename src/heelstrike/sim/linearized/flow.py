"""The variational equation of a smooth motion: what becomes of small errors between two events."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial, legendre
from numpy.typing import NDArray

from heelstrike.contact.linearized.motion import ActiveContacts, linearize_contact
from heelstrike.contact.linearized.slopes import ContactSlopes, contact_slopes
from heelstrike.contact.queries.kinematics import ContactKinematics, contact_kinematics
from heelstrike.errors import SimulationError
from heelstrike.robot.state import State
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.law import law_of
from heelstrike.sim.simulation import Simulation

Floats = NDArray[np.float64]

PANEL = 0.005
"""Longest stretch of time (s) that is taken at once: gaits are smooth by pieces only."""

FASTEST = 0.5
"""Longest stretch in parts of the time in which the fastest error of the closed loop changes."""

STAGES = 4
"""Gauss's nodes in it: collocation of order 8."""

DISTURBANCE = 3e-6
"""Disturbance (m, rad, m/s, rad/s) of the law's derivative: small, as laws have kinks."""

PRESSED = 1e-3
"""Change of a number that a law remembers, by which is seen whether torques hang on it."""


def _rate(slope: Floats) -> float:
    """Largest rate (1/s) of errors; not zero."""
    return max(float(np.abs(np.linalg.eigvals(slope)).max()), 1.0)


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
        self._first: _Instant | None = None
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
        self._first = replace(self._instant(), numbers=self._asked.snapshot())

    def flow(self, begin: float, end: float, active: ActiveContacts) -> Floats:
        """Return what the motion from one time to another does to errors, (nq + nv, nq + nv)."""
        size = self._robot.nq + self._robot.nv
        error = np.eye(size)
        start, fastest = begin, self._fastest(begin, active)
        while (left := end - start) > 0.0:
            span = left / np.ceil(left / min(PANEL, FASTEST / fastest))
            self._check_memory(start + span * NODES[0])
            slopes = [self._slope(start + span * node, active) for node in NODES]
            system = np.eye(STAGES * size)
            for i, j in np.ndindex(STAGES, STAGES):
                block = span * MATRIX[i, j] * slopes[i]
                system[i * size : (i + 1) * size, j * size : (j + 1) * size] -= block
            rates = np.linalg.solve(system, np.vstack([slope @ error for slope in slopes]))
            stages = rates.reshape(STAGES, size, size)
            error = error + span * np.tensordot(WEIGHTS, stages, axes=1)
            fastest = _rate(slopes[-1])
            start = end if span == left else start + span
        self._check_beginning()
        return error

    def _fastest(self, time: float, active: ActiveContacts) -> float:
        """How fast errors change at the beginning of a flow (1/s)."""
        return _rate(self._slope(time, active))

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
        slopes = contact_slopes(self._robot, state.q, state.v, self._ground)
        force = simulation.contacts.force
        return _Instant(self._asked, numbers, simulation.time, state, at, slopes, force)

    def _check_beginning(self) -> None:
        """Refuse a law that acts on what it made of the state in which the step began."""
        if self._first is None:
            return
        first, asked, self._first = self._first, self._first.asked, None
        changes = DISTURBANCE * np.eye(self._robot.nq + self._robot.nv)
        first.torque()
        usual = self._remembered()
        then = replace(first, numbers=asked.snapshot())
        seen = []
        for change in changes:
            first.torque(change)
            seen.append(self._remembered())
        for label, held in usual.items():
            if any(each[label] != held for each in seen) and self._acts_on(label, then):
                raise SimulationError(
                    f"the controller's memory.{label} keeps something of the state in which the "
                    "step begins and its torques hang on it, which is not linearised here. "
                    "hs.find_limit_cycle takes differences instead"
                )

    def _check_memory(self, time: float) -> None:
        """Refuse a law that acts on something that changes within the step: a state of its own."""
        if self._asked is None:
            return
        self._simulation.advance(time)
        instant = self._instant()
        self._asked.restore(instant.numbers)
        for label, held in self._remembered().items():
            if self._constant.setdefault(label, held) == held:
                continue
            if self._acts_on(label, instant):
                raise SimulationError(
                    f"the controller's memory.{label} changes within a step and its torques "
                    "hang on it: it is a state of its own, which is not linearised here. "
                    "hs.floquet_multipliers takes differences of whole steps instead"
                )

    def _remembered(self) -> dict[str, float]:
        """The numbers of the law's memory now, by name."""
        return {label: float(values[place]) for label, values, place in self._numbers()}

    def _numbers(self) -> Iterator[tuple[str, Floats, tuple[int, ...]]]:
        assert self._asked is not None
        for name, member, values in self._asked.numbers.memory.views():
            if member.kind is float:
                for place in np.ndindex(values.shape):
                    yield f"{name}{list(place) if place else ''}", values, place

    def _acts_on(self, wanted: str, instant: _Instant) -> bool:
        """Whether torques hang on a number of the memory at an instant."""
        usual = instant.torque()
        instant.asked.restore(instant.numbers)
        for label, values, place in self._numbers():
            if label == wanted:
                values[place] += PRESSED
        pressed = replace(instant, numbers=instant.asked.snapshot())
        return not np.array_equal(pressed.torque(), usual)


@dataclass(frozen=True)
class _Instant:
    """A law at an instant: what it remembers, and what it sees."""

    asked: AskedLaw
    numbers: Any
    time: float
    state: State
    at: ContactKinematics
    slopes: ContactSlopes
    force: Floats

    def torque(self, change: Floats | None = None) -> Floats:
        """What it asks for in a state changed by so little; it forgets the call."""
        nq = len(self.state.q)
        change = np.zeros(nq + len(self.state.v)) if change is None else change
        normal, gap, place = self.at.normal, self.slopes.gap @ change, self.slopes.place @ change
        along = np.column_stack((normal[:, 1], -normal[:, 0]))
        seen = Contacts(
            position=self.at.position + gap[:, None] * normal + place[:, None] * along,
            normal=normal, gap=self.at.gap + gap, force=self.force,
        )  # fmt: skip
        self.asked.restore(self.numbers)
        there = State(self.state.q + change[:nq], self.state.v + change[nq:])
        return self.asked.torque(self.time, there, seen)

    def gains(self) -> Floats:
        """Derivative of the torques by the state, (nu, nq + nv)."""
        changes = DISTURBANCE * np.eye(len(self.state.q) + len(self.state.v))
        columns = [self.torque(each) - self.torque(-each) for each in changes]
        return np.array(columns).T / (2.0 * DISTURBANCE)
