"""``heelstrike simulate``: a robot in space is dropped, or holds its posture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heelstrike.cli import INTERRUPTED
from heelstrike.cli.options import (
    Animated,
    Animation,
    AsJson,
    FixedStep,
    Friction,
    OnGround,
    Reading,
    RobotName,
)
from heelstrike.cli.planning import FIRST_TIME
from heelstrike.cli.terminal import (
    FAILED,
    output,
    spoken,
    stage,
    tell,
    this_command,
    wrote,
)
from heelstrike.cli.values import ground_called, spatial_pushes_called


# As many arguments as the command has options: a person's.
@spoken
def simulate(
    robot: RobotName,
    *,
    duration: Annotated[float, typer.Option(help="Seconds to simulate.")] = 2.0,
    hold: Annotated[
        bool,
        typer.Option(
            "--hold/--drop",
            help="Hold the posture with springs and dampers, or drop the robot without torques.",
        ),
    ] = True,
    kp: Annotated[float, typer.Option(help="Stiffness that holds it, N m/rad.")] = 200.0,
    kd: Annotated[float, typer.Option(help="Damping, N m s/rad.")] = 5.0,
    above: Annotated[
        float, typer.Option(help="Height of the lowest contact point above the ground in m.")
    ] = 0.0,
    step: FixedStep = 1e-3,
    ground: OnGround = "flat",
    friction: Friction = 0.75,
    push: Annotated[
        list[str] | None,
        typer.Option(
            "--push",
            metavar="LINK:X,Y,Z:START:DURATION",
            help="Push a link, in N along x, y and z, and s; repeat the option for more.",
        ),
    ] = None,
    how: Reading,
    out: Annotated[
        Path,
        typer.Option(
            file_okay=False, help="Folder of the results; files of the same names are replaced."
        ),
    ] = Path("simulation"),
    animation: Animated = Animation.MP4,
    as_json: AsJson = False,
) -> None:
    """Drop a robot in space, or let it hold its posture, and write data, a film and a page.

    The robot moves in three dimensions. Gains are reduced on joints with too little inertia for
    the step. Writes run.nc, summary.json, run.html and run.mp4 (or .gif). The exit status
    is 0 if the robot did not fall, 1 if it did or the simulation failed, 2 if the request was
    wrong, 130 after Ctrl-C, which keeps the results so far.
    """
    with stage("loading"):
        from heelstrike.experiments.space import hold as hold_posture
        from heelstrike.robot.library import load_robot
        from heelstrike.robot.spatial.robot import SpatialRobot
        from heelstrike.sim import RunStatus, TimeStepping, simulate
        from heelstrike.sim.spatial.placing import placed_in_space
        from heelstrike.sim.spatial.space import SPACE
        from heelstrike.whole_file import write_whole

        if not duration > 0.0:
            raise typer.BadParameter("must be longer than zero", param_hint="--duration")
        surface = SPACE.checked_ground(ground_called(ground, friction=friction))
        pushes = spatial_pushes_called(push)
        method = TimeStepping(step=step)
        loaded = load_robot(robot, dimension=3, **how.keywords())
        assert isinstance(loaded, SpatialRobot)  # which is what was asked for
        law = hold_posture(loaded, step, kp=kp, kd=kd) if hold else None
        state = placed_in_space(loaded, surface, above=above)
        out.mkdir(parents=True, exist_ok=True)
    with stage(f"simulating {duration:g} s", when_slow=FIRST_TIME) as going:
        run = simulate(
            loaded, law, state=state, duration=duration, ground=surface, method=method,
            pushes=pushes, progress=lambda t: going.reached(t / duration),
        )  # fmt: skip
    interrupted = run.status is RunStatus.INTERRUPTED
    with stage("writing results"):
        wrote(run.save(out / "run.nc"))
        summary = run.summary()
        wrote(write_whole(out / "summary.json", summary.to_json() + "\n"))
        if not interrupted:
            wrote(run.save_html(out / "run.html", command=this_command()))
            if animation is not Animation.NONE:
                wrote(run.animate(out / f"run.{animation.value}"))
    if as_json:
        typer.echo(summary.to_json())
    else:
        output().print(summary)
        tell(f"data, film and page are in {out}")
    if interrupted:
        raise typer.Exit(INTERRUPTED)
    if not run.completed:
        raise typer.Exit(FAILED)
