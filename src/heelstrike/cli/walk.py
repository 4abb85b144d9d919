"""``heelstrike walk``: design or load a gait, walk it, keep everything."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    METHOD,
    USUAL_METHOD,
    AsJson,
    ControlledBy,
    Debug,
    Friction,
    Method,
    OnGround,
    Pushed,
    RobotName,
    SavedGait,
    Steps,
    method_called,
    reads_robots,
)
from heelstrike.cli.planning import hint_of_balance, law_asked, planned_walk
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
from heelstrike.cli.values import ground_called, pushes_called
from heelstrike.errors import HeelstrikeError

if TYPE_CHECKING:
    from heelstrike.analysis.limit_cycle import LimitCycle
    from heelstrike.experiments.results import Results, Saved
    from heelstrike.gait import Gait
    from heelstrike.sim import Run
    from heelstrike.sim.method import Method as TimeMethod


FIRST_TIME = "(compiling the simulator, once: about 20 s)"
SUITS = "suits the robot's size"


class Animation(StrEnum):
    """Kinds of animation."""

    MP4 = "mp4"
    GIF = "gif"
    NONE = "none"


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
@reads_robots
def walk(
    robot: RobotName = "bravo7",
    step_length: Annotated[
        float | None, typer.Option(help="Length of a step in m.", show_default=SUITS)
    ] = None,
    step_duration: Annotated[
        float | None, typer.Option(help="Duration of a step in s.", show_default=SUITS)
    ] = None,
    clearance: Annotated[
        float | None, typer.Option(help="Height of the swing foot's path in m.", show_default=SUITS)
    ] = None,
    gait: SavedGait = None,
    controller: ControlledBy = None,
    steps: Steps = 20,
    method: Annotated[
        Method | None,
        typer.Option(help=METHOD, show_default=USUAL_METHOD),
    ] = None,
    step: Annotated[
        float, typer.Option(help="Time step h in s; of the record, for the other methods.")
    ] = 1e-3,
    ground: OnGround = "flat",
    friction: Friction = 0.75,
    push: Pushed = None,
    how: Any = None,
    out: Annotated[
        Path,
        typer.Option(file_okay=False, help="For the results; those of an earlier walk go."),
    ] = Path("walk"),
    animation: Annotated[Animation, typer.Option(help="Kind of animation.")] = Animation.MP4,
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
    debug: Debug = False,  # noqa: ARG001 - for `spoken`
) -> None:
    """Design (or load) a gait, walk it, and write figures, an animation and all data.

    Writes gait.json, run.nc, summary.json, a PNG for every figure and walk.mp4 (or .gif). The exit
    status is 0 if the robot walked all steps, 1 if it did not or a result could not be written
    (everything else is written all the same), 2 if the request was wrong, 130 after Ctrl-C, which
    keeps the gait and the data of the walk so far.
    """
    with stage("loading"):
        from heelstrike.experiments.results import Results
        from heelstrike.experiments.walk import walk
        from heelstrike.gait import Gait
        from heelstrike.robot import load_robot
        from heelstrike.sim.files.run_file import TABLE, check_run_file
        from heelstrike.view.page.page import check_page, save_html

        # All that is cheap to refuse is refused before anything that takes long.
        surface, pushes = ground_called(ground, friction=friction), pushes_called(push)
        machine = load_robot(robot, **how)
        for each in pushes:
            each.place(machine)
        law = law_asked(controller, machine)
        through = _through_time(method, step, passive=not machine.nu)
        results = Results(out)
        if html is not None:
            check_page(html)
        if table is not None:
            check_run_file(table, TABLE)
    planned = planned_walk(
        machine, gait, surface, law, length=step_length, duration=step_duration, clearance=clearance
    )
    followed = planned if isinstance(planned, Gait) else None
    wrote(*results.save_gait(followed))
    with stage(f"walking {steps} steps", when_slow=FIRST_TIME) as walking:
        run = walk(
            machine,
            planned,
            steps=steps,
            law=law,
            method=through,
            ground=surface,
            pushes=pushes,
            progress=walking.reached,
        )
    saved = _save(results, run, followed, animation)
    if html is not None and len(run.time):
        wrote(save_html(run, html, gait=followed, command=this_command()))
        tell(f"{html}: the walk as one page, for any browser")
    if table is not None:
        wrote(run.save(table))
        tell(f"{table}: the walk as a table")
    _tell_outcome(run, planned, steps, saved, usual=law is None, as_json=as_json)


def _through_time(method: Method | None, step: float, *, passive: bool) -> TimeMethod:
    from heelstrike.sim import EventDriven

    method = method or (Method.EVENT_DRIVEN if passive else Method.TIME_STEPPING)
    through = method_called(method, step, passive=passive)
    return replace(through, output_period=step) if isinstance(through, EventDriven) else through


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


def _tell_outcome(
    run: Run,
    planned: Gait | LimitCycle | None,
    steps: int,
    saved: tuple[Saved, ...],
    *,
    usual: bool,
    as_json: bool,
) -> None:
    """Show the figures of a walk and say how it went, by the exit status, too."""
    from heelstrike.analysis.diagnosis.falls import first_cause, walked_on
    from heelstrike.experiments.walk import steps_taken, why_unstable
    from heelstrike.gait import Gait
    from heelstrike.sim import EventDriven, RunStatus

    gait = planned if isinstance(planned, Gait) else None
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
    if usual:
        hint_of_balance(run)
    if not walked or any(each.error for each in saved):
        raise typer.Exit(FAILED)
