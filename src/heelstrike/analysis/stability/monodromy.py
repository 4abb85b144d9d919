"""The linearisation of a step that repeats, event by event, and what footholds do to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.linearized_step import linearized_step
from heelstrike.analysis.poincare_map import PoincareMap, Section
from heelstrike.analysis.stability.sensitivity import gait_sensitivity_norm
from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.errors import LimitCycleError, SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim.controller.interface import Controller
from heelstrike.sim.event_driven.method import EventDriven
from heelstrike.sim.linearized.step import Motion, Saltation

REPEATS = 1e-5
"""A state and its image one step later differ by less (m, rad, m/s, rad/s), or nothing repeats."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StepHeight:
    """What the height of the next foothold does to a step."""

    state: Floats
    """(nq + nv,) Errors (δq, δv) at the next touchdown for a metre of height, seen from the new
    foothold. The foot behind is not level with it then: they are none of those that `tangent`
    spans."""
    duration_state: Floats
    """(nq + nv,) Change of the step's duration by errors at its beginning (s/m, s/rad, s²/m,
    s²/rad)."""
    duration: float
    """Change of its duration by the height (s/m)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Monodromy:
    """The linearisation of a step that repeats."""

    period: float
    """Duration of the step in s."""
    motion: Motion
    """Its linearisation, until the touchdown that ends it."""
    relabelling: Floats
    """(nq + nv, nq + nv) Exchange of the legs and the way back along the ground."""
    tangent: Floats
    """(nq + nv, m) Orthonormal basis of the errors that the feet on the ground allow."""
    normal: Floats
    """(nq + nv,) What the ground's rise by a metre does to a state that is seen from it."""

    @property
    def flows(self) -> tuple[Floats, ...]:
        """What the smooth motion before each event does to errors (δq, δv), (nq + nv, nq + nv)."""
        return self.motion.flows

    @property
    def saltations(self) -> tuple[Saltation, ...]:
        """What the events do, in their order; the last is the touchdown that ends the step."""
        return self.motion.saltations

    @cached_property
    def matrix(self) -> Floats:
        """Error (δq, δv) at the next touchdown, relabelled, of one at this; (nq + nv, nq + nv)."""
        matrix: Floats = self.relabelling @ self.motion.matrix
        return matrix

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
        last = self.motion.arrival
        if last is None:
            raise SimulationError(
                "several contact points land at once at the end of this step, so its "
                "response to a higher foothold has no derivative"
            )
        crossing = float(last.gradient @ last.before)
        struck = last.impact.reset @ last.before
        return StepHeight(
            state=self.relabelling @ (struck / crossing - self.normal),
            duration_state=-(last.gradient @ self.motion.until_the_last) / crossing,
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

    The multipliers are those of :func:`~heelstrike.find_limit_cycle`, which linearises steps in the
    same way; here are the flows, the saltations and what the height of a foothold does, too.

    Parameters
    ----------
    robot : Robot
        The robot; without dry friction in its joints.
    state : State
        Just after a touchdown of a walk that repeats, as ``find_limit_cycle(...).state``.
    controller : object with ``torque(t, state, contacts)``, or None
        A compiled one that acts continuously. As in `find_limit_cycle` it restarts at every
        touchdown.
    ground : Ground
        Flat or sloping ground; ``Ground()`` by default.
    method : EventDriven
        Simulation method, ``EventDriven(rtol=1e-12, atol=1e-13)`` by default.
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
    change = float(np.abs(landed.state.vector - begin.vector).max())
    if change > REPEATS:
        raise LimitCycleError(
            f"this step does not repeat: the state changes by {change:.3g} from touchdown to "
            "touchdown. Begin with the state of hs.find_limit_cycle"
        )
    normal = np.zeros(robot.nq + robot.nv)
    normal[:2] = ground.model().normal[0]
    found = linearized_step(step, state, landed)
    return Monodromy(
        period=landed.time,
        motion=found.motion,
        relabelling=found.relabelling,
        tangent=section.chart(begin).directions,
        normal=normal,
    )
