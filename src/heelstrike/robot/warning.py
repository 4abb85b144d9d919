"""The warning a robot file earns when it says more than we simulate."""

from __future__ import annotations

import inspect
import warnings


class RobotWarning(UserWarning):
    """A robot was loaded, but not everything its file says is simulated, or it looks wrong."""


def warn(message: str, category: type[Warning] = RobotWarning) -> None:
    """Issue a warning that points at the caller's line, outside this package."""
    level = 2
    frame = inspect.currentframe()
    frame = frame.f_back if frame else None
    while frame and str(frame.f_globals.get("__name__", "")).startswith("heelstrike."):
        frame = frame.f_back
        level += 1
    warnings.warn(message, category, stacklevel=level)
