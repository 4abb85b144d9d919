"""What else the machine does while something is measured."""

from __future__ import annotations

import math
import os


def load() -> float:
    """Return how many processes ran or waited over the last minute; not a number if nobody knows.

    Windows does not count them.
    """
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan
