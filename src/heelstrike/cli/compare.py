"""``heelstrike compare``: the same walk under several ways through time."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.terminal import (
    FAILED,
    Debug,
    messages,
    output,
    spoken,
    stage,
    tell_interruption,
    wrote,
)

if TYPE_CHECKING:
    from heelstrike.sim.method import Method


class Way(StrEnum):
    """Ways through time that can be compared."""

    EVENT_DRIVEN = "event-driven"
    TIME_STEPPING = "time-stepping"
    PAPER_EXPLICIT = "paper-explicit"
    PAPER_SYMPLECTIC = "paper-symplectic"
    MOREAU_JEAN = "moreau-jean"
    LINEARLY_IMPLICIT = "linearly-implicit"
    HUNT_CROSSLEY = "hunt-crossley"
    KELVIN_VOIGT = "kelvin-voigt"


ALL = [
    Way.EVENT_DRIVEN,
    Way.TIME_STEPPING,
    Way.LINEARLY_IMPLICIT,
    Way.MOREAU_JEAN,
    Way.HUNT_CROSSLEY,
    Way.KELVIN_VOIGT,
]


@spoken
def compare(
    robot: Annotated[str, typer.Argument(help="A built-in robot, or an MJCF or URDF file.")] = (
        "bravo7"
    ),
    method: Annotated[
        list[Way] | None,
        typer.Option(help="Methods; repeat the option. The first is the reference."),
    ] = None,
    gait: Annotated[Path | None, typer.Option(help="Walk this saved gait.")] = None,
    steps: Annotated[int, typer.Option(min=1, help="Steps to walk.")] = 3,
    step: Annotated[
        float, typer.Option(help="Time step in s of the methods that have one.")
    ] = 1e-4,
    friction: Annotated[float, typer.Option(help="Friction coefficient of the ground.")] = 0.75,
    restitution: Annotated[
        float,
        typer.Option(help="Restitution of the ground; methods that know none are left out."),
    ] = 0.0,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Directory for the table and the figure.")
    ] = Path("compare"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")] = False,
    debug: Debug = False,  # noqa: ARG001 - for `spoken`
) -> None:
    """Walk the same gait by several methods and tell how far they differ."""
    import heelstrike as hs
    from heelstrike.experiments.comparison import compare as compare_methods
    from heelstrike.experiments.walk import typical_step
    from heelstrike.view.style import save_figure
    from heelstrike.whole_file import write_whole

    loaded = hs.load_robot(robot)
    ways = method or ALL
    chosen = {way.value: _method(way, step) for way in ways}
    ground = hs.Ground(friction=friction, restitution=restitution)
    if gait is not None:
        planned = hs.load_gait(gait, loaded)
    else:
        size = typical_step(loaded)
        with stage(f"designing a gait of {size.length:g} m in {size.duration:g} s") as designing:
            planned = hs.optimize_gait(
                loaded,
                step_length=size.length,
                step_duration=size.duration,
                clearance=size.clearance,
                friction=friction,
                progress=designing.reached,
            )
    with stage(
        f"walking {steps} steps by {len(chosen)} methods",
        when_slow="(compiling each of them, once: about a minute)",
    ):
        comparison = compare_methods(
            loaded,
            hs.ComputedTorque(loaded, planned),
            methods=chosen,
            state=planned.initial_state,
            duration=(steps + 0.1) * planned.step_duration,
            ground=ground,
        )
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / "compare.json", json.dumps(comparison.to_dict(), indent=2) + "\n")
    wrote(out / "compare.json")
    if as_json:
        typer.echo(json.dumps(comparison.to_dict(), indent=2))
    else:
        output().print(comparison)
    if comparison.interrupted:
        # No figure of what somebody did not wait for.
        tell_interruption(f"walking {steps} steps by {len(chosen)} methods")
        raise typer.Exit(INTERRUPTED)
    save_figure(comparison.plot(), out / "compare.png")
    messages().print(f"in {out}: compare.json, compare.png")
    if not all(run.completed for run in comparison.runs.values()):
        raise typer.Exit(FAILED)


def _method(way: Way, step: float) -> Method:
    from heelstrike import sim

    match way:
        case Way.EVENT_DRIVEN:
            return sim.EventDriven()
        case Way.TIME_STEPPING:
            return sim.TimeStepping(step=step)
        case Way.HUNT_CROSSLEY:
            return sim.Compliant(law=sim.HuntCrossley(), step=step)
        case Way.KELVIN_VOIGT:
            return sim.Compliant(law=sim.KelvinVoigt(), step=step)
        case _:
            return sim.TimeStepping(step=step, scheme=sim.Scheme[way.name])
