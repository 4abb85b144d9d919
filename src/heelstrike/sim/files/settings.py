"""Methods and their laws as attributes of a file: frozen dataclasses, field by field."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from typing import Any

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.contact.ground_shape import GroundShape
from heelstrike.errors import HeelstrikeError
from heelstrike.robot.robot import Robot
from heelstrike.sim.compliant.contact_law import (
    BristleFriction,
    HuntCrossley,
    KelvinVoigt,
    RegularisedFriction,
)
from heelstrike.sim.compliant.method import Compliant
from heelstrike.sim.contacts.constraint import Constraint, constrained
from heelstrike.sim.event_driven.method import EventDriven
from heelstrike.sim.files.variables import DamageError, Stored
from heelstrike.sim.method import Method, UnknownMethod
from heelstrike.sim.time_stepping.method import TimeStepping

METHODS = {kind.__name__: kind for kind in (TimeStepping, EventDriven, Compliant)}
LAWS = {
    kind.__name__: kind
    for kind in (HuntCrossley, KelvinVoigt, RegularisedFriction, BristleFriction)
}
NONE = "none"
"""How a setting that is None is written, for NetCDF has no such attribute."""

_PLAIN = (str, int, float, enum.Enum, np.bool_, np.number)


def settings(prefix: str, thing: Any) -> dict[str, str | int | float]:
    """Return fields of a frozen dataclass as attributes: dataclasses with their own."""
    if isinstance(thing, UnknownMethod):
        return {f"{prefix}_{name}": value for name, value in thing.settings.items()}
    found: dict[str, str | int | float] = {}
    for field in fields(thing) if is_dataclass(thing) else ():
        name, value = f"{prefix}_{field.name}", getattr(thing, field.name)
        if is_dataclass(value):
            found |= {name: type(value).__name__, **settings(name, value)}
        else:
            found[name] = _plain(value)
    return found


def shape_settings(ground: Ground) -> dict[str, str | int | float]:
    """Return name and settings of the shape of a smooth ground as attributes."""
    if ground.shape is None:
        return {}
    return {"ground_shape": type(ground.shape).__name__, **settings("ground_shape", ground.shape)}


def shaped(ground: Ground, stored: Stored, classes: Mapping[str, type]) -> Ground:
    """Return the ground of a file with its shape, which is of a class from outside.

    Raises
    ------
    DamageError
        If the class is not given, or its settings are missing or cannot be.
    """
    if "@ground_shape" not in stored.contents:
        return ground
    name = stored.text("ground_shape")
    kind = classes.get(name)
    if kind is None or not issubclass(kind, GroundShape):
        raise UnknownClassError("on ground of the shape", name)
    return replace(ground, shape=_rebuilt(stored, "ground_shape", kind, classes))


def constraint_settings(robot: Robot) -> dict[str, str | int | float]:
    """Return names and settings of the constraints that hold a robot as attributes."""
    found: dict[str, str | int | float] = {}
    for i, each in enumerate(robot.constraints):
        name = f"constraint_{i}"
        found |= {name: type(each).__name__, **settings(name, each)}
    return found


def held(robot: Robot, stored: Stored, classes: Mapping[str, type]) -> Robot:
    """Return the robot of a file with the constraints of its run, of classes from outside.

    Raises
    ------
    DamageError
        If a class is not given, or its settings are missing or cannot be.
    """
    found: list[Any] = []
    while f"@constraint_{len(found)}" in stored.contents:
        prefix = f"constraint_{len(found)}"
        name = stored.text(prefix)
        kind = classes.get(name)
        if kind is None or not issubclass(kind, Constraint):
            raise UnknownClassError("with the constraint", name)
        found.append(_rebuilt(stored, prefix, kind, classes))
    return constrained(robot, *found) if found else robot


class UnknownClassError(HeelstrikeError):
    """A run is one with something of a class that is not known here."""

    def __init__(self, what: str, name: str) -> None:
        super().__init__(
            f"the run was made {what} {name[:60]!r}, a class of somebody's that is not known here: "
            f"load_run(path, classes=[{name[:60]}])"
        )


def _plain(value: Any) -> str | int | float:
    if value is None:
        return NONE
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, bool | np.bool_):
        return int(value)  # NetCDF knows no truth values either
    return value if isinstance(value, str | int) else float(value)


def unreadable(thing: Any) -> str:
    """Say why a method, or a law of it, could not be made again of its settings; or nothing."""
    if isinstance(thing, UnknownMethod):
        return ""
    kind: Any = type(thing)
    if not getattr(getattr(kind, "__dataclass_params__", None), "frozen", False):
        return f"{kind.__name__} is not a frozen dataclass"
    if (METHODS | LAWS).get(kind.__name__, kind) is not kind:
        return f"heelstrike has a {kind.__name__} of its own; call it something else"
    for field in fields(thing):
        value = getattr(thing, field.name)
        if is_dataclass(value):
            if reason := unreadable(value):
                return reason
        elif value is not None and not isinstance(value, _PLAIN):
            return f"its setting {field.name} is neither number nor text, but {value!r}"
    return ""


class _UnknownLawError(Exception):
    """A method has a law that is not known."""


def stored_method(stored: Stored, classes: Mapping[str, type]) -> Method | UnknownMethod:
    """Make the method of a file, perhaps of a class from outside.

    Of one that is not known, or whose laws are not, return what is told.

    Raises
    ------
    DamageError
        If its settings are missing or cannot be.
    """
    name = stored.text("method")
    if not name.isidentifier():
        raise DamageError(f"the method is called {name[:60]!r}")
    kinds = {**classes, **METHODS, **LAWS}
    kind = kinds.get(name)
    try:
        if kind is not None and issubclass(kind, Method):
            made: Method = _rebuilt(stored, "method", kind, kinds)
            return made
    except _UnknownLawError:
        pass
    begin = "@method_"
    names = (key.removeprefix(begin) for key in stored.contents if key.startswith(begin))
    return UnknownMethod(
        name=name,
        settings={setting: stored.plain(f"method_{setting}") for setting in names},
        impulses_in_events="@impulses_in_events" in stored.contents
        and stored.count("impulses_in_events") != 0,
    )


def _rebuilt(stored: Stored, prefix: str, kind: Any, kinds: Mapping[str, type]) -> Any:
    """Make a frozen dataclass from its fields, as :func:`settings` wrote them."""
    # A setting that did not exist when the file was written has its default.
    values = {
        field.name: _setting(stored, f"{prefix}_{field.name}", field, kinds)
        for field in fields(kind)
        if field.init and (f"@{prefix}_{field.name}" in stored.contents or field.default is MISSING)
    }
    try:
        return kind(**values)
    except HeelstrikeError as error:
        raise DamageError(str(error)) from error
    except Exception as error:  # a setting that may not be None; what a class from outside says
        raise DamageError(f"the settings of {prefix} do not fit: {error}") from error


def _setting(stored: Stored, name: str, field: Field[Any], kinds: Mapping[str, type]) -> Any:
    default = field.default
    told = stored.contents.get(f"@{name}")
    if told is not None and told.dtype.kind == "U" and str(told) == NONE:
        return None
    if field.default_factory is not MISSING or is_dataclass(default):
        law = stored.text(name)
        if law not in kinds:
            raise _UnknownLawError
        return _rebuilt(stored, name, kinds[law], kinds)
    if isinstance(default, enum.Enum):
        return stored.member(name, {member.name.lower(): member for member in type(default)})
    if isinstance(default, bool):
        return stored.count(name) != 0
    if isinstance(default, str):
        return stored.text(name)
    return stored.number(name) if isinstance(default, float) else stored.plain(name)
