"""A law asked from Python: compiled, as it was written, or with every index looked at."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle
from heelstrike.robot.state import State
from heelstrike.sim.controller.checking import CheckedCall
from heelstrike.sim.controller.control import ReadyLaw
from heelstrike.sim.controller.interface import ARGUMENTS, Contacts, Partaking
from heelstrike.sim.dimension import AnyRobot

if TYPE_CHECKING:
    from heelstrike.sim.controller.law import Law


class AskedLaw:
    """A law and its memory, as a controller in Python.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot it controls.
    law : Law
        The law.
    compiled : bool
        Whether it is the compiled function that is asked.
    checked : bool
        Whether every index is looked at. A law of this package, whose tests see to that, is asked
        compiled.

    Attributes
    ----------
    control : Control
        What compiled code hands along to ask it.
    """

    def __init__(
        self, robot: AnyRobot, law: Law, *, compiled: bool = False, checked: bool = False
    ) -> None:
        ready = ReadyLaw(robot, law)
        self.control = control = ready.control
        self.partner = law.function.partner
        self.name = law.function.name
        self.numbers = ready
        self._torque: NDArray[np.float64] = np.zeros(robot.nu)
        self._given: dict[str, Any] = {
            "state": control.state,
            "contacts": control.contacts,
            "robot": control.robot,
            "parameters": ready.parameters,
            "memory": ready.memory,
            "log": ready.log,
            "torque": self._torque,
        }
        self._names: Iterable[str] = law.function.arguments
        self._call: Any = law.function.python
        if compiled or (checked and law.function.is_ours and law.function.compiles):
            self._names, self._call = ARGUMENTS, law.function.finish()
            self._given = {
                name: value.address if isinstance(value, Bundle) else value
                for name, value in self._given.items()
            }
        elif checked:
            self._call = CheckedCall(
                law.function.name, law.function.python, self._names, self._given, control.kept,
                repeats=self.partner is None,
            )  # fmt: skip
            self._names, self._given = ("t",), {}

    def torque(self, t: float, state: State, contacts: Contacts | None) -> NDArray[np.float64]:
        """Return the joint torques (nu,), in N m.

        Raises
        ------
        ControllerError
            If it is checked and reads or writes beyond an array, or writes to one not its own.
        """
        own = self.control.state
        own.q[:], own.v[:] = state.q, state.v
        self.control.robot.update(own)
        if contacts is not None:
            for name, values in contacts.members().items():
                getattr(self.control.contacts, name)[...] = values
        given = self._given | {"t": np.float64(t)}
        with np.errstate(all="ignore"):
            self._call(*(given[name] for name in self._names))
        return self._torque.copy()

    @property
    def takes_part(self) -> bool:
        """Whether it can be kept: an object that it asks in Python has to take part, too."""
        return self.partner is None or isinstance(self.partner, Partaking)

    def snapshot(self) -> NDArray[np.int64]:
        """Return its parameters and its memory, and those of an object that it asks."""
        own = self.control.parameters, self.control.kept
        if self.partner is None:
            return np.concatenate(own)
        its = np.ascontiguousarray(self.partner.snapshot(), dtype=np.float64).ravel()
        return np.concatenate((*own, its.view(np.int64)))

    def restore(self, numbers: NDArray[np.int64]) -> None:
        """Take up what :meth:`snapshot` returned."""
        place = self.control.parameters.size
        end = place + self.control.kept.size
        self.control.parameters[:] = numbers[:place]
        self.control.kept[:] = numbers[place:end]
        if self.partner is not None:
            self.partner.restore(numbers[end:].view(np.float64).copy())
