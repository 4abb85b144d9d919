"""Work and precision: how far from the truth after 1 s of walking, for how much computing.

The truth is the walk on exact hard contact: the event-driven solution at the tightest tolerance.
That it is the limit of time stepping, too, is checked: its error must fall with the step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.experiments.engines import Engine, Peer, Scenario, simulators
from heelstrike.sim import Compliant, EventDriven, EventKind, HuntCrossley, Scheme, TimeStepping
from heelstrike.sim.method import Method
from speed import scenarios
from speed.race import reason
from speed.stopwatch import Work, best_of

Floats = NDArray[np.float64]

GOAL = 1e-4
"""Error in a joint's last position that is asked for, in rad."""


STEPS = [2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 5e-6]
QUICK_STEPS = [1e-3, 1e-4]


@dataclass(frozen=True)
class _Setting:
    """One point of a curve."""

    side: str
    series: str
    knob: str
    work: Work
    final: Callable[[], Floats]


def measure(*, quick: bool, peers: Sequence[str]) -> dict[str, Any]:
    """Error and time of every method at several settings."""
    scenario = scenarios.walking()
    reference = scenario.run(EventDriven(rtol=1e-12, atol=1e-14))
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
    schemes = [Scheme.IMPACT_RESOLVED]
    if not quick:
        schemes += [Scheme.LINEARLY_IMPLICIT, Scheme.MOREAU_JEAN]
    for scheme in schemes:
        for step in QUICK_STEPS if quick else STEPS:
            method = TimeStepping(step=step, scheme=scheme)
            name = f"TimeStepping, {scheme.name.lower().replace('_', ' ')}"
            yield _own(scenario, name, f"h {step:.0e} s", method)
    for factor in () if quick else (1.0, 10.0, 100.0, 1000.0):
        law = HuntCrossley()
        law = HuntCrossley(stiffness=factor * law.stiffness, exponent=law.exponent)
        yield _own(scenario, "Compliant", f"stiffness × {factor:g}", Compliant(law=law))
    for name, engine in simulators(peers).items():
        for series, how, steps in _ways(name, engine, quick=quick):
            for step in steps:
                yield _theirs(
                    name, series, f"h {step:.0e} s", partial(engine.peer, scenario, step, **how)
                )


Way = tuple[str, dict[str, Any], Sequence[float]]


def _ways(name: str, engine: Engine, *, quick: bool) -> Iterable[Way]:
    """Curves of an engine: name, how it is asked to simulate, steps."""
    if quick and name in ("bullet", "dart"):
        yield engine.label, {}, (1e-3,)
    elif name == "bullet":
        yield "Bullet", {}, (1e-3, 1e-4, 1e-5)
    elif name == "dart":
        # With its own detector the error grows again below 20 µs; with FCL it falls on.
        yield "DART, collisions by DART", {"detector": "DART"}, (1e-3, 1e-4, 2e-5)
        yield "DART, collisions by FCL", {"detector": "FCL"}, (1e-3, 1e-4, 3e-6)
    elif name == "drake":
        # Contacts as rigid as SAP makes them come nearest: in a search over the approximations,
        # stiffness from 1e5 to 1e12 N/m, dissipation from 1 to 1000 s/m, stiction speed, SAP's
        # relaxation time and threshold of near rigidity.
        if not quick:
            stiff = {"stiffness": 1e10, "dissipation": 30.0, "stiction": 1e-5}
            yield f"{engine.label}, default contacts", {}, (1e-3, 2e-4)
            lagged = {"approximation": "lagged"}
            yield "Drake lagged, default contacts", lagged, (1e-3, 2e-4)
            yield "Drake lagged, contacts of 1e+10 N/m", lagged | stiff, (1e-3, 1e-4)
        rigid = {"approximation": "sap", "stiffness": 1e12, "near_rigid": 0.1}
        yield ("Drake sap, contacts of 1e+12 N/m", rigid, (1e-3,) if quick else (1e-3, 1e-4, 5e-6))
    elif name == "mujoco":
        # The settings that came nearest in a search over time constants from 2 to 10 steps,
        # friction impedance ratios from 1 to 1000, both cones, and direct stiffness of contacts.
        ways = [("euler", None), ("euler", 5.0), ("rk4", 2.0)]
        if not quick:
            ways += [("euler", 2.0), ("euler", 10.0), ("implicitfast", 5.0), ("rk4", None)]
        for integrator, stiff in ways:
            steps = QUICK_STEPS if quick else STEPS
            if stiff is None:  # softness is all of the error long before
                steps = [step for step in steps if step >= 5e-5]
                yield f"MuJoCo {integrator}, default contacts", {"integrator": integrator}, steps
            else:
                how = {"integrator": integrator, "stiff": stiff, "tolerance": 1e-10}
                yield f"MuJoCo {integrator}, contacts stiff to {stiff:g} steps", how, steps


def _theirs(side: str, series: str, knob: str, make: Callable[[], Peer]) -> _Setting:
    made: list[Peer] = []

    def work() -> float:
        if not made:
            made.append(make())
        return made[0].run()

    return _Setting(side, series, knob, work, lambda: made[0].state().q)


def _own(scenario: Scenario, series: str, knob: str, method: Method) -> _Setting:
    last: list[Floats] = []

    def work() -> float:
        run = scenario.run(method)
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
            for side in dict.fromkeys(point["side"] for point in points)
            if side != "heelstrike"
        }
    return found
