"""The paper's optimisation as functions of finitely many unknowns (eq. 40-43 with 11-13, 20-22).

The unknowns of one step are the joint positions at its end, the joint velocities at both ends, its
duration and its length; the positions at its start are the mirror image of those at its end. All
functions are exact expressions traced from the dynamics kernels, with exact derivatives.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics.symbolic import expression, symbols
from heelstrike.gait import cubic
from heelstrike.gait.impact import Impact
from heelstrike.gait.request import Request
from heelstrike.gait.single_support import SingleSupport, Symbols

Floats = NDArray[np.float64]


LIFT_TOLERANCE = 1e-6
"""Velocity (m/s) into the ground that the rear foot may have after the impact. A foot whose toe is
driven down by whatever lifts its ankle can only leave from rest: without a tolerance its gaits
would be isolated points."""


class Group(enum.Enum):
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

    def __init__(self, text: str, unit: str) -> None:
        self.text = text
        self.unit = unit


@dataclass(frozen=True)
class Row:
    """One scaled constraint, ``lower <= expression <= upper``.

    Attributes
    ----------
    group : Group
        What it is about.
    subject : str
        Joint or contact point concerned, if any.
    lower, upper : float
        Bounds in scaled units.
    scale : float
        Size of the scaled unit in the unit of the group.
    """

    group: Group
    subject: str
    lower: float
    upper: float
    scale: float


@dataclass(frozen=True)
class Differentiable:
    """Constraints with first and second derivatives with respect to the unknowns.

    Attributes
    ----------
    rows : tuple of Row
        Meaning of every constraint.
    value : casadi.Function
        Cost and values.
    gradient : casadi.Function
        Cost and its gradient.
    jacobian : casadi.Function
        Values and their Jacobian.
    hessian : casadi.Function
        Upper triangle of the Hessian of the Lagrangian; its last argument holds the multipliers of
        the cost and of the constraints.

    Notes
    -----
    Constraints along the path are functions of the unknowns and the phase, and the cost is the
    integrand of the objective. Those at touchdown are functions of the unknowns, at no cost.
    """

    rows: tuple[Row, ...]
    value: casadi.Function
    gradient: casadi.Function
    jacobian: casadi.Function
    hessian: casadi.Function


class Constraints:
    """Expressions and their meaning, collected one by one."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.expressions: list[Any] = []

    def add(
        self,
        group: Group,
        value: Any,
        *,
        subject: str = "",
        lower: float = 0.0,
        upper: float = np.inf,
        unit: float = 1.0,
        scale: float = 1.0,
    ) -> None:
        """Add ``lower <= value <= upper``, in units of `unit`; `scale` converts to the group's."""
        self.rows.append(Row(group, subject, lower / unit, upper / unit, scale * unit))
        self.expressions.append(value / unit)


