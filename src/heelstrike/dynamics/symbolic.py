"""The kernels over CasADi symbols: one source, exact expression graphs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import uncompiled
from heelstrike.dynamics import kernels
from heelstrike.dynamics.equations_of_motion import weightless
from heelstrike.dynamics.workspace import Workspace, workspace
from heelstrike.robot.robot import Robot


def traced(kernel: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel that runs over object arrays of CasADi ``SX`` instead of numbers."""
    return uncompiled(kernel, replace={math.sin: casadi.sin, math.cos: casadi.cos})


def symbols(vector: casadi.SX) -> NDArray[np.object_]:
    """Spread a CasADi vector over an object array, one scalar symbol an entry."""
    array = np.empty(vector.numel(), dtype=object)
    for i in range(vector.numel()):
        array[i] = vector[i]
    return array


def expression(array: NDArray[np.object_]) -> casadi.SX:
    """Collect an object array of scalar symbols into a CasADi vector or matrix."""
    collected: Any = (
        casadi.vertcat(*array)
        if array.ndim == 1
        else casadi.vertcat(*(casadi.horzcat(*row) for row in array))
    )
    return collected


class TracedDynamics:
    """Kernels of one robot, run over symbolic positions and velocities.

    Parameters
    ----------
    robot : Robot
        The robot whose numbers enter the expressions.
    q, v : (nv,) object arrays of casadi.SX
        Symbolic state, for example from :func:`symbols`.
    """

    def __init__(
        self, robot: Robot, q: NDArray[np.object_], v: NDArray[np.object_] | None = None
    ) -> None:
        self.robot = robot
        self.model = robot.model
        self.work: Workspace = workspace(robot.nv, dtype=object)
        self.q = q
        self.v = np.zeros(robot.nv, dtype=object) if v is None else v
        traced(kernels.forward_kinematics)(self.model, self.q, self.work)
        traced(kernels.link_velocities)(self.model, self.v, self.work)

    def mass_matrix(self) -> NDArray[np.object_]:
        """Mass matrix, (nv, nv)."""
        matrix = np.zeros((self.robot.nv, self.robot.nv), dtype=object)
        traced(kernels.mass_matrix)(self.model, self.work, matrix)
        return matrix

    def inverse_dynamics(self, acceleration: NDArray[np.object_]) -> NDArray[np.object_]:
        """Generalised force A a + H, (nv,)."""
        force = np.zeros(self.robot.nv, dtype=object)
        traced(kernels.inverse_dynamics)(self.model, acceleration, self.work, force)
        return force

    def bias_force(self) -> NDArray[np.object_]:
        """Centrifugal, Coriolis and gravitational forces, (nv,)."""
        return self.inverse_dynamics(np.zeros(self.robot.nv, dtype=object))

    def gravity_force(self) -> NDArray[np.object_]:
        """Gravitational part of the bias force, (nv,)."""
        return TracedDynamics(self.robot, self.q).bias_force()

    def coriolis_force(self) -> NDArray[np.object_]:
        """Centrifugal and Coriolis part of the bias force, (nv,)."""
        force = np.zeros(self.robot.nv, dtype=object)
        traced(kernels.bias_force)(weightless(self.model), self.work, force)
        return force

    def forward_dynamics(self, force: NDArray[np.object_]) -> NDArray[np.object_]:
        """Acceleration A⁻¹ (force − H) without contact, (nv,)."""
        n = self.robot.nv
        matrix, factor = np.zeros((n, n), dtype=object), np.zeros((n, n), dtype=object)
        acceleration = np.zeros(n, dtype=object)
        traced(kernels.forward_dynamics)(self.model, matrix, factor, force, self.work, acceleration)
        return acceleration

    def passive_force(self) -> NDArray[np.object_]:
        """Force of joint dampers and springs on the robot, (nv,)."""
        force = np.zeros(self.robot.nv, dtype=object)
        traced(kernels.passive_force)(self.model, self.q, self.v, force)
        return force

    def point_position(self, link: int, local: NDArray[Any]) -> NDArray[np.object_]:
        """World position of a point fixed to a link, (2,)."""
        position = np.zeros(2, dtype=object)
        traced(kernels.point_position)(self.work, link, local, position)
        return position

    def point_jacobian(self, link: int, position: NDArray[Any]) -> NDArray[np.object_]:
        """Rows (x, z, rotation) of the Jacobian of the point at a world position, (3, nv)."""
        jacobian = np.zeros((3, self.robot.nv), dtype=object)
        traced(kernels.point_jacobian)(self.model, self.work, link, position, jacobian)
        return jacobian

    def point_bias_acceleration(self, link: int, position: NDArray[Any]) -> NDArray[np.object_]:
        """J̇v of the point at a world position, (3,)."""
        acceleration = np.zeros(3, dtype=object)
        traced(kernels.point_bias_acceleration)(self.work, link, position, acceleration)
        return acceleration

    def contact_jacobian(self, contacts: Sequence[int]) -> NDArray[np.object_]:
        """Rows (normal, tangent) of contact points on level ground, point by point, (2k, nv)."""
        rows = np.zeros((2 * len(contacts), self.robot.nv), dtype=object)
        for place, contact in enumerate(contacts):
            link = int(self.model.contact_link[contact])
            position = self.point_position(link, self.model.contact_position[contact])
            position[1] = position[1] - self.model.contact_radius[contact]
            rows[2 * place : 2 * place + 2] = self.point_jacobian(link, position)[[1, 0]]
        return rows

    def contact_bias_acceleration(self, contacts: Sequence[int]) -> NDArray[np.object_]:
        """J̇v of :meth:`contact_jacobian`, of the gap and the sliding velocity of discs, (2k,)."""
        result = np.zeros(2 * len(contacts), dtype=object)
        for place, contact in enumerate(contacts):
            link = int(self.model.contact_link[contact])
            center = self.point_position(link, self.model.contact_position[contact])
            x, z, turn = self.point_bias_acceleration(link, center)
            result[2 * place] = z
            result[2 * place + 1] = x - self.model.contact_radius[contact] * turn
        return result

    def energies(self) -> tuple[Any, Any]:
        """Kinetic and potential energy (J)."""
        kinetic = np.zeros(1, dtype=object)
        potential = np.zeros(1, dtype=object)
        traced(kernels.kinetic_energy)(self.model, self.v, self.work, kinetic)
        traced(kernels.potential_energy)(self.model, self.q, self.work, potential)
        return kinetic[0], potential[0]

    def center_of_mass(self) -> NDArray[np.object_]:
        """World position of the robot's centre of mass, (2,)."""
        position = np.zeros(2, dtype=object)
        traced(kernels.center_of_mass)(self.model, self.work, position)
        return position

    def momentum(self) -> NDArray[np.object_]:
        """Linear momentum and moment of momentum about the centre of mass, (3,)."""
        result = np.zeros(3, dtype=object)
        traced(kernels.momentum)(self.model, self.work, result)
        return result

    def momentum_matrix(self) -> NDArray[np.object_]:
        """Centroidal momentum matrix, (3, nv)."""
        matrix = np.zeros((3, self.robot.nv), dtype=object)
        traced(kernels.momentum_matrix)(self.model, self.work, matrix)
        return matrix
