"""Machine code kept on disk: whole and of the right key, or not there at all.

What is in a file is believed only if its digest is right, before anything is made of it: unpickling
or running damaged bytes would take the process along. Files are written beside their place and
renamed, so that processes which write the same one, or are killed at it, leave a whole one or none.
A disk that is full or cannot be written costs time only.
"""

from __future__ import annotations

import hashlib
import importlib
import time
import uuid
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numba import config

from heelstrike.cache_folder import cache_folder

KEY = DIGEST = hashlib.sha256().digest_size
"""Bytes of a key, and of the digest of what is in a file."""

FORGOTTEN = 3600.0
"""Age from which a half-written file is one of a killed process, in s."""

LONGEST_WAIT = 300.0
"""How long to wait for another process that compiles the same, in s."""

_UNFINISHED = ".unfinished"

_said: set[str] = set()


class CacheWarning(UserWarning):
    """Machine code could not be read from disk, or not be kept there; nothing else changes."""


def directories(source: Path | None) -> list[Path]:
    """Return where machine code made from a source file is kept, the best place first.

    This is the directory that ``NUMBA_CACHE_DIR`` names. Else it is beside the source, or in the
    user's directory for such files if that cannot be written or there is no file.

    Parameters
    ----------
    source : Path or None
        The file; None for what was typed at a prompt.
    """
    home = str(source.resolve().parent) if source else "typed"
    own = f"{Path(home).name}_{hashlib.sha256(home.encode()).hexdigest()[:16]}"
    settings: Any = config
    if settings.CACHE_DIR:
        return [Path(settings.CACHE_DIR) / own]
    beside = [source.resolve().parent / "__pycache__"] if source else []
    return [*beside, cache_folder() / own]


def read(places: Sequence[Path], name: str, key: bytes) -> bytes | None:
    """Return what was kept under a name, or None if that is missing, damaged or of another key."""
    for place in places:
        file = place / name
        try:
            found = file.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            _say_damaged(file, error.strerror or str(error))
            continue
        if found[:DIGEST] != hashlib.sha256(found[DIGEST:]).digest():
            _say_damaged(file, "its digest is wrong")
        elif found[DIGEST : DIGEST + KEY] == key:
            return found[DIGEST + KEY :]
    return None


def write(places: Sequence[Path], name: str, key: bytes, code: bytes) -> None:
    """Keep code under a name, in the first place that takes it; nowhere if none is given."""
    content = key + code
    content = hashlib.sha256(content).digest() + content

    def keep(unfinished: Path) -> None:
        unfinished.write_bytes(content)
        unfinished.replace(unfinished.parent / name)

    _anywhere(places, keep)


@contextmanager
def alone(places: Sequence[Path], name: str) -> Iterator[None]:
    """Make what is kept under a name while no other process does: others wait, and find it kept.

    After ``LONGEST_WAIT``, and where no file can be locked, both make it.
    """
    place = first_writable(places)
    held = place and _locked(place / f"{name}.lock")
    try:
        yield
    finally:
        if place and held:
            held.close()
            with suppress(OSError):  # somebody waits for it
                (place / f"{name}.lock").unlink()


def _locked(file: Path) -> Any:
    """Lock a file as databases do: everywhere alike, and only as long as this process lives."""
    try:
        sqlite = importlib.import_module("sqlite3")
    except ImportError:  # a Python that was built without it
        return None
    with suppress(sqlite.Error):
        held = sqlite.connect(file, timeout=LONGEST_WAIT, isolation_level=None)
        try:
            held.execute("BEGIN EXCLUSIVE")
        except sqlite.Error as error:
            held.close()
            if getattr(error, "sqlite_errorname", "") != "SQLITE_BUSY":
                with suppress(OSError):  # nobody else has it: it cannot be locked, or written
                    file.unlink()
            return None
        return held
    return None


def first_writable(places: Sequence[Path]) -> Path | None:
    """Return the first place that files can be written to; say so if there is none."""
    return _anywhere(places, lambda unfinished: unfinished.write_bytes(b"?"))


def _anywhere(places: Sequence[Path], use: Callable[[Path], Any]) -> Path | None:
    """Use a new file in the first place where that goes, and clear up; where it went."""
    failures = []
    for place in places:
        unfinished = place / f"{uuid.uuid4().hex}{_UNFINISHED}"
        try:
            place.mkdir(parents=True, exist_ok=True)
            try:
                use(unfinished)
            finally:
                unfinished.unlink(missing_ok=True)
            _clear(place)
        except OSError as error:
            failures.append(f"{place}: {error.strerror or error}")
        else:
            return place
    if failures:
        say_nowhere(failures)
    return None


def _clear(place: Path) -> None:
    """Remove what killed processes left."""
    for file in place.glob(f"*{_UNFINISHED}"):
        try:
            if time.time() - file.stat().st_mtime > FORGOTTEN:
                file.unlink()
        except OSError:  # somebody else was quicker
            continue


def _say_damaged(file: Path, reason: str) -> None:
    _say(
        "damaged",
        f"Compiled code kept in {file} cannot be used: {reason}. It is compiled again and written "
        "again. Should this come back, look after the disk.",
    )


def say_nowhere(failures: Sequence[str]) -> None:
    """Warn that machine code was kept nowhere, and why."""
    _say(
        "nowhere",
        f"Compiled code cannot be kept ({'; '.join(failures)}), so it will be compiled again "
        "at the next start. Set NUMBA_CACHE_DIR to a directory with space that you can write to.",
    )


def _say(what: str, message: str) -> None:
    """Warn, once in a process: what has befallen one file may have befallen them all."""
    if what not in _said:
        _said.add(what)
        warnings.warn(message, CacheWarning, stacklevel=2)
