"""How a question about a robot in space becomes the function of (robot, q, …) that people call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

from numpy.typing import ArrayLike

from heelstrike.dynamics.queries.query import Arguments, described_answer
from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation
from heelstrike.robot.spatial.robot import SpatialRobot

P = ParamSpec("P")
Result = TypeVar("Result", covariant=True)

_ARGUMENTS: Arguments = {
    "robot": ("SpatialRobot", "The robot."),
    "q": ("(nq,) array", "Position, in the order of ``robot.position_names``."),
    "v": ("(nv,) array", "Velocity, in the order of ``robot.velocity_names``."),
    "time": ("float", "How long, in s."),
    "end": ("(nq,) array", "Another position."),
    "acceleration": ("(nv,) array", "Rate of the velocity, in m/s² and rad/s²."),
    "force": ("(nv,) array", "Generalised force, in N and N m."),
    "torque": ("(nu,) array", "Torques or forces of the motors, as ``robot.actuator_names``."),
    "link": ("int or str", "Link, by its index or the name of its body."),
    "local": ("(3,) array", "Place (x, y, z) of the point in the axes of its link, in m."),
    "contacts": ("iterable of int or str, optional", "Contact points, all k = nc by default."),
}


class SpatialQuery(Protocol[P, Result]):
    """What can be asked of a robot in space in a state."""

    @property
    def at(self) -> Callable[Concatenate[SpatialEvaluation, P], Result]:
        """The question, asked of an evaluation."""


class OfSpatialPosition(SpatialQuery[P, Result], Protocol[P, Result]):
    """A query of a position."""

    def __call__(
        self, robot: SpatialRobot, q: ArrayLike, *others: P.args, **named: P.kwargs
    ) -> Result:
        """Answer it."""


class OfSpatialState(SpatialQuery[P, Result], Protocol[P, Result]):
    """A query of a position and a velocity."""

    def __call__(
        self, robot: SpatialRobot, q: ArrayLike, v: ArrayLike, *others: P.args, **named: P.kwargs
    ) -> Result:
        """Answer it."""


def of_position(
    returns: str,
) -> Callable[[Callable[Concatenate[SpatialEvaluation, P], Result]], OfSpatialPosition[P, Result]]:
    """Make a query of a position (and more); `returns` says in what shape, unit and frame."""

    def query(
        body: Callable[Concatenate[SpatialEvaluation, P], Result],
    ) -> OfSpatialPosition[P, Result]:
        def answer(robot: SpatialRobot, q: ArrayLike, *others: P.args, **named: P.kwargs) -> Result:
            return body(SpatialEvaluation(robot, q), *others, **named)

        made: Any = described_answer(answer, body, returns, _ARGUMENTS)
        return made

    return query


def of_state(
    returns: str,
) -> Callable[[Callable[Concatenate[SpatialEvaluation, P], Result]], OfSpatialState[P, Result]]:
    """Make a query of a position and a velocity; see :func:`of_position`."""

    def query(
        body: Callable[Concatenate[SpatialEvaluation, P], Result],
    ) -> OfSpatialState[P, Result]:
        def answer(
            robot: SpatialRobot, q: ArrayLike, v: ArrayLike, *others: P.args, **named: P.kwargs
        ) -> Result:
            return body(SpatialEvaluation(robot, q, v), *others, **named)

        made: Any = described_answer(answer, body, returns, _ARGUMENTS)
        return made

    return query
