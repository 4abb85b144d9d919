"""Work and precision: how far from the truth after 1 s of walking, for how much computing.

The truth is the walk on exact hard contact: the event-driven solution at the tightest tolerance.
That it is the limit of time stepping, too, is checked: its error must fall with the step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.experiments.benchmark import own, scenarios
from heelstrike.experiments.benchmark.scenarios import Scenario
from heelstrike.experiments.benchmark.stopwatch import Work, best_of
from heelstrike.sim import Compliant, EventDriven, EventKind, HuntCrossley, Scheme, TimeStepping
from heelstrike.sim.engine import Method

Floats = NDArray[np.float64]

GOAL = 1e-4
"""Error in a joint's last position that is asked for, in rad."""

LONGEST = 20.0
"""Settings that would take longer than this (s) are left out."""


@dataclass(frozen=True)
class _Setting:
    """One point of a curve."""

    series: str
    knob: str
    work: Work
    final: Callable[[], Floats]


def measure_precision(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Error and time of every method at several settings."""
    scenario = scenarios.walking()
    reference = own.run(scenario, EventDriven(rtol=1e-12, atol=1e-14), record_every=own.NEVER)
    truth = reference.position[-1]
    impacts = sorted({round(e.time, 6) for e in reference.events if e.kind is EventKind.TOUCHDOWN})
    joints = scenario.robot.model.actuator_joint
    points = []
    for setting in _settings(scenario, quick=quick, peers=peers):
        first = setting.work()
        if first > LONGEST:
            continue
        seconds = first
        if first < 1.0:
            seconds = best_of({"": setting.work}, seconds=0.02 if quick else 0.5, least=3)[""]
        final = setting.final()
        error = float(np.max(np.abs(final - truth)[joints]))
        if np.isfinite(error):
            points.append(
                {
                    "series": setting.series,
                    "knob": setting.knob,
                    "seconds": seconds,
                    "error_rad": error,
                }
            )
    return {
        "scenario": scenario.name,
        "duration_s": scenario.duration,
        "goal_rad": GOAL,
        "touchdowns_s": impacts,
        "points": points,
        "to_goal": _to_goal(points),
    }


def _settings(scenario: Scenario, *, quick: bool, peers: Sequence[str]) -> Iterable[_Setting]:
    for rtol in (1e-5, 1e-8) if quick else (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
        adaptive = EventDriven(rtol=rtol, atol=1e-2 * rtol, output_period=None)
        yield _own(scenario, "EventDriven", f"rtol {rtol:.0e}", adaptive)
    steps = (1e-3, 1e-4) if quick else (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6)
    schemes = [Scheme.GAP_LINEARISED]
    if not quick:
        schemes += [Scheme.LINEARLY_IMPLICIT, Scheme.MOREAU_JEAN]
    for scheme in schemes:
        for step in steps:
            method = TimeStepping(step=step, scheme=scheme)
            name = f"TimeStepping, {scheme.name.lower().replace('_', ' ')}"
            yield _own(scenario, name, f"h {step:.0e} s", method)
    for factor in () if quick else (1.0, 10.0, 100.0, 1000.0):
        law = HuntCrossley()
        law = HuntCrossley(stiffness=factor * law.stiffness, exponent=law.exponent)
        yield _own(scenario, "Compliant", f"stiffness × {factor:g}", Compliant(law=law))
    if "mujoco" not in peers:
        return
    from heelstrike.experiments.benchmark.mujoco_peer import MuJoCoPeer, Options

    small = (1e-3, 1e-4) if quick else (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6)
    # The settings that came nearest in a search over time constants from 2 to 10 steps, friction
    # impedance ratios from 1 to 1000, both cones, and direct stiffness of the contacts.
    ways: list[tuple[str, float | None]] = [("euler", None), ("euler", 5.0), ("rk4", 2.0)]
    if not quick:
        ways += [("euler", 2.0), ("euler", 10.0), ("implicitfast", 5.0), ("rk4", None)]
    for integrator, stiff in ways:
        for step in small:
            tolerance = None if stiff is None else 1e-10
            options = Options(step=step, integrator=integrator, stiff=stiff, tolerance=tolerance)
            peer = MuJoCoPeer(scenario, options)
            yield _Setting(options.label, f"h {step:.0e} s", peer.work, peer.final_position)


def _own(scenario: Scenario, series: str, knob: str, method: Method) -> _Setting:
    last: list[Floats] = []

    def work() -> float:
        run = own.run(scenario, method)
        last[:] = [run.position[-1]] if run.completed else [np.full(scenario.robot.nq, np.nan)]
        return run.timing.wall_s

    return _Setting(series, knob, work, lambda: last[0])


def _to_goal(points: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Least time in which each side reaches the goal; the best error of those that do not."""
    sides = {
        "heelstrike": [p for p in points if not p["series"].startswith("MuJoCo")],
        "mujoco": [p for p in points if p["series"].startswith("MuJoCo")],
    }
    found: dict[str, Any] = {}
    for side, its in sides.items():
        if not its:
            continue
        good = [p for p in its if p["error_rad"] <= GOAL]
        if good:
            found[side] = min(good, key=lambda p: p["seconds"])
        else:
            found[f"{side}_best"] = min(its, key=lambda p: p["error_rad"])
    if "heelstrike" in found and ("mujoco" in found or "mujoco_best" in found):
        other = found.get("mujoco") or found["mujoco_best"]
        found["times_less"] = other["seconds"] / found["heelstrike"]["seconds"]
    return found
