"""A robot in space that is watched: every choice of a viewer, and the simulation made of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.contact.spatial.ground import SpatialGround
from heelstrike.errors import ControllerError
from heelstrike.experiments.space import HOLD, LIMP, SpatialLaw, holds
from heelstrike.field_texts import dataclass
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.robot.state import State
from heelstrike.sim.spatial.placing import placed_in_space
from heelstrike.sim.spatial.simulation import SpatialSimulation
from heelstrike.view.live.dimension import LiveDimension
from heelstrike.view.live.stage import (
    Control,
    Stage,
    friction_control,
    slope_control,
    step_control,
    step_of,
)
from heelstrike.view.spatial.live import LIVE_SPACE

STEEPEST = 20.0
"""Degrees."""
HIGHEST = 1.0
"""Metres above the ground from which robots are dropped."""


@dataclass(frozen=True, kw_only=True)
class FirstInSpace:
    """What is chosen at first."""

    method: str
    """Name of the method."""
    step: float = 1e-3
    """In s."""
    laws: Sequence[SpatialLaw] = ()
    """Laws of a user, offered beside the others; the first moves the joints."""
    friction: float = 0.75
    slope: float = 0.0
    """In degrees; positive climbs along x."""


class SpaceStage(Stage):
    """Robots in space under a viewer's choices.

    Parameters
    ----------
    robots : mapping of str to SpatialRobot
        The robots by their names in the list, the first at first.
    methods : callable
        Makes the method of a name and a step (s).
    method_names : tuple of str
        The names, as they are offered.
    first : FirstInSpace
        What is chosen at first.

    Raises
    ------
    HeelstrikeError
        If a law cannot drive the first robot.
    """

    def __init__(
        self,
        robots: Mapping[str, SpatialRobot],
        methods: Callable[[str, float], Any],
        method_names: tuple[str, ...],
        first: FirstInSpace,
    ) -> None:
        self._robots, self._methods, self._method_names = dict(robots), methods, method_names
        self._first = first
        robot = next(iter(self._robots.values()))
        for law in first.laws:
            if law is HOLD and not robot.nu:
                raise ControllerError(
                    f"HoldPosture needs motors, and robot {robot.name!r} has none: leave the "
                    "controller out"
                )
            law.make(robot, first.step)

    @property
    def dimension(self) -> LiveDimension:
        """Space."""
        return LIVE_SPACE

    def controls(self, values: Mapping[str, Any]) -> tuple[Control, ...]:
        """Robot, controller, friction, slope, height, method and step."""
        names = tuple(self._robots)
        name = values.get("robot", names[0])
        robot = self._robots[name]
        laws = tuple(self._laws(robot))
        drop = Control("above", "drop from", 0.0, high=HIGHEST, step=0.01, unit="m")
        first = self._first
        return (
            Control("robot", "robot", name, names, resets=("controller",)),
            Control("controller", "controller", laws[0], laws),
            friction_control(first.friction),
            slope_control(first.slope, STEEPEST),
            *((drop,) if robot.floating else ()),
            Control("method", "method", first.method, self._method_names),
            step_control(first.step),
        )

    def simulation(
        self, values: Mapping[str, Any], progress: Callable[[str], None]
    ) -> SpatialSimulation:
        """Put the robot on the ground, or above it, in the posture of its file."""
        progress("putting the robot on its ground")
        robot, state, ground = self.outline(values)
        step = step_of(values["step"])
        law = self._laws(robot)[values["controller"]]
        return SpatialSimulation(
            robot,
            law.make(robot, step),
            state=state,
            method=self._methods(values["method"], step),
            ground=ground,
            stop_when_fallen=False,  # to see how it falls, and push what lies
        )

    def outline(self, values: Mapping[str, Any]) -> tuple[SpatialRobot, State, SpatialGround]:
        """Put the robot where it will begin."""
        robot, ground = self._robots[values["robot"]], self.ground(values)
        return robot, placed_in_space(robot, ground, above=values.get("above", 0.0)), ground

    def ground(self, values: Mapping[str, Any], simulation: Any = None) -> SpatialGround:
        """Make the ground of a slope and a friction; of a simulation that goes on, its friction."""
        if simulation is not None:
            return replace(simulation.ground, friction=values["friction"])
        slope = float(np.deg2rad(values["slope"]))
        return SpatialGround.of_plane(Ground(friction=values["friction"], slope=slope))

    def _laws(self, robot: SpatialRobot) -> dict[str, SpatialLaw]:
        """Laws that are offered for a robot, those first that were asked for."""
        stock = (HOLD, LIMP) if holds(robot) else (LIMP,)
        asked = (law for law in self._first.laws if law is not HOLD or robot.nu)
        return {law.name: law for law in (*asked, *stock)}
