"""Proximal policy optimisation of Stable-Baselines3 on Walker2d: on hard contact and in MuJoCo.

``python benchmarks/learning_curves.py train --out DIR`` trains policies in our Walker2d and in
Gymnasium's ``Walker2d-v5`` with the settings of RL Baselines3 Zoo for this task
(``hyperparams/ppo.yml``; observations and rewards are normalised as there). Gradients are compiled
(``quick_ppo.py``). ``... show --out DIR`` tries what was learned in both worlds, without noise in
the actions and from unseen starts, prints the tables, and draws the returns over the steps.
Stable-Baselines3 must be installed.

A run is made of legs. Each leg begins with new episodes and draws its random numbers from seeds of
its own, and its result is kept. The same command therefore continues runs that were stopped, and
comes to the same policies. All runs take turns, so that they are equally long whenever they stop.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import machine
import numpy as np
import torch
from numpy.typing import NDArray
from quick_ppo import QuickPPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecNormalize
from table import Table

if find_spec("imageio") is None:  # Gymnasium imports it for films, which nobody takes here
    sys.modules["imageio"] = ModuleType("imageio")

import gymnasium

from heelstrike.experiments.learning.baselines import BaselinesVecEnv
from heelstrike.view.style import BLUE, VERMILION, new_figure, save_figure, styled

WORLDS = {"here": "heelstrike", "mujoco": "MuJoCo"}
"""What policies are learned and tried in, with the names that tables have for it."""

SETTINGS: dict[str, Any] = {
    "n_steps": 512, "batch_size": 32, "n_epochs": 20, "gamma": 0.99, "gae_lambda": 0.95,
    "learning_rate": 5.05041e-05, "clip_range": 0.1, "ent_coef": 0.000585045,
    "max_grad_norm": 1, "vf_coef": 0.871923,
}  # fmt: skip
"""Those of the Zoo for Walker2d, with one environment."""

LEG = 100 * SETTINGS["n_steps"]
"""Steps of a leg."""

UNSEEN = 1_000_000
"""Seed of the starts that policies are tried from."""

LATELY = 100
"""Episodes whose mean return is drawn."""

BAR = 0.9
"""Share of the return in MuJoCo that is asked for."""


class Episodes(BaseCallback):  # type: ignore[misc]
    """Notes when training episodes end, with what return, and after how many steps."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[tuple[int, float, int]] = []

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "episode" in info:
                row = info["episode"]
                self.rows.append((self.num_timesteps, float(row["r"]), int(row["l"])))
        return True


class Silent(gymnasium.Wrapper):  # type: ignore[misc]
    """Tells nothing in its infos, of which the library would make copies in every step."""

    def step(self, action: Any) -> Any:
        """Move on."""
        return *self.env.step(action)[:4], {}


def lanes(world: str, count: int = 1) -> VecEnv:
    """Return lanes of a world, as the trainer takes them."""
    if world == "here":
        return BaselinesVecEnv("Walker2d", count)
    return DummyVecEnv([lambda: Monitor(Silent(gymnasium.make("Walker2d-v5")))] * count)


def train_leg(world: str, seed: int, leg: int, folder: Path) -> None:
    """Train for one more leg, and keep what came of it in a folder of its number."""
    env = lanes(world)
    env.reset()
    env.step(np.zeros((1, 6), dtype=np.float32))  # what is compiled or loaded is, before the clock
    before = folder / f"{leg - 1}"
    if leg == 0:
        normal = VecNormalize(env, gamma=SETTINGS["gamma"])
        model = QuickPPO("MlpPolicy", normal, seed=seed, device="cpu", **SETTINGS)
    else:
        normal = VecNormalize.load(str(before / "normalisation.pkl"), env)
        model = QuickPPO.load(before / "model.zip", normal, device="cpu")
        model.set_random_seed(seed + 1000 * leg)
    episodes = Episodes()
    clock, processor = time.perf_counter(), time.process_time()
    model.learn(LEG, episodes, reset_num_timesteps=leg == 0)
    told = {
        "steps": model.num_timesteps, "processor": time.process_time() - processor,
        "clock": time.perf_counter() - clock, "load": machine.load(),
        "episodes": episodes.rows,
    }  # fmt: skip
    begun = folder / f"{leg}.begun"
    shutil.rmtree(begun, ignore_errors=True)
    begun.mkdir(parents=True)
    model.save(begun / "model.zip")
    normal.save(str(begun / "normalisation.pkl"))
    (begun / "leg.json").write_text(json.dumps(told), encoding="utf-8")
    begun.replace(folder / f"{leg}")
    env.close()


