"""Motions from tables of text: names, units, rate, and what is no motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import walking

from heelstrike.errors import GaitError
from heelstrike.gait.recordings.motion import load_recorded_motion, motion_of
from heelstrike.gait.recordings.opensim import joints_of_opensim
from heelstrike.gait.recordings.table import read_table

NAMES = walking.bravo7().actuator_names
ROWS = np.linspace(-0.5, 0.5, 60).reshape(10, 6)


def written(folder: Path, heading: str, rows: np.ndarray, separator: str = ",") -> Path:
    path = folder / "motion.csv"
    lines = [heading, *(separator.join(repr(float(x)) for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_columns_in_any_order_with_units_and_a_time(tmp_path: Path) -> None:
    """Degrees and milliseconds become ours; what is no joint is named and left out."""
    names = [f"{NAMES[5].replace('_', ' ').title()} [deg]", *NAMES[:4], f"{NAMES[4]}_deg"]
    table = np.column_stack((1000.0 + 5.0 * np.arange(10), np.ones(10), ROWS))
    path = written(tmp_path, ";".join(["t [ms]", "battery", *names]), table, ";")
    motion = load_recorded_motion(path, walking.bravo7())
    np.testing.assert_allclose(motion.time, 5e-3 * np.arange(10), atol=1e-12)
    np.testing.assert_array_equal(motion.position[:, :4], ROWS[:, 1:5])
    np.testing.assert_allclose(motion.position[:, 4], np.deg2rad(ROWS[:, 5]))
    np.testing.assert_allclose(motion.position[:, 5], np.deg2rad(ROWS[:, 0]))
    assert motion.ignored == ("battery",)
    assert motion.rate == pytest.approx(200.0)


def test_a_rate_and_a_unit_that_the_file_does_not_say(tmp_path: Path) -> None:
    path = written(tmp_path, " ".join(NAMES), ROWS, " ")
    motion = load_recorded_motion(path, walking.bravo7(), rate=50.0, unit="deg")
    np.testing.assert_allclose(motion.time, np.arange(10) / 50.0)
    np.testing.assert_allclose(motion.position, np.deg2rad(ROWS))
    assert not motion.seems_degrees(walking.bravo7())
    far = load_recorded_motion(
        written(tmp_path, ",".join(NAMES), 60.0 * ROWS), walking.bravo7(), rate=50.0
    )
    assert far.seems_degrees(walking.bravo7())


@pytest.mark.parametrize(
    ("heading", "rows", "words"),
    [
        (",".join(NAMES), ROWS, "say the rate"),
        (",".join(["time", *NAMES[1:]]), ROWS, "no column for right_hip"),
        (",".join(["time", "rigt_hip", *NAMES[1:]]), np.hstack((ROWS, ROWS[:, :1])),
         "Did you mean"),
        (",".join(["time", "t", *NAMES]), np.hstack((ROWS, ROWS[:, :2])), "two columns"),
        (",".join(["time", *NAMES]), np.hstack((ROWS[::-1, :1], ROWS)), "time does not go on"),
        (",".join(["time", *NAMES]), np.hstack((ROWS[:, :1], np.full((10, 6), np.nan))),
         "line 2: 7 finite numbers"),
        (",".join(["time", *NAMES]), ROWS, "line 2: 7 finite numbers"),
        ("# of a robot\n\n" + ",".join(["time", *NAMES]), ROWS, "line 4: 7 finite numbers"),
        (",".join(["time", *NAMES]), np.hstack((ROWS[:, :1], ROWS))[:3], "at least 8 rows"),
    ],
)  # fmt: skip
def test_what_is_no_motion_is_refused(
    heading: str, rows: np.ndarray, words: str, tmp_path: Path
) -> None:
    with pytest.raises(GaitError, match=words):
        load_recorded_motion(written(tmp_path, heading, rows), walking.bravo7())


def test_files_that_are_none(tmp_path: Path) -> None:
    robot = walking.bravo7()
    with pytest.raises(GaitError, match="cannot be read"):
        load_recorded_motion(tmp_path / "none.csv", robot)
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(GaitError, match="nothing in it"):
        load_recorded_motion(tmp_path / "empty.csv", robot)
    (tmp_path / "picture.csv").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(GaitError, match="not a text file"):
        load_recorded_motion(tmp_path / "picture.csv", robot)
    with pytest.raises(GaitError, match="rad or deg"):
        load_recorded_motion(tmp_path / "empty.csv", robot, unit="grad")


def test_a_unit_that_is_none_is_told_wherever_a_table_is_read(tmp_path: Path) -> None:
    table = read_table(written(tmp_path, ",".join(NAMES), ROWS))
    with pytest.raises(GaitError, match="rad or deg, got 'degree'"):
        motion_of(table, walking.bravo7(), rate=50.0, unit="degree")


@pytest.mark.parametrize(("heading", "words"), [
    ("time [deg]", r"'time \[deg\]' is in deg; s or ms is wanted"),
    (f"{NAMES[0]} [mm]", "is in mm; rad or deg or degrees is wanted"),
])  # fmt: skip
def test_a_unit_of_another_kind_is_refused(heading: str, words: str, tmp_path: Path) -> None:
    """A time in degrees was read as if a second had 57 of them."""
    names = ["time", *NAMES]
    names[names.index(heading.partition(" [")[0])] = heading
    rows = np.column_stack([np.arange(10.0), ROWS])
    with pytest.raises(GaitError, match=words):
        load_recorded_motion(written(tmp_path, ",".join(names), rows), walking.bravo7())


@pytest.mark.parametrize("suffix", ["csv", "json"])
def test_a_joint_that_is_missing_in_a_row_is_told_with_the_row(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"motion.{suffix}"
    if suffix == "csv":
        lines = [",".join(repr(float(x)) for x in row) + ",1" for row in ROWS]
        lines[6] = ",".join(["0.1", "", *lines[6].split(",")[2:]])
        path.write_text("\n".join([",".join([*NAMES, "battery"]), *lines]) + "\n")
        place = "line 8"
    else:
        columns = dict(zip(NAMES, ROWS.T.tolist(), strict=True))
        columns[NAMES[1]][6] = None
        path.write_text(json.dumps(columns))
        place = "row 7"
    table = read_table(path, gaps=True)
    with pytest.raises(GaitError, match=f"{place}: column '{NAMES[1]}' has no number"):
        motion_of(table, walking.bravo7(), rate=50.0)


def test_a_gap_in_a_column_that_is_no_joint_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "motion.csv"
    lines = [",".join(repr(float(x)) for x in row) + "," for row in ROWS]
    path.write_text("\n".join([",".join([*NAMES, "battery"]), *lines]) + "\n")
    motion = motion_of(read_table(path, gaps=True), walking.bravo7(), rate=50.0)
    np.testing.assert_array_equal(motion.position, ROWS)


def test_a_unit_that_is_said_holds_for_coordinates_of_opensim(tmp_path: Path) -> None:
    rows = 40.0 * ROWS
    path = written(tmp_path, "pelvis_tilt,hip_flexion_r,knee_angle_r [rad],a,b,c", rows)
    table = joints_of_opensim(read_table(path), "deg")
    np.testing.assert_allclose(table.whole(["right_hip"])[:, 0], -np.deg2rad(rows[:, 1]))
    np.testing.assert_allclose(table.whole(["root_pitch"])[:, 0], -np.deg2rad(rows[:, 0]))
    np.testing.assert_array_equal(np.abs(table.whole(["right_knee"])[:, 0]), np.abs(rows[:, 2]))
