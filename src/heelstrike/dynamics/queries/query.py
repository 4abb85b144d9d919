"""Queries: what can be asked of a robot in a state, each written once for numbers and symbols.

A query is a function of an :class:`~heelstrike.dynamics.queries.evaluation.AnyEvaluation`. The
decorators here make the function of (robot, q, …) of it that people call, with its documentation.
What its first argument is annotated with says of which robots it is asked: of all, or of those of
the plane or of space alone. A query that is another in space gets a second function there, by
``in_space``; as :func:`functools.singledispatch` does, the class of the evaluation chooses.
:func:`of_space` makes of a query the one of robots in space alone, described as it is there. Its
``at`` is that choice, which :mod:`heelstrike.dynamics.queries.symbolic` and
:mod:`heelstrike.dynamics.queries.casadi_functions` ask over symbols.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from functools import singledispatch, update_wrapper
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

from numpy.typing import ArrayLike

from heelstrike.arguments import refusal
from heelstrike.dynamics.queries.evaluation import (
    AnyEvaluation,
    evaluation_in_space,
    evaluation_of,
)
from heelstrike.errors import RobotError
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot

P = ParamSpec("P")
Q = ParamSpec("Q")
Result = TypeVar("Result", covariant=True)
Other = TypeVar("Other")
At = TypeVar("At", bound=AnyEvaluation)
Asked = TypeVar("Asked", bound="Query[..., Any]")

VECTORS = {
    "q": "nq", "v": "nv", "end": "nq", "acceleration": "nv", "force": "nv", "torque": "nu",
}  # fmt: skip
"""Arguments that are vectors, and how long they are."""

_ARGUMENTS: dict[str, tuple[str, str]] = {
    "robot": ("Robot or SpatialRobot", "The robot."),
    "q": ("(nq,) array", "Position, in m and rad, in the order of ``robot.position_names``."),
    "v": ("(nv,) array", "Velocity, in m/s and rad/s, in the order of ``robot.velocity_names``."),
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
    def at(self) -> Callable[Concatenate[Any, P], Result]:
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

    def in_space(
        self, returns: str
    ) -> Callable[[Callable[Concatenate[At, Q], Other]], OfPosition[Q, Other]]:
        """Give it another function in space, and its answer; return it :func:`of_space`."""


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

    def in_space(
        self, returns: str
    ) -> Callable[[Callable[Concatenate[At, Q], Other]], OfState[Q, Other]]:
        """Give it another function in space, and its answer; return it :func:`of_space`."""


def of_position(
    returns: str,
) -> Callable[[Callable[Concatenate[At, P], Result]], OfPosition[P, Result]]:
    """Make a query of a position (and more); `returns` says in what shape, unit and frame."""

    def query(body: Callable[Concatenate[At, P], Result]) -> OfPosition[P, Result]:
        ask = _asked(body)

        def answer(
            robot: Robot | SpatialRobot, q: ArrayLike, *others: P.args, **named: P.kwargs
        ) -> Result:
            found: Result = ask(evaluation_of(robot)(robot, q), *others, **named)
            return found

        return _described(answer, ask, returns)

    return query


def of_state(
    returns: str,
) -> Callable[[Callable[Concatenate[At, P], Result]], OfState[P, Result]]:
    """Make a query of a position and a velocity; see :func:`of_position`."""

    def query(body: Callable[Concatenate[At, P], Result]) -> OfState[P, Result]:
        ask = _asked(body)

        def answer(
            robot: Robot | SpatialRobot,
            q: ArrayLike,
            v: ArrayLike,
            *others: P.args,
            **named: P.kwargs,
        ) -> Result:
            found: Result = ask(evaluation_of(robot)(robot, q, v), *others, **named)
            return found

        return _described(answer, ask, returns)

    return query


def of_space(query: Asked, returns: str | None = None) -> Asked:
    """Make of a query the one of robots in space alone, with the text of its function there.

    Parameters
    ----------
    query : query
        The query, of all robots.
    returns : str, optional
        Shape, unit and frame of the answer in space, if they are others.

    Returns
    -------
    query
        It refuses other robots.
    """
    known: Any = query

    def answer(robot: SpatialRobot, *others: Any, **named: Any) -> Any:
        if not isinstance(robot, SpatialRobot):
            raise RobotError(refusal("robot", robot, (SpatialRobot.__name__,)))
        return known(robot, *others, **named)

    update_wrapper(answer, known)
    own: Any = answer  # `at` and the signature came along
    own.returns = returns or query.returns
    in_space = inspect.getdoc(known.at.dispatch(evaluation_in_space())) or ""
    own.__doc__ = _docstring(in_space, known.__signature__.parameters, own.returns)
    result: Asked = own
    return result


def _asked(body: Callable[..., Any]) -> Any:
    """Return what chooses a function by the class of the evaluation, to begin with this one."""

    def refuse(at: AnyEvaluation, *_: Any, **__: Any) -> Any:
        (known,) = {kind.where for kind in ask.registry if kind is not object}
        raise RobotError(
            f"{body.__name__} is asked of robots {known}; {at.robot.name!r} is one {at.where}, of "
            "which heelstrike does not know it yet."
        )

    ask: Any = singledispatch(refuse)
    ask.register(body)
    return update_wrapper(ask, body)


def _described(answer: Any, ask: Any, returns: str) -> Any:
    """Give an answer the name, signature and documentation of its question."""

    def in_space(returns: str) -> Callable[[Callable[..., Any]], Any]:
        def query(body: Callable[..., Any]) -> Any:
            ask.register(body)
            return of_space(answer, returns)

        return query

    first, own = inspect.signature(answer), inspect.signature(ask)
    names = [one for one in first.parameters.values() if one.kind == one.POSITIONAL_OR_KEYWORD]
    signature = own.replace(parameters=[*names, *list(own.parameters.values())[1:]])
    summary = inspect.getdoc(ask) or ""
    update_wrapper(answer, ask)
    answer.__signature__, answer.at, answer.returns = signature, ask, returns
    answer.in_space = in_space
    answer.__doc__ = _docstring(summary, signature.parameters, returns)
    return answer


def _docstring(summary: str, names: Iterable[str], returns: str) -> str:
    shape, _, meaning = returns.partition(": ")
    return docstring(summary, names, shape, meaning)


def docstring(summary: str, names: Iterable[str], returned: str, meaning: str) -> str:
    """Return the documentation of a function that takes arguments of queries."""
    text = [summary, "", "Parameters", "----------"] if names else [summary]
    for name in names:
        kind, words = _ARGUMENTS[name]
        text += [f"{name} : {kind}", f"    {words}"]
    text += ["", "Returns", "-------", returned, f"    {meaning}"]
    if names:
        text += ["", "Raises", "------", "RobotError", f"    {_RAISES}"]
    return "\n".join(text)
