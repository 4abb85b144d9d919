"""What a compiled loop needs to ask a controller."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

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
    controlled_robot,
    extents_of,
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
        Words of its memory, and of another for the calls that it shall forget; guarded.
    between_parameters, between_kept : int
        Where in these there are guard words.
    parameters_at, kept_at, spare_at : int
        Where the tables of the bundles are.
    state, contacts, robot
        What it is shown.
    continuous : int
        Whether it acts within the steps too; otherwise its torques are held.
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
    parameters_at: int = number(int)
    kept_at: int = number(int)
    spare_at: int = number(int)
    state: ControlState = part(ControlState, address=True)
    contacts: Contacts = part(Contacts, address=True)
    robot: ControlledRobot = part(ControlledRobot, address=True)
    continuous: int = cell(int)
    in_python: int = cell(int)
    conduct: int = cell(int)


class ReadyLaw:
    """A law made ready for a robot: its numbers and a new memory, guard words round them.

    Parameters
    ----------
    robot : Robot
        The robot.
    law : Law
        The law.
    tree, contacts : Workspace and Contacts, optional
        Those of the simulation, which stock controllers are shown; others see copies.

    Attributes
    ----------
    control : Control
        What loops hand along.
    parameters, memory : Bundle
        Its numbers, which may be set, and what it remembers.

    Raises
    ------
    ControllerError
        If parameters or memory do not fit the robot.
    """

    def __init__(
        self, robot: Robot, law: Law, tree: Workspace | None = None,
        contacts: Contacts | None = None,
    ) -> None:  # fmt: skip
        self._robot, self._law = robot, law
        extents = extents_of(robot)
        numbers, memory = law.numbers(robot)
        self.parameters, parameters, between_parameters = in_one_block(numbers)
        self.memory, kept, between_kept = in_one_block(memory)
        self._spare, spare, _ = in_one_block(memory)
        shown: dict[str, Any] = {
            "state": ControlState.allocate(extents),
            "contacts": Contacts.allocate(extents),
            "robot": controlled_robot(robot),
        }
        self._shown: dict[str, Bundle] = {}
        if law.function.is_ours and tree is not None and contacts is not None:
            shown["state"] = ControlState.allocate(extents, kinematics=tree)
            shown["contacts"] = contacts
        else:
            shown = self._shown = {name: guarded_bundle(each) for name, each in shown.items()}
        self.control = Control(
            parameters=parameters, kept=kept, spare=spare,
            between_parameters=between_parameters, between_kept=between_kept,
            parameters_at=self.parameters.address, kept_at=self.memory.address,
            spare_at=self._spare.address, conduct=WATCHED if self._shown else TRUSTED, **shown,
        )  # fmt: skip

    def set_parameters(self, parameters: Bundle) -> None:
        """Put other parameters in the place of its own.

        Raises
        ------
        ControllerError
            If they are not such as its own.
        """
        numbers, _ = self._law.with_parameters(parameters).numbers(self._robot)
        try:
            self.parameters.become(numbers)
        except ValueError as error:
            raise ControllerError(
                f"controller {self._law.function.name!r} can only be given parameters of the same "
                f"shapes: {error}"
            ) from error

    def arrays(self) -> Iterator[tuple[str, Any]]:
        """Name the arrays with guard words round them."""
        bundles = {"parameters": self.parameters, "memory": self.memory, **self._shown}
        for name, bundle in bundles.items():
            yield from bundle.storage(f"{name}.")
        yield from self._spare.storage("memory.")
