"""``heelstrike zoo``: what controllers withstand on robots, in one table and one figure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli.options import (
    METHOD,
    Afresh,
    AsJson,
    Method,
    Reading,
    Step,
    Workers,
    method_called,
)
from heelstrike.cli.terminal import (
    many,
    print_found,
    spoken,
    stage,
    tell,
    this_command,
    wrote,
)

ROBOTS = "bravo7,geyer7,spring_flamingo,rabbit,human7,walker2d"


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def zoo(
    *,
    robots: Annotated[
        str,
        typer.Option(
            help="Built-in robots, and MJCF, URDF or SDF files, with commas between; a file with a "
            "comma in its name in double quotes."
        ),
    ] = ROBOTS,
    controllers: Annotated[
        str | None, typer.Option(help="Controllers, with commas between.", show_default="all")
    ] = None,
    disturbances: Annotated[
        str | None, typer.Option(help="Disturbances, with commas between.", show_default="all")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of the phases of pushes and of rough ground.")
    ] = 0,
    trials: Annotated[
        int | None,
        typer.Option(
            min=1, help="Phases of a push, and shapes of rough ground.", show_default="4; quick 1"
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A coarse and fast table.")] = False,
    method: Annotated[Method, typer.Option(help=METHOD)] = Method.TIME_STEPPING,
    step: Step = 1e-3,
    workers: Workers = None,
    how: Reading,
    out: Annotated[
        Path,
        typer.Option(
            file_okay=False, help="Folder of the results and gaits; the search resumes from it."
        ),
    ] = Path("zoo"),
    page: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Page to write.", show_default="zoo.md in --out"),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(
            dir_okay=False,
            help="Figure to write (SVG, PNG or PDF).",
            show_default="zoo.svg in --out",
        ),
    ] = None,
    afresh: Afresh = False,
    as_json: AsJson = False,
) -> None:
    """Find how large a disturbance each controller withstands on each robot.

    Every finished cell is saved in zoo.json; after Ctrl-C the same command resumes. Writes
    zoo.csv, a page and a figure, too. The options of reading are for files.
    """
    with stage("loading"):
        from heelstrike.experiments.zoo import campaign
        from heelstrike.experiments.zoo.table import on_terminal
        from heelstrike.experiments.zoo.writing import Targets

        entries = campaign.chosen_controllers(controllers)
        kinds = campaign.chosen_disturbances(disturbances)
        machines = campaign.loaded(robots, how.keywords())
        targets = Targets(out, page or out / "zoo.md", figure or out / "zoo.svg")
    settings = campaign.QUICK if quick else campaign.USUAL
    with many("measuring") as show:

        def reached(progress: campaign.Progress) -> None:
            wrote(*progress.files)
            show(progress.finished, progress.cells, progress.doing)

        results = campaign.zoo(
            machines,
            controllers=entries,
            disturbances=kinds,
            settings=replace(settings, seed=seed, trials=trials or settings.trials),
            method=method_called(method, step),
            folder=out,
            afresh=afresh,
            workers=workers,
            progress=reached,
        )
    with stage("writing"):
        wrote(*targets.write(results, this_command()))
    print_found(on_terminal(results), results.to_dict(), as_json=as_json)
    tell(f"in {out}: zoo.json, zoo.csv; {targets.page}, {targets.figure}")
