"""Centre of mass, momentum and energy of the whole robot, in world axes.

Components are along x and z, and about +y; in space along x, y and z, and about them.
"""

from __future__ import annotations

from heelstrike.dynamics.queries.evaluation import AnyEvaluation, Evaluation
from heelstrike.dynamics.queries.query import of_position, of_state
from heelstrike.robot.model import Floats


@of_position("(2,) float: World position (x, z), in m; (3,) in space.")
def center_of_mass(at: AnyEvaluation) -> Floats:
    """Where the robot's centre of mass is."""
    return at.filled((at.model.axes,), at.kernels.center_of_mass, at.model, at.work)


@of_position("(2, nv) float: Rows x and z, in m and 1; (3, nv) in space.")
def center_of_mass_jacobian(at: AnyEvaluation) -> Floats:
    """Jacobian of the robot's centre of mass: times v it gives the velocity."""
    shape = (at.model.axes, at.model.nv)
    return at.filled(shape, at.kernels.center_of_mass_jacobian, at.model, at.work)


@of_state("(2,) float: Along x and z, in m/s; (3,) in space.")
def center_of_mass_velocity(at: AnyEvaluation) -> Floats:
    """Velocity of the robot's centre of mass."""
    velocity: Floats = momentum.at(at)[: at.model.axes] / at.robot.total_mass
    return velocity


@of_state("(2,) float: Along x and z, in m/s²; (3,) in space.")
def center_of_mass_bias_acceleration(at: AnyEvaluation) -> Floats:
    """J̇v of :func:`center_of_mass_jacobian`."""
    shape = (at.model.axes,)
    return at.filled(shape, at.kernels.center_of_mass_bias_acceleration, at.model, at.work)


@of_state("(3,) float: Along x and z in N s, and about +y in N m s; (6,) in space.")
def momentum(at: AnyEvaluation) -> Floats:
    """Momentum, and moment of momentum about the centre of mass."""
    return at.filled((at.model.axes + at.moments,), at.kernels.momentum, at.model, at.work)


@of_state("float: About +y, in N m s; (3,) float in space.")
def angular_momentum(at: Evaluation) -> float:
    """Moment of momentum about the centre of mass.

    Rotors (armature) turn with the motors, not with the links, and are not counted.
    """
    moment: float = momentum.at(at).tolist()[-1]  # a symbol, too
    return moment


@of_position("(3, nv) float: Rows x, z and moment about +y, in kg and kg m²; (6, nv) in space.")
def momentum_matrix(at: AnyEvaluation) -> Floats:
    """Centroidal momentum matrix: times v it gives :func:`momentum`."""
    shape = (at.model.axes + at.moments, at.model.nv)
    return at.filled(shape, at.kernels.momentum_matrix, at.model, at.work)


@of_state("float: In J.")
def kinetic_energy(at: AnyEvaluation) -> float:
    """Kinetic energy of links and rotors."""
    return at.number(at.kernels.kinetic_energy, at.model, at.v, at.work)


@of_position("float: In J, zero at the world's origin with all springs slack.")
def potential_energy(at: AnyEvaluation) -> float:
    """Energy in the gravity field and of the joint springs."""
    return at.number(at.kernels.potential_energy, at.model, at.q, at.work)


@of_state("tuple of float: Both in J.")
def energy(at: AnyEvaluation) -> tuple[float, float]:
    """Kinetic and potential energy; the potential includes joint springs."""
    return kinetic_energy.at(at), potential_energy.at(at)
