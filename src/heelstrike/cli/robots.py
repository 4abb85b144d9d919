"""``heelstrike robots``: what is built in, and what a robot consists of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from heelstrike.cli.terminal import Debug, output, spoken, tell

if TYPE_CHECKING:
    from heelstrike.robot import Robot


@spoken
def robots(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A built-in robot, or an MJCF or URDF file, to see in detail.", show_default=False
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(dir_okay=False, help="Draw the robot NAME into this file (PNG, SVG or PDF)."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else.")] = False,
    debug: Debug = False,  # noqa: ARG001 - for `spoken`
) -> None:
    """List the built-in robots, or look at one robot."""
    from heelstrike.robot import builtin_robots, load_robot

    if picture is not None and name is None:
        raise typer.BadParameter(
            "say which robot to draw: heelstrike robots NAME --picture FILE",
            param_hint="--picture",
        )
    if name is None:
        shown = [load_robot(each) for each in builtin_robots()]
        if as_json:
            typer.echo(json.dumps([_facts(robot) for robot in shown], indent=2))
        else:
            output().print(_overview(shown))
        return
    robot = load_robot(name)
    if picture is not None:
        from heelstrike.view.drawing import robot_picture

        robot_picture(robot, picture)
        tell(f"drawn into {picture}")
    if as_json:
        typer.echo(json.dumps(_facts(robot), indent=2))
    else:
        output().print(_details(robot))


def _facts(robot: Robot) -> dict[str, Any]:
    return {
        "name": robot.name,
        "mass_kg": robot.total_mass,
        "coordinates": list(robot.joint_names),
        "actuators": list(robot.actuator_names),
        "contact_points": list(robot.contact_names),
        "feet": [foot.name for foot in robot.feet],
        "symmetric": robot.mirror is not None,
        "floating": robot.floating,
    }


def _overview(shown: list[Robot]) -> Table:
    table = Table("robot", title="Built-in robots", title_justify="left")
    for heading in ("mass kg", "coordinates", "actuators", "contact points"):
        table.add_column(heading, justify="right")
    for robot in shown:
        table.add_row(
            robot.name, f"{robot.total_mass:.4g}", *map(str, (robot.nq, robot.nu, robot.nc))
        )
    return table


def _details(robot: Robot) -> Table:
    model = robot.model
    actuator_of = {int(joint): i for i, joint in enumerate(model.actuator_joint)}
    points = ", ".join(robot.contact_names) or "none"
    symmetry = "alike" if robot.mirror is not None else "not alike"
    table = Table(
        "coordinate",
        title=f"{robot.name}: {robot.total_mass:.4g} kg",
        title_justify="left",
        caption=f"contact points: {points}\nleft and right: {symmetry}",
        caption_justify="left",
    )
    for heading in ("link mass kg", "inertia kg m²", "range", "torque N m"):
        table.add_column(heading, justify="right")
    for joint, name in enumerate(robot.joint_names):
        actuator = actuator_of.get(joint)
        torque = (
            ""
            if actuator is None
            else _span(model.torque_lower[actuator], model.torque_upper[actuator], "")
        )
        table.add_row(
            name,
            _number(model.mass[joint]),
            _number(model.inertia[joint]),
            _span(model.lower[joint], model.upper[joint], " rad" if model.axis[joint, 0] else " m"),
            torque,
        )
    return table


def _number(value: float) -> str:
    return f"{value:.4g}" if value else ""


def _span(lower: float, upper: float, unit: str) -> str:
    if lower == float("-inf") and upper == float("inf"):
        return "free"
    return f"{lower:.4g} … {upper:.4g}{unit}"
