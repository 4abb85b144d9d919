"""Laws that were measured on a record, and how badly each was broken where."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True)
class Objection:
    """A law that a record breaks.

    Attributes
    ----------
    law : str
        What was broken.
    size, tolerance : float
        How far, and how far it might have been.
    time : float
        When it was worst (s).
    where : str
        The contact or joint, empty if it is the whole robot.
    count : int
        Rows and places in which it was broken.
    """

    law: str
    size: float
    tolerance: float
    time: float
    where: str
    count: int


@dataclass
class Findings:
    """The worst of every law that was looked at, objections, and other figures of a record."""

    worst: dict[str, float] = field(default_factory=dict)
    objections: list[Objection] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)

    def look(
        self, law: str, broken: Array, tolerance: float, time: Array, names: tuple[str, ...] = ()
    ) -> None:
        """Look at how far a law is broken, row by row (T,) or row by row and place (T, p).

        What is not a number is broken beyond measure.
        """
        if broken.size == 0:
            return
        broken = np.where(np.isnan(broken), np.inf, broken)
        place = np.unravel_index(int(np.argmax(broken)), broken.shape)
        size = max(float(broken[place]), 0.0)
        self.worst[law] = max(size, self.worst.get(law, 0.0))
        if size > tolerance:
            where = names[place[1]] if broken.ndim == 2 and names else ""
            count = int(np.sum(broken > tolerance))
            one = Objection(law, size, tolerance, float(time[place[0]]), where, count)
            self._object(one)

    def _object(self, new: Objection) -> None:
        """Keep one objection a law: the worst, with all places counted."""
        for i, old in enumerate(self.objections):
            if old.law == new.law:
                worse = new if new.size > old.size else old
                self.objections[i] = replace(worse, count=old.count + new.count)
                return
        self.objections.append(new)

    def renew(self, laws: Collection[str], other: Findings) -> None:
        """Take what is said of some laws from another look at the same."""
        kept = [one for one in self.objections if one.law not in laws]
        self.objections = kept + [one for one in other.objections if one.law in laws]
        self.worst |= {law: size for law, size in other.worst.items() if law in laws}

    def take(self, other: Findings) -> None:
        """Take all that was found of another part of the same record."""
        for law, size in other.worst.items():
            self.worst[law] = max(size, self.worst.get(law, 0.0))
        for one in other.objections:
            self._object(one)
        for name, size in other.figures.items():
            self.figures[name] = max(size, self.figures.get(name, 0.0))

    def broken(self) -> tuple[str, ...]:
        """Names of the laws that were broken."""
        return tuple(dict.fromkeys(one.law for one in self.objections))

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers and text."""
        return {
            "worst": self.worst,
            "objections": [asdict(one) for one in self.objections],
            "figures": self.figures,
        }
