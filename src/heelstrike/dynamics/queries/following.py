"""Joints without a motor that closed loops and couplings drive, as functions of those with one.

The equations φ(q) = 0 of the loops, solved for the joints d that follow, give positions; with
J = ∂φ/∂q, velocities ``v_d = D v_i`` and accelerations ``v̇_d = D v̇_i − J_d⁻¹ J̇ v``, where
``D = −J_d⁻¹ J_i``. By the principle of virtual work a generalised force f of all joints acts on the
driven ones as ``f_i + Dᵀ f_d``: so the forces of the loops, which do no work, are gone.

Positions come of Newton's method, written out in symbols: a step of it at each of some places on
the straight way from where the robot stands in its reference, and some more at the end. So they are
those of the assembly that it stands in, and derivatives of what they converge to those of φ(q) = 0.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics.queries.loops import loop_jacobian
from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot

Symbols = NDArray[Any]

TRUNK = 3
"""Coordinates of the trunk, which loops within the robot leave alone."""

WAY, END = 8, 4
"""Steps of Newton's method on the way and at its end: for joints some two radians away."""

INDEPENDENT = 1e-9
"""Pivots of the loops' Jacobian below this count as zero, relative to the largest."""


@dataclass(frozen=True)
class Drive:
    """Which joints of a floating robot have a motor, and which follow from these."""

    driven: tuple[int, ...]
    following: tuple[int, ...]
    """driven, following: Coordinates of the joints, in the order of the robot."""
    rows: tuple[int, ...]
    """Equations of the loops that say where the latter are."""


def drive_of(robot: Robot) -> Drive:
    """Tell which joints of a floating robot have a motor, and which follow from these.

    Raises
    ------
    RobotError
        If the loops leave a joint without motor free, or bind those with one to each other.
    """
    model = robot.model
    driven = tuple(sorted(set(model.actuator_joint.tolist())))
    following = tuple(j for j in range(TRUNK, robot.nv) if j not in driven)
    if not following:
        if model.loops + model.couplings:
            raise RobotError(
                f"robot {robot.name!r}: every joint has a motor, and "
                f"{', '.join([*robot.loop_names, *robot.coupling_names])} connect them."
            )
        return Drive(driven, (), ())
    from scipy.linalg import qr  # for robots with such joints alone

    names = ", ".join(robot.joint_names[j] for j in following)
    jacobian = loop_jacobian(robot, robot.closed(robot.reference_state()).q)
    own, order = qr(jacobian[:, following].T, mode="r", pivoting=True)
    size = np.abs(np.diag(own))
    rank = int(np.sum(size > INDEPENDENT * size.max(initial=0.0)))
    whole = int(np.linalg.matrix_rank(jacobian, tol=INDEPENDENT * max(size.max(initial=1.0), 1.0)))
    if rank < len(following):
        raise RobotError(
            f"robot {robot.name!r}: these joints have no motor: {names}. Closed loops and "
            f"couplings leave {len(following) - rank} of them free."
        )
    if whole > rank:
        raise RobotError(
            f"robot {robot.name!r}: closed loops and couplings connect driven joints with each "
            f"other, and not only with those without a motor: {names}."
        )
    return Drive(driven, following, tuple(sorted(order[:rank].tolist())))


class Joints:
    """All joints of a robot by those with a motor, in one posture, in symbols.

    Parameters
    ----------
    robot : Robot
        The robot, which floats.
    drive : Drive
        Its joints.
    position : (driven,) object array
        Where the driven joints are.

    Attributes
    ----------
    position : (nv - 3,) object array
        Where all joints are.
    """

    def __init__(self, robot: Robot, drive: Drive, position: Symbols) -> None:
        self._robot, self._drive = robot, drive
        self.position: Symbols = position
        if drive.following:
            import casadi

            from heelstrike.dynamics.queries.symbolic import expression, symbols

            given = casadi.SX.sym("driven", len(drive.driven))
            there = casadi.SX.sym("following", len(drive.following))
            own, _, open_by = self._equations(self._joined(symbols(given), symbols(there)))
            step = casadi.Function("step", [given, there], [there - casadi.solve(own, open_by)])
            begin = robot.closed(robot.reference_state()).q
            found = casadi.SX(begin[list(drive.following)])
            away = expression(position) - begin[list(drive.driven)]
            for part in [*np.linspace(0.0, 1.0, WAY + 1)[1:], *np.ones(END)]:
                found = step(begin[list(drive.driven)] + part * away, found)
            self.position = self._joined(position, symbols(found))

    def _joined(self, driven: Symbols, following: Symbols) -> Symbols:
        joints = np.empty(self._robot.nv - TRUNK, dtype=object)
        for places, values in (
            (self._drive.driven, driven), (self._drive.following, following)
        ):  # fmt: skip
            for place, value in zip(places, values, strict=True):
                joints[place - TRUNK] = value
        return joints

    def _state(self, joints: Symbols) -> Symbols:
        trunk = self._robot.model.reference[:TRUNK]
        return np.array([*trunk, *joints], dtype=object)

    def _equations(self, joints: Symbols) -> tuple[Any, Any, Any]:
        """J_d and J_i of the equations that count, and by how much these are open."""
        import casadi

        from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression

        at = TracedDynamics(self._robot, self._state(joints))
        rows = list(self._drive.rows)
        jacobian = at.loop_jacobian()[rows]
        parts = (
            casadi.sparsify(expression(jacobian[:, list(places)]))
            for places in (self._drive.following, self._drive.driven)
        )
        return *parts, expression(at.loop_displacement()[rows])

    @cached_property
    def _slopes(self) -> tuple[Any, Any]:
        """J_d and D."""
        import casadi

        own, others, _ = self._equations(self.position)
        return own, -casadi.solve(own, others)

    def velocity(self, driven: Symbols) -> Symbols:
        """Velocities of all joints, (nv - 3,), from those of the driven ones."""
        if not self._drive.following:
            return driven
        from heelstrike.dynamics.queries.symbolic import expression, symbols

        return self._joined(driven, symbols(self._slopes[1] @ expression(driven)))

    def acceleration(self, driven: Symbols, velocity: Symbols) -> Symbols:
        """Accelerations of all joints, (nv - 3,), at the velocities (nv - 3,) of all."""
        if not self._drive.following:
            return driven
        import casadi

        from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols

        own, slope = self._slopes
        moving = np.array([0.0] * TRUNK + [*velocity], dtype=object)
        at = TracedDynamics(self._robot, self._state(self.position), moving)
        drift = expression(at.loop_bias_acceleration()[list(self._drive.rows)])
        along = slope @ expression(driven) - casadi.solve(own, drift)
        return self._joined(driven, symbols(along))

    def force(self, joints: Symbols) -> Symbols:
        """Generalised force on the driven joints, (driven,), of one on all, (nv - 3,)."""
        if not self._drive.following:
            return joints
        from heelstrike.dynamics.queries.symbolic import expression, symbols

        own, others = (
            joints[[place - TRUNK for place in places]]
            for places in (self._drive.driven, self._drive.following)
        )
        return symbols(expression(own) + self._slopes[1].T @ expression(others))
