"""``heelstrike inspect``: what a robot consists of, and what is wrong with it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from heelstrike.cli.options import AsJson, OnGround, Pushed, Reading, RobotName
from heelstrike.cli.terminal import in_options, output, spoken, tell
from heelstrike.cli.values import ground_called, pushes_called

if TYPE_CHECKING:
    from collections.abc import Sequence

    from heelstrike.contact.ground import Ground
    from heelstrike.robot.inspection import Inspection
    from heelstrike.sim.push import Push

SPACE = 3
"""Dimension of a robot that leaves the plane."""

FOUND = 1
"""Exit code when something looks wrong, so that a script can tell."""


@spoken
def inspect(
    robot: RobotName,
    *,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--out", "--picture", dir_okay=False, help="Draw it into this file (PNG, SVG or PDF)."
        ),
    ] = None,
    ground: OnGround = "flat",
    push: Pushed = None,
    dimension: Annotated[
        int, typer.Option(min=2, max=3, help="Look at it in the plane, or in space.")
    ] = 2,
    how: Reading,
    as_json: AsJson = False,
) -> None:
    """Describe a robot: tree, masses, limits, contact points, and likely mistakes.

    For a robot in space it does not look for mistakes. Ground and pushes appear in the picture
    only. The exit status is 1 if a mistake is likely.
    """
    from heelstrike.robot.inspection import inspect_robot

    surface = None if ground == "flat" else ground_called(ground)
    pushes = pushes_called(push)
    if dimension == SPACE:
        if surface is not None or pushes:
            raise typer.BadParameter(
                "ground and pushes are drawn for planar robots only: leave them out, or "
                "use --dimension 2",
                param_hint="--dimension",
            )
        look_in_space(robot, picture, how, as_json=as_json)
        return
    inspection = inspect_robot(robot, **how.keywords())
    look_at(inspection, picture, as_json=as_json, ground=surface, pushes=pushes)
    if not inspection.sound:
        raise typer.Exit(FOUND)


def look_in_space(robot: str, picture: Path | None, how: Reading, *, as_json: bool) -> None:
    """Print what a robot in space consists of, and draw it into a file."""
    from heelstrike.robot.library import load_robot
    from heelstrike.robot.spatial.inspection import spatial_description, spatial_facts
    from heelstrike.view.drawing import robot_picture

    found = load_robot(robot, dimension=3, **how.keywords())
    if as_json:
        typer.echo(json.dumps(spatial_facts(found), indent=2))
    else:
        output().print(Text(spatial_description(found)), soft_wrap=True)
    if picture is not None:
        robot_picture(found, picture)
        tell(f"drawn into {picture}")


def look_at(
    inspection: Inspection,
    picture: Path | None,
    *,
    as_json: bool,
    ground: Ground | None = None,
    pushes: Sequence[Push] = (),
) -> None:
    """Print what was found of a robot, and draw it into a file."""
    from heelstrike.robot.inspection import facts
    from heelstrike.robot.robot import Robot
    from heelstrike.robot.spatial.robot import SpatialRobot
    from heelstrike.view.drawing import robot_picture
    from heelstrike.view.terminal import terminal_drawing

    robot = inspection.robot
    if isinstance(robot, SpatialRobot) and (ground is not None or pushes):
        raise typer.BadParameter(
            f"{robot.name} is a robot in space; ground and pushes are drawn for planar robots "
            "only: leave them out, or use --projected",
            param_hint="--push" if ground is None else "--ground",
        )
    if picture is None and (ground is not None or pushes):
        raise typer.BadParameter(
            "ground and pushes need a picture: give its file", param_hint="--out"
        )
    if robot is not None:
        for push in pushes:
            push.place(robot)
    if as_json:
        typer.echo(json.dumps(facts(inspection), indent=2))
    else:
        drawing = terminal_drawing(robot) if isinstance(robot, Robot) else ""
        for text in (drawing if _has_letters_for(drawing) else "", in_options(inspection.text())):
            if text:
                output().print(Text(text), soft_wrap=True)
    if picture is not None and robot is not None:
        robot_picture(robot, picture, ground=ground, pushes=pushes)
        tell(f"drawn into {picture}")
    elif picture is not None:
        tell(f"{picture} is not drawn, for there is no robot to draw")


def _has_letters_for(text: str) -> bool:
    """Whether the terminal or pipe can show a text."""
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True
