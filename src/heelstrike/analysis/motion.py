"""What the links did in every row of a run: poses, velocities of the contact points, energies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot
from heelstrike.sim.run import Run

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a robot in world axes, row by row.

    Attributes
    ----------
    link_origin : (nt, nl, 2) float
        Position (x, z) of every link frame, in m.
    link_angle : (nt, nl) float
        Rotation of every link about +y from the reference configuration, in rad.
    center_of_mass : (nt, 2) float
        Position (x, z) of the robot's centre of mass, in m.
    contact_velocity : (nt, nc, 2) float
        Velocity (x, z) of the material point at every contact point, in m/s.
    kinetic, potential : (nt,) float
        Energies in J; the kinetic one includes rotors, the potential one joint springs.
    """

    link_origin: Floats
    link_angle: Floats
    center_of_mass: Floats
    contact_velocity: Floats
    kinetic: Floats
    potential: Floats


@kernel
def _follow(
    model: Model,
    position: Floats,
    velocity: Floats,
    contact_point: Floats,
    work: Workspace,
    origin: Floats,
    angle: Floats,
    center: Floats,
    contact_velocity: Floats,
    kinetic: Floats,
    potential: Floats,
) -> None:
    for row in range(position.shape[0]):
        forward_kinematics(model, position[row], work)
        link_velocities(model, velocity[row], work)
        for link in range(model.nl):
            origin[row, link, 0] = work.origin[link, 0]
            origin[row, link, 1] = work.origin[link, 1]
            angle[row, link] = work.angle[link]
        center_of_mass(model, work, center[row])
        kinetic_energy(model, velocity[row], work, kinetic[row : row + 1])
        potential_energy(model, position[row], work, potential[row : row + 1])
        for contact in range(model.nc):
            place = place_of(work, contact_point[row, contact])
            speed = velocity_at(work.velocity, model.contact_link[contact], place)
            contact_velocity[row, contact, 0], contact_velocity[row, contact, 1] = speed


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
    q = np.ascontiguousarray(position, dtype=np.float64)
    v = np.ascontiguousarray(velocity, dtype=np.float64)
    point = np.ascontiguousarray(contact_point, dtype=np.float64)
    rows = len(q)
    result = Motion(
        link_origin=np.zeros((rows, robot.nl, 2)),
        link_angle=np.zeros((rows, robot.nl)),
        center_of_mass=np.zeros((rows, 2)),
        contact_velocity=np.zeros((rows, robot.nc, 2)),
        kinetic=np.zeros(rows),
        potential=np.zeros(rows),
    )
    _follow(
        robot.model,
        q,
        v,
        point,
        Workspace.allocate(robot.model.extents),
        result.link_origin,
        result.link_angle,
        result.center_of_mass,
        result.contact_velocity,
        result.kinetic,
        result.potential,
    )
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
