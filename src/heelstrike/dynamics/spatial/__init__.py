"""Kinematics and dynamics of trees in space: kernels, and queries in numpy.

The questions are those of :mod:`heelstrike.dynamics`, by the same names.
"""

from heelstrike.dynamics.spatial.queries.equations_of_motion import (
    applied_force,
    bias_force,
    coriolis_force,
    forward_dynamics,
    gravity_force,
    inverse_dynamics,
    mass_matrix,
    passive_force,
)
from heelstrike.dynamics.spatial.queries.momenta import (
    angular_momentum,
    center_of_mass,
    center_of_mass_bias_acceleration,
    center_of_mass_jacobian,
    center_of_mass_velocity,
    energy,
    kinetic_energy,
    momentum,
    momentum_matrix,
    potential_energy,
)
from heelstrike.dynamics.spatial.queries.points import (
    contact_jacobian,
    contact_positions,
    lowest_positions,
    point_bias_acceleration,
    point_jacobian,
    point_position,
    point_velocity,
)
from heelstrike.dynamics.spatial.queries.poses import (
    SpatialPoses,
    SpatialVelocities,
    difference,
    integrate,
    link_poses,
    link_velocities,
)

__all__ = [
    "SpatialPoses",
    "SpatialVelocities",
    "angular_momentum",
    "applied_force",
    "bias_force",
    "center_of_mass",
    "center_of_mass_bias_acceleration",
    "center_of_mass_jacobian",
    "center_of_mass_velocity",
    "contact_jacobian",
    "contact_positions",
    "coriolis_force",
    "difference",
    "energy",
    "forward_dynamics",
    "gravity_force",
    "integrate",
    "inverse_dynamics",
    "kinetic_energy",
    "link_poses",
    "link_velocities",
    "lowest_positions",
    "mass_matrix",
    "momentum",
    "momentum_matrix",
    "passive_force",
    "point_bias_acceleration",
    "point_jacobian",
    "point_position",
    "point_velocity",
    "potential_energy",
]
