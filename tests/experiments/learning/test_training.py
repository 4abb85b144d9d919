"""The trainer: right gradients, a policy that gets better, and training that can be cut."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", minversion="1.1")  # whose robots it trains

import heelstrike as hs
from heelstrike.experiments.learning.perceptron import Perceptron
from heelstrike.experiments.learning.tasks import RUNNING, task_of
from heelstrike.experiments.learning.training import Recipe, Running, Trainer
from heelstrike.experiments.learning.writing import run_of, write_all

SMALL = Recipe(lanes=8, horizon=32, minibatch=64, epochs=2, hidden=(16,))
TASK = RUNNING["Hopper"]


def test_gradients_are_those_of_finite_differences() -> None:
    random = np.random.default_rng(0)
    net = Perceptron((5, 7, 6, 3), random, 1.0)
    net.parameters = [each.astype(np.float64) for each in net.parameters]  # type: ignore[misc]
    x, aim = random.standard_normal((4, 5)), random.standard_normal((4, 3))

    def loss() -> float:
        return 0.5 * float(((net(x)[0] - aim) ** 2).sum())  # type: ignore[arg-type]

    found, seen = net(x)  # type: ignore[arg-type]
    gradients = net.gradients(seen, found - aim)  # type: ignore[arg-type]
    for parameter, gradient in zip(net.parameters, gradients, strict=True):
        place = tuple(random.integers(0, parameter.shape))
        kept, small = parameter[place], 1e-6
        parameter[place] = kept + small
        above = loss()
        parameter[place] = kept - small
        below = loss()
        parameter[place] = kept
        assert gradient[place] == pytest.approx((above - below) / (2 * small), rel=1e-6, abs=1e-8)


def test_the_gradient_of_the_objective_is_that_of_finite_differences() -> None:
    """Half of the decisions are beyond the clip, where nothing is to be gained."""
    trainer = Trainer(TASK, 1, SMALL)
    random, count, actions = np.random.default_rng(1), 64, trainer.course.robot.nu
    seen = random.standard_normal((count, trainer.course.observation.shape[1]))
    done = 0.5 * random.standard_normal((count, actions))
    gain, clip = random.standard_normal(count), trainer.recipe.clip
    actor = trainer.actor
    actor.parameters = [each.astype(np.float64) for each in actor.parameters]  # type: ignore[misc]
    log_deviation = trainer.log_deviation = trainer.log_deviation.astype(np.float64)  # type: ignore

    def log_likely() -> np.ndarray:
        noise = (done - actor(seen)[0]) / np.exp(log_deviation)  # type: ignore[arg-type]
        return -0.5 * (noise**2).sum(axis=1) - log_deviation.sum()

    likely = log_likely() + random.uniform(-0.4, 0.4, count)

    def objective() -> float:
        ratio = np.exp(log_likely() - likely)
        return float(np.mean(np.minimum(ratio * gain, np.clip(ratio, 1 - clip, 1 + clip) * gain)))

    gradients = trainer._gradients(seen, done, likely, gain, np.zeros(count))  # type: ignore
    for values, gradient in (
        (actor.parameters[-1], gradients[len(actor.parameters) - 1]),
        (actor.parameters[0][2], gradients[0][2]), (log_deviation, gradients[-1]),
    ):  # fmt: skip
        kept, small = values[1], 1e-6
        values[1] = kept + small
        above = objective()
        values[1] = kept - small
        below = objective()
        values[1] = kept
        assert -gradient[1] == pytest.approx((above - below) / (2 * small), rel=1e-4, abs=1e-9)


def test_running_mean_and_variance_are_those_of_all_rows() -> None:
    rows = np.random.default_rng(0).normal(3.0, 2.0, (1000, 2))
    running = Running(2)
    for some in np.array_split(rows, 7):
        running.add(some)
    np.testing.assert_allclose(running.mean, rows.mean(axis=0), rtol=1e-6)
    np.testing.assert_allclose(running.variance, rows.var(axis=0), rtol=1e-5)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a process is killed here, a fork")
def test_training_that_was_killed_comes_to_the_same(tmp_path: Path) -> None:
    kept, rounds = tmp_path / "training.npz", 13
    decisions = rounds * SMALL.lanes * SMALL.horizon
    whole = Trainer(TASK, decisions, SMALL)
    whole.learn()
    cut = Trainer(TASK, decisions, SMALL, threads=2)

    def break_off(trainer: Trainer) -> None:
        if trainer.round == 12:
            os.kill(os.getpid(), signal.SIGKILL)

    child = os.fork()
    if not child:
        cut.learn(kept, break_off)
        os._exit(0)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    again = Trainer(TASK, decisions, SMALL)
    again.restore(kept)
    assert again.round == 10
    again.learn(kept)
    assert again.curve == whole.curve
    for mine, its in zip(again._arrays(), whole._arrays(), strict=True):
        np.testing.assert_array_equal(mine, its)
    with pytest.raises(hs.SimulationError, match="another task"):
        Trainer(TASK, decisions + 1, SMALL).restore(kept)
    damaged = tmp_path / "damaged.npz"
    damaged.write_bytes(kept.read_bytes()[:-300])
    with pytest.raises(hs.SimulationError, match="damaged"):
        again.restore(damaged)


@pytest.mark.slow
def test_a_policy_gets_better_and_runs_in_the_loop(tmp_path: Path) -> None:
    recipe = Recipe(lanes=32, horizon=64, minibatch=512, epochs=6, seed=1)
    trainer = Trainer(TASK, 24_000, recipe)
    trainer.learn()
    curve = trainer.curve.mean_return
    assert np.mean(curve[-3:]) > 2.0 * curve[0]
    files, run = write_all(trainer, tmp_path, film=False)
    assert [each.name for each in files] == ["policy.npz", "curve.csv", "curve.svg"]
    table = (tmp_path / "curve.csv").read_text().splitlines()
    assert len(table) == 1 + trainer.rounds
    loaded = hs.control.load_network(tmp_path / "policy.npz")
    again = run_of(loaded, TASK)
    np.testing.assert_array_equal(run.position, again.position)
    observed = np.concatenate((run.position[0, 1:], run.velocity[0]))
    wanted = loaded.gear * np.clip(loaded.act(observed, loaded.begin()), -1.0, 1.0)
    np.testing.assert_allclose(run.torque[0], wanted, atol=1e-9)


def test_tasks_by_name() -> None:
    assert task_of("walker2d") is RUNNING["Walker2d"]
    assert task_of("half_cheetah") is RUNNING["HalfCheetah"]
    task = task_of("bravo7")
    gear = task.gear(task.robot())
    assert np.isfinite(gear).all()
    assert (gear > 0.0).all()
    with pytest.raises(hs.SimulationError, match="cannot learn to run"):
        task_of("acrobot" if "acrobot" in hs.builtin_robots() else "compass_gait")
