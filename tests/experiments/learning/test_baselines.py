"""Lanes for Stable-Baselines3: the steps of the native vector, and trainers that take them."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gymnasium", minversion="1.1")
pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO

from heelstrike.experiments.learning.baselines import BaselinesVecEnv
from heelstrike.experiments.learning.environments import TaskVectorEnv


def test_steps_are_those_of_the_native_vector_and_stay_for_a_step() -> None:
    lanes, limit = 4, 12
    ours = BaselinesVecEnv("Hopper", lanes, max_episode_steps=limit)
    theirs = TaskVectorEnv("Hopper", lanes, max_episode_steps=limit, autoreset_mode="SameStep")
    ours.seed(5)
    before = ours.reset()
    np.testing.assert_array_equal(before, theirs.reset(seed=[5, 6, 7, 8])[0])
    seen = before.copy()
    ends = 0
    for action in np.random.default_rng(0).uniform(-1, 1, (40, lanes, 3)).astype(np.float32):
        observed, reward, over, infos = ours.step(action)
        other, its_reward, terminated, truncated, its_info = theirs.step(action)
        np.testing.assert_array_equal(observed, other)
        np.testing.assert_array_equal(reward, its_reward)
        np.testing.assert_array_equal(over, terminated | truncated)
        np.testing.assert_array_equal(before, seen)  # what a trainer still holds has not changed
        for lane in np.flatnonzero(over).tolist():
            ends += 1
            info = infos[lane]
            np.testing.assert_array_equal(info["terminal_observation"], its_info["final_obs"][lane])
            assert info["TimeLimit.truncated"] == truncated[lane]
            assert info["episode"]["l"] <= limit
        before, seen = observed, observed.copy()
    assert ends >= 3 * lanes
    assert np.shares_memory(ours.step(action)[0], ours._lanes.observation)
    ours.close()


def test_a_trainer_takes_them() -> None:
    lanes = BaselinesVecEnv("Hopper", 4, max_episode_steps=20)
    model = PPO("MlpPolicy", lanes, n_steps=32, batch_size=64, n_epochs=1, seed=0, device="cpu")
    model.learn(256)
    assert model.ep_info_buffer is not None
    assert {info["l"] <= 20 for info in model.ep_info_buffer} == {True}
    with pytest.raises(AttributeError, match="of their own"):
        lanes.set_attr("gravity", 0.0)
