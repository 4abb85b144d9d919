"""A light that says whether the contact forces seen are proven ones."""

from __future__ import annotations

from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.compliant import Compliant
from heelstrike.sim.run import Run
from heelstrike.wording import counted

CERTIFIED = 1e-9
"""Largest residual of a certified contact problem, relative to the size of its data."""


def light_of(run: Run | None) -> dict[str, str]:
    """Return the level of the light, ``good``, ``warn``, ``bad`` or ``none``, and what it says."""
    if run is None:
        return {"level": "none", "text": "nothing simulated yet"}
    if isinstance(run.method, Compliant):
        sunk = 1e3 * run.certificates.penetration
        text = f"compliant ground: no contact problem; sunk in by {sunk:.2g} mm at most"
        return {"level": "none", "text": text}
    worst = run.certificates
    residual = max(worst.complementarity, worst.cone, worst.non_penetration)
    solver = run.solver
    if solver.failures or run.status is RunStatus.SOLVER_FAILED:
        return {"level": "bad", "text": f"{_problems(solver.failures)} without a solution"}
    text = f"{_problems(solver.solves)} certified, residual ≤ {residual:.1g}"
    if not residual <= CERTIFIED:
        return {"level": "bad", "text": f"residual {residual:.2g} of a contact problem"}
    if solver.fallbacks:
        return {"level": "warn", "text": f"{text}; {solver.fallbacks} by another solver"}
    return {"level": "good", "text": text}


def _problems(number: int) -> str:
    return counted(number, "contact problem", "contact problems")
