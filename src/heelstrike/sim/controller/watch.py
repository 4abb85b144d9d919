"""Whether a controller kept to what it may do: it owns its torques and its memory, no more."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from heelstrike.robot.robot import Robot
from heelstrike.sim.controller.control import OVERRAN, TRUSTED, ReadyLaw
from heelstrike.sim.controller.guard import trespasses
from heelstrike.sim.memory import Memory


class Watch:
    """What a controller was handed, to be looked at while it runs.

    Parameters
    ----------
    robots : tuple of Robot
        Those that it could change, whose numbers are copied.
    law : ReadyLaw
        The controller.
    memory : Memory
        Memory of the simulation.
    """

    def __init__(self, robots: tuple[Robot, ...], law: ReadyLaw, memory: Memory) -> None:
        self._control = law.control
        watched = law.control.conduct != TRUSTED or law.control.in_python
        self._numbers = [(each, numbers_of(each)) for each in robots] if watched else []
        self._arrays = [("torque", memory.command), *law.arrays()]

    def misdeed(self) -> str | None:
        """Say what the controller did that it may not, and undo what can be undone."""
        control = self._control
        if control.conduct == TRUSTED and not control.in_python:
            return None
        changed = [restored(robot, numbers) for robot, numbers in self._numbers]
        if any(changed):
            return f"changed the robot: {max(changed)}"
        places = [place for name, values in self._arrays for place in trespasses(name, values)]
        if places:
            more = f" (and {len(places) - 1} more)" if len(places) > 1 else ""
            return f"wrote beyond its arrays, to {places[0]}{more}"
        return "wrote beyond its arrays" if control.conduct == OVERRAN else None


def numbers_of(robot: Robot) -> dict[str, Any]:
    """Copy all numbers of a robot."""
    return {
        name: array.copy()
        for name, array in robot.model.members().items()
        if isinstance(array, np.ndarray)
    }


def restored(robot: Robot, numbers: dict[str, Any]) -> str:
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
