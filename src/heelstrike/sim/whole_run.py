"""Runs for those who have no use for a part of one."""

from __future__ import annotations

from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.run import Run


def whole(run: Run) -> Run:
    """Return a run, unless Ctrl-C ended it.

    Raises
    ------
    KeyboardInterrupt
        If it did: what was to be done with the run shall not be done, nor what comes after.
    """
    if run.status is RunStatus.INTERRUPTED:
        raise KeyboardInterrupt(run.message)
    return run
