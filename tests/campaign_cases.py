"""Trials that cost next to nothing, one that walks, and a controller that cannot be sent."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import walking

import heelstrike as hs


@cache
def limp(settling: float = 0.03) -> hs.Trial:
    """Return bravo7 without torques, for some milliseconds."""
    robot = walking.bravo7()
    return hs.Trial(
        robot=robot, controller=None, state=robot.standing(hs.Ground()), step_length=0.0,
        step_duration=0.01, settling=settling,
    )  # fmt: skip


@cache
def walks() -> hs.Trial:
    """Return bravo7 on its gait, by computed torque."""
    gait = walking.gait()
    return hs.Trial(
        robot=walking.bravo7(), controller=hs.ComputedTorque(walking.bravo7(), gait),
        state=gait.initial_state, step_length=gait.step_length, step_duration=gait.step_duration,
    )  # fmt: skip


class Reads:
    """A controller that reads a file where it is unpickled, which only this machine has."""

    def __init__(self) -> None:
        self.file = "policy.npz"

    def torque(self, t: float, state: hs.State, contacts: object) -> np.ndarray:
        return np.zeros(6)

    def __setstate__(self, state: dict[str, Any]) -> None:
        raise FileNotFoundError(2, "No such file or directory", state["file"])

    def __deepcopy__(self, _: object) -> Reads:
        return Reads()
