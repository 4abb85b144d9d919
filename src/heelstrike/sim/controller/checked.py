"""A compiled controller run in Python, every index looked at: slow, and tells what is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import uncompiled
from heelstrike.dynamics.kernels import forward_kinematics, link_velocities
from heelstrike.dynamics.workspace import Workspace, workspace
from heelstrike.errors import ControllerError
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import CompiledController, Contacts, name_of

SCRATCH = ("acceleration", "force", "composite")
"""Fields of the robot's kinematics that controllers may write to."""


class CheckedController:
    """The same law as a compiled controller, in Python.

    Parameters
    ----------
    robot : Robot
        The robot it controls.
    controller : CompiledController
        The controller.
    """

    def __init__(self, robot: Robot, controller: CompiledController) -> None:
        self._name = name_of(controller)
        self._law: Any = uncompiled(controller.kernel)
        self._tree = workspace(robot.nv)
        self._robot = robot
        self._torque = np.zeros(robot.nu)
        self._memory = np.array(controller.memory, dtype=np.float64)
        self._arguments = (
            self._shown_bundle("model", robot.model),
            Workspace(
                **{
                    field: self._shown(f"tree.{field}", array, writable=field in SCRATCH)
                    for field, array in self._tree.members().items()
                }
            ),
            self._shown_bundle("scratch", workspace(robot.nv), writable=True),
            self._shown("parameters", controller.parameters),
            self._shown("memory", self._memory, writable=True),
            self._shown("torque", self._torque, writable=True),
        )

    def torque(self, t: float, state: State, contacts: Contacts) -> NDArray[np.float64]:
        """Return the joint torques (nu,), in N m.

        Raises
        ------
        ControllerError
            If it reads or writes beyond an array, or writes to one that is not its own.
        """
        forward_kinematics(self._robot.model, state.q, self._tree)
        link_velocities(self._robot.model, state.v, self._tree)
        with np.errstate(all="ignore"):
            self._law(
                np.float64(t),
                self._shown("q", state.q),
                self._shown("v", state.v),
                self._shown_bundle("contacts", contacts),
                *self._arguments,
            )
        return self._torque.copy()

    def snapshot(self) -> NDArray[np.float64]:
        """Return its memory."""
        return self._memory.copy()

    def restore(self, numbers: NDArray[np.float64]) -> None:
        """Take up a memory."""
        self._memory[:] = numbers

    def _shown(self, name: str, array: Any, *, writable: bool = False) -> Any:
        shown = np.asarray(array).view(_Shown)
        shown.name = name
        shown.controller = self._name
        shown.flags.writeable = writable
        return shown

    def _shown_bundle(self, name: str, bundle: Any, *, writable: bool = False) -> Any:
        return type(bundle)(
            **{
                field: self._shown(f"{name}.{field}", value, writable=writable)
                if isinstance(value, np.ndarray)
                else value
                for field, value in bundle.members().items()
            }
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
                f"torque and its memory are its own, and the scratch fields of tree ("
                f"{', '.join(SCRATCH)}) and scratch are free to use"
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


def _text(index: Any) -> str:
    """Write an index as in Python."""
    if isinstance(index, tuple):
        return ", ".join(_text(part) for part in index)
    if isinstance(index, slice):
        ends = ("" if end is None else str(end) for end in (index.start, index.stop))
        return ":".join(ends)
    return str(index)
