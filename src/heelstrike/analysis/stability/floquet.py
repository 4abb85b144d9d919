"""Floquet multipliers of any closed loop: memory, sampling and sensors included, by any method.

What goes on from an instant is in the snapshot of a simulation there: the robot, the numbers that
its controller remembers, and where the clock is between two calls. A walk is followed until it has
settled; in the middle of a step all of that is disturbed, one number at a time, and the difference
is read when the same foot stands in the middle of its next step. Both walks run on the same clock,
so that a period that is no whole number of samples does no harm, and no leg has to be relabelled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.stability.loop import ClosedLoop, Walk
from heelstrike.analysis.stability.returns import Disturbed, returned
from heelstrike.analysis.stability.section import Section
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.method import Method
from heelstrike.sim.snapshot import Snapshot

Floats = NDArray[np.float64]

ALIGNED = 0.9
"""Cosine beyond which an error is one along the walk."""

ALONG = 0.3
"""A multiplier farther from one than this is not that of the walk itself."""

NEUTRAL = 1e-6
"""What of an error that is still there, and of its effects on others, is nothing."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Floquet:
    """How small errors of a walk, and of what its controller remembers, grow from step to step.

    Attributes
    ----------
    matrix : (n, n) float
        Errors in the middle of a step, as a part of what was disturbed, one return later: the mean
        over the returns that were looked at.
    each : tuple of (n, n) float
        Those of the returns.
    coordinates : tuple of str
        What the rows and columns are: errors of the robot, combined so that its feet stay where
        they stand, and numbers of the controller's memory by name.
    directions : (nq + nv, m) float
        The combinations: the first m coordinates.
    steps : int
        Steps of a return: two, of a robot with two legs.
    period, step_length : float
        Mean duration and length of a step in s and m.
    along : complex or None
        The multiplier of a return that is the walk's own: being early or late stays as it is, and
        this is one but for the error of the differences. None of a walk that a clock drives.
    multipliers : (n,) complex
        The others, of a return, largest first.
    disturbance, residual : float
        Size of the disturbances, and the largest difference of position and velocity between two
        returns of the walk itself (m, rad, m/s, rad/s).
    neutral, one_sided, switched : tuple of str
        Numbers of the memory whose errors do nothing, which are left out; coordinates whose errors
        of either sign do different things, of which the mean counts: there the loop has a kink, and
        multipliers are those of a mean of its sides; whole numbers of the memory that came out
        otherwise for some disturbance.
    """

    matrix: Floats
    each: tuple[Floats, ...]
    coordinates: tuple[str, ...]
    directions: Floats
    steps: int
    period: float
    step_length: float
    along: complex | None
    multipliers: NDArray[np.complex128]
    disturbance: float
    residual: float
    neutral: tuple[str, ...]
    one_sided: tuple[str, ...]
    switched: tuple[str, ...]

    @property
    def largest(self) -> float:
        """Factor by which the slowest error shrinks in one step."""
        return float(np.abs(self.multipliers).max(initial=0.0) ** (1.0 / self.steps))

    @cached_property
    def error(self) -> float:
        """Standard error of `largest`, by leaving out one return at a time; NaN of one alone."""
        count = len(self.each)
        if count < 2:
            return float("nan")
        left_out = [
            _largest(np.mean([*self.each[:k], *self.each[k + 1 :]], axis=0), self._flow)
            ** (1.0 / self.steps)
            for k in range(count)
        ]
        return float(np.sqrt((count - 1) * np.var(left_out)))

    @property
    def stable(self) -> bool:
        """Whether every small error dies out."""
        return self.largest < 1.0

    @property
    def repeats(self) -> bool:
        """Whether the walk comes back to itself nearer than what it was disturbed by.

        If not, the multipliers are not those of a walk that repeats itself, and may be of none.
        """
        return self.residual <= self.disturbance

    @property
    def slowest(self) -> dict[str, float]:
        """What the slowest error is made of: shares of the coordinates, largest first."""
        values, vectors = np.linalg.eig(self.matrix)
        wanted = self.multipliers[0] if len(self.multipliers) else 0.0
        vector = np.abs(vectors[:, int(np.argmin(np.abs(values - wanted)))])
        order = np.argsort(-vector)
        return {self.coordinates[i]: float(vector[i] / vector.max()) for i in order}

    _flow: Floats | None = None

    def __repr__(self) -> str:
        verdict = "stable" if self.stable else "unstable"
        if not self.repeats:
            verdict = f"undecided, returns differ by {self.residual:.2g}"
        return (
            f"Floquet(largest factor {self.largest:.4g} ± {self.error:.1g} a step of "
            f"{self.period:.6g} s, {len(self.coordinates)} coordinates: "
            f"{verdict})"
        )


