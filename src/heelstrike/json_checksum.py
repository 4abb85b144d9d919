"""JSON files read strictly, with a checksum among the entries by which a flipped bit is seen."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from enum import Enum
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import HeelstrikeError
from heelstrike.field_texts import dataclass

KEY = "sha256"
LARGEST_FILE = 2**20
"""Files larger than this (in bytes) are refused: those of ours have some kB."""

Member = TypeVar("Member", bound=Enum)
Some = TypeVar("Some")


@dataclass(frozen=True)
class Entries:
    """Entries of a file, or of an object in it, each checked for its kind before use."""

    data: Any
    """What stands there."""
    kind: str
    """What the file holds."""
    largest: float
    """Size that no number of it exceeds."""
    error: type[HeelstrikeError]
    """What is raised, in words, if an entry is missing or of another kind."""

    def entry(self, key: str) -> Any:
        """Return anything."""
        if not isinstance(self.data, dict):
            raise self.error(f'an object with "{key}" must stand where {shown(self.data)} does')
        if key not in self.data:
            raise self.error(f'"{key}" is missing')
        return self.data[key]

    def of_kind(self, key: str, kind: type[Some], words: str) -> Some:
        """Return what is of a kind, in words."""
        value = self.entry(key)
        if not isinstance(value, kind):
            raise self.error(f'"{key}" must be {words}, got {shown(value)}')
        return value

    def objects(self, key: str) -> list[Entries]:
        """Return a list, each of which is taken for an object."""
        return [replace(self, data=value) for value in self.of_kind(key, list, "a list")]

    def object(self, key: str) -> Entries:
        """Return an object."""
        return replace(self, data=self.of_kind(key, dict, "an object"))

    def text(self, key: str) -> str:
        """Return a text."""
        return self.of_kind(key, str, "a text")

    def member(self, key: str, kind: type[Member]) -> Member:
        """Return one of a closed set, named by its value."""
        try:
            return kind(self.text(key))
        except ValueError:
            names = ", ".join(f'"{known.value}"' for known in kind)
            raise self.error(f'"{key}" must be one of {names}') from None

    def names(self, key: str) -> tuple[str, ...]:
        """Return different texts, at least one."""
        value = self.of_kind(key, list, "a list of different names")
        texts = {name for name in value if isinstance(name, str)}
        if len(texts) < max(1, len(value)):
            raise self.error(f'"{key}" must be a list of different names, got {shown(value)}')
        return tuple(value)

    def number(self, key: str) -> float:
        """Return a number."""
        return float(self.numbers(key))

    def numbers(self, key: str, *shape: int | None) -> NDArray[np.float64]:
        """Return numbers in lists of lists of a shape, in which None is any length but zero."""

        def checked(value: Any, lengths: tuple[int | None, ...]) -> Any:
            if lengths:
                length = lengths[0]
                if not isinstance(value, list) or len(value) != (length or len(value) or 1):
                    many = "numbers" if length is None else f"{length} numbers"
                    what = f"be a list of {many}" if lengths == shape else f"hold lists of {many}"
                    raise self.error(f'"{key}" must {what}, got {shown(value)}')
                return [checked(each, lengths[1:]) for each in value]
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise self.error(f'"{key}" must be a number, got {shown(value)}')
            if not abs(value) <= self.largest:
                raise self.error(f'"{key}" holds {shown(value)}, which no {self.kind} has')
            return float(value)

        numbers = checked(self.entry(key), shape)
        try:
            return np.array(numbers, dtype=np.float64)
        except ValueError:
            raise self.error(f'"{key}" must hold lists of one length') from None


@contextmanager
def reading_json(
    path: str | PathLike[str],
    kind: str,
    versions: tuple[int, ...],
    largest: float,
    error: type[HeelstrikeError],
    largest_file: int = LARGEST_FILE,
) -> Iterator[Entries]:
    """Read a file; errors raised while its entries are looked at are told with its path.

    Parameters
    ----------
    path : path
        The file.
    kind : str
        What it holds: its format is ``heelstrike kind``.
    versions : tuple of int
        Versions of the format that are known.
    largest : float
        Size that no number of it exceeds.
    error : type
        What to raise if it is another file, or its entries are not those that were saved.
    largest_file : int
        Bytes from which on a file is refused.
    """
    try:
        data = _entries(path, kind, error, largest_file)
        version = data.get("version")
        if version not in versions or isinstance(version, bool):
            raise error(
                f"version {shown(version)} of the format is not known here, only "
                f"{' and '.join(map(str, versions))}; was it written by a newer heelstrike?"
            )
        yield Entries(data, kind, largest, error)
        if is_changed(data):
            raise error(
                "damaged: its numbers are not those that were saved. If you changed them, remove "
                f'the entry "{KEY}".'
            )
    except error as cause:
        raise error(f"{path}: {cause}") from cause.__cause__


def _entries(
    path: str | PathLike[str], kind: str, error: type[HeelstrikeError], largest_file: int
) -> dict[str, Any]:
    def refuse(constant: str) -> NoReturn:
        raise error(f"contains {constant}; every number of a {kind} is finite.")

    try:
        file = Path(path)
        if file.is_dir():
            raise error(f"is a directory; name the {kind} file in it.")
        if not file.is_file():
            there = "is not a regular file" if file.exists() else "there is no such file"
            raise error(f"{there}.")
        if file.stat().st_size > largest_file:
            raise error(f"larger than {largest_file // 2**20} MB; is it a {kind}?")
        data = json.loads(file.read_text(encoding="utf-8-sig"), parse_constant=refuse)
    except error:  # which may be a ValueError, too
        raise
    except OSError as cause:
        raise error(f"cannot be read: {cause.strerror or cause}.") from cause
    except UnicodeDecodeError as cause:
        raise error(f"cannot be read: not a text file; a {kind} is JSON text.") from cause
    except json.JSONDecodeError as cause:
        raise error(
            f"not valid JSON: {cause.msg} in line {cause.lineno}, column {cause.colno}."
        ) from cause
    # Nested without end; a number of 5000 digits; a path with a null character.
    except (RecursionError, ValueError) as cause:
        raise error(f"cannot be read: not a {kind} file ({cause}).") from cause
    if not isinstance(data, dict) or data.get("format") != f"heelstrike {kind}":
        raise error(
            f'not a {kind} file: it must be a JSON object with "format": "heelstrike {kind}".'
        )
    return data


def json_text(kind: str, version: int, entries: Mapping[str, Any]) -> str:
    """Return the text of a file that :func:`reading_json` reads, a line an entry."""
    data = with_checksum({"format": f"heelstrike {kind}", "version": version, **entries})
    lines = (f'  "{key}": {json.dumps(value, ensure_ascii=False)}' for key, value in data.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


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
