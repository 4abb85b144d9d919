"""What any disturbance does to any closed loop, by differences, for its gait sensitivity norm.

As :func:`~heelstrike.floquet_multipliers` measures errors that are there in the middle of a step,
a walk is disturbed here by what happens from then on, for one return: a push, another ground, other
parameters of the controller. Errors x across the walk and indicators g then obey

    x⁺ = A x + B e,   g = C x + D e

with disturbances e, from return to return.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.analysis.stability.loop import ClosedLoop, Walk, steps_of
from heelstrike.analysis.stability.measurement import Measurement, measure
from heelstrike.analysis.stability.returns import DIFFERENT, returned
from heelstrike.analysis.stability.section import Section
from heelstrike.analysis.stability.sensitivity import gait_sensitivity_norm
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.method import Method
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import Simulation
from heelstrike.sim.snapshot import Snapshot
from heelstrike.sim.whole_run import whole

ROWS = 10
"""Steps of the method between two rows of a return that an indicator is told from."""

UNEVEN = 1e-8
"""What is left of a disturbance either way that differs by less is not told apart."""

Disturb = Callable[[Simulation, float], None]
Indicator = Callable[[Run], ArrayLike]


def step_duration(run: Run) -> float:
    """Seconds from one foot's touchdown to the other's, the last of a return: a step.

    Parameters
    ----------
    run : Run
        From the middle of a step to the middle of the same foot's next.

    Returns
    -------
    float
        In s.

    Raises
    ------
    LimitCycleError
        If no two feet come down.
    """
    steps = steps_of(run.robot, run.events, float(run.time[0]))
    if len(steps) < 2:
        raise LimitCycleError(
            "a disturbed walk took fewer than two steps in a return; use a smaller disturbance"
        )
    return steps[-1][0] - steps[-2][0]


@dataclass(frozen=True, eq=False)
class _Response:
    """x⁺ = A x + B e, g = C x + D e, of one return or the mean of some."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats

    @classmethod
    def mean(cls, several: Sequence[_Response]) -> _Response:
        parts = ([each.A, each.B, each.C, each.D] for each in several)
        return cls(*(np.mean(part, axis=0) for part in zip(*parts, strict=True)))

    def norm(self, place: int | None = None) -> float:
        """Gait sensitivity norm, of one disturbance or of all together."""
        chosen = slice(None) if place is None else [place]
        return gait_sensitivity_norm(self.A, self.B[:, chosen], self.C, self.D[:, chosen])


@dataclass(frozen=True, eq=False, kw_only=True)
class DisturbanceResponse:
    """How a walk responds to disturbances, from return to return."""

    A: Floats
    """(m, m) Errors one return later of errors across the walk."""
    B: Floats
    """(m, k) The same of disturbances of size one that last a return."""
    C: Floats
    """(l, m) Changes of the indicators in the return by errors at its beginning."""
    D: Floats
    """(l, k) The same by the disturbances."""
    disturbances: tuple[str, ...]
    """Tuple of k str. Their names."""
    steps: int
    """Steps of a return."""
    doubts: dict[str, float]
    """What it makes to each of `norms`, in the first return, if errors and disturbances are half as
    large. Of differences that are smooth it is three quarters of what these are wrong by; much more
    where thresholds, samples or rounding make them uneven."""
    disturbance: float
    residual: float
    """disturbance, residual: Size of the errors that were put in, and the largest difference
    between two returns of the walk itself, but for being early or late if no clock drives it, as of
    :class:`~heelstrike.analysis.stability.floquet.Floquet`."""
    along: float | None
    """What the returns leave of being early; None of a walk that a clock drives."""
    one_sided: tuple[str, ...]
    switched: tuple[str, ...]
    """one_sided, switched: Errors, or disturbances, that do different things either way, of which
    the mean counts; whole numbers of the controller's memory that came out otherwise for some
    error."""

    _each: tuple[_Response, ...]

    @cached_property
    def norm(self) -> float:
        """Gait sensitivity norm: of all disturbances together, new ones in every return."""
        return gait_sensitivity_norm(self.A, self.B, self.C, self.D)

    @cached_property
    def norms(self) -> dict[str, float]:
        """The norm of each disturbance by itself."""
        return {
            name: gait_sensitivity_norm(self.A, self.B[:, [k]], self.C, self.D[:, [k]])
            for k, name in enumerate(self.disturbances)
        }

    @cached_property
    def error(self) -> float:
        """Standard error of `norm`, by leaving out one return at a time; NaN of one alone."""
        count = len(self._each)
        if count < 2:
            return float("nan")
        left_out = [
            _Response.mean(self._each[:k] + self._each[k + 1 :]).norm() for k in range(count)
        ]
        return float(np.sqrt((count - 1) * np.var(left_out)))

    @property
    def repeats(self) -> bool:
        """Whether the walk comes back to itself nearer than what it was disturbed by."""
        return self.residual <= self.disturbance

    def __repr__(self) -> str:
        told = ", ".join(
            f"{name} {size:.4g} ± {self.doubts[name]:.1g}" for name, size in self.norms.items()
        )
        differ = "" if self.repeats else f"; undecided, returns differ by {self.residual:.2g}"
        return f"DisturbanceResponse({told}, over returns of {self.steps} steps{differ})"

    def after(self, name: str, returns: int) -> Floats:
        """Indicators after one disturbance of size one, in its return and those after it.

        Parameters
        ----------
        name : str
            Which disturbance.
        returns : int
            How many returns.

        Returns
        -------
        (returns, l) float
            Changes of the indicators.

        Raises
        ------
        SimulationError
            If there is no such disturbance, or no return.
        """
        if name not in self.disturbances or returns < 1:
            raise SimulationError(
                f"name must be one of {', '.join(self.disturbances)}, and returns at least 1; got "
                f"{name!r}, {returns!r}"
            )
        place = self.disturbances.index(name)
        seen, error = [self.D[:, place]], self.B[:, place]
        for _ in range(returns - 1):
            seen.append(self.C @ error)
            error = self.A @ error
        return np.array(seen)


