"""The arrays and attributes of an HDF5 file, read with suspicion.

Nothing is read before its kind and size are known, and only numbers and texts are. A damaged file
can still send the HDF5 library astray, into loops without end or worse: so this module is read by
another process, which hands over what it found (:mod:`heelstrike.reader_process`). It imports
nothing of heelstrike, so that this starts quickly.
"""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Contents = dict[str, NDArray[Any]]
"""Arrays by their path, such as ``/robot/mass``, and attributes, without dimensions, by
theirs, ``/robot/@name``. Numbers are float64 or int64, texts str."""

# zlib shrinks a thousandfold at best.
LARGEST_RATIO = 1100
SLACK = 2**20
"""Bytes that the arrays of the smallest file may take."""
_ZLIB, _SHUFFLE, _CHECKSUM = 1, 2, 3


class HostileFileError(Exception):
    """A file claims what cannot be, or asks for what no record needs."""


def contents(path: Path, groups: tuple[str, ...]) -> Contents:
    """Read the arrays and attributes of the root of an HDF5 file and of groups in it.

    Raises
    ------
    HostileFileError
        If what the file claims to hold is more than a file of its size can, or lies elsewhere.
    OSError, ValueError, KeyError, RuntimeError, TypeError, MemoryError
        Whatever the HDF5 library says about a file that is none or damaged.
    """
    import h5py  # type: ignore[import-untyped]

    found: Contents = {}
    with h5py.File(path, "r") as file:
        size = path.stat().st_size
        places = [("/", file), *((f"/{name}/", _member(file, name)) for name in groups)]
        arrays = {}
        for prefix, group in places:
            if not isinstance(group, h5py.Group):
                continue
            for name in group:
                member = _member(group, name)
                if isinstance(member, h5py.Dataset) and member.shape is not None:
                    arrays[prefix + name] = member
            for name in group.attrs:
                value = _attribute(group.attrs, name)
                if value is not None:
                    found[f"{prefix}@{name}"] = value
        _refuse_floods(arrays, size)
        for name, array in arrays.items():
            value = _values(name, array, size)
            if value is not None:
                found[name] = value
    return found


def _member(group: Any, name: str) -> Any:
    """Return what lies in a group itself, and not behind a link to another file."""
    import h5py

    link = group.get(name, getlink=True)
    if isinstance(link, h5py.ExternalLink):
        raise HostileFileError(f"{name!r} lies in another file")
    return group.get(name) if isinstance(link, h5py.HardLink) else None


def _refuse_floods(arrays: dict[str, Any], size: int) -> None:
    """Refuse a small file that claims to hold a lot, before any of it is read."""
    declared = stored = 0
    for name, array in arrays.items():
        if array.is_virtual or array.external:
            raise HostileFileError(f"{name!r} lies in another file")
        filters = array.id.get_create_plist()
        kinds = {filters.get_filter(i)[0] for i in range(filters.get_nfilters())}
        if not kinds <= {_ZLIB, _SHUFFLE, _CHECKSUM}:
            raise HostileFileError(f"{name!r} is packed in a way that no run is")
        chunk = math.prod(array.chunks or (0,))
        declared += max(math.prod(array.shape), chunk) * array.dtype.itemsize
        stored += array.id.get_storage_size()  # nothing for what was never written
    if declared > LARGEST_RATIO * min(size, stored) + SLACK:
        raise HostileFileError(
            f"it claims to hold {declared / 2**20:.0f} MiB, more than a file of its size can"
        )


def _attribute(attributes: Any, name: str) -> NDArray[Any] | None:
    """Return a number or text, None for anything else."""
    import h5py

    kept = attributes.get_id(name)
    if kept.shape is None or math.prod(kept.shape) != 1:  # nothing at all, or a list
        return None
    if h5py.check_string_dtype(kept.dtype) is None and kept.dtype.kind not in "fiu":
        return None
    value = attributes[name]
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8")
    return _plain(np.asarray(value))


def _values(name: str, array: Any, size: int) -> NDArray[Any] | None:
    import h5py

    if array.dtype.kind in "fiu":
        return _plain(np.asarray(array[()]))
    if h5py.check_string_dtype(array.dtype) is None or array.ndim != 1:
        return None
    texts: list[str] = []
    length = 0
    for i in range(array.shape[0]):  # many may be one and the same: there need be no end to them
        texts.append(array.asstr()[i])
        length += len(texts[-1]) + 1
        if length > size:
            raise HostileFileError(f"{name!r} claims to hold more text than there is")
    return np.array(texts, dtype=str)


def _plain(value: NDArray[Any]) -> NDArray[Any] | None:
    if value.dtype.kind in "fiu":
        kind = np.float64 if value.dtype.kind == "f" else np.int64
        return np.ascontiguousarray(value, dtype=kind).reshape(value.shape)
    return value if value.dtype.kind == "U" else None


def answer(order: bytes) -> bytes:
    """Hand over the contents of the file and groups that an order names."""
    path, *groups = json.loads(order)
    handed = io.BytesIO()
    np.savez(handed, **contents(Path(path), tuple(groups)))  # type: ignore[arg-type]
    return handed.getvalue()
