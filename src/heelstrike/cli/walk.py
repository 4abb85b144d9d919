"""``heelstrike walk``: design or load a gait, walk it, keep everything."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    AsJson,
    Debug,
    Friction,
    RobotName,
    SavedGait,
    Steps,
    method_called,
)
from heelstrike.cli.planning import planned_gait
from heelstrike.cli.terminal import (
    FAILED,
    complain,
    output,
    spoken,
    stage,
    tell,
    tell_interruption,
    wrote,
)

if TYPE_CHECKING:
    from heelstrike.experiments.results import Results, Saved
    from heelstrike.gait import Gait
    from heelstrike.sim import Run
    from heelstrike.sim.method import Method as TimeMethod


FIRST_TIME = "(compiling the simulator, once: about 20 s)"
SUITS = "suits the robot's size"


class Method(StrEnum):
    """Ways through time; each stands for a class of :mod:`heelstrike.sim`."""

    TIME_STEPPING = "time-stepping"
    EVENT_DRIVEN = "event-driven"
    COMPLIANT = "compliant"


class Scheme(StrEnum):
    """Discretisations of time stepping; each stands for one of :class:`heelstrike.sim.Scheme`."""

    GAP_LINEARISED = "gap-linearised"
    PAPER_EXPLICIT = "paper-explicit"
    PAPER_SYMPLECTIC = "paper-symplectic"
    MOREAU_JEAN = "moreau-jean"
    LINEARLY_IMPLICIT = "linearly-implicit"
    IMPACT_RESOLVED = "impact-resolved"


class Animation(StrEnum):
    """Kinds of animation."""

    MP4 = "mp4"
    GIF = "gif"
    NONE = "none"


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
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
    steps: Steps = 20,
    method: Annotated[Method, typer.Option(help="Way through time.")] = Method.TIME_STEPPING,
    scheme: Annotated[
        Scheme | None,
        typer.Option(
            help="Discretisation of time stepping.", show_default=Scheme.IMPACT_RESOLVED.value
        ),
    ] = None,
    step: Annotated[
        float, typer.Option(help="Time step h in s; of the record, for the other methods.")
    ] = 1e-3,
    friction: Friction = 0.75,
    out: Annotated[
        Path,
        typer.Option(file_okay=False, help="For the results; those of an earlier walk go."),
    ] = Path("walk"),
    animation: Annotated[Animation, typer.Option(help="Kind of animation.")] = Animation.MP4,
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
        from heelstrike.contact.ground import Ground
        from heelstrike.experiments.results import Results
        from heelstrike.experiments.walk import walk
        from heelstrike.robot import load_robot

        # All that is cheap to refuse is refused before anything that takes long.
        through = _through_time(method, scheme, step)
        ground, machine, results = Ground(friction=friction), load_robot(robot), Results(out)
    planned = planned_gait(
        machine, gait, friction, length=step_length, duration=step_duration, clearance=clearance
    )
    wrote(results.save_gait(planned))
    with stage(f"walking {steps} steps", when_slow=FIRST_TIME) as walking:
        run = walk(
            machine, planned, steps=steps, method=through, ground=ground, progress=walking.reached
        )
    saved = _save(results, run, planned, animation)
    _tell_outcome(run, planned, steps, saved, as_json=as_json)


def _through_time(method: Method, scheme: Scheme | None, step: float) -> TimeMethod:
    if method is Method.TIME_STEPPING:
        return method_called(scheme or method, step)
    if scheme is not None:
        raise typer.BadParameter(
            f"{method} has no schemes, which are those of time-stepping; leave one of the two out",
            param_hint="--scheme",
        )
    if method is Method.EVENT_DRIVEN:
        from heelstrike.sim import EventDriven

        return EventDriven(output_period=step)
    return method_called(method, step)


def _save(results: Results, run: Run, gait: Gait, animation: Animation) -> tuple[Saved, ...]:
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
            wrote(*results.written[1:])
    for each in saved:
        if each.error is not None:
            complain(f"{each.path} could not be made: {type(each.error).__name__}: {each.error}")
    return saved


def _tell_outcome(
    run: Run, gait: Gait, steps: int, saved: tuple[Saved, ...], *, as_json: bool
) -> None:
    """Show the figures of a walk and say how it went, by the exit status, too."""
    from heelstrike.experiments.walk import why_unstable
    from heelstrike.sim import EventDriven, RunStatus

    summary = run.summary(gait=gait)
    interrupted = run.status is RunStatus.INTERRUPTED
    if as_json:
        typer.echo(summary.to_json())
    elif not interrupted:
        output().print(summary)
        written = ", ".join(each.path.name for each in saved if each.error is None)
        tell(f"in {saved[0].path.parent}: gait.json, {written}")
    if interrupted:
        tell_interruption(f"walking, at t = {run.time[-1]:.3g} s" if len(run.time) else "walking")
        raise typer.Exit(INTERRUPTED)
    walked = run.completed and summary.steps >= steps
    if not run.completed:
        complain(run.message)
    elif not walked:
        complain(f"the robot took {summary.steps} of {steps} steps in {run.time[-1]:.3g} s")
    if not walked and (reason := why_unstable(gait)):
        longer = " --method event-driven keeps to the gait for longer."
        tell(reason + ("" if isinstance(run.method, EventDriven) else longer))
    if not walked or any(each.error for each in saved):
        raise typer.Exit(FAILED)
