"""Moments of a person's joints by inverse dynamics, with forces that plates measured."""

from __future__ import annotations

import numpy as np

from heelstrike.dynamics import inverse_dynamics, link_poses, point_jacobian
from heelstrike.errors import GaitError
from heelstrike.experiments.people.body import BodyMotion
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.forces import RecordedForces
from heelstrike.robot.model import Floats

LEAST = 20.0
"""Normal force (N) below which nobody stands on a plate."""


@dataclass(frozen=True, eq=False)
class Moments:
    """What joints exerted, and what no joint and no plate explains."""

    time: Floats
    """(n,) In s, from 0 on."""
    torque: Floats
    """(n, nu) Of the joints, in the order of the actuators, in N m."""
    residual: Floats
    """(n, 3) Force along x and z (N) and moment (N m) on the trunk that are left over: errors of
    markers, masses and plates."""


def moments_of(motion: BodyMotion, forces: RecordedForces) -> Moments:
    """Joint moments of a motion with measured forces of the ground.

    A force acts on the foot whose ankle is nearest to where it acts.

    Parameters
    ----------
    motion : BodyMotion
        How the person moved, of both legs.
    forces : RecordedForces
        Forces by the same clock and in the same axes.

    Returns
    -------
    Moments
        The moments.

    Raises
    ------
    GaitError
        If a leg was not recorded, or the forces are of another time.
    """
    robot, time = motion.robot, motion.time + motion.begin
    if len(motion.sides) < 2:
        raise GaitError("moments need both legs, but only one was recorded")
    if time[0] < forces.time[0] - 1.0 / LEAST or time[-1] > forces.time[-1] + 1.0 / LEAST:
        raise GaitError(
            f"the forces last from {forces.time[0]:.3g} to {forces.time[-1]:.3g} s, the motion "
            f"from {time[0]:.3g} to {time[-1]:.3g} s"
        )
    feet = [foot.link for foot in robot.feet]
    torque, residual = np.zeros((len(time), robot.nu)), np.zeros((len(time), 3))
    for i, instant in enumerate(time):
        q = motion.q[i]
        needed = inverse_dynamics(robot, q, motion.v[i], motion.acceleration[i])
        poses = link_poses(robot, q)
        for plate in range(forces.force.shape[1]):
            force, point = (
                np.array([np.interp(instant, forces.time, each[:, plate, k]) for k in range(2)])
                for each in (forces.force, forces.point)
            )
            if force[1] < LEAST:
                continue
            link = min(feet, key=lambda each: abs(poses.origin[each, 0] - point[0]))
            away, turn = point - poses.origin[link], poses.angle[link]
            local = np.array(
                [
                    np.cos(turn) * away[0] - np.sin(turn) * away[1],
                    np.sin(turn) * away[0] + np.cos(turn) * away[1],
                ]
            )
            needed = needed - point_jacobian(robot, q, link, local)[:2].T @ force
        torque[i], residual[i] = needed[robot.model.actuator_joint], needed[:3]
    return Moments(motion.time, torque, residual)
