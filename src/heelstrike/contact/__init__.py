"""The ground, the contact problem, its solvers and their certificates."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from heelstrike.contact.certificate import Certificate
from heelstrike.contact.ground import Ground
from heelstrike.contact.ground_shape import GroundShape
from heelstrike.contact.linearized.motion import (
    ActiveContacts,
    ImpactLinearization,
    PhaseLinearization,
    linearize_contact,
    linearize_impact,
    saltation_matrix,
)
from heelstrike.contact.modes import ContactMode, Solver, SolveStatus
from heelstrike.contact.problem import ContactSolution, solve_contact
from heelstrike.contact.queries.force_distribution import ForceDistribution
from heelstrike.contact.queries.forward_dynamics import (
    ContactForwardDynamics,
    contact_forward_dynamics,
)
from heelstrike.contact.queries.inverse_dynamics import (
    ContactInverseDynamics,
    contact_inverse_dynamics,
)
from heelstrike.contact.queries.kinematics import ContactKinematics, contact_kinematics

if TYPE_CHECKING:
    from heelstrike.contact.spatial.certificate import SpatialCertificate
    from heelstrike.contact.spatial.ground import Box, SpatialGround
    from heelstrike.contact.spatial.modes import SpatialContactMode, SpatialSolver, SpatialStatus
    from heelstrike.contact.spatial.problem import SpatialContactSolution

__all__ = [
    "ActiveContacts",
    "Box",
    "Certificate",
    "ContactForwardDynamics",
    "ContactInverseDynamics",
    "ContactKinematics",
    "ContactMode",
    "ContactSolution",
    "ForceDistribution",
    "Ground",
    "GroundShape",
    "ImpactLinearization",
    "PhaseLinearization",
    "SolveStatus",
    "Solver",
    "SpatialCertificate",
    "SpatialContactMode",
    "SpatialContactSolution",
    "SpatialGround",
    "SpatialSolver",
    "SpatialStatus",
    "contact_forward_dynamics",
    "contact_inverse_dynamics",
    "contact_kinematics",
    "linearize_contact",
    "linearize_impact",
    "saltation_matrix",
    "solve_contact",
]

_IN_SPACE = {
    "Box": "ground",
    "SpatialCertificate": "certificate",
    "SpatialContactMode": "modes",
    "SpatialContactSolution": "problem",
    "SpatialGround": "ground",
    "SpatialSolver": "modes",
    "SpatialStatus": "modes",
}
"""Where names of contact in space live."""


def __getattr__(name: str) -> Any:
    # What is for space is loaded only by those who ask for it.
    if name in _IN_SPACE:
        return getattr(importlib.import_module(f"{__name__}.spatial.{_IN_SPACE[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
