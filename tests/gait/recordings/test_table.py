"""Tables in JSON and OpenSim's forms, and files that are broken."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.errors import GaitError
from heelstrike.gait.recordings.forces import load_forces
from heelstrike.gait.recordings.motion import load_recorded_motion
from heelstrike.gait.recordings.table import read_table

NAMES = walking.bravo7().actuator_names
ROWS = np.linspace(-0.5, 0.5, 60).reshape(10, 6)


def mot(folder: Path, names: list[str], rows: np.ndarray, *, header: str = "") -> Path:
    """A file as OpenSim writes one."""
    path = folder / "motion.mot"
    table = ["\t".join(names), *("\t".join(repr(float(x)) for x in row) for row in rows)]
    top = header or f"motion\nversion=1\nnRows={len(rows)}\ninDegrees=yes\n\nendheader\n"
    path.write_text(top + "\n".join(table) + "\n", encoding="utf-8")
    return path


def test_json_of_columns(tmp_path: Path) -> None:
    path = tmp_path / "motion.json"
    columns = {f"{name} [deg]": ROWS[:, k].tolist() for k, name in enumerate(NAMES)}
    path.write_text(json.dumps({"rate_Hz": 40, "made by": "a plotter", **columns}))
    motion = load_recorded_motion(path, walking.bravo7())
    np.testing.assert_allclose(motion.position, np.deg2rad(ROWS), rtol=1e-15)
    np.testing.assert_allclose(motion.time, np.arange(10) / 40.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 2]", "columns by name"),
        ("{", "line 1: no JSON"),
        ('{"a": [1, 2, 3, 4, 5, 6, 7, NaN]}', "NaN is no number"),
        ('{"a": [1, 2, 3, 4, 5, 6, 7, 1e999]}', "'a', row 8: the number is too large"),
        ('{"a": [1, 2, 3, 4, 5, 6, 7, true]}', "'a', row 8: a number"),
        ('{"a": [1, 2]}', "at least 8 rows"),
        ('{"a": [1, 2, 3, 4, 5, 6, 7, 8], "b": [1]}', "'b' has 1 rows"),
        ('{"a": [1, 2, 3, 4, 5, 6, 7, 8], "A": [1, 2, 3, 4, 5, 6, 7, 8]}', "two columns"),
        ('{"rate_Hz": "fast", "a": [1, 2, 3, 4, 5, 6, 7, 8]}', "must be a number"),
        ("[" * 100_000, "cannot be read"),
        ("{}", "columns are wanted"),
    ],
)
def test_json_that_is_no_table(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "motion.json").write_text(text)
    with pytest.raises(GaitError, match=words):
        read_table(tmp_path / "motion.json")


def test_coordinates_of_opensim_have_our_senses(tmp_path: Path) -> None:
    """Flexion of the hip and dorsiflexion lift the leg and the toes, which ours count negative."""
    time = 0.1 * np.arange(10)
    names = ["time", "pelvis_tilt", "pelvis_tx", "hip_flexion_r", "knee_angle_r", "ankle_angle_r"]
    names += ["hip_flexion_l", "knee_angle_l", "ankle_angle_l", "lumbar_extension"]
    values = [5.0, 0.7, 30.0, -40.0, 10.0, -20.0, -10.0, -15.0, -12.0]
    path = mot(tmp_path, names, np.column_stack([time, np.tile(values, (10, 1))]))
    motion = load_recorded_motion(path, hs.load_robot("human7"))
    expected = [-42.0, 40.0, -10.0, 8.0, 10.0, 15.0]  # hips against a trunk at 12 - 5 degrees
    np.testing.assert_allclose(np.rad2deg(motion.position), np.tile(expected, (10, 1)))
    assert read_table(path).units[names.index("pelvis_tx")] == ""  # a length, in no degrees


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("motion\nnRows=10\n", "needs a line 'endheader'"),
        ("motion\nnRows=11\nendheader\n", "says 11 rows, and there are 10"),
    ],
)
def test_headers_of_opensim_that_are_wrong(header: str, words: str, tmp_path: Path) -> None:
    path = mot(tmp_path, list("abcdef"), ROWS, header=header)
    with pytest.raises(GaitError, match=words):
        read_table(path)


def test_a_line_of_opensim_that_is_no_numbers_is_named(tmp_path: Path) -> None:
    path = mot(tmp_path, list("abcdef"), ROWS)
    lines = path.read_text().splitlines()
    lines[11] = lines[11].replace("-", "minus ", 1)
    path.write_text("\n".join(lines))
    with pytest.raises(GaitError, match="line 12: 6 finite numbers"):
        read_table(path)


def test_forces_plate_by_plate(tmp_path: Path) -> None:
    kinds = [f"{kind}{axis}" for kind in "vp" for axis in "xyz"]
    names = ["time", *(f"{plate}ground_force_{k}" for plate in ("", "1_") for k in kinds)]
    rows = np.column_stack([0.5 + 0.01 * np.arange(10), np.arange(120.0).reshape(10, 12)])
    forces = load_forces(mot(tmp_path, names, rows))
    np.testing.assert_allclose(forces.time, rows[:, 0])
    np.testing.assert_array_equal(forces.force[3], [[36.0, 37.0], [42.0, 43.0]])
    np.testing.assert_array_equal(forces.point[3], [[39.0, 40.0], [45.0, 46.0]])
    names[5] = "battery"
    broken, other = mot(tmp_path, names, rows), tmp_path / "other"
    with pytest.raises(GaitError, match="no column 'ground_force_py'"):
        load_forces(broken)
    other.mkdir()
    path = mot(other, list("abcdef"), ROWS)
    with pytest.raises(GaitError, match="no forces"):
        load_forces(path)


def test_only_files_of_opensim_have_its_names_and_senses(tmp_path: Path) -> None:
    """A table of text may call a joint as OpenSim does, and count its angle as it likes."""
    names = ["time", "hip_flexion_r", "knee_angle_r", "ankle_angle_r"]
    names += ["hip_flexion_l", "knee_angle_l", "ankle_angle_l"]
    rows = np.column_stack([0.1 * np.arange(10), ROWS])
    path = mot(tmp_path, names, rows)
    assert read_table(path).opensim
    assert len(load_recorded_motion(path, hs.load_robot("human7")).time) == 10
    other = tmp_path / "motion.csv"
    lines = [",".join(repr(float(x)) for x in row) for row in rows]
    other.write_text("\n".join([",".join(names), *lines]) + "\n")
    assert not read_table(other).opensim
    with pytest.raises(GaitError, match="no column for"):
        load_recorded_motion(other, hs.load_robot("human7"))
