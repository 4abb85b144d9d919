"""A light that says whether the contact forces seen are proven ones."""

from __future__ import annotations

from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.compliant import Compliant
from heelstrike.sim.run import Run
from heelstrike.wording import counted

CERTIFIED = 1e-9
"""Largest residual of a certified contact problem, relative to the size of its data."""

NOTHING_YET = {"level": "none", "text": "nothing simulated yet"}
"""The light before there is anything to see."""


def light_of(run: Run) -> dict[str, str]:
    """Return the level of the light, ``good``, ``warn``, ``bad`` or ``none``, and what it says."""
    if isinstance(run.method, Compliant):
        sunk = 1e3 * run.certificates.penetration
        text = f"compliant ground: no contact problem; sunk in by {sunk:.2g} mm at most"
        return {"level": "none", "text": text}
    worst = run.certificates
    return certified_light(
        solves=run.solver.solves,
        fallbacks=run.solver.fallbacks,
        failures=run.solver.failures,
        residual=max(worst.complementarity, worst.cone, worst.non_penetration),
        failed=run.status is RunStatus.SOLVER_FAILED,
    )


def certified_light(
    *, solves: int, fallbacks: int, failures: int, residual: float, failed: bool
) -> dict[str, str]:
    """Return the light of contact problems, of which the worst has some residual."""
    if failures or failed:
        return {"level": "bad", "text": f"{_problems(failures)} without a solution"}
    text = f"{_problems(solves)} certified, residual ≤ {residual:.1g}"
    if not residual <= CERTIFIED:
        return {"level": "bad", "text": f"residual {residual:.2g} of a contact problem"}
    if fallbacks:
        return {"level": "warn", "text": f"{text}; {fallbacks} by another solver"}
    return {"level": "good", "text": text}


def _problems(number: int) -> str:
    return counted(number, "contact problem", "contact problems")
