"""Kinematics and dynamics of trees in space: kernels, and queries in numpy.

The questions are those of :mod:`heelstrike.dynamics`, which are asked of robots in space, too, and
some that only they answer.
"""

from heelstrike.dynamics.queries.equations_of_motion import applied_force as applied_force
from heelstrike.dynamics.queries.equations_of_motion import bias_force as bias_force
from heelstrike.dynamics.queries.equations_of_motion import coriolis_force as coriolis_force
from heelstrike.dynamics.queries.equations_of_motion import gravity_force as gravity_force
from heelstrike.dynamics.queries.equations_of_motion import inverse_dynamics as inverse_dynamics
from heelstrike.dynamics.queries.equations_of_motion import mass_matrix as mass_matrix
from heelstrike.dynamics.queries.equations_of_motion import passive_force as passive_force
from heelstrike.dynamics.queries.momenta import center_of_mass as center_of_mass
from heelstrike.dynamics.queries.momenta import (
    center_of_mass_bias_acceleration as center_of_mass_bias_acceleration,
)
from heelstrike.dynamics.queries.momenta import center_of_mass_jacobian as center_of_mass_jacobian
from heelstrike.dynamics.queries.momenta import center_of_mass_velocity as center_of_mass_velocity
from heelstrike.dynamics.queries.momenta import energy as energy
from heelstrike.dynamics.queries.momenta import kinetic_energy as kinetic_energy
from heelstrike.dynamics.queries.momenta import momentum as momentum
from heelstrike.dynamics.queries.momenta import momentum_matrix as momentum_matrix
from heelstrike.dynamics.queries.momenta import potential_energy as potential_energy
from heelstrike.dynamics.queries.poses import difference as difference
from heelstrike.dynamics.queries.poses import integrate as integrate
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
from heelstrike.dynamics.spatial.queries.poses import (
    SpatialPoses,
    SpatialVelocities,
)
from heelstrike.dynamics.spatial.queries.poses import link_poses as link_poses
from heelstrike.dynamics.spatial.queries.poses import link_velocities as link_velocities

__all__ = ["SpatialLinearization", "SpatialPoses", "SpatialVelocities"]
