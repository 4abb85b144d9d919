"""Numbers of a page: columns of whole steps of their range, in as few bytes as they change by."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np

from heelstrike.robot.model import Floats

STEPS = 2**20
"""Steps into which the range of a column is divided."""
TOLERANCE = 0.5 / STEPS
"""Error of a number in a page, in the range of its column."""
WIDEST = 1e4
"""Largest number of a column in its usual ones: in a wider one, as of a run that diverged, steps
would swallow these, and each number is a float32."""
ORDER = 3
"""How often numbers are taken from those before: a motion that is smooth hardly changes so."""


def packed(time: Floats, columns: Mapping[str, Floats]) -> dict[str, Any]:
    """Pack columns (n, ...) over time (n,) for a page.

    A column that is the same in all rows is kept once.

    Returns
    -------
    dict
        ``rows``; ``time`` in base64 of little-endian float64; ``columns``, name and numbers a row
        and rows of each, 1 or n, with the least value and the step of each number a row;
        ``numbers`` in base64, one after the other, and each row by row. Of a number with a step,
        rows are the third differences of whole steps from the least value, with the sign as last
        bit, plus one; 0 of what is not known; in bytes of seven bits, the lowest first, of which
        all but the last have the eighth bit. Without a step, rows are little-endian float32.
    """
    layout, parts = [], []
    for name, values in columns.items():
        table = values.reshape(len(time), -1)
        if len(table) > 1 and np.array_equal(
            table, table[:1].repeat(len(table), 0), equal_nan=True
        ):
            table = table[:1]
        least, step = [], []
        for column in table.T:
            low, by = _divided(column)
            least.append(low)
            step.append(by)
            parts.append(_coded(column, low, by))
        layout.append(
            {
                "name": name,
                "width": table.shape[1],
                "rows": len(table),
                "least": least,
                "step": step,
            }
        )
    return {
        "rows": len(time),
        "time": _text(time.astype("<f8").tobytes()),
        "columns": layout,
        "numbers": _text(b"".join(parts)),
    }


def _divided(column: Floats) -> tuple[float, float]:
    """Least value of a column (n,) and its step; no step if it is too wide, or all the same."""
    known = column[np.isfinite(column)]
    low, high = float(known.min(initial=np.inf)), float(known.max(initial=-np.inf))
    size = np.abs(known[known != 0.0])
    if not high > low or size.max() > WIDEST * np.median(size):
        return 0.0, 0.0
    return low, (high - low) / STEPS


def _coded(column: Floats, low: float, step: float) -> bytes:
    if not step > 0.0:
        with np.errstate(over="ignore"):
            return column.astype("<f4").tobytes()
    known = np.isfinite(column)
    change = np.rint((column[known] - low) / step).astype(np.int64)
    for _ in range(ORDER):
        change = np.diff(change, prepend=0)
    code = np.zeros(len(column), dtype=np.int64)
    code[known] = 1 + np.where(change < 0, -2 * change - 1, 2 * change)
    length = 1 + (code[:, None] >> np.arange(7, 35, 7) > 0).sum(axis=1)
    coded = np.zeros(int(length.sum()), dtype=np.uint8)
    begin = np.cumsum(length) - length
    for k in range(int(length.max(initial=0))):
        there = length > k
        more = np.where(length > k + 1, 128, 0)
        coded[(begin + k)[there]] = ((code >> 7 * k & 127) | more)[there]
    return coded.tobytes()


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
