"""What robots in the plane and in space have in common: a tree of links, its parts by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.coordinates import checked, index_of
from heelstrike.robot.model import Integers
from heelstrike.robot.state import State


@dataclass(frozen=True)
class Foot:
    """A link that ends a leg and carries contact points."""

    name: str
    """Name of the foot's body in the robot file."""
    link: int
    """Index of the foot's link."""
    contacts: tuple[int, ...]
    """Indices of its contact points, in the plane ordered from heel to toe."""


@dataclass(frozen=True, eq=False)
class NamedTree(ABC):
    """Base of robots: names and numbers of their parts, and where they are to begin with."""

    name: str
    """Name of the robot."""
    model: Any
    """The arrays that the kernels use."""
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    """joint_names, link_names: Names of the nj joints and of the links they move. A body with
    several joints gives several links that share its name."""
    actuator_names: tuple[str, ...]
    """Names of the nu actuators."""
    contact_names: tuple[str, ...]
    """Names of the nc contact points."""
    feet: tuple[Foot, ...]
    """Links that end a leg and carry contact points, in file order."""

    @property
    def position_names(self) -> tuple[str, ...]:
        """Names of the nq positions: those of joints, or of what a joint has several of."""
        return self.joint_names

    @property
    def velocity_names(self) -> tuple[str, ...]:
        """Names of the nv velocities: those of joints, or of what a joint has several of."""
        return self.joint_names

    @property
    def nl(self) -> int:
        """Number of links."""
        return int(self.model.nl)

    @property
    def nj(self) -> int:
        """Number of joints, one a link."""
        return int(self.model.nj)

    @property
    def nq(self) -> int:
        """Number of positions."""
        return int(self.model.nq)

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return int(self.model.nv)

    @property
    def nu(self) -> int:
        """Number of joint torques."""
        return int(self.model.nu)

    @property
    def nc(self) -> int:
        """Number of contact points."""
        return int(self.model.nc)

    @property
    def total_mass(self) -> float:
        """Mass of the whole robot in kg."""
        return float(np.sum(self.model.mass))

    def reference_state(self) -> State:
        """State at rest in the reference configuration of the robot's file."""
        return State(self.model.reference.copy(), np.zeros(self.nv))

    @property
    @abstractmethod
    def driven(self) -> Integers:
        """Index of the velocity that each actuator drives, (nu,)."""

    def _checked(self, state: State) -> State:
        """Return a copy of a state that fits the robot, or raise a `RobotError`."""
        return checked(self, state)

    def positions(self, state: State) -> dict[str, float]:
        """Positions of a state by `position_names`, in rad and m.

        Parameters
        ----------
        state : State
            The state.

        Returns
        -------
        dict
            Position by name.
        """
        return dict(zip(self.position_names, self._checked(state).q.tolist(), strict=True))

    def velocities(self, state: State) -> dict[str, float]:
        """Velocities of a state by `velocity_names`, in rad/s and m/s.

        Parameters
        ----------
        state : State
            The state.

        Returns
        -------
        dict
            Velocity by name.
        """
        return dict(zip(self.velocity_names, self._checked(state).v.tolist(), strict=True))

    def joint_index(self, joint: str | int) -> int:
        """Index of a joint, given by its name (or by an index, which is checked).

        Parameters
        ----------
        joint : str or int
            Name of the joint, or an index.

        Returns
        -------
        int
            Its place among the joints. In the plane that is its place in q and v, too; in space
            ``model.first_position`` and ``model.first_velocity`` tell those.

        Raises
        ------
        RobotError
            If there is no such joint; the message lists those there are.
        """
        return index_of(self, "joint", self.joint_names, joint)

    def actuator_index(self, actuator: str | int) -> int:
        """Index of an actuator, given by its name or index; see `joint_index`.

        Parameters
        ----------
        actuator : str or int
            Name of the actuator, or an index.

        Returns
        -------
        int
            Its place among the torques.
        """
        return index_of(self, "actuator", self.actuator_names, actuator)


def legs(robot: NamedTree) -> Integers:
    """Index of the foot whose leg each link belongs to, -1 if it carries none or several."""
    carried: list[set[int]] = [set() for _ in range(robot.nl)]
    for index, foot in enumerate(robot.feet):
        link = foot.link
        while link >= 0:
            carried[link].add(index)
            link = int(robot.model.parent[link])
    several = len(robot.feet) > 1
    return np.array(
        [next(iter(feet)) if several and len(feet) == 1 else -1 for feet in carried],
        dtype=np.int64,
    )
