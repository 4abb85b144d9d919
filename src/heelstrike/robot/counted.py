"""What robots in the plane and in space have in common: how much there is of what."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heelstrike.robot.coordinates import index_of
from heelstrike.robot.state import State

if TYPE_CHECKING:
    from heelstrike.robot.model import Model
    from heelstrike.robot.spatial.model import SpatialModel


class Counted:
    """Base of robots: numbers of their parts, their mass and where they are to begin with."""

    name: str
    model: Model | SpatialModel
    actuator_names: tuple[str, ...]

    @property
    def nl(self) -> int:
        """Number of links."""
        return self.model.nl

    @property
    def nj(self) -> int:
        """Number of joints, one a link."""
        return self.model.nj

    @property
    def nq(self) -> int:
        """Number of positions."""
        return self.model.nq

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return self.model.nv

    @property
    def nu(self) -> int:
        """Number of joint torques."""
        return self.model.nu

    @property
    def nc(self) -> int:
        """Number of contact points."""
        return self.model.nc

    @property
    def total_mass(self) -> float:
        """Mass of the whole robot in kg."""
        return float(np.sum(self.model.mass))

    def reference_state(self) -> State:
        """State at rest in the reference configuration of the robot's file."""
        return State(self.model.reference.copy(), np.zeros(self.nv))

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
