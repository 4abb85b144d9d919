"""Markers from TRC files, tables and C3D files; axes and names of laboratories."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heelstrike.errors import GaitError
from heelstrike.gait.recordings.landmarks import landmark_of
from heelstrike.gait.recordings.markers import load_markers

ROWS = 12
NAMES = ("R.Heel", "R.Toe", "RKNE", "Spare")


def places() -> np.ndarray:
    """(rows, markers, 3) in m: forward, up, to the right."""
    random = np.random.default_rng(5)
    found = random.normal(scale=0.01, size=(ROWS, len(NAMES), 3))
    found[:, :, 0] += np.linspace(0.0, 1.0, ROWS)[:, None]
    found[:, 1, 0] += 0.2
    found[:, 2, 1] += 0.5
    return found


def trc(folder: Path, position: np.ndarray, *, unit: str = "mm", scale: float = 1e3) -> Path:
    path = folder / "walk.trc"
    axes = "\t".join(f"{a}{k + 1}" for k in range(len(NAMES)) for a in "XYZ")
    head = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"100.0\t100.0\t{ROWS}\t{len(NAMES)}\t{unit}",
        "Frame#\tTime\t" + "\t\t\t".join(NAMES) + "\t\t",
        "\t\t" + axes,
        "",
    ]
    body = []
    for k, row in enumerate(scale * position.reshape(ROWS, -1)):
        words = ["" if np.isnan(x) else f"{x:.9f}" for x in row]
        body.append("\t".join([str(k + 1), f"{2.0 + 0.01 * k:.3f}", *words]))
    path.write_text("\n".join([*head, *body]) + "\n", encoding="utf-8")
    return path


def test_trc_with_a_marker_that_was_not_always_seen(tmp_path: Path) -> None:
    position = places()
    position[4, 0] = np.nan
    seen = load_markers(trc(tmp_path, position))
    assert seen.names == ("right_heel", "right_toe", "right_knee")
    assert seen.ignored == ("Spare",)
    np.testing.assert_allclose(seen.time, 0.01 * np.arange(ROWS), atol=1e-12)
    assert seen.begin == pytest.approx(2.0)
    np.testing.assert_allclose(seen.position, position[:, :3, :2], atol=1e-11)
    assert np.isnan(seen.of("right_heel")[4]).all()


def test_times_of_trc_that_are_rounded_are_even(tmp_path: Path) -> None:
    """At 60 Hz to the millisecond; where a row is late by more than that, they stay as they are."""
    path = trc(tmp_path, places())
    lines = path.read_text(encoding="utf-8").replace("100.0\t100.0", "60.00\t60.00").split("\n")
    for late, expected in ((0.0, 1.0 / 60.0), (0.004, 0.017)):
        for k in range(ROWS):
            words = lines[6 + k].split("\t")
            words[1] = f"{2.0 + k / 60.0 + late * (k == 9):.3f}"
            lines[6 + k] = "\t".join(words)
        path.write_text("\n".join(lines), encoding="utf-8")
        assert load_markers(path).time[1] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("rate", ["²", "1.²", "-", "nan"])
def test_a_rate_that_is_no_number_is_not_used(tmp_path: Path, rate: str) -> None:
    path = trc(tmp_path, places())
    path.write_text(path.read_text(encoding="utf-8").replace("100.0", rate, 1), encoding="utf-8")
    np.testing.assert_allclose(load_markers(path).time, 0.01 * np.arange(ROWS), atol=1e-12)


def test_who_walks_another_way_is_turned_round(tmp_path: Path) -> None:
    """Along -z of the file, in cm."""
    position = places()
    turned = np.stack([position[..., 2], position[..., 1], -position[..., 0]], axis=-1)
    seen = load_markers(trc(tmp_path, turned, unit="cm", scale=1e2))
    np.testing.assert_allclose(seen.position, position[:, :3, :2], atol=1e-10)
    assert (seen.forward, seen.up) == ("-z", "y")
    back = load_markers(trc(tmp_path, turned, unit="cm", scale=1e2), forward="z")
    assert (back.forward, back.up) == ("z", "y")
    np.testing.assert_allclose(back.position[..., 0], -seen.position[..., 0])
    with pytest.raises(GaitError, match="both up and forward"):
        load_markers(trc(tmp_path, turned), forward="y")


def test_tables_of_markers(tmp_path: Path) -> None:
    position = places()[:, :2, :2]
    names = [f"{name}_{axis} [cm]" for name in ("right_heel", "toe_r") for axis in "xy"]
    path = tmp_path / "markers.csv"
    lines = [",".join(names), *(",".join(map(repr, r)) for r in 1e2 * position.reshape(ROWS, -1))]
    path.write_text("\n".join(lines).replace("np.float64(", "").replace(")", ""))
    seen = load_markers(path, rate=50.0)
    assert seen.names == ("right_heel", "right_toe")
    np.testing.assert_allclose(seen.position, position, atol=1e-12)
    assert seen.rate == pytest.approx(50.0)
    with pytest.raises(GaitError, match="say the rate"):
        load_markers(path)


def test_c3d_is_read_by_ezc3d(tmp_path: Path) -> None:
    """z is up there; a marker of zeros was not seen."""
    ezc3d = pytest.importorskip("ezc3d")
    position = places()
    upright = np.stack([position[..., 0], -position[..., 2], position[..., 1]], axis=-1)
    upright[6, 2] = 0.0
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [200.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(NAMES)
    points = np.ones((4, len(NAMES), ROWS))
    points[:3] = 1e3 * upright.transpose(2, 1, 0)
    file["data"]["points"] = points
    file.write(str(tmp_path / "walk.c3d"))
    seen = load_markers(tmp_path / "walk.c3d")
    expected = position[:, :3, :2].copy()
    expected[6, 2] = np.nan
    np.testing.assert_allclose(seen.position, expected, atol=1e-6)
    assert seen.rate == pytest.approx(200.0)
    (tmp_path / "broken.c3d").write_bytes(b"\x02\x50" + bytes(600))
    with pytest.raises(GaitError, match="no C3D file"):
        load_markers(tmp_path / "broken.c3d")


@pytest.mark.parametrize(
    ("line", "text", "words"),
    [
        (0, "Hello", "five lines of header"),
        (2, "100.0\t100.0\t12\t4\tinch", "line 3: Units must be"),
        (3, "Frame#\tTime\t\t\t", "line 4: no names"),
        (3, "Frame#\tTime\tA\t\t\tA\t\t\tB\t\t\tC", "two markers are called 'A'"),
        (4, "\t\tX1\tY1\tZ1", "line 5: 4 markers have 12 axes"),
        (8, "3\tsoon\t1", "line 9: 14 finite numbers"),
        (8, "3\t2.0\t1", "line 9: the time does not go on"),
        (8, "3\t\t1", "line 9: the time does not go on"),
        (8, "3\t2.02" + "\t1" * 13, "line 9: 14 finite numbers"),
    ],
)
def test_what_is_no_trc(line: int, text: str, words: str, tmp_path: Path) -> None:
    path = trc(tmp_path, places())
    lines = path.read_text().splitlines()
    lines[line] = text
    path.write_text("\n".join(lines))
    with pytest.raises(GaitError, match=words):
        load_markers(path)


def test_names_that_are_not_known(tmp_path: Path) -> None:
    path = trc(tmp_path, places())
    seen = load_markers(path, names={"right_hip": "Spare"})
    assert "right_hip" in seen.names
    with pytest.raises(GaitError, match="no marker 'spar'"):
        load_markers(path, names={"right_hip": "spar"})
    with pytest.raises(GaitError, match="no landmark 'hipp'"):
        load_markers(path, names={"hipp": "Spare"})
    with pytest.raises(GaitError, match="must be x, y or z"):
        load_markers(path, up="w")
    path.write_text(path.read_text().replace("R.", "Q").replace("RKNE", "Q"))
    with pytest.raises(GaitError, match="known landmark"):
        load_markers(path)


@pytest.mark.parametrize(
    ("name", "landmark"),
    [
        ("right_hip", "right_hip"), ("r_gtro", "right_hip"), ("lkne", "left_knee"),
        ("lank", "left_ankle"), ("heel_l", "left_heel"), ("right_mt5", "right_toe"),
        ("r_acromium", "right_shoulder"), ("rib_cage", "trunk"), ("rasi", None), ("hip", None),
    ],
)  # fmt: skip
def test_names_of_laboratories(name: str, landmark: str | None) -> None:
    assert landmark_of(name) == landmark
