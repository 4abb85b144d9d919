"""Centre of mass, momentum and energy of the whole robot, in world axes."""

from __future__ import annotations

from heelstrike.dynamics import kernels
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.query import of_position, of_state
from heelstrike.robot.model import Floats


@of_position("(2,) float: World position (x, z), in m.")
def center_of_mass(at: Evaluation) -> Floats:
    """Where the robot's centre of mass is."""
    return at.filled((at.model.axes,), kernels.center_of_mass, at.model, at.work)


@of_position("(2, nv) float: Rows x and z, in m and 1.")
def center_of_mass_jacobian(at: Evaluation) -> Floats:
    """Jacobian of the robot's centre of mass: times v it gives the velocity."""
    shape = (at.model.axes, at.model.nv)
    return at.filled(shape, kernels.center_of_mass_jacobian, at.model, at.work)


@of_state("(2,) float: Along x and z, in m/s.")
def center_of_mass_velocity(at: Evaluation) -> Floats:
    """Velocity of the robot's centre of mass."""
    return momentum.at(at)[:-1] / at.robot.total_mass


@of_state("(2,) float: Along x and z, in m/s².")
def center_of_mass_bias_acceleration(at: Evaluation) -> Floats:
    """J̇v of :func:`center_of_mass_jacobian`."""
    shape = (at.model.axes,)
    return at.filled(shape, kernels.center_of_mass_bias_acceleration, at.model, at.work)


@of_state("(3,) float: Along x and z in N s, and about +y in N m s.")
def momentum(at: Evaluation) -> Floats:
    """Momentum, and moment of momentum about the centre of mass."""
    return at.filled((3,), kernels.momentum, at.model, at.work)


@of_state("float: About +y, in N m s.")
def angular_momentum(at: Evaluation) -> float:
    """Moment of momentum about the centre of mass.

    Rotors (armature) turn with the motors, not with the links, and are not counted.
    """
    moment: float = momentum.at(at).tolist()[-1]  # a symbol, too
    return moment


@of_position("(3, nv) float: Rows x, z and moment about +y, in kg and kg m².")
def momentum_matrix(at: Evaluation) -> Floats:
    """Centroidal momentum matrix: times v it gives :func:`momentum`."""
    return at.filled((3, at.model.nv), kernels.momentum_matrix, at.model, at.work)


@of_state("float: In J.")
def kinetic_energy(at: Evaluation) -> float:
    """Kinetic energy of links and rotors."""
    return at.number(kernels.kinetic_energy, at.model, at.v, at.work)


@of_position("float: In J, zero at the world's origin with all springs slack.")
def potential_energy(at: Evaluation) -> float:
    """Energy in the gravity field and of the joint springs."""
    return at.number(kernels.potential_energy, at.model, at.q, at.work)


@of_state("tuple of float: Both in J.")
def energy(at: Evaluation) -> tuple[float, float]:
    """Kinetic and potential energy; the potential includes joint springs."""
    return kinetic_energy.at(at), potential_energy.at(at)
