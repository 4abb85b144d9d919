"""Lines of text files from anywhere, and the numbers in them, with the line of what is wrong."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.robot.model import Floats

LARGEST_FILE = 2**26
"""Bytes from which on a file is refused."""
FEWEST = 8
"""Rows of the shortest recording."""
MOST_COLUMNS = 2000
"""Columns from which on a table is refused."""
SHOWN = 60
"""Letters of a line that a message shows."""

Line = tuple[int, str]
"""Number of a line in its file, and its text."""
Name = str | os.PathLike[str]
"""A file."""


def text_of(path: Name) -> str:
    """Return the text of a file.

    Raises
    ------
    GaitError
        If it cannot be read, is too large or no text.
    """
    try:
        file = Path(path)
        if file.stat().st_size > LARGEST_FILE:
            raise GaitError(f"{path}: larger than {LARGEST_FILE // 2**20} MB; is it a recording?")
        if not file.is_file():
            raise GaitError(f"{path}: not a file; a recording is a table of text")
        return file.read_text(encoding="utf-8-sig")
    except GaitError:
        raise
    except (OSError, ValueError) as error:
        if isinstance(error, UnicodeDecodeError):
            raise GaitError(f"{path}: not a text file; a recording is a table of text") from error
        reason = getattr(error, "strerror", None) or error
        raise GaitError(f"{path} cannot be read: {reason}") from error


def lines_of(path: Name) -> list[Line]:
    """Return the lines of a file that say something, remarks (#) left out.

    Raises
    ------
    GaitError
        If there are none.
    """
    numbered = enumerate(text_of(path).splitlines(), start=1)
    found = [(i, line) for i, line in numbered if line.strip() and not line.startswith("#")]
    if not found:
        raise GaitError(f"{path}: there is nothing in it")
    return found


def numbers_in(
    path: Name, lines: Sequence[Line], separator: str | None, columns: int, *, gaps: bool = False
) -> Floats:
    """Return the numbers of lines, (rows, columns).

    Parameters
    ----------
    path : path
        The file, for messages.
    lines : sequence of (int, str)
        Its lines.
    separator : str or None
        What stands between two numbers; None for blanks.
    columns : int
        How many numbers a line has.
    gaps : bool
        Whether numbers may be missing, which become NaN.

    Raises
    ------
    GaitError
        That names the line.
    """
    if columns > MOST_COLUMNS:
        raise GaitError(f"{path}: {columns} columns; a recording has at most {MOST_COLUMNS}")
    rows = []
    for place, line in lines:
        words = line.split(separator)
        if gaps:  # nothing stands after the last marker that is missing, or one tab too many
            words = [*words, *[""] * (columns - len(words))]
            while len(words) > columns and not words[-1].strip():
                words.pop()
        try:
            row = [_number(word, gaps) for word in words]
        except ValueError:
            row = []
        finite = np.isfinite(row) | (np.isnan(row) if gaps else False)
        if len(row) != columns or not np.all(finite):
            raise GaitError(
                f"{path}, line {place}: {columns} finite numbers are wanted, got {line[:SHOWN]!r}"
            )
        rows.append(row)
    if len(rows) < FEWEST:
        raise GaitError(f"{path}: a recording has at least {FEWEST} rows, got {len(rows)}")
    return np.array(rows, dtype=np.float64)


def _number(word: str, gaps: bool) -> float:
    return np.nan if gaps and not word.strip() else float(word)
