"""The warning a robot file earns when it says more than we simulate, and where warnings point."""

from __future__ import annotations

import inspect
import warnings
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]


class RobotWarning(UserWarning):
    """A robot was loaded, but not everything its file says is simulated, or it looks wrong."""


def warn(message: str, category: type[Warning] = RobotWarning, *, again: bool = False) -> None:
    """Issue a warning that points at the caller's line, outside this package.

    Parameters
    ----------
    message : str
        What it says.
    category : type
        Its kind.
    again : bool
        Whether it comes each time, and not once for each line of a caller.
    """
    level, frame = 1, inspect.currentframe()
    while frame and frame.f_back and is_of_package(frame.f_code.co_filename):
        frame = frame.f_back
        level += 1
    if again and frame:
        warnings.warn_explicit(message, category, frame.f_code.co_filename, frame.f_lineno)
    else:
        warnings.warn(message, category, stacklevel=level)


def is_of_package(filename: str) -> bool:
    """Whether a file is one of heelstrike's own."""
    return _PACKAGE in Path(filename).parents
