"""Kinematics and dynamics of planar trees: kernels, queries in numpy, CasADi functions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from heelstrike.dynamics.inverse_kinematics import leg_joints
from heelstrike.dynamics.queries.equations_of_motion import (
    applied_force,
    bias_force,
    coriolis_force,
    forward_dynamics,
    gravity_force,
    inverse_dynamics,
    mass_matrix,
    passive_force,
)
from heelstrike.dynamics.queries.inverse_kinematics import LegPose, inverse_kinematics
from heelstrike.dynamics.queries.linearization import Linearization, linearize
from heelstrike.dynamics.queries.loops import (
    loop_bias_acceleration,
    loop_displacement,
    loop_jacobian,
)
from heelstrike.dynamics.queries.momenta import (
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
from heelstrike.dynamics.queries.points import (
    contact_bias_acceleration,
    contact_jacobian,
    contact_positions,
    point_bias_acceleration,
    point_jacobian,
    point_position,
    point_velocity,
)
from heelstrike.dynamics.queries.poses import (
    LinkPoses,
    LinkVelocities,
    difference,
    integrate,
    link_poses,
    link_velocities,
)

if TYPE_CHECKING:
    from heelstrike.dynamics.queries.casadi_functions import CasadiDynamics as CasadiDynamics

__all__ = [
    "CasadiDynamics",
    "LegPose",
    "Linearization",
    "LinkPoses",
    "LinkVelocities",
    "angular_momentum",
    "applied_force",
    "bias_force",
    "center_of_mass",
    "center_of_mass_bias_acceleration",
    "center_of_mass_jacobian",
    "center_of_mass_velocity",
    "contact_bias_acceleration",
    "contact_jacobian",
    "contact_positions",
    "coriolis_force",
    "difference",
    "energy",
    "forward_dynamics",
    "gravity_force",
    "integrate",
    "inverse_dynamics",
    "inverse_kinematics",
    "kinetic_energy",
    "leg_joints",
    "linearize",
    "link_poses",
    "link_velocities",
    "loop_bias_acceleration",
    "loop_displacement",
    "loop_jacobian",
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


def __getattr__(name: str) -> Any:
    # CasADi is loaded only by those who ask for it.
    if name == "CasadiDynamics":
        from heelstrike.dynamics.queries.casadi_functions import CasadiDynamics

        return CasadiDynamics
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
