"""The whole comparison: which walks belong to it, and how long it took.

Every part has a file of its own, and every row of it is kept as it comes. A comparison that was
interrupted goes on where it was, and its time is the sum of its sittings.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from time import perf_counter
from typing import Any

from heelstrike.experiments.engine_comparison.comparison import CONTROL_PERIOD, STEP_SIZES
from heelstrike.experiments.engine_comparison.settings import BEST, DEFAULTS
from heelstrike.field_texts import dataclass
from heelstrike.whole_file import write_whole

FINER = (1e-4, 5e-5)
"""Finer steps of the engines in s, which are walked only where that is asked for."""

LONGEST = 120.0
"""Seconds that a walk at any of these may take."""

PATIENCE = 30.0
"""Seconds that an engine may take for a scene."""

STEPS = 20
"""Steps to walk."""


@dataclass(frozen=True)
class Part:
    """Walks under a law."""

    law: str
    """Its name."""
    steps: int = STEPS
    """Steps to walk."""
    control_period: float = CONTROL_PERIOD
    """Seconds between two calls of the law."""
    step_sizes: tuple[float, ...] = STEP_SIZES
    """Steps of the engines in s."""
    settings: tuple[str, ...] = (DEFAULTS, BEST)
    """Of the engines."""
    finer: tuple[float, ...] = ()
    """Steps in s that are walked only where finer ones are asked for."""
    pushes: bool = False
    """Whether the largest push is searched for, at defaults."""


PARTS = (
    Part("FootstepFeedback", finer=FINER, pushes=True),
    Part("ComputedTorque"),
    Part("ComputedTorque", 4, 2e-4, (2e-4,), (DEFAULTS,)),
)
"""The parts of a whole comparison, beside scenes, compass gait and guards."""

QUICK = tuple(Part(law, 4, step_sizes=(1e-3,), settings=(DEFAULTS,)) for law in (
    "FootstepFeedback", "ComputedTorque"
))  # fmt: skip
"""Those of a quick one, which has scenes and guards, but neither pushes nor the compass gait."""


@contextmanager
def sitting(file: Path, command: str) -> Iterator[None]:
    """Add to a file how long what is done takes, whether it ends well or is interrupted.

    Parameters
    ----------
    file : Path
        JSON, as :func:`taken` reads it.
    command : str
        What is done.
    """
    begin, before = perf_counter(), os.times()
    try:
        yield
    finally:
        after = os.times()
        spent = sum(after[:4]) - sum(before[:4])  # own and of processes that have ended
        this = {"date": date.today().isoformat(), "wall_s": perf_counter() - begin}
        sittings = [*taken(file).get("sittings", []), {**this, "processor_s": spent}]
        told = {"command": command, "processors": os.cpu_count(), "sittings": sittings}
        write_whole(file, json.dumps(told, indent=1) + "\n")


def taken(file: Path) -> Mapping[str, Any]:
    """Return the command of a comparison, and wall and processor time of its sittings.

    Parameters
    ----------
    file : Path
        Written by :func:`sitting`; if it is missing, nothing is known.
    """
    if not file.exists():
        return {}
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found
