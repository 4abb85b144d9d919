"""One scenario in every engine, in turn: whose runs count, and what a step of each costs."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from heelstrike.experiments.engines import Engine, InvalidRunError, Peer, Scenario, check_flight
from heelstrike.sim import TimeStepping
from speed.stopwatch import TURN, Work, best_of, steps_in_slot, timed

STEP = 1e-3
BEGIN = 0.2
"""Part of a run that is over before its steps are timed, unless it is said when that begins."""
ELSEWHERE = 0.1
"""How far from ours a peer may end a walk or a fall, in m and rad, for its times to count.

Soft contacts and steps of 1 ms lead up to 0.07 away; who falls, or meets no stops, is farther.
"""


def race(
    scenario: Scenario,
    engines: dict[str, Engine],
    *,
    part: bool,
    seconds: float,
    least: int = 5,
    controller: Any = None,
    same_motion: bool = True,
    same_end: bool = True,
    alike: bool | None = None,
    begin: float | None = None,
) -> dict[str, Any]:
    """Time the steps of each engine.

    Each runs for two times, in turn; a step costs the difference by the steps between. Where all
    steps cost the same, the rest of the shorter run is what it takes to set a run of ours up.

    Parameters
    ----------
    scenario : Scenario
    engines : dict
        Engines by name.
    part : bool
        Whether to time Pinocchio's forward dynamics, a part of a step, too.
    seconds, least : float, int
        How long to go on, and how often each runs at least.
    controller : controller, optional
        What heelstrike does instead of the scenario's law.
    same_motion : bool
        Ask every engine for a flight like ours, and, of what does not stand, for an end like ours.
    same_end : bool
        Whether an end unlike ours makes a peer's run invalid, where nothing stands.
    alike : bool, optional
        Whether all steps cost the same, so that a part of the run does; by default if it stands.
    begin : float, optional
        When the steps begin that are timed (s).

    Returns
    -------
    dict
        `<name>_us` by engine, `heelstrike_setup_us` where it can be told; `<name>_check` and
        `<name>_invalid` say why it counts, or not.
    """
    row: dict[str, Any] = {}
    method = TimeStepping(step=STEP)
    try:
        row["heelstrike_check"] = _check(scenario, controller)
    except InvalidRunError as error:
        return {"invalid": str(error)}
    alike = scenario.contacts is not None if alike is None else alike

    def run(duration: float) -> float:
        shorter = replace(scenario, duration=duration)
        return timed(shorter.run, method, controller=controller)[1]

    def first_of(all_steps: int) -> int:
        return round(BEGIN * all_steps if begin is None else begin / STEP)

    steps = {"heelstrike": round(scenario.duration / STEP)}
    if alike:
        run(scenario.duration)
        once = run(scenario.duration) / steps["heelstrike"]
        steps["heelstrike"] = steps_in_slot(once, most=steps["heelstrike"])
    first = {"heelstrike": first_of(steps["heelstrike"])}
    runs = {"heelstrike": lambda count: run(count * STEP)}
    for name, engine in engines.items():
        try:
            peer, row[f"{name}_check"] = _valid(
                engine, scenario, same_motion=same_motion, same_end=same_end
            )
            steps[name] = peer.steps
            if alike:
                steps[name] = steps_in_slot(peer.run() / peer.steps, most=peer.steps)
        except Exception as error:  # of one engine must not lose what the others found
            row[f"{name}_invalid"] = reason(error)
            continue
        first[name], runs[name] = first_of(steps[name]), peer.run
    works: dict[str, Work] = {}
    for name, running in runs.items():
        works[name] = partial(running, steps[name])
        works[f"{name}, begin"] = partial(running, first[name])
    if part:
        try:
            works["pinocchio_part"], row["pinocchio_part_check"] = _forward_dynamics(scenario)
            steps["pinocchio_part"], first["pinocchio_part"] = 1, 0
        except Exception as error:
            row["pinocchio_part_invalid"] = reason(error)
    best = best_of(works, seconds=seconds, least=least, turn=TURN)
    for name, count in steps.items():
        if name in best:
            span = best[name] - best.get(f"{name}, begin", 0.0)
            row[f"{name}_us"] = 1e6 * span / (count - first[name])
    ours = row["heelstrike_us"]
    if alike:
        row["heelstrike_setup_us"] = 1e6 * best["heelstrike, begin"] - first["heelstrike"] * ours
    row["times_faster"] = {name: row[f"{name}_us"] / ours for name in engines if name in best}
    return row


def reason(error: Exception) -> str:
    """Why a run of an engine does not count, in words."""
    if isinstance(error, InvalidRunError):
        return str(error)
    return f"{type(error).__name__}: {error}"


def _check(scenario: Scenario, controller: Any) -> dict[str, float]:
    """Check that our run is physically valid; return what was found."""
    result = scenario.run(TimeStepping(step=STEP), controller=controller, record_every=1)
    if not result.completed:
        raise InvalidRunError(result.message)
    worst = result.certificates
    turning = np.abs(result.velocity[:, 2:]).sum(axis=1).max()
    # The gap is linear in the step: a vertex at the end of a foot turns out of that line.
    allowed = 1e-9 + 0.5 * 0.13 * (turning * STEP) ** 2
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
        carried = result.contact_force[..., 0].sum(axis=1) / scenario.robot.weight
        found["weight_carried"] = float(carried[-1])
        if scenario.feedback is None:  # nothing moves in it: points may share its weight anyhow
            still = np.abs(carried - 1.0).max() <= 1e-9 and np.all(result.gap <= 1e-9)
        else:
            still = abs(carried[-1] - 1.0) <= 1e-2 and np.all(active[1:] == scenario.contacts)
        if not still:
            raise InvalidRunError(
                f"{active.min()} to {active.max()} contacts carry {carried.min():.3g} to "
                f"{carried.max():.3g} of the weight"
            )
    return found


def _valid(
    engine: Engine, scenario: Scenario, *, same_motion: bool, same_end: bool
) -> tuple[Peer, dict[str, Any]]:
    """Return the peer of a scenario, and what was found of it, if its steps count."""
    peer = engine.peer(scenario, STEP)
    check: dict[str, Any] = {}
    if same_motion:
        check["flight_error"] = check_flight(engine, scenario.robot)
    if scenario.contacts is not None:
        peer.settle(peer.settling)
    check |= peer.check()
    if same_motion and same_end and scenario.contacts is None:
        check["end_error"] = _end_error(peer, scenario)
    if peer.lacks:
        check["lacks"] = ", ".join(peer.lacks)
    return peer, check


def _end_error(peer: Peer, scenario: Scenario) -> float:
    """How far from ours a peer has ended, in m and rad; too far is invalid."""
    ours = scenario.run(TimeStepping(step=peer.step)).position[-1]
    error = float(np.max(np.abs(peer.state().q - ours)))
    if not error <= ELSEWHERE:
        raise InvalidRunError(f"it ends {error:.2g} m or rad from where it should")
    return error


def _forward_dynamics(scenario: Scenario) -> tuple[Work, dict[str, float]]:
    from heelstrike.experiments.engines.pinocchio_peer import ForwardDynamics

    part = ForwardDynamics(scenario)
    return part.run, part.check()
