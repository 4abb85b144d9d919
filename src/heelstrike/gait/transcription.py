"""What a step costs and must satisfy at one instant and at touchdown (eq. 11-13, 20-22, 40).

The kind of the feet decides: a flat sole bears a moment of the ground as long as its centre stays
inside; on a point there is none, which is an equation along the path.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Any

import casadi
import numpy as np

from heelstrike.dynamics.queries.symbolic import expression, symbols
from heelstrike.gait.blocks import Block
from heelstrike.gait.cost_rate import heat_of, instant_of, rate_of
from heelstrike.gait.request import Request
from heelstrike.gait.request_digest import digest_of
from heelstrike.gait.rows import Kind, Limit, Rows, joint_limits
from heelstrike.gait.stairs import Stairs
from heelstrike.gait.support import Impact, Support, Symbols

LIFT_TOLERANCE = 1e-6
"""Velocity (m/s) into the ground that the rear foot may have after the impact. A foot whose toe is
driven down by whatever lifts its ankle can only leave from rest: without a tolerance its gaits
would be isolated points."""


class Group(Kind):
    """What a constraint is about, and its unit."""

    NORMAL_FORCE = ("normal force on the stance foot", "N")
    FRICTION = ("friction cone of the stance foot", "N")
    ANKLE = ("no moment on the point foot", "N m")
    ZERO_MOMENT_POINT = ("zero moment point inside the sole", "m")
    CLEARANCE = ("clearance of the swing foot", "m")
    JOINT_RANGE = ("joint range", "rad")
    JOINT_SPEED = ("joint speed limit", "rad/s")
    TORQUE = ("torque limit", "N m")
    TOUCHDOWN_PLACE = ("swing foot on the ground one step ahead", "m")
    TOUCHDOWN_ANGLE = ("swing foot flat at touchdown", "rad")
    LANDING = ("swing foot not rising at touchdown", "m/s")
    IMPACT = ("velocities periodic through the impact", "N m s")
    PERIODIC = ("velocities periodic", "rad/s")
    REST = ("swing foot at rest at touchdown", "m/s")
    IMPULSE = ("impulse pushing the landing foot up", "N s")
    IMPULSE_FRICTION = ("friction cone of the landing impulse", "N s")
    IMPULSE_CENTER = ("landing impulse inside the sole", "m")
    LIFT = ("rear foot free to lift", "m/s")
    SPEED = ("walking speed", "m/s")


class Transcription:
    """Functions of the motion of a robot on one foot, and of the landing on the other.

    The motion is that of the coordinates that stance foot and closed loops leave free: the joints
    with motors and, on a point foot, the trunk's pitch before them. Torques and ground forces
    follow from it (inverse dynamics), so that they are no unknowns. All functions are exact
    expressions traced from the dynamics kernels.

    Parameters
    ----------
    request : Request
        What is asked.

    Attributes
    ----------
    free : list of int
        The coordinates that foot and closed loops leave free.
    size : int
        Their number n.
    path_rows, touchdown_rows : list of Row
        Meaning of the constraints.
    ground : casadi.SX
        (2,) What all functions take last: the angle at which the ground ascends ahead (rad), and
        by how much the next foothold is above that plane (m).
    path : casadi.Function
        (q, v, a, length, ground), the first three (n,), to the rate of what is spent least of, and
        the scaled constraints along the path.
    effort : casadi.Function
        (q, v, a, length, ground) to ΓᵀΓ.
    motion : casadi.Function
        (q, v, a, length, ground) to the ground's wrench (along the ground, away from it and, on a
        flat foot, the moment), the torques, the heights of the swing foot's contact points and the
        positions of all joints.
    mirror : Mirror
        Exchange of left and right among the free coordinates.
    start : casadi.Function
        (q(T), v(0), ground) to the whole position and velocity at the beginning of the step, the
        stance foot at the origin.
    touchdown : casadi.Function
        (q(T), v(T), v(0), duration, length, ground) to the scaled constraints at the end of the
        step.
    landing : casadi.Function
        (q(T), v(T), v(0), ground) to the impulse (along the ground, away from it and, on a flat
        foot, the moment) and the velocities away from the ground of the landing contact points
        before and of the rear contact points after it.
    """

    def __init__(self, request: Request) -> None:
        self.request = request
        self.robot = request.robot
        self.held = request.stance.held
        self.free = [*range(self.held, 3), *request.drive.driven]
        self.size = len(self.free)
        self.mirror = request.mirror.among(self.free)
        self.ground = casadi.SX.sym("ground", 2)
        self._build_path()
        self._build_touchdown()

    @cache  # noqa: B019 - one of each transcription, which it goes with
    def blocks(self, pieces: int) -> tuple[Block, Block]:
        """Blocks of a program: an instant of the path, and touchdown.

        Variables of both are positions and two of their derivatives in the time of a piece, of
        which there are so many a step; then duration and length of the step. The cost of an instant
        is what it adds to the effort or, if the step is free, to the effort per metre.
        """
        variables = casadi.SX.sym("y", 3 * self.size + 2)
        first, second, third = casadi.vertsplit(variables[:-2], self.size)
        duration, length = variables[-2], variables[-1]
        piece = duration / pieces
        effort, rows = self.path(first, second / piece, third / piece**2, length, self.ground)
        cost = duration * effort / (length if self.request.free_step else 1.0)
        landing = self.touchdown(
            first, second / piece, third / piece, duration, length, self.ground
        )
        return (
            Block("path", variables, self.ground, cost, rows),
            Block("touchdown", variables, self.ground, 0.0, landing),
        )

    def _build_path(self) -> None:
        request, robot = self.request, self.robot
        arguments = [casadi.SX.sym(name, self.size) for name in "qva"]
        q, v, a = (symbols(part) for part in arguments)
        slope, length = self.ground[0], casadi.SX.sym("length")
        support = Support(robot, request.stance, request.drive, q, v, a, slope=slope)
        pressure = support.along_ground(support.wrench)
        arguments += [length, self.ground]
        stairs = Stairs(length, self.ground[1])
        heights = [stairs.height(*support.place_of(i)) for i in request.swing.contacts]
        weight = robot.weight
        constraints = Rows()
        for moment in support.missing:
            constraints.add(Group.ANKLE, moment, upper=0.0, unit=weight * request.height)
        constraints.add(Group.NORMAL_FORCE, pressure[1], lower=request.force_margin, unit=weight)
        self._add_cone(constraints, pressure, (Group.FRICTION, Group.ZERO_MOMENT_POINT), weight)
        for i, height in zip(request.swing.contacts, heights, strict=True):
            constraints.add(Group.CLEARANCE, height, subject=robot.contact_names[i])
        _add_joint_limits(constraints, request, support)
        self.path_rows = constraints.rows
        torque = expression(support.torque)
        stacked = casadi.cse(
            casadi.vertcat(self._rate(support, pressure), *constraints.expressions)
        )
        self.path = casadi.Function("path", arguments, [stacked[0], stacked[1:]])
        self.effort = casadi.Function("effort", arguments, [casadi.sumsqr(torque)])
        wrench = expression(pressure)
        self.motion = casadi.Function(
            "motion",
            arguments,
            [wrench, torque, casadi.vertcat(*heights), expression(support.q[3:])],
        )

    def _rate(self, support: Support, pressure: Symbols) -> Any:
        """What an instant costs, a second."""
        request, model = self.request, self.robot.model
        actuators = model.actuator_joint.tolist()
        now = instant_of(support, pressure, list(request.drive.driven), actuators)
        unit = self.robot.weight * request.height / request.pendulum_time
        return rate_of(request.cost, now, heat_of(model), unit)

    def _add_cone(
        self,
        constraints: Rows,
        wrench: Symbols,
        groups: tuple[Group, Group],
        unit: float,
    ) -> None:
        """Friction cone of a wrench and, on a flat foot, its centre p_x = -m / f_z (eq. 44).

        Here x is along the ground and z away from it. The sign is that of a moment about +y, which
        a force f_z at x > 0 makes negative.
        """
        x, z, *moments = wrench
        friction, half = self.request.cone, self.request.stance.half_length
        inside = half - self.request.zmp_margin
        for side, name in ((1.0, "forward"), (-1.0, "backward")):
            constraints.add(groups[0], friction * z - side * x, subject=name, unit=unit)
        for moment, (side, name) in product(moments, ((1.0, "toe"), (-1.0, "heel"))):
            # A distance times a force; one unit of it is half a sole at `unit`.
            constraints.add(
                groups[1],
                inside * z + side * moment,
                subject=name,
                unit=half * unit,
                scale=1.0 / unit,
            )

    def _build_touchdown(self) -> None:
        request, robot = self.request, self.robot
        q, v, v_start = moving = [casadi.SX.sym(name, self.size) for name in ("q", "v", "v_start")]
        duration, length = casadi.SX.sym("duration"), casadi.SX.sym("length")
        q_start, after = self.mirror.position(symbols(q)), self.mirror.velocity(symbols(v_start))
        drive, ground = request.drive, self.ground
        slope, rise = ground[0], ground[1]
        start = Support(robot, request.stance, drive, q_start, symbols(v_start), slope=slope)
        self.start = casadi.Function(
            "start", [q, v_start, ground], [expression(start.q), expression(start.v)]
        )
        end = Support(robot, request.stance, drive, symbols(q), symbols(v), slope=slope)
        impact = Impact(end, request.swing, after)
        impulse = end.along_ground(impact.impulse)
        landing = [end.rise(i, end.v) for i in request.swing.contacts]
        lift = [end.rise(i, impact.v) for i in request.stance.contacts]
        self.landing = casadi.Function(
            "landing",
            [*moving, ground],
            [expression(impulse), casadi.vertcat(*landing), casadi.vertcat(*lift)],
        )
        constraints = Rows()
        place = end.place(request.swing)
        ahead = end.ahead @ place + end.rolled - start.rolled - length
        constraints.add(Group.TOUCHDOWN_PLACE, ahead, subject="x", upper=0.0)
        constraints.add(Group.TOUCHDOWN_PLACE, end.up @ place - rise, subject="z", upper=0.0)
        if request.swing.flat:
            constraints.add(Group.TOUCHDOWN_ANGLE, end.angle(request.swing), upper=0.0)
        if request.impact:
            self._add_impact(constraints, impact.rest, impulse, landing, lift)
        else:
            before = end.jacobian(request.swing) @ end.v
            for subject, speed in zip(("x", "z", "turn"), before, strict=False):
                constraints.add(Group.REST, speed, subject=subject, upper=0.0)
            for j, jump in zip(self.free, after - symbols(v), strict=True):
                subject = robot.joint_names[j]
                constraints.add(Group.PERIODIC, jump, subject=subject, upper=0.0)
        if request.speed is not None:
            speed, unit = length / duration, request.speed
            constraints.add(Group.SPEED, speed, lower=unit, upper=unit, unit=unit)
        self.touchdown_rows = constraints.rows
        values = casadi.cse(casadi.vertcat(*constraints.expressions))
        step = [duration, length, ground]
        self.touchdown = casadi.Function("touchdown", [*moving, *step], [values])

    def _add_impact(
        self, constraints: Rows, rest: Symbols, impulse: Symbols, landing: list[Any],
        lift: list[Any],
    ) -> None:  # fmt: skip
        """Momentum balanced, impulse inside cone and sole, one foot coming down, one let go."""
        request, names, unit = self.request, self.robot.contact_names, self.robot.weight
        for j, residual in zip(self.free, rest, strict=True):
            name = self.robot.joint_names[j]
            constraints.add(Group.IMPACT, residual, subject=name, upper=0.0, unit=unit)
        constraints.add(Group.IMPULSE, impulse[1], unit=unit)
        groups = (Group.IMPULSE_FRICTION, Group.IMPULSE_CENTER)
        self._add_cone(constraints, impulse, groups, unit)
        for i, speed in zip(request.swing.contacts, landing, strict=True):
            constraints.add(Group.LANDING, speed, subject=names[i], lower=-np.inf, upper=0.0)
        for i, speed in zip(request.stance.contacts, lift, strict=True):
            constraints.add(Group.LIFT, speed, subject=names[i], lower=-LIFT_TOLERANCE)


_KEPT = 8
"""Robots and kinds of request whose functions are kept while the process runs."""
STEP = (
    "step_length", "step_duration", "clearance", "clearance_profile", "starts", "slope", "rise"
)  # fmt: skip
"""What of a request is no part of the functions."""

_transcribed: dict[tuple[bytes, bool], Transcription] = {}


def transcribed(request: Request) -> Transcription:
    """Return the functions of a request; those that differ by the step and its ground share them.

    Making them takes as long as an optimisation from a good start.
    """
    key = digest_of(request, without=STEP), request.free_step
    if callable(request.cost):  # nobody can tell whether two functions are the same
        return Transcription(request)
    if key not in _transcribed:
        while len(_transcribed) >= _KEPT:
            del _transcribed[next(iter(_transcribed))]
        _transcribed[key] = Transcription(request)
    return _transcribed[key]


def _add_joint_limits(constraints: Rows, request: Request, support: Support) -> None:
    """Add ranges, speeds, torques and motors of the joints, where robot or request have limits."""
    groups = {
        Limit.RANGE: Group.JOINT_RANGE, Limit.SPEED: Group.JOINT_SPEED, Limit.TORQUE: Group.TORQUE
    }  # fmt: skip
    for limit, value, bounds in joint_limits(
        request.robot, support.q, support.v,
        dict(zip(request.drive.driven, support.torque, strict=True)),
        (request.lower, request.upper),
        np.minimum(request.joint_speed_limit, request.robot.model.speed_limit),
    ):  # fmt: skip
        constraints.add(groups[limit], value, **bounds)
