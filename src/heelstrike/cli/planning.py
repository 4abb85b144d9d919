"""The gait that a command walks: the saved one that is asked for, or one that is designed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from heelstrike.cli.terminal import stage

if TYPE_CHECKING:
    from heelstrike.gait import Gait
    from heelstrike.robot import Robot


def planned_gait(robot: Robot, path: Path | None, friction: float, **size: float | None) -> Gait:
    """Load a gait, or design one; what is None of the size of its steps suits the robot."""
    from heelstrike.experiments.walk import design, typical_step
    from heelstrike.gait import load_gait

    given = {name: value for name, value in size.items() if value is not None}
    if path is not None:
        if given:
            raise typer.BadParameter(
                "a saved gait has its own step length, duration and clearance; leave these options "
                "out, or design a gait without --gait",
                param_hint="--gait",
            )
        return load_gait(path, robot)
    chosen = replace(typical_step(robot), **given)
    with stage(f"designing a gait of {chosen.length:g} m in {chosen.duration:g} s") as designing:
        gait = design(robot, chosen, friction=friction, progress=designing.reached)
        designing.outcome = (
            f"gait: {gait.step_length:.3g} m in {gait.step_duration:.3g} s, "
            f"cost {gait.cost:.4g} N²m²s"
        )
    return gait
