"""``heelstrike compare --engines``: the same walk in other engines."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heelstrike.cli.terminal import output, print_found, save_json, stage, tell, wrote
from heelstrike.cli.values import numbers_called
from heelstrike.errors import SimulationError

if TYPE_CHECKING:
    from heelstrike.experiments.engine_comparison import EngineComparison, SceneTable
    from heelstrike.experiments.engines.served import EngineProcesses
    from heelstrike.experiments.walk import Beginning, Case

QUICK_STEPS, QUICK_SIZES = 4, (1e-3,)
"""Walking steps and step sizes (s) of a quick comparison."""
QUICK_SEARCH: Mapping[str, Any] = {"strides": 2, "halvings": 1}
"""How it searches for the largest push."""


@dataclass(frozen=True)
class InEngines:
    """Which engines a walk is compared in, and how."""

    engines: Annotated[
        str | None,
        typer.Option(
            metavar="all|NAME,...",
            help="Walk in other engines instead: their names, separated by commas.",
        ),
    ] = None
    settings: Annotated[
        str, typer.Option(help="Settings of the engines: defaults, best, or defaults,best.")
    ] = "defaults,best"
    sizes: Annotated[
        str | None,
        typer.Option(
            help="Step sizes of the engines in s, separated by commas.",
            show_default="2e-3,1e-3,5e-4,2e-4",
        ),
    ] = None
    period: Annotated[
        float, typer.Option(help="Seconds between two calls of the law, in engines.")
    ] = 2e-3
    search: Annotated[
        bool,
        typer.Option("--search", help="Search for the best settings of the engines instead."),
    ] = False
    scenes: Annotated[
        bool,
        typer.Option(
            "--scenes",
            help="Also run scenes with closed forms and the compass gait, and check the robots.",
        ),
    ] = False
    pushes: Annotated[
        bool,
        typer.Option(
            "--largest-push", help="Search for the largest push that is stood in engines, too."
        ),
    ] = False
    page: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Write a page of the walks and scenes in --out."),
    ] = None
    films: Annotated[
        bool, typer.Option("--films", help="Write films of the walks in engines that fall.")
    ] = False
    quick: Annotated[
        bool, typer.Option("--quick", help="For engines: only four steps at 1 ms, and few pushes.")
    ] = False
    whole: Annotated[
        bool,
        typer.Option(
            "--whole",
            help="Compare all that the page has: walks under two laws, pushes, scenes, compass "
            "gait. It goes on where it was interrupted.",
        ),
    ] = False
    fine: Annotated[
        bool,
        typer.Option(
            "--fine",
            help="With --whole: also steps of 0.1 and 0.05 ms, in walks of at most two minutes.",
        ),
    ] = False

    processes: Annotated[
        int,
        typer.Option(
            min=1,
            max=2,
            help="With --whole: processes that walk at once, one from the first engine on and one "
            "from the last.",
        ),
    ] = 2

    @property
    def names(self) -> list[str] | str:
        """Names of the engines."""
        assert self.engines is not None
        names = self.engines.split(",")
        return "all" if names == ["all"] else names

    @property
    def suffix(self) -> str:
        """What ends the names of files of quick comparisons, which others are not lost to."""
        return "-quick" if self.quick else ""

    def refuse_without_engines(self) -> None:
        """Refuse options of engines where none is asked for."""
        if given := self._given("engines"):
            raise SimulationError(
                f"{', '.join(given)}: for other engines only. Add --engines all, or leave out"
            )

    def refuse_beside_search(self) -> None:
        """Refuse options that the search for the best settings has no use for."""
        if given := self._given("engines", "search"):
            raise SimulationError(
                f"{', '.join(given)}: the search for the best settings walks at a step of 1 ms "
                "under a law that is called every 2 ms. Leave out, or leave --search out"
            )

    def refuse_beside_whole(self) -> None:
        """Refuse options that the whole comparison decides, or that ask for part of it."""
        if given := self._given("engines", "page", "quick", "whole", "fine", "processes"):
            raise SimulationError(
                f"{', '.join(given)}: the whole comparison has its own walks, scenes and pushes. "
                "Leave out, or leave --whole out"
            )
        if self.quick and self.fine:
            raise SimulationError("--fine: a quick comparison has no fine steps. Leave one out")

    def _given(self, *but: str) -> list[str]:
        """Return options that are not as usual, but for some."""
        usual = InEngines()
        return [
            f"--{'largest-push' if name == 'pushes' else name}"
            for name in vars(usual)
            if name not in but and getattr(self, name) != getattr(usual, name)
        ]


def compare_in_engines(
    case: Case, start: Beginning, asked: InEngines, steps: int, out: Path, *, as_json: bool
) -> None:
    """Walk a case in other engines; tell, write and draw what came of it."""
    from heelstrike.experiments.engine_comparison import compare_engines
    from heelstrike.experiments.engine_comparison.comparison import STEP_SIZES
    from heelstrike.experiments.engine_comparison.two_processes import walk_of
    from heelstrike.view.style import save_figure

    check(case)
    if asked.search:
        asked.refuse_beside_search()
        _search(case, start, asked, steps, out, as_json=as_json)
        return
    refuse_a_quick_page(asked)
    if asked.fine:
        raise SimulationError("--fine: for the whole comparison only. Add --whole, or use --sizes")
    if asked.processes != InEngines().processes:
        raise SimulationError("--processes: for the whole comparison only. Add --whole")
    sizes: tuple[float, ...] = QUICK_SIZES if asked.quick else STEP_SIZES
    if asked.sizes is not None:
        sizes = tuple(numbers_called(asked.sizes, "--sizes"))
    with stage("walking in engines") as show:
        comparison = compare_engines(
            **walk_of(case, start),
            engines=asked.names,
            steps=QUICK_STEPS if asked.quick else steps,
            step_sizes=sizes,
            settings=asked.settings.split(","),
            control_period=asked.period,
            folder=out / "engines",
            films=asked.films,
            progress=show.doing,
        )
    law = named(start, asked, sizes)
    told = comparison.to_dict()
    save_json(out / f"engines-{law}.json", told)
    print_found(comparison, told, as_json=as_json)
    figure = out / f"engines{asked.suffix}.png"
    save_figure(comparison.plot(), figure)
    tell(f"in {out}: engines-{law}.json, {figure.name}")
    table = scenes_in_engines(case, asked, out, as_json=as_json) if asked.scenes else None
    if table is not None:
        save_figure(comparison.plot(table), figure)
    if asked.pushes:
        pushes_in_engines(case, start, asked, out, as_json=as_json)
    if asked.page is not None:
        write_page(comparison, table, out, asked.page)


def refuse_a_quick_page(asked: InEngines) -> None:
    """Refuse a page of a quick comparison."""
    if asked.quick and asked.page is not None:
        raise SimulationError(
            "--page: quick comparisons are left out of pages. Leave out, or leave --quick out"
        )


def named(start: Beginning, asked: InEngines, sizes: Sequence[float] = ()) -> str:
    """Name of a comparison in files: its law, and what is not as usual.

    That is how often the law is called, at which steps (s) of the engines, and whether it is quick.
    """
    from heelstrike.experiments.engine_comparison.comparison import CONTROL_PERIOD, STEP_SIZES

    name = type(start.controller).__name__
    if asked.period != CONTROL_PERIOD:
        name += f"-every-{1e3 * asked.period:g}-ms"
    if asked.sizes is not None and sizes and tuple(sizes) != STEP_SIZES:
        name += f"-at-{'-'.join(f'{1e3 * size:g}' for size in sizes)}-ms"
    return name + asked.suffix


def scenes_in_engines(
    case: Case, asked: InEngines, out: Path, *, as_json: bool,
    processes: EngineProcesses | None = None,
) -> SceneTable:  # fmt: skip
    """Ask engines for scenes whose ends are known, and whether they have the robot at all."""
    from dataclasses import asdict

    from heelstrike.experiments.engine_comparison import compare_compass, compare_scenes, guard
    from heelstrike.experiments.engine_comparison.compass_table import STEPS as COMPASS_STEPS
    from heelstrike.experiments.engine_comparison.entries import entries_called
    from heelstrike.experiments.engine_comparison.scene_table import STEPS
    from heelstrike.experiments.engine_comparison.whole import PATIENCE
    from heelstrike.experiments.engines import InvalidRunError
    from heelstrike.experiments.engines.served import lent

    landing: tuple[float, ...] = () if asked.quick else STEPS
    walker: tuple[float, ...] = QUICK_SIZES if asked.quick else COMPASS_STEPS
    if asked.quick and asked.whole:
        walker = ()  # it would take longest
    with lent(processes) as own:
        shared: Any = {"engines": asked.names, "processes": own, "folder": out / "engines"}
        with stage("simulating scenes with closed forms") as show:
            table = compare_scenes(steps=landing, patience=PATIENCE, progress=show.doing, **shared)
        with stage("walking the compass gait down its slope") as show:
            passive = compare_compass(steps=walker, progress=show.doing, **shared)
        guards: dict[str, dict[str, object]] = {}
        with stage("asking whether engines have the robot") as show:
            for name, entry in entries_called(asked.names).items():
                show.doing(f"asking whether {entry.title} has the robot", 0.0)
                try:
                    found = guard(entry, case.robot, entry.given, own)
                except InvalidRunError as error:
                    guards[name] = {"reason": str(error)}
                else:
                    guards[name] = asdict(found) | {"holds": found.holds}
    name = f"scenes{asked.suffix}.json"
    save_json(out / name, {**table.to_dict(), "guards": guards, "compass": passive.to_dict()})
    if not as_json:
        output().print(table)
        output().print(passive)
    tell(f"in {out}: {name}")
    return table


def pushes_in_engines(
    case: Case, start: Beginning, asked: InEngines, out: Path, *, as_json: bool,
    processes: EngineProcesses | None = None,
) -> None:  # fmt: skip
    """Search for the largest push that is stood in engines."""
    from heelstrike.experiments.engine_comparison import compare_pushes
    from heelstrike.experiments.engine_comparison.two_processes import walk_of

    with stage("pushing in engines") as show:
        table = compare_pushes(
            **walk_of(case, start),
            engines=asked.names,
            settings=asked.settings.split(","),
            control_period=asked.period,
            folder=out / "engines",
            processes=processes,
            progress=show.doing,
            **(QUICK_SEARCH if asked.quick else {}),
        )
    name = f"pushes-{named(start, asked)}.json"
    save_json(out / name, table.to_dict())
    if not as_json:
        output().print(table)
    tell(f"in {out}: {name}")


def write_page(
    comparison: EngineComparison, scenes: SceneTable | None, out: Path, page: Path
) -> None:
    """Write the page of all that lies in a folder, and its figure beside it."""
    from heelstrike.experiments.engine_comparison.page import engines_page
    from heelstrike.view.style import save_figure
    from heelstrike.whole_file import write_whole

    images = page.parent / "images"
    images.mkdir(parents=True, exist_ok=True)
    figure = images / f"{page.stem}.png"
    wrote(write_whole(page, engines_page(out, f"images/{figure.name}")))
    save_figure(comparison.plot(scenes), figure)
    tell(f"{page}, {figure}")


def check(case: Case) -> None:
    """Refuse what engines are not asked for."""
    ground = case.ground.model()
    level = case.ground.shape is None and not ground.vertices[:, 1].any()
    if not level or case.pushes or ground.restitution.any():
        raise SimulationError(
            "engines are compared on level ground without restitution or pushes: leave --ground, "
            "--restitution and --push out"
        )
    if case.followed is None:
        raise SimulationError(
            "engines are compared by a walk that follows a gait; this controller follows none"
        )


def _search(
    case: Case, start: Beginning, asked: InEngines, steps: int, out: Path, *, as_json: bool
) -> None:
    """Search for the best settings, and write them with what made them."""
    from dataclasses import asdict

    from heelstrike.experiments.engine_comparison import search
    from heelstrike.experiments.engine_comparison.comparison import CONTROL_PERIOD
    from heelstrike.experiments.engine_comparison.entries import entries_called
    from heelstrike.experiments.engine_comparison.two_processes import walk_of
    from heelstrike.experiments.engine_comparison.walk import Walk
    from heelstrike.experiments.engines import InvalidRunError
    from heelstrike.experiments.engines.packages import peers
    from heelstrike.whole_file import write_whole

    walk = Walk(**walk_of(case, start), steps=steps, control_period=CONTROL_PERIOD, patience=60.0)
    versions = peers(load=False)
    file = out / "best_settings.json"
    out.mkdir(parents=True, exist_ok=True)
    found = json.loads(file.read_text()) if file.exists() else {}
    told: dict[str, object] = {}
    for name, entry in entries_called(asked.names).items():
        with stage(f"searching for the best settings of {entry.title}") as show:
            try:
                best = search.search_settings(
                    name, entry, walk, versions, lambda text: show.doing(text, 0.0)
                )
            except InvalidRunError as error:
                tell(f"{entry.title}: {error}")
                told[name] = {"reason": str(error)}
                continue
        told[name] = found[name] = asdict(best)
        write_whole(file, json.dumps(found, indent=2) + "\n")
        tell(f"{entry.title}: {dict(best.settings) or 'the defaults'}, {best.error:.2g}")
    walk.processes.end()
    if as_json:
        typer.echo(json.dumps(told, indent=2))
    wrote(file)
