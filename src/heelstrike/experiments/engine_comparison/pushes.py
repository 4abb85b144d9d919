"""The largest push that a walk stands in every engine, under the same law.

The robot walks and is pushed in our event-driven run, the truth; each engine takes over at the end
of the push, with the state that the robot has by then and a law that remembers what came before.
So all engines begin with the very same disturbance, and none has to know of forces from outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from heelstrike.analysis import recovery
from heelstrike.analysis.stability.largest import Largest, largest
from heelstrike.analysis.told_summary import PlainEntries
from heelstrike.arguments import takes
from heelstrike.errors import SimulationError
from heelstrike.experiments.engine_comparison.comparison import CONTROL_PERIOD
from heelstrike.experiments.engine_comparison.entries import Entry, entries_called
from heelstrike.experiments.engine_comparison.kept import KeptRows, asked_of_engine
from heelstrike.experiments.engine_comparison.settings import DEFAULTS, settings_of
from heelstrike.experiments.engine_comparison.walk import TRUTH, Start, Walk
from heelstrike.experiments.engine_comparison.walking import seen
from heelstrike.experiments.engines.packages import peers
from heelstrike.experiments.engines.peer import InvalidRunError
from heelstrike.experiments.engines.served import EngineProcesses, lent
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait
from heelstrike.robot import Robot, State
from heelstrike.sim import Controller, Push, Run, TimeStepping
from heelstrike.sim.controller.law import Law
from heelstrike.sim.method import Method
from heelstrike.sim.run import QUANTITIES
from heelstrike.tolerances import SAME_ROW
from heelstrike.view.terminal import bare_table

STEP = 1e-3
"""Step of the engines (s)."""
UNDISTURBED, PHASE = 2, 0.5
"""Steps before the push, and the part of the next one that is done when it begins."""
LASTING = 0.1
"""How long it lasts, in s."""
SETTLED = 7.0
"""How long after it the walk has to be normal again, in s."""
MOST, STRIDES, HALVINGS = 240.0, 8, 3
"""Largest impulse tried (N s), and how the largest that is stood is searched for."""
DIRECTIONS: Mapping[str, float] = {"forward": 1.0, "backward": -1.0}
"""Where it goes, and the sign of its force."""

UNPUSHED = "does not walk unpushed"
"""What is said where a walk fails without a push."""

OURS: Mapping[str, Method] = {
    "event-driven": TRUTH,
    "heelstrike": TimeStepping(step=STEP),
}
"""Our own rows."""


@dataclass(frozen=True)
class PushRow:
    """The largest push in an engine."""

    engine: str
    """Name of the row's engine, or of our simulation method."""
    title: str
    """What tables call it."""
    settings: str
    """``defaults`` or ``best``."""
    direction: str
    """``forward`` or ``backward``."""
    largest: Largest | None
    """Largest impulse that is stood, as are all smaller ones tried, and the least that is not (N
    s); None if nothing came of it."""
    reason: str
    """Why nothing came of it."""


@dataclass(frozen=True, eq=False)
class PushTable(PlainEntries):
    """The largest pushes in every engine."""

    robot: str
    """Name of the robot."""
    rows: tuple[PushRow, ...]
    """Engine by engine."""

    def __rich__(self) -> Table:
        title = f"{self.robot}: largest push that is stood, N s"
        table = bare_table(title, ("engine", "settings", "direction"))
        table.add_column("largest push")
        for row in self.rows:
            found = row.reason if row.largest is None else str(row.largest)
            if row.largest is not None and row.largest.failed == 0.0:
                found = UNPUSHED
            table.add_row(row.title, row.settings, row.direction, found)
        return table


