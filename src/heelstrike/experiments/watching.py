"""A walk that is watched while it goes on: every choice of a viewer, and the walk made of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, Unpack

import numpy as np

from heelstrike.analysis.limit_cycle import LimitCycle
from heelstrike.contact.ground import Ground
from heelstrike.control import ComputedTorque, Encoder
from heelstrike.errors import GaitError
from heelstrike.experiments.passive import USUAL_SLOPES, passive_walk
from heelstrike.experiments.walk import beginning, design, typical_step
from heelstrike.gait import Gait, load_gait
from heelstrike.robot import Robot, builtin_robots, load_robot
from heelstrike.robot.files.options import LoadOptions
from heelstrike.sim import Controller, Simulation
from heelstrike.sim.method import Method
from heelstrike.view.live.stage import Control, Stage, friction_control

DESIGNED, CYCLE = "designed for the speed", "limit cycle"
EXACT, ENCODERS, NOTHING = "computed torque", "computed torque by encoders", "no torque"
MILLISECONDS = " ms"
STEPS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Steps that are offered, in ms."""
SPEEDS = (0.4, 1.6)
"""Slowest and fastest walk that is offered, as shares of the speed that suits the robot."""
STEEPEST = 8.0
"""Degrees."""
ROUGHEST = 0.03
"""Metres."""
AHEAD, SPACING, ROUGH_LENGTH = 0.5, 0.1, 100.0
"""Where roughness begins, the distance of its corners and its length, in m."""
DESCENT = -3.0
"""Degrees of the slope on which passive walkers begin."""


class Methods(Protocol):
    """Makes the method of a name and a step (s); legs of passive walkers may pass the ground."""

    def __call__(self, name: str, step: float, *, passive: bool) -> Method:
        """Make it."""


@dataclass(frozen=True, kw_only=True)
class First:
    """What is chosen at first.

    Attributes
    ----------
    method : str, optional
        Name of the method; the usual one by default.
    step : float
        In s.
    gait : str or path, optional
        A saved gait of the robot, offered beside the designed one.
    friction : float
        For which gaits are designed, too.
    slope : float, optional
        In degrees; by default level, or a descent for walkers without motors.
    roughness : float
        Greatest height of the ground's corners (m).
    seed : int
        Of the roughness.
    ground : Ground, optional
        Instead of a slope and roughness that can be set.
    """

    method: str | None = None
    step: float = 1e-3
    gait: str | os.PathLike[str] | None = None
    friction: float = 0.75
    slope: float | None = None
    roughness: float = 0.0
    seed: int = 1
    ground: Ground | None = None


