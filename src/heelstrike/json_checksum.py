"""A checksum among the entries of a JSON file, by which a flipped bit is seen."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

KEY = "sha256"


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
