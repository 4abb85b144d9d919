"""Which forces of the ground move a robot as planned."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi
import numpy as np

from heelstrike.dynamics import contact_jacobian, inverse_dynamics, link_poses, passive_force
from heelstrike.gait.motion.phases import Standing
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

PUSHING = 1e-2
"""Share of the weight that each point which stands bears at least: polynomials between the instants
of a plan then leave no pull."""
REGULAR = 1e-9
"""Share of the squared torques that is added for each squared force, so that one split is best."""


def zero_moment_point(robot: Robot, q: Floats, v: Floats, a: Floats) -> Floats:
    """Zero moment point on the ground (m) of a robot that moves, wherever its feet are, (N,).

    The ground's wrench is that which moves the floating base: pₓ = −m_y / f_z about the origin.
    A moment about +y at the trunk (x, z) is m − (p − x) f_z − z f_x there.
    """
    found = []
    for each in zip(q, v, a, strict=True):
        force = inverse_dynamics(robot, *each)
        # The first two coordinates are x and z of the trunk, the third its turn about +y.
        place = link_poses(robot, each[0]).origin[2]
        moment = force[2] * robot.model.axis[2, 0]
        found.append(place[0] - (moment + place[1] * force[0]) / force[1])
    return np.array(found)


def shared_forces(
    robot: Robot, stands: Standing, friction: float, q: Floats, v: Floats, a: Floats
) -> Floats | None:
    """Forces of the ground for the least squared torque, (2 nc,), or None if it cannot exert them.

    The coordinates without motors are moved by the ground alone. Of all forces within the friction
    cones that do it, those are taken which leave least to the motors, by a quadratic program.
    """
    rows = contact_jacobian(robot, q).reshape(2 * robot.nc, robot.nv)[stands.forces]
    driven = robot.model.actuator_joint
    free = np.setdiff1d(np.arange(robot.nv), driven)
    needed = inverse_dynamics(robot, q, v, a) - passive_force(robot, q, v)
    weight = rows[:, driven] @ rows[:, driven].T
    weight += REGULAR * np.trace(weight) * np.eye(len(rows))
    cones = _cones(robot, stands, friction)
    pushing = np.zeros(len(cones))
    pushing[: len(stands.normal)] = PUSHING * robot.weight
    low = np.concatenate([needed[free], pushing])
    high = np.concatenate([needed[free], np.full(len(cones), np.inf)])
    solver = _solver(len(rows), len(low))
    found = solver(
        h=weight, g=-rows[:, driven] @ needed[driven], a=np.vstack([rows[:, free].T, cones]),
        lba=low, uba=high,
    )  # fmt: skip
    if not solver.stats()["success"]:
        return None
    whole = np.zeros(2 * robot.nc)
    whole[stands.forces] = np.array(found["x"]).ravel()
    return whole


def _cones(robot: Robot, stands: Standing, friction: float) -> Floats:
    """Rows that are not negative where the ground pushes and no foot slips, by the forces."""
    unit = dict(zip(stands.forces, np.eye(len(stands.forces)), strict=True))
    link, scale = robot.model.contact_link, robot.model.friction_scale
    rows = [unit[2 * i] for i in stands.normal]
    for i in stands.tangent:
        foot = [j for j in stands.normal if link[j] == link[i]]
        normal = np.sum([scale[j] * unit[2 * j] for j in foot], axis=0)
        rows += [friction * normal + unit[2 * i + 1], friction * normal - unit[2 * i + 1]]
    return np.array(rows)


@cache
def _solver(unknowns: int, rows: int) -> Any:
    """Solver of quadratic programs of a size."""
    shape = {"h": casadi.Sparsity.dense(unknowns, unknowns),
             "a": casadi.Sparsity.dense(rows, unknowns)}  # fmt: skip
    quiet = dict.fromkeys(("print_iter", "print_header", "print_info"), False)
    return casadi.conic("forces", "qrqp", shape, {"error_on_fail": False} | quiet)
