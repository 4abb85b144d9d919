"""Measured tosses of a cube, read from files of PyTorch without PyTorch and without running them.

A file of PyTorch before 1.6 is a row of pickles (a magic number, a version, the machine, one
object, the names of its storages) and then the bytes of each storage. A pickle may call anything;
this reader knows the four names that a tensor of real numbers is made of and refuses every other.
"""

from __future__ import annotations

import pickle
import struct
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MAGIC = 0x1950A86A20F9469CFC6C
HALF_WIDTH = 0.0524
"""Of the cube (m), the unit of length of the files."""

MASS = 0.37
"""Of the cube (kg)."""

INERTIA = 0.00081
"""Of the cube about any axis through its centre (kg m²)."""

RATE = 148.0
"""Samples a second."""

COLUMNS = 19
MOST = 10_000_000
"""Numbers in a file above which it is none of a toss."""


class RefusedError(Exception):
    """A file that holds something else than one matrix of real numbers."""


@dataclass(frozen=True)
class Storage:
    """Where the numbers of a tensor are, before they are read."""

    name: str
    numbers: int


def _tensor(storage: Any, offset: int, shape: Any, strides: Any, *_: Any) -> tuple[Storage, Any]:
    """What PyTorch calls `_rebuild_tensor_v2`: only a whole matrix, row by row."""
    one, rows, columns = shape
    if one != 1 or offset != 0 or tuple(strides)[1:] != (columns, 1):
        raise RefusedError("it holds no matrix, row by row")
    if not isinstance(storage, Storage) or storage.numbers != rows * columns:
        raise RefusedError("its matrix and its numbers do not fit")
    return storage, (rows, columns)


class _Unpickler(pickle.Unpickler):
    """Knows what a tensor of real numbers is made of, and nothing else."""

    known = {  # noqa: RUF012 - read by this class alone
        ("torch._utils", "_rebuild_tensor_v2"): _tensor,
        ("torch", "DoubleStorage"): "DoubleStorage",
        ("collections", "OrderedDict"): OrderedDict,
    }

    def find_class(self, module: str, name: str) -> Any:
        """Return one of the known names."""
        if (module, name) not in self.known:
            raise RefusedError(f"it names {module}.{name}, which no tensor needs")
        return self.known[module, name]

    def persistent_load(self, pid: Any) -> Storage:
        """Return the storage of that description."""
        kind, storage, name, _, numbers, *_ = pid
        if kind != "storage" or storage != "DoubleStorage" or not 0 < numbers <= MOST:
            raise RefusedError(f"it holds {pid!r}, not real numbers in double precision")
        return Storage(str(name), int(numbers))


def _matrix(file: BinaryIO) -> Floats:
    if _Unpickler(file).load() != MAGIC:
        raise RefusedError("it is no file of PyTorch before 1.6")
    _Unpickler(file).load()  # the version
    if not _Unpickler(file).load().get("little_endian", False):
        raise RefusedError("its numbers are of another order of bytes")
    storage, shape = _Unpickler(file).load()
    if _Unpickler(file).load() != [storage.name]:
        raise RefusedError("it holds several tensors")
    (numbers,) = struct.unpack("<q", file.read(8))
    if numbers != storage.numbers:
        raise RefusedError("its numbers are not as many as it says")
    values = np.frombuffer(file.read(8 * numbers), dtype="<f8")
    if len(values) != numbers:
        raise RefusedError("it is cut off")
    return values.reshape(shape).astype(np.float64)


def read_matrix(path: Path) -> Floats:
    """Read a matrix of double precision from a file of PyTorch before 1.6.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    (rows, columns) float
        The matrix.

    Raises
    ------
    RefusedError
        If the file is damaged or names anything that a tensor does not need.
    """
    with path.open("rb") as file:
        try:
            return _matrix(file)
        except RefusedError as error:
            raise RefusedError(f"{path}: {error}") from None
        except (pickle.UnpicklingError, EOFError, ValueError, TypeError, struct.error,
                AttributeError, IndexError, KeyError, OverflowError) as error:  # fmt: skip
            raise RefusedError(f"{path} is no file of a tensor, or damaged: {error}") from error


@dataclass(frozen=True)
class Toss:
    """A cube that was thrown, as it was measured: SI units, world axes, the floor at z = 0."""

    number: int
    position: Floats
    """(n, 3) Of its centre (m)."""
    quaternion: Floats
    """(n, 4) Real part first."""
    velocity: Floats
    """(n, 3) Of its centre (m/s)."""
    spin: Floats
    """(n, 3) Angular velocity in axes of the cube (rad/s)."""


def read_tosses(folder: Path) -> list[Toss]:
    """Read the tosses of a folder, files ``NUMBER.pt``, by their numbers.

    Parameters
    ----------
    folder : Path
        ``data/tosses_processed`` of a clone of DAIRLab/contact-nets.

    Returns
    -------
    list of Toss
        All of them.

    Raises
    ------
    RefusedError
        If there is none, or one is no toss.
    """
    found = []
    files = list(folder.glob("*.pt"))
    for path in files:
        if not (path.stem.isascii() and path.stem.isdecimal()):
            raise RefusedError(f"{path} is no NUMBER.pt")
    for path in sorted(files, key=lambda each: int(each.stem)):
        rows = read_matrix(path)
        if rows.shape[1] != COLUMNS:
            raise RefusedError(f"{path} has rows of {rows.shape[1]} numbers, not of {COLUMNS}")
        if len(rows) < 2:
            raise RefusedError(f"{path} has fewer than two samples")
        if not np.all(np.isfinite(rows)):
            row = int(np.argmin(np.isfinite(rows).all(axis=1)))
            raise RefusedError(f"{path}: a number of sample {row + 1} is not finite")
        found.append(
            Toss(int(path.stem), HALF_WIDTH * rows[:, :3], rows[:, 3:7], HALF_WIDTH * rows[:, 7:10],
                 rows[:, 10:13])
        )  # fmt: skip
    if not found:
        raise RefusedError(f"{folder} has no files NUMBER.pt")
    return found
