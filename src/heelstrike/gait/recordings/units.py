"""Names of columns and the units that they tell: ``left_hip [deg]``, ``left_hip_deg``."""

from __future__ import annotations

import re

import numpy as np

from heelstrike.errors import GaitError

UNITS = {
    "rad": 1.0, "deg": np.pi / 180.0, "degrees": np.pi / 180.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3,
    "s": 1.0, "ms": 1e-3, "n": 1.0, "n m": 1.0,
}  # fmt: skip
"""Units, in those of ours."""


ANGLES = ("rad", "deg", "degrees")
LENGTHS = ("m", "cm", "mm")
FORCES = ("n",)
TORQUES = ("n m",)
TIMES = ("s", "ms")
"""ANGLES, LENGTHS, FORCES, TORQUES, TIMES: Units of each kind, ours first."""


def check_unit(unit: str) -> None:
    """Refuse a unit for joints whose columns name none, unless it is empty, rad or deg.

    Raises
    ------
    GaitError
        If it is another one.
    """
    if unit not in ("", "rad", "deg"):
        raise GaitError(f"unit must be rad or deg, got {unit!r}")


def plain(name: str) -> str:
    """Return a name in small letters, with underscores between its words."""
    return re.sub(r"[\s.\-/]+", "_", name.strip().lower())


def told(name: str) -> tuple[str, str]:
    """Return the plain name of a column and its unit, if it names one."""
    bracket = re.fullmatch(r"(.*?)\s*[\[(]\s*(\w+(?: \w+)?)\s*[\])]", name)
    if bracket and bracket[2].lower() in UNITS:
        return plain(bracket[1]), bracket[2].lower()
    whole = plain(name)
    before, _, last = whole.rpartition("_")
    return (before, last) if before and last in UNITS and len(last) > 1 else (whole, "")
