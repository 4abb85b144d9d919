"""What a robot on the ground does next: accelerations and contact forces under given torques."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import takes
from heelstrike.contact.certificate import Certificate
from heelstrike.contact.ground import Ground
from heelstrike.contact.modes import OPEN, SLIDING_BACKWARD, SLIDING_FORWARD, ContactMode, Solver
from heelstrike.contact.problem import run_solvers, solver_order
from heelstrike.contact.queries.kinematics import ContactKinematics, contact_kinematics
from heelstrike.contact.sets import CONE, LINE
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics import (
    applied_force,
    bias_force,
    loop_bias_acceleration,
    loop_jacobian,
    mass_matrix,
)
from heelstrike.errors import ContactProblemError
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot
from heelstrike.tolerances import STANDING_GAP, STANDING_SPEED


@dataclass(frozen=True, eq=False)
class ContactForwardDynamics:
    """Accelerations and contact forces of one state."""

    acceleration: Floats
    """(nv,) Acceleration of the coordinates."""
    contact_force: Floats
    """(nc, 2) Force (normal, tangent) of the ground on the robot at each contact point, in N; zero
    where it does not touch. On a flat foot the split of least norm."""
    contact_acceleration: Floats
    """(nc, 2) Acceleration of the gap and of the sliding velocity of each contact point, in
    m/s²."""
    mode: tuple[ContactMode, ...]
    """What each of the nc contact points does."""
    certificate: Certificate
    """Whether, and how well, the contact problem is solved."""
    loop_force: Floats
    """(2 loops + couplings,) Forces of closed loops and coupled joints along the rows of
    :func:`heelstrike.dynamics.loop_jacobian`, in N and N m."""


@takes(ContactProblemError)
def contact_forward_dynamics(
    robot: Robot,
    q: ArrayLike,
    v: ArrayLike,
    torque: ArrayLike,
    *,
    ground: Ground | None = None,
    solver: str | Solver = Solver.LEMKE,
) -> ContactForwardDynamics:
    """Accelerations of a robot on rigid ground with Coulomb friction (paper eq. 14-19).

    Points that touch (gap below 1e-6 m) and neither separate nor slide (velocity below 1e-6 m/s)
    may stay, slip or lift as the forces decide; points that slide go on doing so; points that
    separate are free. Closed loops and couplings hold; the joints' own stops and dry friction do
    not act.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) array
        State.
    torque : (nu,) array
        Joint torques; dampers and springs act besides.
    ground : Ground, optional
        Level ground with friction 0.75 by default.
    solver : str
        First contact solver to try, see :func:`heelstrike.solve_contact`.

    Returns
    -------
    ContactForwardDynamics
        Acceleration, contact forces and the certificate.

    Raises
    ------
    ContactProblemError
        If a point comes down on the ground: that is an impact, which has no acceleration.
    RobotError
        If a vector has the wrong length.

    Examples
    --------
    >>> import heelstrike as hs
    >>> import numpy as np
    >>> robot = hs.load_robot("bravo7")
    >>> falling = hs.contact_forward_dynamics(
    ...     robot, robot.reference_state().q + 1.0, np.zeros(9), np.zeros(6)
    ... )
    >>> float(falling.contact_force.sum())
    0.0
    """
    kinematics = contact_kinematics(robot, q, v, ground)
    touching = _touching(robot, kinematics)
    sliding = np.where(
        np.abs(kinematics.velocity[:, 1]) > STANDING_SPEED, kinematics.velocity[:, 1], 0.0
    )
    count = len(touching)
    loops = loop_jacobian(robot, q)
    held = len(loops)
    mode = np.full(count + held, OPEN, np.int64)
    mode[:count][sliding[touching] > 0.0] = SLIDING_FORWARD
    mode[:count][sliding[touching] < 0.0] = SLIDING_BACKWARD

    matrix = mass_matrix(robot, q)
    rows = np.zeros((2 * (count + held), robot.nv))
    rows[: 2 * count] = kinematics.jacobian[touching].reshape(2 * count, robot.nv)
    rows[2 * count :: 2] = loops
    bias = np.zeros(len(rows))
    bias[: 2 * count] = kinematics.bias_acceleration[touching].ravel()
    bias[2 * count :: 2] = loop_bias_acceleration(robot, q, v)
    force = applied_force(robot, q, v, torque) - bias_force(robot, q, v)
    free = np.linalg.solve(matrix, force)
    response = np.linalg.solve(matrix, rows.T)
    delassus = rows @ response
    forces, _, certificate = run_solvers(
        np.ascontiguousarray(0.5 * (delassus + delassus.T)),
        rows @ free + bias,
        np.concatenate([kinematics.friction[touching], np.zeros(held)]),
        solver_order(solver),
        mode,
        tolerance=1e-9,
        sets=np.repeat([CONE, LINE], [count, held]),
    )
    acceleration = free + response @ forces
    contact_force = np.zeros((robot.nc, 2))
    contact_force[touching] = forces[: 2 * count].reshape(count, 2)
    modes = [ContactMode.OPEN] * robot.nc
    for place, contact in enumerate(touching):
        modes[contact] = ContactMode(int(mode[place]))
    return ContactForwardDynamics(
        acceleration=acceleration,
        contact_force=contact_force,
        contact_acceleration=kinematics.jacobian @ acceleration + kinematics.bias_acceleration,
        mode=tuple(modes),
        certificate=certificate,
        loop_force=forces[2 * count :: 2],
    )


def _touching(robot: Robot, kinematics: ContactKinematics) -> list[int]:
    touches = kinematics.gap < STANDING_GAP
    speed = kinematics.velocity[:, 0]
    coming = [robot.contact_names[i] for i in np.flatnonzero(touches & (speed < -STANDING_SPEED))]
    if coming:
        raise ContactProblemError(
            f"robot {robot.name!r}: {', '.join(coming)} would land on the ground. That is "
            "an impact, which has no acceleration; simulate it, or ask for a state "
            "before or after."
        )
    return [int(i) for i in np.flatnonzero(touches & (speed <= STANDING_SPEED))]
