"""What differs from lane to lane and from episode to episode, drawn from named ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim import Push

Range = tuple[float, float]

PUSH_DURATION = 0.1
"""Seconds that a push lasts."""

FLAT, FACE, FACES = 0.5, 0.4, 32
"""Distance (m) from the start over which ground is level, then length of each face, and how many
there are; the last one goes on forever."""


@dataclass(frozen=True)
class Ranges:
    """Ranges from which values are drawn uniformly; None keeps a value.

    Raises
    ------
    SimulationError
        If one is no such pair, or values cannot be.
    """

    friction: Range | None = None
    """Coefficient of friction of the ground."""
    mass: Range | None = None
    """Factor of the mass and inertia of each link, drawn link by link. It takes some milliseconds a
    reset."""
    push: Range | None = None
    """Impulse (N s) of horizontal pushes on the trunk, forwards or back, of 0.1 s each."""
    push_period: Range = (3.0, 3.0)
    """Seconds from one push to the next."""
    delay: Range | None = None
    """Seconds from a decision until it acts, rounded to steps of the simulation."""
    slope: Range | None = None
    """Inclination (rad) of the ground, from half a metre ahead on."""
    roughness: Range | None = None
    """Height (m) up to which faces of 0.4 m deviate from level or slope, from there on."""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if value is None:
                continue
            try:
                low, high = (float(number) for number in value)
            except (TypeError, ValueError):
                low, high = np.nan, np.nan
            least = -0.5 if each.name == "slope" else 0.0
            positive = each.name in ("mass", "push_period") and not low > 0.0
            if positive or not least <= low <= high < np.inf:
                raise SimulationError(
                    f"the range of {each.name} is (lowest, greatest), from "
                    f"{'more than 0' if positive else f'{least:g}'} on, got {value!r}"
                )
            object.__setattr__(self, each.name, (low, high))

    @classmethod
    def of(cls, given: Ranges | Mapping[str, Any] | None) -> Ranges:
        """Return ranges that are given by their names.

        Parameters
        ----------
        given : Ranges or mapping of str to (float, float), optional
            What is drawn; nothing by default.

        Returns
        -------
        Ranges
            The same.

        Raises
        ------
        SimulationError
            If there is no such range.
        """
        if given is None or isinstance(given, Ranges):
            return given or cls()
        known = [each.name for each in fields(cls)]
        if not isinstance(given, Mapping) or not set(given) <= set(known):
            raise SimulationError(f"ranges are given by name, {', '.join(known)}; got {given!r}")
        return cls(**given)

    def pushes(self, seconds: float) -> int:
        """Return how many pushes an episode may have.

        Parameters
        ----------
        seconds : float
            Longest duration of an episode (s).

        Returns
        -------
        int
            The number.
        """
        return 0 if self.push is None else int(seconds / self.push_period[0])

    @property
    def changes_ground(self) -> bool:
        """Whether the ground is another in each episode."""
        return not self.friction is self.slope is self.roughness is None

    @property
    def is_level(self) -> bool:
        """Whether all ground is level."""
        return self.slope is self.roughness is None

    def ground(self, random: np.random.Generator, friction: float) -> tuple[Ground, Floats]:
        """Draw the ground of an episode.

        Parameters
        ----------
        random : Generator
            What it is drawn from.
        friction : float
            Its coefficient, if none is drawn.

        Returns
        -------
        ground : Ground
            The ground.
        profile : (corners, 2) float
            Its corners.
        """
        mu = friction if self.friction is None else random.uniform(*self.friction)
        if self.is_level:
            return Ground(friction=mu), np.array([[-1.0, 0.0], [1.0, 0.0]])
        corners = np.zeros((FACES + 1, 2))
        corners[0, 0] = -FACE
        corners[1:, 0] = FLAT + FACE * np.arange(FACES)
        if self.slope is not None:
            corners[1:, 1] = np.tan(random.uniform(*self.slope)) * (corners[1:, 0] - FLAT)
        if self.roughness is not None:
            height = random.uniform(*self.roughness)
            corners[2:, 1] += random.uniform(-height, height, FACES - 1)
        return Ground(friction=mu, profile=corners), corners

    def robot(self, random: np.random.Generator, robot: Robot) -> Robot:
        """Draw the robot of an episode.

        Parameters
        ----------
        random : numpy.random.Generator
            The generator.
        robot : Robot
            The robot whose masses change.

        Returns
        -------
        Robot
            The same with other masses and inertias.
        """
        assert self.mass is not None
        model = robot.model
        factor = random.uniform(*self.mass, model.mass.shape)
        return replace(
            robot, model=model.replaced(mass=model.mass * factor, inertia=model.inertia * factor)
        )

    def drawn_pushes(
        self, random: np.random.Generator, count: int, link: str | int
    ) -> tuple[Push, ...]:
        """Draw the pushes of an episode.

        Parameters
        ----------
        random : numpy.random.Generator
            The generator.
        count : int
            How many.
        link : str or int
            The link that is pushed.

        Returns
        -------
        tuple of Push
            The pushes, in the order of their beginnings.
        """
        assert self.push is not None
        impulse = random.uniform(*self.push, count) * random.choice((-1.0, 1.0), count)
        waits = random.uniform(*self.push_period, count)
        begin = np.cumsum(waits) - random.uniform(0.0, 1.0) * waits[0]
        return tuple(
            Push(link, force=(force, 0.0), start=start, duration=PUSH_DURATION)
            for force, start in zip((impulse / PUSH_DURATION).tolist(), begin.tolist(), strict=True)
        )

    def drawn_delay(self, random: np.random.Generator, step: float, most: int) -> int:
        """Draw a delay.

        Parameters
        ----------
        random : numpy.random.Generator
            The generator.
        step : float
            Length of a step (s).
        most : int
            Longest delay, in steps.

        Returns
        -------
        int
            The delay, in steps.
        """
        assert self.delay is not None
        return min(round(random.uniform(*self.delay) / step), most)
