"""The robot standing on one foot, in symbols: its whole motion from that of what it may choose.

A flat foot is pinned to the ground, which turns the trunk's coordinates into functions of the
actuated ones (paper eq. 28-35) and the contact wrench and torques into functions of the motion
(eq. 36-37, inverse dynamics). On a point the ground exerts no moment, so the trunk's pitch stays a
coordinate of its own next to those of the joints, and one equation of motion is left that no motor
enters: its residual is the moment that the stance ankle would have to exert. A point foot with a
radius rolls.

Here the trunk's coordinates x, z, pitch are the first three, and follow from the others
(:mod:`heelstrike.dynamics.held`).
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics import kernels
from heelstrike.dynamics.queries.following import Drive, Joints
from heelstrike.dynamics.queries.held import HeldRobot, Place
from heelstrike.dynamics.queries.symbolic import TracedDynamics, traced
from heelstrike.gait.sole import Sole, leg
from heelstrike.robot.robot import Robot

Symbols = NDArray[Any]


class Support:
    """Motion, torques and ground wrench of a robot on one foot.

    Parameters
    ----------
    robot : Robot
        A floating robot whose joints are all actuated.
    sole : Sole
        The stance foot; the middle of its sole, or its point of contact, is the origin.
    drive : Drive
        Its joints: which have motors, and which follow from these.
    position, velocity, acceleration : (n,) object arrays
        Symbolic motion of the n coordinates that foot and loops leave free: on a point foot the
        trunk's pitch, and the driven joints.
    slope : float or symbol
        Angle (rad) at which the ground ascends ahead.

    Attributes
    ----------
    q, v : (nv,) object arrays
        Whole position and velocity.
    wrench : (sole.held,) object array
        Force of the ground on the robot at the origin (x, z) and, on a flat foot, its moment about
        +y there.
    missing : (3 - sole.held,) object array
        Moment (N m) missing in the equation of the trunk's pitch, on a point foot: zero in any
        motion that the robot can make.
    torque : (driven,) object array
        Actuator torques Γ at the driven joints, dampers and springs accounted for.
    """

    def __init__(
        self,
        robot: Robot,
        sole: Sole,
        drive: Drive,
        position: Symbols,
        velocity: Symbols,
        acceleration: Symbols | None = None,
        *,
        slope: Any = 0.0,
    ) -> None:
        self.robot = robot
        self.sole = sole
        cosine, sine = casadi.cos(slope), casadi.sin(slope)
        self.slope = slope
        self.ahead: Symbols = np.array([cosine, sine], dtype=object)
        self.up: Symbols = np.array([-sine, cosine], dtype=object)
        self._pitched = 3 - sole.held  # whether the pitch is one of the free coordinates
        self._joints = Joints(robot, drive, position[self._pitched :])
        posture = np.array([*position[: self._pitched], *self._joints.position], dtype=object)
        self._dynamics = TracedDynamics(robot, _posture(robot, sole, slope, posture))
        self._origin: Symbols = np.zeros(2, dtype=object)
        self._origin = self.place(sole)
        self._held = self.held(sole)
        self.q = self._dynamics.q.copy()
        # The dynamics above is evaluated with the trunk at its reference place, which keeps its
        # coordinates out of the expressions; what is told to the outside is shifted.
        for k in range(2):
            self.q[k] = self.q[k] - self._origin[k] / robot.model.axis[k, k + 1]
        self.v = self.moving(self._held, velocity)
        self._dynamics.v = self.v
        traced(kernels.link_velocities)(robot.model, self.v, self._dynamics.work)
        if acceleration is not None:
            self._solve_forces(acceleration)

    def held(self, sole: Sole) -> HeldRobot:
        """Hold a foot: the first coordinates follow from the others, whose loops are reckoned."""
        center = self._dynamics.point_position(sole.link, sole.point)
        place = Place(sole.link, self.place(sole) + self._origin, center, sole.held)
        return HeldRobot(self._dynamics, [place], dependent=range(sole.held), loops=False)

    def moving(self, held: HeldRobot, velocity: Symbols) -> Symbols:
        """Whole velocity (nv,) from that of the free coordinates, with a foot held that way."""
        first = self._pitched
        joints = self._joints.velocity(velocity[first:])
        return held.velocity(self._whole([*velocity[:first], *joints]))

    def _whole(self, free: list[Any]) -> Symbols:
        return np.array([*np.zeros(self.sole.held), *free], dtype=object)

    def free_force(self, rest: Symbols) -> Symbols:
        """Generalised force on the free coordinates, of one on pitch, if free, and all joints."""
        first, free = self._pitched, rest[self.sole.held :]
        return np.array([*free[:first], *self._joints.force(free[first:])], dtype=object)

    def _solve_forces(self, acceleration: Symbols) -> None:
        dynamics, first = self._dynamics, self._pitched
        joints = self._joints.acceleration(acceleration[first:], self.v[3:])
        a = self._held.acceleration(self._whole([*acceleration[:first], *joints]))
        force = dynamics.inverse_dynamics(a) - dynamics.passive_force()
        self.wrench, rest = self._held.reaction(force)
        self.missing, self.torque = np.split(self.free_force(rest), [first])

    @property
    def rolled(self) -> Any:
        """How far the point of contact is ahead of where it is when the foot is not turned."""
        return self.sole.radius * self.angle(self.sole)

    def place(self, sole: Sole) -> Symbols:
        """World position of the middle of a flat sole or of a disc's point nearest the ground."""
        center = self._dynamics.point_position(sole.link, sole.point)
        bottom: Symbols = center - sole.radius * self.up - self._origin
        return bottom

    def jacobian(self, sole: Sole) -> Symbols:
        """Jacobian rows (x, z and, of a flat foot, rotation) of that place, (held, nv)."""
        place = self.place(sole) + self._origin
        rows: Symbols = self._dynamics.point_jacobian(sole.link, place)[: sole.held]
        return rows

    def angle(self, sole: Sole) -> Any:
        """Rotation of a foot about +y, from where its sole is along the ground."""
        return self._dynamics.work.angle[sole.link] - sole.angle + self.slope

    def place_of(self, contact: int) -> tuple[Any, Any]:
        """Place of a contact disc along the plane of the ground, and its height over it."""
        _, center = self._disc(contact)
        place = center - self._origin
        return self.ahead @ place, self.up @ place - self.robot.model.contact_radius[contact]

    def rise(self, contact: int, v: Symbols) -> Any:
        """Velocity of a contact disc away from the ground, of the robot's velocity `v`, (nv,)."""
        return self.up @ (self._dynamics.point_jacobian(*self._disc(contact))[:2] @ v)

    def along_ground(self, wrench: Symbols) -> Symbols:
        """Force, or impulse, along the ground and away from it, of one in x and z; and moments."""
        return np.array([self.ahead @ wrench[:2], self.up @ wrench[:2], *wrench[2:]], dtype=object)

    def _disc(self, contact: int) -> tuple[int, Symbols]:
        """Link of a contact disc, and its centre."""
        model = self.robot.model
        link = int(model.contact_link[contact])
        return link, self._dynamics.point_position(link, model.contact_position[contact])

    def mass_matrix(self) -> Symbols:
        """Mass matrix A(q), (nv, nv)."""
        return self._dynamics.mass_matrix()


