"""What public functions are called with, looked at before anything is computed from it.

A function says in its annotations what it takes. What is clearly another thing (a name for a robot,
a text for a number, nothing for a state) is refused here by those same annotations, in words;
whether a number is one that can be meant is for the function to say. Of annotations that name
protocols, or what is not listed here, anything passes.
"""

from __future__ import annotations

import enum
import functools
import inspect
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from numbers import Integral, Real
from typing import Any, ParamSpec, TypeVar

import numpy as np

from heelstrike.errors import HeelstrikeError

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_Member = TypeVar("_Member", bound=enum.Enum)

NUMBERS = "iuf"
"""Kinds of arrays that are numbers."""

INSTEAD = {
    "Robot": "hs.load_robot(...) makes one",
    "SpatialRobot": "hs.load_robot(file, dimension=3) makes one",
    "Gait": "hs.optimize_gait(robot, ...) or hs.load_gait(file, robot=robot) makes one",
    "PhasedGait": "hs.PhasedGait.from_gait(robot, gait) makes one",
    "StepFamily": "hs.StepFamily.around(phased_gait) makes one",
    "Encoder": "hs.Encoder() makes one",
    "State": "hs.State(q, v), robot.state({...}) or gait.initial_state makes one",
    "Ground": "hs.Ground(friction=0.75) makes one",
    "Push": "hs.Push(link, force=(fx, fz), start=..., duration=...) makes one",
    "Trial": "hs.Trial(robot=..., controller=..., state=...) makes one",
    "Run": "hs.simulate(...) or hs.load_run(file) makes one",
}
"""How to come by what is wanted, by the name of its class."""

OURS = {*INSTEAD, "Snapshot", "Simulation", "ActiveContacts", "Encoders", "InertialUnit"} | {
    "FootSensors", "Solver", "ForceDistribution", "Bundle"
}  # fmt: skip
"""Classes of ours that an annotation may name."""


def is_number(value: object) -> bool:
    """Whether a value is one real number."""
    if isinstance(value, np.ndarray):
        return value.size == 1 and value.dtype.kind in NUMBERS
    return isinstance(value, Real) and not isinstance(value, (bool, np.bool_))


def _is_whole(value: object) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)


def are_numbers(value: object) -> bool:
    """Whether numpy makes an array of real numbers of a value."""
    try:
        return np.asarray(value).dtype.kind in NUMBERS + "b"
    except (ValueError, TypeError):  # rows of different lengths
        return False


def _is_several(value: object) -> bool:
    return isinstance(value, (Sequence, np.ndarray)) and not isinstance(value, (str, bytes))


def _are_items(value: object) -> bool:
    one = isinstance(value, str) or _is_whole(value)  # one name or index, too
    return one or (isinstance(value, Iterable) and not isinstance(value, bytes))


_KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "float": ("a number", is_number),
    "int": ("a whole number", _is_whole),
    "bool": ("True or False", lambda value: isinstance(value, (bool, np.bool_))),
    "str": ("a text", lambda value: isinstance(value, str)),
    "None": ("None", lambda value: value is None),
    "ArrayLike": ("numbers", are_numbers),
    "NDArray": ("numbers", are_numbers),
    "Floats": ("numbers", are_numbers),
    "Path": ("a path", lambda value: isinstance(value, os.PathLike)),
    "PathLike": ("a path", lambda value: isinstance(value, os.PathLike)),
    "Mapping": ("a mapping", lambda value: isinstance(value, Mapping)),
    "Sequence": ("a sequence", _is_several),
    "Iterable": ("a sequence", _are_items),
    "Callable": ("a function", callable),
}
"""What an annotation means in words, and whether a value is that."""


