"""A motion between two instants, linearised event by event: flows between them, saltations at them.

A motion that an event-driven simulation has made is gone through once more. Between two events the
variational equation is integrated, with derivatives of the equations of motion that are exact; at
an event the error goes through its saltation matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise, permutations, product

import numpy as np

from heelstrike.contact.linearized.motion import (
    ActiveContacts,
    linearize_contact,
    saltation_matrix,
)
from heelstrike.contact.linearized.slopes import ContactSlopes, contact_slopes
from heelstrike.contact.linearized.strikes import Strike, strikes
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.linearized.flow import Variation
from heelstrike.sim.linearized.inputs import Inputs
from heelstrike.sim.linearized.pushed import pushed
from heelstrike.sim.run import Event, Run

SAME_INSTANT = 1e-11
"""Rows of a run within this time (s) of an event belong to it."""

SLIPS = 1e-9
"""Points on the ground that are faster than this (m/s) slide."""

FITS = 1e-6
"""An impact that is recomputed agrees with the simulation's to this (m/s, rad/s)."""

MOST_TOGETHER = 3
"""Contact points that come down in one instant, in any order."""

NOT_SMOOTH = (
    EventKind.ZENO, EventKind.PAINLEVE, EventKind.ENERGY_GAIN, EventKind.BRIDGE, EventKind.WEDGED,
    EventKind.JOINT_SLIP, EventKind.JOINT_STICK, EventKind.JOINT_BRAKE,
)  # fmt: skip
"""Events behind which errors have no derivative that is known here."""

APPROACHES = 1e-8
"""What comes down on the ground or to a stop faster than this (m/s, rad/s) was not there."""

SWITCHES = (EventKind.STICK, EventKind.SLIP_REVERSAL)


@dataclass(frozen=True, eq=False, kw_only=True)
class Saltation:
    """An event of a step and what it does to small errors."""

    time: float
    """When, in s."""
    kinds: tuple[EventKind, ...]
    """What happened then."""
    matrix: Floats
    """(nq + nv + k, nq + nv + k) The saltation matrix: error just after of an error just
    before, and of a change of k inputs. The identity at lift-offs and where slip begins, as forces
    are continuous there. Of the touchdown that ends a step, that of the error on the section: at
    touchdown, whenever that is."""
    spread: float
    """Where several points come down in one instant, errors decide in which order; the matrix is
    then the mean of those of all orders, which differ by so much at most."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion, linearised from its beginning to its last event."""

    flows: tuple[Floats, ...]
    """Tuple of (nq + nv + k, nq + nv + k) float. What the smooth motion before each event, and
    after the last if it goes on, does to errors (δq, δv) and to changes of k inputs, which stay."""
    saltations: tuple[Saltation, ...]
    """What the events do, in their order; the last is a section if the motion ends with it."""
    arrival: Strike | None
    """The one contact point that comes down in that section, if it is one."""

    @property
    def matrix(self) -> Floats:
        """Errors at the end by errors at the beginning, and inputs."""
        if len(self.flows) > len(self.saltations):
            return self.until_the_last
        return self.saltations[-1].matrix @ self.until_the_last

    @property
    def until_the_last(self) -> Floats:
        """The same just before the section."""
        matrix = self.flows[0]
        for event, flow in zip(self.saltations, self.flows[1:], strict=False):
            matrix = flow @ event.matrix @ matrix
        return matrix


def linearized(
    run: Run, until: float, variation: Variation, *, section: bool = True, begin: float = 0.0
) -> Motion:
    """Linearise a part of a run, up to an event or a time.

    Parameters
    ----------
    run : Run
        A run of an event-driven simulation that goes a little beyond an event.
    until : float
        When it ends (s).
    variation : Variation
        The variational equation of the same motion.
    section : bool
        Whether it ends with an event, whenever that is; or at that time.
    begin : float
        When it begins (s).

    Raises
    ------
    SimulationError
        If a controller or an event cannot be linearised; the message says which and why.
    """
    _refuse(run.robot, run, until)
    instants = _instants(run, begin, until)
    times = [begin, *(events[0].time for events in instants)]
    bounds = list(pairwise(times if section else [*times, until]))
    held = [_active(run, *each, variation.braked) for each in bounds]
    flows, saltations, arrival = [], [], None
    for k, begin_and_end in enumerate(bounds):
        flows.append(variation.flow(*begin_and_end, held[k]))
        if k < len(instants):
            after = held[k + 1] if k + 1 < len(held) else None
            events = tuple(instants[k])
            instant = _Instant(run, events, held[k], after, variation.inputs, variation.braked)
            saltations.append(instant.saltation())
            arrival = instant.arrival() if after is None else None
    return Motion(tuple(flows), tuple(saltations), arrival)


