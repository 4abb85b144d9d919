"""``heelstrike walk``: design or load a gait, walk it, keep everything."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.terminal import (
    FAILED,
    Debug,
    complain,
    output,
    spoken,
    stage,
    tell,
    tell_interruption,
    wrote,
)

if TYPE_CHECKING:
    from heelstrike.gait import Gait
    from heelstrike.robot import Robot
    from heelstrike.sim.method import Method as TimeMethod


FIRST_TIME = "(compiling the simulator, once: about 20 s)"


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


class Animation(StrEnum):
    """Kinds of animation."""

    MP4 = "mp4"
    GIF = "gif"
    NONE = "none"


@spoken
def walk(
    robot: Annotated[
        str, typer.Argument(help="A built-in robot, or an MJCF or URDF file.", show_default=True)
    ] = "bravo7",
    step_length: Annotated[
        float | None,
        typer.Option(help="Length of a step in m.", show_default="suits the robot's size"),
    ] = None,
    step_duration: Annotated[
        float | None,
        typer.Option(help="Duration of a step in s.", show_default="suits the robot's size"),
    ] = None,
    clearance: Annotated[
        float | None,
        typer.Option(
            help="Height of the swing foot's path in m.", show_default="suits the robot's size"
        ),
    ] = None,
    gait: Annotated[
        Path | None, typer.Option(help="Walk this saved gait instead of designing one.")
    ] = None,
    steps: Annotated[int, typer.Option(min=1, help="Steps to walk.")] = 20,
    method: Annotated[Method, typer.Option(help="Way through time.")] = Method.TIME_STEPPING,
    scheme: Annotated[
        Scheme, typer.Option(help="Discretisation of time stepping.")
    ] = Scheme.GAP_LINEARISED,
    step: Annotated[
        float, typer.Option(help="Time step h in s; of the record, for the other methods.")
    ] = 1e-3,
    friction: Annotated[float, typer.Option(help="Friction coefficient of the ground.")] = 0.75,
    out: Annotated[
        Path,
        typer.Option(
            file_okay=False,
            help="Directory for the results; those of an earlier walk are replaced.",
        ),
    ] = Path("walk"),
    animation: Annotated[Animation, typer.Option(help="Kind of animation.")] = Animation.MP4,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the summary as JSON, and nothing else.")
    ] = False,
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
        from heelstrike.experiments.walk import walk, why_unstable
        from heelstrike.robot import load_robot
        from heelstrike.sim import RunStatus

        # All that is cheap to refuse is refused before anything that takes long.
        time_method = _time_method(method, step, scheme)
        ground = Ground(friction=friction)
        machine = load_robot(robot)
        results = Results(out)
    planned = _gait(machine, gait, step_length, step_duration, clearance, friction)
    wrote(results.save_gait(planned))
    with stage(f"walking {steps} steps", when_slow=FIRST_TIME) as walking:
        run = walk(
            machine,
            planned,
            steps=steps,
            method=time_method,
            ground=ground,
            progress=walking.reached,
        )
    # After Ctrl-C one wants to have what there is and go: the data, but no pictures of them.
    interrupted = run.status is RunStatus.INTERRUPTED
    kind = None if animation is Animation.NONE or interrupted else animation.value
    if interrupted:
        tell("interrupted: writing the data, which Ctrl-C would stop")
    with stage("writing results") as writing:
        try:
            saved = results.save_run(
                run, planned, figures=not interrupted, animation=kind, progress=writing.reached
            )
        finally:
            wrote(*results.written[1:])
    for each in saved:
        if each.error is not None:
            complain(f"{each.path} could not be made: {type(each.error).__name__}: {each.error}")
    if interrupted:
        if as_json:
            typer.echo(run.summary(gait=planned).to_json())
        tell_interruption(f"walking, at t = {run.time[-1]:.3g} s" if len(run.time) else "walking")
        raise typer.Exit(INTERRUPTED)
    summary = run.summary(gait=planned)
    if as_json:
        typer.echo(summary.to_json())
    else:
        output().print(summary)
        written = ", ".join(each.path.name for each in saved if each.error is None)
        tell(f"in {out}: gait.json, {written}")
    walked = run.completed and summary.steps >= steps
    if not run.completed:
        complain(run.message)
    elif not walked:
        complain(f"the robot took {summary.steps} of {steps} steps in {run.time[-1]:.3g} s")
    if not walked and (reason := why_unstable(planned)):
        longer = " --method event-driven keeps to the gait for longer."
        tell(reason + ("" if method is Method.EVENT_DRIVEN else longer))
    if not walked or any(each.error for each in saved):
        raise typer.Exit(FAILED)


def _time_method(method: Method, step: float, scheme: Scheme) -> TimeMethod:
    from heelstrike import sim

    match method:
        case Method.TIME_STEPPING:
            return sim.TimeStepping(step=step, scheme=sim.Scheme[scheme.name])
        case Method.EVENT_DRIVEN:
            return sim.EventDriven(output_period=step)
        case Method.COMPLIANT:
            return sim.Compliant(step=step)


def _gait(
    robot: Robot,
    path: Path | None,
    step_length: float | None,
    step_duration: float | None,
    clearance: float | None,
    friction: float,
) -> Gait:
    from heelstrike.experiments.walk import design, typical_step
    from heelstrike.gait import load_gait

    asked = {"length": step_length, "duration": step_duration, "clearance": clearance}
    given = {name: value for name, value in asked.items() if value is not None}
    if path is not None:
        if given:
            raise typer.BadParameter(
                "a saved gait has its own step length, duration and clearance; leave these options "
                "out, or design a gait without --gait",
                param_hint="--gait",
            )
        return load_gait(path, robot)
    size = replace(typical_step(robot), **given)
    with stage(f"designing a gait of {size.length:g} m in {size.duration:g} s") as designing:
        gait = design(robot, size, friction=friction, progress=designing.reached)
        designing.outcome = (
            f"gait: {gait.step_length:.3g} m in {gait.step_duration:.3g} s, "
            f"cost {gait.cost:.4g} N²m²s"
        )
    return gait
