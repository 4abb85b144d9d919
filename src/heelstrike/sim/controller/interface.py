"""What any controller is to the simulator, and the contact points as it sees them."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.robot.model import Floats
from heelstrike.robot.state import State

ARGUMENTS = ("t", "state", "contacts", "robot", "parameters", "memory", "log", "torque")
"""What functions made controllers may take."""


class Contacts(Bundle):
    """Contact points of a robot as a controller sees them."""

    position: Floats = array("nc", "axes")
    """World position of each contact point (the lowest point of its disc), in metres."""
    normal: Floats = array("nc", "axes")
    """Ground normal under each point."""
    gap: Floats = array("nc")
    """Distance to the ground, in metres; negative when penetrating."""
    force: Floats = array("nc", "components")
    """Force on the robot, (normal, tangent), of the step before, in newtons."""


@runtime_checkable
class Controller(Protocol):
    """Anything that can say which joint torques to apply.

    With an attribute `commands_voltage` that is true it says voltages, as parts of the full one.
    """

    def torque(self, t: float, state: State, contacts: Contacts) -> NDArray[np.float64]:
        """Return the joint torques (nu,), in N m, to hold until the next call.

        Parameters
        ----------
        t : float
            Time (s).
        state : State
            Where the robot is.
        contacts : Contacts
            How it touches the ground.

        Returns
        -------
        (nu,) float
            Torques, in the order of the actuators.
        """
        ...


@runtime_checkable
class Partaking(Protocol):
    """A controller in Python whose memory can be kept with a simulation."""

    def snapshot(self) -> ArrayLike:
        """Return its memory as an array of numbers."""
        ...

    def restore(self, numbers: NDArray[np.float64]) -> None:
        """Take up a memory that :meth:`snapshot` returned."""
        ...


def read_only(contacts: Contacts) -> Contacts:
    """Return the same contacts, to be looked at only."""
    shown = {name: values.view() for name, values in contacts.members().items()}
    for values in shown.values():
        values.flags.writeable = False
    return Contacts(**shown)