def _refuse(robot: Robot, run: Run, period: float) -> None:
    """Refuse steps whose errors have no derivative that is known here."""
    if np.any(robot.model.dry_friction > 0.0):
        raise SimulationError(
            f"dry friction in the joints of {robot.name!r} cannot be linearised here; "
            "hs.find_limit_cycle takes differences instead"
        )
    if robot.constraints:
        raise SimulationError(
            f"constraints from outside of {robot.name!r} are not linearised here; "
            "hs.find_limit_cycle takes differences instead"
        )
    if run.saturations:
        raise SimulationError(
            "torques reached the limits of the motors, where a law cannot be "
            "linearised; hs.find_limit_cycle takes differences instead"
        )
    for event in run.events:
        if event.kind in NOT_SMOOTH and event.time <= period:
            raise SimulationError(
                f"an event of kind {event.kind.name} at t = {event.time:.6g} s cannot be "
                "linearised; hs.find_limit_cycle takes differences instead"
            )


def _instants(run: Run, begin: float, period: float) -> list[list[Event]]:
    """Events between two times, those of one instant together."""
    instants: list[list[Event]] = []
    for event in run.events:
        if not begin < event.time <= period + SAME_INSTANT:
            continue
        if instants and event.time - instants[-1][0].time <= SAME_INSTANT:
            instants[-1].append(event)
        else:
            instants.append([event])
    return instants


def _active(run: Run, begin: float, end: float, braked: tuple[int, ...]) -> ActiveContacts:
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
        joints=(*(int(j) for j in np.flatnonzero(run.stop_torque[row])), *braked),
    )