class WalkStage(Stage):
    """Walks of any robot under a viewer's choices.

    Parameters
    ----------
    robot : str or path
        Name or file of the robot at first; the built-in ones are offered, too.
    methods : callable
        Makes the method of a name and a step (s), for robots with motors or without.
    method_names : sequence of str
        The names, the usual one first.
    first : First, optional
        What is chosen at first.
    **how
        How the robot's file is read, as for :func:`heelstrike.load_robot`.
    """

    def __init__(
        self,
        robot: str | os.PathLike[str],
        methods: Methods,
        method_names: tuple[str, ...],
        first: First | None = None,
        **how: Unpack[LoadOptions],
    ) -> None:
        self._name, self._first = str(robot), First() if first is None else first
        self._robots = {self._name: load_robot(robot, **how)}
        self._methods, self._method_names = methods, method_names
        self._gaits: dict[tuple[Any, ...], Gait | LimitCycle] = {}
        robot_at_first = self._robots[self._name]
        if self._first.roughness and not robot_at_first.nu:
            raise GaitError(
                f"{robot_at_first.name} has no motors, and without them no walk repeats on rough "
                "ground: choose a flat or sloping one"
            )
        gait = self._first.gait
        self._saved = "" if gait is None else Path(gait).name
        if gait is not None:
            self._gaits[self._name, self._saved] = load_gait(gait, robot_at_first)

    def controls(self, values: Mapping[str, Any]) -> tuple[Control, ...]:
        """Robot, gait, controller, speed, ground, method and step."""
        name = values.get("robot", self._name)
        robot = self._robot(name)
        names = tuple(dict.fromkeys((self._name, *builtin_robots())))
        passive = robot.nu == 0
        found = [Control("robot", "robot", name, names, resets=_OF_ROBOT)]
        if passive:
            found.append(Control("gait", "gait", CYCLE, (CYCLE,)))
        else:
            gaits = (self._saved, DESIGNED) if (name, self._saved) in self._gaits else (DESIGNED,)
            found.append(Control("gait", "gait", gaits[0], gaits))
            drives = (EXACT, ENCODERS, NOTHING)
            found.append(Control("controller", "controller", EXACT, drives))
            if values.get("gait", gaits[0]) == DESIGNED:
                found.append(_speed_control(robot))
        found.append(friction_control(self._first.friction))
        if self._first.ground is None:
            found += self._shape_controls(robot)
        usual = "event-driven" if passive else self._method_names[0]
        asked = self._first.method if name == self._name else None
        found.append(Control("method", "method", asked or usual, self._method_names))
        return (*found, self._step_control())

    def simulation(self, values: Mapping[str, Any], progress: Callable[[str], None]) -> Simulation:
        """Put the robot on its ground as its gait begins."""
        robot = self._robot(values["robot"])
        ground = self.ground(values)
        walked = self._walked(robot, values, ground, progress)
        start = beginning(robot, walked, ground)
        step = 1e-3 * float(values["step"].removesuffix(MILLISECONDS))
        controller = start.controller if robot.nu == 0 else self._controller(robot, walked, values)
        return Simulation(
            robot,
            controller,
            state=start.state,
            method=self._methods(values["method"], step, passive=robot.nu == 0),
            ground=ground,
        )

    def ground(self, values: Mapping[str, Any], simulation: Simulation | None = None) -> Ground:  # noqa: ARG002
        """Make the ground of a slope, a roughness and a friction."""
        friction = values["friction"]
        if self._first.ground is not None:
            numbers = self._first.ground.numbers()
            same = np.full_like(numbers["friction"], friction)
            return Ground.of_numbers(numbers | {"friction": same})
        slope = float(np.deg2rad(values["slope"]))
        if not values["roughness"]:
            return Ground(friction=friction, slope=slope)
        rough = Ground.rough(
            amplitude=values["roughness"], spacing=SPACING, length=ROUGH_LENGTH, start=AHEAD,
            seed=self._first.seed,
        )  # fmt: skip
        corners = rough.numbers()["corner"].copy()
        corners[:, 1] += np.tan(slope) * corners[:, 0]
        return Ground(friction=friction, profile=corners)

    def _robot(self, name: str) -> Robot:
        if name not in self._robots:
            self._robots[name] = load_robot(name)
        return self._robots[name]

    def _shape_controls(self, robot: Robot) -> list[Control]:
        slope, passive = self._first.slope, robot.nu == 0
        if slope is None:
            slope = USUAL_SLOPES.get(robot.name, DESCENT) if passive else 0.0
        steepest = max(STEEPEST, abs(slope))
        shapes = [
            Control("slope", "slope", slope, low=-steepest, high=steepest, step=0.5, unit="°")
        ]
        rough = 0.0 if passive else self._first.roughness
        highest = 0.0 if passive else max(ROUGHEST, rough)
        shapes.append(
            Control("roughness", "roughness ±", rough, high=highest, step=0.001, unit="m")
        )
        return shapes

    def _step_control(self) -> Control:
        step = 1e3 * self._first.step
        offered = sorted({*STEPS, float(f"{step:.6g}")})
        words = tuple(f"{each:g}{MILLISECONDS}" for each in offered)
        return Control("step", "step", f"{step:.6g}{MILLISECONDS}", words)

    def _walked(
        self,
        robot: Robot,
        values: Mapping[str, Any],
        ground: Ground,
        progress: Callable[[str], None],
    ) -> Gait | LimitCycle:
        """Return the gait of some choices, designed once."""
        if values["gait"] == CYCLE:
            progress("looking for a walk that repeats")
            return passive_walk(robot, ground)
        name = values["robot"]
        if values["gait"] != DESIGNED:
            return self._gaits[name, values["gait"]]
        speed = values["speed"]
        key = (name, DESIGNED, speed)
        if key not in self._gaits:
            usual = typical_step(robot)
            size = replace(usual, length=speed * usual.duration)
            doing = f"designing a gait of {size.length:.3g} m in {size.duration:.3g} s"
            progress(doing)
            self._gaits[key] = design(
                robot,
                size,
                friction=self._first.friction,
                progress=lambda share: progress(f"{doing}: {100.0 * share:.0f} %"),
            )
        return self._gaits[key]

    def _controller(
        self, robot: Robot, walked: Gait | LimitCycle, values: Mapping[str, Any]
    ) -> Controller | None:
        assert isinstance(walked, Gait)
        if values["controller"] == NOTHING:
            return None
        encoder = Encoder() if values["controller"] == ENCODERS else None
        return ComputedTorque(robot, walked, encoder=encoder)


_OF_ROBOT = ("gait", "controller", "speed", "slope", "roughness", "method")
"""Controls whose first value depends on the robot."""


def _speed_control(robot: Robot) -> Control:
    """Walking speed of designed gaits, about the one that suits the robot."""
    usual = typical_step(robot)
    speed = usual.length / usual.duration
    low, high = (round(share * speed, 2) for share in SPEEDS)
    return Control("speed", "walking speed", speed, low=low, high=high, step=0.01, unit="m/s")
