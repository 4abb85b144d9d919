"""``heelstrike compare``: the same walk under several simulation methods."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.engines import InEngines, compare_in_engines
from heelstrike.cli.options import (
    SEVERAL,
    AsJson,
    Method,
    Reading,
    RobotName,
    Step,
    Steps,
    TableFolder,
    Walking,
)
from heelstrike.cli.planning import asked_for, methods_asked, with_gait
from heelstrike.cli.terminal import (
    FAILED,
    complain,
    print_found,
    save_json,
    spoken,
    stage,
    tell,
    tell_interruption,
)
from heelstrike.cli.whole_comparison import compare_whole
from heelstrike.errors import SimulationError

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
def compare(
    robot: RobotName = "bravo7",
    *,
    method: Annotated[
        list[Method] | None,
        typer.Option(
            help=f"{SEVERAL} The first is the reference.",
            show_default=f"{', '.join(USUAL)}",
        ),
    ] = None,
    walking: Walking,
    steps: Steps = 3,
    step: Step = 1e-4,
    restitution: Annotated[
        float,
        typer.Option(help="Restitution of the ground; methods without restitution are left out."),
    ] = 0.0,
    others: InEngines,
    how: Reading,
    out: TableFolder = Path("compare"),
    as_json: AsJson = False,
) -> None:
    """Walk the same steps by several methods or in several engines, and report the differences."""
    import heelstrike as hs
    from heelstrike.analysis.diagnosis.falls import first_cause, walked_on
    from heelstrike.experiments.walk import beginning
    from heelstrike.view.style import save_figure

    if others.engines is None:
        others.refuse_without_engines()
    elif method:
        raise SimulationError("--method: engines have methods of their own. Leave it out")
    case = asked_for(robot, how, walking, steps=steps, restitution=restitution)
    if others.whole:
        compare_whole(case, others, walking, out, as_json=as_json)
        return
    methods = methods_asked(case, method or USUAL, step)
    case = with_gait(case, walking.gait)
    start = beginning(case.robot, case.gait, case.ground, case.law)
    if others.engines is not None:
        compare_in_engines(case, start, others, steps, out, as_json=as_json)
        return
    doing = f"walking {steps} steps by {len(methods)} methods"
    with stage(doing, when_slow="(compiling each of them, once: about a minute)"):
        comparison = hs.compare(
            case.robot,
            start.controller,
            methods=methods,
            state=start.state,
            duration=(steps + 0.1) * start.step_duration,
            ground=case.ground,
            pushes=case.pushes,
        )
    told = comparison.to_dict()
    save_json(out / "compare.json", told)
    print_found(comparison, told, as_json=as_json)
    if comparison.interrupted:  # no figure of what somebody did not wait for
        tell_interruption(doing)
        raise typer.Exit(INTERRUPTED)
    save_figure(comparison.plot(), out / "compare.png")
    tell(f"in {out}: compare.json, compare.png")
    falls = {  # who stands, or walks without motors, is judged by the end of its run
        name: first_cause(run, case.followed) if case.followed else None
        for name, run in comparison.runs.items()
    }
    for name, fall in falls.items():
        if fall is not None and comparison.runs[name].completed:
            complain(f"{name}: the robot goes down: {fall}")
    if not all(walked_on(run, falls[name]) for name, run in comparison.runs.items()):
        raise typer.Exit(FAILED)
