"""``heelstrike compare --engines all --whole``: the page of engines by one command."""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from heelstrike.cli.engines import (
    InEngines,
    check,
    friction_of,
    named,
    pushes_in_engines,
    refuse_a_quick_page,
    scenes_in_engines,
    write_page,
    written,
)
from heelstrike.cli.options import Walking
from heelstrike.cli.planning import with_gait
from heelstrike.cli.terminal import output, stage, tell
from heelstrike.errors import SimulationError

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

    from heelstrike.experiments.engine_comparison import EngineComparison, SceneTable
    from heelstrike.experiments.engine_comparison.whole import Part
    from heelstrike.experiments.engines.served import EngineProcesses
    from heelstrike.experiments.walk import Beginning, Case

    Progress = Callable[[str, float], None]


def compare_whole(
    case: Case, asked: InEngines, walking: Walking, out: Path, *, as_json: bool
) -> None:
    """Compare all that the page has; tell how long it took."""
    from heelstrike.experiments.engine_comparison.whole import sitting, taken
    from heelstrike.experiments.engines.served import EngineProcesses

    if walking.controller is not None:
        raise SimulationError("--controller: the whole comparison has laws of its own. Leave out")
    asked.refuse_beside_whole()
    refuse_a_quick_page(asked)
    out.mkdir(parents=True, exist_ok=True)
    file = out / f"whole{asked.suffix}.json"
    processes = EngineProcesses()
    options = "".join(f" --{each}" for each in ("quick", "fine") if getattr(asked, each))
    command = f"heelstrike compare {case.robot.name} --engines {asked.engines} --whole{options}"
    with sitting(file, command), _helped(case, asked, walking, out):
        try:
            comparison, scenes = _compared(case, asked, walking, out, processes, as_json=as_json)
        finally:
            processes.end()
    if asked.page is not None:
        write_page(comparison, scenes, out, asked.page)
    sittings = taken(file)["sittings"]
    if as_json:
        typer.echo(json.dumps(taken(file), indent=2))
    wall, processor = (sum(each[k] for each in sittings) for k in ("wall_s", "processor_s"))
    tell(f"{wall / 60.0:.1f} min, of which {processor / 60.0:.1f} min of processor time; in {out}")


def _compared(
    case: Case, asked: InEngines, walking: Walking, out: Path, processes: EngineProcesses, *,
    as_json: bool,
) -> tuple[EngineComparison, SceneTable]:  # fmt: skip
    """Walk, push, and simulate the scenes; return the first walks, and the scenes."""
    from heelstrike.experiments.engine_comparison.settings import DEFAULTS
    from heelstrike.view.style import save_figure

    found = []
    for part, own, start in _parts(case, asked, walking):
        with stage(f"walking in engines under {part.law}") as show:
            comparison = _walked(part, own, start, asked, out, processes, show.doing)
        name = named(start, replace(asked, period=part.control_period))
        written(out / f"engines-{name}.json", comparison)
        found.append(comparison)
        if not as_json:
            output().print(comparison)
        if part.pushes:
            pushed = replace(asked, settings=DEFAULTS)
            pushes_in_engines(own, start, pushed, out, as_json=as_json, processes=processes)
    scenes = scenes_in_engines(case, asked, out, as_json=as_json, processes=processes)
    save_figure(found[0].plot(scenes), out / f"engines{asked.suffix}.png")
    return found[0], scenes


def _parts(
    case: Case, asked: InEngines, walking: Walking
) -> Iterator[tuple[Part, Case, Beginning]]:
    """Return the parts of the comparison, each with what is walked and its beginning."""
    from heelstrike.experiments.engine_comparison.whole import PARTS, QUICK
    from heelstrike.experiments.laws import law_called
    from heelstrike.experiments.walk import beginning

    for part in QUICK if asked.quick else PARTS:
        own = with_gait(replace(case, law=law_called(part.law)), walking.gait)
        check(own)
        yield part, own, beginning(own.robot, own.gait, own.ground, own.law)


def _walked(
    part: Part, case: Case, start: Beginning, asked: InEngines, out: Path,
    processes: EngineProcesses, progress: Progress,
) -> EngineComparison:  # fmt: skip
    """Walk a part of the whole comparison."""
    from heelstrike.experiments.engine_comparison import compare_engines
    from heelstrike.experiments.engine_comparison.whole import LONGEST

    assert start.controller is not None
    assert case.followed is not None
    return compare_engines(
        case.robot,
        start.controller,
        case.followed,
        engines=asked.names,
        steps=part.steps,
        step_sizes=part.step_sizes + (part.finer if asked.fine else ()),
        settings=part.settings,
        control_period=part.control_period,
        friction=friction_of(case),
        folder=out / "engines",
        longest=LONGEST if asked.fine else None,
        processes=processes,
        progress=progress,
    )


@contextmanager
def _helped(case: Case, asked: InEngines, walking: Walking, out: Path) -> Iterator[None]:
    """Have another process fill the folder of rows from the last engine on, for a while."""
    if asked.processes < 2:
        yield
        return
    spawn = multiprocessing.get_context("spawn")
    enough = spawn.Event()
    helper = spawn.Process(target=_from_the_last, args=(case, asked, walking, out, enough))
    helper.start()
    try:
        yield
    finally:
        enough.set()
        helper.join()


class _EnoughError(Exception):
    """What there was to do has been done."""


def _from_the_last(
    case: Case, asked: InEngines, walking: Walking, out: Path, enough: Event
) -> None:
    """Walk, push and simulate in the engines from the last one on; rows are kept as they come.

    The other process begins with the first engine. Where they meet, each finds what the other has
    done.
    """
    from heelstrike.experiments.engine_comparison import (
        compare_compass,
        compare_pushes,
        compare_scenes,
    )
    from heelstrike.experiments.engine_comparison.entries import entries_called
    from heelstrike.experiments.engine_comparison.whole import PATIENCE
    from heelstrike.experiments.engines.served import EngineProcesses

    def progress(text: str, share: float) -> None:  # noqa: ARG001
        if enough.is_set():
            raise _EnoughError

    processes = EngineProcesses()
    names = list(reversed(entries_called(asked.names)))
    own = replace(asked, engines=",".join(names))
    shared: Any = {
        "engines": names, "folder": out / "engines", "processes": processes, "progress": progress
    }  # fmt: skip
    try:
        for part, walked, start in _parts(case, own, walking):
            _walked(part, walked, start, own, out, processes, progress)
            if part.pushes:
                assert start.controller is not None
                assert walked.followed is not None
                compare_pushes(
                    walked.robot, start.controller, walked.followed,
                    friction=friction_of(walked), control_period=part.control_period, **shared,
                )  # fmt: skip
        compare_scenes(steps=(), patience=PATIENCE, **shared)
        if not asked.quick:
            compare_compass(**shared)
    except (_EnoughError, KeyboardInterrupt):
        pass
    finally:
        processes.end()
