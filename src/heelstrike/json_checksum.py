"""JSON files read strictly, with a checksum among the entries by which a flipped bit is seen."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

from heelstrike.errors import HeelstrikeError

KEY = "sha256"
LARGEST_FILE = 2**20
"""Files larger than this (in bytes) are refused: those of ours have some kB."""


def read_json(
    path: str | PathLike[str], kind: str, versions: tuple[int, ...], error: type[HeelstrikeError]
) -> dict[str, Any]:
    """Read the entries of a file; what they say is still to be checked, and `require_unchanged`.

    Parameters
    ----------
    path : path
        The file.
    kind : str
        What it holds: its format is ``heelstrike kind``.
    versions : tuple of int
        Versions of the format that are known.
    error : type
        What to raise if it is another file, in words.
    """

    def refuse(constant: str) -> NoReturn:
        raise error(f"{path}: contains {constant}; every number of a {kind} is finite.")

    try:
        file = Path(path)
        if file.is_dir():
            raise error(f"{path}: is a directory; name the {kind} file in it.")
        if not file.is_file():
            there = "is not a regular file" if file.exists() else "there is no such file"
            raise error(f"{path}: {there}.")
        if file.stat().st_size > LARGEST_FILE:
            raise error(f"{path}: larger than {LARGEST_FILE // 2**20} MB; is it a {kind}?")
        data = json.loads(file.read_text(encoding="utf-8-sig"), parse_constant=refuse)
    except error:
        raise
    except OSError as cause:
        raise error(f"{path}: cannot be read: {cause.strerror or cause}.") from cause
    except UnicodeDecodeError as cause:
        raise error(f"{path}: cannot be read: not a text file; a {kind} is JSON text.") from cause
    except json.JSONDecodeError as cause:
        raise error(
            f"{path}: not valid JSON: {cause.msg} in line {cause.lineno}, column {cause.colno}."
        ) from cause
    # Nested without end; a number of 5000 digits; a path with a null character.
    except (RecursionError, ValueError) as cause:
        raise error(f"{path!r}: cannot be read: not a {kind} file ({cause}).") from cause
    if not isinstance(data, dict) or data.get("format") != f"heelstrike {kind}":
        raise error(
            f"{path}: not a {kind} file: it must be a JSON object with "
            f'"format": "heelstrike {kind}".'
        )
    version = data.get("version")
    if version not in versions or isinstance(version, bool):
        raise error(
            f"{path}: version {shown(version)} of the format is not known here, only "
            f"{' and '.join(map(str, versions))}; was it written by a newer heelstrike?"
        )
    return data


def require_unchanged(
    path: str | PathLike[str], data: Mapping[str, Any], error: type[HeelstrikeError]
) -> None:
    """Raise an error if the entries of a file are not those that were saved."""
    if is_changed(data):
        raise error(
            f"{path}: damaged: its numbers are not those that were saved. If you changed them, "
            f'remove the entry "{KEY}".'
        )


def shown(value: Any) -> str:
    """Say in a few words what stands in a file."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "…"


def with_checksum(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a file, and that of their checksum.

    It is one of what they say, not of how they are written: indents and order are free.
    """
    return {**data, KEY: _checksum(data)}


def is_changed(data: Mapping[str, Any]) -> bool:
    """Tell whether entries are not those that their checksum, if they have one, was made of."""
    try:
        return KEY in data and data[KEY] != _checksum(data)
    except RecursionError:  # lists in lists in lists, which nobody saved
        return True


def _checksum(data: Mapping[str, Any]) -> str:
    entries = {key: value for key, value in data.items() if key != KEY}
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode("ascii")).hexdigest()
