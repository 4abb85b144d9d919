"""Contact points of a simulation where it is now, seen from Python."""

from __future__ import annotations

from functools import cache, cached_property
from typing import Any

from numba import types

from heelstrike.compiler.compilation import loop_for
from heelstrike.compiler.mold import Mold
from heelstrike.compiler.words import copy_words
from heelstrike.contact.ground import Ground, GroundModel
from heelstrike.dynamics.kernels import forward_kinematics
from heelstrike.dynamics.workspace import Workspace
from heelstrike.once_each import once_each
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.contacts.geometry import locate_contacts
from heelstrike.sim.controller.interface import Contacts
from heelstrike.sim.memory import Memory, Surface


@once_each
def _mold_of(robot: Robot) -> Mold[Contacts]:
    return Mold(Contacts.allocate({**robot.model.extents, "components": 2}))


class Look:
    """A look at a simulation that leaves its memory as it is.

    Parameters
    ----------
    robot : Robot
        The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    @cached_property
    def _scratch(self) -> tuple[Workspace, Surface]:
        extents = self._robot.model.extents
        return Workspace.allocate(extents), Surface.allocate(extents, capacity=self._robot.nc)

    def at_contacts(self, ground: Ground, memory: Memory) -> Contacts:
        """Return the contact points of the state now, with the forces of the step before."""
        contacts = _mold_of(self._robot).cast()
        _locate()(self._robot.model, ground.model(), memory, *self._scratch, contacts)
        return contacts


@cache
def _locate() -> Any:
    def locate_now(
        model: Model, ground: GroundModel, memory: Memory, tree: Workspace, surface: Surface,
        contacts: Contacts,
    ) -> int:  # fmt: skip
        forward_kinematics(model, memory.q, tree)
        locate_contacts(model, ground, tree, contacts, surface)
        copy_words(memory.contacts.force, contacts.force)
        return 0

    kinds = Model, GroundModel, Memory, Workspace, Surface, Contacts
    return loop_for(types.int64(*(kind.compiled_type() for kind in kinds)), locate_now)
