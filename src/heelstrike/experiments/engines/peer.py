"""What every other engine is asked: one small interface, and what makes a run of it valid."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from heelstrike.experiments.engines.scenario import Scenario
from heelstrike.field_texts import dataclass
from heelstrike.robot import Robot, State
from heelstrike.robot.model import Floats
from heelstrike.sim import TimeStepping

SINKING = 0.01
"""How far a standing robot may sink into soft ground, in m."""

ALWAYS = 0.99
"""Share of the steps in which all contacts must be active: hard ones may lose touch for a step."""

FLIGHT, FLIGHT_STEP = 0.1, 1e-3
FLIGHT_ERROR = 1e-3
"""How far the coordinates of a flight of 0.1 s in steps of 1 ms may be from ours, in m and rad.

Two methods of first order differ by ½ h t |a|: 5e-4 at 10 m/s² or rad/s². A wrong mass, axis or
direction of gravity moves them by ½ t² a, 5e-2.
"""


class InvalidRunError(Exception):
    """A run that does not count, and why."""


@dataclass(frozen=True)
class Touching:
    """How a robot touches the ground."""

    active: int
    """Contact points that the engine's solver was given."""
    force: float
    """Sum of their normal forces, in N."""
    depth: float
    """Deepest penetration, in m; negative or zero where there is none."""


class Peer(ABC):
    """A scenario in another engine.

    Attributes
    ----------
    scenario : Scenario
    step : float
        Seconds.
    steps : int
        Steps in the duration of the scenario.
    start : State
        Where runs start; `settle` moves it.
    commands : (steps or 1, nu) float
        Commands c of the law of control in each step; one row if they never change.
    zero : (nq,) float
        Our position where the engine's coordinates are zero: the reference, unless it has ours.
    done : int
        Steps since the start.
    seconds : float
        Computing time of the steps that `record` has taken.
    """

    settling: ClassVar[float] = 0.0
    """How long it takes soft ground to be pressed in, in s."""

    lacks: ClassVar[tuple[str, ...]] = ()
    """Members of a robot's model that the engine has nothing for."""

    tells_friction: ClassVar[bool] = True
    """Whether the engine says what the tangential forces of its contacts are."""

    tells_means: ClassVar[bool] = True
    """Whether the forces that it tells are means over a step, not those of the end of it."""

    bounces: ClassVar[bool] = True
    """Whether the engine takes a coefficient of restitution."""

    float32: ClassVar[bool] = False
    """Whether it computes in single precision."""

    def __init__(self, scenario: Scenario, step: float) -> None:
        self.scenario = scenario
        self.step = step
        self.steps = round(scenario.duration / step)
        self.start = scenario.state
        self.commands = _commands(scenario, step, self.steps)
        self.zero = scenario.robot.model.reference
        self.done = 0
        self.seconds = 0.0

    @abstractmethod
    def place(self, q: Floats, v: Floats) -> None:
        """Put the robot somewhere, at time 0.

        Parameters
        ----------
        q, v : (nq,) float, (nv,) float
            Position in the engine's coordinates, and velocity.
        """

    @abstractmethod
    def simulate(self, steps: int) -> None:
        """Simulate some steps after those that are `done`, in as few calls as the engine allows.

        Parameters
        ----------
        steps : int
            How many.
        """

    @abstractmethod
    def coordinates(self) -> tuple[Any, Any]:
        """Position in the engine's coordinates, and velocity, now."""

    @abstractmethod
    def contacts(self) -> list[tuple[float, float]]:
        """Normal force (N) and depth (m) of each contact that its solver is given."""

    @abstractmethod
    def hold(self, torque: Floats) -> None:
        """Apply torques in all steps from now on, in a scenario without a law of control.

        Parameters
        ----------
        torque : (nu,) float
            Torques of the actuators (N m).
        """

    @abstractmethod
    def forces(self) -> Floats:
        """Forces on the contact points of the robot in the last step, (nc, 2), in N.

        Upwards and forward, each the mean over the step; zero for points that do not touch.
        """

    def close(self) -> None:  # noqa: B027 - most have nothing to end
        """End what the engine has running; nothing where it runs in this process."""

    def record(self, steps: int) -> Floats:
        """Simulate some steps one by one, and tell what happened in each.

        Parameters
        ----------
        steps : int
            How many.

        Returns
        -------
        (steps, nq + nv + 2 nc) float
            In our coordinates: position and velocity after each step, and the forces in it.
        """
        robot = self.scenario.robot
        rows = np.zeros((steps, robot.nq + robot.nv + 2 * robot.nc))
        for row in rows:
            begin = perf_counter()
            self.advance(1)
            self.seconds += perf_counter() - begin
            q, v = self.coordinates()
            row[: robot.nq] = q
            row[robot.nq : robot.nq + robot.nv] = v
            row[robot.nq + robot.nv :] = self.forces().ravel()
        rows[:, : robot.nq] += self.zero
        return rows

    def restart(self) -> None:
        """Go back to `start`, at time 0."""
        self.done = 0
        self.place(self.start.q - self.zero, self.start.v)

    def advance(self, steps: int) -> None:
        """Simulate some steps.

        Parameters
        ----------
        steps : int
            How many.
        """
        self.simulate(steps)
        self.done += steps

    def hold_by_law(self, ahead: int) -> None:
        """Hold the torques of the scenario's law of control, in an engine that has none itself.

        Parameters
        ----------
        ahead : int
            Steps that `simulate` has taken already.
        """
        feedback = self.scenario.feedback
        if feedback is None:
            return
        row = self.commands[min(self.done + ahead, len(self.commands) - 1)]
        joints = self.scenario.robot.model.actuator_joint
        law, (q, v) = feedback.parameters, self.coordinates()
        self.hold(row - law.kp * q[joints] - law.kd * v[joints])

    def state(self) -> State:
        """Where it is now."""
        q, v = self.coordinates()
        return State(np.asarray(q) + self.zero, v)

    def touching(self) -> Touching:
        """How it touches the ground now."""
        contacts = self.contacts()
        depth = max((depth for _, depth in contacts), default=0.0)
        return Touching(len(contacts), sum(force for force, _ in contacts), depth)

    def settle(self, seconds: float) -> None:
        """Let it sink in first: start from where it is after a while.

        Parameters
        ----------
        seconds : float
            How long.
        """
        self.restart()
        self.advance(round(seconds / self.step))
        self.start = self.state()

    def run(self, steps: int | None = None) -> float:
        """Simulate from the start, to the end or some steps; return the seconds it took.

        Parameters
        ----------
        steps : int, optional
            How many; by default all of the scenario.

        Returns
        -------
        float
            Seconds of computing.
        """
        self.restart()
        begin = perf_counter()
        self.advance(self.steps if steps is None else steps)
        return perf_counter() - begin

    def check(self) -> dict[str, float]:
        """Step through once, looking at contacts and forces.

        Raises
        ------
        InvalidRunError
            If something that stands does not stand as it should.
        """
        self.restart()
        active, deepest, touching = [], 0.0, Touching(0, 0.0, 0.0)
        for _ in range(self.steps):
            self.advance(1)
            touching = self.touching()
            active.append(touching.active)
            deepest = max(deepest, touching.depth)
        scenario = self.scenario
        found = {
            "penetration_m": float(deepest),
            "active_contacts": float(np.mean(active)),
            "steps": float(self.steps),
        }
        if not np.all(np.isfinite(self.state().q)):
            raise InvalidRunError("its state is not finite")
        if scenario.contacts is not None:
            carried = touching.force / scenario.robot.weight
            found["weight_carried"] = float(carried)
            if np.mean(np.array(active) == scenario.contacts) < ALWAYS:
                raise InvalidRunError(
                    f"{min(active)} to {max(active)} of {scenario.contacts} contacts are active"
                )
            if abs(carried - 1.0) > 1e-2 or deepest > SINKING:
                raise InvalidRunError(
                    f"the ground carries {carried:.3f} of the weight and the robot sinks "
                    f"{1e3 * deepest:.1f} mm"
                )
        return found


