"""What a motion depends on besides the state in which it begins, as columns of its derivative."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from heelstrike.contact.linearized.partials import FRICTION, chosen_numbers, columns_of
from heelstrike.robot.robot import Robot

TORQUE = "added torque"
"""Torques that are added, the same all the time, to those that act anyway."""

LAW = "law."
"""What the names of the law's parameters begin with, which may be those of numbers."""


@dataclass(frozen=True)
class Inputs:
    """Torques, numbers of the robot and of the ground, and parameters of the law."""

    numbers: tuple[str, ...] = ()
    """Of robot and ground, the ground's friction last."""
    columns: dict[str, slice] = field(default_factory=dict)
    """Where each is among the columns."""
    parameters: tuple[str, ...] = ()
    """Of the law."""

    @property
    def size(self) -> int:
        """How many columns there are."""
        return max((each.stop for each in self.columns.values()), default=0)

    @property
    def dynamic(self) -> tuple[str, ...]:
        """Numbers of the robot."""
        return tuple(name for name in self.numbers if name != FRICTION)

    def of(self, name: str) -> list[int]:
        """Columns of one, none of what is not there."""
        there = self.columns.get(name, slice(0, 0))
        return list(range(there.start, there.stop))

    def of_numbers(self) -> list[int]:
        """Columns of the numbers."""
        return [column for name in self.numbers for column in self.of(name)]

    def of_parameters(self) -> list[int]:
        """Columns of the law's parameters."""
        return [column for name in self.parameters for column in self.of(LAW + name)]


NONE = Inputs()


def inputs_of(robot: Robot, numbers: Sequence[str], parameters: dict[str, int]) -> Inputs:
    """Number the columns: torques, numbers of robot and ground, then parameters by their sizes.

    Raises
    ------
    SimulationError
        If there is no such number.
    """
    chosen_numbers(numbers)
    own = columns_of(robot.model, numbers)
    sizes = {TORQUE: robot.nu, **{name: each.stop - each.start for name, each in own.items()}}
    sizes |= {LAW + name: size for name, size in parameters.items()}
    columns, begin = {}, 0
    for name, size in sizes.items():
        columns[name] = slice(begin, begin + size)
        begin += size
    return Inputs(tuple(own), columns, tuple(parameters))
