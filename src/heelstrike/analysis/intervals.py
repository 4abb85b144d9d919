"""What acted between two rows of a run, whichever way it went through time.

Time stepping holds forces and torques from row to row, impacts included, and compliant runs record
the mean over what follows. In event-driven runs the rows are instants of a continuous motion:
forces are averaged over the two ends, and the impulses of impacts stand apart, in the events.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.run import AnyRun, Event, Run
from heelstrike.tolerances import SAME_ROW

IMPULSIVE = (EventKind.TOUCHDOWN, EventKind.IMPACT, EventKind.ZENO, EventKind.PAINLEVE)
"""Events whose impulses are not in the forces of an event-driven run."""


def impulses_in_events(run: AnyRun) -> bool:
    """Whether the impulses of impacts are in the run's events, not in its forces."""
    return run.method.impulses_in_events


def mean_over_intervals(run: AnyRun, values: Floats) -> Floats:
    """Mean from each row to the next of a force or torque, (nt, ...) to (nt − 1, ...)."""
    if impulses_in_events(run):
        return np.asarray(0.5 * (values[:-1] + values[1:]))
    return values[:-1]


def mean_between(
    time: Floats, gained: Floats, rows: Integers, still: Floats, *, since: bool = False
) -> Floats:
    """Means over the spans between some rows of a run.

    Parameters
    ----------
    time : (n,) float
        Time of the rows of the run (s).
    gained : (n - 1, ...) float
        What is gained from each of them to the next: the impulse (N s) of a force.
    rows : (k,) int
        Some of the rows, in order.
    still : (k, ...) float
        Values where no time passes.
    since : bool
        Whether the mean of a row is that since the one before, not that until the next.

    Returns
    -------
    (k, ...) float
        The mean of each row.
    """
    sums = np.concatenate((np.zeros((1, *gained.shape[1:])), np.cumsum(gained, axis=0)))
    before, after = np.append(rows[:1], rows[:-1]), np.append(rows[1:], rows[-1:])
    first, last = (before, rows) if since else (rows, after)
    elapsed = time[last] - time[first]
    lasting = elapsed > 0.0
    found = still.copy()
    spans = elapsed[lasting].reshape(-1, *[1] * (still.ndim - 1))
    found[lasting] = (sums[last] - sums[first])[lasting] / spans
    return found


def friction_work(run: Run, torque: Floats, velocity: Floats) -> Floats:
    """Work of dry friction in joints from each row to the next, (nt − 1, n), in J.

    `torque` and `velocity`, (nt, n), are those of the joints at the rows. In an instant the torque
    jumps where the joint comes to rest or turns round; its power is zero on both sides of that.
    """
    held = np.diff(run.time)[:, None]
    if impulses_in_events(run):
        return mean_over_intervals(run, torque * velocity) * held
    return np.asarray(torque[:-1] * 0.5 * (velocity[:-1] + velocity[1:]) * held)


def event_impulse(run: Run) -> Floats:
    """Impulse (x, z) of impacts that only the events know, (nt − 1, nc, 2), in N s.

    World axes, on the robot, at the contact points; each stands in the interval, of no length, in
    which its velocities jump.
    """
    impulse = np.zeros((max(len(run.time) - 1, 0), run.robot.nc, 2))
    for row, event in _jumps(run, IMPULSIVE):
        nx, nz = run.contact_normal[row, event.contact]
        normal, tangent = event.impulse
        impulse[row, event.contact] += (normal * nx + tangent * nz, normal * nz - tangent * nx)
    return impulse


def stop_impulse(run: Run) -> Floats:
    """Impulse of joint stops that only the events know, (nt − 1, nv), in N m s (N s for a slide).

    On the joint's coordinate, and like :func:`event_impulse` in the interval of its jump.
    """
    impulse = np.zeros((max(len(run.time) - 1, 0), run.robot.nv))
    model = run.robot.model
    for row, event in _jumps(run, (EventKind.JOINT_STOP,)):
        joint = event.contact
        middle = 0.5 * (model.lower[joint] + model.upper[joint])  # infinite if it has one stop
        side = 1.0 if run.position[row, joint] < middle else -1.0
        impulse[row, joint] += side * event.impulse[0]
    return impulse


def brake_impulse(run: Run) -> Floats:
    """Impulse of brakes that take hold, that only the events know, (nt − 1, brakes), in N m s."""
    brakes = run.robot.model.brake_joint.tolist()
    impulse = np.zeros((max(len(run.time) - 1, 0), len(brakes)))
    for row, event in _jumps(run, (EventKind.JOINT_BRAKE,)):
        impulse[row, brakes.index(event.contact)] += event.impulse[0]
    return impulse


def _jumps(run: Run, kinds: Sequence[EventKind]) -> Iterator[tuple[int, Event]]:
    """Events of some kinds that alone know their impulse, each with the interval of its jump."""
    if impulses_in_events(run) and len(run.time) > 1:
        for event in run.events:
            if event.kind in kinds:
                yield _interval_of(event.time, run.time), event


def _interval_of(instant: float, time: Floats) -> int:
    """Interval between two rows whose ends are nearest to an instant: the one of a jump there.

    Rows of the output period may lie as near as 1e-12 s beside it.
    """
    first = int(np.searchsorted(time, instant - SAME_ROW))
    last = int(np.searchsorted(time, instant + SAME_ROW, side="right"))
    if last - first < 2:
        return min(first, len(time) - 2)
    away = np.abs(time[first:last] - instant)
    return first + int(np.argmin(away[:-1] + away[1:]))
