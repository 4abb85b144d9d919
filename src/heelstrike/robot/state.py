"""Where a robot is and how fast it moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heelstrike.arguments import are_numbers, refusal
from heelstrike.errors import RobotError


@dataclass(frozen=True)
class State:
    """Position and velocity of a robot at one instant.

    Attributes
    ----------
    q : (nq,) float
        Generalised positions (m, rad).
    v : (nv,) float
        Generalised velocities (m/s, rad/s).
    """

    q: NDArray[np.float64]
    v: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("q", "v"):
            if not are_numbers(value := getattr(self, name)):
                raise RobotError(refusal(name, value, ["ArrayLike"]))
        object.__setattr__(self, "q", np.array(self.q, dtype=np.float64))
        object.__setattr__(self, "v", np.array(self.v, dtype=np.float64))

    @property
    def vector(self) -> NDArray[np.float64]:
        """Positions, then velocities, (nq + nv,)."""
        return np.concatenate((self.q, self.v))
