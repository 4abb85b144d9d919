"""Forces of the ground: units of their columns, and axes of any sense."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from heelstrike.errors import GaitError
from heelstrike.gait.recordings.forces import load_forces

ROWS = np.random.default_rng(3).normal(size=(12, 6))


def written(folder: Path, *, force: str = "", length: str = "") -> Path:
    path = folder / "forces.csv"
    names = [f"ground_force_{kind}{axis}" for kind in "vp" for axis in "xyz"]
    units = [force] * 3 + [length] * 3
    lines = [",".join(["time", *(f"{n}{u}" for n, u in zip(names, units, strict=True))])]
    lines += [",".join(map(repr, [0.01 * k, *row.tolist()])) for k, row in enumerate(ROWS)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(("length", "meters"), [("", 1.0), (" [m]", 1.0), (" [mm]", 1e-3)])
def test_places_are_in_the_unit_of_their_columns(
    length: str, meters: float, tmp_path: Path
) -> None:
    forces = load_forces(written(tmp_path, force=" [N]", length=length))
    np.testing.assert_array_equal(forces.force[:, 0], ROWS[:, :2])
    np.testing.assert_allclose(forces.point[:, 0], meters * ROWS[:, 3:5])


def test_an_axis_against_the_walk_changes_signs(tmp_path: Path) -> None:
    forces = load_forces(written(tmp_path), forward="-y", up="z")
    np.testing.assert_array_equal(forces.force[:, 0], ROWS[:, [1, 2]] * [-1.0, 1.0])
    np.testing.assert_array_equal(forces.point[:, 0], ROWS[:, [4, 5]] * [-1.0, 1.0])


def test_opensim_s_header_of_degrees_leaves_units_of_forces(tmp_path: Path) -> None:
    """inDegrees is of angles: it neither takes a unit away nor gives forces one."""
    names = ["time", "plate_vx", "plate_vy", "plate_px [mm]", "plate_py [mm]"]
    rows = ["\t".join(map(repr, [0.01 * k, *row[:4].tolist()])) for k, row in enumerate(ROWS)]
    path = tmp_path / "forces.mot"
    path.write_text("\n".join(["inDegrees=yes", "endheader", "\t".join(names), *rows]) + "\n")
    forces = load_forces(path)
    np.testing.assert_array_equal(forces.force[:, 0], ROWS[:, :2])
    np.testing.assert_allclose(forces.point[:, 0], 1e-3 * ROWS[:, 2:4])


def test_units_and_axes_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(GaitError, match=r"ground_force_vx \[mm\]' is in mm; n is wanted"):
        load_forces(written(tmp_path, force=" [mm]"))
    with pytest.raises(GaitError, match="both up and forward"):
        load_forces(written(tmp_path), forward="-y", up="y")
    with pytest.raises(GaitError, match="forward must be x, y or z"):
        load_forces(written(tmp_path), forward="w")
