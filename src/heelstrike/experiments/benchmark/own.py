"""heelstrike's own side of a comparison."""

from __future__ import annotations

import numpy as np

from heelstrike.experiments.benchmark.scenarios import Scenario
from heelstrike.experiments.benchmark.stopwatch import Work
from heelstrike.sim import Controller, Run, TimeStepping, simulate
from heelstrike.sim.method import Method
from heelstrike.sim.whole_run import whole

NEVER = 2**62
"""Steps between two rows of a run of which only the end is wanted."""


class InvalidRunError(Exception):
    """A run that does not count, and why."""


def controller(scenario: Scenario, *, own: bool) -> Controller | None:
    """Controller of a scenario."""
    return scenario.own if own and scenario.own is not None else scenario.feedback


def run(
    scenario: Scenario,
    method: Method,
    *,
    own: bool = False,
    record_every: int = NEVER,
) -> Run:
    """Simulate a scenario."""
    return whole(
        simulate(
            scenario.robot,
            controller(scenario, own=own),
            state=scenario.state,
            duration=scenario.duration,
            method=method,
            ground=scenario.ground,
            record_every=record_every,
            stop_when_fallen=False,
        )
    )


def work(scenario: Scenario, method: Method, *, own: bool = False) -> Work:
    """Work that simulates a scenario and counts the seconds of the simulation itself."""
    return lambda: run(scenario, method, own=own).timing.wall_s


def check(scenario: Scenario, *, step: float, own: bool = False) -> dict[str, float]:
    """Check that a time-stepping run of a scenario is physically valid; return what was found.

    Raises
    ------
    InvalidRunError
        If the robot sank into the ground or fell, contact problems were not solved to 1e-9, or,
        where it stands, the ground does not carry its weight.
    """
    result = run(scenario, TimeStepping(step=step), own=own, record_every=1)
    if not result.completed:
        raise InvalidRunError(result.message)
    worst = result.certificates
    turning = np.abs(result.velocity[:, 2:]).sum(axis=1).max()
    # The gap is linear in the step: a vertex at the end of a foot turns out of that line.
    allowed = 1e-9 + 0.5 * 0.13 * (turning * step) ** 2
    if worst.penetration > allowed:
        raise InvalidRunError(f"penetration {worst.penetration:.1e} m, allowed are {allowed:.1e} m")
    if max(worst.complementarity, worst.cone, worst.non_penetration) > 1e-9:
        raise InvalidRunError(f"contact problems solved to {worst} only")
    if result.solver.failures:
        raise InvalidRunError(f"{result.solver.failures} contact problems without a solution")
    active = (result.contact_force[..., 0] > 0.0).sum(axis=1)
    found = {
        "penetration_m": worst.penetration,
        "complementarity": worst.complementarity,
        "active_contacts": float(active.mean()),
        "steps": float(result.steps),
    }
    if scenario.contacts is not None:
        if not np.all(active[1:] == scenario.contacts):
            raise InvalidRunError(f"{active.min()} to {active.max()} contacts carry load")
        carried = result.contact_force[-1, :, 0].sum() / scenario.robot.weight
        found["weight_carried"] = float(carried)
        if abs(carried - 1.0) > 1e-2:
            raise InvalidRunError(f"the ground carries {carried:.3f} of the weight")
    return found
