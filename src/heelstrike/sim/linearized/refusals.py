"""Time steps that have no derivative which is known here."""

from __future__ import annotations

import numpy as np

from heelstrike.contact.modes import OPEN
from heelstrike.errors import SimulationError
from heelstrike.sim.closed_sets import Scheme
from heelstrike.sim.contacts.rows import POINT, SECOND_FACE
from heelstrike.sim.linearized.inputs import Inputs
from heelstrike.sim.simulation import Simulation

ONE_NORMAL = 1e-12
"""Normals that differ by less are those of one face of the ground."""


IMPLICIT = (Scheme.MOREAU_JEAN, Scheme.LINEARLY_IMPLICIT)
"""Schemes that take springs and dampers ahead, into the mass matrix."""


def refuse_inputs(scheme: Scheme, inputs: Inputs) -> None:
    """Refuse numbers that are in the mass matrix of a step, which is not differentiated by them.

    Raises
    ------
    SimulationError
        That names them.
    """
    ahead = [name for name in inputs.numbers if name in ("stiffness", "damping")]
    wrong = ahead if scheme in IMPLICIT else []
    if scheme is Scheme.LINEARLY_IMPLICIT:
        wrong += inputs.parameters
    if wrong:
        raise SimulationError(
            f"Scheme.{scheme.name} takes {', '.join(wrong)} into the mass matrix, which is not "
            "differentiated by them; use Scheme.IMPACT_RESOLVED"
        )


def refuse_step(simulation: Simulation) -> None:
    """Refuse the step that has just been taken if its equations are not all known here.

    Raises
    ------
    SimulationError
        That says what is in the way.
    """
    reasons = {
        "constraints from outside": bool(simulation.robot.constraints),
        "smooth ground": bool(simulation.ground.model().curved),
        "a motor on its speed-torque line, or under a voltage,": bool(
            np.any(simulation._memory.torque != simulation._memory.command)
        ),
        "a wedge": bool(simulation._work.impact.relaxed),
        "restitution that is scaled back": bool(
            simulation._work.impact.gains and simulation._work.impact.bounded
        ),
        "a concave corner of the ground": _held(simulation, SECOND_FACE).size > 0,
        "a contact point at a convex corner of the ground": _at_corner(simulation),
    }
    for what, there in reasons.items():
        if there:
            raise SimulationError(f"{what} in a time step cannot be differentiated yet")


def _held(simulation: Simulation, kind: int) -> np.ndarray:
    """Entries of a kind that were held in the step."""
    assembly = simulation._memory.assembly
    places = slice(assembly.begin[kind], assembly.until[kind])
    return np.asarray(assembly.candidate[places][assembly.answer.mode[places] != OPEN])


def _at_corner(simulation: Simulation) -> bool:
    """Whether the normal of a contact turns as it moves."""
    faces = simulation.ground.model().normal
    normals = simulation._memory.contacts.normal[_held(simulation, POINT)]
    apart = np.abs(normals[:, None] - faces[None]).max(axis=2)
    return bool(len(normals)) and bool(np.any(apart.min(axis=1) > ONE_NORMAL))
