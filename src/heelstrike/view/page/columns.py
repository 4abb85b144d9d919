"""Numbers of a page: columns of float32 in one text, time in float64."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TOLERANCE = 2.0**-24
"""Relative error of a number in a page: a float32's rounding."""


def packed(time: Floats, columns: Mapping[str, Floats]) -> dict[str, Any]:
    """Pack columns (n, ...) over time (n,) for a page.

    A column that is the same in all rows is kept once.

    Returns
    -------
    dict
        ``rows``; ``time`` in base64 of little-endian float64; ``columns``, name and numbers a row
        and rows of each, 1 or n; ``numbers`` in base64 of little-endian float32, one column after
        the other, row by row.
    """
    layout, parts = [], []
    for name, values in columns.items():
        with np.errstate(over="ignore"):
            flat = values.reshape(len(time), -1).astype("<f4")
        if len(flat) > 1 and np.array_equal(flat, flat[:1].repeat(len(flat), 0), equal_nan=True):
            flat = flat[:1]
        layout.append({"name": name, "width": flat.shape[1], "rows": len(flat)})
        parts.append(flat.tobytes())
    return {
        "rows": len(time),
        "time": _text(time.astype("<f8").tobytes()),
        "columns": layout,
        "numbers": _text(b"".join(parts)),
    }


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
