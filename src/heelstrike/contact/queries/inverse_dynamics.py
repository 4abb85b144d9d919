"""Which torques and contact forces make a robot on the ground accelerate as it should."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import one_of, takes
from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.force_distribution import ForceDistribution, distribute
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics import inverse_dynamics, loop_jacobian, passive_force
from heelstrike.dynamics.queries.evaluation import contact_indices, joint_vector
from heelstrike.errors import ContactProblemError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Integers
from heelstrike.robot.motors import torque_range
from heelstrike.robot.robot import Robot
from heelstrike.tolerances import STANDING_GAP

RELATIVE = 1e-9
"""Shares of the largest generalised force below which a violation is rounding."""


@dataclass(frozen=True, eq=False)
class ContactInverseDynamics:
    """Torques and contact forces for an acceleration, and why it is impossible."""

    torque: Floats
    """(nu,) Torques of the actuators, in the order of ``robot.actuator_names`` (N m, N for a
    slide)."""
    contact_force: Floats
    """(nc, 2) Force (normal, tangent) of the ground on the robot at each contact point, in N; zero
    at points that do not carry."""
    loop_force: Floats
    """(2 loops + couplings,) Forces of closed loops (x, z, in N) and couplings (N m, N for a slide)
    along their rows."""
    missing_force: Floats
    """(nv,) Generalised force that neither motors, ground nor loops can supply, in N and N m: zero
    if the acceleration is possible."""
    friction_use: Floats
    """(nc,) |tangential| / (μ · normal) of every point: above 1 it would slip, infinite where it
    pulls or has a tangential force alone; 0 at points without force."""
    pulling: np.ndarray[tuple[int], np.dtype[np.bool_]]
    """(nc,) Whether the ground would have to pull at the point."""
    torque_excess: Floats
    """(nu,) By how much each torque exceeds what its motor can give at v, in N m; zero within."""
    contact_acceleration: Floats
    """(nc, 2) Acceleration of the gap and of the sliding velocity of every contact point, in m/s²:
    zero at carrying points if the acceleration keeps them where they are."""
    feasible: bool
    """Whether the ground pushes, inside its friction cones, the torques are within their limits and
    nothing is missing."""
    message: str
    """Why the acceleration is impossible; empty if it is not."""


@takes(ContactProblemError)
def contact_inverse_dynamics(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    acceleration: ArrayLike,
    *,
    contacts: Iterable[int | str] | None = None,
    distribution: str | ForceDistribution = ForceDistribution.LEAST_NORM,
    ground: Ground | None = None,
) -> ContactInverseDynamics:
    """Joint torques and contact forces that yield an acceleration: SᵀΓ + Jᵀλ = A a + H − passive.

    Coordinates without a motor, such as those of a floating trunk, must be moved by the ground
    alone: their rows say what the contact forces have to make up. Where many forces do, as on two
    feet or along a flat sole, `distribution` says which to take; the torques follow. Dampers and
    springs are the passive forces; joint stops and dry friction do not act.

    Closed loops and couplings bear what they must: their forces are eliminated, being at right
    angles to all that they let happen. Where motors share a torque through them, or loops a force,
    theirs are those of least norm. That the acceleration keeps them is the caller's affair, too.

    Parameters
    ----------
    robot : Robot
        The robot, with a fixed or floating base.
    q, v, acceleration : (nq,), (nv,) and (nv,) array
        State and acceleration. That the acceleration keeps the contacts is the caller's affair;
        ``contact_acceleration`` of the result tells.
    contacts : iterable of int or str, optional
        Contact points (index or name) that carry. By default all that touch: gap below 1e-6 m.
    distribution : ForceDistribution or its name
        ``"least_norm"`` or ``"least_friction_use"``.
    ground : Ground, optional
        Level ground with friction 0.75 by default.

    Returns
    -------
    ContactInverseDynamics
        If no forces inside the friction cones will do, the forces of least norm are returned, with
        `feasible` false; if none at all will do, those that come nearest.

    Raises
    ------
    RobotError
        If a vector has the wrong length, or there is no such contact point.
    ContactProblemError
        If the distribution is not known.

    Examples
    --------
    >>> import heelstrike as hs
    >>> import numpy as np
    >>> robot = hs.load_robot("bravo7")
    >>> standing = hs.contact_inverse_dynamics(
    ...     robot, robot.reference_state().q, np.zeros(9), np.zeros(9), contacts=range(4)
    ... )
    >>> standing.feasible, bool(np.isclose(standing.contact_force[:, 0].sum(), robot.weight))
    (True, True)
    """
    choice = one_of(ForceDistribution, "distribution", distribution, ContactProblemError)
    kinematics = contact_kinematics(robot, q, v, ground)
    touching = np.flatnonzero(kinematics.gap < STANDING_GAP)
    carrying = list(contact_indices(robot, touching if contacts is None else contacts))
    a = joint_vector(robot, "acceleration", acceleration)
    force = inverse_dynamics(robot, q, v, a) - passive_force(robot, q, v)
    driven = robot.model.actuator_joint
    rows = kinematics.jacobian[carrying].reshape(2 * len(carrying), robot.nv)
    split = _without_loops if not robot.model.loops + robot.model.couplings else _with_loops
    forces, torque, loop_force, rest = split(
        loop_jacobian(robot, q), driven, rows, kinematics.friction[carrying], choice, force
    )

    contact_force = np.zeros((robot.nc, 2))
    contact_force[carrying] = forces
    tiny = RELATIVE * max(1.0, float(np.abs(force).max()))
    use = _friction_use(contact_force, kinematics.friction, tiny)
    lower, upper = torque_range(robot.model, v)
    excess = np.maximum(np.maximum(torque - upper, lower - torque), 0.0)
    pulling = contact_force[:, 0] < -tiny
    complaints = [
        *(f"{robot.joint_names[j]} lacks {rest[j]:.3g}" for j in _where(np.abs(rest) > tiny)),
        *(f"the ground would have to pull at {robot.contact_names[i]}" for i in _where(pulling)),
        *(
            f"{robot.contact_names[i]} would slip (friction use {use[i]:.3g})"
            for i in _where((use > 1.0 + RELATIVE) & ~pulling)
        ),
        *(
            f"{robot.actuator_names[k]} exceeds its torque limit by {excess[k]:.3g}"
            for k in _where(excess > tiny)
        ),
    ]
    return ContactInverseDynamics(
        torque=torque,
        contact_force=contact_force,
        loop_force=loop_force,
        missing_force=rest,
        friction_use=use,
        pulling=pulling,
        torque_excess=excess,
        contact_acceleration=kinematics.jacobian @ a + kinematics.bias_acceleration,
        feasible=not complaints,
        message="; ".join(complaints),
    )


def _without_loops(
    loops: Floats, driven: Integers, rows: Floats, friction: Floats, choice: ForceDistribution,
    force: Floats,
) -> tuple[Floats, Floats, Floats, Floats]:  # fmt: skip
    """Forces of the ground, torques, none of loops, and what is missing of a generalised force."""
    idle = np.setdiff1d(np.arange(force.size), driven)
    forces, _ = distribute(rows[:, idle].T, force[idle], friction, choice)
    rest = force - rows.T @ forces.ravel()
    torque = rest[driven]
    rest[driven] = 0.0
    return forces, torque, np.zeros(len(loops)), rest


def _with_loops(
    loops: Floats, driven: Integers, rows: Floats, friction: Floats, choice: ForceDistribution,
    force: Floats,
) -> tuple[Floats, Floats, Floats, Floats]:  # fmt: skip
    """Like :func:`_without_loops`, in the ways that the loops leave open."""
    from scipy.linalg import null_space  # what walks without loops begins sooner without

    allowed = null_space(loops)
    idle = allowed @ null_space(allowed[driven])
    forces, _ = distribute((rows @ idle).T, idle.T @ force, friction, choice)
    rest = force - rows.T @ forces.ravel()
    torque = np.linalg.lstsq(allowed[driven].T, allowed.T @ rest, rcond=None)[0]
    rest[driven] -= torque
    loop_force: Floats = np.linalg.lstsq(loops.T, rest, rcond=None)[0].astype(np.float64)
    return forces, torque, loop_force, rest - loops.T @ loop_force


def _friction_use(force: Floats, friction: Floats, tiny: float) -> Floats:
    """Share of the friction cone in use; nothing where there is no force."""
    normal, tangent = force.T
    cone = friction * normal
    use = np.full(normal.size, np.inf)
    np.divide(np.abs(tangent), cone, out=use, where=cone > 0.0)
    # A tangential force that is rounding beside the load neither slips nor uses anything.
    use[(np.abs(tangent) <= tiny) & (normal >= -tiny)] = 0.0
    return use


def _where(condition: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[int]:
    return [int(i) for i in np.flatnonzero(condition)]
