"""Kills campaigns, and their workers, with SIGKILL at random moments, until they are through.

Every trial must be there then, once, and be the one of a campaign that was left alone.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import heelstrike as hs
from heelstrike.cli.options import method_called
from heelstrike.experiments.campaigns.file import load_campaign
from heelstrike.experiments.campaigns.store import DATABASE

FILE = "campaign.toml"
SHORT = """
controller = "JointFeedback"
duration = 0.05
trials = {trials}
seed = 7
[parameters]
"ground.friction" = {{ uniform = [0.2, 0.9] }}
"state.v.root_x" = {{ normal = [0.0, 0.2] }}
"""
LONGEST = 1.5
"""Longest time (s) between an outcome and a death."""
PROCESSES = 2
"""Workers of a campaign whose workers are killed."""
PROGRAM = """
import sys
from pathlib import Path
from heelstrike.cli.options import method_called
from heelstrike.experiments.campaigns.file import load_campaign
from heelstrike.experiments.campaigns.workers import process_pool
if __name__ == "__main__":
    file, folder, processes = sys.argv[1], sys.argv[2], int(sys.argv[3])
    campaign, _ = load_campaign(file, Path(file).parent, method_called)
    executor = process_pool(processes) if processes else None
    campaign.run(folder, executor=executor, workers=1)
"""


@dataclass(frozen=True)
class Survived:
    """What is left of a campaign that was killed again and again."""

    kills: int
    """How often it was killed, or workers of it."""
    lost: int
    """Trials that are missing."""
    twice: int
    """Trials that are there more than once."""
    same: bool
    """Whether outcomes are those of a campaign that was left alone."""


def campaign_of(text: str, folder: Path) -> hs.Campaign:
    """Return the campaign that a text describes, which is kept in a folder."""
    file = folder / FILE
    file.write_text(text, encoding="utf-8")
    return load_campaign(file, folder, method_called)[0]


def short_campaign(home: Path, trials: int) -> hs.Campaign:
    """Make a campaign of short trials, whose file is in a folder."""
    return campaign_of(SHORT.format(trials=trials), home)


def killed(home: Path, whole: hs.Campaign, *, workers: bool, most: int, seed: int) -> Survived:
    """Run a campaign in processes of its own, and kill these until it is through.

    Parameters
    ----------
    home : Path
        The folder of its file, as :func:`short_campaign` makes it; empty but for that.
    whole : Campaign
        The same.
    workers : bool
        Whether its workers are killed, not itself.
    most : int
        How often at most.
    seed : int
        Of the moments.
    """
    kept, rng = home / "kept", np.random.default_rng(seed)
    script = home / "run.py"
    script.write_text(PROGRAM, encoding="utf-8")
    command = [sys.executable, str(script), str(home / FILE), str(kept)]
    command.append(str(PROCESSES if workers else 0))
    kill = _one_worker if workers else _itself
    kills, through = 0, False
    while not through:
        child = subprocess.Popen(command)
        while child.poll() is None:
            _wait_for_one_more(child, kept)
            pause = float(rng.uniform(0.0, LONGEST))
            try:
                child.wait(pause if kills < most else None)
            except subprocess.TimeoutExpired:
                kills += kill(child, rng)
        through = child.returncode == 0
        if not through and child.returncode != -signal.SIGKILL:
            raise RuntimeError(f"the campaign ended with {child.returncode}")
    with sqlite3.connect(kept / DATABASE) as connection:
        numbers = [n for (n,) in connection.execute("SELECT number FROM trials")]
    there = len(set(numbers))
    same = repr(whole.load(kept).outcomes) == repr(whole.run(workers=1).outcomes)
    return Survived(kills, len(whole) - there, len(numbers) - there, same)


def _itself(child: subprocess.Popen[bytes], _: np.random.Generator) -> int:
    child.kill()
    child.wait()
    return 1


def _one_worker(child: subprocess.Popen[bytes], rng: np.random.Generator) -> int:
    """Kill one of the workers of a campaign, if it has one now; return how many."""
    found = _workers_of(child.pid)
    if not found:
        return 0
    with contextlib.suppress(ProcessLookupError):
        os.kill(found[int(rng.integers(len(found)))], signal.SIGKILL)
        return 1
    return 0


def _workers_of(pid: int) -> list[int]:
    """Return the processes of a pool that a process has started."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
        return [int(one) for one in children if b"spawn_main" in _command_of(one)]
    except OSError:  # it has ended
        return []


def _command_of(pid: str) -> bytes:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    return b""


def _wait_for_one_more(child: subprocess.Popen[bytes], folder: Path) -> None:
    """Wait until a campaign has kept another block, or has ended."""
    before = rows(folder)
    while child.poll() is None and rows(folder) <= before:
        time.sleep(0.005)


def rows(folder: Path) -> int:
    """Count the outcomes that are kept in a folder."""
    try:
        with sqlite3.connect(f"file:{folder / DATABASE}?mode=ro", uri=True) as connection:
            return int(connection.execute("SELECT COUNT(*) FROM trials").fetchone()[0])
    except sqlite3.OperationalError:  # not begun
        return 0
