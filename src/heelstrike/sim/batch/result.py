"""What many simulations came to."""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.run import Timing


@dataclass(frozen=True, eq=False, kw_only=True)
class AnyBatchResult:
    """How many simulations ended, with their records if they were kept."""

    position: Floats
    """(n, nq)"""
    velocity: Floats
    """(n, nv) State of each run when it ended (m, rad; m/s, rad/s)."""
    time: Floats
    """(n,) When that was, in s."""
    status: tuple[RunStatus, ...]
    """How each run ended."""
    message: tuple[str, ...]
    """The same in a person's words."""
    steps: Integers
    saturations: Integers
    """steps, saturations: (n,) Steps taken; times that a torque was clipped to its limit."""
    events: Integers
    """(n, kinds) Events of each kind, in the order of
    :class:`~heelstrike.sim.closed_sets.EventKind`."""
    penetration: Floats
    """(n,) Deepest penetration of a contact point, in m."""
    energy_gain: Floats
    """(n,) Kinetic energy that restitution made (J)."""
    solves: Integers
    shortcuts: Integers
    fallbacks: Integers
    failures: Integers
    relaxed: Integers
    """solves, shortcuts, fallbacks, failures, relaxed: (n,) Contact problems of each run, and how
    they were solved; see :class:`~heelstrike.sim.run.SolverCount`."""
    threads: int
    """Threads that worked on it."""
    timing: Timing
    """Seconds spent compiling, or loading compiled code, and simulating."""
    _runs: tuple[Any, ...] | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.status)

    @property
    def completed(self) -> NDArray[np.bool_]:
        """Which runs lasted as long as they were asked to, (n,)."""
        return np.array([status is RunStatus.COMPLETED for status in self.status], dtype=bool)

    def run(self, index: int) -> Any:
        """Return the record of one run, as :func:`~heelstrike.simulate` would have.

        Parameters
        ----------
        index : int
            Which run.

        Returns
        -------
        Run or SpatialRun
            Its record.

        Raises
        ------
        SimulationError
            If the batch was not recorded, or was interrupted before this run began.
        IndexError
            If there is no such run.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"there is no run {index} in a batch of {len(self)}")
        run = None if self._runs is None else self._runs[index]
        if run is not None:
            return run
        if self._runs is None:
            raise SimulationError(
                "this batch kept final states only; call simulate_batch with record_every=1, or "
                "another number of steps between two rows, to have its runs"
            )
        raise SimulationError(f"the batch was interrupted before run {index} began")

    def __str__(self) -> str:
        counts = [
            f"{count} {status.value}"
            for status in RunStatus
            if (count := sum(each is status for each in self.status))
        ]
        return f"{len(self)} runs: {', '.join(counts)}"


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchResult(AnyBatchResult):
    """What many simulations came to."""

    complementarity: Floats
    cone: Floats
    non_penetration: Floats
    """complementarity, cone, non_penetration: (n,) Largest relative residuals of the contact
    problems."""
    combinations: Integers
    """(n,) Contact problems that came to the last resort, combinations of contact modes."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SpatialBatchResult(AnyBatchResult):
    """What many simulations in space came to."""

    residual: Floats
    """(n,) Largest relative residual of the contact problems."""
    uncertified: Integers
    halved: Integers
    """uncertified, halved: (n,) Steps that went on with a residual above 1e-9; that were taken in
    parts."""
