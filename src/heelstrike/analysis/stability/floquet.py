"""Floquet multipliers of any closed loop: memory, sampling and sensors included, by any method.

What goes on from an instant is in the snapshot of a simulation there: the robot, the numbers that
its controller remembers, and where the clock is between two calls. A walk is followed until it has
settled; in the middle of a step all of that is disturbed, one number at a time, and the difference
is read when the same foot stands in the middle of its next step. Both walks run on the same clock,
so the period need not be a whole number of samples, and no leg has to be relabelled.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.stability.across import Across
from heelstrike.analysis.stability.loop import ClosedLoop
from heelstrike.analysis.stability.measurement import measure
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.method import Method
from heelstrike.sim.snapshot import Snapshot

SURE = 2.0
"""A factor is told from one by so many standard errors."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Floquet:
    """How small errors of a walk, and of what its controller remembers, grow from step to step."""

    matrix: Floats
    """(n, n) Errors in the middle of a step, as a part of what was disturbed, one return later: the
    mean over the returns that were looked at."""
    each: tuple[Floats, ...]
    """Tuple of (n, n) float. Those of the returns."""
    coordinates: tuple[str, ...]
    """What the rows and columns are: errors of the robot, combined so that its feet stay where they
    stand, and numbers of the controller's memory by name."""
    directions: Floats
    """(nq + nv, m) The combinations: the first m coordinates."""
    steps: int
    """Steps of a return: two, of a robot with two legs."""
    period: float
    step_length: float
    """period, step_length: Mean duration and length of a step in s and m."""
    along: float | None
    """What the returns leave of being early by a 250th of one: all, but for errors of samples and
    of integration, of a walk that no clock drives. None of one that a clock drives."""
    multipliers: NDArray[np.complex128]
    """(n,) Those of a return, largest first, without the one that is one."""
    disturbance: float
    residual: float
    """disturbance, residual: Size of the disturbances, and the largest difference between two
    returns of the walk itself, but for being early or late if no clock drives it (m, rad,
    velocities by the length they make in half a step)."""
    neutral: tuple[str, ...]
    one_sided: tuple[str, ...]
    switched: tuple[str, ...]
    """neutral, one_sided, switched: Numbers of the memory whose errors do nothing, which are left
    out; coordinates whose errors of either sign do different things, of which the mean counts:
    there the loop has a kink, and multipliers are those of a mean of its sides; whole numbers of
    the memory that came out otherwise for some disturbance."""

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
        left_out = [self._errors.largest(k) ** (1.0 / self.steps) for k in range(count)]
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
        vector = self._errors.slowest
        order = np.argsort(-vector)
        return {self.coordinates[i]: float(vector[i] / vector.max()) for i in order}

    _errors: Across

    def __repr__(self) -> str:
        verdict = "stable" if self.stable else "unstable"
        if not self.repeats:
            verdict = f"undecided, returns differ by {self.residual:.2g}"
        elif abs(self.largest - 1.0) <= SURE * self.error:
            verdict = "undecided, it may be one"
        return (
            f"Floquet(largest factor {self.largest:.4g} ± {self.error:.1g} a step of "
            f"{self.period:.6g} s, {len(self.coordinates)} coordinates: "
            f"{verdict})"
        )


# More arguments than eight: what walks, and what is disturbed how, are a user's to say.
@takes(SimulationError)
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
        Simulation method; ``TimeStepping()`` by default.
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
        sample late, and the map is uneven at the scale of what moves meanwhile; ten times the
        time step if steps of the integration fall otherwise in every return. 1e-5 again of a walk
        that keeps step with the calls of its controller.
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
        If the walk, or a disturbed one, falls, takes no steps or stands otherwise one return later;
        if disturbances are so large that touchdowns of a walk that keeps step with the calls of its
        controller fall between others.
    SimulationError, ControllerError
        If an argument is not usable, or a controller cannot be kept.

    Notes
    -----
    Time stepping moves impacts to its steps. If every return takes the same steps, small errors are
    those of the stepped map, whose multipliers are sharp. If not, that map is uneven at the scale
    of what moves in a step; larger disturbances and the mean over returns tell multipliers to a few
    hundredths then, as `error` says: more returns and shorter steps make it less.

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
    walk = loop.follow(settling, returns, longest_step)
    found = measure(loop, walk, disturbance, memory=memory)
    errors, names = found.errors, found.section.names
    return Floquet(
        matrix=np.mean(errors.matrices, axis=0),
        each=errors.matrices,
        coordinates=tuple(names[i] for i in errors.kept),
        directions=found.section.directions,
        steps=walk.steps,
        period=walk.duration / walk.steps,
        step_length=walk.length / walk.steps,
        along=errors.along,
        multipliers=errors.multipliers,
        disturbance=found.size,
        residual=found.residual,
        neutral=tuple(names[i] for i in errors.inert),
        one_sided=found.one_sided,
        switched=found.switched,
        _errors=errors,
    )
