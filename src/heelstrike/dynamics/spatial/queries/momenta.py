"""Centre of mass, momentum and energy of the whole robot, in world axes."""

from __future__ import annotations

from heelstrike.dynamics.spatial import totals
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.dynamics.spatial.queries.query import of_position, of_state
from heelstrike.robot.model import Floats


@of_position("(3,) float: World position, in m.")
def center_of_mass(at: SpatialEvaluation) -> Floats:
    """Where the robot's centre of mass is."""
    return at.filled((3,), totals.center_of_mass, at.model, at.work)


@of_position("(3, nv) float: Rows x, y and z, in m and 1.")
def center_of_mass_jacobian(at: SpatialEvaluation) -> Floats:
    """Jacobian of the robot's centre of mass: times v it gives the velocity."""
    return at.filled((3, at.model.nv), totals.center_of_mass_jacobian, at.model, at.work)


@of_state("(3,) float: In m/s.")
def center_of_mass_velocity(at: SpatialEvaluation) -> Floats:
    """Velocity of the robot's centre of mass."""
    return momentum.at(at)[:3] / at.robot.total_mass


@of_state("(3,) float: In m/s².")
def center_of_mass_bias_acceleration(at: SpatialEvaluation) -> Floats:
    """J̇v of :func:`center_of_mass_jacobian`."""
    return at.filled((3,), totals.center_of_mass_bias_acceleration, at.model, at.work)


@of_state("(6,) float: Along x, y, z in N s, and about them in N m s.")
def momentum(at: SpatialEvaluation) -> Floats:
    """Momentum, and moment of momentum about the centre of mass."""
    return at.filled((6,), totals.momentum, at.model, at.work)


@of_state("(3,) float: About x, y and z, in N m s.")
def angular_momentum(at: SpatialEvaluation) -> Floats:
    """Moment of momentum about the centre of mass.

    Rotors (armature) turn with the motors, not with the links, and are not counted.
    """
    return momentum.at(at)[3:]


@of_position("(6, nv) float: Rows x, y, z and moments about them, in kg and kg m².")
def momentum_matrix(at: SpatialEvaluation) -> Floats:
    """Centroidal momentum matrix: times v it gives :func:`momentum`."""
    return at.filled((6, at.model.nv), totals.momentum_matrix, at.model, at.work)


@of_state("float: In J.")
def kinetic_energy(at: SpatialEvaluation) -> float:
    """Kinetic energy of links and rotors."""
    return at.number(totals.kinetic_energy, at.model, at.v, at.work)


@of_position("float: In J, zero at the world's origin with all springs slack.")
def potential_energy(at: SpatialEvaluation) -> float:
    """Energy in the gravity field and of the joint springs."""
    return at.number(totals.potential_energy, at.model, at.q, at.work)


@of_state("tuple of float: Both in J.")
def energy(at: SpatialEvaluation) -> tuple[float, float]:
    """Kinetic and potential energy; the potential includes joint springs."""
    return kinetic_energy.at(at), potential_energy.at(at)
