"""One switch for code without instructions that only some processors have.

Compilers and libraries use what the processor at hand offers, and sums then round differently from
one machine to the next. ``HEELSTRIKE_PLAIN_CODE=1`` in the environment makes them use what every
processor of the kind has: Numba and the straight-line code compile for the generic one, NumPy and
OpenBLAS take their basic loops. It is slower, and shows that an answer does not depend on rounding.

It holds for what this package and NumPy compute. MuJoCo, CasADi's solvers and the C library's
functions (sines, exponentials) look at the processor themselves.
"""

from __future__ import annotations

import os
import platform
import sys
import warnings

SWITCH = "HEELSTRIKE_PLAIN_CODE"

# OpenBLAS has no name for a generic processor; these are the oldest of theirs.
_OLDEST = {"x86_64": "Prescott", "amd64": "Prescott", "aarch64": "ARMV8", "arm64": "ARMV8"}


def is_asked_for() -> bool:
    """Whether the environment asks for plain code."""
    return os.environ.get(SWITCH, "") not in ("", "0")


def select() -> None:
    """Ask all who choose instructions for plain ones, in this process and those it starts.

    They look at the environment when they are imported. So this package does this first of all, and
    warns if NumPy or Numba was there before it.
    """
    os.environ["NUMBA_CPU_NAME"] = "generic"
    os.environ["NUMBA_CPU_FEATURES"] = ""
    # NumPy enables what is listed, so nothing; it refuses two lists.
    asked_before = os.environ.get("NPY_ENABLE_CPU_FEATURES") == " "
    os.environ.pop("NPY_DISABLE_CPU_FEATURES", None)
    os.environ["NPY_ENABLE_CPU_FEATURES"] = " "
    oldest = _OLDEST.get(platform.machine().lower())
    if oldest:
        os.environ["OPENBLAS_CORETYPE"] = oldest
    early = [name for name in ("numpy", "numba") if name in sys.modules]
    if early and not asked_before:
        warnings.warn(
            f"{SWITCH} is set, but {' and '.join(early)} had been imported before heelstrike and "
            f"will use all that this processor has. Import heelstrike first.",
            RuntimeWarning,
            stacklevel=3,
        )
