"""Lanes in which robots run for the reward of Gymnasium's environments."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from heelstrike.compiler.compilation import loop_for
from heelstrike.contact.ground import Ground
from heelstrike.experiments.learning.course import Course
from heelstrike.experiments.learning.tasks import RunningTask
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim import Batch, HeldTorque, Method, TimeStepping

TERMS = ("x_position", "z_distance_from_origin", "x_velocity", "reward_forward", "reward_ctrl",
         "reward_survive")  # fmt: skip
"""What is told of a step beside its reward."""

AT_ONCE = 16
"""Episodes for which noise is drawn at once."""


class RunningCourse(Course):
    """Lanes of a running task.

    Parameters
    ----------
    task : RunningTask
        What is to be learned.
    lanes : int
        How many.
    threads : int
        Threads that move them.
    method : Method, optional
        Simulation method; time stepping at the step of the task by default.
    """

    def __init__(
        self, task: RunningTask, lanes: int = 1, *, threads: int = 1, method: Method | None = None
    ) -> None:
        robot = task.robot()
        self.task: RunningTask = task
        self.initial = robot.reference_state()
        batch = Batch(
            robot, HeldTorque(robot), state=self.initial, lanes=lanes, threads=threads,
            method=TimeStepping(step=task.step) if method is None else method,
            ground=Ground(friction=task.friction),
            stop_when_fallen=False,
        )  # fmt: skip
        self._skipped = int(task.exclude_current_positions_from_observation)
        size = robot.nq + robot.nv - self._skipped
        super().__init__(task, batch, size, TERMS, task.gear(robot))
        self._start = self.initial.vector
        self._noise = np.zeros((lanes, AT_ONCE, robot.nq + robot.nv))
        self._drawn = np.full(lanes, AT_ONCE, dtype=np.int64)
        self._numbers = np.array([
            task.decision_period, task.forward_reward_weight, task.ctrl_cost_weight,
            task.healthy_reward, *task.healthy_z_range, *task.healthy_angle_range,
            *task.healthy_state_range, task.velocity_limit, self.initial.q[1],
            float(task.terminate_when_unhealthy),
        ])  # fmt: skip
        self._new_q, self._new_v = np.zeros((lanes, robot.nq)), np.zeros((lanes, robot.nv))
        self._judge, self._take = _judge(), _take()
        self._all = np.arange(lanes)
        self._assess(self._all)

    def seed(self, lane: int, random: np.random.Generator) -> None:
        """See :meth:`Course.seed`; noise is drawn for several episodes at once."""
        super().seed(lane, random)
        self._drawn[lane] = AT_ONCE

    def begin(self, chosen: Integers) -> None:
        """Let lanes start again, each with noise of its own.

        Parameters
        ----------
        chosen : (k,) int
            Which lanes.
        """
        count = len(chosen)
        q, v = self._new_q[:count], self._new_v[:count]
        while (lane := self._take(chosen, self._start, self._noise, self._drawn, q, v)) >= 0:
            self._draw(lane)
            self._drawn[lane] = 0
        self.batch._begin_anew(chosen, q, v)
        self._assess(chosen)

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
        self._judge(
            self._all if begun is None else begun, begun is not None, self._skipped, self._numbers,
            batch._q, batch._v, batch._outcome, self._before, self._action, self.terms,
            self.observation, self.reward, self.terminated,
        )  # fmt: skip


@cache
def _take() -> Any:
    """Return what takes noise that was drawn before; see `take` within."""

    def take(
        chosen: Integers, start: Floats, noise: Floats, drawn: Integers, q: Floats, v: Floats
    ) -> int:
        """Write states to begin in, or return a lane for which noise has to be drawn first."""
        for lane in chosen:
            if drawn[lane] == noise.shape[1]:
                return int(lane)
        nq = q.shape[1]
        for place in range(chosen.shape[0]):
            lane = chosen[place]
            for i in range(nq):
                q[place, i] = start[i] + noise[lane, drawn[lane], i]
            for i in range(v.shape[1]):
                v[place, i] = start[nq + i] + noise[lane, drawn[lane], nq + i]
            drawn[lane] += 1
        return -1

    cube, table = types.float64[:, :, ::1], types.float64[:, ::1]
    whole = types.int64[::1]
    return loop_for(
        types.int64(whole, types.float64[::1], cube, whole, table, table), take
    )  # fmt: skip


@cache
def _judge() -> Any:
    """Return what observes and judges; see `judge` within."""

    def judge(
        lanes: Integers, begun: bool, skipped: int, numbers: Floats, q: Floats, v: Floats,
        outcome: Integers, before: Floats, action: Floats, terms: Floats, observation: Floats,
        reward: Floats, terminated: Any,
    ) -> int:  # fmt: skip
        """Write observations, rewards with their terms, and which episodes are over."""
        period, forward_weight, action_weight, alive = (
            numbers[0],
            numbers[1],
            numbers[2],
            numbers[3],
        )
        limit, origin = numbers[10], numbers[11]
        for lane in lanes:
            place = 0
            if begun:
                before[lane] = q[lane, 0]
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
            integers, types.boolean, types.int64, vector, columns, columns, integers, vector, table,
            table, table, vector, types.boolean[::1],
        ),
        judge,
    )  # fmt: skip
