"""What ties links and joints of a scene together besides its tree; the words are the builder's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Pair = tuple[float, float]


@dataclass(frozen=True)
class Loop:
    """A hinge between two places of two links, by their indices; -1 is the world."""

    link: int
    other: int
    at: Pair
    other_at: Pair


@dataclass(frozen=True)
class Coupling:
    """A joint that follows another, by the indices of their links, along a polynomial."""

    joint: int
    leader: int
    polynomial: tuple[float, ...]


@dataclass(frozen=True)
class Brake:
    """A brake on the joint of a link, which holds up to a limit, from one time (s) to another."""

    joint: int
    limit: float
    on: float
    off: float


@dataclass(frozen=True)
class Latch:
    """An end of the range of a link's joint that holds it, until another link touches down."""

    joint: int
    end: str
    release: int


@dataclass(frozen=True)
class Ties:
    """All that ties a scene together; most have none."""

    loops: tuple[Loop, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    brakes: tuple[Brake, ...] = ()
    latches: tuple[Latch, ...] = ()

    def add_to(self, builder: Any, names: tuple[str, ...]) -> None:
        """Add everything to a robot whose links have these names."""
        for one in self.loops:
            other = None if one.other < 0 else names[one.other]
            builder.loop(names[one.link], other, at=one.at, other_at=one.other_at)
        for follower in self.couplings:
            builder.couple(names[follower.joint], names[follower.leader], follower.polynomial)
        for brake in self.brakes:
            builder.brake(names[brake.joint], limit=brake.limit)
        for latch in self.latches:
            builder.latch(names[latch.joint], latch.end, release=names[latch.release])

    def switched(self) -> tuple[float, ...]:
        """Return the times (s) at which brakes are put on or let go."""
        return tuple(sorted({time for one in self.brakes for time in (one.on, one.off)}))

    def braked(self, time: float, names: tuple[str, ...]) -> list[str]:
        """Return the joints whose brakes are on from a time on."""
        return [names[one.joint] for one in self.brakes if one.on <= time < one.off]
