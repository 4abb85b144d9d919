"""A closed loop as it is simulated, followed from step to step and kept in the middle of some."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from heelstrike.analysis.poincare_map import check_steps, is_wheel
from heelstrike.contact.ground import Ground
from heelstrike.contact.linearized.slopes import along_the_ground
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.errors import LimitCycleError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.method import Method
from heelstrike.sim.run import Event
from heelstrike.sim.simulation import CAN_GO_ON, Simulation
from heelstrike.sim.snapshot import Snapshot
from heelstrike.sim.whole_run import whole
from heelstrike.tolerances import SAME_ROW

LATE = 2.0
"""Disturbances (m, rad) are this many times the seconds between two calls, as a touchdown falls
somewhere between them and is felt at the end."""

UNEVEN = 10.0
"""The same, of a fixed step, where steps fall otherwise in every return."""

SMOOTH, ROUGH = 1e-5, 0.05
"""Least and largest disturbance that is chosen so."""

REBOUND = 0.3
"""Touchdowns that follow a step sooner than this part of the longest are of the same step."""


STANDS = 1e-4
"""A foot that is lifted by less than this (m) stands."""

FEW_ROWS = 10**9


@dataclass(frozen=True)
class Walk:
    """A walk, kept in the middle of every so many steps."""

    begins: tuple[Snapshot, ...]
    """One more than there are returns."""
    steps: int
    """Steps from one to the next."""
    duration: float
    length: float
    """duration, length: Of a return, in s and m."""


class ClosedLoop:
    """What is simulated.

    Parameters
    ----------
    robot : Robot
    controller : object with ``torque(t, state, contacts)``, or None
    state : State or Snapshot
    method, ground, control_period, record_every
        As of :class:`~heelstrike.Simulation`.

    Raises
    ------
    SimulationError
        If it has no steps that repeat.
    """

    def __init__(
        self, robot: Robot, controller: Controller | None, state: State | Snapshot, *,
        method: Method | None, ground: Ground | None, control_period: float | None,
        record_every: int = FEW_ROWS,
    ) -> None:  # fmt: skip
        self.robot, self.controller, self.ground = robot, controller, ground or Ground()
        if isinstance(state, Snapshot):  # rows are counted on
            record_every = int(state.identity.get("record_every", record_every))
        self._setup: dict[str, Any] = {
            "state": state, "method": method, "ground": ground, "control_period": control_period,
            "record_every": record_every,
        }  # fmt: skip
        check_steps(robot, self.ground)
        self.simulation = self.fresh()
        self.grid = self.simulation.control_period

    def fresh(self, farther: float = 0.0) -> Simulation:
        """Return a simulation at the beginning of the walk, or so many metres along the ground."""
        setup = self._setup
        if farther:
            q = setup["state"].q.copy()
            q[:2] += farther * self.along
            setup = setup | {"state": State(q, setup["state"].v)}
        return Simulation(self.robot, self.controller, **setup)

    @property
    def can_be_moved(self) -> bool:
        """Whether the walk can begin elsewhere: a snapshot knows where its feet stand."""
        return isinstance(self._setup["state"], State)

    def sampled(self, seconds: float) -> float:
        """Round to whole samples, if there are any."""
        return round(seconds / self.grid) * self.grid if self.grid > 0.0 else seconds

    def usual_disturbance(self, walk: Walk) -> float:
        """How large disturbances are if nobody says."""
        step = self.simulation.method.step_length
        if step is None:
            return float(np.clip(LATE * self.grid, SMOOTH, ROUGH))
        return SMOOTH if self.even(walk) else float(np.clip(UNEVEN * step, SMOOTH, ROUGH))

    def even(self, walk: Walk) -> bool:
        """Whether steps of the integration fall alike in every return."""
        # On another one the walk is as far on as it moves in one, much more than this.
        first = walk.begins[0].state.v
        fixed = self.simulation.method.step_length is not None
        return not fixed or all(
            np.abs(each.state.v - first).max() <= SMOOTH for each in walk.begins
        )

    @property
    def along(self) -> Floats:
        """Unit vector (x, z) along the ground."""
        return along_the_ground(self.ground)

    def advanced(self, simulation: Simulation, until: float, doing: str) -> None:
        """Simulate until a time, or say why that did not go.

        What is meant to be a sample is one to the last digit: a little later, the controller would
        have been asked.
        """
        sample = self.sampled(until)
        simulation.advance(sample if abs(sample - until) <= SAME_ROW else until)
        if simulation.status not in CAN_GO_ON:
            raise LimitCycleError(f"{doing}: {simulation.message}")
        if simulation.status is not CAN_GO_ON[0]:
            raise KeyboardInterrupt(simulation.message)

    def follow(self, settling: int, returns: int, longest: float) -> Walk:
        """Let it walk, and keep it in the middle of the steps from which returns begin."""
        feet = len({self.foot(i) for i in range(self.robot.nc)})
        wanted = settling + (returns + 1) * feet + 2
        landings = self._landings(wanted, longest)
        first = settling
        chosen = [first + k * feet for k in range(returns + 1)]
        if len({landings[place][1] for place in chosen}) > 1:
            raise LimitCycleError(
                f"the feet of {self.robot.name!r} do not land in turn, so no step repeats"
            )
        simulation, begins = self.fresh(), []
        middle = self.sampled(0.5 * (landings[first][0] + landings[first + 1][0]))
        for place in chosen:
            # Whole samples apart: of a walk that keeps step with them all returns have as many.
            gone = self.sampled(landings[place][0] - landings[first][0])
            self.advanced(simulation, middle + gone, "the undisturbed walk does not go on")
            begins.append(simulation.snapshot())
        way = (begins[-1].state.q[:2] - begins[0].state.q[:2]) @ self.along
        return Walk(
            begins=tuple(begins),
            steps=feet,
            duration=(begins[-1].time - begins[0].time) / returns,
            length=abs(float(way)) / returns,
        )

    def foot(self, contact: int) -> int:
        """What comes down as one: the points of a foot, or every spoke by itself."""
        return foot_of(self.robot, contact)

    def _stands(self, state: State) -> int | None:
        """Tell which foot stands, if it is one."""
        gap = contact_kinematics(self.robot, state.q, state.v, self.ground).gap
        feet = {self.foot(int(i)) for i in np.flatnonzero(gap <= STANDS)}
        return feet.pop() if len(feet) == 1 else None

    def _landings(self, wanted: int, longest: float) -> list[tuple[float, int]]:
        """When which foot first touched the ground, of the first so many steps."""
        simulation = self.fresh()
        begin, stands = simulation.time, self._stands(simulation.state)
        while True:
            before = len(steps_of(self.robot, whole(simulation.record).events, begin, stands))
            doing = f"the undisturbed walk ends after {before} steps, {wanted} are needed"
            self.advanced(simulation, simulation.time + longest, doing)
            steps = steps_of(self.robot, whole(simulation.record).events, begin, stands)
            if len(steps) >= wanted:
                return steps
            if len(steps) == before:
                raise LimitCycleError(
                    f"robot {self.robot.name!r} takes no step within {longest:g} s from t "
                    f"= {simulation.time - longest:.4g} s on; if its steps are longer, "
                    "raise longest_step"
                )


def steps_of(
    robot: Robot, events: Sequence[Event], begin: float, stands: int | None = None
) -> list[tuple[float, int]]:
    """When which foot touched the ground first, however often it bounced or rocked then.

    A foot may rock long after it has come down, and the other at the impact of this one: a step is
    one by another foot, some time later. At the beginning it is another than the one that stands
    then, if that is known.
    """
    landings = [
        (event.time, foot_of(robot, event.contact))
        for event in events
        if event.kind is EventKind.TOUCHDOWN and event.time > begin
    ]
    times = [begin, *(time for time, _ in landings)]
    apart = REBOUND * max(np.diff(times), default=0.0)
    alone = len({foot_of(robot, contact) for contact in range(robot.nc)}) == 1
    steps: list[tuple[float, int]] = []
    for time, foot in landings:
        last, standing = steps[-1] if steps else (begin, stands)
        if time - last > apart and (alone or foot != standing):
            steps.append((time, foot))
    return steps


def foot_of(robot: Robot, contact: int) -> int:
    """Tell what comes down as one: the points of a foot, or every spoke by itself."""
    if is_wheel(robot):
        return contact
    for place, foot in enumerate(robot.feet):
        if contact in foot.contacts:
            return place
    return len(robot.feet) + contact
