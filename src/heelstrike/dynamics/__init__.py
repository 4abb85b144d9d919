"""Kinematics and dynamics of planar trees: kernels, queries in numpy, symbolic traces."""

from heelstrike.dynamics.queries import (
    LinkPoses,
    bias_force,
    center_of_mass,
    contact_positions,
    energy,
    forward_dynamics,
    gravity_force,
    inverse_dynamics,
    link_poses,
    mass_matrix,
    momentum,
    passive_force,
    point_bias_acceleration,
    point_jacobian,
)

__all__ = [
    "LinkPoses",
    "bias_force",
    "center_of_mass",
    "contact_positions",
    "energy",
    "forward_dynamics",
    "gravity_force",
    "inverse_dynamics",
    "link_poses",
    "mass_matrix",
    "momentum",
    "passive_force",
    "point_bias_acceleration",
    "point_jacobian",
]