class Transcription:
    """Functions of the unknowns (q(T), v(T), v(0), T, L), each joint vector in coordinate order.

    Parameters
    ----------
    request : Request
        What is asked.

    Attributes
    ----------
    joints : int
        Number of actuated joints.
    path : Differentiable
        Constraints at a phase t / T in [0, 1] of the step, and the integrand of the objective.
    touchdown : Differentiable
        Constraints at the end of the step.
    motion : casadi.Function
        (unknowns, phase) to the scalars and vectors of the motion at that phase: foot wrench (x,
        z, moment), torques, heights of the swing foot's contact points, joint positions.
    start : casadi.Function
        Unknowns to the whole position and velocity at the beginning of the step.
    landing : casadi.Function
        Unknowns to the impulse (x, z, moment), and the vertical velocities of the landing contact
        points before and of the rear contact points after touchdown.
    """

    def __init__(self, request: Request) -> None:
        self.request = request
        self.robot = request.robot
        self.joints = self.robot.nv - 3
        self._unknowns = casadi.SX.sym("unknowns", 3 * self.joints + 2)
        entries = symbols(self._unknowns)
        self._end, self._end_velocity, self._start_velocity = np.split(entries[:-2], 3)
        self._duration, self._length = entries[-2:]
        self._build_path()
        self._build_touchdown()

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 3 * self.joints + 2

    def _mirrored(self, joints: Symbols, *, positions: bool) -> Symbols:
        """Mirror image of joint positions or velocities."""
        mirror = self.robot.mirror
        assert mirror is not None
        reference = self.robot.model.reference[3:] if positions else np.zeros(self.joints)
        counterpart = mirror.joint[3:] - 3
        return mirror.sign[3:] * (joints[counterpart] - reference[counterpart]) + reference

    def _polynomials(self) -> tuple[Any, Any, Any, Any]:
        return cubic.coefficients(
            expression(self._mirrored(self._end, positions=True)),
            expression(self._end),
            expression(self._start_velocity),
            expression(self._end_velocity),
            self._duration,
        )

    def _build_path(self) -> None:
        request, robot, model = self.request, self.robot, self.robot.model
        phase = casadi.SX.sym("phase")
        polynomials = self._polynomials()
        motion = [
            symbols(function(polynomials, phase * self._duration))
            for function in (cubic.position, cubic.velocity, cubic.acceleration)
        ]
        support = SingleSupport(robot, request.stance, *motion)
        heights = [
            support.point(request.swing.link, model.contact_position[i])[1]
            - model.contact_radius[i]
            for i in request.swing.contacts
        ]
        constraints = Constraints()
        self._add_forces(constraints, support)
        for i, height in zip(request.swing.contacts, heights, strict=True):
            constraints.add(Group.CLEARANCE, height, subject=robot.contact_names[i])
        add_joint_limits(constraints, self.request, motion[0], motion[1], support.torque)

        effort = self._duration * casadi.sumsqr(expression(support.torque))
        if request.free_step:
            effort = effort / self._length
        x = self._unknowns
        self.path = _differentiated(constraints, [x, phase], effort)
        self.motion = casadi.Function(
            "motion",
            [x, phase],
            [
                casadi.vertcat(support.force_x, support.force_z, support.moment),
                expression(support.torque),
                casadi.vertcat(*heights),
                expression(motion[0]),
            ],
        )
        at_start = casadi.Function(
            "state", [x, phase], [expression(support.q), expression(support.v)]
        )
        self.start = casadi.Function("start", [x], at_start(x, 0.0))

    def _add_forces(self, constraints: Constraints, support: SingleSupport) -> None:
        """Ground wrench unilateral, in the friction cone, centred inside the sole."""
        request = self.request
        weight = self.robot.weight
        constraints.add(
            Group.NORMAL_FORCE, support.force_z, lower=request.force_margin, unit=weight
        )
        self._add_cone(
            constraints,
            (support.force_x, support.force_z, support.moment),
            (Group.FRICTION, Group.ZERO_MOMENT_POINT),
            weight,
        )

    def _add_cone(
        self,
        constraints: Constraints,
        wrench: tuple[Any, Any, Any],
        groups: tuple[Group, Group],
        unit: float,
    ) -> None:
        """Friction cone and centre of pressure of a wrench, p_x = -m / f_z (paper eq. 44).

        The sign is that of a moment about +y, which a force f_z at x > 0 makes negative.
        """
        x, z, moment = wrench
        friction, half = self.request.friction, self.request.stance.half_length
        inside = half - self.request.zmp_margin
        for side, name in ((1.0, "forward"), (-1.0, "backward")):
            constraints.add(groups[0], friction * z - side * x, subject=name, unit=unit)
        for side, name in ((1.0, "toe"), (-1.0, "heel")):
            # A distance times a force; one unit of it is half a sole at `unit`.
            constraints.add(
                groups[1],
                inside * z + side * moment,
                subject=name,
                unit=half * unit,
                scale=1.0 / unit,
            )

    def _build_touchdown(self) -> None:
        request, robot, model = self.request, self.robot, self.robot.model
        swing = request.swing
        support = SingleSupport(robot, request.stance, self._end, self._end_velocity)
        after = self._mirrored(self._start_velocity, positions=False)
        impact = Impact(support, swing, after)
        before_x, before_z, before_turn = support.jacobian(swing.link, swing.point) @ support.v
        landing = [
            support.jacobian(swing.link, model.contact_position[i])[1] @ support.v
            for i in swing.contacts
        ]
        lift = [
            support.jacobian(request.stance.link, model.contact_position[i])[1] @ impact.v
            for i in request.stance.contacts
        ]

        constraints = Constraints()
        place = support.point(swing.link, swing.point)
        exact: dict[str, Any] = {"lower": 0.0, "upper": 0.0}
        constraints.add(Group.TOUCHDOWN_PLACE, place[0] - self._length, subject="x", **exact)
        constraints.add(Group.TOUCHDOWN_PLACE, place[1], subject="z", **exact)
        constraints.add(Group.TOUCHDOWN_ANGLE, support.angle(swing.link) - swing.angle, **exact)
        joint_names = robot.joint_names[3:]
        impulse = (impact.impulse_x, impact.impulse_z, impact.impulse_moment)
        if request.impact:
            unit = robot.weight
            for name, residual in zip(joint_names, impact.joint_impulse, strict=True):
                constraints.add(Group.IMPACT, residual, subject=name, unit=unit, **exact)
            constraints.add(Group.IMPULSE, impact.impulse_z, unit=unit)
            self._add_cone(
                constraints, impulse, (Group.IMPULSE_FRICTION, Group.IMPULSE_CENTER), unit
            )
            for i, speed in zip(swing.contacts, landing, strict=True):
                subject = robot.contact_names[i]
                constraints.add(Group.LANDING, speed, subject=subject, lower=-np.inf, upper=0.0)
            for i, speed in zip(request.stance.contacts, lift, strict=True):
                constraints.add(
                    Group.LIFT, speed, subject=robot.contact_names[i], lower=-LIFT_TOLERANCE
                )
        else:
            for subject, speed in (("x", before_x), ("z", before_z), ("turn", before_turn)):
                constraints.add(Group.REST, speed, subject=subject, **exact)
            for name, jump in zip(joint_names, after - self._end_velocity, strict=True):
                constraints.add(Group.PERIODIC, jump, subject=name, **exact)
        if request.speed is not None:
            speed = self._length / self._duration
            constraints.add(
                Group.SPEED, speed, lower=request.speed, upper=request.speed, unit=request.speed
            )
        x = self._unknowns
        self.touchdown = _differentiated(constraints, [x], casadi.SX(0))
        self.landing = casadi.Function(
            "landing",
            [x],
            [casadi.vertcat(*impulse), casadi.vertcat(*landing), casadi.vertcat(*lift)],
        )


