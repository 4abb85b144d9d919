"""``heelstrike identify``: what a robot is, from what it measured as it moved."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli.options import AsJson, MeasuredRobot, Rate, Reading, Unit
from heelstrike.cli.planning import planar_robot_called
from heelstrike.cli.terminal import print_found, spoken, stage, tell, wrote
from heelstrike.wording import some_of

SHOWN = 6
"""Columns of no use that are named."""


# As many arguments as the command has options: a person's, none of which is handed on one by one.
@spoken
def identify(
    recording: Annotated[
        Path, typer.Argument(help="Table of text: time, joints, torques, perhaps contact forces.")
    ],
    *,
    robot: MeasuredRobot = "bravo7",
    rate: Rate = None,
    unit: Unit = "",
    encoder_noise: Annotated[
        float | None,
        typer.Option(help="Noise of the encoders in rad.", show_default="told by roughness"),
    ] = None,
    torque_noise: Annotated[float, typer.Option(help="Noise of the torques in N m.")] = 0.2,
    force_noise: Annotated[float, typer.Option(help="Noise of the contact forces in N.")] = 2.0,
    longest_delay: Annotated[
        float, typer.Option(help="Longest delay of the motors in s that is looked for.")
    ] = 0.0,
    how: Reading,
    figure: Annotated[
        Path | None, typer.Option(dir_okay=False, help="Also draw it, as .png, .svg or .pdf.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tell masses, moments, friction and delay of a robot from a recorded motion.

    Each number comes with an interval that holds in 95 %, and what the motion does not tell is
    named. Lengths are those of the robot's file.
    """
    with stage("loading"):
        from heelstrike.analysis.told_summary import plain
        from heelstrike.experiments.identification import identify as told_by
        from heelstrike.experiments.identification.figure import draw_identified
        from heelstrike.gait.recordings.robot_log import load_robot_log
        from heelstrike.view.style import save_figure

        machine = planar_robot_called(robot, how)
        log = load_robot_log(recording, machine, rate=rate, unit=unit)
    if log.ignored:
        tell(f"columns of no use: {some_of(log.ignored, SHOWN)}")
    with stage("fitting"):
        found = told_by(
            machine, log, encoder_noise=encoder_noise, torque_noise=torque_noise,
            force_noise=force_noise, longest_delay=longest_delay,
        )  # fmt: skip
    if figure is not None:
        wrote(save_figure(draw_identified(found), figure))
    told = {
        "numbers": [
            {"name": each.name, "unit": each.unit, "value": each.value, "low": each.low,
             "high": each.high, "file": each.assumed, "told": each.told,
             "with": [{"share": share, "name": name} for share, name in each.others]}
            for each in found.numbers
        ],
        "delay": plain(found.delay),
        "friction": found.friction.value if found.friction.samples else None,
        "friction_at_least": plain(found.friction.at_least),
        "not_told": list(found.hidden), "misfit": found.misfit,
    }  # fmt: skip
    print_found(str(found), told, as_json=as_json)
