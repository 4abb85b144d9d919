"""hs.Policy: the compiled network is that of NumPy, its files are whole or refused."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import walking

import heelstrike as hs
from heelstrike.control.policy.network import Layer, Network, load_network


def network(*kinds: str, activation: str = "tanh", seed: int = 0, width: int = 16) -> Network:
    robot, random = walking.bravo7(), np.random.default_rng(seed)
    observed = robot.nq + robot.nv - 1
    layers, inputs = [], observed
    for kind in kinds:
        rows = {"dense": 1, "lstm": 4, "gru": 3}[kind] * width
        layers.append(
            Layer(
                random.normal(0, 0.4, (rows, inputs)), random.normal(0, 0.4, rows), kind,
                activation if kind == "dense" else "linear",
                random.normal(0, 0.4, (rows, width)) if kind != "dense" else None,
                random.normal(0, 0.4, rows) if kind != "dense" else None,
            )
        )  # fmt: skip
        inputs = width
    layers.append(Layer(random.normal(0, 0.1, (robot.nu, inputs)), np.zeros(robot.nu)))
    return Network(
        tuple(layers), 0.002, np.full(robot.nu, 30.0), random.normal(0, 0.1, observed),
        random.uniform(0.5, 2.0, observed), velocity_limit=3.0, robot=robot.name,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kinds", "activation"),
    [
        (("dense", "dense"), "tanh"), (("dense",), "elu"), (("dense",), "relu"),
        (("lstm",), "tanh"), (("dense", "gru"), "elu"), (("gru", "lstm"), "tanh"),
    ],
)  # fmt: skip
def test_torques_are_those_of_numpy(
    kinds: tuple[str, ...], activation: str, tmp_path: Path
) -> None:
    robot, made = walking.bravo7(), network(*kinds, activation=activation)
    law = hs.Policy(made.save(tmp_path / "policy.npz"), robot)
    start = robot.reference_state()
    run = hs.simulate(robot, law, state=start, duration=0.04, stop_when_fallen=False)
    memory = made.begin()
    for row in range(0, len(run.time) - 1):
        if row % 2 == 0:
            velocity = np.clip(run.velocity[row], -3.0, 3.0)
            observation = np.concatenate((run.position[row, 1:], velocity))
            wanted = made.gear * np.clip(made.act(observation, memory), -1.0, 1.0)
        np.testing.assert_allclose(run.torque[row], wanted, rtol=0.0, atol=1e-12 * 30.0)
    assert np.ptp(run.torque, axis=0).max() > 0.1
    again = hs.simulate(robot, law, state=start, duration=0.04, stop_when_fallen=False)
    np.testing.assert_array_equal(again.torque, run.torque)  # it begins with nothing remembered


def test_what_it_remembers_is_part_of_snapshots() -> None:
    robot, law = walking.bravo7(), hs.Policy(network("lstm"))
    simulation = hs.Simulation(robot, law, state=robot.reference_state())
    simulation.advance(0.01)
    kept = simulation.snapshot()
    simulation.advance(0.02)
    there = simulation.state.vector
    simulation.restore(kept)
    simulation.advance(0.02)
    np.testing.assert_array_equal(simulation.state.vector, there)


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    good = network("dense").save(tmp_path / "good.npz")
    assert load_network(good).robot == "bravo7"
    arrays: dict[str, Any] = dict(np.load(good))

    def written(name: str, **changes: Any) -> Path:
        path = tmp_path / name
        np.savez(path, **{k: v for k, v in (arrays | changes).items() if v is not None})
        return path

    text = tmp_path / "text.npz"
    text.write_text("no archive")
    short = tmp_path / "short.npz"
    short.write_bytes(good.read_bytes()[:-400])
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, **{k: np.asarray(v) for k, v in arrays.items()}, more=np.array([{}]))
    for path, words in (
        (tmp_path / "nowhere.npz", "cannot be read"), (text, "damaged"), (short, "damaged"),
        (pickled, "damaged"), (written("a.npz", format="other"), "layout"),
        (written("b.npz", mean=None), "mean"), (written("c.npz", period=-1.0), "period"),
        (written("d.npz", **{"weight.0": np.zeros((3, 3))}), r"damaged, the arrays .* \(16,\)$"),
        (written("e.npz", **{"kind.0": "magic"}), "dense"),
        (written("f.npz", **{"bias.0": np.full(16, np.nan)}), "finite"),
    ):  # fmt: skip
        with pytest.raises(hs.ControllerError, match=words):
            hs.Policy(path)
    with pytest.raises(hs.ControllerError, match="actuators"):
        hs.Policy(good, hs.load_robot("rabbit"))


def test_a_call_of_64_by_64_takes_microseconds() -> None:
    """Two microseconds on a quiet machine; uncompiled it would be thousands."""
    robot = walking.bravo7()
    options: Any = {"state": robot.reference_state(), "stop_when_fallen": False}
    took = []
    for law in (hs.HeldTorque(robot), hs.Policy(network("dense", "dense", width=64))):
        batch = hs.Batch(robot, law, lanes=4, control_period=0.001, **options)
        times = []
        for _ in range(5):
            batch.reset()
            begin = time.process_time()
            batch.step(100)
            times.append((time.process_time() - begin) / 400)
        took.append(min(times))
    assert took[1] - took[0] < 50e-6
