"""``heelstrike check``: a trajectory before it reaches hardware."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli.options import AsJson, Friction, MeasuredRobot, Rate, Reading, Unit
from heelstrike.cli.planning import planar_robot_called
from heelstrike.cli.terminal import FAILED, print_found, spoken, stage, this_command, wrote


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def check(
    trajectory: Annotated[
        Path, typer.Argument(help="Table of text: a column a driven joint, and the time.")
    ],
    *,
    robot: MeasuredRobot = "bravo7",
    rate: Rate = None,
    unit: Unit = "",
    friction: Friction = 0.75,
    stiffness: Annotated[
        float | None,
        typer.Option(
            help="Stiffness of the servos, in N m/rad.", show_default="suits the robot's size"
        ),
    ] = None,
    damping: Annotated[
        float | None,
        typer.Option(
            help="Damping of the servos, in N m s/rad.", show_default="suits the robot's size"
        ),
    ] = None,
    trials: Annotated[
        int, typer.Option(min=0, help="Walks with tolerances of mass, ground and delay.")
    ] = 64,
    seed: Annotated[int, typer.Option(min=0, help="Seed of these walks.")] = 0,
    how: Reading,
    page: Annotated[
        Path | None, typer.Option(dir_okay=False, help="Also write the walk of it as a page.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check a trajectory of joints before it reaches hardware, and walk it.

    The stance foot is assumed flat, which gives trunk and phases. The checks are inverse dynamics
    against motors, soles and friction, a walk on hard contact by servos, and walks with
    tolerances. The exit status is 0 if all pass, otherwise 1.
    """
    with stage("loading"):
        from heelstrike.experiments.checking import check_motion
        from heelstrike.gait.recordings.motion import load_recorded_motion
        from heelstrike.view.page.page import check_page, save_html

        if page is not None:
            check_page(page)
        machine = planar_robot_called(robot, how)
        motion = load_recorded_motion(trajectory, machine, rate=rate, unit=unit)
    with stage("checking") as doing:
        found = check_motion(
            machine, motion, friction=friction, stiffness=stiffness, damping=damping,
            trials=trials, seed=seed, progress=lambda what: doing.doing(what, 0.0),
        )  # fmt: skip
    if page is not None and found.run is not None and len(found.run.time):
        wrote(save_html(found.run, page, command=this_command()))
    told = {
        "good": found.good, "headline": found.headline,
        "findings": [asdict(each) | {"broken": each.broken} for each in found.findings],
    }  # fmt: skip
    if found.campaign is not None:
        good = int(found.campaign.success.sum())
        told["tolerances"] = {"trials": len(found.campaign), "success": good}
    print_found(str(found), told, as_json=as_json)
    if not found.good:
        raise typer.Exit(FAILED)
