"""The ground, the contact problem, its solvers and their certificates."""

from heelstrike.contact.certificate import Certificate
from heelstrike.contact.ground import Ground
from heelstrike.contact.lcp import LcpSolution, solve_lcp
from heelstrike.contact.modes import ContactMode, Solver, SolveStatus
from heelstrike.contact.problem import ContactSolution, solve_contact

__all__ = [
    "Certificate",
    "ContactMode",
    "ContactSolution",
    "Ground",
    "LcpSolution",
    "SolveStatus",
    "Solver",
    "solve_contact",
    "solve_lcp",
]
