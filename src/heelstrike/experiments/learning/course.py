"""Lanes in which robots run for a reward: what environments and the trainer are made of."""

from __future__ import annotations

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
from heelstrike.sim import Batch, HeldTorque, Method, TimeStepping

TERMS = ("x_position", "z_distance_from_origin", "x_velocity", "reward_forward", "reward_ctrl",
         "reward_survive")  # fmt: skip
"""What is told of a step beside its reward."""

AT_ONCE = 16
"""Episodes for which noise is drawn at once."""


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
    method : Method, optional
        Way through time; time stepping at the step of the task by default.

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

    def __init__(
        self, task: RunningTask, lanes: int = 1, *, threads: int = 1, method: Method | None = None
    ) -> None:
        robot = task.robot()
        self.task, self.robot = task, robot
        self.initial = robot.reference_state()
        self.batch = Batch(
            robot, HeldTorque(robot), state=self.initial, lanes=lanes, threads=threads,
            method=TimeStepping(step=task.step) if method is None else method,
            ground=Ground(friction=task.friction),
            stop_when_fallen=False,
        )  # fmt: skip
        step = self.batch.method.step_length
        self._steps = 0 if step is None else max(round(task.decision_period / step), 1)
        self.gear = task.gear(robot)
        self._skipped = int(task.exclude_current_positions_from_observation)
        size = robot.nq + robot.nv - self._skipped
        self.observation = np.zeros((lanes, size))
        self.reward = np.zeros(lanes)
        self.terminated = np.zeros(lanes, dtype=np.bool_)
        self.terms = np.zeros((lanes, len(TERMS)))
        self._start = self.initial.vector
        self._randoms = [np.random.default_rng() for _ in range(lanes)]
        self._noise = np.zeros((lanes, AT_ONCE, robot.nq + robot.nv))
        self._drawn = np.full(lanes, AT_ONCE, dtype=np.int64)
        self._before = np.zeros(lanes)
        self._action = np.zeros((lanes, robot.nu))
        self._numbers = np.array([
            task.decision_period, task.forward_reward_weight, task.ctrl_cost_weight,
            task.healthy_reward, *task.healthy_z_range, *task.healthy_angle_range,
            *task.healthy_state_range, task.velocity_limit, self.initial.q[1],
            float(task.terminate_when_unhealthy),
        ])  # fmt: skip
        self._command, self._judge = _command(), _judge()
        self._assess(self._every)

    @property
    def _every(self) -> Integers:
        return np.arange(len(self.batch))

    def seed(self, lane: int, random: np.random.Generator) -> None:
        """Have the noise of a lane drawn from other random numbers from now on.

        Parameters
        ----------
        lane : int
            Which.
        random : Generator
            What it is drawn from, positions first. It is drawn for several episodes at once.
        """
        self._randoms[lane] = random
        self._drawn[lane] = AT_ONCE

    def begin(self, chosen: Integers) -> None:
        """Let lanes begin anew, each with noise of its own.

        Parameters
        ----------
        chosen : (k,) int
            Which lanes.
        """
        drawn = self._drawn[chosen]
        for lane in chosen[drawn == AT_ONCE].tolist():
            self._draw(lane)
        drawn %= AT_ONCE
        noise = self._noise[chosen, drawn]
        self._drawn[chosen] = drawn + 1
        noise += self._start
        nq = self.robot.nq
        self.batch._begin_anew(chosen, noise[:, :nq], noise[:, nq:])
        self._assess(chosen)

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
        wrong = self._command(self._action, self.gear, batch._q, self._before, batch.command)
        if wrong >= 0:
            raise SimulationError(f"the action of lane {wrong} is not finite: {given[wrong]}")
        if self._steps:
            batch.step(self._steps, mask)
        else:
            moves = np.ones(len(batch)) if mask is None else mask
            batch.advance(batch.time + moves * self.task.decision_period)
        self._assess(None)

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
        if batch.outcome[lane] > 1:
            return batch.message(lane)
        q, v = batch.position[lane].tolist(), batch.velocity[lane].tolist()
        for name, unit, values, (low, high) in (
            ("the height of the trunk", " m", q[1:2], task.healthy_z_range),
            ("its pitch", " rad", q[2:3], task.healthy_angle_range),
            ("a position or velocity", "", q[2:] + v, task.healthy_state_range),
        ):
            for value in values:
                if not low < value < high:
                    return f"{name} is {value:.3g}{unit}, out of {low:g} to {high:g}"
        return "it is healthy"

    def _draw(self, lane: int) -> None:
        """Draw the noise of the next episodes of a lane."""
        task, robot, random = self.task, self.robot, self._randoms[lane]
        scale, noise = task.reset_noise_scale, self._noise[lane]
        if not task.normal_noise:
            noise[:] = random.uniform(-scale, scale, noise.shape)
            return
        for row in noise:
            row[: robot.nq] = random.uniform(-scale, scale, robot.nq)
            row[robot.nq :] = scale * random.standard_normal(robot.nv)

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
