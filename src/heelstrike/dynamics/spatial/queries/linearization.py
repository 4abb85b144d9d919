"""The linear system that a robot in space is in the neighbourhood of a state, exactly."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.queries import equations_of_motion
from heelstrike.dynamics.queries.evaluation import contact_indices, joint_vector
from heelstrike.dynamics.queries.linearization import implicit_functions, implicit_motion
from heelstrike.dynamics.spatial import configurations
from heelstrike.dynamics.spatial.queries import points
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation, position_vector
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import BALL, FREE
from heelstrike.robot.spatial.robot import SpatialRobot

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True, eq=False)
class SpatialLinearization:
    """d/dt (δq, δv) = A (δq, δv) + B δΓ about a state and torque of a robot in space.

    δq (nv,) is the velocity that takes the position of the state, as it moves on, to another in a
    unit of time, as :func:`heelstrike.dynamics.difference` finds it: turns are in body axes.
    """

    A: Floats
    """(2 nv, 2 nv) Derivative of the rates of (δq, δv) with respect to (δq, δv)."""
    B: Floats
    """(2 nv, nu) Their derivative with respect to the joint torques."""
    state_derivative: Floats
    """(2 nv,) (v, v̇) at the state itself, zero at an equilibrium."""
    contact_force: Floats
    """(k, 3) Force (normal, t1, t2) of the ground on the robot at the held contact points, in N."""
    contact_force_state: Floats
    """(k, 3, 2 nv) Its derivative with respect to (δq, δv)."""
    contact_force_torque: Floats
    """(k, 3, nu) Its derivative with respect to the joint torques."""


def linearize_in_space(
    robot: SpatialRobot,
    q: ArrayLike,
    v: ArrayLike,
    torque: ArrayLike,
    *,
    contacts: Iterable[int | str] = (),
) -> SpatialLinearization:
    """Linearise the equations of motion; see :func:`heelstrike.dynamics.linearize`."""
    held = contact_indices(robot, contacts)
    position, velocity = position_vector(robot, "q", q), joint_vector(robot, "v", v)
    gamma = joint_vector(robot, "torque", torque)
    n, k = robot.nv, len(held)
    solution, by_state, by_torque = implicit_motion(
        *_equations(robot, held), (position, np.zeros(n), velocity), gamma
    )
    upper = np.hstack([-_turning(robot, velocity), np.eye(n)])
    return SpatialLinearization(
        A=np.vstack([upper, by_state[:n]]),
        B=np.vstack([np.zeros((n, robot.nu)), by_torque[:n]]),
        state_derivative=np.concatenate([velocity, solution[:n]]),
        contact_force=solution[n:].reshape(k, 3),
        contact_force_state=by_state[n:].reshape(k, 3, 2 * n),
        contact_force_torque=by_torque[n:].reshape(k, 3, robot.nu),
    )


def _turning(robot: SpatialRobot, v: Floats) -> Floats:
    """What the turning of body axes does to δq: ω × on the turns of every free or ball joint."""
    result = np.zeros((robot.nv, robot.nv))
    model = robot.model
    inside = {FREE: 3, BALL: 0}
    for kind, first in zip(model.joint_kind.tolist(), model.first_velocity.tolist(), strict=True):
        if kind in inside:
            own = slice(first + inside[kind], first + inside[kind] + 3)
            x, y, z = v[own]
            result[own, own] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return result


@lru_cache(maxsize=8)
def _equations(
    robot: SpatialRobot, contacts: tuple[int, ...]
) -> tuple[casadi.Function, casadi.Function]:
    """Equations of motion and contact as functions of (q, δq, v, (v̇, λ), Γ), and Jacobians.

    The Jacobians are those with respect to (v̇, λ), (δq, v) and Γ.
    """
    import casadi

    from heelstrike.dynamics.queries.symbolic import expression, symbols

    n, count = robot.nv, robot.nv + 3 * len(contacts)
    sizes = {"q": robot.nq, "change": n, "v": n, "unknown": count, "torque": robot.nu}
    arguments = [casadi.SX.sym(name, size) for name, size in sizes.items()]
    q, change, v, unknown, torque = (symbols(each) for each in arguments)
    start = SpatialEvaluation(robot, q)
    moved = start.filled((robot.nq,), configurations.integrate, robot.model, q, change, 1.0)
    at = SpatialEvaluation(robot, moved, v)
    force = equations_of_motion.inverse_dynamics.at(at, unknown[:n])
    residual: list[Any] = list(force - equations_of_motion.applied_force.at(at, torque))
    if contacts:
        jacobian = points.contact_jacobian.at(at, contacts).reshape(-1, n)
        pull = unknown[n:]
        residual = [each - jacobian[:, k] @ pull for k, each in enumerate(residual)]
        bias = points.contact_bias_acceleration.at(at, contacts).ravel()
        residual += [row @ unknown[:n] + more for row, more in zip(jacobian, bias, strict=True)]
    made = expression(np.array(residual, dtype=object))
    state = casadi.vertcat(arguments[1], arguments[2])
    return implicit_functions(arguments, made, (arguments[3], state, arguments[4]))
