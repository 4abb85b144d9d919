"""The compiled steps of proximal policy optimisation are those of Stable-Baselines3."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import torch
from quick_ppo import QuickPPO
from stable_baselines3 import PPO


def trained(kind: Any, rounds: int) -> Any:
    """A trainer that went through rounds of decisions that PPO made."""
    settings: dict[str, Any] = {
        "n_steps": 96, "batch_size": 32, "n_epochs": 4, "learning_rate": 1e-3, "clip_range": 0.1,
        "ent_coef": 0.01, "max_grad_norm": 0.7, "vf_coef": 0.87, "seed": 3, "device": "cpu",
    }  # fmt: skip
    maker = PPO("MlpPolicy", gymnasium.make("Pendulum-v1"), **settings)
    model = kind("MlpPolicy", gymnasium.make("Pendulum-v1"), **settings)
    maker.learn(96)  # its last round is in its buffer
    model._setup_learn(96)
    model.rollout_buffer = maker.rollout_buffer
    for round in range(rounds):
        np.random.seed(round)  # noqa: NPY002 - the library draws from it
        model.train()
    return model


def test_a_round_leads_to_the_same_networks() -> None:
    """36 steps, each changes a weight by up to 1e-3; float32 rounds them to 1e-7."""
    theirs, ours = (trained(kind, 3).policy.state_dict() for kind in (PPO, QuickPPO))
    begin = trained(PPO, 0).policy.state_dict()
    moved = max(float((theirs[name] - begin[name]).abs().max()) for name in theirs)
    off = {name: float((theirs[name] - ours[name]).abs().max()) for name in theirs}
    assert moved > 1e-2
    assert max(off.values()) < 2e-5, off


def test_decisions_have_the_value_and_probability_that_the_library_gives_them() -> None:
    model = trained(QuickPPO, 1)
    observation, seen = torch.tensor([[0.3, -0.5, 1.2]]), []
    with torch.no_grad():
        for _ in range(2000):
            action, *found = (each.item() for each in model.policy(observation))
            value, likely, _ = model.policy.evaluate_actions(observation, torch.tensor([[action]]))
            assert found == pytest.approx([value.item(), likely.item()], abs=1e-5)
            seen.append(action)
        wanted = model.policy.get_distribution(observation).distribution
    error = wanted.stddev.item() / len(seen) ** 0.5
    assert np.mean(seen) == pytest.approx(wanted.mean.item(), abs=4.0 * error)
    assert np.std(seen) == pytest.approx(wanted.stddev.item(), rel=0.1)


def test_a_kept_trainer_goes_on_as_if_there_had_been_no_break(tmp_path: Path) -> None:
    one = trained(QuickPPO, 1)
    one.save(tmp_path / "kept.zip")
    other = QuickPPO.load(tmp_path / "kept.zip", one.env, device="cpu")
    other._setup_learn(96)
    other.rollout_buffer = one.rollout_buffer
    for model in (one, other):
        np.random.seed(5)  # noqa: NPY002 - the library draws from it
        model.train()
    np.testing.assert_array_equal(one.weights, other.weights)
