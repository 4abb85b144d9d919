"""A walk that is watched while it goes on: every choice of a viewer, and the walk made of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Unpack

import numpy as np

from heelstrike.analysis.limit_cycle import LimitCycle
from heelstrike.contact.ground import Ground
from heelstrike.errors import GaitError, HeelstrikeError
from heelstrike.experiments.laws import (
    Entry,
    check_law,
    gait_for,
    law_called,
    law_that_steps,
    laws_of,
)
from heelstrike.experiments.passive import USUAL_SLOPES, passive_walk
from heelstrike.experiments.walk import beginning, design, typical_step
from heelstrike.field_texts import dataclass
from heelstrike.gait import Gait, load_gait
from heelstrike.robot import Robot, State, builtin_robots
from heelstrike.robot.files.options import LoadOptions
from heelstrike.robot.library import load_planar_robot
from heelstrike.sim import Simulation
from heelstrike.sim.method import Method
from heelstrike.view.live.stage import (
    Control,
    Stage,
    friction_control,
    slope_control,
    step_control,
    step_of,
)

if TYPE_CHECKING:
    from heelstrike.view.live.dimension import AnySimulation

DESIGNED, CYCLE = "designed for the speed", "limit cycle"
NOTHING = "no torque"
SPEEDS = (0.4, 1.6)
"""Slowest and fastest walk that is offered, as shares of the speed that suits the robot."""
STEEPEST = 8.0
"""Degrees."""
ROUGHEST = 0.03
"""Metres."""
DESCENT = -3.0
"""Degrees of the slope on which passive walkers begin."""


class Methods(Protocol):
    """Makes the method of a name and a step (s); legs of passive walkers may pass the ground."""

    def __call__(self, name: str, step: float, *, passive: bool) -> Method:
        """Make it."""


@dataclass(frozen=True, kw_only=True)
class First:
    """What is chosen at first."""

    method: str | None = None
    """Name of the method; the usual one by default."""
    step: float = 1e-3
    """In s."""
    gait: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None = None
    """Saved gaits of the robots, offered beside the designed ones; the first is walked."""
    laws: Sequence[Entry] = ()
    """Laws offered beside those that have a name; the first moves the joints. By default that is
    the law that steps where balance needs it, where a robot can have it, or computed torque."""
    friction: float = 0.75
    """For which gaits are designed, too."""
    slope: float | None = None
    """In degrees; by default level, or a descent for walkers without motors."""
    roughness: float = 0.0
    """Greatest height of the ground's corners (m)."""
    seed: int = 1
    """Of the roughness."""
    ground: Ground | None = None
    """Instead of a slope and roughness that can be set."""


