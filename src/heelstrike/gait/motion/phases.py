"""Phases that a motion is asked to have, and what holds in each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.arguments import are_numbers
from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot

SHORTEST, LONGEST = 0.02, 3.0
"""Durations (s) between which a phase is looked for where none is asked for."""
PIECES = 6
"""Polynomials of a phase, one after the other."""


@dataclass(frozen=True, init=False)
class ContactPhase:
    """A part of a motion in which the same contact points stand, and neither slide nor lift.

    Examples
    --------
    >>> import heelstrike as hs
    >>> run = [hs.ContactPhase("right_foot"), hs.ContactPhase()]  # stance, then flight
    """

    contacts: tuple[str, ...]
    """Feet, with all of their contact points, or single contact points, by name; none in flight."""
    duration: tuple[float, float]
    """Shortest and longest duration, in s."""
    pieces: int
    """Polynomials of degree 5 that the phase consists of, one after the other."""

    def __init__(
        self, *contacts: str, duration: float | tuple[float, float] = (SHORTEST, LONGEST),
        pieces: int = PIECES,
    ) -> None:  # fmt: skip
        if not all(isinstance(each, str) for each in contacts):
            raise GaitError(
                f"a phase names the feet or contact points that stand, got {contacts!r}"
            )
        given = duration if are_numbers(duration) and not isinstance(duration, bool) else np.nan
        bounds = np.atleast_1d(np.asarray(given, dtype=np.float64))
        bounds = np.repeat(bounds, 2) if bounds.size == 1 else bounds
        if bounds.shape != (2,) or not 0.0 < bounds[0] <= bounds[1] < np.inf:
            raise GaitError(
                "the duration of a phase is a positive number (s), or the shortest and the "
                f"longest, got {duration!r}"
            )
        whole = isinstance(pieces, int | np.integer) and not isinstance(pieces, bool)
        if not whole or not 1 <= pieces <= 200:
            raise GaitError(f"a phase has from 1 to 200 pieces, got {pieces!r}")
        object.__setattr__(self, "contacts", contacts)
        object.__setattr__(self, "duration", (float(bounds[0]), float(bounds[1])))
        object.__setattr__(self, "pieces", int(pieces))


@dataclass(frozen=True)
class Standing:
    """Contact points that stand, and the forces that hold them."""

    points: frozenset[int]
    """The points."""
    normal: tuple[int, ...]
    """Those whose normal forces are unknown: of a foot at most its first and its last."""
    tangent: tuple[int, ...]
    """Those whose tangential forces are unknown: of a foot its first. The ground exerts the same on
    a flat foot however it is shared."""

    @property
    def forces(self) -> list[int]:
        """Places of the unknown forces among (normal, tangent) of all points."""
        return sorted([2 * i for i in self.normal] + [2 * i + 1 for i in self.tangent])


def standing(robot: Robot, points: Sequence[int]) -> Standing:
    """Return which forces hold contact points.

    Parameters
    ----------
    robot : Robot
        The robot.
    points : sequence of int
        The points that stand.
    """
    normal, tangent = [], []
    for link in dict.fromkeys(robot.model.contact_link[list(points)].tolist()):
        of_link = sorted(i for i in points if robot.model.contact_link[i] == link)
        ahead = sorted(of_link, key=lambda i: robot.model.contact_position[i][0])
        normal += sorted({ahead[0], ahead[-1]})
        tangent.append(ahead[0])
    return Standing(frozenset(points), tuple(sorted(normal)), tuple(sorted(tangent)))


def points_of(robot: Robot, phase: ContactPhase) -> tuple[int, ...]:
    """Return the contact points that a phase names.

    Raises
    ------
    GaitError
        If it names something else.
    """
    feet = {foot.name: foot.contacts for foot in robot.feet}
    points: set[int] = set()
    for name in phase.contacts:
        if name in feet:
            points |= set(feet[name])
        elif name in robot.contact_names:
            points.add(robot.contact_names.index(name))
        else:
            known = ", ".join([*feet, *robot.contact_names])
            raise GaitError(
                f"robot {robot.name!r} has no foot or contact point {name!r}; it has {known}"
            )
    return tuple(sorted(points))
