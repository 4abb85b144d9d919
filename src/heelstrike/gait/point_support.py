"""The robot standing on one point foot, in symbols: pinned at a point, free to turn about it.

The ground holds the foot but exerts no moment on it, so the trunk's pitch stays a coordinate of its
own next to those of the joints, and one equation of motion is left that no motor enters: its
residual is the moment that the stance ankle would have to exert. A foot with a radius rolls.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics import kernels
from heelstrike.dynamics.symbolic import TracedDynamics, traced
from heelstrike.gait.single_support import Symbols
from heelstrike.robot.robot import Robot


class PointSupport:
    """Motion, torques and ground force of a robot on one contact point.

    Parameters
    ----------
    robot : Robot
        A floating robot whose joints are all actuated.
    contact : int
        The contact point that stands.
    position, velocity, acceleration : (nv - 2,) object arrays
        Symbolic motion of the trunk's pitch and of the joints, in the order of the coordinates.

    Attributes
    ----------
    q, v : (nv,) object arrays
        Whole position and velocity, with the point of contact at the origin of the world.
    torque : (nv - 3,) object array
        Actuator torques Γ at the joints, dampers and springs accounted for.
    force_x, force_z : casadi.SX
        Force of the ground on the robot at the point of contact.
    ankle : casadi.SX
        What is missing in the equation of the trunk's pitch, in N m: zero in any motion that the
        robot can make.
    """

    def __init__(
        self,
        robot: Robot,
        contact: int,
        position: Symbols,
        velocity: Symbols,
        acceleration: Symbols | None = None,
    ) -> None:
        self.robot = robot
        model = robot.model
        self._dynamics = TracedDynamics(
            robot, np.array([*model.reference[:2], *position], dtype=object)
        )
        self._link = int(model.contact_link[contact])
        self._center = self._dynamics.point_position(self._link, model.contact_position[contact])
        self._radius = float(model.contact_radius[contact])
        self._origin = self._center - np.array([0.0, self._radius])
        self._jacobian = self._dynamics.point_jacobian(self._link, self._origin)[:2]
        self.q = self._dynamics.q.copy()
        # The trunk stays at its reference place in the expressions; the outside hears it shifted.
        for k in range(2):
            self.q[k] = self.q[k] - self._origin[k] / model.axis[k, k + 1]
        self.v = pinned_point(self._jacobian, velocity, np.zeros(2))
        self._dynamics.v = self.v
        traced(kernels.link_velocities)(model, self.v, self._dynamics.work)
        if acceleration is not None:
            self._solve_forces(acceleration)

    def _solve_forces(self, acceleration: Symbols) -> None:
        dynamics = self._dynamics
        # The centre of a disc that rolls on level ground does not accelerate by itself.
        drift = dynamics.point_bias_acceleration(self._link, self._center)[:2]
        a = pinned_point(self._jacobian, acceleration, -drift)
        force = dynamics.inverse_dynamics(a) - dynamics.passive_force()
        self.force_x, self.force_z, rest = point_reaction(self._jacobian, force)
        self.ankle, self.torque = rest[0], rest[1:]

    @property
    def rolled(self) -> Any:
        """How far the point of contact is ahead of where it is when the link is not turned."""
        return self._radius * self._dynamics.work.angle[self._link]

    def point(self, link: int, local: Any) -> Symbols:
        """World position of a point of a link, from the point of contact."""
        shifted: Symbols = self._dynamics.point_position(link, local) - self._origin
        return shifted

    def lowest(self, contact: int) -> Symbols:
        """World position of the lowest point of a contact disc, from the point of contact."""
        model = self.robot.model
        center = self.point(int(model.contact_link[contact]), model.contact_position[contact])
        bottom: Symbols = center - np.array([0.0, model.contact_radius[contact]])
        return bottom

    def jacobian(self, contact: int) -> Symbols:
        """Jacobian rows (x, z) of the lowest point of a contact disc, (2, nv)."""
        rows: Symbols = self._dynamics.point_jacobian(
            int(self.robot.model.contact_link[contact]), self.lowest(contact) + self._origin
        )[:2]
        return rows

    def mass_matrix(self) -> Symbols:
        """Mass matrix A(q), (nv, nv)."""
        return self._dynamics.mass_matrix()


class PointImpact:
    """Plastic impact of a point foot while the other one leaves without an impulse (eq. 20-22).

    Parameters
    ----------
    before : PointSupport
        The robot on its old stance foot at the instant of touchdown, moving.
    contact : int
        The contact point that lands.
    velocity : (nv - 2,) object array
        Velocities of pitch and joints after the impact.

    Attributes
    ----------
    v : (nv,) object array
        Velocity of all coordinates after the impact, with the landing point at rest.
    impulse_x, impulse_z : casadi.SX
        Impulse of the ground on the robot (N s).
    rest : (nv - 2,) object array
        Impulses that pitch and joints would need besides (N m s): zero for the true velocity.
    """

    def __init__(self, before: PointSupport, contact: int, velocity: Symbols) -> None:
        jacobian = before.jacobian(contact)
        self.v = pinned_point(jacobian, velocity, np.zeros(2))
        momentum = before.mass_matrix() @ (self.v - before.v)
        self.impulse_x, self.impulse_z, self.rest = point_reaction(jacobian, momentum)


def pinned_point(jacobian: Symbols, others: Symbols, target: NDArray[Any]) -> Symbols:
    """Complete the velocities (or accelerations) of pitch and joints so that J v = target.

    `jacobian` is (2, nv) with rows (x, z), `others` (nv - 2,), `target` (2,).
    """
    residual = target - jacobian[:, 2:] @ others
    return np.array(
        [residual[0] / jacobian[0, 0], residual[1] / jacobian[1, 1], *others], dtype=object
    )


def point_reaction(jacobian: Symbols, force: Symbols) -> tuple[Any, Any, Symbols]:
    """Force (x, z) at the pinned point that makes up that on the trunk, and what is left."""
    x, z = force[0] / jacobian[0, 0], force[1] / jacobian[1, 1]
    rest: Symbols = force[2:] - jacobian[:, 2:].T @ np.array([x, z], dtype=object)
    return x, z, rest
