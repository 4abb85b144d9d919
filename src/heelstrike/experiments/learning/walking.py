"""Lanes in which robots walk at a commanded speed."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from heelstrike.compiler.compilation import loop_for
from heelstrike.contact.ground import Ground
from heelstrike.control.policy.network import Layer, Network
from heelstrike.control.policy.reference import OBSERVED, HeldAction, between, spot
from heelstrike.errors import SimulationError
from heelstrike.experiments.learning.course import Course
from heelstrike.experiments.learning.ranges import FACES
from heelstrike.experiments.learning.walk_task import WalkTask
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim import Batch, Method, Push, TimeStepping

TERMS = ("x_position", "x_velocity", "commanded_speed", "reward_alive", "reward_speed",
         "reward_joints", "reward_upright", "reward_effort", "reward_action")  # fmt: skip
"""What is told of a step beside its reward, which is the sum of what begins with `reward`."""

SKIPPED = 2
"""Positions that are not observed, x and z."""

PUSHED = 2
"""Link that is pushed, the last one of the trunk, whose coordinates are x, z and pitch."""


class WalkingCourse(Course):
    """Lanes of a walk.

    Parameters
    ----------
    task : WalkTask
        What is to be learned.
    lanes : int
        How many.
    threads : int
        Threads that move them.
    method : Method, optional
        Simulation method; time stepping at the step of the task by default.
    """

    def __init__(
        self, task: WalkTask, lanes: int = 1, *, threads: int = 1, method: Method | None = None
    ) -> None:
        robot = task.robot()
        self.task: WalkTask = task
        self.motion = reference = task.motion()
        gear = task.action_size * reference.stiffness
        self._pushes = task.randomise.pushes(task.max_episode_steps * task.decision_period)
        batch = Batch(
            robot, HeldAction(reference, gear), lanes=lanes, threads=threads,
            state=robot.reference_state(),
            method=TimeStepping(step=task.step) if method is None else method,
            ground=self._first_ground(), stop_when_fallen=False,
            pushes=[Push(PUSHED, force=(0.0, 0.0), start=0.0, duration=0.0)] * self._pushes,
        )  # fmt: skip
        nu, step = robot.nu, batch.method.step_length
        if step is None and task.randomise.delay is not None:
            raise SimulationError("a delay is a number of steps: use a method with a fixed step")
        self._step = step or task.step
        self._skipped = SKIPPED
        size = robot.nq + robot.nv - SKIPPED + OBSERVED
        super().__init__(task, batch, size, TERMS, gear, np.ones(nu))
        self._speed, self._phase = batch.command[:, nu], batch.command[:, nu + 1]
        self._since = batch.command[:, nu + 2]
        self._next_phase = np.zeros(lanes)
        self._delay = np.zeros(lanes, dtype=np.int64)
        self._commanded = batch.command.copy()
        self._profile = np.zeros((lanes, FACES + 1 if self._is_rough else 2, 2))
        self._profile[:, :, 0] = np.arange(self._profile.shape[1])
        self._change = np.full(lanes, np.inf)
        self._moved = np.zeros(lanes, dtype=np.bool_)
        height = float(robot.reference_state().q[1])
        self._numbers = np.array([
            task.decision_period, task.velocity_limit, task.lowest * height, task.most_pitch,
            task.alive_weight, task.speed_weight, task.speed_width, task.joint_weight,
            task.joint_width, task.upright_weight, task.upright_width, task.effort_weight,
            1.0 / (robot.weight * height), task.action_weight,
        ])  # fmt: skip
        self._judge = _judge()
        self.begin(np.arange(lanes))

    @property
    def _is_rough(self) -> bool:
        return not self.task.randomise.is_level

    def _first_ground(self) -> Ground:
        """Return ground of the kind that all episodes have."""
        ranges, friction = self.task.randomise, self.task.friction
        return ranges.ground(np.random.default_rng(0), friction)[0]

    def begin(self, chosen: Integers) -> None:
        """See :meth:`Course.begin`: somewhere in a stride, at some speed, with some noise."""
        task, motion, robot = self.task, self.motion, self.robot
        nu, phases = robot.nu, motion.motion.shape[1]
        states = np.empty((len(chosen), robot.nq + robot.nv))
        for place, lane in enumerate(chosen.tolist()):
            random = self._randoms[lane]
            self._disturb(lane, random)
            speed = random.uniform(*task.speeds)
            row = int(np.argmin(np.abs(motion.speed - speed)))
            column = int(random.integers(phases))
            states[place] = motion.motion[row, column, : states.shape[1]]
            states[place, 0] = 0.0
            noise = random.uniform(-1.0, 1.0, robot.nv)
            states[place, robot.nq :] += task.reset_noise_scale * noise
            self._next_phase[lane] = column / phases
            self._speed[lane] = speed
            self._change[lane] = task.command_period
        self.batch.command[chosen, :nu] = 0.0
        self._phase[chosen], self._since[chosen] = self._next_phase[chosen], 0.0
        self._commanded[chosen] = self.batch.command[chosen]
        self.batch._begin_anew(chosen, states[:, : robot.nq], states[:, robot.nq :])
        self._assess(chosen)

    def _disturb(self, lane: int, random: np.random.Generator) -> None:
        """Draw what is another in each episode."""
        task, ranges, batch = self.task, self.task.randomise, self.batch
        given: dict[str, Any] = {}
        if ranges.changes_ground:
            given["ground"], self._profile[lane] = ranges.ground(random, task.friction)
        if self._pushes:
            given["pushes"] = ranges.drawn_pushes(random, self._pushes, PUSHED)
        if ranges.delay is not None:
            self._delay[lane] = ranges.drawn_delay(random, self._step, self._steps)
        if ranges.mass is not None:
            batch.lay(lane, robot=ranges.robot(random, self.robot), **given)
        elif given:
            batch._renew(lane, **given)

    def step(self, action: ArrayLike, mask: NDArray[np.bool_] | None = None) -> None:
        """See :meth:`Course.step`; then another speed is commanded in lanes that are due."""
        super().step(action, mask)
        due = self._moved & (self.batch.time >= self._change)
        for lane in np.flatnonzero(due).tolist():
            self._speed[lane] = speed = self._randoms[lane].uniform(*self.task.speeds)
            self.observation[lane, -OBSERVED] = speed
            self._change[lane] += self.task.command_period

    def _move(self, mask: NDArray[np.bool_] | None) -> None:
        """See :meth:`Course._move`; what is commanded acts after the delay of each lane."""
        batch, moved = self.batch, self._moved
        moved[:] = True if mask is None else mask
        self._phase[moved], self._since[moved] = self._next_phase[moved], batch.time[moved]
        if not self._delay.any():
            super()._move(mask)
            return
        commanded, before = batch.command.copy(), self._commanded
        batch.command[:], steps = before, 0
        for end in sorted({*self._delay.tolist(), self._steps}):
            acts = self._delay <= steps
            batch.command[acts] = commanded[acts]
            if end > steps:
                batch.step(end - steps, mask)
            steps = end
        batch.command[:] = commanded
        self._commanded[moved] = commanded[moved]

    def cause(self, lane: int) -> str:
        """See :meth:`Course.cause`."""
        batch, task = self.batch, self.task
        if batch.outcome[lane] > 1:
            return batch.message(lane)
        height, pitch = self._height(lane), float(batch.position[lane, 2])
        least = float(self._numbers[2])
        if height < least:
            return f"the trunk is {height:.3g} m over the ground, less than {least:.3g} m"
        if abs(pitch) > task.most_pitch:
            return f"its pitch is {pitch:.3g} rad, more than {task.most_pitch:g}"
        return "it is healthy"

    def _height(self, lane: int) -> float:
        x, z = self.batch.position[lane, :2].tolist()
        return z - float(self.batch.lane(lane).ground.height(x))

    def network(
        self, layers: tuple[Layer, ...], mean: Floats, deviation: Floats, **more: Any
    ) -> Network:
        """See :meth:`Course.network`."""
        return super().network(layers, mean, deviation, reference=self.motion, **more)

    def _assess(self, begun: Integers | None) -> None:
        """See :meth:`Course._assess`."""
        batch, reference = self.batch, self.motion
        if begun is not None:
            self._before[begun] = batch.position[begun, 0]
            self._moved[:] = False
        self._judge(
            self._numbers, reference.speed, reference.stride, reference.motion,
            self.robot.model.actuator_joint, self._profile, batch._q, batch._v, batch._outcome,
            batch.torque, self._before, self._action, self._speed, self._moved, self._next_phase,
            self.terms, self.observation, self.reward, self.terminated,
        )  # fmt: skip


@cache
def _judge() -> Any:
    """Return what observes and judges; see `judge` within."""

    def judge(
        numbers: Floats, speeds: Floats, strides: Floats, states: Floats, joints: Integers,
        profile: Floats, q: Floats, v: Floats, outcome: Integers, torque: Floats, before: Floats,
        action: Floats, command: Floats, moved: Any, phase: Floats, terms: Floats,
        observation: Floats, reward: Floats, terminated: Any,
    ) -> int:  # fmt: skip
        """Let phases go on; write observations, rewards with terms, and which episodes are over."""
        period, limit, lowest, most_pitch = numbers[0], numbers[1], numbers[2], numbers[3]
        nq, nv, nu = q.shape[1], v.shape[1], joints.shape[0]
        for lane in range(q.shape[0]):
            if moved[lane]:
                row, above, share, _, _, _ = spot(speeds, 1, command[lane], 0.0)
                stride = strides[row] + share * (strides[above] - strides[row])
                phase[lane] += period / stride
            at = spot(speeds, states.shape[1], command[lane], phase[lane])
            place = 0
            for i in range(2, nq):
                observation[lane, place] = q[lane, i] - between(states, at, i)
                place += 1
            for i in range(nv):
                seen = min(max(v[lane, i], -limit), limit)
                observation[lane, place] = seen - between(states, at, nq + i)
                place += 1
            observation[lane, place] = command[lane]
            observation[lane, place + 1] = np.sin(2.0 * np.pi * phase[lane])
            observation[lane, place + 2] = np.cos(2.0 * np.pi * phase[lane])
            x, face = q[lane, 0], 0
            while face < profile.shape[1] - 2 and x >= profile[lane, face + 1, 0]:
                face += 1
            rise = profile[lane, face + 1, 1] - profile[lane, face, 1]
            length = profile[lane, face + 1, 0] - profile[lane, face, 0]
            floor = profile[lane, face, 1] + rise / length * (x - profile[lane, face, 0])
            healthy = outcome[lane] <= 1 and q[lane, 1] - floor > lowest
            healthy = healthy and abs(q[lane, 2]) < most_pitch
            off = effort = size = 0.0
            for i in range(nu):
                joint = joints[i]
                off += (q[lane, joint] - between(states, at, joint)) ** 2 / nu
                effort += (torque[lane, i] * numbers[12]) ** 2 / nu
                size += action[lane, i] ** 2 / nu
            speed = (x - before[lane]) / period
            fast = (speed - between(states, at, nq)) / numbers[6]
            turned = (q[lane, 2] - between(states, at, 2)) / numbers[10]
            terms[lane, 0] = x
            terms[lane, 1] = speed
            terms[lane, 2] = command[lane]
            terms[lane, 3] = numbers[4] if healthy else 0.0
            terms[lane, 4] = numbers[5] * np.exp(-fast * fast)
            terms[lane, 5] = numbers[7] * np.exp(-off / (numbers[8] * numbers[8]))
            terms[lane, 6] = numbers[9] * np.exp(-turned * turned)
            terms[lane, 7] = -numbers[11] * effort
            terms[lane, 8] = -numbers[13] * size
            total = 0.0
            for i in range(3, 9):
                total += terms[lane, i]
            reward[lane] = total
            terminated[lane] = not healthy
        return 0

    cube, table = types.float64[:, :, ::1], types.float64[:, ::1]
    vector, columns = types.float64[::1], types.float64[:, :]
    strided, whole = types.float64[:], types.int64[::1]
    truth = types.boolean[::1]
    return loop_for(
        types.int64(
            vector, vector, vector, cube, whole, cube, columns, columns, whole, columns, vector,
            table, strided, truth, vector, table, table, vector, truth,
        ),
        judge,
    )  # fmt: skip
