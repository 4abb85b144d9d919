"""What a robot is: the kernels' arrays with the names, feet and symmetry a person needs."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heelstrike.robot.model import Model
from heelstrike.robot.state import State


@dataclass(frozen=True)
class Foot:
    """A link that ends a leg and carries contact points.

    Attributes
    ----------
    name : str
        Name of the foot's body in the robot file.
    link : int
        Index of the foot's link.
    contacts : tuple of int
        Indices of its contact points, ordered from heel to toe.
    """

    name: str
    link: int
    contacts: tuple[int, ...]


@dataclass(frozen=True)
class Mirror:
    """Exchange of left and right.

    Mirrored joint positions are ``sign * (q[joint] - reference[joint]) + reference``, mirrored
    velocities ``sign * v[joint]``; contact point ``i`` becomes ``contact[i]``, foot likewise.

    Attributes
    ----------
    joint : (nv,) int
        Counterpart of every coordinate (itself for trunk coordinates).
    sign : (nv,) float
        +1, or -1 where the two joints turn in opposite senses.
    contact : (nc,) int
        Counterpart of every contact point.
    foot : (nf,) int
        Counterpart of every foot.
    """

    joint: NDArray[np.int64]
    sign: NDArray[np.float64]
    contact: NDArray[np.int64]
    foot: NDArray[np.int64]

    def position(
        self, q: NDArray[np.float64], reference: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return positions with left and right exchanged.

        Parameters
        ----------
        q : (..., nq) float
            Positions.
        reference : (nq,) float
            The robot's `Model.reference`.
        """
        mirrored: NDArray[np.float64] = self.sign * (q - reference)[..., self.joint] + reference
        return mirrored

    def velocity(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return velocities or accelerations, of shape (..., nv), left and right exchanged."""
        mirrored: NDArray[np.float64] = self.sign * v[..., self.joint]
        return mirrored


@dataclass(frozen=True, eq=False)
class Robot:
    """A planar robot.

    Attributes
    ----------
    name : str
        Name of the robot.
    model : Model
        The arrays that the kernels use.
    joint_names, link_names : tuple of str
        Names of the nv coordinates and of the links they move. A body with several joints gives
        several links that share its name.
    actuator_names : tuple of str
        Names of the nu actuators.
    contact_names : tuple of str
        Names of the nc contact points.
    feet : tuple of Foot
        Links that end a leg and carry contact points, in file order.
    mirror : Mirror or None
        Exchange of left and right, or None for a robot that is not symmetric.
    floating : bool
        Whether the first three coordinates are the trunk's x, z and pitch.
    contact_friction : tuple of float
        Friction of the nc contact points according to the robot's file, empty if unknown. A
        simulation takes friction from its `Ground`.
    source : str
        File or builder the robot came from, for error messages.
    """

    name: str
    model: Model
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    actuator_names: tuple[str, ...]
    contact_names: tuple[str, ...]
    feet: tuple[Foot, ...]
    mirror: Mirror | None
    floating: bool
    contact_friction: tuple[float, ...] = ()
    source: str = field(default="", repr=False)

    @property
    def nq(self) -> int:
        """Number of positions."""
        return len(self.model.reference)

    @property
    def nv(self) -> int:
        """Number of velocities."""
        return len(self.model.parent)

    @property
    def nu(self) -> int:
        """Number of joint torques."""
        return len(self.model.actuator_joint)

    @property
    def nc(self) -> int:
        """Number of contact points."""
        return len(self.model.contact_link)

    @property
    def total_mass(self) -> float:
        """Mass of the whole robot in kg."""
        return float(np.sum(self.model.mass))

    @property
    def weight(self) -> float:
        """Total mass times gravity, in N."""
        return self.total_mass * float(np.hypot(*self.model.gravity))

    def reference_state(self) -> State:
        """State at rest in the reference configuration of the robot's file."""
        return State(self.model.reference.copy(), np.zeros(self.nv))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the robot to a file: MJCF (``.xml``) holds all of it, URDF (``.urdf``) most.

        What is read back has the same dynamics, on the same coordinates. URDF cannot hold springs,
        armature (so no motor inertia) and torque limits that differ between the two senses; and its
        zero configuration becomes the robot's reference.

        Parameters
        ----------
        path : str or path
            File to write.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RobotError
            If the ending is another one.

        Warns
        -----
        RobotWarning
            With everything that the format cannot hold, joint by joint.
        """
        from heelstrike.robot.saving import save_robot

        return save_robot(self, path)

    def __repr__(self) -> str:
        return (
            f"Robot({self.name!r}: {self.nv} coordinates, {self.nu} actuators, "
            f"{self.nc} contact points, {self.total_mass:g} kg)"
        )
