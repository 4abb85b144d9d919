"""``heelstrike inspect``: what a robot consists of, and what is wrong with it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from heelstrike.cli.terminal import Debug, output, spoken, tell

FOUND = 1
"""Exit code when something looks wrong, so that a script can tell."""


@spoken
def inspect(
    robot: Annotated[str, typer.Argument(help="A built-in robot, or an MJCF or URDF file.")],
    picture: Annotated[
        Path | None,
        typer.Option(
            "--out", "--picture", dir_okay=False, help="Draw it into this file (PNG, SVG or PDF)."
        ),
    ] = None,
    floating: Annotated[
        bool, typer.Option("--floating", help="Let the trunk float in the plane.")
    ] = False,
    projected: Annotated[
        bool, typer.Option("--projected", help="Lock the joints that leave the x–z plane.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")] = False,
    debug: Debug = False,  # noqa: ARG001 - for `spoken`
) -> None:
    """Look at a robot: tree, masses, limits, contact points, and what looks wrong.

    Ends with exit code 1 if something does.
    """
    from heelstrike.robot.inspection import facts, inspect_robot

    inspection = inspect_robot(robot, floating=floating, projected=projected)
    if as_json:
        typer.echo(json.dumps(facts(inspection), indent=2))
    else:
        if inspection.robot is not None:
            from heelstrike.view.terminal import terminal_drawing

            _draw(terminal_drawing(inspection.robot))
        _print(inspection.text())
    if picture is not None and inspection.robot is None:
        tell(f"{picture} is not drawn, for there is no robot to draw")
    elif picture is not None and inspection.robot is not None:
        from heelstrike.view.drawing import robot_picture

        robot_picture(inspection.robot, picture)
        tell(f"drawn into {picture}")
    if not inspection.sound:
        raise typer.Exit(FOUND)


def _print(text: str) -> None:
    output().print(Text(text), soft_wrap=True)


def _draw(text: str) -> None:
    """Print a drawing, unless the terminal or pipe has no letters for it."""
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return
    if text:
        _print(text)