@dataclass(frozen=True, kw_only=True)
class Engine:
    """An engine that simulates."""

    label: str
    """Name in tables and figures, with the way its steps are timed."""
    note: str
    """What its times include."""
    peer: Callable[..., Peer]
    """Makes the peer of a scenario with a step, in the fastest way that is valid, or another way
    that further keywords name."""


def check_flight(engine: Engine, robot: Robot) -> float:
    """Check that a robot flies as ours does; return the largest difference of a coordinate.

    It is what tells that the engine has the same robot: masses, inertias, lengths, axes, gravity.

    Parameters
    ----------
    engine : Engine
        The engine.
    robot : Robot
        The robot.

    Returns
    -------
    float
        Largest difference of a coordinate after the flight (rad, m).

    Raises
    ------
    InvalidRunError
        If it does not.
    """
    scenario = flight(robot)
    peer = engine.peer(scenario, FLIGHT_STEP)
    if peer.lacks:
        none: Any = {name: np.zeros(robot.nv) for name in peer.lacks}
        robot = replace(robot, model=robot.model.replaced(**none))
        scenario = replace(scenario, robot=robot)
        peer = engine.peer(scenario, FLIGHT_STEP)
    peer.run()
    ours = scenario.run(TimeStepping(step=FLIGHT_STEP)).position[-1]
    error = float(np.max(np.abs(peer.state().q - ours)))
    if not error <= FLIGHT_ERROR:
        raise InvalidRunError(f"in free flight it is {error:.1e} m or rad away after {FLIGHT} s")
    return error


def flight(robot: Robot) -> Scenario:
    """Return a robot that flies, turning in all joints, far from ground and stops."""
    model = robot.model
    q = model.reference.copy()
    inside = np.isfinite(model.lower) & np.isfinite(model.upper)
    q[inside] = 0.5 * (model.lower[inside] + model.upper[inside])
    if robot.floating:
        q[1] += 5.0
    v = np.where(np.arange(robot.nv) % 2, 1.0, -1.0)
    return Scenario(f"{robot.name} flying", robot, State(q, v), FLIGHT)


def _commands(scenario: Scenario, step: float, steps: int) -> Floats:
    feedback = scenario.feedback
    if feedback is None:
        return np.zeros((1, scenario.robot.nu))
    if feedback.parameters.coefficients.shape[2] == 1 and len(feedback.parameters.begins) == 1:
        return feedback.command([0.0])  # it never changes
    return feedback.command(step * np.arange(steps))
