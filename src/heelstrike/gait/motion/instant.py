"""A robot at one instant of a motion, and at a touchdown, in symbols (paper eq. 1-5, 20-22).

All contact points may push: what a phase does not use is zero by its bounds. So one set of
functions serves all phases of a robot.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from heelstrike.dynamics import center_of_mass, contact_positions
from heelstrike.dynamics.places import write_point_rows
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols
from heelstrike.gait.blocks import Block
from heelstrike.gait.cost import Instant, OwnConstraint
from heelstrike.gait.cost_rate import heat_of, own_expression, rate_of
from heelstrike.gait.motion.rows import Kind
from heelstrike.gait.rows import Limit, Rows, joint_limits
from heelstrike.robot.robot import Robot

Symbols = Any


class MotionFunctions:
    """Functions of a robot whose contact points stand, or not, on level or sloping ground.

    The parameters of both blocks are the slope of the ground (rad) and the coefficient of friction.
    Forces of points are (away from the ground, along it), point by point.

    Parameters
    ----------
    robot : Robot
        The robot.
    cost : dict or function
        What :func:`~heelstrike.gait.cost.costs_of` returned.
    constraint : function, optional
        Of an instant, expressions that are not to be negative.
    per_metre : bool
        Whether the cost is divided by the distance that the motion covers.

    Attributes
    ----------
    path : Block
        Variables are positions and two of their derivatives by the share of a piece, (nv,) each,
        forces of all contact points, (2 nc,), places where they stand, (nc,), duration of a piece
        (s), distance (m), time since the beginning of the motion (s). The cost is its rate times
        the duration of a piece.
    path_rows : list of Row
        What its constraints mean.
    effort : casadi.Function
        The same variables and parameters to ΓᵀΓ times the duration of a piece.
    landing : Block
        Variables are positions, (nq,), velocities before in shares of the last piece and after it
        in shares of the next, (nv,) each, impulses, (2 nc,), durations of both pieces (s).
    landing_rows : list of Row
        What its constraints mean.
    """

    def __init__(
        self, robot: Robot, cost: Any, *, per_metre: bool, constraint: OwnConstraint | None = None
    ) -> None:
        self.robot, self.cost, self.per_metre = robot, cost, per_metre
        self.constraint = constraint
        self.slope, self.friction = casadi.SX.sym("slope"), casadi.SX.sym("friction")
        self.along: Symbols = np.array([casadi.cos(self.slope), casadi.sin(self.slope)])
        self.up: Symbols = np.array([-self.along[1], self.along[0]])
        self.gravity = float(np.hypot(*robot.model.gravity))
        self.length = size_of(robot)
        self.second = float(np.sqrt(self.length / self.gravity))
        self._build_path()
        self._build_landing()

    def _points(self, dynamics: TracedDynamics) -> tuple[Symbols, Symbols, Symbols]:
        """Heights, (nc,), rows (normal, tangent), (2 nc, nv), and their J̇v, (2 nc,)."""
        model = self.robot.model
        heights, rows, bias = [], dynamics.zeros(2 * model.nc, model.nv), []
        for i, link, center in dynamics.contact_centers(None):
            radius = model.contact_radius[i]
            heights.append(self.up @ center - radius)
            lowest = center - radius * self.up
            dynamics.run(
                write_point_rows, model, dynamics.work, link, lowest, self.up, 0,
                rows[2 * i : 2 * i + 2],
            )  # fmt: skip
            # The gap and the sliding velocity of a disc that rolls are those of its centre.
            moved = dynamics.bias_acceleration(link, center)[:2]
            bias += [self.up @ moved, self.along @ moved]
        return np.array(heights, dtype=object), rows, np.array(bias, dtype=object)

    def place(self, dynamics: TracedDynamics, contact: int) -> Any:
        """Where a point stands along the ground (m): a disc rolls, and where it began to counts."""
        ((_, link, center),) = dynamics.contact_centers([contact])
        turned = dynamics.work.angle[link]
        return self.along @ center - self.robot.model.contact_radius[contact] * turned

    def _build_path(self) -> None:
        robot, model = self.robot, self.robot.model
        n, weight = robot.nv, robot.weight
        y = casadi.SX.sym("y", 3 * (n + robot.nc) + 3)
        places = y[-3 - robot.nc : -3]
        q, first, second, force = casadi.vertsplit(
            y[: -3 - robot.nc], [0, n, 2 * n, 3 * n, 3 * n + 2 * robot.nc]
        )
        duration, distance, time = y[-3], y[-2], y[-1]
        v, a = first / duration, symbols(second / duration**2)
        dynamics = TracedDynamics(robot, symbols(q), symbols(v))
        heights, jacobian, bias = self._points(dynamics)
        pushes = symbols(force)
        needed = dynamics.inverse_dynamics(a) - dynamics.passive_force() - jacobian.T @ pushes
        speeds, accelerations = jacobian @ dynamics.v, jacobian @ a + bias
        actuated = model.actuator_joint
        torque = needed[actuated]
        rows = Rows()
        for j in np.setdiff1d(np.arange(n), actuated).tolist():
            unit = weight * (self.length if model.axis[j, 0] else 1.0)
            rows.add(Kind.MOTION, needed[j], subject=robot.joint_names[j], upper=0.0, unit=unit)
        for i, name in enumerate(robot.contact_names):
            for k, kind in enumerate((Kind.NORMAL_REST, Kind.TANGENT_REST)):
                unit = self.gravity
                rows.add(kind, accelerations[2 * i + k], subject=name, upper=0.0, unit=unit, of=i)
            for k, kind in enumerate((Kind.NORMAL_STILL, Kind.TANGENT_STILL)):
                rows.add(kind, speeds[2 * i + k], subject=name, upper=0.0, of=i)
            away = self.place(dynamics, i) - places[i]
            rows.add(Kind.PLACE, away, subject=name, upper=0.0, of=i)
        self._add_cones(rows, pushes, (Kind.PUSH, Kind.FRICTION), weight)
        for i, name in enumerate(robot.contact_names):
            rows.add(Kind.HEIGHT, heights[i], subject=name, of=i)
        self._add_limits(rows, dynamics, torque)
        centers = np.array([center for _, _, center in dynamics.contact_centers(None)])
        now = Instant(
            position=q,
            velocity=v,
            torque=expression(torque),
            motor_velocity=expression(dynamics.v[actuated]),
            force=expression(np.array([sum(pushes[1::2]), sum(pushes[0::2])], dtype=object)),
            acceleration=expression(a),
            time=time,
            points=casadi.horzcat(expression(centers @ self.along), expression(heights)),
        )
        if self.constraint is not None:
            own = own_expression("constraint", self.constraint, now)
            for k, value in enumerate(casadi.vertsplit(casadi.vec(own)), start=1):
                rows.add(Kind.OWN, value, subject=f"number {k}")
        self.path_rows = rows.rows
        rate = rate_of(self.cost, now, heat_of(model), weight * self.length / self.second)
        cost = duration * rate / (casadi.fabs(distance) if self.per_metre else 1.0)
        parameters = casadi.vertcat(self.slope, self.friction)
        self.path = Block("path", y, parameters, cost, casadi.vertcat(*rows.expressions))
        effort = duration * casadi.sumsqr(now.torque)
        self.effort = casadi.Function("effort", [y, parameters], [effort])

    def _add_cones(
        self, rows: Rows, pushes: Symbols, kinds: tuple[Kind, Kind], unit: float
    ) -> None:
        """Every point pushes, and the points of a foot together stay in its friction cone."""
        robot = self.robot
        for i, name in enumerate(robot.contact_names):
            rows.add(kinds[0], pushes[2 * i], subject=name, unit=unit, of=i)
        for contacts, name in links_with_points(robot):
            normal = sum(pushes[2 * i] for i in contacts)
            tangent = sum(pushes[2 * i + 1] for i in contacts)
            for side in (1.0, -1.0):
                cone = self.friction * normal - side * tangent
                rows.add(kinds[1], cone, subject=name, unit=unit, of=contacts)

    def _add_limits(self, rows: Rows, dynamics: TracedDynamics, torque: Symbols) -> None:
        model = self.robot.model
        kinds = {Limit.RANGE: Kind.RANGE, Limit.SPEED: Kind.SPEED, Limit.TORQUE: Kind.TORQUE}
        for limit, value, bounds in joint_limits(
            self.robot, dynamics.q, dynamics.v,
            dict(zip(model.actuator_joint.tolist(), torque, strict=True)),
            (model.lower, model.upper), model.speed_limit,
        ):  # fmt: skip
            rows.add(kinds[limit], value, **bounds)

    def _build_landing(self) -> None:
        robot = self.robot
        n, weight = robot.nv, robot.weight
        y = casadi.SX.sym("y", 3 * n + 2 * robot.nc + 2)
        q, before, after, impulse = casadi.vertsplit(y[:-2], [0, n, 2 * n, 3 * n, y.numel() - 2])
        before, after, pushes = symbols(before / y[-2]), symbols(after / y[-1]), symbols(impulse)
        dynamics = TracedDynamics(robot, symbols(q), before)
        heights, jacobian, _ = self._points(dynamics)
        momentum = dynamics.mass_matrix() @ (after - before) - jacobian.T @ pushes
        arriving, leaving = jacobian @ before, jacobian @ after
        rows = Rows()
        for j, name in enumerate(robot.joint_names):
            rows.add(Kind.MOMENTUM, momentum[j], subject=name, upper=0.0, unit=weight)
        for i, name in enumerate(robot.contact_names):
            rows.add(Kind.TOUCH, heights[i], subject=name, upper=0.0, of=i)
            rows.add(Kind.ARRIVE, arriving[2 * i], subject=name, lower=-np.inf, upper=0.0, of=i)
            rows.add(Kind.NORMAL_STOP, leaving[2 * i], subject=name, upper=0.0, of=i)
            rows.add(Kind.TANGENT_STOP, leaving[2 * i + 1], subject=name, upper=0.0, of=i)
            rows.add(Kind.LEAVE, leaving[2 * i], subject=name, lower=-LEAVING, of=i)
        self._add_cones(rows, pushes, (Kind.IMPULSE, Kind.IMPULSE_FRICTION), weight * self.second)
        self.landing_rows = rows.rows
        parameters = casadi.vertcat(self.slope, self.friction)
        zero = casadi.SX(0)
        self.landing = Block("landing", y, parameters, zero, casadi.vertcat(*rows.expressions))


def size_of(robot: Robot) -> float:
    """Height (m) of the centre of mass over the lowest contact point, as the robot stands."""
    q = robot.reference_state().q
    lowest = contact_positions(robot, q)[:, 1] - robot.model.contact_radius
    return float(center_of_mass(robot, q)[1] - lowest.min())


LEAVING = 1e-6
"""Velocity (m/s) into the ground that a point may have that leaves it at an impact."""


def links_with_points(robot: Robot) -> list[tuple[tuple[int, ...], str]]:
    """Return the contact points of every link that has some, and a name of it."""
    links = robot.model.contact_link
    names = {foot.link: foot.name for foot in robot.feet}
    found = []
    for link in dict.fromkeys(links.tolist()):
        contacts = tuple(np.flatnonzero(links == link).tolist())
        found.append((contacts, names.get(link, robot.link_names[link])))
    return found
