"""What the torques of a law do if the state that it sees, or its own numbers, are a little other.

A law is somebody's function: its derivatives are central differences, the only ones of this
package's linearised motions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.bundle_type import address_of
from heelstrike.compiler.compilation import kernel
from heelstrike.compiler.words import copy_words
from heelstrike.contact.linearized.slopes import ContactSlopes, contact_slopes
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.state import State
from heelstrike.sim.controller.control import Control
from heelstrike.sim.controller.in_python import AskedLaw
from heelstrike.sim.controller.interface import Contacts, Controller
from heelstrike.sim.controller.law import controller_in, law_of
from heelstrike.sim.simulation import Simulation

DISTURBANCE = 3e-6
"""Disturbance (m, rad, m/s, rad/s) of the law's derivative, and of its parameters as a part of
them: small, as laws have kinks."""

PRESSED = 1e-3
"""Change of a number that a law remembers, and of forces as a part of them, by which is seen
whether torques depend on them."""


def numbers_in(bundle: Bundle) -> Iterator[tuple[str, Floats, tuple[int, ...]]]:
    """Yield the real numbers of a bundle: name, array and place."""
    for name, member, values in bundle.views():
        if member.kind is float:
            for place in np.ndindex(values.shape):
                yield f"{name}{list(place) if place else ''}", values, place


@kernel
def ask_near(
    time: float, q: Floats, v: Floats, changes: Floats, gap: Floats, place: Floats,
    usual: Contacts, remembered: Integers, control: Control, torques: Floats,
) -> None:  # fmt: skip
    """Ask a law in states near one, each time with the same memory.

    Parameters
    ----------
    time : float
        Time (s).
    q, v : (nq,) and (nv,) float
        The state.
    changes : (k, nq + nv) float
        What is added to it.
    gap, place : (nc, nq + nv) float
        Derivatives of gaps, and of places along the ground.
    usual : Contacts
        The contact points in that state.
    remembered : (m,) int
        Words of the law's memory.
    control : Control
        What it is asked with.
    torques : (k, nu) float
        Receives its torques.
    """
    controller = controller_in(control.function)
    state, robot, contacts = control.state, control.robot, control.contacts
    for row in range(changes.shape[0]):
        copy_words(remembered, control.kept)
        for j in range(q.shape[0]):
            state.q[j] = q[j] + changes[row, j]
        for j in range(v.shape[0]):
            state.v[j] = v[j] + changes[row, q.shape[0] + j]
        robot.update(state)
        for i in range(usual.gap.shape[0]):
            higher = along = 0.0
            for j in range(changes.shape[1]):
                higher += gap[i, j] * changes[row, j]
                along += place[i, j] * changes[row, j]
            x, z = usual.normal[i, 0], usual.normal[i, 1]
            contacts.gap[i] = usual.gap[i] + higher
            contacts.position[i, 0] = usual.position[i, 0] + higher * x + along * z
            contacts.position[i, 1] = usual.position[i, 1] + higher * z - along * x
        controller(
            time, address_of(state), address_of(contacts), address_of(robot),
            control.parameters_at, control.kept_at, control.log_at, torques[row],
        )  # fmt: skip


@dataclass(frozen=True)
class Instant:
    """A law at an instant: what it remembers, and what it sees."""

    asked: AskedLaw
    numbers: Integers
    time: float
    state: State
    seen: Contacts
    slopes: ContactSlopes

    def torque(self, change: Floats | None = None) -> Floats:
        """What it asks for in a state changed by so little; it forgets the call."""
        changes = np.zeros((1, len(self.state.vector)))
        if change is not None:
            changes[0] = change
        torque: Floats = self.torques(changes)[0]
        return torque

    def torques(self, changes: Floats) -> Floats:
        """The same in states changed by each of some changes, (k, nu)."""
        asked, seen, slopes = self.asked, self.seen, self.slopes
        asked.restore(self.numbers)
        control = asked.control
        for name, values in seen.members().items():
            getattr(control.contacts, name)[...] = values
        torques = np.zeros((len(changes), asked.numbers.robot.nu))
        ask_near(
            self.time, self.state.q, self.state.v, changes, slopes.gap, slopes.place, seen,
            control.kept.copy(), control, torques,
        )  # fmt: skip
        return torques

    def gains(self) -> Floats:
        """Derivative of the torques by the state, (nu, nq + nv)."""
        changes = DISTURBANCE * np.eye(len(self.state.vector))
        size = len(changes)
        torques = self.torques(np.vstack((changes, -changes)))
        gains: Floats = (torques[:size] - torques[size:]).T / (2.0 * DISTURBANCE)
        return gains

    def by_parameters(self, names: Sequence[str]) -> Floats:
        """Derivative of the torques by parameters of the law, (nu, k)."""
        columns = []
        for values, place in self.parameters(names):
            change = DISTURBANCE * max(1.0, abs(float(values[place])))
            sides = []
            for side in (change, -change):
                self.asked.restore(self.numbers)
                values[place] += side
                sides.append(replace(self, numbers=self.asked.snapshot()).torque())
            columns.append((sides[0] - sides[1]) / (2.0 * change))
        return np.array(columns).T if columns else np.zeros((self.asked.numbers.robot.nu, 0))

    def parameters(self, names: Sequence[str]) -> list[tuple[Floats, tuple[int, ...]]]:
        """Where the parameters of some names are."""
        known = list(numbers_in(self.asked.numbers.parameters))
        return [
            (values, place)
            for name in names
            for label, values, place in known
            if label.partition("[")[0] == name
        ]


class AskedAlong:
    """The law of a simulation, asked at its instants and in states near by.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    controller : object with ``torque(t, state, contacts)``
        Its controller.

    Raises
    ------
    SimulationError
        If its controller is no compiled law, or commands voltages.
    """

    def __init__(self, simulation: Simulation, controller: Controller) -> None:
        law = law_of(controller)
        if law is None or not law.function.compiles or law.commands_voltage:
            compiled = law is not None and law.function.compiles
            wrong = "commands voltages" if compiled else "is sampled, in Python"
            raise SimulationError(
                f"only a compiled controller that asks for torques can be linearised; this one "
                f"{wrong}. hs.find_limit_cycle takes differences of whole steps instead"
            )
        self._simulation = simulation
        self._asked = AskedLaw(simulation.robot, law, compiled=True)
        self._asked.control.function[:] = law.function.words
        self._constant: dict[str, float] = {}
        self._first: Instant | None = None
        self._first = replace(self.now(), numbers=self._asked.snapshot())

    def now(self) -> Instant:
        """Return the law at the instant where the simulation is."""
        simulation, state = self._simulation, self._simulation.state
        own = simulation._numbers.control
        numbers = np.concatenate((own.parameters, own.kept))
        shown = simulation.contacts
        seen = Contacts(**{name: each.copy() for name, each in shown.members().items()})
        slopes = contact_slopes(simulation.robot, state.q, state.v, simulation.ground)
        return Instant(self._asked, numbers, simulation.time, state, seen, slopes)

    def check_beginning(self) -> None:
        """Refuse a law that acts on what it made of the state in which the step began."""
        if self._first is not None:
            first, self._first = self._first, None
            self.check_call(first)

    def at_call(
        self, change: Floats, rows: Sequence[int], parameters: Sequence[str]
    ) -> tuple[Floats, Floats]:
        """Return what it asks for in a call now, (nu,), and what errors do to that, (nu, k).

        Columns of `change` are errors: its first rows those of the state (q, v), others, of which
        `rows` names those of the law's parameters, of inputs.
        """
        instant = self.now()
        self.check_call(instant)
        asked, held = instant.torque(), instant.gains() @ change[: len(instant.state.vector)]
        return asked, held + instant.by_parameters(parameters) @ change[rows]

    def check_call(self, instant: Instant) -> None:
        """Refuse a law that acts on what it keeps of the state in a call."""
        self._check_forces(instant)
        instant.torque()
        usual = self._remembered()
        then = replace(instant, numbers=self._asked.snapshot())
        seen = []
        for change in DISTURBANCE * np.eye(len(instant.state.vector)):
            instant.torque(change)
            seen.append(self._remembered())
        for label, held in usual.items():
            if any(each[label] != held for each in seen) and self._acts_on(label, then):
                raise SimulationError(
                    f"the controller's memory.{label} keeps something of the state in which the "
                    "step begins and its torques depend on it, which is not linearised here. "
                    "hs.find_limit_cycle takes differences instead"
                )

    def check_memory(self) -> None:
        """Refuse a law that acts on something that changes within the step: a state of its own."""
        instant = self.now()
        self._check_forces(instant)
        self._asked.restore(instant.numbers)
        for label, held in self._remembered().items():
            if self._constant.setdefault(label, held) == held:
                continue
            if self._acts_on(label, instant):
                raise SimulationError(
                    f"the controller's memory.{label} changes within a step and its torques "
                    "depend on it: it is a state of its own, which is not linearised here. "
                    "hs.floquet_multipliers takes differences of whole steps instead"
                )

    def _check_forces(self, instant: Instant) -> None:
        """Refuse a law that acts on forces of contacts, which errors change, too."""
        seen = {**instant.seen.members(), "force": (1.0 + PRESSED) * instant.seen.force}
        pressed = replace(instant, seen=Contacts(**seen))
        if not np.array_equal(pressed.torque(), instant.torque()):
            raise SimulationError(
                "the controller's torques depend on forces of the contacts, which is not "
                "linearised here. hs.find_limit_cycle takes differences of whole steps instead"
            )

    def _remembered(self) -> dict[str, float]:
        """The numbers of the law's memory now, by name."""
        memory = self._asked.numbers.memory
        return {label: float(values[place]) for label, values, place in numbers_in(memory)}

    def _acts_on(self, wanted: str, instant: Instant) -> bool:
        """Whether torques depend on a number of the memory at an instant."""
        usual = instant.torque()
        instant.asked.restore(instant.numbers)
        for label, values, place in numbers_in(self._asked.numbers.memory):
            if label == wanted:
                values[place] += PRESSED
        pressed = replace(instant, numbers=instant.asked.snapshot())
        return not np.array_equal(pressed.torque(), usual)


def parameter_sizes(controller: Controller | None, names: Sequence[str]) -> dict[str, int]:
    """Return how many real numbers the named parameters of a law are.

    Raises
    ------
    SimulationError
        If there is no law, or it has no such parameter.
    """
    if not names:
        return {}
    law = None if controller is None else law_of(controller)
    sizes: dict[str, int] = {}
    for label, _, _ in () if law is None else numbers_in(law.parameters):
        name = label.partition("[")[0]
        sizes[name] = sizes.get(name, 0) + 1
    missing = [name for name in names if name not in sizes]
    if missing:
        raise SimulationError(
            f"the controller has no parameter {missing[0]!r}; it has {', '.join(sizes) or 'none'}"
        )
    return {name: sizes[name] for name in names}
