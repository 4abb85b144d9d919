"""Options that several commands have, each typed once, and the methods that they name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from heelstrike.sim.method import Method

RobotName = Annotated[str, typer.Argument(help="A built-in robot, or an MJCF or URDF file.")]
SavedGait = Annotated[
    Path | None, typer.Option("--gait", help="Walk this saved gait instead of designing one.")
]
Steps = Annotated[int, typer.Option(min=1, help="Steps to walk.")]
Friction = Annotated[float, typer.Option(help="Friction coefficient of the ground.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")]
Debug = Annotated[
    bool, typer.Option("--debug", help="Show where in the program an error arose.", hidden=True)
]


def method_called(name: str, step: float) -> Method:
    """Return the method of a name, which may be that of a scheme or a law, with a step (s)."""
    from heelstrike import sim

    match name:
        case "event-driven":
            return sim.EventDriven()
        case "time-stepping":
            return sim.TimeStepping(step=step)
        case "compliant" | "hunt-crossley":
            return sim.Compliant(step=step)
        case "kelvin-voigt":
            return sim.Compliant(law=sim.KelvinVoigt(), step=step)
    return sim.TimeStepping(step=step, scheme=sim.Scheme[name.upper().replace("-", "_")])
