"""Whether a controller kept to what it may do: it owns its torques and its memory, no more."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numba import types

from heelstrike.compiler.bundle import address_of_array
from heelstrike.compiler.bundle_type import WORD_BYTES
from heelstrike.compiler.compilation import loop_for
from heelstrike.compiler.words import word_from
from heelstrike.robot.model import Integers
from heelstrike.sim.controller.control import OVERRAN, TRUSTED, ReadyLaw
from heelstrike.sim.controller.guard import GUARD, ZONE, trespasses
from heelstrike.sim.dimension import AnyRobot

BYTES = ZONE * WORD_BYTES
"""Of the guard words on either side of an array."""


class Watch:
    """What a controller was handed, to be looked at while it runs.

    Parameters
    ----------
    robots : tuple of Robot or SpatialRobot
        Those that it could change, whose numbers are copied.
    law : ReadyLaw
        The controller.
    memory : Memory or SpatialMemory
        Memory of the simulation.
    """

    def __init__(self, robots: tuple[AnyRobot, ...], law: ReadyLaw, memory: Any) -> None:
        self._control = law.control
        watched = law.control.conduct != TRUSTED or law.control.in_python
        self._numbers = [(each, numbers_of(each)) for each in robots] if watched else []
        self._arrays = [("torque", memory.command), *law.arrays()] if watched else []
        guarded = [values for _, values in self._arrays]
        self._zones = np.array(
            [address_of_array(each) + place for each in guarded for place in (-BYTES, each.nbytes)],
            dtype=np.int64,
        )
        self._pairs = np.array(
            [
                (address_of_array(getattr(robot.model, name)), address_of_array(kept), kept.size)
                for robot, numbers in self._numbers
                for name, kept in numbers.items()
            ],
            dtype=np.int64,
        ).reshape(-1, 3)

    def misdeed(self) -> str | None:
        """Say what the controller did that it may not, and undo what can be undone."""
        control = self._control
        if control.conduct == TRUSTED and not control.in_python:
            return None
        if control.conduct != OVERRAN and _untouched()(self._zones, self._pairs) == 1:
            return None
        changed = [restored(robot, numbers) for robot, numbers in self._numbers]
        if any(changed):
            return f"changed the robot: {max(changed)}"
        places = [place for name, values in self._arrays for place in trespasses(name, values)]
        if places:
            more = f" (and {len(places) - 1} more)" if len(places) > 1 else ""
            return f"wrote beyond its arrays, to {places[0]}{more}"
        return "wrote beyond its arrays" if control.conduct == OVERRAN else None


@cache
def _untouched() -> Any:
    def is_untouched(zones: Integers, pairs: Integers) -> int:
        """Whether all guard words are what they were, and all numbers those that were copied."""
        changed = 0
        for i in range(zones.shape[0]):
            for k in range(ZONE):
                changed |= word_from(zones[i] + WORD_BYTES * k) ^ GUARD
        for i in range(pairs.shape[0]):
            now, kept = pairs[i, 0], pairs[i, 1]
            for k in range(pairs[i, 2]):
                changed |= word_from(now + WORD_BYTES * k) ^ word_from(kept + WORD_BYTES * k)
        return 1 if changed == 0 else 0

    signature = types.int64(types.int64[::1], types.int64[:, ::1])
    return loop_for(signature, is_untouched)


def numbers_of(robot: AnyRobot) -> dict[str, Any]:
    """Copy all numbers of a robot."""
    return {
        name: array.copy()
        for name, array in robot.model.members().items()
        if isinstance(array, np.ndarray)
    }


def restored(robot: AnyRobot, numbers: dict[str, Any]) -> str:
    """Put numbers of a robot back; say which had changed, nothing if none had."""
    first = ""
    for name, kept in numbers.items():
        now = getattr(robot.model, name)
        if now.tobytes() == kept.tobytes():
            continue
        places = np.argwhere(~((now == kept) | ((now != now) & (kept != kept))))
        if not first and len(places):
            place = tuple(places[0].tolist())
            index = ", ".join(map(str, place))
            first = f"model.{name}[{index}] from {kept[place]:.9g} to {now[place]:.9g}"
        ctypes.memmove(now.ctypes.data, kept.ctypes.data, kept.nbytes)  # read-only to numpy
    return first
