"""Pushes: forces that somebody else applies to the robot for a while."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from heelstrike.arguments import check_fields
from heelstrike.compiler.bundle import Bundle, array
from heelstrike.compiler.compilation import kernel, rare_kernel
from heelstrike.dynamics.kernels import point_position
from heelstrike.dynamics.places import add_point_force, place_of, velocity_at
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers, Model
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot


@dataclass(frozen=True)
class Push:
    """A constant force on a point of a link over a window of time.

    Raises
    ------
    SimulationError
        If a number is missing or not finite, or the duration is negative.

    Notes
    -----
    Event-driven simulation begins and ends it at the instant. Methods with a fixed step apply its
    mean over each step, so that its impulse is exact wherever the window lies.

    Examples
    --------
    >>> Push("trunk", force=(60.0, 0.0), start=1.0, duration=0.1)
    Push(link='trunk', force=(60.0, 0.0), start=1.0, duration=0.1, point=None)
    """

    link: str | int
    """Name of the body, or index of the link."""
    force: tuple[float, ...] = field(kw_only=True)
    """Force (x, z) on the robot in world axes, in N; (x, y, z) on a robot in space."""
    start: float = field(kw_only=True)
    duration: float = field(kw_only=True)
    """start, duration: When it begins and how long it lasts, in s."""
    point: tuple[float, ...] | None = field(default=None, kw_only=True)
    """Where it acts, in the axes of the link, in m; by default at the link's centre of mass."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        object.__setattr__(self, "force", _numbers("force", self.force))
        if self.point is not None:
            object.__setattr__(self, "point", _numbers("point", self.point))
        for name, lowest in (("start", -np.inf), ("duration", 0.0)):
            value = getattr(self, name)
            number = isinstance(value, float | int | np.number) and np.isfinite(value)
            if not (number and value >= lowest):
                least = " ≥ 0" if lowest == 0.0 else ""
                raise SimulationError(
                    f"the {name} of a push must be a finite number{least}, got {value!r}"
                )

    @property
    def end(self) -> float:
        """When it ends, in s."""
        return self.start + self.duration

    def place(self, robot: Robot | SpatialRobot) -> tuple[int, tuple[float, ...]]:
        """Link of `robot` on which it acts, and the point in the axes of that link.

        Parameters
        ----------
        robot : Robot or SpatialRobot
            The robot.

        Returns
        -------
        tuple
            Index of the link, and the point in its axes (m), (x, z) or (x, y, z).

        Raises
        ------
        SimulationError
            If the robot has no such link, or force or point have not as many numbers as it has
            axes.
        """
        if isinstance(self.link, str):
            # A body with several joints is a chain of links: the last one carries its mass.
            named = [i for i, name in enumerate(robot.link_names) if name == self.link]
            if not named:
                raise SimulationError(
                    f"a push acts on link {self.link!r}, which robot {robot.name!r} does not have; "
                    f"its links are {', '.join(dict.fromkeys(robot.link_names))}"
                )
            index = named[-1]
        else:
            index = int(self.link)
            if not 0 <= index < robot.nl:
                raise SimulationError(
                    f"a push acts on link {index}, but robot {robot.name!r} has links 0 to "
                    f"{robot.nl - 1}"
                )
        center = robot.model.center_of_mass[index]
        for name, value in (("force", self.force), ("point", self.point)):
            if value is not None and len(value) != center.size:
                raise SimulationError(
                    f"the {name} of a push on a robot in {WHERE[center.size]}, got {value!r}"
                )
        return index, tuple(center.tolist()) if self.point is None else self.point

    def time_within(self, begin: Floats, end: Floats) -> Floats:
        """Seconds that it acts within each of the intervals from `begin` to `end`.

        Parameters
        ----------
        begin, end : (k,) float
            Ends of the intervals (s).

        Returns
        -------
        (k,) float
            Seconds.
        """
        return np.maximum(np.minimum(end, self.end) - np.maximum(begin, self.start), 0.0)


def _numbers(name: str, value: Sequence[float]) -> tuple[float, ...]:
    try:
        numbers = tuple(float(number) for number in value)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) not in (2, 3):
        raise SimulationError(
            f"the {name} of a push must be two numbers (x, z), or three (x, y, z) in space, got "
            f"{value!r}"
        ) from None
    if not np.all(np.isfinite(numbers)):
        raise SimulationError(f"the {name} of a push must be finite, got {value!r}")
    return numbers


WHERE = {2: "the plane is two numbers (x, z)", 3: "space has three numbers (x, y, z)"}
"""Where a robot lives that has so many axes, and what vectors have there."""


