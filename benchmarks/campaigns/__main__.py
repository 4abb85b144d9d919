"""What campaigns cost beside the bare batch, and whether any of a kind of death loses a trial.

    python benchmarks/campaigns cost --trials 400
    python benchmarks/campaigns kills --kills 200

`cost` walks trials of ``mix.toml`` by :class:`~heelstrike.Campaign`, kept on disk, and the very
same in bare calls of :func:`~heelstrike.simulate_batch`, in turn, and prints processor time, the
smallest of some rounds; where the machine is not quiet, that counts and not the time on the wall.

`kills` begins a campaign of short trials in a process of its own, kills that with SIGKILL at random
moments and begins it again, until it is through: every trial must be there, once, and be the one
of a campaign that was left alone.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import heelstrike as hs
from heelstrike.cli.options import method_called
from heelstrike.experiments.campaigns.file import load_campaign
from heelstrike.experiments.campaigns.store import DATABASE
from heelstrike.experiments.campaigns.trials import laid_out

MIX = Path(__file__).parent / "mix.toml"
SHORT = """
controller = "JointFeedback"
duration = 0.05
trials = {trials}
seed = 7
[parameters]
"ground.friction" = {{ uniform = [0.2, 0.9] }}
"state.v.root_x" = {{ normal = [0.0, 0.2] }}
"""
FIRST, LAST = 0.0, 1.5
"""Shortest and longest time (s) between the first outcome of a process and its end."""


def campaign_of(text: str, folder: Path) -> hs.Campaign:
    """Return the campaign that a text describes."""
    file = folder / "campaign.toml"
    file.write_text(text, encoding="utf-8")
    return load_campaign(file, folder, method_called)[0]


def bare(campaign: hs.Campaign, threads: int) -> hs.BatchResult:
    """Simulate the trials of a campaign in one bare batch."""
    (trial,) = campaign.trials.values()
    lanes = [
        laid_out(trial, campaign.plan.of(i), int(campaign.plan.seeds[i]))
        for i in range(len(campaign))
    ]
    return hs.simulate_batch(
        trial.robot, [lane.controller for lane in lanes], state=trial.state,
        ground=[lane.ground for lane in lanes], pushes=[lane.pushes for lane in lanes],
        method=trial.method, duration=campaign.duration, threads=threads, progress=False,
        on_error="stop",
    )  # fmt: skip


def cost(trials: int, rounds: int, workers: int) -> None:
    """Print what a campaign costs beside the bare batch."""
    with tempfile.TemporaryDirectory() as folder:
        text = MIX.read_text(encoding="utf-8").replace("trials = 10000", f"trials = {trials}")
        campaign = campaign_of(text, Path(folder))
        few = campaign_of(text.replace(f"trials = {trials}", "trials = 8"), Path(folder))
        few.run(workers=workers)  # compiles
        bare(few, workers)
        least = {"campaign": np.inf, "bare batch": np.inf}
        wall = dict(least)
        for round_ in range(rounds):
            for name in least:
                begin, at = time.process_time(), time.perf_counter()
                if name == "campaign":
                    results = campaign.run(
                        Path(folder) / "kept", workers=workers, afresh=round_ > 0
                    )
                else:
                    batch = bare(campaign, workers)
                least[name] = min(least[name], time.process_time() - begin)
                wall[name] = min(wall[name], time.perf_counter() - at)
        for name, seconds in least.items():
            print(
                f"{name}: {1e3 * seconds / trials:.1f} ms of a processor a trial, "
                f"{wall[name]:.1f} s on the wall"
            )
        print(f"ratio {least['campaign'] / least['bare batch']:.3f} of processor time")
        print(f"10 000 on {workers} quiet processors: "
              f"{1e4 * least['campaign'] / trials / workers / 60.0:.1f} min")  # fmt: skip
        print(f"memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")
        lasted = int(np.count_nonzero(batch.completed))
        print(f"{results}; {lasted} of {trials} lasted in the batch")


def kills(count: int, trials: int, seed: int) -> None:
    """Kill a campaign again and again; tell what was lost or done twice."""
    rng, text = np.random.default_rng(seed), SHORT.format(trials=trials)
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        whole = campaign_of(text, home)
        wanted = repr(whole.run().outcomes)
        killed = rounds = 0
        while killed < count:
            kept = home / f"kept{rounds}"
            rounds += 1
            while True:
                child = subprocess.Popen(
                    [sys.executable, __file__, "run", str(home / "campaign.toml"), str(kept)]
                )
                before = rows(kept)
                while child.poll() is None and rows(kept) <= before:
                    time.sleep(0.005)
                pause = float(rng.uniform(FIRST, LAST))
                try:
                    child.wait(pause if killed < count else None)
                    break
                except subprocess.TimeoutExpired:
                    os.kill(child.pid, signal.SIGKILL)
                    child.wait()
                    killed += 1
            results = whole.load(kept)
            with sqlite3.connect(kept / DATABASE) as connection:
                numbers = [n for (n,) in connection.execute("SELECT number FROM trials")]
            lost, twice = trials - len(set(numbers)), len(numbers) - len(set(numbers))
            same = repr(results.outcomes) == wanted
            print(f"{killed} kills: {lost} lost, {twice} twice, outcomes the same: {same}",
                  flush=True)  # fmt: skip
            assert not lost, "trials were lost"
            assert not twice, "trials are there twice"
            assert same, "outcomes differ"


def rows(folder: Path) -> int:
    """Count the outcomes that are kept in a folder."""
    try:
        with sqlite3.connect(f"file:{folder / DATABASE}?mode=ro", uri=True) as connection:
            return int(connection.execute("SELECT COUNT(*) FROM trials").fetchone()[0])
    except sqlite3.OperationalError:  # not begun
        return 0


def main() -> None:
    """Measure, or kill."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    costs = commands.add_parser("cost", help="compare with the bare batch")
    costs.add_argument("--trials", type=int, default=400)
    costs.add_argument("--rounds", type=int, default=2)
    costs.add_argument("--workers", type=int, default=2)
    deaths = commands.add_parser("kills", help="kill a campaign at random moments")
    deaths.add_argument("--kills", type=int, default=200)
    deaths.add_argument("--trials", type=int, default=4000)
    deaths.add_argument("--seed", type=int, default=0)
    one = commands.add_parser("run", help="run a campaign of a file")
    one.add_argument("file", type=Path)
    one.add_argument("folder", type=Path)
    options = parser.parse_args()
    if options.command == "cost":
        cost(options.trials, options.rounds, options.workers)
    elif options.command == "kills":
        kills(options.kills, options.trials, options.seed)
    else:
        campaign, _ = load_campaign(options.file, options.file.parent, method_called)
        campaign.run(options.folder, workers=1)


if __name__ == "__main__":
    main()
