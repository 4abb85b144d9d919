"""The whole comparison by two processes: one from the first engine on, one from the last.

Both keep their rows in one folder. Where they meet, each finds what the other has done.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heelstrike.experiments.engine_comparison.comparison import EngineComparison, compare_engines
from heelstrike.experiments.engine_comparison.compass_table import compare_compass
from heelstrike.experiments.engine_comparison.entries import entries_called
from heelstrike.experiments.engine_comparison.pushes import compare_pushes
from heelstrike.experiments.engine_comparison.scene_table import compare_scenes
from heelstrike.experiments.engine_comparison.whole import LONGEST, PATIENCE, Part
from heelstrike.experiments.engines.served import EngineProcesses
from heelstrike.experiments.laws import law_called
from heelstrike.experiments.walk import Beginning, Case, beginning
from heelstrike.field_texts import dataclass

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Work:
    """What the whole comparison does."""

    walks: tuple[tuple[Part, Case], ...]
    """Its parts, each with what is walked. A part names its law, as laws do not reach another
    process."""
    engines: tuple[str, ...] | str
    """Names of engines; ``"all"`` is all of them."""
    folder: Path
    """Where rows are kept as they come."""
    fine: bool = False
    """Whether the finer steps are walked, too."""
    quick: bool = False
    """Whether the compass gait is left out."""


def begun(part: Part, case: Case) -> Beginning:
    """Return what the walk of a case begins with, under the law of a part."""
    return beginning(case.robot, case.gait, case.ground, law_called(part.law))


def walk_of(case: Case, start: Beginning) -> dict[str, Any]:
    """Return the robot, controller, gait and friction of a walk, as comparisons ask for them."""
    assert start.controller is not None
    assert case.followed is not None
    return {
        "robot": case.robot,
        "controller": start.controller,
        "gait": case.followed,
        "friction": case.lowest_friction,
    }


def compare_part(
    work: Work, part: Part, case: Case, processes: EngineProcesses, progress: Progress
) -> EngineComparison:
    """Walk a part of the whole comparison.

    Parameters
    ----------
    work : Work
        The whole.
    part : Part
        Which steps and settings.
    case : Case
        What is walked.
    processes : EngineProcesses
        Of the engines; they are not ended.
    progress : callable
        Called before each walk with a text, and the share of walks that is done.

    Returns
    -------
    EngineComparison
        A row each engine, settings and step.
    """
    return compare_engines(
        **walk_of(case, begun(part, case)),
        engines=work.engines,
        steps=part.steps,
        step_sizes=part.step_sizes + (part.finer if work.fine else ()),
        settings=part.settings,
        control_period=part.control_period,
        folder=work.folder,
        longest=LONGEST if work.fine else None,
        processes=processes,
        progress=progress,
    )


@contextmanager
def another_process(work: Work) -> Iterator[None]:
    """Have another process fill the folder of rows from the last engine on, for a while.

    Parameters
    ----------
    work : Work
        What there is to do.
    """
    spawn = multiprocessing.get_context("spawn")
    enough = spawn.Event()
    backwards = replace(work, engines=tuple(reversed(entries_called(work.engines))))
    helper = spawn.Process(target=_fill, args=(backwards, enough))
    helper.start()
    try:
        yield
    finally:
        enough.set()
        helper.join()


class _EnoughError(Exception):
    """What there was to do has been done."""


def _fill(work: Work, enough: Event) -> None:
    """Walk, push and simulate until it is enough; rows are kept as they come."""

    def progress(text: str, share: float) -> None:  # noqa: ARG001
        if enough.is_set():
            raise _EnoughError

    processes = EngineProcesses()
    shared: Any = {
        "engines": work.engines,
        "folder": work.folder,
        "processes": processes,
        "progress": progress,
    }
    try:
        for part, case in work.walks:
            compare_part(work, part, case, processes, progress)
            if part.pushes:
                _push(part, case, shared)
        compare_scenes(steps=(), patience=PATIENCE, **shared)
        if not work.quick:
            compare_compass(**shared)
    except (_EnoughError, KeyboardInterrupt):
        pass
    finally:
        processes.end()


def _push(part: Part, case: Case, shared: Any) -> None:
    walk = walk_of(case, begun(part, case))
    compare_pushes(**walk, control_period=part.control_period, **shared)
