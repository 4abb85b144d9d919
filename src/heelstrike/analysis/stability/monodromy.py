"""The linearisation of a step, event by event: flows between them, saltation matrices at them.

A step that an event-driven simulation has taken is gone through once more. Between two events the
variational equation is integrated by Gauss's collocation, with derivatives of the equations of
motion that are exact; at an event the error goes through its saltation matrix. The product is the
derivative of the map from touchdown to touchdown, without a difference of two simulations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, permutations, product

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.poincare_map import SAME_INSTANT, Chart, PoincareMap, Section
from heelstrike.analysis.stability.sensitivity import gait_sensitivity_norm
from heelstrike.analysis.stability.variation import Variation
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.linearized.motion import (
    ActiveContacts,
    linearize_contact,
    linearize_impact,
    saltation_matrix,
)
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.event_driven.method import EventDriven
from heelstrike.sim.run import Event, Run
from heelstrike.sim.simulation import Simulation, simulate

Floats = NDArray[np.float64]

BEYOND = 1.02
"""How much longer than a step is simulated."""

SLIPS = 1e-9
"""Points on the ground that are faster than this (m/s) slide."""

REPEATS = 1e-5
"""A state and its image one step later differ by less (m, rad, m/s, rad/s), or nothing repeats."""

FITS = 1e-6
"""An impact that is recomputed agrees with the simulation's to this (m/s, rad/s)."""

MOST_TOGETHER = 3
"""Contact points that come down in one instant, in any order."""

NOT_SMOOTH = (
    EventKind.ZENO, EventKind.PAINLEVE, EventKind.ENERGY_GAIN, EventKind.BRIDGE, EventKind.WEDGED,
    EventKind.JOINT_SLIP, EventKind.JOINT_STICK,
)  # fmt: skip
"""Events behind which errors have no derivative that is known here."""

APPROACHES = 1e-8
"""What comes down on the ground or to a stop faster than this (m/s, rad/s) was not there."""

SWITCHES = (EventKind.STICK, EventKind.SLIP_REVERSAL)


@dataclass(frozen=True, eq=False, kw_only=True)
class Saltation:
    """An event of a step and what it does to small errors.

    Attributes
    ----------
    time : float
        When, in s.
    kinds : tuple of EventKind
        What happened then.
    matrix : (nq + nv, nq + nv) float
        The saltation matrix: error just after of an error just before. The identity at lift-offs
        and where slip begins, as forces are continuous there. Of the touchdown that ends a step,
        that of the error on the section: at touchdown, whenever that is.
    spread : float
        Where several points come down in one instant, errors decide in which order; the matrix is
        then the mean of those of all orders, which differ by so much at most.
    """

    time: float
    kinds: tuple[EventKind, ...]
    matrix: Floats
    spread: float