# More arguments than eight: what walks, and what is disturbed how, are a user's to say.
def floquet_multipliers(
    robot: Robot,
    state: State | Snapshot,
    controller: Controller | None = None,
    *,
    ground: Ground | None = None,
    method: Method | None = None,
    control_period: float | None = None,
    settling: int = 10,
    returns: int = 4,
    disturbance: float | None = None,
    memory: Sequence[str] | None = None,
    longest_step: float = 3.0,
) -> Floquet:
    """Measure the Floquet multipliers of a walk under any controller and method.

    Unlike :func:`~heelstrike.find_limit_cycle` it lets the closed loop be: the controller goes on
    from step to step with all that it remembers and on its own clock, touchdowns fall between two
    samples as they come, and the walk need only come near to itself.

    Parameters
    ----------
    robot : Robot
        A robot that is free to move along the ground.
    state : State or Snapshot
        Where the walk begins.
    controller : object with ``torque(t, state, contacts)``, or None
        One in Python must take part in snapshots.
    ground : Ground
        Level or sloping ground; ``Ground()`` by default.
    method : Method
        Way through time; ``TimeStepping()`` by default.
    control_period : float, optional
        As of :func:`~heelstrike.simulate`.
    settling : int
        Steps before anything is disturbed: the walk must repeat by then.
    returns : int
        Returns of the walk over which the differences are averaged.
    disturbance : float, optional
        Size of the disturbances (m, rad, and times 1/s those of velocities; of what is remembered,
        a part of how much it varies). By default 1e-5; twice the seconds between two samples if
        an event-driven simulation calls the controller only then, as touchdowns are felt up to a
        sample late, and the map is uneven at the scale of what moves meanwhile.
    memory : sequence of str, optional
        Numbers of the controller's memory that are disturbed; by default all that matter.
    longest_step : float
        Seconds after which a step without touchdown has failed.

    Returns
    -------
    Floquet

    Raises
    ------
    LimitCycleError
        If the walk, or a disturbed one, falls, takes no steps or stands otherwise one return later.
    SimulationError, ControllerError
        If an argument is not usable, or a controller cannot be kept.

    Notes
    -----
    Time stepping moves impacts to its steps: small errors are then those of the stepped map, whose
    multipliers are sharp if every return takes the same number of steps, and mean little if not, as
    `error` tells. ``EventDriven`` with a `control_period` is the better instrument.

    Two things are known beforehand and left out: where along the ground the robot is, which is
    nobody's affair, and being early or late (`along`). A controller that acts on where in the world
    it is has no walk that repeats. Cost: (returns) × 2 × (coordinates) walks of a return.

    Examples
    --------
    >>> import heelstrike as hs
    >>> from heelstrike.experiments.passive import METHOD, passive_walk
    >>> robot, ramp = hs.load_robot("compass_gait"), hs.Ground(friction=3.0, slope=-0.05)
    >>> cycle = passive_walk(robot, ramp)
    >>> found = hs.floquet_multipliers(
    ...     robot, cycle.state, ground=ramp, method=METHOD, settling=0, returns=1
    ... )
    >>> bool(abs(found.largest - abs(cycle.multipliers[0])) < 1e-4)
    True
    """
    if settling < 0 or returns < 1:
        raise SimulationError(
            f"settling must not be negative and returns at least one; got {settling!r}, {returns!r}"
        )
    loop = ClosedLoop(
        robot, controller, state, method=method, ground=ground, control_period=control_period
    )
    size = loop.usual_disturbance if disturbance is None else float(disturbance)
    if not 0.0 < size < 1.0:
        raise SimulationError(f"a disturbance must lie between 0 and 1, got {disturbance!r}")
    walk = loop.follow(settling, returns, longest_step)
    section = Section(loop, walk.begins[0], walk.duration, memory)
    found = [returned(loop, section, walk, k, size) for k in range(returns)]
    return _combined(walk, section, size, found)


