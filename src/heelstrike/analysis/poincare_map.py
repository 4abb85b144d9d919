"""The Poincaré map of a walk: from just after one touchdown to just after the next.

Between the two the legs change their parts. So that a walk which repeats is a fixed point, the
state after touchdown is relabelled - left and right exchanged, a wheel turned by whole spokes - and
moved back along the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.contact.linearized.slopes import along_the_ground, plane
from heelstrike.contact.linearized.standing import Chart, Standing
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.event_driven.method import EventDriven
from heelstrike.sim.linearized.step import SAME_INSTANT
from heelstrike.sim.run import Run
from heelstrike.sim.simulation import Simulation
from heelstrike.sim.whole_run import whole
from heelstrike.tolerances import CLOSED_GAP

Flags = NDArray[np.bool_]

# A state this deep (m) in the ground is lifted out of it: penetration of other methods.
SHALLOW = 1e-4
AT_REST = 1e-8
# Steps of a walk differ by less than this factor in time: what is simulated beyond a touchdown.
SLACK = 1.2


@dataclass(frozen=True)
class Section:
    """States just after a touchdown, as the contact points see them."""

    robot: Robot
    ground: Ground

    def contacts(self, state: State) -> tuple[Floats, Floats, Floats]:
        """Places along the ground, gaps and velocities (normal, tangent) of the contact points."""
        seen = contact_kinematics(self.robot, state.q, state.v, self.ground)
        return seen.position @ along_the_ground(self.ground), seen.gap, seen.velocity

    def standing(self, state: State) -> tuple[Flags, Flags]:
        """Which points are on the ground, (nc,), and along which directions at rest, (nc, 2)."""
        _, gap, velocity = self.contacts(state)
        touching = np.abs(gap) <= CLOSED_GAP
        at_rest = np.abs(velocity) <= AT_REST
        at_rest[:, 0] &= touching
        at_rest[:, 1] &= at_rest[:, 0]
        return touching, at_rest

    def held(self, state: State) -> Integers:
        """Joints that are, at rest, where latches hold them or have just let go of them."""
        model = self.robot.model
        joint, above = model.latch_joint, model.latch_side > 0
        way = np.where(above, model.upper[joint], model.lower[joint]) - state.q[joint]
        there = (np.abs(way) <= CLOSED_GAP) & (np.abs(state.v[joint]) <= AT_REST)
        return np.asarray(joint[there])

    def chart(self, state: State) -> Chart:
        """Return coordinates of the states on the section near one of them."""
        touching, at_rest = self.standing(state)
        standing = Standing(
            self.robot, self.ground, touching, at_rest, self.foothold(state), self.held(state)
        )
        return Chart(standing, state.vector)

    def foothold(self, state: State) -> int:
        """First contact point that stands, or else the lowest."""
        _, gap, _ = self.contacts(state)
        _, at_rest = self.standing(state)
        return int(np.argmax(at_rest[:, 0]) if at_rest.any() else np.argmin(gap))

    def lifted(self, state: State) -> State:
        """Return the state with the robot raised out of the ground, if it is a little in it."""
        _, gap, _ = self.contacts(state)
        depth = -float(gap.min(initial=0.0))
        if not 0.0 < depth <= SHALLOW:
            return state
        q = state.q.copy()
        q[:2] += depth * np.array(plane(self.ground)[0])
        return State(q, state.v)

    def moved_back(self, state: State) -> tuple[State, float]:
        """Return the state with its foothold level with the world's origin, and how far it was."""
        place, _, _ = self.contacts(state)
        distance = float(place[self.foothold(state)])
        q = state.q.copy()
        q[:2] -= distance * along_the_ground(self.ground)
        return State(q, state.v), distance


def derivative(function: Callable[[Floats], Floats], size: int, change: float) -> Floats:
    """Derivative of a function of a vector at zero, (m, size), by central differences."""
    columns = [
        (function(each) - function(-each)) / (2.0 * change) for each in change * np.eye(size)
    ]
    return np.array(columns).reshape(size, -1).T


