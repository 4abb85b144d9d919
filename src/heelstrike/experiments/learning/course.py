"""Lanes in which robots do something for a reward: of them environments and trainers are made."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cache
from typing import Any, Protocol

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.compilation import loop_for
from heelstrike.control.policy.network import Layer, Network
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.robot import Robot
from heelstrike.robot.state import State
from heelstrike.sim import Batch

AT_RESET = 2
"""Terms, the first ones, that are told when an episode begins."""


class Task(Protocol):
    """What is to be learned, as a trainer knows it."""

    @property
    def max_episode_steps(self) -> int:
        """Decisions after which an episode is truncated."""

    @property
    def decision_period(self) -> float:
        """Seconds from one decision to the next."""

    @property
    def about(self) -> Mapping[str, str]:
        """What a policy tells of the task that it was trained for."""


class Course(ABC):
    """Lanes of a task, with actions, observations, rewards and ends.

    Parameters
    ----------
    task : Task
        What is to be learned.
    batch : Batch
        The robots.
    observed : int
        Numbers that are observed.
    names : sequence of str
        What is told of a step beside its reward; the first two also when an episode begins.
    gear : (nu,) float
        Torque (N m) for an action of 1.
    scale : (nu,) float, optional
        What is commanded for an action of 1; the torque by default.

    Attributes
    ----------
    observation : (n, no) float
        What is observed now.
    reward : (n,) float
        Of the last step.
    terminated : (n,) bool
        Which episodes are over: the robot is not healthy, or cannot be simulated any further.
    terms : (n, names) float
        What `names` says.
    """

    _skipped: int
    """Positions that are not observed."""

    def __init__(
        self, task: Task, batch: Batch, observed: int, names: tuple[str, ...], gear: Floats,
        scale: Floats | None = None,
    ) -> None:  # fmt: skip
        lanes = len(batch)
        self.task: Any = task
        self.batch, self.names, self.gear = batch, names, gear
        self.robot: Robot = batch.robot
        step = batch.method.step_length
        self._steps = 0 if step is None else max(round(task.decision_period / step), 1)
        self.observation = np.zeros((lanes, observed))
        self.reward = np.zeros(lanes)
        self.terminated = np.zeros(lanes, dtype=np.bool_)
        self.terms = np.zeros((lanes, len(names)))
        self._randoms = [np.random.default_rng() for _ in range(lanes)]
        self._before = np.zeros(lanes)
        self._action = np.zeros((lanes, self.robot.nu))
        self._scale = gear if scale is None else scale
        self._command = _command()

    def seed(self, lane: int, random: np.random.Generator) -> None:
        """Have everything random in a lane drawn from other numbers from now on.

        Parameters
        ----------
        lane : int
            Which.
        random : Generator
            What it is drawn from.
        """
        self._randoms[lane] = random

    @abstractmethod
    def begin(self, chosen: Integers) -> None:
        """Let lanes start again, each with noise of its own.

        Parameters
        ----------
        chosen : (k,) int
            Which lanes.
        """

    @abstractmethod
    def cause(self, lane: int) -> str:
        """Say why an episode is over.

        Parameters
        ----------
        lane : int
            Of which lane.

        Returns
        -------
        str
            In a person's words.
        """

    def network(
        self, layers: tuple[Layer, ...], mean: Floats, deviation: Floats, **more: Any
    ) -> Network:
        """Return a policy of this task.

        Parameters
        ----------
        layers : tuple of Layer
            From observation to action.
        mean, deviation : (no,) float
            What observations are normalised with.
        **more
            Further fields of :class:`~heelstrike.control.policy.network.Network`.

        Returns
        -------
        Network
            The policy.
        """
        task = self.task
        return Network(
            layers, task.decision_period, self.gear, mean, deviation, skipped=self._skipped,
            velocity_limit=task.velocity_limit, robot=self.robot.name, **more,
        )  # fmt: skip

    @abstractmethod
    def _assess(self, begun: Integers | None) -> None:
        """Observe and judge all lanes, or those that have just begun."""

    def step(self, action: ArrayLike, mask: NDArray[np.bool_] | None = None) -> None:
        """Make a decision in all lanes.

        Parameters
        ----------
        action : (n, nu) float
            Parts of the greatest torques, from -1 to 1; what is beyond is cut, and costs all the
            same.
        mask : (n,) bool, optional
            Which lanes move; all by default.

        Raises
        ------
        SimulationError
            If it is of another shape, or not finite.
        """
        given = np.asarray(action)
        if given.shape != self._action.shape or given.dtype.kind not in "fiu":
            raise SimulationError(
                f"an action has shape {self._action.shape} and numbers in it, got shape "
                f"{given.shape} of {given.dtype}"
            )
        self._action[:] = given
        batch = self.batch
        wrong = self._command(self._action, self._scale, batch._q, self._before, batch.command)
        if wrong >= 0:
            raise SimulationError(f"the action of lane {wrong} is not finite: {given[wrong]}")
        self._move(mask)
        self._assess(None)

    def _move(self, mask: NDArray[np.bool_] | None) -> None:
        """Move on until the next decision."""
        batch = self.batch
        if self._steps:
            batch.step(self._steps, mask)
        else:
            moves = np.ones(len(batch)) if mask is None else mask
            batch.advance(batch.time + moves * self.task.decision_period)

    def state_of(self, lane: int) -> State:
        """Return where a robot is."""
        return State(self.batch.position[lane], self.batch.velocity[lane])


@cache
def _command() -> Any:
    """Return what makes torques of actions; see `command` within."""

    def command(
        action: Floats, gear: Floats, q: Floats, before: Floats, torque: Floats
    ) -> int:  # fmt: skip
        """Write torques, and where robots are; return a lane whose action is no numbers, or -1."""
        wrong = -1
        for lane in range(action.shape[0]):
            before[lane] = q[lane, 0]
            for i in range(action.shape[1]):
                value = action[lane, i]
                if not abs(value) < np.inf:
                    wrong = lane
                torque[lane, i] = gear[i] * min(max(value, -1.0), 1.0)
        return wrong

    table, vector = types.float64[:, ::1], types.float64[::1]
    signature = types.int64(table, vector, types.float64[:, :], vector, table)
    return loop_for(signature, command)
