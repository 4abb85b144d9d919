"""Files that appear whole or not at all.

What is written goes into a file of its own beside the target, onto the disk, and then takes the
target's name in one move. A full disk, a quota or a crash leave an older file as it was. What a
killed writer left behind is removed when its target is written the next time.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from heelstrike.errors import HeelstrikeError, WriteError

LONGEST_AGE = 86400.0
"""Seconds after which a file beside its target is abandoned, where one cannot ask its writer."""

_LONGEST_NAME = 40  # characters of the target's name, so that a long one does not get too long
_in_progress: set[str] = set()
"""Names of the files that this process is writing."""


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Name a file to write, which becomes `path` when the block ends without an exception.

    Parameters
    ----------
    path : str or path
        The target. An existing file is replaced and hands on its permissions; a link stays, and
        what it points to is replaced.

    Yields
    ------
    Path
        File to write, with the same ending as the target.

    Raises
    ------
    WriteError
        If there is no such folder, the target is no regular file, or anything in the block or
        afterwards raises an OSError.
    """
    with _told(path):
        target = check_target(path)
        _remove_abandoned(target)
        beside = target.with_name(_name_beside(target))
    _in_progress.add(beside.name)
    try:
        with _told(path):
            yield beside
            with beside.open("rb+") as file:
                os.fsync(file.fileno())
            if target.exists():
                shutil.copymode(target, beside)
            beside.replace(target)
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        _in_progress.discard(beside.name)


def write_whole(
    path: str | os.PathLike[str], content: str | bytes | memoryview,
    error: type[HeelstrikeError] = WriteError,
) -> Path:  # fmt: skip
    """Write a file at once; see :func:`whole_file`.

    Parameters
    ----------
    path : str or path
        File to write.
    content : str or bytes
        What is to be in it; text as UTF-8.
    error : type
        What is raised if it cannot be written.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    HeelstrikeError
        Of the type `error`, if it cannot be written; an older file is as it was.
    """
    try:
        data = content.encode("utf-8") if isinstance(content, str) else content
    except UnicodeEncodeError as cause:
        raise error(f"cannot write {path}: its content is no text ({cause})") from cause
    try:
        with whole_file(path) as beside:
            beside.write_bytes(data)
    except WriteError as cause:
        raise error(str(cause)) from cause
    return Path(path)


def check_target(path: str | os.PathLike[str]) -> Path:
    """Refuse what can be seen at once to be no place for a file, before anything takes long.

    Returns
    -------
    Path
        The file that would be written: links are followed.

    Raises
    ------
    WriteError
        If there is no such folder, or the target is a folder, a device or write-protected.
    """
    with _told(path):
        return _checked(path)


def _checked(path: str | os.PathLike[str]) -> Path:
    try:
        target = Path(os.path.realpath(path))
    except ValueError as error:  # a name with a null character
        raise WriteError(f"cannot write {path!r}: {error}") from error
    if not target.parent.is_dir():
        raise WriteError(f"cannot write {path}: there is no folder {target.parent}")
    if target.is_dir():
        raise WriteError(f"cannot write {path}: it is a folder; give the name of a file")
    if target.exists() and not target.is_file():
        raise WriteError(f"cannot write {path}: it is not a regular file")
    if target.exists() and not os.access(target, os.W_OK):
        raise WriteError(f"cannot write {path}: it is write-protected")
    return target


@contextmanager
def _told(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what the system says into words."""
    try:
        yield
    except WriteError:
        raise
    except OSError as error:
        raise WriteError(f"cannot write {path}: {error.strerror or error}") from error


def _name_beside(target: Path) -> str:
    writer = f"{_machine()}-{os.getpid()}-{secrets.token_hex(4)}"
    return f".{target.name[:_LONGEST_NAME]}.part-{writer}{target.suffix[:_LONGEST_NAME]}"


def _remove_abandoned(target: Path) -> None:
    """Remove what killed writers of this target left behind."""
    name = re.compile(
        rf"\.{re.escape(target.name[:_LONGEST_NAME])}\.part-([0-9a-f]+)-([0-9]+)-[0-9a-f]+"
        rf"{re.escape(target.suffix[:_LONGEST_NAME])}"
    )
    with os.scandir(target.parent) as entries:
        found = [(entry, match) for entry in entries if (match := name.fullmatch(entry.name))]
    for entry, match in found:
        with suppress(OSError):  # somebody else was faster, or it is not ours to remove
            if _is_abandoned(entry, match[1], int(match[2])):
                Path(entry).unlink()


def _is_abandoned(entry: os.DirEntry[str], machine: str, process: int) -> bool:
    if machine == _machine():
        if process == os.getpid():
            return entry.name not in _in_progress  # of a process that once had our number
        if os.name == "posix":
            return not _is_alive(process)
    return time.time() - entry.stat().st_mtime > LONGEST_AGE


def _is_alive(process: int) -> bool:
    """Whether there is a process of this number (POSIX; asking on Windows would end it)."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it is somebody else's
        return True
    return True


def _machine() -> str:
    """Short name of what numbers processes: the machine, or a container on it."""
    numbering = ""
    with suppress(OSError):
        numbering = str(Path("/proc/self/ns/pid").readlink())
    return hashlib.sha256(f"{platform.node()} {numbering}".encode()).hexdigest()[:8]
