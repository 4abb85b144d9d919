"""A small humanoid that is watched, and what a session shows of it."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

import heelstrike as hs
from heelstrike.view.live.board import Board
from heelstrike.view.live.session import Session


def leg(side: str, y: float) -> str:
    return f"""
  <body name="{side}_thigh" pos="0 {y} -0.1"><joint name="{side}_hip_joint" axis="0 1 0"
      range="-1 1"/><geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.05" mass="4"/>
    <body name="{side}_foot" pos="0 0 -0.35"><joint name="{side}_ankle_joint" axis="0 1 0"
      range="-0.5 0.5"/><geom type="box" size="0.15 0.06 0.03" pos="0.03 0 0" mass="1"/></body>
  </body>"""


HUMANOID = f"""
<mujoco model="small"><compiler angle="radian" autolimits="true"/><worldbody>
<body name="trunk" pos="0 0 0.48"><freejoint name="root"/>
  <geom type="box" size="0.1 0.15 0.1" mass="10"/>
  <body name="head" pos="0 0 0.15"><joint name="neck" axis="0 0 1" range="-1 1"/>
    <geom type="sphere" size="0.08" mass="1"/></body>{leg("left", 0.1)}{leg("right", -0.1)}
</body></worldbody><actuator>
{
    "".join(
        f'<motor joint="{side}_{j}_joint" ctrlrange="-80 80"/>'
        for side in ("left", "right")
        for j in ("hip", "ankle")
    )
}<motor joint="neck" ctrlrange="-5 5"/>
</actuator></mujoco>"""


def humanoid(folder: Path) -> hs.SpatialRobot:
    file = folder / "small.xml"
    file.write_text(HUMANOID)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = hs.load_robot(file, dimension=3)
    assert isinstance(robot, hs.SpatialRobot)
    return robot


def standing(robot: hs.SpatialRobot, **options: Any) -> Any:
    return hs.Simulation(
        robot, hs.HoldPosture(robot, kp=300.0, kd=8.0), state=robot.reference_state(), **options
    )


class Shown(Board):
    """A board that is looked at without JSON."""

    def __init__(self) -> None:
        super().__init__()
        self.told: dict[str, Any] = {}
        self.seen: np.ndarray = np.zeros(0)
        self.layout: Any = None

    def begin(self, scene: Any) -> None:
        super().begin(scene)
        self.layout, self.scene = scene["layout"], scene["scene"]

    def add(self, frames: Any, events: Any = ()) -> None:
        super().add(frames, events)
        self.seen = frames[-1]

    def look(self, frame: Any) -> None:
        super().look(frame)
        self.seen = frame

    def state(self, state: Any) -> None:
        super().state(state)
        self.told |= state

    def field(self, name: str) -> np.ndarray:
        begin, width = self.layout["fields"][name]
        return self.seen[begin : begin + width]


def ask(session: Session, do: str, **more: Any) -> str:
    """Ask for something; return the note that comes back."""
    session.obey("a", {"do": do, **more})
    told: str = session._board.told["note"]  # type: ignore[attr-defined]
    return told


def go_on(session: Session, until: float) -> None:
    for _ in range(1000):
        if session.cursor >= until - 1.5e-3:
            return
        session.update(0.016)
    raise AssertionError(f"stays at {session.cursor}: {session.history.newest}")
