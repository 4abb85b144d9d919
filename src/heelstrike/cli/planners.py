"""``heelstrike planners``: the cart table against the optimal gait."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli.options import AsJson, Friction, Reading, RobotName, TableFolder
from heelstrike.cli.planning import planar_robot_called
from heelstrike.cli.terminal import FAILED, print_found, save_json, spoken, stage, tell
from heelstrike.cli.values import numbers_called


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def planners(
    robot: RobotName = "bravo7",
    *,
    speeds: Annotated[
        str, typer.Option(metavar="V,V,...", help="Speeds in m/s, with commas between.")
    ] = "0.2,0.3,0.4,0.5,0.6",
    step_duration: Annotated[float, typer.Option(help="Duration of a step in s.")] = 0.7,
    friction: Friction = 0.75,
    steps: Annotated[int, typer.Option(min=2, help="Steps of each walk.")] = 10,
    how: Reading,
    out: TableFolder = Path("planners"),
    as_json: AsJson = False,
) -> None:
    """Compare walks planned by the cart-table model with the optimal gait.

    The zero moment point is planned first, by preview control or by the capture point, and the
    joints follow by inverse kinematics; the optimal gait needs the least torque. All are walked
    event-driven. The exit status is 1 if one of them falls or cannot be planned.
    """
    with stage("loading"):
        from heelstrike.experiments.planners import compare_planners
        from heelstrike.view.planner_figure import draw_planners
        from heelstrike.view.style import save_figure

        machine = planar_robot_called(robot, how)
        asked = numbers_called(speeds, "--speeds")
    with stage("walking") as doing:
        found = compare_planners(
            machine, speeds=asked, step_duration=step_duration, friction=friction, steps=steps,
            progress=lambda what: doing.doing(what, 0.0),
        )  # fmt: skip
    told = found.to_dict()
    save_json(out / "planners.json", told)
    print_found(found, told, as_json=as_json)
    save_figure(draw_planners(machine, told["walks"]), out / "planners.png")
    tell(f"in {out}: planners.json, planners.png")
    if not all(each.walks for each in found.walks):
        raise typer.Exit(FAILED)
