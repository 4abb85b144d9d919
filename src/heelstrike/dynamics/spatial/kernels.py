"""The kernels of space that queries run; by the names of :mod:`heelstrike.dynamics.kernels`."""

from heelstrike.dynamics.spatial.configurations import difference as difference
from heelstrike.dynamics.spatial.configurations import integrate as integrate
from heelstrike.dynamics.spatial.equations import bias_force as bias_force
from heelstrike.dynamics.spatial.equations import forward_dynamics as forward_dynamics
from heelstrike.dynamics.spatial.equations import inverse_dynamics as inverse_dynamics
from heelstrike.dynamics.spatial.equations import mass_matrix as mass_matrix
from heelstrike.dynamics.spatial.equations import passive_force as passive_force
from heelstrike.dynamics.spatial.kinematics import angular_velocity as angular_velocity
from heelstrike.dynamics.spatial.kinematics import forward_kinematics as forward_kinematics
from heelstrike.dynamics.spatial.kinematics import link_velocities as link_velocities
from heelstrike.dynamics.spatial.kinematics import point_bias as point_bias
from heelstrike.dynamics.spatial.kinematics import point_position as point_position
from heelstrike.dynamics.spatial.kinematics import point_velocity as point_velocity
from heelstrike.dynamics.spatial.totals import center_of_mass as center_of_mass
from heelstrike.dynamics.spatial.totals import (
    center_of_mass_bias_acceleration as center_of_mass_bias_acceleration,
)
from heelstrike.dynamics.spatial.totals import center_of_mass_jacobian as center_of_mass_jacobian
from heelstrike.dynamics.spatial.totals import kinetic_energy as kinetic_energy
from heelstrike.dynamics.spatial.totals import momentum as momentum
from heelstrike.dynamics.spatial.totals import momentum_matrix as momentum_matrix
from heelstrike.dynamics.spatial.totals import potential_energy as potential_energy
