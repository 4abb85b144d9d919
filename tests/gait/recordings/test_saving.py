"""Gaits and motions as tables, and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait.recordings.motion import load_recorded_motion


@pytest.mark.parametrize("suffix", [".csv", ".TSV"])
def test_a_gait_comes_back_to_the_last_bit(suffix: str, tmp_path: Path) -> None:
    gait, robot = walking.gait(), walking.bravo7()
    path = tmp_path / f"gait{suffix}"
    gait.save(path, rate=200.0, steps=3)
    motion = load_recorded_motion(path, robot)
    assert motion.rate == pytest.approx(200.0)
    assert motion.time[-1] == pytest.approx(3.0 * gait.step_duration)
    np.testing.assert_array_equal(motion.position, gait.position(motion.time))


def test_degrees_and_an_order_of_ones_own(tmp_path: Path) -> None:
    gait = walking.gait()
    order = gait.joint_names[::-1]
    gait.save(tmp_path / "gait.csv", rate=50.0, joints=order, degrees=True)
    heading = (tmp_path / "gait.csv").read_text().splitlines()[0]
    assert heading == ",".join(["time [s]", *(f"{name} [deg]" for name in order)])
    motion = load_recorded_motion(tmp_path / "gait.csv", walking.bravo7())
    np.testing.assert_allclose(motion.position, gait.position(motion.time), atol=1e-14)


def test_tables_that_cannot_be_meant(tmp_path: Path) -> None:
    gait = walking.gait()
    with pytest.raises(GaitError, match="rate must be"):
        gait.save(tmp_path / "gait.csv", rate=0.0)
    with pytest.raises(GaitError, match="at least 8"):
        gait.save(tmp_path / "gait.csv", rate=2.0)
    with pytest.raises(GaitError, match=r"no joint 'left_hpi'\. Did you mean 'left_hip'"):
        gait.save(tmp_path / "gait.csv", joints=["left_hpi"])
    with pytest.raises(GaitError, match="different names"):
        gait.save(tmp_path / "gait.csv", joints=["left_hip", "left_hip"])
    with pytest.raises(GaitError, match="too many"):
        gait.save(tmp_path / "gait.csv", rate=1e6)
    assert not list(tmp_path.iterdir())


def test_a_motion_is_saved_with_its_mirror_image(tmp_path: Path) -> None:
    robot = hs.load_robot("rabbit")
    phases = [
        hs.ContactPhase("right_tibia", duration=(0.05, 0.3), pieces=4),
        hs.ContactPhase(duration=(0.05, 0.3), pieces=3),
    ]
    running = hs.optimize_motion(robot, phases, speed=2.0, starts=1, refine=False)
    path = tmp_path / "run.csv"
    running.save(path, robot=robot, rate=1000.0)
    motion = load_recorded_motion(path, robot)
    assert motion.time[-1] == pytest.approx(2.0 * running.duration, abs=1e-3)
    joints = robot.model.actuator_joint
    np.testing.assert_array_equal(motion.position, running.position(motion.time)[:, joints])
    with pytest.raises(GaitError, match="give robot"):
        running.save(path)
    with pytest.raises(GaitError, match="designed for robot"):
        running.save(path, robot=walking.bravo7())
