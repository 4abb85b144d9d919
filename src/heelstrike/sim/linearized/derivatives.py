"""Derivatives of what a simulation does, from one instant to another, through contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.arguments import takes
from heelstrike.contact.linearized.partials import FRICTION
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.compliant.method import Compliant
from heelstrike.sim.contacts.loops import TAKES_HOLD
from heelstrike.sim.event_driven.method import EventDriven
from heelstrike.sim.frame import is_due
from heelstrike.sim.linearized.closing import close_positions
from heelstrike.sim.linearized.flow import Variation
from heelstrike.sim.linearized.inputs import LAW, TORQUE, Inputs, inputs_of
from heelstrike.sim.linearized.law import AskedAlong, parameter_sizes
from heelstrike.sim.linearized.mode_changes import ModeChange, other_modes
from heelstrike.sim.linearized.refusals import refuse_inputs, refuse_step
from heelstrike.sim.linearized.step import linearized
from heelstrike.sim.linearized.time_step import allocate_slopes, differentiate_step
from heelstrike.sim.linearized.yielding import AT_LIMITS, Yielding
from heelstrike.sim.simulation import Simulation
from heelstrike.sim.snapshot import Snapshot
from heelstrike.sim.time_stepping.method import TimeStepping
from heelstrike.sim.whole_run import whole

NOTHING: Mapping[str, ArrayLike] = MappingProxyType({})

SAME_TORQUE = 1e-9
"""Torques that differ by less, of themselves and of 1 N m, are one, asked for twice."""

AT_ONCE = 1e-6
"""Part of a step within which a time is its end."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StepDerivatives:
    """Derivatives of the state (q, v) after some time by what it depends on, to first order."""

    begin: float
    end: float
    """begin, end: From when to when (s)."""
    state: Floats
    """(nq + nv, nq + nv) By the state at the beginning."""
    torque: Floats
    """(nq + nv, nu) By torques that are added, the same all the time, to those that act anyway."""
    numbers: Mapping[str, Floats]
    """(nq + nv, k) each. By numbers of the robot and the ground, by name."""
    gains: Mapping[str, Floats]
    """(nq + nv, k) each. By parameters of the law, by name."""
    changes: tuple[ModeChange, ...] = ()
    """Contact points at a change of mode, where the derivatives are those of one side; of one time
    step."""
    spread: float = 0.0
    """Where several points come down in one instant of an event-driven motion, derivatives are the
    mean of those of all orders in which they may do so; what an event does differs by so much."""

    def forward(
        self, state: ArrayLike = 0.0, torque: ArrayLike = 0.0, *,
        numbers: Mapping[str, ArrayLike] = NOTHING, gains: Mapping[str, ArrayLike] = NOTHING,
    ) -> Floats:  # fmt: skip
        """Return the change of the state at the end, (nq + nv,).

        Parameters
        ----------
        state, torque : (nq + nv,) and (nu,) array
            Changes of the state at the beginning and of the torques.
        numbers, gains : mapping of str to (k,) array
            Changes of those that were asked for.

        Returns
        -------
        (nq + nv,) float
            The change.
        """
        change = self.state @ np.broadcast_to(state, len(self.state))
        change = change + self.torque @ np.broadcast_to(torque, self.torque.shape[1])
        for own, given in ((self.numbers, numbers), (self.gains, gains)):
            for name, value in given.items():
                change = change + own[name] @ np.broadcast_to(value, own[name].shape[1])
        return np.asarray(change)

    def adjoint(self, gradient: ArrayLike) -> Gradient:
        """Return the gradient of a function of the state at the end by all that it depends on.

        Parameters
        ----------
        gradient : (nq + nv,) array
            Its gradient by that state.

        Returns
        -------
        Gradient
            By the state at the beginning, the torques and the numbers.
        """
        back = np.asarray(gradient, np.float64)
        return Gradient(
            state=back @ self.state,
            torque=back @ self.torque,
            numbers={name: back @ each for name, each in self.numbers.items()},
            gains={name: back @ each for name, each in self.gains.items()},
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Gradient:
    """The gradient of a number with respect to all that a run depends on."""

    state: Floats
    """(nq + nv,) By the state at the beginning."""
    torque: Floats
    """(nu,) By torques that are added; over a run (steps, nu), those of each step."""
    numbers: Mapping[str, Floats]
    gains: Mapping[str, Floats]
    """numbers, gains: (k,) each. By numbers of robot and ground, and by parameters of the law, by
    name."""


@dataclass(frozen=True, eq=False)
class RunDerivatives:
    """Derivatives along a run, step by step."""

    steps: tuple[StepDerivatives, ...]
    """Of each step: of the method, or from one call of a sampled controller to the next."""

    def forward(
        self, state: ArrayLike = 0.0, torque: ArrayLike = 0.0, *,
        numbers: Mapping[str, ArrayLike] = NOTHING, gains: Mapping[str, ArrayLike] = NOTHING,
    ) -> Floats:  # fmt: skip
        """Return changes of the state at the beginning and after every step.

        Parameters
        ----------
        state : (nq + nv,) array
            Change at the beginning.
        torque : (steps, nu) array
            Changes of the torques in every step.
        numbers, gains : mapping of str to (k,) array
            Changes of those that were asked for.

        Returns
        -------
        (steps + 1, nq + nv) float
            The changes.
        """
        first = self.steps[0]
        changes = [np.array(np.broadcast_to(state, len(first.state)), dtype=np.float64)]
        added = np.broadcast_to(torque, (len(self.steps), first.torque.shape[1]))
        for step, each in zip(self.steps, added, strict=True):
            changes.append(step.forward(changes[-1], each, numbers=numbers, gains=gains))
        return np.array(changes)

    def adjoint(self, gradient: ArrayLike) -> Gradient:
        """Return the gradient of a function of the run's states by all that they depend on.

        Parameters
        ----------
        gradient : (nq + nv,) or (steps + 1, nq + nv) array
            Its gradient by the last state, or by that at the beginning and those after every step.

        Returns
        -------
        Gradient
            By the state at the beginning, the torques of every step and the numbers.
        """
        given, size = np.asarray(gradient, np.float64), len(self.steps[0].state)
        by_states = np.zeros((len(self.steps) + 1, size))
        by_states[-1 if given.ndim == 1 else slice(None)] = given
        back, found = by_states[-1], []
        for step, own in zip(reversed(self.steps), by_states[-2::-1], strict=True):
            found.append(step.adjoint(back))
            back = found[-1].state + own
        return Gradient(
            state=back,
            torque=np.array([each.torque for each in found[::-1]]),
            numbers=_sums([each.numbers for each in found]),
            gains=_sums([each.gains for each in found]),
        )


def _sums(several: Sequence[Mapping[str, Floats]]) -> dict[str, Floats]:
    """Add what has the same name."""
    return {name: np.sum([each[name] for each in several], axis=0) for name in several[0]}


@takes(SimulationError)
def step_derivatives(
    simulation: Simulation,
    *,
    until: float | None = None,
    numbers: Sequence[str] = (),
    gains: Sequence[str] = (),
    answers: bool = True,
    modes: Mapping[str, str] | None = None,
) -> StepDerivatives:
    """Take a step, or advance until a time, and differentiate the result.

    Contact modes are those that the certified solution has. While they last, equations hold that
    are differentiated implicitly: exact to rounding, but for the law's own derivative, which is a
    difference. Events of an event-driven motion, touchdowns, slips and stops, are gone through with
    their saltations (:func:`~heelstrike.saltation_matrix`). So are those of compliant ground, whose
    motion is differentiated, not the steps of its integration, whose lengths depend on it; bristles
    begin as they are bent.

    Parameters
    ----------
    simulation : Simulation
        It goes on to the end.
    until : float, optional
        End in s, rounded as by :meth:`~heelstrike.Simulation.advance`; one step of the method by
        default. What a sampled controller answered before the beginning is held as it is.
    numbers : sequence of str
        ``"friction"`` of the ground; ``"mass"``, ``"inertia"``, ``"center_of_mass"``,
        ``"armature"``, ``"damping"``, ``"stiffness"``, ``"rest"`` or ``"gravity"`` of the robot,
        all numbers of that name, as in its :class:`~heelstrike.robot.model.Model`.
    gains : sequence of str
        Parameters of a compiled law, by their names.
    answers : bool
        Whether the controller answers to a changed state. If not, its torques are those that they
        are. It must be compiled, and act on the state, but not on forces.
    modes : mapping of str to str, optional
        For contact points at a change of mode the other side: ``"open"``, ``"stick"``,
        ``"slip_forward"`` or ``"slip_backward"`` by name, as `changes` tells; of one time step.

    Returns
    -------
    StepDerivatives

    Raises
    ------
    SimulationError
        If what happens has no derivative that is known here; the message says what.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot, ground = hs.load_robot("bravo7"), hs.Ground(friction=0.6)
    >>> simulation = hs.Simulation(robot, state=robot.reference_state(), ground=ground)
    >>> found = hs.step_derivatives(simulation, numbers=["mass"])
    >>> found.state.shape, found.torque.shape, found.numbers["mass"].shape
    ((18, 18), (18, 6), (18, 9))
    """
    stepper = _stepper(simulation, numbers, gains, answers)
    if modes is not None and not (until is None and isinstance(stepper, _TimeSteps)):
        raise SimulationError("modes is for one step of time stepping only: leave it out")
    return stepper.until(None if until is None else simulation._instant(until), modes)


@takes(SimulationError)
def run_derivatives(
    simulation: Simulation,
    until: float,
    *,
    every: float | None = None,
    numbers: Sequence[str] = (),
    gains: Sequence[str] = (),
    answers: bool = True,
) -> RunDerivatives:
    """Advance until a time and differentiate every step, for gradients along the run.

    Parameters
    ----------
    simulation, numbers, gains, answers
        As of :func:`step_derivatives`.
    until : float
        End in s, rounded as by :meth:`~heelstrike.Simulation.advance`.
    every : float, optional
        Seconds from one state to the next; by default one step of time stepping, or the period of a
        sampled controller, of which it must be a multiple; and the whole time of an event-driven
        motion, and on compliant ground, where bristles keep errors between two states. If a sampled
        controller is between two calls, the first of several ends at the next call: what it
        answered to one state then never acts after the next.

    Returns
    -------
    RunDerivatives

    Raises
    ------
    SimulationError
        As of :func:`step_derivatives`.

    Examples
    --------
    >>> import heelstrike as hs
    >>> robot = hs.load_robot("compass_gait")
    >>> simulation = hs.Simulation(robot, state=robot.reference_state(), stop_when_fallen=False)
    >>> run = hs.run_derivatives(simulation, 0.01)
    >>> run.adjoint([1.0] + [0.0] * 7).state.shape
    (8,)
    """
    begin, end = simulation.time, simulation._instant(until)
    own = max(simulation.method.step_length or 0.0, simulation.control_period)
    if every is not None:
        part = every / own % 1.0 if own > 0.0 else 0.0
        if not every > 0.0 or min(part, 1.0 - part) > AT_ONCE:
            of = f", and a multiple of {own:.6g} s" if own > 0.0 else ""
            raise SimulationError(f"every must be positive{of}; got {every}")
    own = 0.0 if isinstance(simulation.method, Compliant) else own
    span = every or own or end - begin
    stepper = _stepper(simulation, numbers, gains, answers)
    first = begin + span
    if first < end - AT_ONCE * span:
        first = begin + (_to_the_next_call(simulation) or span)
    count = ceil(max(end - first, 0.0) / span - AT_ONCE) if span > 0.0 else 0
    ends = first + span * np.arange(count + 1)
    return RunDerivatives(tuple(stepper.until(min(each, end)) for each in ends.tolist()))


def _to_the_next_call(simulation: Simulation) -> float:
    """Seconds to the next call of a controller that is sampled in steps; zero at a call."""
    every = simulation._clock.control_every
    if every <= 1:
        return 0.0
    return -simulation._clock.index % every * (simulation.method.step_length or 0.0)


def _stepper(
    simulation: Simulation, numbers: Sequence[str], gains: Sequence[str], answers: bool
) -> _TimeSteps | _Flows | _Yields:
    """Choose how a simulation is differentiated.

    Raises
    ------
    SimulationError
        If its method is none of this package's, or there are no such numbers.
    """
    sizes = parameter_sizes(simulation.controller, gains)
    inputs = inputs_of(simulation.robot, numbers, sizes)
    if isinstance(simulation.method, TimeStepping):
        refuse_inputs(simulation.method.scheme, inputs)
        return _TimeSteps(simulation, inputs, answers)
    if isinstance(simulation.method, EventDriven):
        return _Flows(simulation, inputs, answers)
    if isinstance(simulation.method, Compliant):
        return _Yields(simulation, inputs, answers)
    raise SimulationError(
        f"{simulation.method.name} is not differentiated; use TimeStepping(), EventDriven() or "
        "Compliant()"
    )


class _TimeSteps:
    """Time steps, whose derivatives are multiplied."""

    def __init__(self, simulation: Simulation, inputs: Inputs, answers: bool) -> None:
        self._simulation, self._inputs = simulation, inputs
        friction = FRICTION in inputs.numbers
        self._slopes = allocate_slopes(simulation.robot, inputs.dynamic, friction=friction)
        controller = simulation.controller if answers else None
        self._law = None if controller is None else AskedAlong(simulation, controller)

    def until(self, end: float | None, modes: Mapping[str, str] | None = None) -> StepDerivatives:
        """Go on until a time, or take one step, and say what that does."""
        simulation, slopes, inputs = self._simulation, self._slopes, self._inputs
        robot, begin, step = simulation.robot, simulation.time, simulation.method.step_length or 0.0
        size, single = robot.nq + robot.nv, end is None
        end = begin + step if end is None else end
        change = np.eye(size + inputs.size)
        added = change[[size + column for column in inputs.of(TORQUE)]]
        held, asked = np.zeros_like(added), np.zeros(robot.nu)
        found: tuple[ModeChange, ...] = ()
        while simulation.time < end - AT_ONCE * step:
            if self._law is not None and is_due(simulation._clock):
                own = [size + column for column in inputs.of_parameters()]
                asked, held = self._law.at_call(change, own, inputs.parameters)
            slopes.q[:], slopes.v[:] = simulation.state.q, simulation.state.v
            free = simulation._memory.loops.braked < TAKES_HOLD
            _one_step(simulation)
            stops = np.any(free & (simulation._memory.loops.braked >= TAKES_HOLD))
            slopes.turning = 0.0 if stops else 0.5
            if self._law is not None:
                held[_at_limits(simulation, asked)] = 0.0
            refuse_step(simulation)
            found = other_modes(simulation, modes or {}) if single else ()
            memory, work = simulation._memory, simulation._work
            differentiate_step(
                robot.model, work.step, work.scheme, memory.stiffness, memory.next_v,
                memory.equations.added, memory.contacts.normal, memory.rows, memory.surface,
                memory.assembly, work.impact, memory.pushes, slopes,
            )  # fmt: skip
            close_positions(robot.model, work, memory, slopes)
            moved = slopes.state[:, :size] @ change[:size]
            moved += slopes.state[:, size : size + robot.nu] @ (added + held)
            by_number = slopes.state[:, size + robot.nu :]
            moved += by_number @ change[[size + column for column in inputs.of_numbers()]]
            change[:size] = moved
        return _told(simulation, begin, change, inputs, found)


def _one_step(simulation: Simulation) -> None:
    """Take a step that is one."""
    status = simulation.step()
    if status is not RunStatus.COMPLETED:
        raise SimulationError(f"a step that ends the run has no derivative: {simulation.message}")


def _at_limits(simulation: Simulation, asked: Floats) -> NDArray[np.bool_]:
    """Tell which torques are what limits let through, (nu,), and do not answer."""
    off = np.abs(simulation._memory.torque - asked)
    return np.asarray(off > SAME_TORQUE * (1.0 + np.abs(asked)))


class _Flows:
    """Event-driven motions, gone through event by event."""

    def __init__(self, simulation: Simulation, inputs: Inputs, answers: bool) -> None:
        self._simulation, self._inputs, self._answers = simulation, inputs, answers

    def until(self, end: float | None, modes: Mapping[str, str] | None = None) -> StepDerivatives:
        """Go on until a time, or take one step, and say what that does."""
        del modes
        simulation, begin = self._simulation, self._simulation.time
        now = simulation.snapshot()
        if end is None:
            beside = _again(simulation, now)
            _one_step(beside)
            end = beside.time
        beside = _again(simulation, now)
        beside.advance(end)
        if beside.status is not RunStatus.COMPLETED:
            raise SimulationError(f"a step that ends the run has no derivative: {beside.message}")
        run = whole(beside.record)
        controller = simulation.controller
        again = _again(simulation, now)
        variation = Variation(again, controller, self._inputs, answers=self._answers)
        motion = linearized(run, end, variation, section=False, begin=begin)
        simulation.advance(end)
        spread = max((event.spread for event in motion.saltations), default=0.0)
        return _told(simulation, begin, motion.matrix, self._inputs, (), spread)


class _Yields:
    """Motions on compliant ground, gone through from sample to sample."""

    def __init__(self, simulation: Simulation, inputs: Inputs, answers: bool) -> None:
        self._simulation, self._inputs, self._answers = simulation, inputs, answers
        self._beside = _again(simulation, simulation.snapshot())
        self._went_on = False
        self._yielding = Yielding(self._beside, simulation.controller, inputs, answers=answers)

    def until(self, end: float | None, modes: Mapping[str, str] | None = None) -> StepDerivatives:
        """Go on until a time, or take one step, and say what that does."""
        del modes
        simulation, inputs, yielding = self._simulation, self._inputs, self._yielding
        begin, step = simulation.time, simulation.method.step_length or 0.0
        size = simulation.robot.nq + simulation.robot.nv
        if self._went_on and np.any(simulation._work.now.friction.bend):
            raise SimulationError(
                "bristles of compliant ground keep errors from one interval to the next: leave "
                "every out, or use RegularisedFriction()"
            )
        self._went_on = True
        end = begin + step if end is None else end
        change = np.eye(yielding.size + inputs.size)
        change = np.delete(change, slice(size, yielding.size), axis=1)  # bends begin as they are
        held = np.zeros((simulation.robot.nu, change.shape[1]))
        self._beside.restore(simulation.snapshot())
        yielding.begin()
        while simulation.time < end - AT_ONCE * step:
            self._beside.restore(simulation.snapshot())
            held, asked = self._held(change, held)
            _one_step(simulation)
            if asked is not None and np.any(_at_limits(simulation, asked)):
                raise SimulationError(AT_LIMITS)
            self._beside._memory.command[:] = simulation._memory.command
            yielding.flow(change, held)
        if self._answers and yielding.law is not None and simulation._control.continuous:
            yielding.law.check_beginning()
        return _told(simulation, begin, change[:size], inputs, ())

    def _held(self, change: Floats, held: Floats) -> tuple[Floats, Floats | None]:
        """Return what errors do to torques that are held from this sample on.

        Also the torques that a sampled law asks for, if it is asked now.
        """
        simulation, law, asked = self._simulation, self._yielding.law, None
        if law is None or not self._answers:
            return held, asked
        if simulation._control.continuous:
            law.check_memory()
        elif is_due(simulation._clock):
            own = [self._yielding.size + column for column in self._inputs.of_parameters()]
            asked, held = law.at_call(change, own, self._inputs.parameters)
        return held, asked


def _again(simulation: Simulation, now: Snapshot) -> Simulation:
    """Return another simulation at the same instant."""
    again = Simulation(
        simulation.robot, simulation.controller, state=now, method=simulation.method,
        ground=simulation.ground, control_period=simulation._given_period,
        stop_when_fallen=False, record_every=int(now.identity["record_every"]),
    )  # fmt: skip
    again._clock.record_every = 1  # rows of all times are looked at
    return again


def _told(
    simulation: Simulation, begin: float, change: Floats, inputs: Inputs,
    changes: tuple[ModeChange, ...], spread: float = 0.0,
) -> StepDerivatives:  # fmt: skip
    """Tell columns apart."""
    size = simulation.robot.nq + simulation.robot.nv
    by_input = change[:size, size:]
    return StepDerivatives(
        begin=begin,
        end=simulation.time,
        state=change[:size, :size],
        torque=by_input[:, inputs.columns[TORQUE]],
        numbers={name: by_input[:, inputs.of(name)] for name in inputs.numbers},
        gains={name: by_input[:, inputs.of(LAW + name)] for name in inputs.parameters},
        changes=changes,
        spread=spread,
    )