def takes(
    error: type[HeelstrikeError],
) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]:
    """Make a function refuse arguments that are not what its annotations say.

    Parameters
    ----------
    error : type
        What it raises then.
    """

    def decorate(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
        signature = inspect.signature(function)
        wanted = {
            name: kinds
            for name, each in signature.parameters.items()
            if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
            and (kinds := _kinds(each.annotation))
        }

        in_turn = [
            name
            for name, each in signature.parameters.items()
            if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)
        ]

        @functools.wraps(function)
        def checked(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Result:
            given = (*zip(in_turn, args, strict=False), *kwargs.items())
            if not all(_is_any(value, wanted[name]) for name, value in given if name in wanted):
                refuse(*args, **kwargs)
            return function(*args, **kwargs)

        def refuse(*args: Any, **kwargs: Any) -> None:
            try:
                given = signature.bind(*args, **kwargs).arguments
            except TypeError:  # too many, too few, unknown: Python's own words come with the call
                return
            for name, kinds in wanted.items():
                if name in given and not _is_any(given[name], kinds):
                    raise error(refusal(name, given[name], kinds))

        return checked

    return decorate


def check_fields(instance: Any, error: type[HeelstrikeError]) -> None:
    """Refuse members of a dataclass that are not what its annotations say.

    Parameters
    ----------
    instance : object
        The dataclass, as it is made.
    error : type
        What is raised then.
    """
    kind: Any = type(instance)
    for name, kinds in _wanted(kind).items():
        if not _is_any(value := getattr(instance, name), kinds):
            raise error(refusal(name, value, kinds))


def one_of(kind: type[_Member], name: str, value: object, error: type[HeelstrikeError]) -> _Member:
    """Return the member of a closed set that an argument is, or names by its value.

    Parameters
    ----------
    kind : type
        The set.
    name : str
        What the argument is called.
    value : object
        The argument.
    error : type
        What is raised if it is no such thing.
    """
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(repr(each.value) for each in kind)
        raise error(f"{name} must be one of {known}, got {value!r}") from None


def positive(name: str, value: object, error: type[HeelstrikeError], unit: str = "") -> float:
    """Return the positive, finite number that an argument is.

    Parameters
    ----------
    name : str
        What the argument is called.
    value : object
        The argument.
    error : type
        What is raised if it is no such number.
    unit : str
        Of what it is a number, as in "m".
    """
    number: Any = value
    if not (is_number(value) and np.ndim(number) == 0 and 0.0 < number < np.inf):
        of = f" ({unit})" if unit else ""
        raise error(f"{name} must be a positive number{of}, got {value!r}")
    return float(number)


@functools.cache
def _wanted(dataclass: Any) -> dict[str, tuple[str, ...]]:
    return {
        each.name: kinds for each in fields(dataclass) if each.init and (kinds := _kinds(each.type))
    }


def _kinds(annotation: Any) -> tuple[str, ...]:
    """Alternatives of an annotation, by names in `_KINDS` and `OURS`; none if one is unknown."""
    if not isinstance(annotation, str):
        return ()
    plain = annotation
    while "[" in plain:  # from within, what is in brackets goes
        inner = re.sub(r"\[[^\[\]]*\]", "", plain)
        if inner == plain:
            return ()
        plain = inner
    names = tuple(each.strip().rpartition(".")[2] for each in plain.split("|"))
    if not all(name in _KINDS or name in OURS for name in names):
        return ()
    return names


def refusal(name: str, value: object, kinds: Sequence[str]) -> str:
    """Say that an argument is none of what is wanted, what was given, and what makes one."""
    makes = next((INSTEAD[kind] for kind in kinds if kind in INSTEAD), "")
    if "Robot" in kinds and type(value).__name__ == "SpatialRobot":
        makes = "this is for the plane: hs.load_robot(file, dimension=2) makes one"
    if "Run" in kinds and type(value).__name__ == "SpatialRun":
        makes = "this is for runs in the plane"
    advice = f"; {makes}" if makes else ""
    return f"{name} must be {_words(kinds)}, got {shown(value)}{advice}"


def _is_any(value: object, kinds: Sequence[str]) -> bool:
    own: Any = type(value)
    names = _names(own)
    return any(_KINDS[kind][1](value) if kind in _KINDS else kind in names for kind in kinds)


@functools.lru_cache
def _names(kind: Any) -> frozenset[str]:
    """Names of a class and of all that it is one of."""
    return frozenset(each.__name__ for each in kind.__mro__)


def _words(kinds: Sequence[str]) -> str:
    """What is wanted: ``a Robot``, ``a number or None``."""

    def words(kind: str) -> str:
        if kind in _KINDS:
            return _KINDS[kind][0]
        return f"{'an' if kind[0] in 'AEIOU' else 'a'} {kind}"

    several = list(dict.fromkeys(words(kind) for kind in kinds))
    return " or ".join(filter(None, (", ".join(several[:-1]), several[-1])))


def shown(value: object) -> str:
    """Write what was given, with its kind, in a line."""
    text = " ".join(repr(value).split())
    short = text if len(text) <= 60 else f"{text[:57]}..."
    return f"{short} ({type(value).__name__})"


def at_least(value: float, digits: int = 4) -> str:
    """Write a positive number rounded up: whoever asks for what is written asks for enough."""
    return _rounded(value, digits, ROUND_CEILING)


def at_most(value: float, digits: int = 4) -> str:
    """Write a positive number rounded down: whoever asks for what is written asks for no more."""
    return _rounded(value, digits, ROUND_FLOOR)


def _rounded(value: float, digits: int, way: str) -> str:
    return f"{float(Context(prec=digits, rounding=way).create_decimal_from_float(value)):g}"