def _combined(walk: Walk, section: Section, size: float, found: list[Disturbed]) -> Floquet:
    """Put returns together; leave out what stays without doing anything."""
    matrices = [each.matrix for each in found]
    mean = np.mean(matrices, axis=0)
    kept, inert = _with_consequence(matrices, section.of_robot)
    square = np.ix_(kept, kept)
    matrices = [matrix[square] for matrix in matrices]
    flow = section.flow[kept] if section.flow is not None else None
    mean = np.mean(matrices, axis=0)
    along, others = _without(mean, flow)
    names = section.names
    one_sided = {name for each in found for name in each.one_sided}
    switched = {name for each in found for name in each.switched}
    made = Floquet(
        matrix=mean,
        each=tuple(matrices),
        coordinates=tuple(names[i] for i in kept),
        directions=section.directions,
        steps=walk.steps,
        period=walk.duration / walk.steps,
        step_length=walk.length / walk.steps,
        along=along,
        multipliers=others,
        disturbance=size,
        residual=max(each.residual for each in found),
        neutral=tuple(names[i] for i in inert),
        one_sided=tuple(names[i] for i in kept if names[i] in one_sided),
        switched=tuple(sorted(switched)),
    )
    return replace(made, _flow=flow)


def _with_consequence(matrices: list[Floats], of_robot: int) -> tuple[list[int], list[int]]:
    """Tell coordinates on which something hangs from those that nothing but they themselves feel.

    The latter's own multipliers are one, of what stays as it is, and zero, of what is written anew.
    """
    kept = list(range(len(matrices[0])))
    while True:
        alone = [
            i
            for i in kept
            if i >= of_robot
            and all(_is_alone(matrix[kept, i], kept.index(i)) for matrix in matrices)
        ]
        if not alone:
            return kept, sorted(set(range(len(matrices[0]))) - set(kept))
        kept = [i for i in kept if i not in alone]


def _is_alone(column: Floats, place: int) -> bool:
    own, others = column[place], np.delete(column, place)
    stays = min(abs(own), abs(own - 1.0)) <= NEUTRAL
    return bool(stays and np.abs(others).max(initial=0.0) <= NEUTRAL)


def _without(matrix: Floats, flow: Floats | None) -> tuple[complex | None, NDArray[np.complex128]]:
    """Return the multiplier along the walk, if there is one, and the others, largest first."""
    values, vectors = np.linalg.eig(matrix)
    along = None
    others = values.astype(np.complex128)
    if flow is not None and len(values):
        there = np.flatnonzero(flow)
        parts, way = vectors[there], flow[there]
        cosine = np.abs(way @ parts) / (
            np.linalg.norm(way) * np.maximum(np.linalg.norm(parts, axis=0), 1e-300)
        )
        cosine = np.where(np.abs(values - 1.0) < ALONG, cosine, 0.0)
        if cosine.max() > ALIGNED:
            place = int(np.argmax(cosine))
            along = complex(values[place])
            others = np.delete(others, place)
    return along, others[np.argsort(-np.abs(others), kind="stable")]


def _largest(matrix: Floats, flow: Floats | None) -> float:
    return float(np.abs(_without(matrix, flow)[1]).max(initial=0.0))
