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
from heelstrike.experiments.benchmark.engines import PACKAGES, simulators
from heelstrike.experiments.benchmark.peer import Peer, Setting, reason
from heelstrike.experiments.benchmark.scenarios import Scenario
from heelstrike.experiments.benchmark.stopwatch import Work, best_of
from heelstrike.sim import Compliant, EventDriven, EventKind, HuntCrossley, Scheme, TimeStepping
from heelstrike.sim.method import Method

Floats = NDArray[np.float64]

GOAL = 1e-4
"""Error in a joint's last position that is asked for, in rad."""


@dataclass(frozen=True)
class _Setting:
    """One point of a curve."""

    side: str
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
    points: list[dict[str, Any]] = []
    failures = []
    for setting in _settings(scenario, quick=quick, peers=peers):
        about = {"side": setting.side, "series": setting.series, "knob": setting.knob}
        try:
            seconds, final = _run(setting, quick=quick)
        except Exception as error:  # of one engine must not lose what the others found
            failures.append({**about, "reason": reason(error)})
            continue
        error_rad = float(np.max(np.abs(final - truth)[joints]))
        if np.isfinite(error_rad):
            points.append({**about, "seconds": seconds, "error_rad": error_rad})
        else:
            failures.append({**about, "reason": "it does not get through the walk"})
    return {
        "scenario": scenario.name,
        "duration_s": scenario.duration,
        "goal_rad": GOAL,
        "touchdowns_s": impacts,
        "points": points,
        "failures": failures,
        "to_goal": _to_goal(points),
    }


def _run(setting: _Setting, *, quick: bool) -> tuple[float, Floats]:
    """Least seconds that a setting takes, and where it ends."""
    seconds = setting.work()
    if seconds < 1.0:
        seconds = best_of({"": setting.work}, seconds=0.02 if quick else 0.5, least=3)[""]
    return seconds, setting.final()


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
    for name, engine in simulators(peers).items():
        for setting in engine.settings(quick):
            yield _theirs(name, scenario, setting)


def _theirs(side: str, scenario: Scenario, setting: Setting) -> _Setting:
    made: list[Peer] = []

    def work() -> float:
        if not made:
            made.append(setting.make(scenario))
        return made[0].run()

    return _Setting(side, setting.series, setting.knob, work, lambda: made[0].state().q)


def _own(scenario: Scenario, series: str, knob: str, method: Method) -> _Setting:
    last: list[Floats] = []

    def work() -> float:
        run = own.run(scenario, method)
        last[:] = [run.position[-1]] if run.completed else [np.full(scenario.robot.nq, np.nan)]
        return run.timing.wall_s

    return _Setting("heelstrike", series, knob, work, lambda: last[0])


def _to_goal(points: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Least time in which each side reaches the goal; the best error of those that do not."""
    found: dict[str, Any] = {}
    for side in dict.fromkeys(point["side"] for point in points):
        its = [point for point in points if point["side"] == side]
        good = [point for point in its if point["error_rad"] <= GOAL]
        if good:
            found[side] = min(good, key=lambda point: point["seconds"])
        else:
            found[f"{side}_best"] = min(its, key=lambda point: point["error_rad"])
    if "heelstrike" in found:
        ours = found["heelstrike"]["seconds"]
        found["times_less"] = {
            side: (found.get(side) or found[f"{side}_best"])["seconds"] / ours
            for side in PACKAGES
            if side in found or f"{side}_best" in found
        }
    return found