@takes(SimulationError)
def compare_pushes(
    robot: Robot,
    controller: Law | Controller,
    gait: Gait,
    *,
    engines: Sequence[str] | str = "all",
    settings: Sequence[str] = (DEFAULTS,),
    friction: float = 0.75,
    most: float = MOST,
    strides: int = STRIDES,
    halvings: int = HALVINGS,
    control_period: float = CONTROL_PERIOD,
    folder: Path | str | None = None,
    processes: EngineProcesses | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> PushTable:
    """Find the largest push on the trunk that a walk stands, in every engine.

    The push begins in the middle of the third step and lasts 0.1 s; a walk stands it as
    :func:`~heelstrike.recovery` judges, 7 s later.

    Parameters
    ----------
    robot : Robot
        A planar robot that floats.
    controller : law or controller
        What moves it.
    gait : Gait
        What it follows, and where it begins.
    engines : sequence of str or str
        Names of the engines; ``"all"`` is all of them.
    settings : sequence of str
        ``"defaults"``, ``"best"`` or both.
    friction : float
        Coefficient of the ground.
    most : float
        Largest impulse tried, in N s.
    strides, halvings : int
        Impulses tried upwards to it, and how often the stride in which the walk first fails is
        halved.
    control_period : float
        Seconds between two calls of the controller.
    folder : path, optional
        Where rows are kept as they come, to go on from there.
    processes : EngineProcesses, optional
        Where engines have been asked before; they are not ended.
    progress : callable, optional
        Called before each search with a text, and the share of them that is done.

    Returns
    -------
    PushTable
        A row each engine, settings and direction; ours first.

    Raises
    ------
    SimulationError
        If there is no engine of a name, or a number is not positive.
    """
    entries = entries_called(engines)
    with lent(processes) as own:
        walk = Walk(robot, controller, gait, UNDISTURBED, control_period, friction, 60.0, own)
        versions = peers(load=False)
        kept = KeptRows(
            folder if walk.can_be_told else None, walk.entries(), ("walk", "walking", "pushes")
        )
        asked: list[tuple[str, str, str, Any, Callable[[float], bool]]] = []
        for direction, sign in DIRECTIONS.items():
            for name, method in OURS.items():
                title = f"heelstrike, {'event-driven' if method is TRUTH else 'time stepping'}"
                by_ours = partial(stands_by_ours, walk, method, sign)
                asked.append((name, title, direction, [DEFAULTS], by_ours))
            for name, entry in entries.items():
                for which in settings:
                    given = settings_of(name, entry, which)
                    in_engine = partial(stands_in, walk, entry, given, versions, sign)
                    told = asked_of_engine(entry.package, given, versions)
                    asked.append((name, entry.title, direction, [which, told], in_engine))
        say = progress or (lambda text, share: None)  # noqa: ARG005
        rows = []
        for k, (name, title, direction, told, recovers) in enumerate(asked):
            say(f"{title}, pushed {direction}", k / len(asked))
            search = {"most": most, "strides": strides, "halvings": halvings}
            try:
                found = kept.entries(
                    f"push-{name}-{told[0]}-{direction}",
                    [name, direction, told, search],
                    partial(_searched, recovers, search),
                )
            except InvalidRunError as error:
                rows.append(PushRow(name, title, told[0], direction, None, str(error)))
                continue
            if found["failed"] is None:
                found["failed"] = math.inf
            rows.append(PushRow(name, title, told[0], direction, Largest(**found), ""))
    return PushTable(robot.name, tuple(rows))


def _searched(recovers: Callable[[float], bool], search: Mapping[str, Any]) -> dict[str, Any]:
    return asdict(largest(recovers, unit="N s", **search))


def pushed(walk: Walk, impulse: float) -> tuple[Push, float]:
    """Return a push on the trunk, forward if positive (N s), and when all is judged.

    Its window is a whole number of control periods.

    Parameters
    ----------
    walk : Walk
        What is pushed.
    impulse : float
        N s.
    """
    period = walk.control_period
    begin = period * round((UNDISTURBED + PHASE) * walk.gait.step_duration / period)
    lasting = period * round(LASTING / period)
    trunk = 2  # of a planar robot that floats: behind its two slides
    push = Push(trunk, force=(impulse / lasting, 0.0), start=begin, duration=lasting)
    return push, push.end + SETTLED


def stands(walk: Walk, run: Run, push: Push) -> bool:
    """Whether a walk recovers from a push.

    Parameters
    ----------
    walk : Walk
        What was pushed.
    run : Run
        What became of it, from the end of the push on.
    push : Push
        The push.
    """
    speed = walk.gait.step_length / walk.gait.step_duration
    return bool(recovery(run, pushed=(push.start, push.end), normal_speed=speed, after=SETTLED))


def since(run: Run, begin: float) -> Run:
    """Return a run without what was before a time: all that an engine knows that takes over then.

    Parameters
    ----------
    run : Run
        The run, which lasts that long.
    begin : float
        When (s).
    """
    later = run.time >= begin - SAME_ROW
    return replace(
        run,
        time=run.time[later],
        **{name: getattr(run, name)[later] for name in QUANTITIES},
        events=tuple(event for event in run.events if event.time >= begin - SAME_ROW),
    )


def stands_by_ours(walk: Walk, method: Method, sign: float, impulse: float) -> bool:
    """Whether a walk recovers from a push by a method of ours.

    Parameters
    ----------
    walk : Walk
        What is pushed.
    method : Method
        The simulation method.
    sign : float
        1 forward, -1 backward.
    impulse : float
        N s, at least 0.
    """
    push, until = pushed(walk, sign * impulse)
    run = walk.ours(method, pushes=[push], until=until)
    return run.time[-1] >= push.end and stands(walk, since(run, push.end), push)


def stands_in(
    walk: Walk, entry: Entry, given: Mapping[str, Any], versions: Mapping[str, str], sign: float,
    impulse: float,
) -> bool:  # fmt: skip
    """Whether a walk recovers from a push in an engine.

    Parameters
    ----------
    walk : Walk
        What is pushed.
    entry : Entry
        The engine's row.
    given : mapping
        Its settings.
    versions : mapping
        What :func:`~heelstrike.experiments.engines.peers` says of the engines.
    sign : float
        1 forward, -1 backward.
    impulse : float
        N s, at least 0.

    Raises
    ------
    InvalidRunError
        If the engine is missing, ends, hangs or refuses.
    """
    push, until = pushed(walk, sign * impulse)
    past = walk.past(push)
    if not past.completed:
        return False
    start = Start(
        told_the_past(walk, past), State(past.position[-1], past.velocity[-1]), push.end, until
    )
    run, _ = walk.run_in(entry, STEP, given, versions, start)
    return stands(walk, run, push)


def told_the_past(walk: Walk, past: Run) -> Any:
    """Return the controller of a walk with the memory that it has at the end of a run.

    Parameters
    ----------
    walk : Walk
        Whose controller it is.
    past : Run
        What it has seen, every control period.
    """
    asked, period = walk.asked(), walk.control_period
    for k in range(round(past.time[-1] / period)):
        row = int(np.searchsorted(past.time, k * period + 1e-9, side="right")) - 1
        q = past.position[row]
        contacts = seen(walk.robot, q, past.contact_force[row])
        asked.torque(k * period, State(q, past.velocity[row]), contacts)
    return asked
