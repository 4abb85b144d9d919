"""The ground, the contact problem, its solvers and their certificates."""

from heelstrike.contact.certificate import Certificate
from heelstrike.contact.force_distribution import ForceDistribution
from heelstrike.contact.forward_dynamics import ContactForwardDynamics, contact_forward_dynamics
from heelstrike.contact.ground import Ground
from heelstrike.contact.inverse_dynamics import ContactInverseDynamics, contact_inverse_dynamics
from heelstrike.contact.kinematics import ContactKinematics, contact_kinematics
from heelstrike.contact.lcp import LcpSolution, solve_lcp
from heelstrike.contact.modes import ContactMode, Solver, SolveStatus
from heelstrike.contact.problem import ContactSolution, solve_contact

__all__ = [
    "Certificate",
    "ContactForwardDynamics",
    "ContactInverseDynamics",
    "ContactKinematics",
    "ContactMode",
    "ContactSolution",
    "ForceDistribution",
    "Ground",
    "LcpSolution",
    "SolveStatus",
    "Solver",
    "contact_forward_dynamics",
    "contact_inverse_dynamics",
    "contact_kinematics",
    "solve_contact",
    "solve_lcp",
]
