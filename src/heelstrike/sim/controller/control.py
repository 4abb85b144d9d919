"""What a compiled loop needs to ask a controller."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, cell, number, part
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import ControllerError
from heelstrike.robot.model import Integers
from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.guard import guarded_bundle, in_one_block
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.controller.robot import (
    ControlledRobot,
    ControlState,
    extents_of,
    robot_view,
)

if TYPE_CHECKING:
    from heelstrike.sim.controller.law import Law

# What `Control.conduct` says of the controller: that it is one of this package, whose tests see to
# what it writes; that it is watched; that it wrote beyond its own arrays.
TRUSTED = 0
WATCHED = 1
OVERRAN = 2


class Control(Bundle):
    """The numbers of a controller, and how it is asked.

    Attributes
    ----------
    parameters : (n,) int
        Words of its parameters; guarded.
    kept, spare : (m,) int
        Words of its memory and log, and of others for the calls that it shall forget; guarded.
    between_parameters, between_kept : int
        Where in these there are guard words.
    logged : (k,) int
        Where among the words of `kept` those of the log are.
    parameters_at, kept_at, spare_at, log_at, spare_log_at : int
        Where the tables of the bundles are.
    state, contacts, robot
        What it is shown.
    believes : int
        Whether the robot it is shown is another than the one that moves.
    continuous : int
        Whether it acts within the steps too; otherwise its torques are held.
    voltage : int
        Whether it commands voltages; otherwise torques.
    in_python : int
        Whether the loop has to come back for its torques.
    conduct : int
        What it has done that it may not.
    """

    parameters: Integers = array("words", of=int)
    kept: Integers = array("memory", of=int)
    spare: Integers = array("memory", of=int)
    between_parameters: Integers = array("p", of=int, address=True)
    between_kept: Integers = array("m", of=int, address=True)
    logged: Integers = array("logged", of=int, address=True)
    parameters_at: int = number(int)
    kept_at: int = number(int)
    spare_at: int = number(int)
    log_at: int = number(int)
    spare_log_at: int = number(int)
    state: ControlState = part(ControlState, address=True)
    contacts: Contacts = part(Contacts, address=True)
    robot: ControlledRobot = part(ControlledRobot, address=True)
    believes: int = number(int)
    continuous: int = cell(int)
    voltage: int = cell(int)
    in_python: int = cell(int)
    conduct: int = cell(int)


class ReadyLaw:
    """A law made ready for a robot: its numbers, a new memory and log, guard words round them.

    Parameters
    ----------
    robot : Robot
        The robot.
    law : Law
        The law.
    tree, contacts : Workspace and Contacts, optional
        Those of the simulation, which stock controllers are shown; others see copies.
    log : Bundle, optional
        What the log begins with that a controller in Python keeps; by default that of the law.

    Attributes
    ----------
    control : Control
        What loops hand along.
    robot : Robot
        The robot it is shown: that of the law, if it knows another than the one it controls.
    parameters, memory, log : Bundle
        Its numbers, which may be set, what it remembers, and what it tells of itself.

    Raises
    ------
    ControllerError
        If parameters or memory do not fit the robot, or the law knows one that is built otherwise.
    """

    def __init__(
        self, robot: Robot, law: Law, tree: Workspace | None = None,
        contacts: Contacts | None = None, log: Bundle | None = None,
    ) -> None:  # fmt: skip
        believes = believes_in_another(law, robot)
        self.robot = robot = law.robot if believes and law.robot is not None else robot
        self._law = law
        extents = extents_of(robot)
        numbers, memory = law.numbers(robot)
        log = law.new_log(robot) if log is None else log
        self.parameters, parameters, between_parameters = in_one_block(numbers)
        kinds: tuple[Any, Any] = type(memory), type(log)
        both: Any = _kept(*kinds)(memory=memory, log=log)
        both, kept, between_kept = in_one_block(both)
        self._spare, spare, _ = in_one_block(both)
        self.memory, self.log = both.memory, both.log
        places = [_places(values, kept) for _, _, values in self.log.views()]
        shown: dict[str, Any] = {
            "state": ControlState.allocate(extents),
            "contacts": Contacts.allocate(extents),
            "robot": robot_view(robot),
        }
        self._shown: dict[str, Bundle] = {}
        if law.function.is_ours and tree is not None and contacts is not None:
            if not believes:
                shown["state"] = ControlState.allocate(extents, kinematics=tree)
            shown["contacts"] = contacts
        else:
            shown = self._shown = {name: guarded_bundle(each) for name, each in shown.items()}
        self.control = Control(
            parameters=parameters, kept=kept, spare=spare,
            between_parameters=between_parameters, between_kept=between_kept,
            parameters_at=self.parameters.address, kept_at=self.memory.address,
            spare_at=self._spare.memory.address, log_at=self.log.address,
            spare_log_at=self._spare.log.address, logged=np.concatenate((*places, _NOWHERE)),
            believes=believes, conduct=WATCHED if self._shown else TRUSTED, **shown,
        )  # fmt: skip

    def set_parameters(self, parameters: Bundle) -> None:
        """Put other parameters in the place of its own.

        Raises
        ------
        ControllerError
            If they are not such as its own.
        """
        numbers, _ = self._law.with_parameters(parameters).numbers(self.robot)
        try:
            self.parameters.become(numbers)
        except ValueError as error:
            raise ControllerError(
                f"controller {self._law.function.name!r} can only be given parameters of the same "
                f"shapes: {error}"
            ) from error

    def arrays(self) -> Iterator[tuple[str, Any]]:
        """Name the arrays with guard words round them."""
        bundles = {
            "parameters": self.parameters, "memory": self.memory, "log": self.log, **self._shown
        }  # fmt: skip
        for name, bundle in bundles.items():
            yield from bundle.storage(f"{name}.")
        yield from self._spare.memory.storage("memory.")
        yield from self._spare.log.storage("log.")


_NOWHERE = np.zeros(0, dtype=np.int64)


@cache
def _kept(memory: Any, log: Any) -> Any:
    """Class of what a law keeps from call to call."""
    return type("Kept", (Bundle,), {"memory": part(memory), "log": part(log)})


def _places(values: Any, block: Integers) -> Integers:
    """Return where in a block of words those of an array within it are."""
    first = (values.ctypes.data - block.ctypes.data) // block.itemsize
    return np.arange(first, first + values.size)


def believes_in_another(law: Law, robot: Robot) -> bool:
    """Whether a law knows another robot than the one it controls, by any of its numbers.

    Raises
    ------
    ControllerError
        If that one has other joints, actuators or contact points.
    """
    known = law.robot
    if known is None or known is robot or known.model is robot.model:
        return False
    for what in ("joint_names", "actuator_names", "contact_names", "link_names"):
        its, ours = getattr(known, what), getattr(robot, what)
        if its != ours:
            raise ControllerError(
                f"controller {law.function.name!r} knows robot {known.name!r}, which is built "
                f"otherwise than {robot.name!r}: its {what.replace('_', ' ')} are "
                f"{', '.join(its)}, not {', '.join(ours)}. Only numbers may differ"
            )
    mine, its = robot.model.members(), known.model.members()
    return not all(np.array_equal(mine[name], its[name]) for name in mine)
