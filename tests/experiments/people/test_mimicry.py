"""A person's walk on hard contact: near, exact, walked; and what is left in a folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.errors import GaitError
from heelstrike.experiments.people import Mimicry, mimic
from heelstrike.experiments.people.writing import write_mimicry
from heelstrike.gait.polynomials import gauss
from heelstrike.gait.recordings.motion import load_recorded_motion


@pytest.fixture(scope="module")
def winter() -> Mimicry:
    return mimic("winter")


@pytest.mark.slow
def test_the_nearest_gait_is_near_and_walks(winter: Mimicry) -> None:
    assert winter.nearest.distance < 2.0  # degrees rms; a flat foot all the time leaves 5
    assert winter.walk.all_of_them
    assert winter.walk.run.completed
    assert "20 of 20 steps" in str(winter)
    told = np.rad2deg(
        [winter.wanted.position(t) for t in np.linspace(0.0, winter.nearest.motion.duration, 500)]
    )
    moved = winter.nearest.motion.position(np.linspace(0.0, winter.nearest.motion.duration, 500))
    away = np.rad2deg(moved[:, 3:]) - told[:, 1:]
    assert np.sqrt((away**2).mean()) == pytest.approx(winter.nearest.distance, rel=0.01)


@pytest.mark.slow
def test_no_force_is_lacking(winter: Mimicry) -> None:
    """A v̇ + H = Jᵀλ on the trunk at the Gauss points, by point Jacobians: within 1e-9 N."""
    robot = winter.robot
    for phase in winter.nearest.motion.phases:
        nodes, _ = gauss(phase.force.shape[1])
        times = phase.breakpoints[:-1, None] + np.diff(phase.breakpoints)[:, None] * nodes
        forces = phase.force.reshape(-1, robot.nc, 2)
        for t, force in zip(times.ravel(), forces, strict=True):
            q, v, a = (phase.coordinates(t, order=order) for order in range(3))
            lacking = dynamics.mass_matrix(robot, q) @ a + dynamics.bias_force(robot, q, v)
            for i, (normal, tangent) in enumerate(force):
                link, local = int(robot.model.contact_link[i]), robot.model.contact_position[i]
                rows = dynamics.point_jacobian(robot, q, link, local)[:2]
                lacking -= rows.T @ np.array([tangent, normal])
            assert np.abs(lacking[:3]).max() < 1e-9


@pytest.mark.slow
def test_what_is_left_in_a_folder(winter: Mimicry, tmp_path: Path) -> None:
    files = write_mimicry(winter, tmp_path / "out", rate=500.0)
    assert all(each.stat().st_size for each in files)
    motion = hs.load_motion(tmp_path / "out" / "motion.json", winter.robot)
    table = load_recorded_motion(tmp_path / "out" / "motion.csv", winter.robot)
    assert table.rate == pytest.approx(500.0)
    joints = winter.robot.model.actuator_joint
    np.testing.assert_array_equal(table.position, motion.position(table.time)[:, joints])
    told = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert told["gait"]["distance_deg"] == winter.nearest.distance
    assert told["walk"]["steps"] == 20


def test_recordings_that_cannot_be_mimicked(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("time,battery\n" + "".join(f"{k},1\n" for k in range(10)))
    with pytest.raises(GaitError, match="no markers"):
        mimic(path)
    with pytest.raises(GaitError, match="cannot be read"):
        mimic(tmp_path / "none.trc")
    with pytest.raises(GaitError, match="hip, knee and ankle"):
        mimic("winter", robot=hs.load_robot("rabbit"))
    with pytest.raises(GaitError, match="robot must be a Robot"):
        mimic("winter", robot="bravo7")  # type: ignore[arg-type]
