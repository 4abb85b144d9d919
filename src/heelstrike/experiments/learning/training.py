"""Proximal policy optimisation (Schulman et al. 2017), in NumPy."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import asdict, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.array_file import DAMAGED, read_arrays, write_arrays
from heelstrike.control.policy.network import Layer, Network
from heelstrike.errors import SimulationError
from heelstrike.experiments.learning.courses import LearningTask, course_of
from heelstrike.experiments.learning.perceptron import Adam, Array, Perceptron
from heelstrike.field_texts import dataclass

Floats = NDArray[np.float64]

LIMIT = 10.0
"""Normalised observations and rewards are cut there."""

BEGIN_ANEW = 10
"""Rounds after which all lanes start again and everything is kept: what goes on from there is what
would have come without a break, to the last bit."""


@dataclass(frozen=True)
class Recipe:
    """How it is learned."""

    lanes: int = 64
    """Robots that learn at once."""
    horizon: int = 128
    """Decisions of each in a round."""
    epochs: int = 6
    """How often the decisions of a round are gone through."""
    minibatch: int = 1024
    """Decisions that a step of the optimiser is of."""
    rate: float = 5e-4
    """Length of such a step, which falls to a tenth at the end."""
    discount: float = 0.99
    """Weight of a reward that comes a decision later."""
    trace: float = 0.95
    """λ of the generalised advantage (Schulman et al. 2016)."""
    clip: float = 0.2
    """How far a decision's probability may change in a round."""
    hidden: tuple[int, ...] = (64, 64)
    """Outputs of the hidden layers of policy and value."""
    first_deviation: float = 0.6
    """Standard deviation of actions at the beginning."""
    seed: int = 0
    """Of everything that is random."""


WALKING = Recipe(epochs=8, rate=1e-3, first_deviation=0.25)
"""How walking is learned, from a motion that is followed already."""


@dataclass
class Curve:
    """How learning went, round by round."""

    decisions: list[int] = field(default_factory=list)
    """Decisions so far."""
    mean_return: list[float] = field(default_factory=list)
    """Mean return of the last hundred episodes that ended."""
    mean_length: list[float] = field(default_factory=list)
    """Their mean length in decisions."""
    deviation: list[float] = field(default_factory=list)
    """Standard deviation of the actions, mean of all actuators."""


class Running:
    """Mean and variance of rows, as they come in (Chan et al. 1979)."""

    def __init__(self, size: int) -> None:
        self.mean, self.variance = np.zeros(size), np.ones(size)
        self.count = 1e-4

    def add(self, rows: Floats) -> None:
        """Take rows into account."""
        count = len(rows)
        shift, total = rows.mean(axis=0) - self.mean, self.count + count
        self.variance = (
            self.variance * self.count + rows.var(axis=0) * count
            + shift**2 * self.count * count / total
        ) / total  # fmt: skip
        self.mean = self.mean + shift * count / total
        self.count = total

    @property
    def deviation(self) -> Floats:
        """Standard deviations, none of them zero."""
        return np.sqrt(self.variance + 1e-8)


