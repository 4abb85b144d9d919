"""``heelstrike robots``: what is built in, and what a robot consists of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from heelstrike.cli.inspect import look_at
from heelstrike.cli.options import AsJson
from heelstrike.cli.terminal import output, spoken


@spoken
def robots(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A built-in robot, or an MJCF, URDF or SDF file, to see in detail.",
            show_default=False,
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Draw the robot NAME into this file (PNG, SVG or PDF)."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the built-in robots, or look at one robot as `heelstrike inspect` does."""
    from heelstrike.robot.inspection import facts, inspect_robot
    from heelstrike.robot.library import builtin_robots, load_robot

    if picture is not None and name is None:
        raise typer.BadParameter(
            "say which robot to draw: heelstrike robots NAME --picture FILE",
            param_hint="--picture",
        )
    if name is not None:
        look_at(inspect_robot(name), picture, as_json=as_json)
        return
    shown = [load_robot(each) for each in builtin_robots()]
    if as_json:
        typer.echo(json.dumps([facts(inspect_robot(robot)) for robot in shown], indent=2))
        return
    table = Table("robot", title="Built-in robots", title_justify="left")
    for heading in ("mass kg", "coordinates", "actuators", "contact points"):
        table.add_column(heading, justify="right")
    for robot in shown:
        numbers = (f"{robot.total_mass:.4g}", robot.nq, robot.nu, robot.nc)
        table.add_row(robot.name, *map(str, numbers))
    output().print(table)
