"""A gait that joints follow by time, on either foot, and when its steps may end."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, number
from heelstrike.control.followed_motion import EARLIEST, LATEST
from heelstrike.gait.gait import Gait
from heelstrike.robot.model import Floats


class FollowedGait(Bundle):
    """Numbers of a law that follows a gait."""

    breakpoints: Floats = array("pieces + 1")
    """Times in a step between which one polynomial holds (s)."""
    coefficients: Floats = array(2, "pieces", "terms", "nu")
    """For either stance foot the joints' polynomials, lowest power first."""
    earliest: float = number(float)
    """A touchdown counts only after this time in a step (s)."""
    latest: float = number(float)
    """The reference goes on along its polynomials until this time in a step (s)."""
    landing: float = number(float)
    """A foot that touches without coming flat counts as landed after this time (s)."""


def followed(gait: Gait) -> dict[str, Any]:
    """Numbers of `FollowedGait`: touchdowns count in the second half of a step."""
    sides = [gait.pieces, gait.mirrored_pieces()]
    if gait.stance_foot:
        sides.reverse()
    duration = gait.step_duration
    return {
        "breakpoints": gait.breakpoints,
        "coefficients": np.array(sides),
        "earliest": EARLIEST * duration,
        "latest": LATEST * duration,
        "landing": 0.02 * duration,
    }