def _differentiated(
    constraints: Constraints, arguments: list[casadi.SX], cost: casadi.SX
) -> Differentiable:
    """Functions of a cost and constraints with derivatives by the first argument."""
    x = arguments[0]
    stacked = casadi.cse(casadi.vertcat(cost, *constraints.expressions))
    cost, values = stacked[0], stacked[1:]
    multipliers = casadi.SX.sym("multipliers", stacked.numel())
    hessian, _ = casadi.hessian(casadi.dot(multipliers, stacked), x)
    return Differentiable(
        tuple(constraints.rows),
        casadi.Function("value", arguments, [cost, values]),
        casadi.Function("gradient", arguments, [cost, casadi.gradient(cost, x)]),
        casadi.Function("jacobian", arguments, [values, casadi.jacobian(values, x)]),
        casadi.Function("hessian", [*arguments, multipliers], [casadi.triu(hessian)]),
    )


def add_joint_limits(
    constraints: Constraints, request: Request, position: Any, velocity: Any, torque: Any
) -> None:
    """Add ranges, speeds and torques of the joints, where robot or request have limits.

    Positions, velocities and torques are those of the joints from the first leg on, without the
    floating base.
    """
    robot, model = request.robot, request.robot.model
    actuator = np.argsort(model.actuator_joint)
    for k in range(robot.nv - 3):
        name, j = robot.joint_names[k + 3], k + 3
        lower, upper = float(request.lower[j]), float(request.upper[j])
        if np.isfinite([lower, upper]).any():
            constraints.add(Group.JOINT_RANGE, position[k], subject=name, lower=lower, upper=upper)
        lower = float(model.torque_lower[actuator[k]])
        upper = float(model.torque_upper[actuator[k]])
        finite = [abs(limit) for limit in (lower, upper) if np.isfinite(limit)]
        if finite:
            unit = max(finite) or 1.0
            constraints.add(
                Group.TORQUE, torque[k], subject=name, lower=lower, upper=upper, unit=unit
            )
        limit = min(request.joint_speed_limit, float(model.speed_limit[j]))
        if np.isfinite(limit):
            constraints.add(
                Group.JOINT_SPEED, velocity[k], subject=name, lower=-limit, upper=limit, unit=limit
            )
