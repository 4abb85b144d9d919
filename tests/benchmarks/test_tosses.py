"""Measured tosses: files are read without running anything in them; what is fitted and told."""

from __future__ import annotations

import pickle
import struct
from pathlib import Path

import numpy as np
import pytest
from tosses.engines import GRAVITY, Heelstrike, matrix_of
from tosses.fitting import WIDTH, drawn, errors, fitted
from tosses.reading import HALF_WIDTH, MAGIC, RATE, RefusedError, Toss, read_matrix, read_tosses


def tensor_file(
    rows: np.ndarray, *, names: bytes = b"ctorch._utils\n_rebuild_tensor_v2\n",
    storage: bytes = b"ctorch\nDoubleStorage\n", offset: int = 0,
) -> bytes:  # fmt: skip
    """A file of one matrix as PyTorch before 1.6 wrote it, in the text of pickles."""
    count, (height, width) = rows.size, rows.shape
    pid = b"(S'storage'\n" + storage + b"S'7'\nS'cpu'\nI%d\nNtQ" % count
    shape = b"(I1\nI%d\nI%d\nt" % (height, width)
    strides = b"(I%d\nI%d\nI1\nt" % (count, width)
    hooks = b"ccollections\nOrderedDict\n)R"
    tensor = names + b"(" + pid + b"I%d\n" % offset + shape + strides + b"I00\n" + hooks + b"tR."
    head = [pickle.dumps(each, 2) for each in (MAGIC, 1001, {"little_endian": True})]
    tail = pickle.dumps(["7"], 2) + struct.pack("<q", count) + rows.astype("<f8").tobytes()
    return b"".join((*head, tensor, tail))


def rows_of(samples: int = 4) -> np.ndarray:
    """Samples of a cube that hovers, in the units of the files."""
    rows = np.zeros((samples, 19))
    rows[:, :3] = 1.0, 2.0, 30.0
    rows[:, 3] = 1.0
    rows[:, 7:10] = 5.0, -4.0, 3.0
    return rows


def test_a_toss_is_read_in_si_units(tmp_path: Path) -> None:
    for number in (10, 9):
        (tmp_path / f"{number}.pt").write_bytes(tensor_file(rows_of()))
    tosses = read_tosses(tmp_path)
    assert [toss.number for toss in tosses] == [9, 10]
    np.testing.assert_allclose(tosses[0].position[2], HALF_WIDTH * np.array([1.0, 2.0, 30.0]))
    np.testing.assert_allclose(tosses[0].velocity[2], HALF_WIDTH * np.array([5.0, -4.0, 3.0]))


@pytest.mark.parametrize(
    ("spoilt", "told"),
    [
        (tensor_file(rows_of(), names=b"cos\nsystem\n"), "os.system"),
        (tensor_file(rows_of(), names=b"cbuiltins\neval\n"), "builtins.eval"),
        (tensor_file(rows_of(), storage=b"ctorch\nLongStorage\n"), "LongStorage"),
        (tensor_file(rows_of(), offset=1), "no matrix"),
        (tensor_file(rows_of())[:-8], "cut off"),
        (tensor_file(rows_of())[:60], "damaged"),
        (b"PK\x03\x04 a newer file", "damaged"),
        (pickle.dumps(3, 2), "before 1.6"),
    ],
)
def test_what_is_no_tensor_is_refused_and_not_run(spoilt: bytes, told: str, tmp_path: Path) -> None:
    path = tmp_path / "0.pt"
    path.write_bytes(spoilt)
    with pytest.raises(RefusedError, match=told):
        read_matrix(path)


def test_each_reason_to_refuse_a_toss_is_told(tmp_path: Path) -> None:
    path = tmp_path / "0.pt"
    missing = rows_of()
    missing[2, 5] = np.nan
    for rows, told in (
        (rows_of()[:, :18], "has rows of 18 numbers, not of 19"),
        (rows_of(1), "has fewer than two samples"),
        (missing, "a number of sample 3 is not finite"),
    ):
        path.write_bytes(tensor_file(rows))
        with pytest.raises(RefusedError, match=told):
            read_tosses(tmp_path)
    path.rename(tmp_path / "first.pt")
    with pytest.raises(RefusedError, match=r"first\.pt is no NUMBER\.pt"):
        read_tosses(tmp_path)


def toss_of(position: np.ndarray) -> Toss:
    still = np.zeros_like(position)
    return Toss(0, position, np.tile([1.0, 0.0, 0.0, 0.0], (len(position), 1)), still, still)


def test_errors_are_means_of_samples_after_the_first_in_widths() -> None:
    toss = toss_of(np.zeros((3, 3)))
    path = np.array([[9.0, 0.0, 0.0], [0.0, WIDTH, 0.0], [0.0, 0.0, 3.0 * WIDTH]])
    assert errors([toss], [path]) == pytest.approx([2.0])


def test_what_is_fitted_is_not_judged() -> None:
    chosen, rest = drawn(570, 48, 0)
    assert (len(chosen), len(rest)) == (48, 522)
    assert sorted(chosen + rest) == list(range(570))
    assert drawn(570, 48, 1) != (chosen, rest)


def test_a_cube_in_the_air_falls_and_turns_as_it_must() -> None:
    rows = rows_of(8)
    rows[:, 10:13] = 0.0, 0.0, 6.0
    toss = Toss(
        0, HALF_WIDTH * rows[:, :3], rows[:, 3:7], HALF_WIDTH * rows[:, 7:10], rows[:, 10:13]
    )
    (path,) = Heelstrike().thrown([toss], (0.2, 0.1))
    time = np.arange(8)[:, None] / RATE
    exact = toss.position[0] + time * toss.velocity[0] - 0.5 * time**2 * [0.0, 0.0, GRAVITY]
    np.testing.assert_allclose(path, exact, atol=5e-4)  # half a step times g times t
    assert np.ptp((path - exact)[:, :2]) < 1e-12


def test_friction_that_made_the_tosses_is_found_again() -> None:
    """Flat cubes that slide to rest: how far they go is v² / (2 μ g)."""
    friction, engine = 0.23, Heelstrike()
    begin = np.tile([0.0, 0.0, HALF_WIDTH], (30, 1))
    tosses = []
    for speed in (0.3, 0.5):
        lying = toss_of(begin)
        lying.velocity[:, 0] = speed
        tosses.append(lying)
    for toss, path in zip(tosses, engine.thrown(tosses, (friction, 0.0)), strict=True):
        toss.position[:] = path
    found = fitted(engine, tosses, 40)
    assert found[0] == pytest.approx(friction, abs=2e-3)


def test_a_quarter_turn_about_x_takes_y_to_z() -> None:
    turned = matrix_of(np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]))
    np.testing.assert_allclose(turned @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-15)
