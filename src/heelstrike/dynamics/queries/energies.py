"""Mechanical energy of a robot."""

from __future__ import annotations

from heelstrike.dynamics import kernels
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.query import of_position, of_state


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
