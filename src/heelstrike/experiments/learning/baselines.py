"""Lanes as Stable-Baselines3 takes them: a ``VecEnv`` without copies, whose lanes start again.

::

    from stable_baselines3 import PPO
    from heelstrike.experiments.learning.baselines import BaselinesVecEnv

    model = PPO("MlpPolicy", BaselinesVecEnv("Walker2d", 64), seed=0)
    model.learn(1_000_000)
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import SimulationError
from heelstrike.experiments.learning.environments import TaskVectorEnv
from heelstrike.robot.model import Floats

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as missing:
    raise SimulationError(
        "this adapter needs Stable-Baselines3: pip install stable-baselines3"
    ) from missing


class BaselinesVecEnv(VecEnv):  # type: ignore[misc]
    """Lanes of a task for the trainers of Stable-Baselines3.

    Observations and ends are arrays that the lanes themselves write to, in turns of two: what a
    step returned is as it was until the step after the next, which is as long as trainers hold on
    to it. Rewards are those of the last step.

    Parameters
    ----------
    task : str
        Name of the task, as of :class:`~heelstrike.experiments.learning.environments.TaskVectorEnv`.
    num_envs : int
        How many lanes.
    **options
        As of that class: `max_episode_steps`, `threads`, `render_mode`, and fields of the task.
    """  # noqa: E501 - a name

    def __init__(self, task: str, num_envs: int = 1, **options: Any) -> None:
        self._vector = vector = TaskVectorEnv(task, num_envs, autoreset_mode="SameStep", **options)
        self._lanes = vector._lanes
        self.render_mode = vector.render_mode
        self._spare = np.zeros_like(self._lanes.observation)
        self._over, self._spare_over = np.zeros((2, num_envs), dtype=np.bool_)
        self._return, self._decisions = np.zeros(num_envs), np.zeros(num_envs, dtype=np.int64)
        self._begin = time.time()
        self._actions: Any = None
        super().__init__(num_envs, vector.single_observation_space, vector.single_action_space)

    def reset(self) -> Floats:
        """Begin episodes in all lanes, with the seeds that :meth:`seed` was told, if any.

        Returns
        -------
        (n, no) float
            Observations.
        """
        seeds = self._seeds if any(each is not None for each in self._seeds) else None
        self._vector.reset(seed=seeds)
        self._return[:], self._decisions[:] = 0.0, 0
        self._reset_seeds()
        self._reset_options()
        return self._lanes.observation

    def step_async(self, actions: NDArray[Any]) -> None:
        """Note the actions, (n, nu)."""
        self._actions = actions

    def step_wait(self) -> tuple[Floats, Floats, NDArray[np.bool_], list[dict[str, Any]]]:
        """Make a decision in every lane; start again where an episode has ended.

        Returns
        -------
        tuple
            Observations, rewards, which episodes have ended, and an info for each lane: where one
            has ended its last observation, whether it was truncated, the cause of a fall, and
            return and length, as trainers look for them.
        """
        lanes, vector = self._lanes, self._vector
        lanes.observation, self._spare = self._spare, lanes.observation
        self._over, self._spare_over = self._spare_over, self._over
        vector.check_begun()
        lanes.step(self._actions)
        self._decisions += 1
        self._return += lanes.reward
        over = self._over
        np.greater_equal(self._decisions, vector.limit, out=over)
        over |= lanes.terminated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if over.any():
            self._end(np.flatnonzero(over), infos)
        return lanes.observation, lanes.reward, over, infos

    def _end(self, ended: NDArray[np.int64], infos: list[dict[str, Any]]) -> None:
        lanes, seconds = self._lanes, time.time() - self._begin
        for lane in ended.tolist():
            fell = bool(lanes.terminated[lane])
            info = infos[lane]
            info["terminal_observation"] = lanes.observation[lane].copy()
            info["TimeLimit.truncated"] = not fell
            length = int(self._decisions[lane])
            info["episode"] = {"r": float(self._return[lane]), "l": length, "t": seconds}
            if fell:
                info["cause"] = lanes.cause(lane)
        reward = lanes.reward.copy()
        lanes.begin(ended)
        lanes.reward[:] = reward  # to start again is no reward
        self._return[ended], self._decisions[ended] = 0.0, 0

    def close(self) -> None:
        """Let everything go."""
        self._vector.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a picture of each lane, if ``render_mode`` is ``"rgb_array"``."""
        return list(self._vector.render() or [None] * self.num_envs)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the lanes: one for all, once a lane."""
        return [getattr(self._vector, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:  # noqa: ARG002
        """Lanes have no attributes of their own that could be set."""
        raise AttributeError(f"lanes of a batch have no {attr_name!r} of their own to set")

    def env_method(
        self,
        method_name: str,
        *arguments: Any,  # noqa: ARG002
        indices: Any = None,  # noqa: ARG002
        **named: Any,  # noqa: ARG002
    ) -> list[Any]:
        """Lanes have no methods of their own."""
        raise AttributeError(f"lanes of a batch have no method {method_name!r} of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:  # noqa: ARG002
        """Return that none is."""
        return [False for _ in self._get_indices(indices)]
