"""One policy in several worlds: episodes are those of environments, step by step."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

gymnasium = pytest.importorskip("gymnasium", minversion="1.1")

import heelstrike as hs  # noqa: E402
from heelstrike.cli.main import app  # noqa: E402
from heelstrike.control.policy.network import Layer, Network  # noqa: E402
from heelstrike.experiments.learning import transfer  # noqa: E402
from heelstrike.experiments.learning.environments import TaskEnv  # noqa: E402
from heelstrike.experiments.learning.tasks import RUNNING  # noqa: E402

TASK = replace(RUNNING["Hopper"], max_episode_steps=15)


def network(size: float = 1.0, **about: str) -> Network:
    random = np.random.default_rng(0)
    layer = Layer(random.normal(0, size, (3, 11)), np.zeros(3))
    return Network(
        (layer,), TASK.decision_period, np.full(3, 200.0), np.zeros(11), np.ones(11),
        velocity_limit=10.0, robot="hopper", about=about,
    )  # fmt: skip


def test_episodes_are_those_of_an_environment() -> None:
    policy, count = network(), 3
    found = transfer.episodes(policy, TASK, hs.TimeStepping(step=TASK.step), count, seed=4)
    for lane in range(count):
        environment: Any = TaskEnv("Hopper")
        environment._np_random = np.random.default_rng([4, lane])
        observation, _ = environment.reset()
        gained, begin, length, fell = 0.0, environment._lanes.batch.position[0, 0], 0, False
        while length < 15 and not fell:
            observation, reward, fell, _, _ = environment.step(
                policy.act(observation, policy.begin())
            )
            gained, length = gained + reward, length + 1
        assert found.returns[lane] == pytest.approx(gained, rel=1e-12)
        assert (found.lengths[lane], found.fell[lane]) == (length, fell)
        distance = environment._lanes.batch.position[0, 0] - begin
        assert found.distances[lane] == pytest.approx(distance, rel=1e-9)


def test_worlds_begin_alike_and_differ_little_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """In 0.12 s springs of ground and stops give way by some mm, the trunk by 2 cm at most."""
    monkeypatch.setitem(RUNNING, "Hopper", TASK)
    worlds = {each.world: each for each in transfer.transfer(network(0.02, task=TASK.file), 2)}
    assert {"event-driven", "compliant", "MuJoCo", "time stepping, 2 ms"} <= worlds.keys()
    first = worlds["event-driven"]
    for each in worlds.values():
        np.testing.assert_array_equal(each.lengths, 15, err_msg=each.world)
        apart = np.abs(each.distances - first.distances)
        assert apart.max() < (0.02 if each.world == "compliant" else 0.005), each.world
        # The return is that of the distance, of being healthy, and of the actions.
        wanted = each.distances / TASK.decision_period + 15 * (1.0 - 1e-3 * each.efforts)
        np.testing.assert_allclose(each.returns, wanted, rtol=1e-9)
        assert each.row()["episodes"] == 2


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(RUNNING, "Hopper", TASK)
    one = {"time stepping": hs.TimeStepping(step=TASK.step)}
    monkeypatch.setattr(transfer, "worlds_of", lambda task: one)
    path = network(task=TASK.file).save(tmp_path / "policy.npz")
    arguments = ["transfer", str(path), "--episodes", "2"]
    result = CliRunner().invoke(app, [*arguments, "--json"])
    assert result.exit_code == 0, result.output
    rows = json.loads(result.stdout)
    assert [row["world"] for row in rows] == ["time stepping", "MuJoCo"]
    shown = CliRunner().invoke(app, arguments).stdout
    assert f"{rows[0]['return']:.0f}" in shown
    untold = network().save(tmp_path / "untold.npz")
    refused = CliRunner().invoke(app, ["transfer", str(untold)])
    assert refused.exit_code == 2
    assert "about.task" in " ".join(refused.output.split())
