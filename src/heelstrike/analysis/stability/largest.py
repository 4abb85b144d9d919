"""The largest disturbance that a walk stands, each found by bisection.

Recovery is no monotone matter: a robot may stand a push of 20 N s and fall at 15. What is reported
is the largest size such that all smaller sizes that were tried recover, and the smallest that did
not: sizes are tried upwards in equal strides, then the last stride is halved until it is short.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from heelstrike.analysis.stability.trial import FAR, Trial
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.sim.push import Push


@dataclass(frozen=True, kw_only=True)
class Largest:
    """The largest disturbance that a walk withstands."""

    recovered: float
    """Largest size from which the walk recovers, as it does from all smaller ones tried."""
    failed: float
    """Smallest size tried from which it does not; infinite if it recovers from the largest."""
    trials: int
    """Walks simulated."""
    unit: str
    """Of the sizes."""

    def __str__(self) -> str:
        if np.isinf(self.failed):
            return f"≥ {self.recovered:.3g} {self.unit}"
        return f"{self.recovered:.3g} {self.unit} (not {self.failed:.3g})"


def largest(
    recovers: Callable[[float], bool], *, most: float, strides: int = 8, halvings: int = 4,
    unit: str = "",
) -> Largest:  # fmt: skip
    """Find how large a disturbance may be.

    Parameters
    ----------
    recovers : callable
        Takes a size, at least 0; returns whether a walk recovers from it.
    most : float
        Largest size tried.
    strides : int
        Sizes tried upwards to it.
    halvings : int
        How often the stride in which it first fails is halved.
    unit : str
        Of the sizes.

    Returns
    -------
    Largest
        Sizes of both outcomes; nothing is recovered from if the undisturbed walk fails.

    Raises
    ------
    SimulationError
        If `most` or the numbers of trials are not positive.
    """
    if not (np.isfinite(most) and most > 0.0 and strides > 0 and halvings >= 0):
        raise SimulationError(
            f"a search needs a largest size, strides and halvings; got most={most!r}, "
            f"strides={strides!r}, halvings={halvings!r}"
        )
    good, bad, trials = -1.0, np.inf, 0
    for size in np.linspace(0.0, most, strides + 1):
        trials += 1
        if not recovers(float(size)):
            bad = float(size)
            break
        good = float(size)
    for _ in range(halvings if 0.0 < bad < np.inf else 0):
        middle = 0.5 * (good + bad)
        trials += 1
        if recovers(middle):
            good = middle
        else:
            bad = middle
    return Largest(recovered=max(good, 0.0), failed=bad, trials=trials, unit=unit)


@takes(SimulationError)
def largest_push(
    trial: Trial, *, phase: float = 0.5, direction: tuple[float, float] = (1.0, 0.0),
    duration: float = 0.1, link: str | int = 2, most: float = 100.0, strides: int = 8,
    halvings: int = 4,
) -> Largest:  # fmt: skip
    """Find the largest push, in N s, from which a walk recovers.

    Parameters
    ----------
    trial : Trial
        The walk.
    phase : float
        When in a step the push begins, from 0 to 1.
    direction : (2,) float
        Where it goes, x and z, of any length.
    duration : float
        How long it lasts, in s.
    link : str or int
        Link on whose centre of mass it acts; the trunk by default.
    most : float
        Largest impulse tried, in N s.
    strides, halvings : int
        As of :func:`largest`.

    Returns
    -------
    Largest
        Impulses in N s.

    Raises
    ------
    SimulationError
        If an argument is not usable.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("rabbit")
    >>> gait = hs.optimize_gait(robot, step_length=0.3, step_duration=0.4, friction=0.6, starts=1)
    >>> phased = hs.PhasedGait.from_gait(robot, gait)
    >>> zero = hs.zero_dynamics(phased)
    >>> trial = hs.Trial(
    ...     robot=robot, controller=hs.VirtualConstraints(phased), state=zero.initial_state,
    ...     step_length=zero.step_length, step_duration=zero.period,
    ... )
    >>> print(hs.largest_push(trial, phase=0.4, most=20.0, strides=2, halvings=0))
    10 N s (not 20)
    """
    size = float(np.hypot(*direction))
    if not (0.0 <= phase <= 1.0 and size > 0.0 and duration > 0.0):
        raise SimulationError(
            "a push needs a phase from 0 to 1, a direction and a duration; got "
            f"phase={phase!r}, direction={direction!r}, duration={duration!r}"
        )
    begin = trial.begins + phase * trial.step_duration

    def recovers(impulse: float) -> bool:
        force = impulse / duration / size
        push = Push(
            link, force=(force * direction[0], force * direction[1]), start=begin, duration=duration
        )
        run = trial.run(begin + duration, pushes=[push] if impulse > 0.0 else [])
        return bool(trial.recovered(run, (begin, begin + duration)))

    return largest(recovers, most=most, strides=strides, halvings=halvings, unit="N s")


@takes(SimulationError)
def largest_slope(
    trial: Trial, *, uphill: bool, most: float = 15.0, strides: int = 15, halvings: int = 2
) -> Largest:
    """Find the steepest slope, in degrees, that a walk gets onto from level ground unseen.

    Parameters
    ----------
    trial : Trial
        The walk.
    uphill : bool
        Whether the slope leads up.
    most : float
        Steepest slope tried, in degrees.
    strides, halvings : int
        As of :func:`largest`.

    Returns
    -------
    Largest
        Slopes in degrees.

    Raises
    ------
    SimulationError
        If an argument is not usable.
    """
    sign = 1.0 if uphill else -1.0

    def recovers(degrees: float) -> bool:
        ground = trial.other_ground(slope=sign * float(np.deg2rad(degrees)))
        return _walks_on(trial, ground, same_speed=False)

    return largest(recovers, most=most, strides=strides, halvings=halvings, unit="degrees")


@takes(SimulationError)
def largest_ground_step(
    trial: Trial, *, up: bool, most: float = 0.1, strides: int = 10, halvings: int = 2
) -> Largest:
    """Find the highest step in level ground, in m, that a walk takes unseen.

    Parameters
    ----------
    trial : Trial
        The walk.
    up : bool
        Whether the step leads up.
    most : float
        Highest step tried, in m.
    strides, halvings : int
        As of :func:`largest`.

    Returns
    -------
    Largest
        Heights in m.

    Raises
    ------
    SimulationError
        If an argument is not usable.
    """
    sign = 1.0 if up else -1.0

    def recovers(height: float) -> bool:
        edge, rise = trial.edge, sign * height
        corners = [(edge - 1.0, 0.0), (edge, 0.0), (edge, rise), (edge + FAR, rise)]
        ground = trial.ground if height == 0.0 else _ground(trial, corners)
        return _walks_on(trial, ground, same_speed=True)

    return largest(recovers, most=most, strides=strides, halvings=halvings, unit="m")


@takes(SimulationError)
def largest_roughness(
    trial: Trial, *, seed: int, spacing: float = 0.1, most: float = 0.05, strides: int = 10,
    halvings: int = 2,
) -> Largest:  # fmt: skip
    """Find the roughest ground, in m up and down, that a walk gets over unseen.

    Parameters
    ----------
    trial : Trial
        The walk.
    seed : int
        Of the random heights; each is that of a size times one shape.
    spacing : float
        Distance between corners, in m.
    most : float
        Largest amplitude tried, in m.
    strides, halvings : int
        As of :func:`largest`.

    Returns
    -------
    Largest
        Amplitudes in m.

    Raises
    ------
    SimulationError
        If an argument is not usable.
    """

    def recovers(amplitude: float) -> bool:
        ground = trial.other_ground(roughness=amplitude, spacing=spacing, seed=seed)
        return _walks_on(trial, ground, same_speed=False)

    return largest(recovers, most=most, strides=strides, halvings=halvings, unit="m")


def _walks_on(trial: Trial, ground: Ground, *, same_speed: bool) -> bool:
    run = trial.run(trial.begins, ground=ground)
    return bool(trial.recovered(run, (trial.begins, trial.begins), same_speed=same_speed))


def _friction(trial: Trial) -> float:
    friction = trial.ground.model().friction
    if len(friction) > 1:
        raise SimulationError("the ground of a trial must be level: the disturbances change it")
    return float(friction[0])


def _ground(trial: Trial, corners: list[tuple[float, float]]) -> Ground:
    return Ground(friction=_friction(trial), profile=np.array(corners))