class Impact:
    """The plastic impact at touchdown (paper eq. 20-22 with restitution zero).

    The landing foot comes to rest, a flat one flat on the ground, while the other foot leaves
    without an impulse. With v⁺ prescribed by "the landing foot rests", eq. 22 becomes an inverse
    problem of the same form as that of the forces in single support: the momentum A (v⁺ − v⁻) that
    no joint can supply is the impulse of the ground, and what is left over must vanish.

    Parameters
    ----------
    before : Support
        The robot on its old stance foot at the instant of touchdown, moving.
    landing : Sole
        The foot that lands.
    velocity : (n,) object array
        Velocities after the impact of the coordinates that the foot leaves free.

    Attributes
    ----------
    v : (nv,) object array
        Velocity of all coordinates after the impact, with the landing foot at rest.
    impulse : (landing.held,) object array
        Impulse of the ground on the robot where the foot lands (x, z: N s; moment about +y: N m s).
    rest : (n,) object array
        Impulses that the free coordinates would need besides (N m s): all zero for the velocity
        that satisfies eq. 22.
    """

    def __init__(self, before: Support, landing: Sole, velocity: Symbols) -> None:
        held = before.held(landing)
        self.v = before.moving(held, velocity)
        momentum = before.mass_matrix() @ (self.v - before.v)
        self.impulse, rest = held.reaction(momentum)
        self.rest = before.free_force(rest)


def foot_angle(robot: Robot, sole: Sole, q: Symbols) -> Any:
    """Rotation about +y that the joints between trunk and foot make up."""
    model = robot.model
    return sum(model.axis[link, 0] * (q[link] - model.reference[link]) for link in leg(robot, sole))


def _posture(robot: Robot, sole: Sole, slope: Any, position: Symbols) -> Symbols:
    """Coordinates with the trunk at its reference place, pitched so that a flat foot is flat.

    Ground that ascends ahead turns it backwards, against the positive sense about +y.
    """
    model = robot.model
    q = np.array([*model.reference[: sole.held], *position], dtype=object)
    if sole.held == 3:
        missing = sole.angle - slope - foot_angle(robot, sole, q)
        q[2] = model.reference[2] + missing / model.axis[2, 0]
    return q
