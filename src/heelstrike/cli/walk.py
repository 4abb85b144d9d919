"""``heelstrike walk``: design or load a gait, walk it, keep everything."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    Animated,
    Animation,
    AsJson,
    OneMethod,
    Reading,
    RobotName,
    Steps,
    Walking,
)
from heelstrike.cli.planning import (
    FIRST_TIME,
    asked_for,
    hint_of_balance,
    methods_asked,
    with_gait,
)
from heelstrike.cli.terminal import (
    FAILED,
    complain,
    output,
    spoken,
    stage,
    tell,
    tell_interruption,
    this_command,
    wrote,
)
from heelstrike.errors import HeelstrikeError

if TYPE_CHECKING:
    from heelstrike.experiments.results import Results, Saved
    from heelstrike.experiments.walk import Case
    from heelstrike.gait import Gait
    from heelstrike.sim import Run


SUITS = "suits the robot's size"


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def walk(
    robot: RobotName = "bravo7",
    *,
    step_length: Annotated[
        float | None, typer.Option(help="Length of a step in m.", show_default=SUITS)
    ] = None,
    step_duration: Annotated[
        float | None, typer.Option(help="Duration of a step in s.", show_default=SUITS)
    ] = None,
    clearance: Annotated[
        float | None, typer.Option(help="Height of the swing foot's path in m.", show_default=SUITS)
    ] = None,
    walking: Walking,
    steps: Steps = 20,
    method: OneMethod = None,
    step: Annotated[
        float, typer.Option(help="Time step h in s; of the record, for the other methods.")
    ] = 1e-3,
    how: Reading,
    out: Annotated[
        Path,
        typer.Option(
            file_okay=False, help="Folder of the results; those of an earlier walk are deleted."
        ),
    ] = Path("walk"),
    animation: Animated = Animation.MP4,
    html: Annotated[
        Path | None,
        typer.Option(
            dir_okay=False, help="Also write the walk as one page with animation and curves."
        ),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option("--csv", dir_okay=False, help="Also write the walk as a table of text."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Design (or load) a gait, walk it, and write figures, an animation and all data.

    Writes gait.json, run.nc, summary.json, a PNG for every figure and walk.mp4 (or .gif). The exit
    status is 0 if the robot walked all steps, 1 if it did not or a result could not be written
    (everything else is written all the same), 2 if the request was wrong, 130 after Ctrl-C, which
    keeps the gait and the data of the walk so far.
    """
    with stage("loading"):
        from heelstrike.experiments.results import Results
        from heelstrike.sim import EventDriven
        from heelstrike.sim.files.run_file import TABLE, check_run_file
        from heelstrike.view.page.page import check_page, save_html

        # All that is cheap to refuse is refused before anything that takes long.
        case = asked_for(robot, how, walking, steps=steps)
        (through,) = methods_asked(case, [] if method is None else [method], step).values()
        if isinstance(through, EventDriven):
            through = replace(through, output_period=step)
        results = Results(out)
        if html is not None:
            check_page(html)
        if table is not None:
            check_run_file(table, TABLE)
    case = with_gait(
        replace(case, method=through), walking.gait,
        length=step_length, duration=step_duration, clearance=clearance,
    )  # fmt: skip
    wrote(*results.save_gait(case.followed))
    with stage(f"walking {steps} steps", when_slow=FIRST_TIME) as going:
        run = case.run(going.reached)
    saved = _save(results, run, case.followed, animation)
    if html is not None and len(run.time):
        wrote(save_html(run, html, gait=case.followed, command=this_command()))
        tell(f"{html}: the walk as one page, for any browser")
    if table is not None:
        wrote(run.save(table))
        tell(f"{table}: the walk as a table")
    _tell_outcome(case, run, saved, as_json=as_json)


def _save(results: Results, run: Run, gait: Gait | None, animation: Animation) -> tuple[Saved, ...]:
    """Write what a walk leaves; after Ctrl-C, when one wants to go, the data but no pictures."""
    from heelstrike.sim import RunStatus

    interrupted = run.status is RunStatus.INTERRUPTED
    kind = None if animation is Animation.NONE or interrupted else animation.value
    if interrupted:
        tell("interrupted: writing the data, which Ctrl-C would stop")
    with stage("writing results") as writing:
        try:
            saved = results.save_run(
                run, gait, figures=not interrupted, animation=kind, progress=writing.reached
            )
        finally:
            wrote(*results.written)
    for each in saved:
        if each.error is not None:
            ours = isinstance(each.error, HeelstrikeError)
            reason = str(each.error) if ours else f"{type(each.error).__name__}: {each.error}"
            complain(f"{each.path} could not be made: {reason}")
    return saved


def _tell_outcome(case: Case, run: Run, saved: tuple[Saved, ...], *, as_json: bool) -> None:
    """Show the figures of a walk and say how it went, by the exit status, too."""
    from heelstrike.analysis.diagnosis.falls import first_cause, walked_on
    from heelstrike.experiments.walk import steps_taken, why_unstable
    from heelstrike.sim import EventDriven, RunStatus

    gait, planned, steps = case.followed, case.gait, case.steps
    summary = run.summary(gait=gait)
    interrupted = run.status is RunStatus.INTERRUPTED
    if as_json:
        typer.echo(summary.to_json())
    elif not interrupted:
        output().print(summary)
        written = [each.path.name for each in saved if each.error is None]
        names = ", ".join(["gait.json", *written] if gait else written)
        tell(f"in {saved[0].path.parent}: {names}")
    if interrupted:
        tell_interruption(f"walking, at t = {run.time[-1]:.3g} s" if len(run.time) else "walking")
        raise typer.Exit(INTERRUPTED)
    taken = steps_taken(run, planned)
    fall = None if gait is None else first_cause(run, gait)
    walked = walked_on(run, fall) and (planned is None or taken >= steps)
    if not run.completed:
        complain(run.message)
    elif fall is not None:
        complain(f"the robot goes down: {fall}")
    elif not walked:
        complain(f"the robot took {taken} of {steps} steps in {run.time[-1]:.3g} s")
    exact = isinstance(run.method, EventDriven)
    if not walked and planned is not None and (reason := why_unstable(planned)):
        tell(reason + ("" if exact else " --method event-driven keeps to it for longer."))
    elif not (walked or gait or exact):
        tell("Legs of one length scuff the ground; --method event-driven lets them swing through.")
    if case.law is None:
        hint_of_balance(run)
    if not walked or any(each.error for each in saved):
        raise typer.Exit(FAILED)
