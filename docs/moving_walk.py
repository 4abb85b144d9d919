"""The walk on the front page: computed again by every build, so that it is of this version."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def on_post_build(config: Any, **_: Any) -> None:
    """Write ``walk.html`` beside the front page, which shows it in a frame."""
    import heelstrike as hs

    robot = hs.load_robot("bravo7")
    gait = hs.optimize_gait(robot, step_length=0.30, step_duration=0.70, friction=0.6)
    run = hs.simulate(
        robot,
        hs.ComputedTorque(robot, gait),
        state=gait.initial_state,
        duration=6.1 * gait.step_duration,
        method=hs.TimeStepping(step=1e-3),
        ground=hs.Ground(friction=0.75),
    )
    run.save_html(Path(config["site_dir"]) / "walk.html", gait=gait)
