"""What a controller told of itself, in datasets and files.

Its arrays are variables ``log_<name>``; what their shapes are called, their units and what they are
is the text of one attribute, so that a file says it all and reading it executes nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from heelstrike.sim.files.variables import DamageError, Stored, Variable
from heelstrike.sim.run import AnyRun, Logged

PREFIX = "log_"

Extents = Mapping[str | int, str]
"""What datasets call the extents of arrays."""


def dimensions(name: str, extents: tuple[str | int, ...], known: Extents) -> tuple[str, ...]:
    """Return what the dimensions of a logged array are called: the robot's, or its own."""
    own = (f"{PREFIX}{name}_{place}" for place in range(len(extents)))
    return tuple(known.get(each, mine) for each, mine in zip(extents, own, strict=True))


def log_variables(run: AnyRun, known: Extents) -> dict[str, Any]:
    """Return the log of a run as a dataset takes it."""
    return {
        PREFIX + name: _variable(
            dimensions(name, each.extents, known), each.unit, each.label, _kind(each)
        ).written(each.values)
        for name, each in run.log.items()
    }


def log_attribute(run: AnyRun) -> dict[str, str]:
    """Return what a file has to tell of a log."""
    told = {
        name: [_kind(each).__name__, each.unit, each.label, list(each.extents)]
        for name, each in run.log.items()
    }
    return {"log": json.dumps(told)} if told else {}


def stored_log(stored: Stored, sizes: dict[str, int], known: Extents) -> Mapping[str, Logged]:
    """Return the log in a file, none of one that has none.

    Raises
    ------
    DamageError
        If something is missing or cannot be.
    """
    if "@log" not in stored.contents:
        return {}
    try:
        told = json.loads(stored.text("log"))
        declared = {
            str(name): (str(unit), str(label), tuple(map(str, extents)), kind)
            for name, (kind, unit, label, extents) in told.items()
        }
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise DamageError(f"what is told of the log cannot be read: {error}") from error
    found = {}
    for name, (unit, label, extents, kind) in declared.items():
        if kind not in ("float", "int"):
            raise DamageError(f"the log {name!r} holds {kind!r}, neither int nor float")
        dims = dimensions(name, extents, known)
        variable = _variable(dims, unit, label, int if kind == "int" else float)
        (values,) = stored.arrays({PREFIX + name: variable}, sizes).values()
        found[name] = Logged(values, unit, label, extents)
    return found


def _variable(dims: tuple[str, ...], unit: str, label: str, kind: type) -> Variable:
    return Variable(("time", *dims), unit, label, kind, allowed="anything")


def _kind(logged: Logged) -> type:
    return int if logged.values.dtype.kind == "i" else float
