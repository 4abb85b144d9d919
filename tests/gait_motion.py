"""The whole motion of a gait, worked out from its joint polynomials with the compiled kernels.

Nothing here comes from the optimiser: flatness of the stance foot, its rest, and the forces are
solved for as dense linear systems (paper eq. 27-34).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heelstrike import dynamics
from heelstrike.gait import Gait
from heelstrike.robot import Robot


@dataclass(frozen=True)
class Instant:
    """Motion and forces at one instant of single support.

    The wrench (x, z, moment about +y) acts on the robot at the middle of the stance sole.
    """

    q: np.ndarray
    v: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    wrench: np.ndarray


def selection(robot: Robot) -> np.ndarray:
    """Return the matrix B of eq. 1, (nv, nu)."""
    matrix = np.zeros((robot.nv, robot.nu))
    matrix[robot.model.actuator_joint, np.arange(robot.nu)] = 1.0
    return matrix


def middle(robot: Robot, foot: int) -> np.ndarray:
    """Return the middle of the sole in the link frame, for soles level in the reference."""
    contacts = list(robot.feet[foot].contacts)
    point = robot.model.contact_position[contacts].mean(axis=0)
    return point - [0.0, robot.model.contact_radius[contacts[0]]]


def place(robot: Robot, q: np.ndarray, foot: int) -> np.ndarray:
    """World position of the middle of a sole."""
    poses = dynamics.link_poses(robot, q)
    link = robot.feet[foot].link
    c, s = np.cos(poses.angle[link]), np.sin(poses.angle[link])
    x, z = middle(robot, foot)
    return poses.origin[link] + [c * x + s * z, c * z - s * x]


def standing(robot: Robot, joints: np.ndarray, foot: int) -> np.ndarray:
    """Position with a foot flat and the middle of its sole at the origin."""
    q = robot.model.reference.copy()
    q[robot.model.actuator_joint] = joints
    q[2] -= dynamics.link_poses(robot, q).angle[robot.feet[foot].link]
    q[:2] -= place(robot, q, foot)
    return q


def foot_jacobian(robot: Robot, q: np.ndarray, foot: int) -> np.ndarray:
    """Jacobian of the middle of a sole, (3, nv)."""
    return dynamics.point_jacobian(robot, q, robot.feet[foot].link, middle(robot, foot))


def instant(robot: Robot, gait: Gait, t: float, *, end: bool = False) -> Instant:
    """Motion of the first step at a time in [0, T]; `end` for the state just before touchdown."""
    foot = gait.stance_foot
    if end:
        powers = gait.step_duration ** np.arange(4)
        rates = np.array([0.0, 1.0, 2.0 * gait.step_duration, 3.0 * gait.step_duration**2])
        bends = np.array([0.0, 0.0, 2.0, 6.0 * gait.step_duration])
        joints = [row @ gait.coefficients for row in (powers, rates, bends)]
    else:
        joints = [gait.position(t), gait.velocity(t), gait.acceleration(t)]
    actuated = robot.model.actuator_joint
    q = standing(robot, joints[0], foot)
    jacobian = foot_jacobian(robot, q, foot)

    def completed(driven: np.ndarray, target: np.ndarray) -> np.ndarray:
        full = np.zeros(robot.nv)
        full[actuated] = driven
        full[:3] = np.linalg.solve(jacobian[:, :3], target - jacobian @ full)
        return full

    v = completed(joints[1], np.zeros(3))
    drift = dynamics.point_bias_acceleration(
        robot, q, v, robot.feet[foot].link, middle(robot, foot)
    )
    acceleration = completed(joints[2], -drift)
    force = dynamics.inverse_dynamics(robot, q, v, acceleration)
    force -= dynamics.passive_force(robot, q, v)
    solution = np.linalg.solve(np.hstack([selection(robot), jacobian.T]), force)
    return Instant(q, v, acceleration, solution[: robot.nu], solution[robot.nu :])


def contact_heights(robot: Robot, q: np.ndarray, foot: int) -> np.ndarray:
    """Heights of the lowest points of the contact discs of a foot."""
    contacts = list(robot.feet[foot].contacts)
    return dynamics.contact_positions(robot, q)[contacts, 1] - robot.model.contact_radius[contacts]


def contact_rates(robot: Robot, q: np.ndarray, v: np.ndarray, foot: int) -> np.ndarray:
    """Vertical velocities of the contact discs of a foot."""
    link = robot.feet[foot].link
    return np.array(
        [
            dynamics.point_jacobian(robot, q, link, robot.model.contact_position[i])[1] @ v
            for i in robot.feet[foot].contacts
        ]
    )
