"""A robot at one instant of a motion, and at a touchdown, in symbols (paper eq. 1-5, 20-22).

All contact points may push: what a phase does not use is zero by its bounds. So one set of
functions serves all phases of a robot.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from heelstrike.dynamics import center_of_mass, contact_positions
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.places import write_point_rows
from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols
from heelstrike.gait.blocks import Block
from heelstrike.gait.cost import Instant, OwnConstraint
from heelstrike.gait.cost_rate import (
    heat_of,
    own_expression,
    powers_of,
    rate_of,
    smooth_rate_of,
)
from heelstrike.gait.motion.rows import Kind
from heelstrike.gait.rows import Limit, Row, Rows, joint_limits
from heelstrike.robot.loops import row_names
from heelstrike.robot.robot import Robot

Symbols = Any


class MotionFunctions:
    """Functions of a robot whose contact points stand, or not, on level or sloping ground.

    The parameters of both blocks are the slope of the ground (rad) and the coefficient of friction.
    Forces of points are (away from the ground, along it), point by point; those of closed loops and
    coupled joints come after them, row by row.

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
        forces of all contact points and loops, (forces,), places where the points stand, (nc,), and
        which do, (nc,), duration of a piece (s), distance (m), time since the beginning of the
        motion (s), share of the phase that has gone by; then, if `rated`, the third derivative of
        positions, (nv,), and the first of forces, (forces,), by the share of a piece. The cost is
        its rate times the duration of a piece.
    path_rows : list of Row
        What its constraints mean.
    rated : bool
        Whether the cost or a constraint of one's own depends on the rates of torques.
    jumps : (rows,) array of bool
        Which of its constraints do, so that they jump where pieces join.
    joining : Block or None
        If so, of the variables of the path at the end of a piece and then at the beginning of the
        next. The constraints are equations: the torques are the same.
    joining_rows : list of Row
        What its constraints mean.
    spending : Block or None
        For costs with corners, as |P| has one: variables are those of the path and, for each of the
        powers, a bound of what every motor spends, in units of the robot's weight times its
        `length` per `second`. The cost is theirs, and its
        constraints keep each above both powers of which the greater is spent. So nothing is
        rounded off, and derivatives are exact. It is None if no cost has corners.
    spending_rows : list of Row
        What its constraints mean.
    rounded : Block or None
        Likewise without such bounds: of the variables of the path, with corners rounded off. It
        leads near an optimum where the other one finds none.
    effort : casadi.Function
        The same variables and parameters to ΓᵀΓ times the duration of a piece.
    landing : Block
        Variables are positions, (nq,), velocities before in shares of the last piece and after it
        in shares of the next, (nv,) each, impulses, (forces,), durations of both pieces (s).
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
        self.loops = count_rows(robot.model)
        self.forces = 2 * robot.nc + self.loops
        self._build_path()
        self._build_landing()

    def place(self, dynamics: TracedDynamics, contact: int) -> Any:
        """Where a point stands along the ground (m): a disc rolls, and where it began to counts."""
        ((_, link, center),) = dynamics.contact_centers([contact])
        turned = dynamics.work.angle[link]
        return self.along @ center - self.robot.model.contact_radius[contact] * turned

    def _build_path(self) -> None:
        robot, model = self.robot, self.robot.model
        n, weight = robot.nv, robot.weight
        sizes = [n, n, n, self.forces, robot.nc, robot.nc, 4, n, self.forces]
        parts = [casadi.SX.sym("y", size) for size in sizes]
        q, first, second, force, places, stands, times, third, force_rate = parts
        duration, distance, time, share = casadi.vertsplit(times)
        v, a = first / duration, symbols(second / duration**2)
        dynamics = TracedDynamics(robot, symbols(q), symbols(v))
        heights, jacobian, bias = point_rows(dynamics, self.up, self.along)
        tied, tied_bias = dynamics.loop_jacobian(), dynamics.loop_bias_acceleration()
        pushes, pulls = np.split(symbols(force), [2 * robot.nc])
        needed = dynamics.inverse_dynamics(a) - dynamics.passive_force()
        needed = needed - jacobian.T @ pushes - tied.T @ pulls
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
        for kind, values, unit in (
            (Kind.LOOP_REST, tied @ a + tied_bias, self.gravity),
            (Kind.LOOP_STILL, tied @ dynamics.v, 1.0),
            (Kind.LOOP_CLOSED, dynamics.loop_displacement(), 1.0),
        ):
            for name, value in zip(row_names(robot), values, strict=True):
                rows.add(kind, value, subject=name, upper=0.0, unit=unit)
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
            point_force=casadi.horzcat(expression(pushes[0::2]), expression(pushes[1::2])),
            stands=stands,
            share=share,
            torque_rate=casadi.SX.sym("torque_rate", robot.nu),
        )
        if self.constraint is not None:
            own = own_expression("constraint", self.constraint, now)
            for k, value in enumerate(casadi.vertsplit(casadi.vec(own)), start=1):
                rows.add(Kind.OWN, value, subject=f"number {k}")
        self.path_rows = rows.rows
        by = duration / (casadi.fabs(distance) if self.per_metre else 1.0)
        parameters = casadi.vertcat(self.slope, self.friction)
        cost = by * smooth_rate_of(self.cost, now)
        limits = casadi.vertcat(*rows.expressions)
        self.jumps = np.array(casadi.which_depends(limits, now.torque_rate, 1, True))
        self.rated = bool(self.jumps.any() or casadi.depends_on(cost, now.torque_rate))
        y = casadi.vertcat(*(parts if self.rated else parts[:-2]))
        self.joining: Block | None = None
        self.joining_rows: list[Row] = []
        if self.rated:
            changed = casadi.jtimes(
                now.torque, casadi.vertcat(q, first, second, force),
                casadi.vertcat(first, second, third, force_rate),
            ) / duration  # fmt: skip
            cost, limits = casadi.substitute([cost, limits], [now.torque_rate], [changed])
            self._build_joining(y, parameters, now.torque)
        self.path = Block("path", y, parameters, cost, limits)
        self._build_spending(y, parameters, by, now)
        effort = duration * casadi.sumsqr(now.torque)
        self.effort = casadi.Function("effort", [y, parameters], [effort])

    def _build_joining(self, y: Any, parameters: Any, torque: Any) -> None:
        """Let torques go on from one piece to the next."""
        robot, rows = self.robot, Rows()
        before, after = (casadi.SX.sym("y", y.numel()) for _ in range(2))
        torques = casadi.Function("torque", [y, parameters], [torque])
        jump = torques(before, parameters) - torques(after, parameters)
        for i, j in enumerate(robot.model.actuator_joint.tolist()):
            unit = robot.weight * (self.length if robot.model.axis[j, 0] else 1.0)
            rows.add(Kind.JOIN, jump[i], subject=robot.joint_names[j], upper=0.0, unit=unit)
        given, jumps = casadi.vertcat(before, after), casadi.vertcat(*rows.expressions)
        self.joining = Block("joining", given, parameters, casadi.SX(0), jumps)
        self.joining_rows = rows.rows

    def _build_spending(self, y: Any, parameters: Any, by: Any, now: Instant) -> None:
        """Bound what motors spend; `by` is what a rate counts."""
        unit = self.robot.weight * self.length / self.second
        found = powers_of(self.cost, now, heat_of(self.robot.model))
        self.powers = len(found) * self.robot.nu
        bounds = casadi.SX.sym("spent", self.powers)
        rows, cost = Rows(), casadi.SX(0)
        for k, (weight, _, *powers) in enumerate(found):
            spent = bounds[k * self.robot.nu : (k + 1) * self.robot.nu]
            cost += by * weight * unit * casadi.sum1(spent)
            for power in powers:
                for i, name in enumerate(self.robot.actuator_names):
                    value = spent[i] * unit - power[i]
                    rows.add(Kind.POWER, value, subject=name, unit=unit)
        self.spending, self.spending_rows, self.rounded = None, rows.rows, None
        if found:
            given, limits = casadi.vertcat(y, bounds), casadi.vertcat(*rows.expressions)
            self.spending = Block("spending", given, parameters, cost, limits)
            rate = rate_of(self.cost, now, heat_of(self.robot.model), unit)
            rate -= smooth_rate_of(self.cost, now)
            self.rounded = Block("rounded", y, parameters, by * rate, casadi.SX(0))

    def _add_cones(
        self, rows: Rows, pushes: Symbols, kinds: tuple[Kind, Kind], unit: float
    ) -> None:
        """Every point pushes, and the points of a foot together stay in its friction cone."""
        robot, scale = self.robot, self.robot.model.friction_scale.tolist()
        for i, name in enumerate(robot.contact_names):
            rows.add(kinds[0], pushes[2 * i], subject=name, unit=unit, of=i)
        for contacts, name in links_with_points(robot):
            normal = sum(scale[i] * pushes[2 * i] for i in contacts)
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
        y = casadi.SX.sym("y", 3 * n + self.forces + 2)
        q, before, after, impulse = casadi.vertsplit(y[:-2], [0, n, 2 * n, 3 * n, y.numel() - 2])
        before, after = symbols(before / y[-2]), symbols(after / y[-1])
        pushes, pulls = np.split(symbols(impulse), [2 * robot.nc])
        dynamics = TracedDynamics(robot, symbols(q), before)
        heights, jacobian, _ = point_rows(dynamics, self.up, self.along)
        tied = dynamics.loop_jacobian()
        momentum = dynamics.mass_matrix() @ (after - before) - jacobian.T @ pushes - tied.T @ pulls
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
        for name, value in zip(row_names(robot), tied @ after, strict=True):
            rows.add(Kind.LOOP_STOP, value, subject=name, upper=0.0)
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


def point_rows(
    dynamics: TracedDynamics, up: Symbols, along: Symbols
) -> tuple[Symbols, Symbols, Symbols]:
    """Heights of contact points, (nc,), rows (normal, tangent), (2 nc, nv), their J̇v, (2 nc,).

    Parameters
    ----------
    dynamics : TracedDynamics
        The robot.
    up, along : (2,) array
        Directions away from the ground and along it.
    """
    model = dynamics.model
    heights, rows, bias = [], dynamics.zeros(2 * model.nc, model.nv), []
    for i, link, center in dynamics.contact_centers(None):
        radius = model.contact_radius[i]
        heights.append(up @ center - radius)
        lowest = center - radius * up
        dynamics.run(
            write_point_rows, model, dynamics.work, link, lowest, up, 0, rows[2 * i : 2 * i + 2]
        )
        # The gap and the sliding velocity of a disc that rolls are those of its centre.
        moved = dynamics.bias_acceleration(link, center)[:2]
        bias += [up @ moved, along @ moved]
    return np.array(heights, dtype=object), rows, np.array(bias, dtype=object)


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