@dataclass(frozen=True)
class _Instant:
    """Events of one instant, what held before and what holds after, if the motion goes on."""

    run: Run
    events: tuple[Event, ...]
    held: ActiveContacts
    after: ActiveContacts | None
    inputs: Inputs
    braked: tuple[int, ...]
    """Joints that brakes hold."""

    @property
    def time(self) -> float:
        return self.events[0].time

    @cached_property
    def rows(self) -> tuple[int, int]:
        """Rows just before and just after."""
        there = np.flatnonzero(np.abs(self.run.time - self.time) <= SAME_INSTANT)
        return int(there[0]), int(there[-1])

    @cached_property
    def before(self) -> Floats:
        """Rate of the state before."""
        return self._rate(self.rows[0], self.held)

    @cached_property
    def rate(self) -> Floats:
        """Rate of the state after; none of a section."""
        if self.after is None:
            return np.zeros(len(self.before))
        return self._rate(self.rows[1], self.after)

    @cached_property
    def slopes(self) -> ContactSlopes:
        """Derivatives of gaps and velocities before."""
        run, row = self.run, self.rows[0]
        return contact_slopes(run.robot, run.position[row], run.velocity[row], run.ground)

    @cached_property
    def struck(self) -> list[Event]:
        """What receives impulses."""
        return [event for event in self.events if event.impulse[0] != 0.0]

    @cached_property
    def fresh(self) -> list[Event]:
        """Of these, what comes down; the others were on the ground or at their stops."""
        return [
            each for each in self.struck if self._gap_gradient(each) @ self.before < -APPROACHES
        ]

    def saltation(self) -> Saltation:
        kinds = tuple(dict.fromkeys(event.kind for event in self.events))
        switched = [event.contact for event in self.events if event.kind in SWITCHES]
        spread, matrix = 0.0, np.eye(len(self._wide(self.before)))
        if self.struck:
            matrices = [self._through(order) for order in self._orders()]
            matrix = np.mean(matrices, axis=0)
            spread = max(
                float(np.abs(one - other).max()) for one, other in product(matrices, matrices)
            )
        elif switched and self.after is not None:  # a speed that vanishes is the event
            speed = self.slopes.velocity[switched[0], 1]
            matrix = saltation_matrix(matrix, *map(self._wide, (speed, self.before, self.rate)))
        return Saltation(time=self.time, kinds=kinds, matrix=matrix, spread=spread)

    def arrival(self) -> Strike | None:
        """The one contact point that comes down."""
        if len(self.fresh) != 1 or self.fresh[0].kind.of_joint:
            return None
        return self._orders()[0][-1]

    def _rate(self, row: int, active: ActiveContacts) -> Floats:
        run = self.run
        q, v, torque = run.position[row], run.velocity[row], run.torque[row]
        acting = pushed(run.robot, q, run.pushes, float(run.time[row]))
        return linearize_contact(run.robot, q, v, torque, active, ground=run.ground, **acting).rate

    def _through(self, order: list[Strike]) -> Floats:
        """Matrix of what comes down in an order."""
        matrix = np.eye(len(self._wide(self.before)))
        for strike in order:
            after = self.rate if strike is order[-1] else strike.after
            rates = map(self._wide, (strike.gradient, strike.before, after))
            matrix = saltation_matrix(self._reset(strike), *rates) @ matrix
        return matrix

    def _wide(self, vector: Floats) -> Floats:
        """Return a vector over the state as one over state and inputs."""
        return np.concatenate([vector, np.zeros(self.inputs.size)])

    def _reset(self, strike: Strike) -> Floats:
        """Derivative of state and inputs after an impact by those before."""
        size = len(self.before)
        reset = np.eye(size + self.inputs.size)
        reset[:size, :size] = strike.impact.reset
        reset[:size, [size + column for column in self.inputs.of_numbers()]] = (
            strike.impact.by_numbers
        )
        return reset

    def _orders(self) -> list[list[Strike]]:
        """The orders in which points that come down together may do so."""
        if len(self.fresh) > MOST_TOGETHER:
            raise SimulationError(
                f"{len(self.fresh)} contact points come down together at t = {self.time:.6g} s: "
                "more orders than are gone through here"
            )
        orders = [order for each in permutations(self.fresh) if (order := self._in_order(each))]
        if not orders:
            raise SimulationError(
                f"the impact at t = {self.time:.6g} s cannot be linearised: no point lands in it, "
                "or several cannot land one after the other; hs.find_limit_cycle takes differences "
                "instead"
            )
        return orders

    def _in_order(self, order: Sequence[Event]) -> list[Strike]:
        """What comes down in an order; nothing if a point would not after those before it."""
        run, (first, last) = self.run, self.rows
        friction = float(run.ground.model().friction[0]) * run.robot.model.friction_scale
        others = [event for event in self.struck if event not in self.fresh]
        down = [
            (self._gap_gradient(event), self._struck([*order[:count], *others], friction))
            for count, event in enumerate(order, start=1)
        ]
        found = strikes(
            run.robot, run.position[first], run.velocity[first], self.before, run.torque[last],
            down, run.ground, self.inputs.numbers,
            pushed(run.robot, run.position[last], run.pushes, float(run.time[last])).get("force"),
        )  # fmt: skip
        if found:
            v = found[-1].impact.velocity
            off = float(np.abs(v - run.velocity[last]).max())
            if off > FITS * max(1.0, float(np.abs(v).max())):
                raise SimulationError(
                    f"the impact at t = {self.time:.6g} s cannot be linearised: points slide, "
                    f"bounce or lift off in it (velocities differ by {off:.3g}); "
                    "hs.find_limit_cycle takes differences instead"
                )
        return found

    def _struck(self, events: Sequence[Event], friction: Floats) -> ActiveContacts:
        """What receives impulses in an impact; `friction` is that of all points."""
        points = [event for event in events if not event.kind.of_joint]
        on_the_cone = [
            abs(event.impulse[1]) >= friction[event.contact] * event.impulse[0] * (1.0 - 1e-9)
            for event in points
        ]
        return ActiveContacts(
            resting=tuple(
                event.contact
                for event, slides in zip(points, on_the_cone, strict=True)
                if not slides
            ),
            sliding=tuple(
                (event.contact, -1 if event.impulse[1] > 0.0 else 1)
                for event, slides in zip(points, on_the_cone, strict=True)
                if slides
            ),
            joints=(*(event.contact for event in events if event.kind.of_joint), *self.braked),
        )

    def _gap_gradient(self, event: Event) -> Floats:
        """Derivative of what vanishes as a point comes down, or a joint comes to its stop."""
        if not event.kind.of_joint:
            gap: Floats = self.slopes.gap[event.contact]
            return gap
        model, gradient = self.run.robot.model, np.zeros(len(self.slopes.gap.T))
        # A sign of its own makes coming to either end a fall.
        middle = 0.5 * (model.lower[event.contact] + model.upper[event.contact])
        upper = self.run.position[self.rows[0], event.contact] > middle
        gradient[event.contact] = -1.0 if upper else 1.0
        return gradient
