"""A person's walk on hard contact: near, exact, walked; and what is left in a folder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import heelstrike as hs
from heelstrike import dynamics
from heelstrike.errors import GaitError
from heelstrike.experiments.people import Mimicry, mimic, mimicry
from heelstrike.experiments.people.body import pitch_in
from heelstrike.experiments.people.moments import Moments
from heelstrike.experiments.people.writing import write_mimicry
from heelstrike.gait.polynomials import gauss
from heelstrike.gait.recordings.forces import RecordedForces
from heelstrike.gait.recordings.motion import load_recorded_motion
from heelstrike.gait.recordings.table import read_table


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


@pytest.mark.slow
def test_moments_are_written_with_their_peaks(winter: Mimicry, tmp_path: Path) -> None:
    """And a table of the motion that cannot be written takes nothing else along."""
    time = np.arange(9) / 100.0
    random = np.random.default_rng(2)
    torque, residual = random.normal(size=(9, 6)), random.normal(size=(9, 3))
    measured = replace(winter, moments=Moments(time, torque, residual))
    with pytest.raises(GaitError, match="give a higher rate"):
        write_mimicry(measured, tmp_path, rate=1.0)
    table = read_table(tmp_path / "moments.csv")
    assert table.written[1] == "right_hip_moment [N m]"
    np.testing.assert_array_equal(table.values, np.column_stack([time, torque, residual]))
    told = json.loads((tmp_path / "summary.json").read_text())["moments"]
    assert told["peak_Nm"]["right_hip"] == np.abs(torque[:, 0]).max()
    assert told["trunk_lacks_Nm"] == np.abs(residual[:, 2]).max()
    assert (tmp_path / "walk.nc").exists()
    assert not (tmp_path / "motion.csv").exists()


def joints(path: Path, *, degrees: bool = False, unit: str = "", hole: bool = False) -> Path:
    """A table of joints that swing, with a pitch of the trunk."""
    time = 0.02 * np.arange(100)
    phase = 2.0 * np.pi * time / 1.1
    columns = {"root_pitch": 0.1 * np.ones(100)}
    for side, shift in (("right", 0.0), ("left", np.pi)):
        columns[f"{side}_hip"] = -0.5 * np.cos(phase + shift)
        columns[f"{side}_knee"] = 0.5 - 0.5 * np.cos(phase + shift + 0.6)
        columns[f"{side}_ankle"] = 0.2 * np.sin(phase + shift)
    values = np.column_stack(list(columns.values()))
    rows = [
        ",".join(map(repr, [t, *row]))
        for t, row in zip(
            time.tolist(), (np.rad2deg(values) if degrees else values).tolist(), strict=True
        )
    ]
    if hole:
        words = rows[40].split(",")
        rows[40] = ",".join([*words[:2], "", *words[3:]])
    heading = ",".join(["time", *(f"{name}{unit}" for name in columns)])
    path.write_text("\n".join([heading, *rows]) + "\n")
    return path


def test_joints_are_read_in_their_unit(tmp_path: Path) -> None:
    path = joints(tmp_path / "walk.csv", degrees=True)
    with pytest.raises(GaitError, match="make no sense in rad, but in degrees"):
        mimic(path)
    with pytest.raises(GaitError, match="rad or deg, got 'degree'"):
        mimic(path, unit="degree")
    pitch = pitch_in(read_table(path), "deg")
    assert pitch is not None
    np.testing.assert_allclose(pitch, 0.1)


def test_a_cell_that_is_empty_is_told_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(GaitError, match="line 42: column 'right_hip' has no number"):
        mimic(joints(tmp_path / "walk.csv", hole=True))
    path = joints(tmp_path / "walk.csv")
    lines = path.read_text().splitlines()
    lines[9] = ",".join([lines[9].split(",")[0], "", *lines[9].split(",")[2:]])
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(GaitError, match="line 10: column 'root_pitch' has no number"):
        mimic(path)


def force_table(path: Path) -> Path:
    names = [f"ground_force_{kind}{axis}" for kind in "vp" for axis in "xyz"]
    rows = [",".join(map(str, [0.02 * k, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])) for k in range(100)]
    path.write_text("\n".join([",".join(["time", *names]), *rows]) + "\n")
    return path


def test_forces_go_with_markers_only(tmp_path: Path) -> None:
    forces = force_table(tmp_path / "forces.csv")
    with pytest.raises(GaitError, match="forces go with markers only"):
        mimic(joints(tmp_path / "walk.csv"), forces=forces)


@pytest.mark.parametrize("given", [{"markers": {"right_hip": "X"}}, {"up": "z"}, {"forward": "x"}])
def test_what_is_of_markers_is_refused_for_joints(given: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(GaitError, match=rf"table of joints; {next(iter(given))} go with markers"):
        mimic(joints(tmp_path / "walk.csv"), **given)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"speed": 0.0}, "speed must be a positive number"),
        ({"speed": np.nan}, "speed must be a positive number"),
        ({"friction": -1.0}, "friction must not be negative"),
        ({"steps": 0}, "steps must be 1 or more"),
        ({"rate": -1.0}, "rate must be from"),
    ],
)
def test_numbers_that_make_no_sense(asked: dict[str, Any], said: str) -> None:
    """Before the file is looked for."""
    with pytest.raises(GaitError, match=said):
        mimic("nowhere.trc", **asked)


@pytest.mark.parametrize("forward", [None, "-y"])
def test_forces_are_in_the_axes_of_the_markers(
    forward: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Winter's person walks along -y here, and z is up: said, or found from heels and toes."""
    winter = read_table(mimicry.LIBRARY / "winter_table_a1.csv", gaps=True)
    values, names = winter.values.copy(), []
    for k, written in enumerate(winter.written):
        along = winter.names[k].endswith("_x")
        values[:, k] *= -1.0 if along else 1.0
        names.append(written.replace("_x", "_y") if along else written.replace("_y", "_z"))
    path = tmp_path / "walk.csv"
    rows = [",".join("" if np.isnan(x) else repr(x) for x in row) for row in values.tolist()]
    path.write_text("\n".join([",".join(names), *rows]) + "\n")

    class ReachedError(Exception):
        pass

    def reached(_: Any, forces: RecordedForces) -> None:
        np.testing.assert_array_equal(forces.force[0, 0], [-2.0, 3.0])
        np.testing.assert_array_equal(forces.point[0, 0], [-5.0, 6.0])
        raise ReachedError

    monkeypatch.setattr("heelstrike.experiments.people.mimicry.moments_of", reached)
    with pytest.raises(ReachedError):
        mimic(path, forward=forward, forces=force_table(tmp_path / "forces.csv"))


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
