"""What inspection says of a robot in space, in words and as data."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike.robot import RobotWarning, SpatialRobot
from heelstrike.robot.inspection import facts

ROBOT = """
<mujoco model="pair"><worldbody><body name="trunk" pos="0 0 1"><freejoint name="base"/>
  <inertial pos="0 0 0.1" mass="5" diaginertia="0.1 0.2 0.25"/>
  <body name="arm" pos="0 0.2 0"><joint name="shoulder" type="ball"/>
    <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>
  <body name="leg" pos="0 0 -0.1"><joint name="hip" axis="1 0 0" range="-20 90" damping="0.5"/>
    <inertial pos="0 0 -0.4" mass="2" diaginertia="0.03 0.03 0.01"/>
    <geom size="0.05" pos="0 0 -0.8"/></body></body></worldbody>
  <actuator><motor name="hip" joint="hip" ctrlrange="-40 40"/></actuator></mujoco>"""


def written(folder: Path, text: str = ROBOT) -> Path:
    path = folder / "pair.xml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_in_space_is_inspected(tmp_path: Path) -> None:
    inspection = hs.inspect_robot(written(tmp_path))
    assert isinstance(inspection.robot, SpatialRobot)
    assert inspection.loadable
    assert inspection.sound
    text = inspection.text()
    for words in (
        "pair: 8 kg, in space, 12 positions, 10 velocities, 1 actuators, 1 contact points",
        "moves freely", "├ shoulder", "└ hip", "hinge 1, 0, 0", "-0.3491 … 1.571", "± 40",
        "damping 0.5", "feet: leg (1 points)", "leg: 1, 0.85 m, radius 0.05 m",
    ):  # fmt: skip
        assert words in text, words


def test_as_data(tmp_path: Path) -> None:
    inspection = hs.inspect_robot(written(tmp_path))
    found = json.loads(json.dumps(facts(inspection)))
    assert found["dimension"] == 3
    assert found["joint_kinds"] == ["free", "ball", "hinge"]
    assert found["parent"] == [-1, 0, 0]
    assert found["upper"] == [None, None, pytest.approx(np.pi / 2)]
    assert found["velocities"][-1] == "hip"
    assert found["findings"] == []


def test_what_looks_wrong_is_found(tmp_path: Path) -> None:
    wrong = ROBOT.replace('diaginertia="0.03 0.03 0.01"', 'diaginertia="0.03 0.3 0.01"')
    inspection = hs.inspect_robot(written(tmp_path, wrong))
    assert "principal moments 0.01, 0.03, 0.3 kg m²" in inspection.text()
    assert "They are taken as they are." in inspection.text()
    assert "In the plane" not in inspection.text()


def test_a_robot_and_a_projected_file(tmp_path: Path) -> None:
    path = written(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)
        robot = hs.load_robot(path, dimension=3)
    assert "in space" in hs.inspect_robot(robot).text()
    lifted = hs.load_robot("bravo7", dimension=3)
    assert "base: is held" in hs.inspect_robot(lifted).text()