class Pushes(Bundle):
    """The pushes of a simulation as the kernels see them."""

    link: Integers = array("np", of=int)
    point: Floats = array("np", "axes")
    position: Floats = array("np", "axes")
    force: Floats = array("np", "axes")
    """point, position, force: Points in the axes of their links and, scratch, in the world; forces
    in world axes."""
    start: Floats = array("np")
    end: Floats = array("np")
    share: Floats = array("np")
    """How much of each push acts in the step being computed, 0 to 1."""


def pushes_on(robot: Robot | SpatialRobot, pushes: Sequence[Push]) -> Pushes:
    """Return the arrays of some pushes on a robot."""
    numbers = numbers_of_pushes(robot, pushes)
    start, duration = numbers.pop("window").T.copy()
    return Pushes.allocate(
        np=len(start), axes=robot.model.axes, start=start, end=start + duration, **numbers
    )


def numbers_of_pushes(robot: Robot | SpatialRobot, pushes: Sequence[Push]) -> dict[str, Any]:
    """Return some pushes on a robot as arrays that :func:`pushes_of_numbers` makes them of."""
    places, axes = [push.place(robot) for push in pushes], robot.model.axes

    def rows(values: Sequence[Sequence[float]], length: int) -> Floats:
        return np.array(values, dtype=np.float64).reshape(-1, length)

    return {
        "link": np.array([link for link, _ in places], dtype=np.int64),
        "point": rows([point for _, point in places], axes),
        "force": rows([push.force for push in pushes], axes),
        "window": rows([(push.start, push.duration) for push in pushes], 2),
    }


def pushes_of_numbers(numbers: Mapping[str, Floats]) -> tuple[Push, ...]:
    """Return the pushes of some numbers."""
    return tuple(
        Push(int(link), force=force, start=start, duration=duration, point=point)
        for link, point, force, (start, duration) in zip(
            *(numbers[name].tolist() for name in ("link", "point", "force", "window")), strict=True
        )
    )


@kernel
def share_over_step(time: float, step: float, pushes: Pushes) -> bool:
    """Find how much of each push acts in the step from `time` on; return whether any does."""
    any_acts = False
    for i in range(pushes.link.shape[0]):
        acting = min(time + step, pushes.end[i]) - max(time, pushes.start[i])
        pushes.share[i] = max(acting, 0.0) / step
        any_acts = any_acts or acting > 0.0
    return any_acts


@kernel
def switch_at(time: float, pushes: Pushes) -> tuple[bool, float]:
    """Let the pushes act that do so from `time` on.

    Returns whether anything changed, and when it next will.
    """
    changed = False
    following = np.inf
    for i in range(pushes.link.shape[0]):
        acts = 1.0 if pushes.start[i] <= time and time < pushes.end[i] else 0.0
        changed = changed or acts != pushes.share[i]
        pushes.share[i] = acts
        if pushes.start[i] > time:
            following = min(following, pushes.start[i])
        if pushes.end[i] > time:
            following = min(following, pushes.end[i])
    return changed, following


@rare_kernel
def add_pushes(model: Model, tree: Workspace, pushes: Pushes, force: Floats) -> None:
    """Add the generalised force Jᵀf of the pushes to `force`."""
    for i in range(pushes.link.shape[0]):
        if pushes.share[i] > 0.0:
            link, position = pushes.link[i], pushes.position[i]
            push = (pushes.share[i] * pushes.force[i, 0], pushes.share[i] * pushes.force[i, 1])
            point_position(tree, link, pushes.point[i], position)
            add_point_force(model, tree, link, position, push, force)


@kernel
def add_push_slopes(model: Model, tree: Workspace, pushes: Pushes, slopes: Floats) -> None:
    """Add the derivative of Jᵀf of the pushes by position, (nv, nq), to `slopes`.

    The column of J of a coordinate turns with all coordinates nearer to the root, and with itself:
    ∂²p/∂q_j ∂q_k is the turning of the one nearer to the root times the column of the other.
    """
    for i in range(pushes.link.shape[0]):
        if pushes.share[i] > 0.0:
            x, z = pushes.share[i] * pushes.force[i, 0], pushes.share[i] * pushes.force[i, 1]
            point_position(tree, pushes.link[i], pushes.point[i], pushes.position[i])
            place = place_of(tree, pushes.position[i])
            j = pushes.link[i]
            while j >= 0:
                along_x, along_z = velocity_at(tree.motion, j, place)
                turned = x * along_z - z * along_x
                k = j
                while k >= 0:
                    slopes[j, k] += tree.motion[k, 0] * turned
                    if k != j:
                        slopes[k, j] += tree.motion[k, 0] * turned
                    k = model.parent[k]
                j = model.parent[j]