class WalkStage(Stage):
    """Walks of any robot under a viewer's choices.

    Parameters
    ----------
    robot : path, or sequence of these
        Names or files of robots, the first at first; the built-in ones are offered, too.
    methods : callable
        Makes the method of a name and a step (s), for robots with motors or without.
    method_names : sequence of str
        The names, the usual one first.
    first : First, optional
        What is chosen at first.
    loaded : mapping of str to Robot, optional
        Robots that have been loaded already, by name or file.
    **how
        How the robots' files are read, as for :func:`heelstrike.load_robot`.

    Raises
    ------
    HeelstrikeError
        If a robot or gait cannot be loaded, or a gait belongs to none of the robots, or a law can
        drive none of them.
    """

    def __init__(
        self,
        robot: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
        methods: Methods,
        method_names: tuple[str, ...],
        first: First | None = None,
        *,
        loaded: Mapping[str, Robot] | None = None,
        **how: Unpack[LoadOptions],
    ) -> None:
        self._first = First() if first is None else first
        known = loaded or {}
        self._robots = {
            str(each): known[str(each)]
            if str(each) in known
            else load_planar_robot(each, **({} if str(each) in builtin_robots() else how))
            for each in _several(robot)
        }
        self._asked = tuple(self._robots)
        self._name = self._asked[0]
        for law in self._first.laws:
            if all(law.needs(each) for each in self._robots.values()):
                check_law(law, self._robots[self._name])
        self._methods, self._method_names = methods, method_names
        self._gaits: dict[tuple[Any, ...], Gait | LimitCycle] = {}
        robot_at_first = self._robots[self._name]
        if self._first.roughness and not robot_at_first.nu:
            raise GaitError(
                f"{robot_at_first.name} has no motors, and without them no walk repeats on rough "
                "ground: choose a flat or sloping one"
            )
        self._saved: dict[str, list[str]] = {}  # names of gaits, by robots
        for path in _several(self._first.gait):
            self._open(path)

    def controls(self, values: Mapping[str, Any]) -> tuple[Control, ...]:
        """Robot, gait, controller, speed, ground, method and step."""
        name = values.get("robot", self._name)
        robot = self._robot(name)
        names = tuple(dict.fromkeys((*self._asked, *builtin_robots())))
        passive = robot.nu == 0
        found = [Control("robot", "robot", name, names, resets=_OF_ROBOT)]
        if passive:
            found.append(Control("gait", "gait", CYCLE, (CYCLE,)))
        else:
            gaits = (*self._saved.get(name, ()), DESIGNED)
            gait = values.get("gait", gaits[0])
            laws = self._laws(robot)
            usual_law = self._usual_law(robot, self._gaits.get((name, gait)))
            law = laws.get(values.get("controller", usual_law))
            if law is None or not law.stands:
                found.append(Control("gait", "gait", gaits[0], gaits))
            found.append(Control("controller", "controller", usual_law, (*laws, NOTHING)))
            own = law is not None and (law.stands or law.bent_knees)
            if gait == DESIGNED and not own:
                found.append(_speed_control(robot))
        found.append(friction_control(self._first.friction))
        if self._first.ground is None:
            found += self._shape_controls(robot)
        usual = "event-driven" if passive else self._method_names[0]
        asked = self._first.method if name == self._name else None
        found.append(Control("method", "method", asked or usual, self._method_names))
        return (*found, step_control(self._first.step))

    def simulation(self, values: Mapping[str, Any], progress: Callable[[str], None]) -> Simulation:
        """Put the robot on its ground as its gait begins."""
        robot = self._robot(values["robot"])
        ground = self.ground(values)
        law = self._laws(robot).get(values.get("controller", NOTHING))
        walked = self._walked(robot, law, values, ground, progress)
        start = beginning(robot, walked, ground, law)
        step = step_of(values["step"])
        return Simulation(
            robot,
            None if law is None else start.controller,
            state=start.state,
            method=self._methods(values["method"], step, passive=robot.nu == 0),
            ground=ground,
        )

    def outline(self, values: Mapping[str, Any]) -> tuple[Robot, State, Ground]:
        """Put the robot where its walk will begin; it stands as long as no gait is known."""
        robot, ground = self._robot(values["robot"]), self.ground(values)
        saved = self._gaits.get((values["robot"], values.get("gait")))
        try:
            if isinstance(saved, Gait):
                return robot, beginning(robot, saved, ground).state, ground
            return robot, robot.standing(ground), ground
        except HeelstrikeError:  # of what cannot stand the picture is no less
            return robot, robot.reference_state(), ground

    def ground(self, values: Mapping[str, Any], simulation: AnySimulation | None = None) -> Ground:  # noqa: ARG002
        """Make the ground of a slope, a roughness and a friction."""
        friction = values["friction"]
        if self._first.ground is not None:
            return replace(self._first.ground, friction=friction)
        slope = float(np.deg2rad(values["slope"]))
        if not values["roughness"]:
            return Ground(friction=friction, slope=slope)
        rough = Ground.rough(amplitude=values["roughness"], seed=self._first.seed)
        corners = rough.numbers()["corner"].copy()
        corners[:, 1] += np.tan(slope) * corners[:, 0]
        return Ground(friction=friction, profile=corners)

    def _robot(self, name: str) -> Robot:
        if name not in self._robots:
            self._robots[name] = load_planar_robot(name)
        return self._robots[name]

    def _open(self, path: str | os.PathLike[str]) -> None:
        """Load a gait, of whichever robot that was named it is."""
        refused: list[GaitError] = []
        for name, robot in self._robots.items():
            try:
                gait = load_gait(path, robot)
            except GaitError as error:
                refused.append(error)
                continue
            saved = self._saved.setdefault(name, [])
            called = Path(path).name if Path(path).name not in saved else str(path)
            saved.append(called)
            self._gaits[name, called] = gait
        if len(refused) == len(self._robots):
            raise refused[0]

    def _laws(self, robot: Robot) -> dict[str, Entry]:
        """Laws that are offered for a robot, those first that were asked for."""
        asked = [law for law in self._first.laws if not law.needs(robot)]
        return {law.name: law for law in (*asked, *laws_of(robot))}

    def _usual_law(self, robot: Robot, gait: Gait | LimitCycle | None) -> str:
        """Name of the law that moves the joints of a robot at first."""
        on_points = isinstance(gait, Gait) and bool(gait.point_feet)
        steps = None if on_points else law_that_steps(robot)
        usual = steps or law_called("ComputedTorque")
        asked = [law for law in self._first.laws if not law.needs(robot)]
        return (asked[0] if asked else usual).name

    def _shape_controls(self, robot: Robot) -> list[Control]:
        slope, passive = self._first.slope, robot.nu == 0
        if slope is None:
            slope = USUAL_SLOPES.get(robot.name, DESCENT) if passive else 0.0
        shapes = [slope_control(slope, STEEPEST)]
        rough = 0.0 if passive else self._first.roughness
        highest = 0.0 if passive else max(ROUGHEST, rough)
        shapes.append(
            Control("roughness", "roughness ±", rough, high=highest, step=0.001, unit="m")
        )
        return shapes

    def _walked(
        self,
        robot: Robot,
        law: Entry | None,
        values: Mapping[str, Any],
        ground: Ground,
        progress: Callable[[str], None],
    ) -> Gait | LimitCycle | None:
        """Return the gait of some choices, designed once; None of a robot that stands."""
        if law is not None and law.stands:
            return None
        if values["gait"] == CYCLE:
            progress("looking for a walk that repeats")
            return passive_walk(robot, ground)
        name = values["robot"]
        if values["gait"] != DESIGNED:
            return self._gaits[name, values["gait"]]
        if law is not None and law.bent_knees:
            key: tuple[Any, ...] = (name, DESIGNED, law.bent_knees)
            if key not in self._gaits:
                progress("designing a gait with bent knees")
                self._gaits[key] = gait_for(robot)
            return self._gaits[key]
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


_OF_ROBOT = ("gait", "controller", "speed", "slope", "roughness", "method")
"""Controls whose first value depends on the robot."""


def _several(
    given: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None,
) -> Sequence[str | os.PathLike[str]]:
    if given is None:
        return ()
    return (given,) if isinstance(given, str | os.PathLike) else given


def _speed_control(robot: Robot) -> Control:
    """Walking speed of designed gaits, about the one that suits the robot."""
    usual = typical_step(robot)
    speed = usual.length / usual.duration
    low, high = (round(share * speed, 2) for share in SPEEDS)
    return Control("speed", "walking speed", speed, low=low, high=high, step=0.01, unit="m/s")
