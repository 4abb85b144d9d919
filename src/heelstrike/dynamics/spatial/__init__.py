"""Kinematics and dynamics of trees in space: kernels, and queries in numpy.

The questions are those of :mod:`heelstrike.dynamics`, described as they are in space and asked of
robots in space alone, and some that only they answer.
"""

from heelstrike.dynamics.queries import equations_of_motion as _motion
from heelstrike.dynamics.queries import momenta as _momenta
from heelstrike.dynamics.queries import poses as _poses
from heelstrike.dynamics.queries.query import of_space as _of_space
from heelstrike.dynamics.spatial.queries.equations_of_motion import (
    forward_dynamics as forward_dynamics,
)
from heelstrike.dynamics.spatial.queries.linearization import SpatialLinearization
from heelstrike.dynamics.spatial.queries.momenta import angular_momentum as angular_momentum
from heelstrike.dynamics.spatial.queries.points import (
    contact_bias_acceleration as contact_bias_acceleration,
)
from heelstrike.dynamics.spatial.queries.points import contact_jacobian as contact_jacobian
from heelstrike.dynamics.spatial.queries.points import contact_positions as contact_positions
from heelstrike.dynamics.spatial.queries.points import lowest_positions as lowest_positions
from heelstrike.dynamics.spatial.queries.points import (
    point_bias_acceleration as point_bias_acceleration,
)
from heelstrike.dynamics.spatial.queries.points import point_jacobian as point_jacobian
from heelstrike.dynamics.spatial.queries.points import point_position as point_position
from heelstrike.dynamics.spatial.queries.points import point_velocity as point_velocity
from heelstrike.dynamics.spatial.queries.poses import SpatialPoses, SpatialVelocities
from heelstrike.dynamics.spatial.queries.poses import link_poses as link_poses
from heelstrike.dynamics.spatial.queries.poses import link_velocities as link_velocities

__all__ = ["SpatialLinearization", "SpatialPoses", "SpatialVelocities"]

applied_force = _of_space(_motion.applied_force)
bias_force = _of_space(_motion.bias_force)
coriolis_force = _of_space(_motion.coriolis_force)
gravity_force = _of_space(_motion.gravity_force)
inverse_dynamics = _of_space(_motion.inverse_dynamics)
mass_matrix = _of_space(_motion.mass_matrix)
passive_force = _of_space(_motion.passive_force)
center_of_mass = _of_space(_momenta.center_of_mass)
center_of_mass_bias_acceleration = _of_space(_momenta.center_of_mass_bias_acceleration)
center_of_mass_jacobian = _of_space(_momenta.center_of_mass_jacobian)
center_of_mass_velocity = _of_space(_momenta.center_of_mass_velocity)
energy = _of_space(_momenta.energy)
kinetic_energy = _of_space(_momenta.kinetic_energy)
momentum = _of_space(_momenta.momentum)
momentum_matrix = _of_space(_momenta.momentum_matrix)
potential_energy = _of_space(_momenta.potential_energy)
difference = _of_space(_poses.difference)
integrate = _of_space(_poses.integrate)
