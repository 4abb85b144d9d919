"""A step on point feet as functions of the motion at one instant, and at touchdown.

The motion is that of the trunk's pitch and of the joints. Along the path there is one equation, the
stance ankle exerts no moment, beside the inequalities of any gait; torques and ground forces follow
from the motion (inverse dynamics), so that they are no unknowns.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from heelstrike.dynamics.symbolic import expression, symbols
from heelstrike.gait.point_support import PointImpact, PointSupport
from heelstrike.gait.request import Request
from heelstrike.gait.transcription import LIFT_TOLERANCE, Constraints, Group, add_joint_limits


class PointTranscription:
    """Functions of the motion of a robot on point feet.

    Parameters
    ----------
    request : Request
        What is asked.

    Attributes
    ----------
    size : int
        Number n of coordinates, pitch and joints.
    path_rows, touchdown_rows : list of Row
        Meaning of the constraints.
    path : casadi.Function
        (q, v, a), each (n,), to ΓᵀΓ and the scaled constraints along the path.
    touchdown : casadi.Function
        (angle of the stance link at the start, q(T), v(T), v after the impact, mirrored back, step
        length) to the scaled constraints at touchdown.
    motion : casadi.Function
        (q, v, a) to ground force (x, z), torques, height of the swing foot, ankle moment.
    landing : casadi.Function
        (q(T), v(T), v after the impact) to the impulse (x, z) and the vertical velocities of the
        landing foot before and the rear foot after the impact.
    state : casadi.Function
        (q, v) to the whole position and velocity, the point of contact at the origin.
    roll : casadi.Function
        q to how far the stance foot has rolled.
    """

    def __init__(self, request: Request) -> None:
        self.request = request
        self.robot = request.robot
        self.size = self.robot.nv - 2
        self.stance = int(request.stance.contacts[0])
        self.swing = int(request.swing.contacts[0])
        self._build_path()
        self._build_touchdown()

    def mirrored(self, vector: Any, *, positions: bool) -> Any:
        """Mirror image of positions or velocities of pitch and joints, numbers or symbols."""
        mirror = self.robot.mirror
        assert mirror is not None
        counterpart = (mirror.joint[2:] - 2).tolist()
        sign: Any = mirror.sign[2:]
        offset: Any = np.zeros(self.size)
        if positions:
            reference = self.robot.model.reference[2:]
            offset = reference - sign * reference[counterpart]
        if not isinstance(vector, np.ndarray):
            sign, offset = casadi.DM(sign), casadi.DM(offset)
        return sign * vector[counterpart] + offset

    def _build_path(self) -> None:
        request, robot = self.request, self.robot
        q, v, a = (casadi.SX.sym(name, self.size) for name in "qva")
        support = PointSupport(robot, self.stance, symbols(q), symbols(v), symbols(a))
        weight = robot.weight
        constraints = Constraints()
        constraints.add(
            Group.ANKLE, support.ankle, lower=0.0, upper=0.0, unit=weight * request.height
        )
        constraints.add(
            Group.NORMAL_FORCE, support.force_z, lower=request.force_margin, unit=weight
        )
        for side, name in ((1.0, "forward"), (-1.0, "backward")):
            inside = request.friction * support.force_z - side * support.force_x
            constraints.add(Group.FRICTION, inside, subject=name, unit=weight)
        height = support.lowest(self.swing)[1]
        constraints.add(Group.CLEARANCE, height, subject=robot.contact_names[self.swing])
        add_joint_limits(constraints, request, symbols(q)[1:], symbols(v)[1:], support.torque)
        self.path_rows = constraints.rows
        torque = expression(support.torque)
        stacked = casadi.cse(casadi.vertcat(casadi.sumsqr(torque), *constraints.expressions))
        self.path = casadi.Function("path", [q, v, a], [stacked[0], stacked[1:]])
        self.motion = casadi.Function(
            "motion",
            [q, v, a],
            [casadi.vertcat(support.force_x, support.force_z), torque, height, support.ankle],
        )
        self.state = casadi.Function(
            "state", [q, v], [expression(support.q), expression(support.v)]
        )
        self.roll = casadi.Function("roll", [q], [casadi.SX(support.rolled)])

    def _build_touchdown(self) -> None:
        request, robot = self.request, self.robot
        q, v, after = (casadi.SX.sym(name, self.size) for name in ("q", "v", "after"))
        roll, length = casadi.SX.sym("roll"), casadi.SX.sym("length")
        support = PointSupport(robot, self.stance, symbols(q), symbols(v))
        impact = PointImpact(support, self.swing, symbols(after))
        landing = support.jacobian(self.swing)[1] @ support.v
        lift = support.jacobian(self.stance)[1] @ impact.v
        constraints = Constraints()
        exact: dict[str, Any] = {"lower": 0.0, "upper": 0.0}
        x, z = support.lowest(self.swing)
        ahead = x + support.rolled - roll - length
        constraints.add(Group.TOUCHDOWN_PLACE, ahead, subject="x", **exact)
        constraints.add(Group.TOUCHDOWN_PLACE, z, subject="z", **exact)
        if request.impact:
            unit = robot.weight
            for name, residual in zip(robot.joint_names[2:], impact.rest, strict=True):
                constraints.add(Group.IMPACT, residual, subject=name, unit=unit, **exact)
            constraints.add(Group.IMPULSE, impact.impulse_z, unit=unit)
            for side, name in ((1.0, "forward"), (-1.0, "backward")):
                inside = request.friction * impact.impulse_z - side * impact.impulse_x
                constraints.add(Group.IMPULSE_FRICTION, inside, subject=name, unit=unit)
            constraints.add(Group.LANDING, landing, lower=-np.inf, upper=0.0)
            constraints.add(Group.LIFT, lift, lower=-LIFT_TOLERANCE)
        else:
            before = support.jacobian(self.swing) @ support.v
            for subject, speed in zip("xz", before, strict=True):
                constraints.add(Group.REST, speed, subject=subject, **exact)
            for k, name in enumerate(robot.joint_names[2:]):
                constraints.add(Group.PERIODIC, after[k] - v[k], subject=name, **exact)
        self.touchdown_rows = constraints.rows
        self.touchdown = casadi.Function(
            "touchdown", [roll, q, v, after, length], [casadi.vertcat(*constraints.expressions)]
        )
        self.landing = casadi.Function(
            "landing",
            [q, v, after],
            [casadi.vertcat(impact.impulse_x, impact.impulse_z), casadi.vertcat(landing, lift)],
        )