@dataclass(frozen=True)
class Landing:
    """The end of a step: the state on the section, the time it took (s), its length (m).

    And what the controller remembers of it, as far as that is carried on, and the contact point
    that landed last.
    """

    state: State
    time: float
    length: float
    memory: Floats
    contact: int


@dataclass(frozen=True)
class Carried:
    """What a controller remembers from step to step."""

    names: tuple[str, ...] = ()
    """Members of its memory."""
    relabelled: Callable[[Any, float], None] | None = None
    """``relabelled(memory, time)`` makes of the memory at the end of a step, which took a time,
    that at the beginning of the next: legs exchanged, times counted again."""

    def of(self, simulation: Simulation) -> Floats:
        """Return the numbers that are carried, (m,)."""
        views = {name: values for name, _, values in simulation.memory.views()}
        unknown = [name for name in self.names if name not in views]
        if unknown:
            raise SimulationError(
                f"the controller's memory has no {', '.join(unknown)}; it has "
                f"{', '.join(views) or 'no members'}"
            )
        taken = [np.ravel(views[name]).astype(np.float64) for name in self.names]
        return np.concatenate((*taken, np.zeros(0)))

    def put(self, numbers: Floats, simulation: Simulation) -> None:
        """Write numbers that :meth:`of` returned."""
        begin = 0
        views = {name: values for name, _, values in simulation.memory.views()}
        for name in self.names:
            values = views[name]
            values[...] = numbers[begin : begin + values.size].reshape(values.shape)
            begin += values.size


class PoincareMap:
    """Steps of a walk, one at a time.

    Parameters
    ----------
    section : Section
    controller : object with ``torque(t, state, contacts)``, or None
    method : EventDriven
    landing : sequence of int, optional
        Contact points all of which must have come down to complete a step.
    symmetry : callable, optional
        Relabels the legs after a step.
    longest : float
        Seconds after which a step has failed.
    control_period : float, optional
        Seconds between two calls of the controller, counted from the beginning of the step.
    carried : Carried
        What the controller remembers from step to step; the rest starts again.

    Raises
    ------
    SimulationError
        If it does not tell when a step is complete and what comes after it.
    """

    def __init__(
        self,
        section: Section,
        controller: Controller | None,
        method: EventDriven,
        landing: Sequence[int] | None,
        symmetry: Callable[[State], State] | None,
        longest: float,
        control_period: float | None = None,
        carried: Carried = Carried(),  # noqa: B008 - it is frozen
    ) -> None:
        robot = section.robot
        self.section = section
        self._controller = controller
        self._control_period = control_period
        self._carried = carried
        self._method = method
        self._longest = longest
        self._expected = longest
        if landing is not None and not (landing and set(landing) <= set(range(robot.nc))):
            raise SimulationError(
                f"landing must name contact points from 0 to {robot.nc - 1}, got {landing}"
            )
        if landing is not None:
            self._feet = [frozenset(landing)]
        elif robot.mirror is not None:
            self._feet = [frozenset(foot.contacts) for foot in robot.feet]
        else:
            self._feet = [frozenset((i,)) for i in range(robot.nc)]
        self.relabelled: Callable[[State, int], State]
        if symmetry is not None:
            self.relabelled = lambda state, _: symmetry(state)
        elif landing is not None:
            self.relabelled = lambda state, _: state
        elif (mirror := robot.mirror) is not None:
            self.relabelled = lambda state, _: mirror.state(state)
        elif is_wheel(robot):
            self.relabelled = lambda state, contact: turned(robot, state, contact)
        else:
            raise SimulationError(
                f"robot {robot.name!r} has no mirror image: give the contact points that "
                "complete a step (landing) and, if the legs swap roles, how (symmetry)"
            )

    def begin(self, state: State) -> Floats:
        """Return what the controller remembers at first, of what is carried."""
        if not self._carried.names:
            return np.zeros(0)
        return self._carried.of(self._simulation(state, None))

    def __call__(self, state: State, memory: Floats | None = None) -> Landing:
        """Take one step, with what the controller remembers.

        Raises
        ------
        LimitCycleError
            If it is not completed.
        """
        run, time, contact = self._walk(state, memory)
        row = np.flatnonzero(run.time <= time + SAME_INSTANT)[-1]
        after = self.relabelled(State(run.position[row], run.velocity[row]), contact)
        after, end = self.section.moved_back(after)
        _, begin = self.section.moved_back(state)
        left = np.zeros(0)
        if self._carried.names:
            again = self._simulation(state, memory)
            again.advance(time)
            if self._carried.relabelled is not None:
                self._carried.relabelled(again.memory, time)
            left = self._carried.of(again)
        return Landing(after, time, abs(end - begin), left, contact)

    @property
    def carries(self) -> tuple[str, ...]:
        """What the controller remembers from step to step, by name."""
        return self._carried.names

    def simulation(self, state: State) -> Simulation:
        """Begin a step with all rows, of a controller that carries nothing."""
        return self._simulation(state, None, self._method)

    def _simulation(
        self, state: State, memory: Floats | None, method: EventDriven | None = None
    ) -> Simulation:
        """Begin a step. Only the rows of events are looked at."""
        method = replace(self._method, output_period=self._longest) if method is None else method
        simulation = Simulation(
            self.section.robot, self._controller, state=state, method=method,
            ground=self.section.ground, control_period=self._control_period,
        )  # fmt: skip
        if memory is not None and self._carried.names:
            self._carried.put(memory, simulation)
        return simulation

    def _walk(self, state: State, memory: Floats | None = None) -> tuple[Run, float, int]:
        """Simulate beyond the end of a step; return the run, that time and the point that landed.

        Steps take about as long as the one before; where that is too short, they get the longest.
        """
        for duration in (min(SLACK * self._expected, self._longest), self._longest):
            simulation = self._simulation(state, memory)
            simulation.advance(duration)
            run = whole(simulation.record)
            down: set[int] = set()
            for event in run.events:
                if event.kind is EventKind.TOUCHDOWN and event.time > 0.0:
                    down.add(event.contact)
                elif event.kind is EventKind.LIFTOFF:
                    down.discard(event.contact)
                if any(foot <= down for foot in self._feet):
                    self._expected = event.time
                    return run, event.time, event.contact
            if not run.completed:
                break
        lasted = f" in {run.time[-1]:.6g} s" if len(run.time) else ""
        raise LimitCycleError(
            f"robot {run.robot.name!r} did not complete a step{lasted} "
            f"({run.message}); begin nearer to the cycle"
        )


