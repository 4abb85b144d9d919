"""Centre of mass, momentum and energy of a robot in space in every row of a run."""

from __future__ import annotations

import numpy as np

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.spatial.kinematics import forward_kinematics, link_velocities
from heelstrike.dynamics.spatial.totals import (
    center_of_mass,
    kinetic_energy,
    momentum,
    potential_energy,
)
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.sim.spatial.run import SpatialRun


class CentroidalMotion(Bundle):
    """How the mass of a robot in space moves, row by row, in world axes."""

    center_of_mass: Floats = array("nt", 3)
    """Position of the robot's centre of mass, in m."""
    momentum: Floats = array("nt", 6)
    """Momentum along x, y, z in N s, then moment of momentum about the centre of mass in N m s."""
    kinetic: Floats = array("nt")
    potential: Floats = array("nt")
    """kinetic, potential: Energies in J; the kinetic one includes rotors, the potential one joint
    springs."""


@kernel
def _follow(
    model: SpatialModel,
    position: Floats,
    velocity: Floats,
    work: SpatialWorkspace,
    motion: CentroidalMotion,
) -> None:
    for row in range(position.shape[0]):
        forward_kinematics(model, position[row], work)
        link_velocities(model, velocity[row], work)
        center_of_mass(model, work, motion.center_of_mass[row])
        momentum(model, work, motion.momentum[row])
        kinetic_energy(model, velocity[row], work, motion.kinetic[row : row + 1])
        potential_energy(model, position[row], work, motion.potential[row : row + 1])


def centroidal_motion(run: SpatialRun) -> CentroidalMotion:
    """Follow centre of mass, momentum and energy of a robot in space through a run.

    Parameters
    ----------
    run : SpatialRun
        The run.

    Returns
    -------
    CentroidalMotion
        Row by row.
    """
    model = run.robot.model
    q, v = (np.ascontiguousarray(each, np.float64) for each in (run.position, run.velocity))
    result = CentroidalMotion.allocate(nt=len(q))
    _follow(model, q, v, SpatialWorkspace.allocate(model.extents), result)
    return result
