"""Whether an engine has our robot at all: free flight, and weight at rest."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from heelstrike.experiments.engine_comparison.entries import Entry
from heelstrike.experiments.engine_comparison.walking import walk_in
from heelstrike.experiments.engines.peer import flight
from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.experiments.engines.served import EngineProcesses, ServedPeer, lent, served
from heelstrike.experiments.laws import law_called
from heelstrike.field_texts import dataclass
from heelstrike.reader_process import ReaderProcess
from heelstrike.robot import Robot
from heelstrike.robot.model import Floats
from heelstrike.sim import EventDriven

FLIGHT_STEPS = (1e-3, 5e-4, 2.5e-4)
"""Steps (s) of the flights, each half the one before."""

FLOW = EventDriven(rtol=1e-12, atol=1e-13)
"""Our flight, exact to rounding."""

DOUBLE, SINGLE = 1e-6, 1e-3
"""How far an extrapolated flight may be from ours in double and single precision (m, rad)."""

REST, REST_STEP, REST_PERIOD = 1.0, 1e-3, 2e-3
"""How long a robot stands, in what steps, and how often its law is called, in s."""

WEIGHT = 0.01
"""Part of the weight by which the forces on a robot at rest may differ from it."""


@dataclass(frozen=True)
class Guards:
    """The results of :func:`guard` for an engine."""

    flight: float
    """Largest difference of a coordinate from ours at the end of a flight of 0.1 s, at the shortest
    of `FLIGHT_STEPS` (m, rad)."""
    order: float
    """Order in the step of the engine's flight, as its three steps tell."""
    extrapolated: float
    """The same difference, extrapolated to no step."""
    weight: float
    """Sum of normal forces on the robot at rest, in its weight."""
    sunk_m: float
    """How deep the deepest point is at rest, in m."""
    float32: bool
    """Whether the engine computes in single precision."""

    @property
    def holds(self) -> bool:
        """Whether the engine has our robot."""
        allowed = SINGLE if self.float32 else DOUBLE
        return self.extrapolated <= allowed and abs(self.weight - 1.0) <= WEIGHT


def guard(
    entry: Entry, robot: Robot, given: Mapping[str, Any], processes: EngineProcesses | None = None
) -> Guards:
    """Test that an engine has the same robot, by free flight and the weight at rest.

    Parameters
    ----------
    entry : Entry
        Its row.
    robot : Robot
        A robot that stands on flat feet.
    given : mapping
        Settings of the engine.
    processes : EngineProcesses, optional
        Where engines have been asked before; they are not ended.

    Returns
    -------
    Guards
        What it answers.

    Raises
    ------
    InvalidRunError
        If the engine is missing, ends, hangs or refuses.
    """
    scenario = flight(robot)
    ours = scenario.run(FLOW).position[-1]
    ends = []
    facts: dict[str, Any] = {}
    with lent(processes) as own:
        process = own.of(entry.package)
        for step in FLIGHT_STEPS:
            settings = {**given, **entry.exact}
            peer = served(entry.package, scenario, step, process=process, **settings)
            ends.append(_end(peer))
            facts = peer.facts
        weight, sunk = _at_rest(entry, robot, given, process)
    errors = [float(np.max(np.abs(end - ours))) for end in ends]
    first, second, third = ends
    apart = [float(np.max(np.abs(a - b))) for a, b in ((first, second), (second, third))]
    order = math.log2(apart[0] / apart[1]) if min(apart) > 0.0 else math.nan
    once = [2.0 * second - first, 2.0 * third - second]
    twice = (4.0 * once[1] - once[0]) / 3.0
    extrapolated = min(float(np.max(np.abs(each - ours))) for each in (twice, third))
    return Guards(errors[-1], order, extrapolated, weight, sunk, bool(facts["float32"]))


def _end(peer: ServedPeer) -> Floats:
    """Where a peer is at the end of its scenario."""
    peer.restart()
    rows = peer.record(peer.steps)
    return np.asarray(rows[-1, : peer.scenario.robot.nq])


def _at_rest(
    entry: Entry, robot: Robot, given: Mapping[str, Any], process: ReaderProcess
) -> tuple[float, float]:
    """Weight that the ground bears, in the robot's, and how deep its deepest point is (m)."""
    trial = law_called("JointFeedback").trial(robot, None)
    scenario = Scenario("at rest", robot, trial.state, REST)
    peer = served(entry.package, scenario, REST_STEP, process=process, **given)
    run = walk_in(peer, trial.controller, control_period=REST_PERIOD, name=entry.title)
    last = run.contact_force[-round(0.2 * len(run.time)) :, :, 0].sum(axis=1)
    return float(last.mean() / robot.weight), float(max(0.0, -run.gap[-1].min()))
