"""``heelstrike campaign``: thousands of trials of a walk with other numbers, and one verdict."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heelstrike.cli.options import Afresh, AsJson, Workers, method_called
from heelstrike.cli.terminal import (
    complain,
    many,
    output,
    print_found,
    spoken,
    stage,
    tell,
    this_command,
    wrote,
)

if TYPE_CHECKING:
    from heelstrike.experiments.campaigns import CampaignResults, Progress

USAGE = "FILE.toml | replay DIR NUMBER | verdict DIR"


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def campaign(
    what: Annotated[
        list[str],
        typer.Argument(
            metavar=USAGE,
            help="The file of a campaign; or the folder of one, whose trial is walked again, or "
            "whose trials so far are judged.",
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False, help="Folder of the outcomes; the campaign resumes from it.",
            show_default="the file's name without .toml",
        ),
    ] = None,
    workers: Workers = None,
    processes: Annotated[
        int | None,
        typer.Option(min=1, help="Processes instead of threads; one that dies is replaced."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://…", help="Dask scheduler whose workers do the work."),
    ] = None,
    film: Annotated[
        bool, typer.Option("--film/--no-film", help="Write a film and a page of a replayed trial.")
    ] = True,
    afresh: Afresh = False,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Simulate many trials of a walk, each with other numbers.

    Outcomes are saved in campaign.sqlite, block by block. After Ctrl-C, or if the process is
    killed, the same command resumes, with the same result.
    """
    match what:
        case ["replay", folder, number] if number.isdecimal():
            _replay(Path(folder), int(number), film=film, as_json=as_json)
        case ["verdict", folder]:
            with stage("loading"):
                from heelstrike.experiments.campaigns.file import kept_campaign

                made, _ = kept_campaign(Path(folder), method_called)
                results = made.load(folder)
            _tell(results, Path(folder), as_json=as_json)
        case [file] if file not in ("replay", "verdict"):
            into = out or Path(Path(file).stem)
            results = _run(file, into, workers, processes, scheduler, afresh=afresh)
            wrote(into)
            _tell(results, into, as_json=as_json)
            tell(f"heelstrike campaign replay {into} NUMBER walks a trial again")
        case _:
            complain(f"write heelstrike campaign {USAGE}")
            raise typer.Exit(2)


def _run(
    file: str, folder: Path, workers: int | None, processes: int | None, scheduler: str | None,
    *, afresh: bool,
) -> CampaignResults:  # fmt: skip
    with stage("loading"):
        from heelstrike.experiments.campaigns.file import load_campaign
        from heelstrike.experiments.campaigns.workers import dask_client, process_pool

        made, limit = load_campaign(file, folder, method_called)
        executor = None
        if scheduler is not None:
            executor = dask_client(scheduler)
        elif processes is not None:
            executor = process_pool(processes)
    with many("simulating") as show:

        def reached(progress: Progress) -> None:
            if not progress.finished:
                return
            left = f", {progress.left:.0f} s left" if progress.rate > 0.0 else ""
            told = (
                f"{100.0 * progress.success / progress.finished:.1f} % walked on, "
                f"{progress.rate:.1f} trials/s{left}"
            )
            show(progress.finished, progress.trials, {told: progress.finished / progress.trials})

        return made.run(
            folder, executor=executor, workers=workers, limit=limit, progress=reached,
            afresh=afresh,
        )  # fmt: skip


def _tell(results: CampaignResults, folder: Path, *, as_json: bool) -> None:
    """Print the verdict, and write its page."""
    with stage("judging"):
        from heelstrike.experiments.campaigns.page import save_campaign_page
        from heelstrike.experiments.campaigns.verdict import verdict

        found = verdict(results)
        page = save_campaign_page(results, folder / "verdict.html", command=this_command())
    wrote(page)
    told = {
        "trials": len(results), "success": found.success.count,
        "interval": [found.success.low, found.success.high], "causes": results.causes,
        "worst": found.worst,
    }  # fmt: skip
    print_found(str(found), told, as_json=as_json)
    tell(f"in {folder}: campaign.sqlite, verdict.html")


def _replay(folder: Path, number: int, *, film: bool, as_json: bool) -> None:
    with stage("loading"):
        from heelstrike.errors import SimulationError
        from heelstrike.experiments.campaigns.file import kept_campaign
        from heelstrike.view.page.page import save_html

        made, _ = kept_campaign(folder, method_called)
        if number >= len(made):
            raise SimulationError(f"{folder} has trials 0 to {len(made) - 1}, and no {number}")
    with stage(f"walking trial {number}"):
        run = made.replay(number)
        gait = made.gait(number)
    files = []
    if film and len(run.time):
        with stage("filming"):
            page, movie = (folder / f"trial-{number}{end}" for end in (".html", ".mp4"))
            files += [save_html(run, page, gait=gait, command=this_command()), run.animate(movie)]
    wrote(*map(Path, files))
    values = made.plan.of(number)
    summary = run.summary(gait=gait)
    if as_json:
        typer.echo(json.dumps({"values": values, "summary": json.loads(summary.to_json())}))
        return
    told = ", ".join(
        f"{name} {each:.6g}" if isinstance(each, float) else f"{name} {each}"
        for name, each in values.items()
    )
    output().print(f"trial {number}: {told}\n{summary}")
    if files:
        tell(f"in {folder}: {', '.join(Path(each).name for each in files)}")
