"""What workers of a campaign do in tests, in the place of scenes."""

from __future__ import annotations

import os
import time
from typing import Any

ENDLESS, ASLEEP, GONE = 1, 2, 3
"""Seeds that work forever, wait forever, and end their process."""


def nothing(method: str) -> None:
    """Prepare nothing."""


def pretend(method: str, seed: int, *, twins: bool = True) -> dict[str, Any]:
    """Return a result at once, but for the seeds above."""
    if seed == ENDLESS:
        while True:
            pass
    if seed == ASLEEP:
        time.sleep(1e6)
    if seed == GONE:
        os._exit(7)
    return {"method": method, "seed": seed, "kind": "ordinary", "status": "completed"}
