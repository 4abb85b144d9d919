"""Stable-Baselines3's proximal policy optimisation, with gradients that are compiled.

The library's own steps of 32 decisions go through some hundred calls of PyTorch each, for a network
of 11 000 numbers. Here the same steps are one compiled function: the same order of the decisions,
losses, bound of the gradient, and Adam. ``tests/benchmarks/test_quick_ppo.py`` compares the
networks after a round of both. All else is the library's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from stable_baselines3 import PPO

Array = NDArray[np.float32]
LAYERS = (
    ("mlp_extractor.policy_net.0", "mlp_extractor.policy_net.2", "action_net"),
    ("mlp_extractor.value_net.0", "mlp_extractor.value_net.2", "value_net"),
)
"""Names of the layers of the actor and of the critic."""


class QuickPPO(PPO):  # type: ignore[misc]
    """PPO with two hidden layers of tanh, one environment, and actions that are numbers."""

    def _setup_model(self) -> None:
        super()._setup_model()
        named = dict(self.policy.named_parameters())
        own = ["log_std", *(f"{layer}.{what}" for network in LAYERS for layer in network
                            for what in ("weight", "bias"))]  # fmt: skip
        assert sorted(own) == sorted(named)
        self.weights: Array = np.concatenate([named[name].detach().numpy().ravel() for name in own])
        begin = 0
        for name in own:  # from now on the library's networks look into these numbers
            end = begin + named[name].numel()
            named[name].data = torch.from_numpy(self.weights[begin:end]).view(named[name].shape)
            begin = end
        if not hasattr(self, "moments"):  # a kept one has had some
            self.moments: Array = np.zeros((2, len(self.weights)), dtype=np.float32)
            self.steps_taken = 0
        layers = [named[f"{layer}.weight"].shape for layer in LAYERS[0]]
        self.sizes = (int(layers[0][1]), int(layers[0][0]), int(layers[2][0]))
        self.policy.forward = self._decide

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "weights"]

    def _decide(self, observation: Any, deterministic: bool = False) -> Any:
        """Return an action, its value, and the logarithm of its probability."""
        noise = np.random.standard_normal(self.sizes[2]).astype(np.float32)  # noqa: NPY002 - theirs
        noise *= not deterministic
        found = decide(self.weights, self.sizes, observation.numpy(), noise)
        return tuple(map(torch.from_numpy, found))

    def train(self) -> None:
        """Go through the decisions of a round."""
        buffer, count = self.rollout_buffer, self.n_steps
        order = np.array([np.random.permutation(count) for _ in range(self.n_epochs)])  # noqa: NPY002
        flat = [
            np.ascontiguousarray(each.reshape(count, -1), dtype=np.float32)
            for each in (buffer.observations, buffer.actions, buffer.log_probs, buffer.advantages,
                         buffer.returns)
        ]  # fmt: skip
        numbers = np.array([
            self.learning_rate, self.clip_range(1.0), self.ent_coef, self.vf_coef,
            self.max_grad_norm,
        ])  # fmt: skip
        self.steps_taken = improve(
            self.weights, self.moments, self.steps_taken, self.sizes,
            order.reshape(-1, self.batch_size), *flat, numbers,
        )  # fmt: skip
        self._n_updates += self.n_epochs


def compiled(function: Any) -> Any:
    """Compile a function, and keep it."""
    return njit(cache=True)(function)


@compiled
def layers_of(flat: Array, begin: int, sizes: tuple[int, int, int], outputs: int) -> Any:
    """Return weights and biases of three layers that begin somewhere, and where they end."""
    inputs, hidden, _ = sizes
    a = begin + hidden * inputs
    b = a + hidden
    c = b + hidden * hidden
    d = c + hidden
    e = d + outputs * hidden
    return (
        flat[begin:a].reshape((hidden, inputs)), flat[a:b],
        flat[b:c].reshape((hidden, hidden)), flat[c:d],
        flat[d:e].reshape((outputs, hidden)), flat[e : e + outputs],
        e + outputs,
    )  # fmt: skip


@compiled
def network(layers: Any, x: Array) -> Any:
    """Return what both hidden layers and the last one make of rows."""
    first = np.tanh(np.dot(x, layers[0].T) + layers[1])
    second = np.tanh(np.dot(first, layers[2].T) + layers[3])
    return first, second, np.dot(second, layers[4].T) + layers[5]


@compiled
def slopes(layers: Any, found: Any, x: Array, first: Array, second: Array, slope: Array) -> None:
    """Write gradients of weights and biases, of those by the outputs."""
    found[4][:] = np.dot(slope.T, second)
    found[5][:] = slope.sum(axis=0)
    before = np.dot(slope, layers[4]) * (np.float32(1.0) - second * second)
    found[2][:] = np.dot(before.T, first)
    found[3][:] = before.sum(axis=0)
    before = np.dot(before, layers[2]) * (np.float32(1.0) - first * first)
    found[0][:] = np.dot(before.T, x)
    found[1][:] = before.sum(axis=0)


@compiled
def decide(weights: Array, sizes: tuple[int, int, int], x: Array, noise: Array) -> Any:
    """Return actions, values and logarithms of probability of one row."""
    log_deviation = weights[: sizes[2]]
    actor = layers_of(weights, sizes[2], sizes, sizes[2])
    critic = layers_of(weights, actor[6], sizes, 1)
    action = network(actor, x)[2] + np.exp(log_deviation) * noise
    likely = (
        np.float32(-0.5) * noise * noise - log_deviation - np.float32(0.5 * np.log(2.0 * np.pi))
    ).sum()
    return action, network(critic, x)[2], np.full(1, likely, dtype=np.float32)


@compiled
def improve(
    weights: Array, moments: Array, steps: int, sizes: tuple[int, int, int], order: Any,
    seen: Array, done: Array, likely: Array, advantage: Array, target: Array, numbers: Any,
) -> int:  # fmt: skip
    """Take a step for each row of `order`; return how many there have been in all."""
    rate, clip, entropy_weight, value_weight, longest = numbers
    count = order.shape[1]
    gradient = np.zeros_like(weights)
    actions = sizes[2]
    log_deviation = weights[:actions]
    actor, actor_slopes = (
        layers_of(weights, actions, sizes, actions), layers_of(gradient, actions, sizes, actions)
    )  # fmt: skip
    critic, critic_slopes = (
        layers_of(weights, actor[6], sizes, 1), layers_of(gradient, actor[6], sizes, 1)
    )  # fmt: skip
    slope = np.zeros((count, actions), dtype=np.float32)
    value_slope = np.zeros((count, 1), dtype=np.float32)
    for some in order:
        x, gain = seen[some], advantage[some, 0]
        mean_gain = gain.mean()
        spread = np.sqrt(((gain - mean_gain) ** 2).sum() / (count - 1)) + 1e-8
        first, second, mean = network(actor, x)
        gradient[:actions] = -entropy_weight
        for row in range(count):
            log_ratio = -likely[some[row], 0]
            for i in range(actions):
                noise = (done[some[row], i] - mean[row, i]) * np.exp(-log_deviation[i])
                slope[row, i] = noise
                log_ratio -= 0.5 * noise * noise + log_deviation[i] + 0.5 * np.log(2.0 * np.pi)
            ratio, good = np.exp(log_ratio), (gain[row] - mean_gain) / spread
            beyond = ratio > 1.0 + clip if good > 0.0 else ratio < 1.0 - clip
            factor = 0.0 if beyond else -good * ratio / count
            for i in range(actions):
                noise = slope[row, i]
                slope[row, i] = factor * noise * np.exp(-log_deviation[i])
                gradient[i] += factor * (noise * noise - 1.0)
        slopes(actor, actor_slopes, x, first, second, slope)
        first, second, value = network(critic, x)
        for row in range(count):
            value_slope[row, 0] = (
                2.0 * value_weight * (value[row, 0] - target[some[row], 0]) / count
            )
        slopes(critic, critic_slopes, x, first, second, value_slope)
        length = 0.0
        for each in gradient:
            length += each * each
        shorter = min(1.0, longest / (np.sqrt(length) + 1e-6))
        steps += 1
        first_share, second_share = 1.0 - 0.9**steps, np.sqrt(1.0 - 0.999**steps)
        for i in range(len(weights)):
            by = shorter * gradient[i]
            moments[0, i] += 0.1 * (by - moments[0, i])
            moments[1, i] = 0.999 * moments[1, i] + 0.001 * by * by
            weights[i] -= (
                rate / first_share * moments[0, i]
                / (np.sqrt(moments[1, i]) / second_share + 1e-5)
            )  # fmt: skip
    return steps