def check_steps(robot: Robot, ground: Ground) -> None:
    """Refuse robots and ground on which no step repeats.

    Raises
    ------
    SimulationError
        If the ground is not one line, or the robot not free to move along it.
    """
    if len(ground.model().friction) > 1:
        raise SimulationError(
            "a step repeats only on flat or sloping ground that is the same at every step"
        )
    if not np.array_equal(robot.model.axis[:2], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]):
        raise SimulationError(
            "a step repeats only for a robot that is free to move along the ground; the "
            f"first two coordinates of {robot.name!r} are not its position x, z"
        )


def is_wheel(robot: Robot) -> bool:
    """Whether all contact points are spokes of one wheel: evenly spaced, balanced on its hinge."""
    model = robot.model
    links = np.unique(model.contact_link)
    if len(links) != 1 or robot.nc < 3:
        return False
    (link,) = links
    spokes = model.contact_position @ np.array([1j, 1.0])  # angles about +y, from the vertical
    angles = np.sort(np.angle(spokes))
    gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    return bool(
        model.axis[link, 0] != 0.0
        and np.ptp(np.abs(spokes)) < 1e-9
        and np.ptp(gaps) < 1e-9
        and np.ptp(model.contact_radius) < 1e-9
        and np.abs(model.center_of_mass[link]).max() < 1e-9
    )


def turned(robot: Robot, state: State, contact: int) -> State:
    """Return the state of a wheel turned by whole spokes: point 0 takes the place of `contact`."""
    model = robot.model
    link = int(model.contact_link[0])
    spokes = model.contact_position @ np.array([1j, 1.0])
    turn = float(np.angle(spokes[contact] / spokes[0]))
    q = state.q.copy()
    q[link] += model.axis[link, 0] * turn
    return State(q, state.v)
