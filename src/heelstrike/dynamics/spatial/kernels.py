"""The kernels of space that queries run; by the names of :mod:`heelstrike.dynamics.kernels`."""

from heelstrike.dynamics.spatial.configurations import difference, integrate
from heelstrike.dynamics.spatial.equations import (
    bias_force,
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    passive_force,
)
from heelstrike.dynamics.spatial.kinematics import (
    angular_velocity,
    forward_kinematics,
    link_velocities,
    point_bias,
    point_position,
    point_velocity,
)
from heelstrike.dynamics.spatial.totals import (
    center_of_mass,
    center_of_mass_bias_acceleration,
    center_of_mass_jacobian,
    kinetic_energy,
    momentum,
    momentum_matrix,
    potential_energy,
)

__all__ = [
    "angular_velocity",
    "bias_force",
    "center_of_mass",
    "center_of_mass_bias_acceleration",
    "center_of_mass_jacobian",
    "difference",
    "forward_dynamics",
    "forward_kinematics",
    "integrate",
    "inverse_dynamics",
    "kinetic_energy",
    "link_velocities",
    "mass_matrix",
    "momentum",
    "momentum_matrix",
    "passive_force",
    "point_bias",
    "point_position",
    "point_velocity",
    "potential_energy",
]
