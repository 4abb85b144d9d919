"""``heelstrike report``: runs judged on one page, from their files or walked for it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    SEVERAL,
    USUAL_METHOD,
    AsJson,
    Method,
    Reading,
    Step,
    Steps,
    Walking,
)
from heelstrike.cli.planning import FIRST_TIME, asked_for, methods_asked, with_gait
from heelstrike.cli.terminal import (
    FAILED,
    output,
    spoken,
    stage,
    tell,
    tell_interruption,
    this_command,
    wrote,
)

if TYPE_CHECKING:
    from heelstrike.analysis.diagnosis.changes import Tried
    from heelstrike.gait import Gait
    from heelstrike.sim import Run

OF_A_WALK = (
    *("steps", "method", "step", "tries"),
    *(each.name for group in (Walking, Reading) for each in fields(group) if each.name != "gait"),
)
"""Options that say how a robot walks, and nothing to a run that is read."""


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def report(
    *,
    context: typer.Context,
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="ROBOT|RUN.nc...",
            help="A robot to walk, by its name or file; or files of runs.",
        ),
    ],
    out: Annotated[Path, typer.Option(dir_okay=False, help="Page to write.")] = Path("report.html"),
    walking: Walking,
    steps: Steps = 10,
    method: Annotated[
        list[Method] | None,
        typer.Option(help=SEVERAL, show_default=USUAL_METHOD),
    ] = None,
    step: Step = 1e-3,
    tries: Annotated[
        bool, typer.Option(help="Walk again with pushes, slopes and what the report would change.")
    ] = True,
    how: Reading,
    as_json: AsJson = False,
) -> None:
    """Judge runs on one page: why it fell, margins, what it withstands, what to change, film.

    The gait of a run that is read is the one of --gait, or of the gait.json beside it. The exit
    status is 0 if all runs lasted to their end, 1 if not.
    """
    from heelstrike.experiments.what_if import NO_CONTROLLER, tried_beside
    from heelstrike.sim.run import Run
    from heelstrike.view.page.page import check_page
    from heelstrike.view.report import report

    check_page(out)
    files = [each for each in what if each.endswith(".nc")]
    if files and len(files) < len(what):
        raise typer.BadParameter("give either files of runs, or one robot to walk; not both")
    if files:
        _refuse_options_of_a_walk(context)
        runs, followed = _read(files, walking.gait)
        tried: dict[str, tuple[Tried, ...]] = {
            name: (NO_CONTROLLER,) for name, run in runs.items() if isinstance(run, Run)
        }
    elif len(what) > 1:
        raise typer.BadParameter("give one robot; repeat --method to compare methods")
    else:
        asked = asked_for(what[0], how, walking, steps=steps)
        methods = methods_asked(asked, method or (), step)
        asked = with_gait(asked, walking.gait)
        followed = asked.followed
        cases = {name: replace(asked, method=through) for name, through in methods.items()}
        runs = {}
        for name, case in cases.items():
            with stage(f"walking {steps} steps ({name})", when_slow=FIRST_TIME) as going:
                runs[name] = case.run(going.reached)
        tried = {}
        for name, run in runs.items() if tries else ():
            with stage("trying pushes, slopes and changes", when_slow=FIRST_TIME):
                tried[name] = tried_beside(cases[name], run)
    _stop_if_interrupted(runs)
    with stage("writing the report"):
        only = next(iter(runs.values()))
        shown = runs if len(runs) > 1 else only
        named = (
            tried if len(runs) > 1 else dict(zip((only.robot.name,), tried.values(), strict=False))
        )
        wrote(report(shown, out, gait=followed, command=this_command(), tried=named))
    _tell(runs, followed, out, tried, as_json=as_json)


def _refuse_options_of_a_walk(context: typer.Context) -> None:
    for name in OF_A_WALK:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            raise typer.BadParameter(
                "this option is for a robot that is walked, and files of runs were "
                "given: leave it out",
                param_hint=f"--{name.replace('_', '-')}",
            )


def _read(files: list[str], gait: Path | None) -> tuple[dict[str, Run], Gait | None]:
    """Load runs by the names of their files, and the gait that they followed, if it is known."""
    from heelstrike.gait import load_gait
    from heelstrike.robot import Robot
    from heelstrike.sim import load_run

    with stage("reading"):
        short = len({Path(each).stem for each in files}) == len(files)
        runs = {Path(each).stem if short else each: load_run(each) for each in files}
        robot = next(iter(runs.values())).robot
        planar = isinstance(robot, Robot)
        if gait is None and planar:
            beside = {
                path for each in files if (path := Path(each).with_name("gait.json")).exists()
            }
            gait = beside.pop() if len(beside) == 1 else None
            if gait is not None:
                tell(f"the gait is the one of {gait}")
        if gait is not None and not planar:
            raise typer.BadParameter(
                "gaits are for robots in the plane, and the runs are in space: leave it out",
                param_hint="--gait",
            )
        return runs, None if gait is None else load_gait(gait, robot)


def _stop_if_interrupted(runs: dict[str, Run]) -> None:
    from heelstrike.sim import RunStatus

    for run in runs.values():
        if run.status is RunStatus.INTERRUPTED and run.final is not None:
            tell_interruption("walking")
            raise typer.Exit(INTERRUPTED)


def _tell(
    runs: dict[str, Run],
    gait: Gait | None,
    out: Path,
    tried: Mapping[str, Sequence[Tried]],
    *,
    as_json: bool,
) -> None:
    from heelstrike.analysis.diagnosis.falls import walked_on
    from heelstrike.analysis.told_summary import plain
    from heelstrike.view.report.account import account_of

    verdicts = {
        name: account_of(name, run, gait, tried.get(name, ())).verdict for name, run in runs.items()
    }
    if as_json:
        told = {name: plain(asdict(verdict)) for name, verdict in verdicts.items()}
        typer.echo(json.dumps(told, indent=2, ensure_ascii=False))
    else:
        for name, verdict in verdicts.items():
            label = f"{name}: " if len(verdicts) > 1 else ""
            output().print(f"{label}{verdict.headline}", markup=False, soft_wrap=True)
    tell(f"{out}: the report, for any browser, which prints it to PDF")
    if not all(walked_on(run, verdicts[name].fall) for name, run in runs.items()):
        raise typer.Exit(FAILED)