@dataclass(frozen=True, eq=False, kw_only=True)
class StepHeight:
    """What the height of the next foothold does to a step.

    Attributes
    ----------
    state : (nq + nv,) float
        Errors (δq, δv) at the next touchdown for a metre of height, seen from the new foothold. The
        foot behind is not level with it then: they are none of those that `tangent` spans.
    duration_state : (nq + nv,) float
        Change of the step's duration by errors at its beginning (s/m, s/rad, s²/m, s²/rad).
    duration : float
        Change of its duration by the height (s/m).
    """

    state: Floats
    duration_state: Floats
    duration: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Monodromy:
    """The linearisation of a step that repeats.

    Attributes
    ----------
    period : float
        Duration of the step in s.
    flows : tuple of (nq + nv, nq + nv) float
        What the smooth motion before each event does to errors (δq, δv).
    saltations : tuple of Saltation
        What the events do, in their order; the last is the touchdown that ends the step.
    relabelling : (nq + nv, nq + nv) float
        Exchange of the legs and the way back along the ground.
    tangent : (nq + nv, m) float
        Orthonormal basis of the errors that the feet on the ground allow.
    arrival : tuple of (nq + nv,) float or None
        Of the touchdown that ends the step: derivative of the gap, rate of the state before, its
        image under the impact, and the ground's normal; None if several points come down at once.
    """

    period: float
    flows: tuple[Floats, ...]
    saltations: tuple[Saltation, ...]
    relabelling: Floats
    tangent: Floats
    arrival: tuple[Floats, Floats, Floats, Floats] | None = None

    @cached_property
    def matrix(self) -> Floats:
        """Error (δq, δv) at the next touchdown, relabelled, of one at this; (nq + nv, nq + nv)."""
        matrix = np.eye(len(self.relabelling))
        for flow, event in zip(self.flows, self.saltations, strict=True):
            matrix = event.matrix @ flow @ matrix
        return self.relabelling @ matrix

    @property
    def reduced(self) -> Floats:
        """The same in the coordinates of `tangent`, (m, m)."""
        return self.tangent.T @ self.matrix @ self.tangent

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers of a step, (m,), largest first."""
        found = np.linalg.eigvals(self.reduced).astype(np.complex128)
        return found[np.argsort(-np.abs(found), kind="stable")]

    @property
    def step_height(self) -> StepHeight:
        """What the height of the next foothold does, on which the walk then goes on.

        Raises
        ------
        SimulationError
            If several contact points end the step at once.
        """
        if self.arrival is None:
            raise SimulationError(
                "several contact points come down at once at the end of this step: what a higher "
                "foothold does to it has no derivative"
            )
        gradient, rate, struck, normal = self.arrival
        until = self.flows[-1]
        for flow, event in zip(self.flows[-2::-1], self.saltations[-2::-1], strict=True):
            until = until @ event.matrix @ flow
        crossing = float(gradient @ rate)
        return StepHeight(
            state=self.relabelling @ (struck / crossing - normal),
            duration_state=-(gradient @ until) / crossing,
            duration=1.0 / crossing,
        )

    @property
    def gait_sensitivity_norm(self) -> float:
        """Of the step's duration to heights of footholds, in s/m (Hobbelen and Wisse 2007).

        Raises
        ------
        SimulationError
            If several contact points end the step at once.
        """
        height = self.step_height
        return gait_sensitivity_norm(
            self.matrix, height.state, height.duration_state, height.duration
        )

    def __repr__(self) -> str:
        largest = np.abs(self.multipliers).max(initial=0.0)
        return (
            f"Monodromy({len(self.saltations)} events in {self.period:.9g} s, largest multiplier "
            f"{largest:.6g})"
        )


@takes(SimulationError)
def monodromy(
    robot: Robot,
    state: State,
    controller: Controller | None = None,
    *,
    ground: Ground | None = None,
    method: EventDriven | None = None,
    landing: Sequence[int] | None = None,
    symmetry: Callable[[State], State] | None = None,
    longest_step: float = 3.0,
) -> Monodromy:
    """Linearise a step that repeats: flows between its events times saltation matrices at them.

    What :func:`~heelstrike.find_limit_cycle` gets from differences of whole steps, from derivatives
    instead; the two have nothing in common but the simulation of the step itself.

    Parameters
    ----------
    robot : Robot
        The robot; without dry friction in its joints.
    state : State
        Just after a touchdown of a walk that repeats, as ``find_limit_cycle(...).state``.
    controller : object with ``torque(t, state, contacts)``, or None
        A compiled one that acts continuously. As in `find_limit_cycle` it begins afresh at every
        touchdown.
    ground : Ground
        Flat or sloping ground; ``Ground()`` by default.
    method : EventDriven
        Way through time, ``EventDriven(rtol=1e-12, atol=1e-13)`` by default.
    landing, symmetry, longest_step
        As of :func:`~heelstrike.find_limit_cycle`.

    Returns
    -------
    Monodromy

    Raises
    ------
    LimitCycleError
        If no step is completed, or it does not repeat.
    SimulationError
        If a controller or an event cannot be linearised; the message says which and why.

    Examples
    --------
    >>> import heelstrike as hs
    >>> from heelstrike.experiments.passive import passive_walk
    >>> wheel, ramp = hs.load_robot("rimless_wheel"), hs.Ground(friction=3.0, slope=-0.15)
    >>> cycle = passive_walk(wheel, ramp)
    >>> step = hs.monodromy(wheel, cycle.state, ground=ramp)
    >>> bool(abs(step.multipliers[0] - cycle.multipliers[0]) < 1e-8)
    True
    """
    ground = Ground() if ground is None else ground
    method = EventDriven(rtol=1e-12, atol=1e-13) if method is None else method
    section = Section(robot, ground)
    step = PoincareMap(section, controller, method, landing, symmetry, longest_step)
    landed = step(state)
    begin, _ = section.moved_back(state)
    change = float(np.abs(_vector(landed.state) - _vector(begin)).max())
    if change > REPEATS:
        raise LimitCycleError(
            f"this step does not repeat: the state changes by {change:.3g} from touchdown to "
            "touchdown. Begin with the state of hs.find_limit_cycle"
        )
    period = landed.time
    run = simulate(
        robot, controller, state=state, duration=BEYOND * period, method=method, ground=ground
    )
    _refuse(robot, run, period)
    instants = _instants(run, period)
    bounds = [0.0, *(events[0].time for events in instants)]
    simulation = Simulation(robot, controller, state=state, method=method, ground=ground)
    variation = Variation(simulation, controller)
    flows, saltations = [], []
    phases = [_active(run, start, end) for start, end in pairwise(bounds)]
    for place, (start, end) in enumerate(pairwise(bounds)):
        flows.append(variation.flow(start, end, phases[place]))
        after = phases[place + 1] if place + 1 < len(phases) else None
        instant = _Instant(run, tuple(instants[place]), phases[place], after)
        saltations.append(instant.saltation())
    normal = np.zeros(robot.nq + robot.nv)
    normal[:2] = ground.model().normal[0]
    arrival = instant.arrival()
    return Monodromy(
        period=period,
        flows=tuple(flows),
        saltations=tuple(saltations),
        relabelling=_relabelling(section, step, run, period, landed.contact),
        tangent=Chart(section, begin).tangent,
        arrival=None if arrival is None else (*arrival, normal),
    )


def _refuse(robot: Robot, run: Run, period: float) -> None:
    """Refuse steps whose errors have no derivative that is known here."""
    if np.any(robot.model.dry_friction > 0.0):
        raise SimulationError(
            f"dry friction in the joints of {robot.name!r} cannot be linearised here; "
            "hs.find_limit_cycle takes differences instead"
        )
    if np.any(run.brake_torque):
        raise SimulationError(
            f"brakes of {robot.name!r} are on, which is not linearised here; "
            "hs.find_limit_cycle takes differences instead"
        )
    if run.saturations:
        raise SimulationError(
            "torques were clipped at the limits of the motors: a law that cannot do what it asks "
            "for is not linearised here; hs.find_limit_cycle takes differences instead"
        )
    for event in run.events:
        if event.kind in NOT_SMOOTH and event.time <= period:
            raise SimulationError(
                f"an event of kind {event.kind.name} at t = {event.time:.6g} s cannot be "
                "linearised; hs.find_limit_cycle takes differences instead"
            )


def _instants(run: Run, period: float) -> list[list[Event]]:
    """Events of the step, those of one instant together."""
    instants: list[list[Event]] = []
    for event in run.events:
        if not 0.0 < event.time <= period + SAME_INSTANT:
            continue
        if instants and event.time - instants[-1][0].time <= SAME_INSTANT:
            instants[-1].append(event)
        else:
            instants.append([event])
    return instants


def _active(run: Run, begin: float, end: float) -> ActiveContacts:
    """What holds the robot between two events, as the row nearest to their middle shows it."""
    row = int(np.argmin(np.abs(run.time - 0.5 * (begin + end))))
    if not begin + SAME_INSTANT < run.time[row] < end - SAME_INSTANT:
        # Too short for a row of its own: the last of the first instant says what comes after it.
        row = int(np.flatnonzero(run.time <= begin + SAME_INSTANT)[-1])
    down = [i for i in range(run.robot.nc) if run.contact_force[row, i, 0] > 0.0]
    speed = run.slip_velocity[row]
    return ActiveContacts(
        resting=tuple(i for i in down if abs(speed[i]) <= SLIPS),
        sliding=tuple((i, 1 if speed[i] > 0.0 else -1) for i in down if abs(speed[i]) > SLIPS),
        joints=tuple(int(j) for j in np.flatnonzero(run.stop_torque[row])),
    )


@dataclass(frozen=True)
class _Instant:
    """Events of one instant, what held before and what holds after, if the step goes on."""

    run: Run
    events: tuple[Event, ...]
    before: ActiveContacts
    after: ActiveContacts | None

    @property
    def time(self) -> float:
        return self.events[0].time

    @cached_property
    def rows(self) -> tuple[int, int]:
        """Rows just before and just after."""
        there = np.flatnonzero(np.abs(self.run.time - self.time) <= SAME_INSTANT)
        return int(there[0]), int(there[-1])

    def saltation(self) -> Saltation:
        kinds = tuple(dict.fromkeys(event.kind for event in self.events))
        struck = [event for event in self.events if event.impulse[0] != 0.0]
        switched = [event.contact for event in self.events if event.kind in SWITCHES]
        spread = 0.0
        if struck:
            matrices = self._impacts(struck)
            matrix = np.mean(matrices, axis=0)
            spread = max(
                float(np.abs(one - other).max()) for one, other in product(matrices, matrices)
            )
        elif switched and self.after is not None:
            matrix = self._switch(switched[0])
        else:
            matrix = np.eye(self.run.robot.nq + self.run.robot.nv)
        return Saltation(time=self.time, kinds=kinds, matrix=matrix, spread=spread)

    def arrival(self) -> tuple[Floats, Floats, Floats] | None:
        """Derivative of the gap of the one point that comes down, rate before, its image after."""
        struck = [event for event in self.events if event.impulse[0] != 0.0]
        q, v = self._state(self.rows[0])
        rate = self._rate(self.rows[0], v, self.before)
        fresh = [event for event in struck if self._gap_gradient(event, q) @ rate < -APPROACHES]
        if len(fresh) != 1 or fresh[0].kind.of_joint:
            return None
        ground = self.run.ground
        active = _struck(struck, self._friction())
        impact = linearize_impact(self.run.robot, q, v, active, ground=ground)
        return self._gap_gradient(fresh[0], q), rate, impact.reset @ rate

    def _friction(self) -> Floats:
        """Friction coefficients of the contact points on ground that is the same everywhere."""
        friction: Floats = (
            float(self.run.ground.model().friction[0]) * self.run.robot.model.friction_scale
        )
        return friction

    def _state(self, row: int) -> tuple[Floats, Floats]:
        return self.run.position[row], self.run.velocity[row]

    def _rate(self, row: int, v: Floats, active: ActiveContacts) -> Floats:
        run = self.run
        q, torque = run.position[row], run.torque[row]
        return linearize_contact(run.robot, q, v, torque, active, ground=run.ground).rate

    def _switch(self, contact: int) -> Floats:
        """Where a point that slid comes to rest, or turns round: its speed is the event."""
        robot, ground, (first, last) = self.run.robot, self.run.ground, self.rows
        q, v = self._state(first)
        at = contact_kinematics(robot, q, v, ground)
        by_position = _speed_gradient(robot, ground, q, v, contact)
        gradient = np.concatenate((by_position, at.jacobian[contact, 1]))
        assert self.after is not None
        return saltation_matrix(
            np.eye(len(gradient)), gradient, self._rate(first, v, self.before),
            self._rate(last, self.run.velocity[last], self.after),
        )  # fmt: skip

    def _impacts(self, struck: list[Event]) -> list[Floats]:
        """Matrices of the orders in which points that come down together may do so."""
        first, _ = self.rows
        q, v = self._state(first)
        rate = self._rate(first, v, self.before)
        # The others were on the ground or at their stops, and feel the impact.
        fresh = [event for event in struck if self._gap_gradient(event, q) @ rate < -APPROACHES]
        others = [event for event in struck if event not in fresh]
        if len(fresh) > MOST_TOGETHER:
            raise SimulationError(
                f"{len(fresh)} contact points come down together at t = {self.time:.6g} s: more "
                f"orders than are gone through here"
            )
        found = []
        for order in permutations(fresh):
            matrix = self._in_order(order, others)
            if matrix is not None:
                found.append(matrix)
        if not found:
            raise SimulationError(
                f"the impact at t = {self.time:.6g} s cannot be linearised: nothing comes down in "
                "it, or of several points none after the other"
            )
        return found

    def _in_order(self, order: Sequence[Event], others: Sequence[Event]) -> Floats | None:
        """Matrix of an order; None if a point would not come down after those before it."""
        robot, ground, (first, last) = self.run.robot, self.run.ground, self.rows
        q, v = self._state(first)
        rate = self._rate(first, v, self.before)
        matrix = np.eye(len(rate))
        for count, event in enumerate(order, start=1):
            gradient = self._gap_gradient(event, q)
            if count > 1 and gradient @ rate >= 0.0:
                return None
            active = _struck([*order[:count], *others], self._friction())
            impact = linearize_impact(robot, q, v, active, ground=ground)
            v = impact.velocity
            if count < len(order):
                after = self._rate(last, v, active)
                matrix = saltation_matrix(impact.reset, gradient, rate, after) @ matrix
                rate = after
        off = float(np.abs(v - self.run.velocity[last]).max())
        if off > FITS * max(1.0, float(np.abs(v).max())):
            raise SimulationError(
                f"the impact at t = {self.time:.6g} s cannot be linearised: points that slide, "
                f"bounce or come off in it leave velocities {off:.3g} from those recomputed"
            )
        if self.after is None:  # errors at touchdown, whenever that is
            onto = np.eye(len(rate)) - np.outer(rate, gradient) / float(gradient @ rate)
            closing: Floats = impact.reset @ onto @ matrix
            return closing
        after = self._rate(last, self.run.velocity[last], self.after)
        return saltation_matrix(impact.reset, gradient, rate, after) @ matrix

    def _gap_gradient(self, event: Event, q: Floats) -> Floats:
        """Derivative of what vanishes as a point comes down, or a joint comes to its stop."""
        robot = self.run.robot
        if event.kind.of_joint:
            gradient = np.zeros(robot.nq + robot.nv)
            # A sign of its own makes coming to either end a fall.
            upper = q[event.contact] > 0.5 * np.sum(
                [robot.model.lower[event.contact], robot.model.upper[event.contact]]
            )
            gradient[event.contact] = -1.0 if upper else 1.0
            return gradient
        at = contact_kinematics(robot, q, np.zeros(robot.nv), self.run.ground)
        return np.concatenate((at.jacobian[event.contact, 0], np.zeros(robot.nv)))


def _struck(events: Sequence[Event], friction: Floats) -> ActiveContacts:
    """What receives impulses in an impact, as its events tell; `friction` is that of all points."""
    points = [event for event in events if not event.kind.of_joint]
    on_the_cone = [
        abs(event.impulse[1]) >= friction[event.contact] * event.impulse[0] * (1.0 - 1e-9)
        for event in points
    ]
    return ActiveContacts(
        resting=tuple(
            event.contact for event, slides in zip(points, on_the_cone, strict=True) if not slides
        ),
        sliding=tuple(
            (event.contact, -1 if event.impulse[1] > 0.0 else 1)
            for event, slides in zip(points, on_the_cone, strict=True)
            if slides
        ),
        joints=tuple(event.contact for event in events if event.kind.of_joint),
    )


def _speed_gradient(robot: Robot, ground: Ground, q: Floats, v: Floats, contact: int) -> Floats:
    """Derivative by q of the sliding velocity of a point, by differences of fourth order."""

    def speed(change: Floats) -> float:
        return float(contact_kinematics(robot, q + change, v, ground).velocity[contact, 1])

    h = 1e-3
    return np.array(
        [
            (8.0 * (speed(e) - speed(-e)) - (speed(2.0 * e) - speed(-2.0 * e))) / (12.0 * h)
            for e in h * np.eye(robot.nq)
        ]
    )


def _relabelling(
    section: Section, step: PoincareMap, run: Run, period: float, contact: int
) -> Floats:
    """Derivative of the exchange of the legs and the way back, which is affine."""
    row = np.flatnonzero(run.time <= period + SAME_INSTANT)[-1]
    end = State(run.position[row], run.velocity[row])
    nq = section.robot.nq

    def image(change: Floats) -> Floats:
        moved = State(end.q + change[:nq], end.v + change[nq:])
        return _vector(step.relabelled(moved, contact))

    h = 1e-3
    exchange = np.array(
        [(image(e) - image(-e)) / (2.0 * h) for e in h * np.eye(nq + section.robot.nv)]
    ).T
    after = step.relabelled(end, contact)
    foothold = section.foothold(after)
    at = contact_kinematics(section.robot, after.q, after.v, section.ground)
    # The foothold moves along the ground as its point does, which no gap changes.
    way = np.zeros(nq + section.robot.nv)
    way[:2] = section.along
    place = np.concatenate((at.jacobian[foothold, 1], np.zeros(section.robot.nv)))
    back: Floats = exchange - np.outer(way, place @ exchange)
    return back


def _vector(state: State) -> Floats:
    return np.concatenate((state.q, state.v))
