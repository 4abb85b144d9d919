"""``heelstrike compare --engines all --whole``: the page of engines by one command."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from heelstrike.cli.engines import (
    InEngines,
    check,
    named,
    pushes_in_engines,
    refuse_a_quick_page,
    scenes_in_engines,
    write_page,
)
from heelstrike.cli.options import Walking
from heelstrike.cli.planning import with_gait
from heelstrike.cli.terminal import output, save_json, stage, tell
from heelstrike.errors import SimulationError

if TYPE_CHECKING:
    from heelstrike.experiments.engine_comparison import EngineComparison, SceneTable
    from heelstrike.experiments.engine_comparison.two_processes import Work
    from heelstrike.experiments.engines.served import EngineProcesses
    from heelstrike.experiments.walk import Case


def compare_whole(
    case: Case, asked: InEngines, walking: Walking, out: Path, *, as_json: bool
) -> None:
    """Compare all that the page has; tell how long it took."""
    from heelstrike.experiments.engine_comparison.two_processes import another_process
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
    with sitting(file, command):
        work = _work(case, asked, walking, out)
        with another_process(work) if asked.processes > 1 else nullcontext():
            try:
                comparison, scenes = _compared(work, case, asked, out, processes, as_json=as_json)
            finally:
                processes.end()
    if asked.page is not None:
        write_page(comparison, scenes, out, asked.page)
    sittings = taken(file)["sittings"]
    if as_json:
        typer.echo(json.dumps(taken(file), indent=2))
    wall, processor = (sum(each[k] for each in sittings) for k in ("wall_s", "processor_s"))
    tell(f"{wall / 60.0:.1f} min, of which {processor / 60.0:.1f} min of processor time; in {out}")


def _work(case: Case, asked: InEngines, walking: Walking, out: Path) -> Work:
    """Return what there is to do, with the gaits that are walked."""
    from heelstrike.experiments.engine_comparison.two_processes import Work
    from heelstrike.experiments.engine_comparison.whole import PARTS, QUICK
    from heelstrike.experiments.laws import law_called

    walks = []
    for part in QUICK if asked.quick else PARTS:
        own = with_gait(replace(case, law=law_called(part.law)), walking.gait)
        check(own)
        walks.append((part, replace(own, law=None)))
    names = asked.names if isinstance(asked.names, str) else tuple(asked.names)
    return Work(tuple(walks), names, out / "engines", fine=asked.fine, quick=asked.quick)


def _compared(
    work: Work, case: Case, asked: InEngines, out: Path, processes: EngineProcesses, *,
    as_json: bool,
) -> tuple[EngineComparison, SceneTable]:  # fmt: skip
    """Walk, push, and simulate the scenes; return the first walks, and the scenes."""
    from heelstrike.experiments.engine_comparison.settings import DEFAULTS
    from heelstrike.experiments.engine_comparison.two_processes import begun, compare_part
    from heelstrike.view.style import save_figure

    found = []
    for part, walked in work.walks:
        with stage(f"walking in engines under {part.law}") as show:
            comparison = compare_part(work, part, walked, processes, show.doing)
        start = begun(part, walked)
        name = named(start, replace(asked, period=part.control_period))
        save_json(out / f"engines-{name}.json", comparison.to_dict())
        found.append(comparison)
        if not as_json:
            output().print(comparison)
        if part.pushes:
            pushed = replace(asked, settings=DEFAULTS)
            pushes_in_engines(walked, start, pushed, out, as_json=as_json, processes=processes)
    scenes = scenes_in_engines(case, asked, out, as_json=as_json, processes=processes)
    save_figure(found[0].plot(scenes), out / f"engines{asked.suffix}.png")
    return found[0], scenes
