"""Where a robot is and how fast it moves."""

from __future__ import annotations

import numpy as np

from heelstrike.arguments import are_numbers, refusal
from heelstrike.errors import RobotError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats


@dataclass(frozen=True)
class State:
    """Position and velocity of a robot at one instant."""

    q: Floats
    """(nq,) Generalised positions (m, rad)."""
    v: Floats
    """(nv,) Generalised velocities (m/s, rad/s)."""

    def __post_init__(self) -> None:
        for name in ("q", "v"):
            if not are_numbers(value := getattr(self, name)):
                raise RobotError(refusal(name, value, ["ArrayLike"]))
        object.__setattr__(self, "q", np.array(self.q, dtype=np.float64))
        object.__setattr__(self, "v", np.array(self.v, dtype=np.float64))

    @property
    def vector(self) -> Floats:
        """Positions, then velocities, (nq + nv,)."""
        return np.concatenate((self.q, self.v))
