"""Queries: what can be asked of a robot in a state, each written once for numbers and symbols.

A query is a function of an :class:`~heelstrike.dynamics.queries.evaluation.Evaluation`. The
decorators here make the function of (robot, q, …) of it that people call, with its documentation,
which hands a robot in space on to the query of that name in :mod:`heelstrike.dynamics.spatial`; its
``at`` is the query itself, which :mod:`heelstrike.dynamics.queries.symbolic` and
:mod:`heelstrike.dynamics.queries.casadi_functions` ask over symbols.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterable
from functools import update_wrapper
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

from numpy.typing import ArrayLike

from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.errors import RobotError
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot

P = ParamSpec("P")
Result = TypeVar("Result", covariant=True)

VECTORS = {
    "q": "nq", "v": "nv", "end": "nq", "acceleration": "nv", "force": "nv", "torque": "nu",
}  # fmt: skip
"""Arguments that are vectors, and how long they are."""

Arguments = dict[str, tuple[str, str]]
"""Of every argument its type and what it is."""

_ARGUMENTS: Arguments = {
    "robot": ("Robot or SpatialRobot", "The robot."),
    "q": ("(nq,) array", "Position, in m and rad, in the order of ``robot.joint_names``."),
    "v": ("(nv,) array", "Velocity, in m/s and rad/s."),
    "time": ("float", "How long, in s."),
    "end": ("(nq,) array", "Another position."),
    "acceleration": ("(nv,) array", "Rate of the velocity, in m/s² and rad/s²."),
    "force": ("(nv,) array", "Generalised force, in N and N m."),
    "torque": ("(nu,) array", "Torques or forces of the motors, as ``robot.actuator_names``."),
    "link": ("int or str", "Link, by its index or the name of its body."),
    "local": ("(2,) array", "Place (x, z), in space (x, y, z), of the point on its link, in m."),
    "contacts": ("iterable of int or str, optional", "Contact points, all k = nc by default."),
}
_RAISES = "If the robot has no such link or contact point, or a vector has the wrong length."


class Query(Protocol[P, Result]):
    """What can be asked of a robot in a state."""

    @property
    def at(self) -> Callable[Concatenate[Evaluation, P], Result]:
        """The question, asked of an evaluation."""

    @property
    def returns(self) -> str:
        """Shape, unit and frame of the answer."""


class OfPosition(Query[P, Result], Protocol[P, Result]):
    """A query of a position."""

    def __call__(
        self, robot: Robot | SpatialRobot, q: ArrayLike, *others: P.args, **named: P.kwargs
    ) -> Result:
        """Answer it."""


class OfState(Query[P, Result], Protocol[P, Result]):
    """A query of a position and a velocity."""

    def __call__(
        self,
        robot: Robot | SpatialRobot,
        q: ArrayLike,
        v: ArrayLike,
        *others: P.args,
        **named: P.kwargs,
    ) -> Result:
        """Answer it."""


def of_position(
    returns: str,
) -> Callable[[Callable[Concatenate[Evaluation, P], Result]], OfPosition[P, Result]]:
    """Make a query of a position (and more); `returns` says in what shape, unit and frame."""

    def query(body: Callable[Concatenate[Evaluation, P], Result]) -> OfPosition[P, Result]:
        def answer(
            robot: Robot | SpatialRobot, q: ArrayLike, *others: P.args, **named: P.kwargs
        ) -> Result:
            if isinstance(robot, SpatialRobot):
                return in_space(body.__name__, robot)(robot, q, *others, **named)
            return body(Evaluation(robot, q), *others, **named)

        return described_answer(answer, body, returns)

    return query


def of_state(
    returns: str,
) -> Callable[[Callable[Concatenate[Evaluation, P], Result]], OfState[P, Result]]:
    """Make a query of a position and a velocity; see :func:`of_position`."""

    def query(body: Callable[Concatenate[Evaluation, P], Result]) -> OfState[P, Result]:
        def answer(
            robot: Robot | SpatialRobot,
            q: ArrayLike,
            v: ArrayLike,
            *others: P.args,
            **named: P.kwargs,
        ) -> Result:
            if isinstance(robot, SpatialRobot):
                return in_space(body.__name__, robot)(robot, q, v, *others, **named)
            return body(Evaluation(robot, q, v), *others, **named)

        return described_answer(answer, body, returns)

    return query


def in_space(name: str, robot: SpatialRobot) -> Callable[..., Any]:
    """Return the query of that name about robots in space, which are not imported before.

    Raises
    ------
    RobotError
        If it is one of the plane alone.
    """
    questions = importlib.import_module("heelstrike.dynamics.spatial")
    if not hasattr(questions, name):
        raise RobotError(
            f"{name} is asked of robots of the plane; {robot.name!r} is one of space, of which "
            "heelstrike does not know it yet."
        )
    question: Callable[..., Any] = getattr(questions, name)
    return question


def described_answer(
    answer: Any, body: Callable[..., Any], returns: str, arguments: Arguments = _ARGUMENTS
) -> Any:
    """Give an answer the name, signature and documentation of its question."""
    first, own = inspect.signature(answer), inspect.signature(body)
    names = [one for one in first.parameters.values() if one.kind == one.POSITIONAL_OR_KEYWORD]
    signature = own.replace(parameters=[*names, *list(own.parameters.values())[1:]])
    update_wrapper(answer, body)
    answer.__signature__, answer.at, answer.returns = signature, body, returns
    shape, _, meaning = returns.partition(": ")
    summary = inspect.getdoc(body) or ""
    answer.__doc__ = docstring(summary, signature.parameters, shape, meaning, arguments)
    return answer


def docstring(
    summary: str,
    names: Iterable[str],
    returned: str,
    meaning: str,
    arguments: Arguments = _ARGUMENTS,
) -> str:
    """Return the documentation of a function that takes arguments of queries."""
    text = [summary, "", "Parameters", "----------"] if names else [summary]
    for name in names:
        kind, words = arguments[name]
        text += [f"{name} : {kind}", f"    {words}"]
    text += ["", "Returns", "-------", returned, f"    {meaning}"]
    if names:
        text += ["", "Raises", "------", "RobotError", f"    {_RAISES}"]
    return "\n".join(text)
