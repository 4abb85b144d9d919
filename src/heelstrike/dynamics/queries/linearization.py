"""The linear system that a robot is in the neighbourhood of a state, exactly."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.queries.evaluation import contact_indices, joint_vector
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot

if TYPE_CHECKING:
    import casadi

    from heelstrike.dynamics.spatial.queries.linearization import SpatialLinearization


@dataclass(frozen=True, eq=False)
class Linearization:
    """d/dt (δq, δv) = A (δq, δv) + B δΓ about a state and torque."""

    A: Floats
    """(nq + nv, nq + nv) Derivative of (v, v̇) with respect to (q, v)."""
    B: Floats
    """(nq + nv, nu) Derivative of (v, v̇) with respect to the joint torques."""
    state_derivative: Floats
    """(nq + nv,) (v, v̇) at the state itself, zero at an equilibrium."""
    contact_force: Floats
    """(k, 2) Force (normal, tangent) of the ground on the robot at the held contact points, in
    N."""
    contact_force_state: Floats
    """(k, 2, nq + nv) Its derivative with respect to (q, v)."""
    contact_force_torque: Floats
    """(k, 2, nu) Its derivative with respect to the joint torques."""


@overload
def linearize(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    torque: ArrayLike,
    *,
    contacts: Iterable[int | str] = (),
) -> Linearization: ...


@overload
def linearize(
    robot: SpatialRobot,
    q: ArrayLike,
    v: ArrayLike,
    torque: ArrayLike,
    *,
    contacts: Iterable[int | str] = (),
) -> SpatialLinearization: ...


def linearize(
    robot: Robot | SpatialRobot,
    q: ArrayLike,
    v: ArrayLike,
    torque: ArrayLike,
    *,
    contacts: Iterable[int | str] = (),
) -> Linearization | SpatialLinearization:
    """Linearise the equations of motion about a state, with derivatives exact to rounding.

    The derivatives come from the traced kernels (algorithmic differentiation), not from
    differences. Dampers and springs are part of the system; closed loops and couplings hold.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot.
    q, v : (nq,) and (nv,) array
        State.
    torque : (nu,) array
        Joint torques.
    contacts : iterable of int or str
        Contact points (index or name) that the ground holds: they neither leave level ground nor
        slide, discs roll. The constraint is J v̇ + J̇v = 0, so that A also tells how the velocity of
        a perturbation that breaks the contact would go on. Redundant points, such as heel and toe
        of one flat foot, are welcome: A and B are unique, forces are those of least norm.

    Returns
    -------
    Linearization or SpatialLinearization
        A, B, and the same for the contact forces.

    Raises
    ------
    RobotError
        If a vector has the wrong length or there is no such contact point.
    """
    if isinstance(robot, SpatialRobot):
        from heelstrike.dynamics.spatial.queries.linearization import linearize_in_space

        return linearize_in_space(robot, q, v, torque, contacts=contacts)
    held = contact_indices(robot, contacts)
    position, velocity = joint_vector(robot, "q", q), joint_vector(robot, "v", v)
    gamma = joint_vector(robot, "torque", torque)
    n, k = robot.nv, 2 * len(held)
    solution, by_state, by_torque = implicit_motion(
        *_equations(robot, held), (position, velocity), gamma
    )
    upper = np.hstack([np.zeros((n, n)), np.eye(n)])
    return Linearization(
        A=np.vstack([upper, by_state[:n]]),
        B=np.vstack([np.zeros((n, robot.nu)), by_torque[:n]]),
        state_derivative=np.concatenate([velocity, solution[:n]]),
        contact_force=solution[n : n + k].reshape(-1, 2),
        contact_force_state=by_state[n : n + k].reshape(len(held), 2, 2 * n),
        contact_force_torque=by_torque[n : n + k].reshape(len(held), 2, robot.nu),
    )


def implicit_motion(
    equations: casadi.Function, derivatives: casadi.Function, state: tuple[Floats, ...],
    torque: Floats,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Solve equations of motion for accelerations and forces, and differentiate what they tell.

    Parameters
    ----------
    equations : casadi.Function
        What must vanish, of the state, (v̇, λ) and Γ.
    derivatives : casadi.Function
        Its Jacobians by (v̇, λ), the state and Γ.
    state : tuple of float arrays
        The state, (q, v) say; its last part is the velocity.
    torque : (nu,) float
        Γ.

    Returns
    -------
    tuple of float arrays
        (v̇, λ), and its derivatives by the state and Γ.
    """
    n, nothing = len(state[-1]), np.zeros(equations.size1_in(len(state)))
    system = np.array(derivatives(*state, nothing, torque)[0])
    constant = np.array(equations(*state, nothing, torque)).reshape(-1, 1)
    solution = solved(system, -constant, n)[:, 0]
    slopes = [np.array(part) for part in derivatives(*state, solution, torque)]
    # Implicit differentiation: the equations stay satisfied.
    rates = solved(system, -np.hstack(slopes[1:]), n)
    by_state, by_torque = np.split(rates, [slopes[1].shape[1]], axis=1)
    return solution, by_state, by_torque


def solved(system: Floats, right: Floats, n: int) -> Floats:
    """Solve for n accelerations or velocities, which are unique, and the least forces.

    The first are scaled by the mass matrix's diagonal, so that light links count as heavy ones.
    """
    scale = np.ones(len(system))
    scale[:n] = 1.0 / np.sqrt(np.abs(np.diag(system)[:n]))
    scaled = scale[:, None] * system * scale
    solution = np.linalg.lstsq(scaled, scale[:, None] * right, rcond=1e-12)[0]
    return np.asarray(scale[:, None] * solution, np.float64)


@lru_cache(maxsize=32)
def _equations(robot: Robot, contacts: tuple[int, ...]) -> tuple[casadi.Function, casadi.Function]:
    """Equations of motion, contact and loops as functions of (q, v, (v̇, λ), Γ), and Jacobians.

    The Jacobians are those with respect to (v̇, λ), (q, v) and Γ.
    """
    import casadi

    from heelstrike.dynamics.queries.casadi_functions import CasadiDynamics

    held, loops = robot.nv + 2 * len(contacts), count_rows(robot.model)
    sizes = {"q": robot.nq, "v": robot.nv, "unknown": held + loops}
    arguments = [casadi.SX.sym(name, size) for name, size in (sizes | {"torque": robot.nu}).items()]
    q, v, unknown, torque = arguments
    equations = CasadiDynamics(robot).contact_equations(contacts)
    pull = [unknown[held:]] if loops else []
    residual = equations(q, v, unknown[: robot.nv], unknown[robot.nv : held], torque, *pull)
    return implicit_functions(arguments, residual, (unknown, casadi.vertcat(q, v), torque))


def implicit_functions(
    arguments: Sequence[casadi.SX], residual: casadi.SX, by: Sequence[casadi.SX]
) -> tuple[casadi.Function, casadi.Function]:
    """Return what must vanish as a function of its arguments, and its Jacobians by others."""
    import casadi

    jacobians = [casadi.densify(casadi.jacobian(residual, each)) for each in by]
    return (
        casadi.Function("equations", arguments, [residual]),
        casadi.Function("derivatives", arguments, jacobians),
    )
