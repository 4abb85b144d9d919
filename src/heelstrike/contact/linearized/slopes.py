"""Derivatives of gaps, places and velocities of contact points by the state, exact to rounding.

They are the gradients of the events of a walk, a gap or a sliding speed that vanishes, and those of
the equations that a standing robot obeys.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.contact.ground import Ground
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics.loops import count_rows
from heelstrike.dynamics.places import write_point_rows
from heelstrike.dynamics.queries.evaluation import joint_vector
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Integers
from heelstrike.robot.robot import Robot

if TYPE_CHECKING:
    import casadi


@dataclass(frozen=True, eq=False)
class ContactSlopes:
    """Derivatives by the state (q, v), each over nq + nv columns."""

    place: Floats
    """(nc, nq + nv) Of where along the ground the contact points are. A disc's does not roll with
    it."""
    gap: Floats
    """(nc, nq + nv) Of their gaps."""
    velocity: Floats
    """(nc, 2, nq + nv) Of their velocities (normal, tangent), those of discs with the turning."""
    loop: Floats
    loop_velocity: Floats
    """loop, loop_velocity: (k, nq + nv) Of what closed loops lack, and of its rate."""


def contact_slopes(
    robot: Robot, q: ArrayLike, v: ArrayLike, ground: Ground | None = None
) -> ContactSlopes:
    """Differentiate what contact points and loops do on ground that is one line.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) array
        State.
    ground : Ground, optional
        Level or sloping ground; ``Ground()`` by default.

    Returns
    -------
    ContactSlopes

    Raises
    ------
    RobotError
        If a vector has the wrong length.
    SimulationError
        If the ground is not one line.
    """
    traced = _slopes(robot, plane(ground)[0])
    found = np.array(traced(joint_vector(robot, "q", q), joint_vector(robot, "v", v)))
    nc, loops = robot.nc, count_rows(robot.model)
    place, gap, velocity, *closed = np.split(found, np.cumsum([nc, nc, 2 * nc, loops]))
    return ContactSlopes(place, gap, velocity.reshape(nc, 2, found.shape[1]), *closed)


def following(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    points: Sequence[int],
    leading: Sequence[int] | Integers,
) -> Floats:
    """Errors (δq, δv) of a robot on level ground, by those of some of its coordinates.

    Contact points stay in place and at rest, from which the errors of all others follow.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) array
        State.
    points : sequence of int
        The contact points. Redundant ones, such as heel and toe of one flat foot, are welcome.
    leading : sequence of k int
        The coordinates.

    Returns
    -------
    (nq + nv, 2 k) float
        Errors of all coordinates by errors of these, positions first.
    """
    size = robot.nq + robot.nv
    moving = contact_slopes(robot, q, v).velocity[list(points)].reshape(-1, size)
    # What stays where it is may move as it may be displaced: a disc at rest may roll.
    still = np.hstack([moving[:, robot.nq :], np.zeros((len(moving), robot.nv))])
    held, lead = np.vstack([still, moving]), both(robot, leading)
    follow = np.setdiff1d(np.arange(size), lead)
    errors = np.zeros((size, len(lead)))
    errors[lead] = np.eye(len(lead))
    errors[follow] = -np.linalg.lstsq(held[:, follow], held[:, lead])[0]
    return errors


def both(robot: Robot, coordinates: Sequence[int] | Integers) -> Integers:
    """Return where coordinates, then their velocities, are in a state (q, v)."""
    chosen = np.asarray(coordinates, dtype=np.int64)
    return np.concatenate([chosen, robot.nq + chosen])


def exchanged(robot: Robot, errors: Floats) -> Floats:
    """Return errors (nq + nv, m) of a robot that has a mirror image with its legs exchanged."""
    mirror = robot.mirror
    assert mirror is not None
    return np.vstack([mirror.velocity(each.T).T for each in np.split(errors, [robot.nq])])


def along_the_ground(ground: Ground) -> Floats:
    """Return the unit vector (x, z) along ground that is one line."""
    (nx, nz), _, _ = plane(ground)
    return np.array([nz, -nx])


def plane(ground: Ground | None) -> tuple[tuple[float, float], float, float]:
    """Return normal, friction and restitution of ground that is one line.

    Raises
    ------
    SimulationError
        If it is not.
    """
    terrain = (Ground() if ground is None else ground).model()
    if len(terrain.friction) > 1 or terrain.curved:
        raise SimulationError(
            "contact is linearised on level or sloping ground that is the same everywhere"
        )
    nx, nz = terrain.normal[0].tolist()
    return (nx, nz), float(terrain.friction[0]), float(terrain.restitution[0])


@lru_cache(maxsize=16)
def _slopes(robot: Robot, normal: tuple[float, float]) -> casadi.Function:
    """Jacobian by (q, v) of places, gaps, velocities, and of loops and their rates."""
    import casadi

    from heelstrike.dynamics.queries.symbolic import TracedDynamics, expression, symbols

    q, v = casadi.SX.sym("q", robot.nq), casadi.SX.sym("v", robot.nv)
    at = TracedDynamics(robot, symbols(q), symbols(v))
    model, up = at.model, np.array(normal)
    places, gaps, rows = [], [], []
    for i, link, center in at.contact_centers(None):
        two = at.zeros(2, model.nv)
        point = center - float(model.contact_radius[i]) * up
        at.run(write_point_rows, model, at.work, link, point, up, 0, two)
        places.append(up[1] * center[0] - up[0] * center[1])
        gaps.append(up[0] * center[0] + up[1] * center[1])
        rows += list(two)
    seen = [casadi.vertcat(*places, *gaps)]
    if rows:
        seen.append(expression(np.array(rows)) @ v)
    if count_rows(model):
        seen.append(casadi.vertcat(*at.loop_displacement()))
        seen.append(expression(np.array(at.loop_jacobian())) @ v)
    state = casadi.vertcat(q, v)
    slopes = casadi.densify(casadi.jacobian(casadi.vertcat(*seen), state))
    return casadi.Function("slopes", [q, v], [slopes])
