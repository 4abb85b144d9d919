"""Errors of a walk, disturbed by as much as tells them: what multipliers and responses share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.analysis.stability.across import Across
from heelstrike.analysis.stability.loop import SMOOTH, ClosedLoop, Walk
from heelstrike.analysis.stability.returns import (
    Disturbed,
    keeps_step,
    returned,
    stays_early,
)
from heelstrike.analysis.stability.section import Section
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.sim.run import Run

LESS = 0.25
"""Part of a disturbance that is tried where a walk that nobody chose it for falls."""

SAME = 0.1
"""Disturbances show what samples do if they tell of being early what being early by hardly anything
does, to this part of it."""


@dataclass(frozen=True)
class Measurement:
    """Returns of a walk, disturbed."""

    size: float
    """Of the disturbances."""
    section: Section
    """Their coordinates."""
    found: list[Disturbed]
    """The returns."""
    early: float
    """What is left of being early."""
    in_step: bool
    """Whether samples take away what is less than one of it."""

    @cached_property
    def errors(self) -> Across:
        """The returns without errors that are none."""
        return self.without(self.found)

    def without(self, found: list[Disturbed]) -> Across:
        """Leave errors that are none out of returns of the same walk, as out of these."""
        return Across.of(
            found, self.early, self.section.of_robot, smooth=self.size <= SMOOTH,
            in_step=self.in_step,
        )  # fmt: skip

    @property
    def residual(self) -> float:
        """Largest difference between two returns, but for being late if no clock drives it."""
        driven = self.errors.along is None
        return max(each.residual if driven else each.residual_but_late for each in self.found)

    @property
    def one_sided(self) -> tuple[str, ...]:
        """Coordinates whose errors of either sign do different things."""
        names = self.section.names
        found = {name for each in self.found for name in each.one_sided}
        return tuple(names[i] for i in self.errors.kept if names[i] in found)

    @property
    def switched(self) -> tuple[str, ...]:
        """Whole numbers of the memory that came out otherwise for some disturbance."""
        return tuple(sorted({name for each in self.found for name in each.switched}))


def measure(
    loop: ClosedLoop, walk: Walk, disturbance: float | None, *,
    memory: Sequence[str] | None = None, indicator: Callable[[Run], ArrayLike] | None = None,
) -> Measurement:  # fmt: skip
    """Disturb all returns of a walk, by a size or by what is usual.

    Raises
    ------
    LimitCycleError
        If a disturbed walk falls, or disturbances are too large for the samples of the controller.
    SimulationError
        If the size is none.
    """
    if disturbance is not None and not 0.0 < disturbance < 1.0:
        raise SimulationError(f"a disturbance must lie between 0 and 1, got {disturbance!r}")
    size = loop.usual_disturbance(walk) if disturbance is None else float(disturbance)
    section = Section(loop, walk, size, memory)
    hardly = keeps_step(loop, section, walk)
    if disturbance is None and hardly is not None and size > SMOOTH:
        size, section = SMOOTH, Section(loop, walk, SMOOTH, memory)
        hardly = keeps_step(loop, section, walk)

    def disturbed() -> list[Disturbed]:
        returns = range(len(walk.begins) - 1)
        return [returned(loop, section, walk, k, size, indicator) for k in returns]

    try:
        found = disturbed()
    except LimitCycleError:
        if disturbance is not None or hardly is not None or loop.even(walk):
            raise
        size *= LESS  # what steps make uneven is large for it, and it falls
        found = disturbed()
    if hardly is not None:
        off = (found[0].matrix @ found[0].begins - hardly)[: section.of_robot]
        if np.linalg.norm(off) > SAME * np.linalg.norm(found[0].begins[: section.of_robot]):
            raise LimitCycleError(
                f"a disturbance of {size:g} is too large: the controller is called every "
                f"{loop.grid:g} s, and the walk keeps step with these calls. It corrects "
                "an error in time of less than one call, and keeps an error of one "
                "call; this disturbance mixes both. Use "
                f"disturbance={min(SMOOTH, 0.1 * size):g}"
            )
    return Measurement(size, section, found, stays_early(loop, section, walk), hardly is not None)
