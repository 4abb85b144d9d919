"""What a reader looks at on the disk, noted, so that it is known when it would find the same again.

Not only what is read counts: a mesh that is not there yet, and a package found behind another
folder, are looks too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

Looks = dict[tuple[str, str], str]
"""What was found, by kind of look and whole path."""

LARGEST = 2**30
"""Bytes of a file that no reader reads."""

_noted: ContextVar[Looks | None] = ContextVar("looks", default=None)


@contextmanager
def noting() -> Iterator[Looks]:
    """Note all looks until the end."""
    looks: Looks = {}
    token = _noted.set(looks)
    try:
        yield looks
    finally:
        _noted.reset(token)


def is_there(path: Path) -> bool:
    """Whether there is something; an impossible name (too long, null character) is nothing."""
    return _look("kind", path) != ""


def is_file(path: Path) -> bool:
    """Whether there is a regular file."""
    return _look("kind", path) == "file"


def is_folder(path: Path) -> bool:
    """Whether there is a folder."""
    return _look("kind", path) == "folder"


def will_read(path: Path) -> Path:
    """Note what is in a file; return its path."""
    if _noted.get() is not None:
        _look("content", path)
    return path


def folders_in(path: Path) -> list[Path]:
    """Folders in a folder, in order.

    Raises
    ------
    OSError
        If it cannot be listed.
    """
    _look("folders", path)
    return sorted(each for each in path.iterdir() if each.is_dir())


def same(looks: Looks) -> bool:
    """Whether all looks would find the same again."""
    return all(_found(kind, Path(path)) == found for (kind, path), found in looks.items())


def _look(kind: str, path: Path) -> str:
    found = _found(kind, path)
    looks = _noted.get()
    if looks is not None:
        looks[kind, str(path.absolute())] = found
    return found


def _found(kind: str, path: Path) -> str:
    try:
        if kind == "content":
            size = path.stat().st_size
            if not path.is_file() or size > LARGEST:
                return str(size)
            with path.open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        if kind == "folders":
            names = sorted(each.name for each in path.iterdir() if each.is_dir())
            return hashlib.sha256("\0".join(names).encode()).hexdigest()
        if path.is_file():
            return "file"
        if path.is_dir():
            return "folder"
        return "other" if path.exists() else ""
    except (OSError, ValueError):  # ValueError: no possible name of a file
        return ""