def train(out: Path, worlds: list[str], seeds: int, steps: int) -> None:
    """Train all policies, a leg of each in turn."""
    torch.set_num_threads(1)
    for leg in range(-(-steps // LEG)):
        for seed in range(seeds):
            for world in worlds:
                folder = out / f"{world}-{seed}"
                if not (folder / f"{leg}").exists():
                    train_leg(world, seed, leg, folder)
                    print(f"{world}, seed {seed}: {told(folder, leg)}", flush=True)


def kept(folder: Path, leg: int) -> dict[str, Any]:
    """Return what was noted of a leg."""
    row: dict[str, Any] = json.loads((folder / f"{leg}" / "leg.json").read_text(encoding="utf-8"))
    return row


def told(folder: Path, leg: int) -> str:
    """Return how a leg went."""
    row = kept(folder, leg)
    returns = [each[1] for each in row["episodes"]]
    return (
        f"{row['steps']} steps, mean return {np.mean(returns or [0.0]):.0f} of {len(returns)} "
        f"episodes, {row['processor']:.0f} s of processor, {row['clock']:.0f} s, "
        f"load {row['load']:.1f}"
    )


def tried(folder: Path, leg: int, world: str, count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the returns of a policy in a world, and which episodes ended by a fall."""
    env = lanes(world, count)
    normal = VecNormalize.load(str(folder / f"{leg}" / "normalisation.pkl"), env)
    model = QuickPPO.load(folder / f"{leg}" / "model.zip", device="cpu")
    env.seed(UNSEEN)
    observation = env.reset()
    returns, fell, goes = np.zeros(count), np.zeros(count, bool), np.ones(count, bool)
    while goes.any():
        action = model.predict(normal.normalize_obs(observation), deterministic=True)[0]
        observation, reward, over, infos = env.step(action)
        returns[goes] += reward[goes]
        for lane in np.flatnonzero(over & goes):
            fell[lane] = not infos[lane].get("TimeLimit.truncated", False)
        goes &= ~over
    env.close()
    return returns, fell


def show(out: Path, worlds: list[str], seeds: int, count: int, picture: Path) -> None:
    """Print tables of what was learned after as many steps as all runs have; draw the curves."""
    torch.set_num_threads(1)
    folders = {world: [out / f"{world}-{seed}" for seed in range(seeds)] for world in worlds}
    legs = min(
        sum((folder / f"{leg}").exists() for leg in range(len(list(folder.iterdir()))))
        for each in folders.values()
        for folder in each
    )
    steps = legs * LEG
    rows, means = [], {}
    for world, several in folders.items():
        for seed, folder in enumerate(several):
            cells = []
            for where in worlds:
                returns, fell = tried(folder, legs - 1, where, count)
                means[world, where, seed] = returns.mean()
                half = 1.96 * returns.std(ddof=1) / np.sqrt(count)
                cells.append(f"{returns.mean():.0f} ± {half:.0f}, {fell.mean():.0%}")
            rows.append([f"{WORLDS[world]}, seed {seed}", *cells])
    title = f"Return ± half the interval of 95 %, falls, of {count} episodes, after {steps} steps"
    tables = [Table(title, ["learned in", *(f"tried in {WORLDS[w]}" for w in worlds)], rows)]
    rows = []
    for world, several in folders.items():
        noted = [kept(folder, leg) for folder in several for leg in range(legs)]
        own = [means[world, world, seed] for seed in range(seeds)]
        share = 1e6 / (steps * seeds)
        rows.append([
            WORLDS[world], f"{np.mean(own):.0f}", f"{min(own):.0f} to {max(own):.0f}",
            f"{share * sum(row['processor'] for row in noted):.0f} s",
            f"{share * sum(row['clock'] for row in noted):.0f} s",
            f"{np.mean([row['load'] for row in noted]):.1f}",
        ])  # fmt: skip
    head = ["", "mean return", "of the seeds", "processor, 1e6 steps", "clock", "at load"]
    tables.append(Table("Each tried where it was learned", head, rows))
    for table in tables:
        print(table.markdown(), end="\n\n")
    if {"here", "mujoco"} <= set(worlds):
        ours, theirs = (
            np.mean([means[world, world, seed] for seed in range(seeds)])
            for world in ("here", "mujoco")
        )  # fmt: skip
        print(f"heelstrike / MuJoCo: {ours / theirs:.2f} (asked for: {BAR:g})")
    draw({world: [curve(folder, legs) for folder in each] for world, each in folders.items()},
         steps, picture)  # fmt: skip


def curve(folder: Path, legs: int) -> NDArray[Any]:
    """Return after how many steps each training episode ended, and its return, (2, n)."""
    rows = [row[:2] for leg in range(legs) for row in kept(folder, leg)["episodes"]]
    return np.array(rows).T


def draw(curves: dict[str, list[NDArray[Any]]], steps: int, picture: Path) -> None:
    """Draw mean, least and greatest return of the seeds over the steps."""
    places = np.arange(LEG // 5, steps + 1, LEG // 5)
    with styled():
        figure = new_figure(6.4, 3.4)
        axes = figure.subplots()
        for (world, several), color, dashes in zip(
            curves.items(), (BLUE, VERMILION), ("-", (0, (5, 2))), strict=False
        ):
            lately = np.array([
                [row[1][max(end - LATELY, 0) : end].mean() if end else 0.0
                 for end in np.searchsorted(row[0], places, side="right").tolist()]
                for row in several
            ])  # fmt: skip
            axes.fill_between(
                places / 1e6, lately.min(axis=0), lately.max(axis=0), color=color, alpha=0.2, lw=0
            )
            axes.plot(
                places / 1e6, lately.mean(axis=0), color=color, linestyle=dashes,
                label=f"{WORLDS[world]}: mean of {len(several)} seeds, least to greatest",
            )  # fmt: skip
        axes.set_xlabel("steps in millions")
        axes.set_ylabel(f"return while learning,\nmean of {LATELY} episodes")
        axes.legend(loc="upper left")
    print(f"drawn: {save_figure(figure, picture)}")


def main() -> None:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("what", choices=["train", "show"])
    parser.add_argument("--out", type=Path, default=Path("learning_curves"))
    parser.add_argument("--worlds", nargs="+", choices=list(WORLDS), default=list(WORLDS))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--episodes", type=int, default=50)
    parser.add_argument("--picture", type=Path, default=Path("learning_curves.svg"))
    given = parser.parse_args()
    if given.what == "train":
        train(given.out, given.worlds, given.seeds, given.steps)
    else:
        show(given.out, given.worlds, given.seeds, given.episodes, given.picture)


if __name__ == "__main__":
    main()