class Trainer:
    """Learns a policy for a task.

    Parameters
    ----------
    task : RunningTask or WalkTask
        The task.
    decisions : int
        Decisions to learn from, over all.
    recipe : Recipe
        How.
    threads : int
        Threads that move the robots; it makes no difference to what is learned.
    """

    def __init__(
        self, task: LearningTask, decisions: int, recipe: Recipe | None = None, *, threads: int = 1
    ) -> None:
        self.task, self.recipe = task, Recipe() if recipe is None else recipe
        recipe = self.recipe
        self.decisions, self.round = int(decisions), 0
        self.course = course_of(task, recipe.lanes, threads=threads)
        self.random = np.random.default_rng(recipe.seed)
        observed, actions = self.course.observation.shape[1], self.course.robot.nu
        self.actor = Perceptron((observed, *recipe.hidden, actions), self.random, 0.01)
        self.critic = Perceptron((observed, *recipe.hidden, 1), self.random, 1.0)
        first = np.log(recipe.first_deviation)
        self.log_deviation: Array = np.full(actions, first, dtype=np.float32)
        self.adam = Adam(
            [*self.actor.parameters, *self.critic.parameters, self.log_deviation], recipe.rate
        )
        self.observations, self.returns = Running(observed), Running(1)
        self.curve = Curve()
        self.best = -np.inf
        self._lately: list[tuple[float, int]] = []
        self._running_return = np.zeros(recipe.lanes)
        self._return, self._length = np.zeros(recipe.lanes), np.zeros(recipe.lanes, dtype=np.int64)

    @property
    def rounds(self) -> int:
        """Rounds in all."""
        return max(1, -(-self.decisions // (self.recipe.lanes * self.recipe.horizon)))

    @property
    def finished(self) -> bool:
        """Whether there is no more to learn from."""
        return self.round >= self.rounds

    def learn(
        self, kept: str | os.PathLike[str] | None = None,
        progress: Callable[[Trainer], None] | None = None,
    ) -> None:  # fmt: skip
        """Learn until the decisions are made.

        Parameters
        ----------
        kept : path, optional
            File that everything is kept in from time to time, and at the end.
        progress : callable, optional
            Called after every round.
        """
        while not self.finished:
            if self.round % BEGIN_ANEW == 0:
                if kept is not None:
                    self.keep(kept)
                self._begin()
            self._improve(*self._try_out())
            self.round += 1
            self._note()
            if progress is not None:
                progress(self)
        if kept is not None:
            self.keep(kept)

    def network(self) -> Network:
        """Return the policy as it is now, without the noise of its actions.

        Returns
        -------
        Network
            For :class:`heelstrike.Policy`.
        """
        parameters = self.actor.parameters
        last = len(parameters) - 2
        layers = tuple(
            Layer(
                parameters[i].T.astype(np.float64), parameters[i + 1].astype(np.float64),
                activation="tanh" if i < last else "linear",
            )
            for i in range(0, last + 1, 2)
        )  # fmt: skip
        return self.course.network(
            layers,
            self.observations.mean,
            self.observations.deviation,
            observation_limit=LIMIT,
            about={**self.task.about, "seed": str(self.recipe.seed)},
        )

    def keep(self, path: str | os.PathLike[str]) -> Path:
        """Keep everything that the further course depends on in a file.

        Parameters
        ----------
        path : str or path
            The file, which appears whole or not at all.

        Returns
        -------
        Path
            The file.
        """
        state = {
            "recipe": asdict(self.recipe), "task": asdict(self.task), "decisions": self.decisions,
            "round": self.round, "random": self.random.bit_generator.state, "best": self.best,
            "adam": self.adam.steps, "lately": self._lately, "curve": asdict(self.curve),
            "count": [self.observations.count, self.returns.count],
        }  # fmt: skip
        arrays = {f"array.{i}": each for i, each in enumerate(self._arrays())}
        return write_arrays(path, {"state": json.dumps(state), **arrays})

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Go on from a file, as if there had been no break.

        Parameters
        ----------
        path : str or path
            What :meth:`keep` wrote, of the same task, recipe and number of decisions.

        Raises
        ------
        SimulationError
            If it is another, damaged, or cannot be read.
        """
        arrays = read_arrays(path, _KEPT, SimulationError)
        try:
            state = json.loads(str(arrays["state"]))
            mine = json.loads(json.dumps([asdict(self.recipe), asdict(self.task), self.decisions]))
            same = [state["recipe"], state["task"], state["decisions"]] == mine
            for i, own in enumerate(self._arrays() if same else []):
                own[...] = arrays[f"array.{i}"]
            self.random.bit_generator.state = state["random"]
            self.round, self.best, self.adam.steps = state["round"], state["best"], state["adam"]
            self._lately = [tuple(each) for each in state["lately"]]
            self.curve = Curve(**state["curve"])
            self.observations.count, self.returns.count = state["count"]
        except DAMAGED as error:
            raise SimulationError(f"{path}: not {_KEPT}, or damaged") from error
        if not same:
            raise SimulationError(
                f"{path}: kept of another task, recipe or number of decisions; begin afresh, or "
                "ask for the same"
            )

    def _arrays(self) -> list[Any]:
        adam, kept = self.adam, (self.observations, self.returns)
        statistics = [each for one in kept for each in (one.mean, one.variance)]
        return [*adam.parameters, *adam.mean, *adam.square, *statistics]

    def _begin(self) -> None:
        """Let all lanes start again, with noise that the trainer's own random numbers decide."""
        for lane, seed in enumerate(self.random.integers(0, 2**63, self.recipe.lanes).tolist()):
            self.course.seed(lane, np.random.default_rng(seed))
        self.course.begin(np.arange(self.recipe.lanes))
        for each in (self._running_return, self._return, self._length):
            each[:] = 0

    def _normal(self, observation: Floats) -> Array:
        normal = (observation - self.observations.mean) / self.observations.deviation
        return np.clip(normal, -LIMIT, LIMIT).astype(np.float32)

    def _try_out(self) -> tuple[Array, Array, Array, Array, Array]:
        """Make the decisions of a round; return what was seen, done, how likely, gained, valued."""
        recipe, course = self.recipe, self.course
        shape: tuple[int, int] = recipe.horizon, recipe.lanes
        seen: Array = np.zeros((*shape, course.observation.shape[1]), dtype=np.float32)
        raw: Any = np.zeros(seen.shape)
        done: Array = np.zeros((*shape, course.robot.nu), dtype=np.float32)
        likely, value, later = (np.zeros(shape, dtype=np.float32) for _ in range(3))
        reward: Any = np.zeros(shape)
        over: Any = np.zeros(shape, dtype=bool)
        deviation = np.exp(self.log_deviation)
        for t in range(recipe.horizon):
            raw[t] = course.observation
            seen[t] = self._normal(course.observation)
            mean = self.actor(seen[t])[0]
            noise = self.random.standard_normal(mean.shape, dtype=np.float32)
            done[t] = mean + deviation * noise
            likely[t] = -0.5 * (noise * noise).sum(axis=1) - self.log_deviation.sum()
            value[t] = self.critic(seen[t])[0][:, 0]
            course.step(done[t])
            reward[t] = course.reward
            self._return += course.reward
            self._length += 1
            self._running_return = recipe.discount * self._running_return + course.reward
            self.returns.add(self._running_return[:, None])
            terminated = course.terminated
            ended = terminated | (self._length >= self.task.max_episode_steps)
            if ended.any():
                self._end(t, ended, terminated, later, over)
        course_value = self.critic(self._normal(course.observation))[0][:, 0]
        following = np.concatenate((value[1:], course_value[None]))
        following = np.where(over, later, following)
        scale = float(self.returns.deviation[0])
        reward = np.clip(reward / scale, -LIMIT, LIMIT)
        surprise = reward + recipe.discount * following - value
        advantage, carried = np.zeros(shape, dtype=np.float32), np.zeros(recipe.lanes)
        for t in range(recipe.horizon - 1, -1, -1):
            kept = recipe.discount * recipe.trace * ~over[t]
            carried = surprise[t] + kept * carried
            advantage[t] = carried
        self.observations.add(raw.reshape(-1, raw.shape[-1]))
        flat = recipe.horizon * recipe.lanes
        return (
            seen.reshape(flat, -1), done.reshape(flat, -1), likely.reshape(flat),
            advantage.reshape(flat), value.reshape(flat),
        )  # fmt: skip

    def _end(self, t: int, ended: Any, terminated: Any, later: Array, over: Any) -> None:
        """End episodes: what would follow one that is cut is what its last state is worth."""
        over[t] = ended
        cut = ended & ~terminated
        if cut.any():
            later[t, cut] = self.critic(self._normal(self.course.observation[cut]))[0][:, 0]
        for lane in np.flatnonzero(ended).tolist():
            self._lately.append((float(self._return[lane]), int(self._length[lane])))
        del self._lately[:-100]
        self.course.begin(np.flatnonzero(ended))
        for each in (self._return, self._length, self._running_return):
            each[ended] = 0

    def _improve(
        self, seen: Array, done: Array, likely: Array, advantage: Array, value: Array
    ) -> None:
        """Go through the decisions of a round, and make those that came out well more likely."""
        recipe = self.recipe
        target = advantage + value
        share = 1.0 - 0.9 * self.round / self.rounds
        for _ in range(recipe.epochs):
            order = self.random.permutation(len(seen))
            for first in range(0, len(order), recipe.minibatch):
                some = order[first : first + recipe.minibatch]
                gain = advantage[some]
                gain = (gain - gain.mean()) / (gain.std() + 1e-8)
                gradients = self._gradients(seen[some], done[some], likely[some], gain,
                                            target[some])  # fmt: skip
                self.adam.step(gradients, share)

    def _gradients(
        self, seen: Array, done: Array, likely: Array, gain: Array, target: Array
    ) -> list[Array]:
        """Return the gradients of the clipped objective and of half the square of the value."""
        clip, count = self.recipe.clip, np.float32(len(seen))
        mean, hidden = self.actor(seen)
        inverse = np.exp(-self.log_deviation)
        noise = (done - mean) * inverse
        ratio = np.exp(-0.5 * (noise * noise).sum(axis=1) - self.log_deviation.sum() - likely)
        # Where the ratio is beyond the clip, on the side that the gain leads to, nothing is gained.
        beyond = ((gain > 0.0) & (ratio > 1.0 + clip)) | ((gain < 0.0) & (ratio < 1.0 - clip))
        slope = np.where(beyond, np.float32(0.0), -gain * ratio / count)[:, None]
        actor = self.actor.gradients(hidden, slope * noise * inverse)
        deviation = (slope * (noise * noise - 1.0)).sum(axis=0)
        found, hidden = self.critic(seen)
        critic = self.critic.gradients(hidden, 0.5 * (found - target[:, None]) / count)
        return [*actor, *critic, deviation.astype(np.float32)]

    def _note(self) -> None:
        curve, lately = self.curve, self._lately
        curve.decisions.append(self.round * self.recipe.lanes * self.recipe.horizon)
        curve.mean_return.append(float(np.mean([each[0] for each in lately])) if lately else 0.0)
        curve.mean_length.append(float(np.mean([each[1] for each in lately])) if lately else 0.0)
        curve.deviation.append(float(np.exp(self.log_deviation).mean()))
        self.best = max(self.best, curve.mean_return[-1])


_KEPT = "what a trainer keeps"
