"""What a live view does in its own way with robots in the plane, and with robots in space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.push import Push
from heelstrike.view.live.layout import FrameLayout

if TYPE_CHECKING:
    from heelstrike.contact.ground import Ground
    from heelstrike.contact.spatial.ground import SpatialGround
    from heelstrike.sim.dimension import AnyRobot
    from heelstrike.sim.run import Event
    from heelstrike.sim.simulation import Simulation
    from heelstrike.sim.spatial.run import SpatialEvent
    from heelstrike.sim.spatial.simulation import SpatialSimulation

    AnyGround = Ground | SpatialGround
    AnyEvent = Event | SpatialEvent
    AnySimulation = Simulation | SpatialSimulation
    Outline = tuple[AnyRobot, State, AnyGround]


class LiveDimension(ABC):
    """Names and answers that depend on the dimension; all else of a live view is the same.

    Attributes
    ----------
    name : str
        Of the pictures that the page draws: ``plane`` or ``space``.
    kinds : tuple of str
        Names of the events, by their numbers.
    quantities : tuple of str
        What a run records beside the time.
    """

    name: str
    kinds: tuple[str, ...]
    quantities: tuple[str, ...]

    @abstractmethod
    def layout(self, robot: Any) -> FrameLayout:
        """Lay the frames of a robot out."""

    @abstractmethod
    def scene(self, robot: Any, ground: Any) -> dict[str, Any]:
        """Describe what of a robot and its ground does not change, as JSON has it."""

    @abstractmethod
    def check(self, push: Push, robot: Any) -> None:
        """Refuse a push that cannot act on a robot."""

    @abstractmethod
    def somewhere(self, draw: np.random.Generator) -> tuple[float, ...]:
        """Draw a unit vector, more or less along the ground."""

    @abstractmethod
    def moved(self, simulation: Any, joint: str, position: float) -> State:
        """Return the state with a joint elsewhere (rad or m) and all else as it is.

        A robot that stands, or would stand in the ground, is lifted or lowered on it.

        Raises
        ------
        HeelstrikeError
            If there is no such joint, or the robot cannot be like that.
        """

    @abstractmethod
    def light(self, run: Any) -> dict[str, str]:
        """Return level and words of the light that says whether contact forces are proven."""

    @abstractmethod
    def shown_at(self, event: Any, robot: Any) -> int:
        """Index of what the picture marks for an event, -1 for nothing."""


def dimension_of(robot: Any) -> LiveDimension:
    """Return what a robot needs; what is for space is loaded by those who have such a robot."""
    if isinstance(robot, Robot):
        from heelstrike.view.live.plane import LIVE_PLANE

        return LIVE_PLANE
    from heelstrike.view.spatial.live import LIVE_SPACE

    return LIVE_SPACE
