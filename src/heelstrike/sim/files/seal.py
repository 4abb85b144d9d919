"""The end of a file that tells whether all before it is as it was written."""

from __future__ import annotations

import hashlib
from pathlib import Path

_MARK = b"\nheelstrike run, sha256 of all before this line: "
_BEGINNING = _MARK[:12]
_DIGITS = 64
LENGTH = len(_MARK) + _DIGITS + 1
"""Bytes that a seal takes."""

_BLOCK = 2**20


def seal(content: bytes | memoryview) -> bytes:
    """Return what to append to a file. HDF5 does not look at it, and drops it when it writes."""
    return _MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"


def seal_holds(path: Path) -> bool | None:
    """Tell whether a file is as it was sealed; None if it has no seal, not even a piece of one.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    rest = path.stat().st_size - LENGTH
    if rest < 0:
        return None
    digest = hashlib.sha256()
    with path.open("rb") as file:
        file.seek(rest)
        found = file.read()
        if not found.startswith(_MARK):
            return False if _BEGINNING in found else None
        file.seek(0)
        while rest > 0 and (block := file.read(min(rest, _BLOCK))):
            digest.update(block)
            rest -= len(block)
    return found == _MARK + digest.hexdigest().encode() + b"\n"
