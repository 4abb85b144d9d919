"""Lanes in which robots run for a reward: what environments and the trainer are made of."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.compilation import loop_for
from heelstrike.contact.ground import Ground
from heelstrike.errors import SimulationError
from heelstrike.experiments.learning.tasks import RunningTask
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.state import State
from heelstrike.sim import Batch, HeldTorque, TimeStepping

TERMS = ("x_position", "z_distance_from_origin", "x_velocity", "reward_forward", "reward_ctrl",
         "reward_survive")  # fmt: skip
"""What is told of a step beside its reward."""


class Course:
    """Lanes of a task, with actions, observations, rewards and ends.

    Parameters
    ----------
    task : RunningTask
        What is to be learned.
    lanes : int
        How many.
    threads : int
        Threads that move them.

    Attributes
    ----------
    batch : Batch
        The robots.
    observation : (n, no) float
        What is observed now.
    reward : (n,) float
        Of the last step.
    terminated : (n,) bool
        Which episodes are over: the robot is not healthy, or cannot be simulated any further.
    terms : (n, 6) float
        What :data:`TERMS` names.
    """

    def __init__(self, task: RunningTask, lanes: int = 1, *, threads: int = 1) -> None:
        robot = task.robot()
        self.task, self.robot = task, robot
        self.initial = robot.reference_state()
        self.batch = Batch(
            robot, HeldTorque(robot), state=self.initial, lanes=lanes, threads=threads,
            method=TimeStepping(step=task.step), ground=Ground(friction=task.friction),
            stop_when_fallen=False,
        )  # fmt: skip
        self.gear = robot.model.torque_upper.copy()
        self._skipped = int(task.exclude_current_positions_from_observation)
        size = robot.nq + robot.nv - self._skipped
        self.observation = np.zeros((lanes, size))
        self.reward = np.zeros(lanes)
        self.terminated = np.zeros(lanes, dtype=np.bool_)
        self.terms = np.zeros((lanes, len(TERMS)))
        self._before = np.zeros(lanes)
        self._action = np.zeros((lanes, robot.nu))
        self._numbers = np.array([
            task.decision_period, task.forward_reward_weight, task.ctrl_cost_weight,
            task.healthy_reward, *task.healthy_z_range, *task.healthy_angle_range,
            *task.healthy_state_range, task.velocity_limit, self.initial.q[1],
            float(task.terminate_when_unhealthy),
        ])  # fmt: skip
        self._judge = _judge()
        self._assess(self._every)

    @property
    def _every(self) -> Integers:
        return np.arange(len(self.batch))

    def begin(self, chosen: Integers, randoms: Sequence[np.random.Generator]) -> None:
        """Let lanes begin anew, each with noise of its own.

        Parameters
        ----------
        chosen : (k,) int
            Which lanes.
        randoms : sequence of k Generator
            What the noise of each is drawn from, positions first.
        """
        q, v = self._noise(randoms)
        batch = self.batch
        batch._begin_anew(chosen, self.initial.q + q, self.initial.v + v)
        self._assess(chosen)

    def step(self, action: ArrayLike) -> None:
        """Make a decision in all lanes.

        Parameters
        ----------
        action : (n, nu) float
            Parts of the greatest torques, from -1 to 1; what is beyond is cut, and costs all the
            same.

        Raises
        ------
        SimulationError
            If it is of another shape, or not finite.
        """
        self._action[:] = self.checked(action)
        np.clip(self._action, -1.0, 1.0, out=self.batch.command)
        self.batch.command *= self.gear
        self._before[:] = self.batch.position[:, 0]
        self.batch.step(self.task.frame_skip)
        self._assess(None)

    def checked(self, action: ArrayLike) -> NDArray[Any]:
        """Return an action as an array of numbers, or refuse it."""
        given = np.asarray(action)
        if given.shape != self._action.shape or given.dtype.kind not in "fiu":
            raise SimulationError(
                f"an action has shape {self._action.shape} and numbers in it, got shape "
                f"{given.shape} of {given.dtype}"
            )
        if not np.isfinite(given).all():
            lane = int(np.flatnonzero(~np.isfinite(given).all(axis=1))[0])
            raise SimulationError(f"the action of lane {lane} is not finite: {given[lane]}")
        return given

    def state_of(self, lane: int) -> State:
        """Return where a robot is."""
        return State(self.batch.position[lane], self.batch.velocity[lane])

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
        batch, task = self.batch, self.task
        if not batch.going[lane]:
            return batch.message(lane)
        q, v = batch.position[lane], batch.velocity[lane]
        ranges = (
            ("the height of the trunk", "m", q[1:2], task.healthy_z_range),
            ("its pitch", "rad", q[2:3], task.healthy_angle_range),
            ("a position or velocity", "", np.append(q[2:], v), task.healthy_state_range),
        )
        for name, unit, values, (low, high) in ranges:
            out = values[~((low < values) & (values < high))]
            if out.size:
                return f"{name} is {out[0]:.3g} {unit}, out of {low:g} to {high:g}".replace(
                    "  ", " "
                )
        return "it is healthy"

    def _noise(self, randoms: Sequence[np.random.Generator]) -> tuple[Floats, Floats]:
        task, robot = self.task, self.robot
        scale = task.reset_noise_scale
        q, v = np.empty((len(randoms), robot.nq)), np.empty((len(randoms), robot.nv))
        for place, random in enumerate(randoms):
            q[place] = random.uniform(-scale, scale, robot.nq)
            if task.normal_noise:
                v[place] = scale * random.standard_normal(robot.nv)
            else:
                v[place] = random.uniform(-scale, scale, robot.nv)
        return q, v

    def _assess(self, begun: Integers | None) -> None:
        """Observe and judge all lanes, or those that have just begun."""
        batch = self.batch
        if begun is not None:
            self._before[begun] = batch.position[begun, 0]
        self._judge(
            self._skipped, self._numbers, batch._q, batch._v, batch._outcome, self._before,
            self._action, self.terms, self.observation, self.reward, self.terminated,
        )  # fmt: skip


@cache
def _judge() -> Any:
    """Return what observes and judges; see `judge` within."""

    def judge(
        skipped: int, numbers: Floats, q: Floats, v: Floats, outcome: Integers, before: Floats,
        action: Floats, terms: Floats, observation: Floats, reward: Floats, terminated: Any,
    ) -> int:  # fmt: skip
        """Write observations, rewards with their terms, and which episodes are over."""
        period, forward_weight, action_weight, alive = (
            numbers[0],
            numbers[1],
            numbers[2],
            numbers[3],
        )
        limit, origin = numbers[10], numbers[11]
        for lane in range(q.shape[0]):
            place = 0
            healthy = goes_on = outcome[lane] <= 1
            for i in range(q.shape[1]):
                if i >= skipped:
                    observation[lane, place] = q[lane, i]
                    place += 1
                if i >= 2:
                    healthy = healthy and numbers[8] < q[lane, i] < numbers[9]
            for i in range(v.shape[1]):
                observation[lane, place] = min(max(v[lane, i], -limit), limit)
                place += 1
                healthy = healthy and numbers[8] < v[lane, i] < numbers[9]
            healthy = healthy and numbers[4] < q[lane, 1] < numbers[5]
            healthy = healthy and numbers[6] < q[lane, 2] < numbers[7]
            cost = 0.0
            for i in range(action.shape[1]):
                cost += action[lane, i] * action[lane, i]
            speed = (q[lane, 0] - before[lane]) / period
            terms[lane, 0] = q[lane, 0]
            terms[lane, 1] = q[lane, 1] - origin
            terms[lane, 2] = speed
            terms[lane, 3] = forward_weight * speed
            terms[lane, 4] = -action_weight * cost
            terms[lane, 5] = alive if healthy else 0.0
            reward[lane] = terms[lane, 3] + terms[lane, 5] + terms[lane, 4]
            terminated[lane] = not goes_on or (not healthy and numbers[12] != 0.0)
        return 0

    table, columns = types.float64[:, ::1], types.float64[:, :]
    vector, integers = types.float64[::1], types.int64[::1]
    return loop_for(
        types.int64(
            types.int64, vector, columns, columns, integers, vector, table, table, table, vector,
            types.boolean[::1],
        ),
        judge,
    )  # fmt: skip
