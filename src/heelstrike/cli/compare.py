"""``heelstrike compare``: the same walk under several ways through time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    SEVERAL,
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
from heelstrike.cli.planning import law_asked, planned_walk
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
from heelstrike.cli.values import ground_called, pushes_called

USUAL = (
    Method.EVENT_DRIVEN,
    Method.TIME_STEPPING,
    Method.LINEARLY_IMPLICIT,
    Method.MOREAU_JEAN,
    Method.COMPLIANT,
    Method.KELVIN_VOIGT,
)
"""What is compared where nobody names methods."""


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
@reads_robots
def compare(
    robot: RobotName = "bravo7",
    method: Annotated[
        list[Method] | None,
        typer.Option(
            help=f"{SEVERAL} The first is the reference.",
            show_default=f"{', '.join(USUAL)}",
        ),
    ] = None,
    controller: ControlledBy = None,
    gait: SavedGait = None,
    steps: Steps = 3,
    step: Annotated[
        float, typer.Option(help="Time step in s of the methods that have one.")
    ] = 1e-4,
    ground: OnGround = "flat",
    friction: Friction = 0.75,
    restitution: Annotated[
        float,
        typer.Option(help="Restitution of the ground; methods that know none are left out."),
    ] = 0.0,
    push: Pushed = None,
    how: Any = None,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Directory for the table and the figure.")
    ] = Path("compare"),
    as_json: AsJson = False,
    debug: Debug = False,  # noqa: ARG001 - for `spoken`
) -> None:
    """Walk the same steps by several methods and tell how far they differ."""
    import heelstrike as hs
    from heelstrike.analysis.diagnosis.falls import first_cause, walked_on
    from heelstrike.experiments.walk import beginning
    from heelstrike.gait import Gait
    from heelstrike.view.style import save_figure
    from heelstrike.whole_file import write_whole

    surface = ground_called(ground, friction=friction, restitution=restitution)
    pushes = pushes_called(push)
    machine = hs.load_robot(robot, **how)
    for each in pushes:
        each.place(machine)
    law = law_asked(controller, machine)
    ways = method or USUAL
    methods = {way.value: method_called(way, step, passive=not machine.nu) for way in ways}
    planned = planned_walk(machine, gait, surface, law)
    start = beginning(machine, planned, surface, law)
    doing = f"walking {steps} steps by {len(methods)} methods"
    with stage(doing, when_slow="(compiling each of them, once: about a minute)"):
        comparison = hs.compare(
            machine,
            start.controller,
            methods=methods,
            state=start.state,
            duration=(steps + 0.1) * start.step_duration,
            ground=surface,
            pushes=pushes,
        )
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(comparison.to_dict(), indent=2)
    wrote(write_whole(out / "compare.json", text + "\n"))
    if as_json:
        typer.echo(text)
    else:
        output().print(comparison)
    if comparison.interrupted:  # no figure of what somebody did not wait for
        tell_interruption(doing)
        raise typer.Exit(INTERRUPTED)
    save_figure(comparison.plot(), out / "compare.png")
    tell(f"in {out}: compare.json, compare.png")
    followed = planned if isinstance(planned, Gait) else None
    falls = {  # who stands, or walks without motors, is judged by the end of its run
        name: first_cause(run, followed) if followed else None
        for name, run in comparison.runs.items()
    }
    for name, fall in falls.items():
        if fall is not None and comparison.runs[name].completed:
            complain(f"{name}: the robot goes down: {fall}")
    if not all(walked_on(run, falls[name]) for name, run in comparison.runs.items()):
        raise typer.Exit(FAILED)
