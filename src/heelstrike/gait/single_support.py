"""The robot standing on one flat foot, in symbols: its whole motion from that of its joints.

The stance foot is pinned to the ground, which turns the trunk's coordinates into functions of the
actuated ones (paper eq. 28-35) and the contact wrench and torques into functions of the motion
(eq. 36-37, inverse dynamics). Here the trunk's coordinates x, z, pitch are the first three; the
first two move every point alike, so the 3 by 3 systems with J_u are triangular.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics import kernels
from heelstrike.dynamics.symbolic import TracedDynamics, traced
from heelstrike.gait.sole import Sole
from heelstrike.robot.robot import Robot

Symbols = NDArray[np.object_]


class SingleSupport:
    """Motion, torques and ground wrench of a robot pinned to its flat stance foot.

    Parameters
    ----------
    robot : Robot
        A floating robot whose joints are all actuated.
    sole : Sole
        The stance foot; the middle of its sole is the origin of the world.
    position, velocity, acceleration : (nv - 3,) object arrays
        Symbolic motion of the joints, in the order of the coordinates.

    Attributes
    ----------
    q, v : (nv,) object arrays
        Whole position and velocity.
    torque : (nv - 3,) object array
        Actuator torques Γ at the joints, dampers and springs accounted for.
    force_x, force_z, moment : casadi.SX
        Wrench of the ground on the robot at the middle of the sole; the moment is about +y.
    """

    def __init__(
        self,
        robot: Robot,
        sole: Sole,
        position: Symbols,
        velocity: Symbols,
        acceleration: Symbols | None = None,
    ) -> None:
        self.robot = robot
        self._dynamics = TracedDynamics(robot, _flat_posture(robot, sole, position))
        self._origin = self._dynamics.point_position(sole.link, sole.point)
        self._jacobian = self._dynamics.point_jacobian(sole.link, self._origin)
        self.q = self._dynamics.q.copy()
        # The dynamics above is evaluated with the trunk at its reference place, which keeps its
        # coordinates out of the expressions; what is told to the outside is shifted.
        for k in range(2):
            self.q[k] = self.q[k] - self._origin[k] / robot.model.axis[k, k + 1]
        self.v = pinned(self._jacobian, velocity, np.zeros(3))
        self._dynamics.v = self.v
        traced(kernels.link_velocities)(robot.model, self.v, self._dynamics.work)
        if acceleration is not None:
            self._solve_forces(sole, acceleration)

    def _solve_forces(self, sole: Sole, acceleration: Symbols) -> None:
        dynamics = self._dynamics
        drift = dynamics.point_bias_acceleration(sole.link, self._origin)
        a = pinned(self._jacobian, acceleration, -drift)
        force = dynamics.inverse_dynamics(a) - dynamics.passive_force()
        self.force_x, self.force_z, self.moment = wrench = reaction(self._jacobian, force)
        self.torque = force[3:] - self._jacobian[:, 3:].T @ np.array(wrench, dtype=object)

    def point(self, link: int, local: Any) -> Symbols:
        """World position of a point of a link, from the middle of the stance sole."""
        shifted: Symbols = self._dynamics.point_position(link, local) - self._origin
        return shifted

    def jacobian(self, link: int, local: Any) -> Symbols:
        """Jacobian rows (x, z, rotation) of a point of a link, (3, nv)."""
        position = self._dynamics.point_position(link, local)
        return self._dynamics.point_jacobian(link, position)

    def angle(self, link: int) -> Any:
        """Rotation of a link about +y."""
        return self._dynamics.work.angle[link]

    def mass_matrix(self) -> Symbols:
        """Mass matrix A(q), (nv, nv)."""
        return self._dynamics.mass_matrix()


def _flat_posture(robot: Robot, sole: Sole, position: Symbols) -> Symbols:
    """Coordinates with the trunk at its reference place and pitched so that the foot is flat."""
    model = robot.model
    q = np.array([*model.reference[:3], *position], dtype=object)
    angle: Any = 0.0
    link = sole.link
    while link > 2:
        angle = angle + model.axis[link, 0] * (q[link] - model.reference[link])
        link = model.parent[link]
    q[2] = model.reference[2] + (sole.angle - angle) / model.axis[2, 0]
    return q


def pinned(jacobian: Symbols, joints: Symbols, target: NDArray[Any]) -> Symbols:
    """Complete joint velocities (or accelerations) so that J v = target (paper eq. 32-34).

    `jacobian` is (3, nv) with rows (x, z, rotation), `joints` (nv - 3,), `target` (3,).
    """
    residual = target - jacobian[:, 3:] @ joints
    pitch = residual[2] / jacobian[2, 2]
    x = (residual[0] - jacobian[0, 2] * pitch) / jacobian[0, 0]
    z = (residual[1] - jacobian[1, 2] * pitch) / jacobian[1, 1]
    return np.array([x, z, pitch, *joints], dtype=object)


def reaction(jacobian: Symbols, force: Symbols) -> tuple[Any, Any, Any]:
    """Wrench F on the pinned foot whose Jᵀ F makes up the force on the trunk, (x, z, moment)."""
    x = force[0] / jacobian[0, 0]
    z = force[1] / jacobian[1, 1]
    moment = (force[2] - jacobian[0, 2] * x - jacobian[1, 2] * z) / jacobian[2, 2]
    return x, z, moment
