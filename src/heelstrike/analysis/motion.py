"""What the links did in every row of a run: poses, velocities of the contact points, energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.kernels import (
    center_of_mass,
    forward_kinematics,
    kinetic_energy,
    link_velocities,
    potential_energy,
)
from heelstrike.dynamics.places import place_of, velocity_at
from heelstrike.dynamics.workspace import Workspace
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run


class Motion(Bundle):
    """Motion of a robot in world axes, row by row."""

    link_origin: Floats = array("nt", "nl", "axes")
    """Position (x, z) of every link frame, in m."""
    link_angle: Floats = array("nt", "nl")
    """Rotation of every link about +y from the reference configuration, in rad."""
    center_of_mass: Floats = array("nt", "axes")
    """Position (x, z) of the robot's centre of mass, in m."""
    contact_velocity: Floats = array("nt", "nc", "axes")
    """Velocity (x, z) of the material point at every contact point, in m/s."""
    kinetic: Floats = array("nt")
    potential: Floats = array("nt")
    """kinetic, potential: Energies in J; the kinetic one includes rotors, the potential one joint
    springs."""


@kernel
def _follow(
    model: Model,
    position: Floats,
    velocity: Floats,
    contact_point: Floats,
    work: Workspace,
    motion: Motion,
) -> None:
    for row in range(position.shape[0]):
        forward_kinematics(model, position[row], work)
        link_velocities(model, velocity[row], work)
        for link in range(model.nl):
            motion.link_origin[row, link, 0] = work.origin[link, 0]
            motion.link_origin[row, link, 1] = work.origin[link, 1]
            motion.link_angle[row, link] = work.angle[link]
        center_of_mass(model, work, motion.center_of_mass[row])
        kinetic_energy(model, velocity[row], work, motion.kinetic[row : row + 1])
        potential_energy(model, position[row], work, motion.potential[row : row + 1])
        for contact in range(model.nc):
            place = place_of(work, contact_point[row, contact])
            speed = velocity_at(work.velocity, model.contact_link[contact], place)
            motion.contact_velocity[row, contact, 0] = speed[0]
            motion.contact_velocity[row, contact, 1] = speed[1]


def motion(
    robot: Robot, position: ArrayLike, velocity: ArrayLike, contact_point: ArrayLike
) -> Motion:
    """Follow a robot through a sequence of states.

    Parameters
    ----------
    robot : Robot
        The robot.
    position : (nt, nq) array
        Generalised positions, in m and rad.
    velocity : (nt, nv) array
        Generalised velocities, in m/s and rad/s.
    contact_point : (nt, nc, 2) array
        World positions (x, z) at which the links' velocities are asked for, in m.
    """
    q, v, point = (np.ascontiguousarray(a, np.float64) for a in (position, velocity, contact_point))
    result = Motion.allocate(robot.model.extents, nt=len(q))
    _follow(robot.model, q, v, point, Workspace.allocate(robot.model.extents), result)
    return result


def run_motion(run: Run) -> Motion:
    """Follow the robot of a run through its rows; see :func:`motion`.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    Motion
        Where its links and its centre of mass are in each row.
    """
    return motion(run.robot, run.position, run.velocity, run.contact_point)


def in_world(origin: Floats, angle: Floats, local: Floats) -> Floats:
    """Places (..., 2) of points (x, z) in link frames whose poses are given, in m and rad."""
    c, s = np.cos(angle), np.sin(angle)
    x, z = local[..., 0], local[..., 1]
    return np.asarray(origin + np.stack((c * x + s * z, c * z - s * x), axis=-1))