# More arguments than eight: what walks, and what is disturbed how, are a user's to say.
@takes(SimulationError)
def disturbance_response(
    robot: Robot,
    state: State | Snapshot,
    controller: Controller | None = None,
    *,
    disturbances: Mapping[str, tuple[Disturb, float]],
    indicator: Indicator = step_duration,
    ground: Ground | None = None,
    method: Method | None = None,
    control_period: float | None = None,
    settling: int = 10,
    returns: int = 4,
    disturbance: float | None = None,
    longest_step: float = 3.0,
) -> DisturbanceResponse:
    """Measure how a walk responds to disturbances, under any controller and method.

    Parameters
    ----------
    robot, state, controller, ground, method, control_period, settling, returns, longest_step
        The walk, how it is simulated and how long it is looked at, as of
        :func:`~heelstrike.floquet_multipliers`.
    disturbances : mapping of str to (callable, float)
        By name: ``disturb(simulation, size)``, which is called in the middle of a step and changes
        what comes then, by ``simulation.apply(push)``, ``simulation.ground = ...`` or
        ``simulation.parameters``; and a size for differences, small and both ways.
    indicator : callable
        Takes the :class:`~heelstrike.Run` of a return, with a row every ten steps of the method and
        all events, and returns one or more numbers, which must not depend on when it began; the
        duration of a step by default, for which `method` must not have a fixed step.
    disturbance : float, optional
        Size of the errors that are put in, as of :func:`~heelstrike.floquet_multipliers`.

    Returns
    -------
    DisturbanceResponse

    Raises
    ------
    LimitCycleError, SimulationError, ControllerError
        As of :func:`~heelstrike.floquet_multipliers`.

    Notes
    -----
    A ground that is higher in the end counts as level: errors are seen from it. What a disturbance
    has changed is as before in the next return. A return is two steps, of a robot with two legs.

    How exact it is: `doubts` compares with differences of half the size, `error` with the other
    returns, `repeats` and `one_sided` say what there is to doubt beside.

    Examples
    --------
    >>> import heelstrike as hs
    >>> from heelstrike.experiments.passive import METHOD, passive_walk
    >>> robot, ramp = hs.load_robot("compass_gait"), hs.Ground(friction=3.0, slope=-0.05)
    >>> cycle = passive_walk(robot, ramp)
    >>> def pushed(simulation, size):
    ...     force, t = (size / 0.1, 0.0), simulation.time
    ...     simulation.apply(hs.Push(2, force=force, start=t, duration=0.1))
    >>> found = hs.disturbance_response(
    ...     robot, cycle.state, disturbances={"push": (pushed, 1e-3)}, ground=ramp, method=METHOD,
    ...     settling=0, returns=1,
    ... )  # s of duration of every other step, per N s
    >>> bool(0.0 < found.norm < 1.0)
    True
    """
    if settling < 0 or returns < 1:
        raise SimulationError(
            f"settling must not be negative and returns at least one; got {settling!r}, {returns!r}"
        )
    _check(disturbances)
    loop = ClosedLoop(
        robot, controller, state, method=method, ground=ground, control_period=control_period,
        record_every=ROWS,
    )  # fmt: skip
    counts_steps = loop.simulation.method.step_length is not None
    if counts_steps and indicator is step_duration:
        raise SimulationError(
            "with a fixed step, touchdown times are rounded to steps and do not show "
            "small disturbances: use method=hs.EventDriven(), or give an indicator= "
            "that does not count steps"
        )
    walk = loop.follow(settling, returns, longest_step)
    found = measure(loop, walk, disturbance, indicator=indicator)
    each, sided = _responses(loop, walk, found, disturbances, indicator)
    half = returned(loop, found.section, walk, 0, 0.5 * found.size, indicator)
    smaller = {name: (disturb, 0.5 * size) for name, (disturb, size) in disturbances.items()}
    (again,), _ = _responses(loop, walk, replace(found, found=[half]), smaller, indicator)
    mean = _Response.mean(each)
    return DisturbanceResponse(
        A=mean.A,
        B=mean.B,
        C=mean.C,
        D=mean.D,
        disturbances=tuple(disturbances),
        steps=walk.steps,
        doubts={name: abs(each[0].norm(k) - again.norm(k)) for k, name in enumerate(disturbances)},
        disturbance=found.size,
        residual=found.residual,
        along=found.errors.along,
        one_sided=found.one_sided + sided,
        switched=found.switched,
        _each=tuple(each),
    )


