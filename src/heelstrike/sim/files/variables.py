"""What is in a file: variables as they are declared, each looked at as it is asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class DamageError(ValueError):
    """What a file holds cannot be."""


class Variable(NamedTuple):
    """An array of a file.

    Attributes
    ----------
    dims : tuple of str
        Names of its dimensions.
    unit, label : str
        Its unit, and what it is.
    kind : type
        ``float``, ``int`` or ``str``.
    allowed : str
        What its numbers may be that is not finite: ``"infinite"``, ``"anything"`` or nothing.
    default : float, optional
        What files mean that are older than it.
    """

    dims: tuple[str, ...]
    unit: str = ""
    label: str = ""
    kind: type = float
    allowed: str = ""
    default: float | None = None

    def written(self, values: Any) -> tuple[Any, NDArray[Any], dict[str, Any]]:
        """Return it as xarray takes it."""
        array: NDArray[Any] = np.asarray(values, dtype=object if self.kind is str else self.kind)
        told = {"units": self.unit, "long_name": self.label}
        return self.dims, array, {name: words for name, words in told.items() if words}


class Stored:
    """Variables by name, and attributes by their name after an @, read with suspicion.

    Parameters
    ----------
    contents : mapping of str to array
        Numbers and texts, attributes without dimensions.

    Raises
    ------
    DamageError
        By every method, if what is asked for is missing or cannot be.
    """

    def __init__(self, contents: Mapping[str, NDArray[Any]]) -> None:
        self.contents = contents

    def arrays(self, variables: Mapping[str, Variable], sizes: dict[str, int]) -> dict[str, Any]:
        """Return variables, and note the sizes of their dimensions where these are not known."""
        return {name: self._array(name, each, sizes) for name, each in variables.items()}

    def _array(self, name: str, variable: Variable, sizes: dict[str, int]) -> NDArray[Any]:
        shape = [sizes.get(dim) for dim in variable.dims]
        values = self.contents.get(name)
        if values is None and (variable.default is not None or 0 in shape):
            values = np.full([size or 0 for size in shape], variable.default or 0, variable.kind)
        if values is None:
            raise DamageError(f"the variable {name!r} is missing, or holds no numbers")
        if (values.dtype.kind == "U") is not (variable.kind is str):
            held = "numbers, not text" if variable.kind is str else "text, not numbers"
            raise DamageError(f"{name!r} holds {held}")
        known = zip(shape, values.shape, strict=False)
        if values.ndim != len(shape) or any(size not in (None, n) for size, n in known):
            wanted = " × ".join("any" if n is None else str(n) for n in shape)
            found = " × ".join(str(n) for n in values.shape)
            raise DamageError(f"{name!r} has shape {found} instead of {wanted}")
        sizes.update(zip(variable.dims, values.shape, strict=True))
        if variable.kind is str:
            return values
        if variable.kind is int:
            if not np.all((values == np.round(values)) & (np.abs(values) < 2.0**62)):
                raise DamageError(f"{name!r} does not hold whole numbers")
        elif variable.allowed != "anything":
            bad = np.isnan(values) if variable.allowed else ~np.isfinite(values)
            if np.any(bad):
                row = int(np.argwhere(bad)[0][0])
                raise DamageError(f"{name!r} is not finite in row {row}")
        return np.ascontiguousarray(values, dtype=variable.kind)

    def _attribute(self, name: str) -> NDArray[Any]:
        if f"@{name}" not in self.contents:
            raise DamageError(f"the attribute {name!r} is missing, or neither number nor text")
        return self.contents[f"@{name}"]

    def number(self, name: str, default: Any = MISSING) -> float:
        """Return an attribute that is a number, or the default that older files leave it at."""
        if default is not MISSING and f"@{name}" not in self.contents:
            return float(default)
        value = self._attribute(name)
        if value.dtype.kind not in "fi":
            raise DamageError(f"attribute {name!r} is not a number")
        if np.isnan(value):
            raise DamageError(f"attribute {name!r} is NaN")
        return float(value)

    def count(self, name: str, default: Any = MISSING) -> int:
        """Return an attribute that counts something, or the default."""
        value = self.number(name, default)
        if not (0.0 <= value < math.inf and value == round(value)):
            raise DamageError(f"attribute {name!r} is {value:g}, not a count")
        return int(value)

    def text(self, name: str) -> str:
        """Return an attribute that is text."""
        value = self._attribute(name)
        if value.dtype.kind != "U":
            raise DamageError(f"attribute {name!r} is not text")
        return str(value)

    def member(self, name: str, members: Mapping[str, Any]) -> Any:
        """Return the one of several things that an attribute names."""
        value = self.text(name)
        if value not in members:
            shown = value if len(value) <= 60 else value[:57] + "…"
            raise DamageError(f"{name} {shown!r} is unknown; known are {', '.join(members)}")
        return members[value]

    def plain(self, name: str) -> str | int | float:
        """Return an attribute as it was written."""
        kind = self._attribute(name).dtype.kind
        if kind == "U":
            return self.text(name)
        return int(self._attribute(name)) if kind == "i" else self.number(name)
