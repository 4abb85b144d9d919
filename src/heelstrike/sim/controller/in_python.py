"""A law asked from Python: compiled, as it was written, or with every index looked at."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.compilation import uncompiled
from heelstrike.errors import ControllerError
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.control import ReadyLaw
from heelstrike.sim.controller.interface import ARGUMENTS, Contacts, Partaking
from heelstrike.sim.controller.robot import ControlledRobot

if TYPE_CHECKING:
    from heelstrike.sim.controller.law import Law

SCRATCH = ("kinematics.acceleration", "kinematics.force", "kinematics.composite")
"""Of the state, what queries write to."""


class AskedLaw:
    """A law and its memory, as a controller in Python.

    Parameters
    ----------
    robot : Robot
        The robot it controls.
    law : Law
        The law.
    compiled : bool
        Whether it is the compiled function that is asked.
    checked : bool
        Whether every index is looked at: slow, and tells what is wrong.
    """

    def __init__(
        self, robot: Robot, law: Law, *, compiled: bool = False, checked: bool = False
    ) -> None:
        ready = ReadyLaw(robot, law)
        control = ready.control
        self.partner = law.function.partner
        self.name = law.function.name
        self.numbers, self._control = ready, control
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
        if compiled:
            self._names, self._call = ARGUMENTS, law.function.finish()
            self._given = {
                name: value.address if isinstance(value, Bundle) else value
                for name, value in self._given.items()
            }
        elif checked:
            self._call = uncompiled(law.function.python)
            self._given = {name: self._shown(name, value) for name, value in self._given.items()}

    def torque(self, t: float, state: State, contacts: Contacts | None) -> NDArray[np.float64]:
        """Return the joint torques (nu,), in N m.

        Raises
        ------
        ControllerError
            If it is checked and reads or writes beyond an array, or writes to one not its own.
        """
        own = self._control.state
        own.q[:], own.v[:] = state.q, state.v
        self._control.robot.update(own)
        if contacts is not None:
            for name, values in contacts.members().items():
                getattr(self._control.contacts, name)[...] = values
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
        own = self._control.parameters, self._control.kept
        if self.partner is None:
            return np.concatenate(own)
        its = np.ascontiguousarray(self.partner.snapshot(), dtype=np.float64).ravel()
        return np.concatenate((*own, its.view(np.int64)))

    def restore(self, numbers: NDArray[np.int64]) -> None:
        """Take up what :meth:`snapshot` returned."""
        place = self._control.parameters.size
        end = place + self._control.kept.size
        self._control.parameters[:] = numbers[:place]
        self._control.kept[:] = numbers[place:end]
        if self.partner is not None:
            self.partner.restore(numbers[end:].view(np.float64).copy())

    def _shown(self, name: str, value: Any) -> Any:
        """Return the same array, or a bundle of the same arrays, each knowing what it is."""
        if not isinstance(value, Bundle):
            return _shown(name, value, self.name, writable=True)
        free = name in ("robot", "memory", "log")
        members: dict[str, Any] = value.members()
        kind = type(value)
        if kind is ControlledRobot:
            model = members["model"]
            members["model"] = model.stored(
                lambda part, array: _shown(f"robot.model.{part}", array, self.name, writable=False)
            )
            # Its queries look at every index, too.
            queries = {
                each: uncompiled(query)
                for each, query in vars(ControlledRobot).items()
                if hasattr(query, "py_func")
            }
            kind = type(kind.__name__, (kind,), queries)
        copy = kind(**members)
        copy.__dict__["_cells"] = value.__dict__["_cells"]
        return copy.stored(
            lambda part, array: _shown(
                f"{name}.{part}", array, self.name, writable=free or part in SCRATCH
            )
        )


class _Shown(np.ndarray[Any, np.dtype[Any]]):
    """An array that knows what it is called, and who uses it."""

    name = ""
    controller = ""

    def __array_finalize__(self, other: Any) -> None:
        self.name = getattr(other, "name", "")
        self.controller = getattr(other, "controller", "")

    def __getitem__(self, index: Any) -> Any:
        try:
            part = super().__getitem__(index)
        except IndexError:
            raise self._beyond("reads", index) from None
        if isinstance(part, _Shown):
            part.name = f"{self.name}[{_text(index)}]"
        return part

    def __setitem__(self, index: Any, value: Any) -> None:
        if not self.flags.writeable:
            raise ControllerError(
                f"controller {self.controller!r} writes to {self.name}[{_text(index)}]: only its "
                f"torque and its memory are its own, and robot.estimate is free to use"
            )
        try:
            super().__setitem__(index, value)
        except IndexError:
            raise self._beyond("writes to", index) from None

    def _beyond(self, does: str, index: Any) -> ControllerError:
        return ControllerError(
            f"controller {self.controller!r} {does} {self.name}[{_text(index)}], beyond its shape "
            f"{self.shape}"
        )


def _shown(name: str, array: Any, controller: str, *, writable: bool) -> Any:
    shown = np.asarray(array).view(_Shown)
    shown.name = name
    shown.controller = controller
    shown.flags.writeable = writable
    return shown


def _text(index: Any) -> str:
    """Write an index as in Python."""
    if isinstance(index, tuple):
        return ", ".join(_text(part) for part in index)
    if isinstance(index, slice):
        ends = ("" if end is None else str(end) for end in (index.start, index.stop))
        return ":".join(ends)
    return str(index)