def _responses(
    loop: ClosedLoop, walk: Walk, found: Measurement,
    disturbances: Mapping[str, tuple[Disturb, float]], indicator: Indicator,
) -> tuple[list[_Response], tuple[str, ...]]:  # fmt: skip
    """Respond in every return; say which disturbances do different things either way."""
    errors, responses, sided = found.errors, [], set()
    kept = list(errors.kept)
    for k, each in enumerate(found.found):
        into, through = [], []
        for name, (disturb, amount) in disturbances.items():
            sides, seen = _responded(loop, found.section, walk, k, name, disturb, amount, indicator)
            up, down = (errors.bases[k + 1].T @ side[kept] for side in sides)
            sizes = float(np.linalg.norm(up)), float(np.linalg.norm(down))
            apart = float(np.linalg.norm(up - down))
            if apart > DIFFERENT * max(sizes) and apart * amount > UNEVEN:
                sided.add(name)
            into.append(0.5 * (up + down))
            through.append(seen)
        through_errors = each.seen[:, kept] @ errors.bases[k]
        responses.append(
            _Response(errors.across[k], np.array(into).T, through_errors, np.array(through).T)
        )
    return responses, tuple(name for name in disturbances if name in sided)


def _check(disturbances: Mapping[str, tuple[Disturb, float]]) -> None:
    if not isinstance(disturbances, Mapping) or not disturbances:
        raise SimulationError(
            "disturbances are given by name, as in {'push': (pushed, 1e-3)}, where "
            f"pushed(simulation, size) disturbs; got {disturbances!r}"
        )
    for name, given in disturbances.items():
        pair = isinstance(given, tuple) and len(given) == 2 and callable(given[0])
        if not (pair and isinstance(given[1], (int, float)) and 0.0 < given[1] < np.inf):
            raise SimulationError(
                f"disturbance {name!r} must be a function (simulation, size) and a positive size, "
                f"got {given!r}"
            )


def _responded(
    loop: ClosedLoop, section: Section, walk: Walk, place: int, name: str, disturb: Disturb,
    amount: float, indicator: Indicator,
) -> tuple[tuple[Floats, Floats], Floats]:  # fmt: skip
    """Errors after a disturbance either way, and changes of the indicators, by its size."""
    begin, end = walk.begins[place], walk.begins[place + 1]
    loop.simulation.restore(end)
    usual, sides = section.read(loop.simulation), []
    for sign in (1.0, -1.0):
        simulation = loop.fresh()
        simulation.restore(begin)
        disturb(simulation, sign * amount)
        doing = f"disturbance {name!r} of size {sign * amount:.3g}"
        loop.advanced(simulation, end.time, doing)
        if section.feet_of(simulation.state, simulation.ground) != section.feet(end):
            raise LimitCycleError(f"{doing} makes the robot stand on another foot one return later")
        there, numbers = section.read(simulation)
        there[1] -= _raised(loop, simulation)
        told = np.atleast_1d(np.asarray(indicator(whole(simulation.record)), np.float64))
        if not np.all(np.isfinite(told)):
            raise SimulationError(f"{doing}: the indicator is {told}, no finite numbers")
        sides.append(((there, numbers), told))
    (up, seen_up), (down, seen_down) = sides
    errors = section.error(up, usual) / amount, section.error(usual, down) / amount
    return errors, (seen_up - seen_down) / (2.0 * amount)


def _raised(loop: ClosedLoop, simulation: Simulation) -> float:
    """How much higher the ground is than the usual one, where the robot stands (m)."""
    state = simulation.state
    seen = contact_kinematics(loop.robot, state.q, state.v, simulation.ground)
    x = float(seen.position[int(np.argmin(seen.gap)), 0])
    return float(simulation.ground.height(x) - loop.ground.height(x))
