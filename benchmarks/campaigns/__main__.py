"""What campaigns cost beside the bare batch, and whether any of a kind of death loses a trial.

    python benchmarks/campaigns cost --trials 400
    python benchmarks/campaigns kills --kills 200
    python benchmarks/campaigns clusters --trials 640 --only Dask
    python benchmarks/campaigns schedulers --kills 5

`cost` walks trials of ``mix.toml`` by :class:`~heelstrike.Campaign`, kept on disk, and the very
same in bare calls of :func:`~heelstrike.simulate_batch`, in turn, and prints processor time, the
smallest of some rounds; where the machine is not quiet, that counts and not the time on the wall.

`kills` begins a campaign of short trials in a process of its own, kills that with SIGKILL at random
moments and begins it again, until it is through; then the same with the workers of one. Every trial
must be there, once, and be the one of a campaign that was left alone.

`clusters` has trials of ``mix.toml`` worked on by a pool of processes, a Dask cluster and jobs of
submitit, where these are installed, or only one of them beside own threads. It compares outcomes
and processor time: what beginning and end cost, what each trial does, and what 10 000 would.
`schedulers` kills the scheduler of a Dask cluster at random moments, and goes on with another one.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import heelstrike as hs
from heelstrike.experiments.campaigns.trials import laid_out

# Run as a folder, its modules would be on the path and not the package.
sys.path[0] = str(Path(__file__).resolve().parent.parent)

from campaigns.clusters import EXECUTORS, FEW, compare, kill_schedulers  # noqa: E402
from campaigns.killing import campaign_of, killed, short_campaign  # noqa: E402

MIX = Path(__file__).parent / "mix.toml"


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


def mix(trials: int, folder: Path) -> hs.Campaign:
    """Return the campaign of ``mix.toml`` with so many trials, which is kept in a folder."""
    text = MIX.read_text(encoding="utf-8").replace("trials = 10000", f"trials = {trials}")
    return campaign_of(text, folder)


def cost(trials: int, rounds: int, workers: int) -> None:
    """Print what a campaign costs beside the bare batch."""
    with tempfile.TemporaryDirectory() as folder:
        campaign, few = mix(trials, Path(folder)), mix(8, Path(folder))
        few.run(workers=workers)  # compiles
        bare(few, workers)
        least = {"campaign": np.inf, "bare batch": np.inf}
        wall, memory = dict(least), {}
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
                memory.setdefault(name, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        for name, seconds in least.items():
            print(
                f"{name}: {1e3 * seconds / trials:.1f} ms of a processor a trial, "
                f"{wall[name]:.1f} s on the wall, at most {memory[name]:.0f} MB until then"
            )
        print(f"ratio {least['campaign'] / least['bare batch']:.3f} of processor time")
        print(f"10 000 on {workers} quiet processors: "
              f"{1e4 * least['campaign'] / trials / workers / 60.0:.1f} min")  # fmt: skip
        lasted = int(np.count_nonzero(batch.completed))
        print(f"{results}; {lasted} of {trials} lasted in the batch")


def kills(count: int, trials: int, seed: int) -> None:
    """Kill campaigns and workers again and again, half of the times each; tell what was lost."""
    halves = ("campaigns", False, count - count // 2), ("workers", True, count // 2)
    for who, workers, most in halves:
        deaths = lost = twice = rounds = 0
        while deaths < most:
            with tempfile.TemporaryDirectory() as folder:
                whole = short_campaign(Path(folder), trials)
                found = killed(
                    Path(folder), whole, workers=workers, most=most - deaths,
                    seed=seed + rounds,
                )  # fmt: skip
            rounds += 1
            deaths, lost, twice = deaths + found.kills, lost + found.lost, twice + found.twice
            print(f"{deaths} {who} killed in {rounds} campaigns of {trials} trials: {lost} lost, "
                  f"{twice} twice, outcomes the same: {found.same}", flush=True)  # fmt: skip
            if found.lost or found.twice or not found.same:
                raise SystemExit(1)


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
    others = commands.add_parser("clusters", help="compare workers of others with own threads")
    others.add_argument("--trials", type=int, default=5 * FEW)
    others.add_argument("--only", choices=list(EXECUTORS), help="one of them beside own threads")
    schedulers = commands.add_parser("schedulers", help="kill schedulers of Dask")
    schedulers.add_argument("--kills", type=int, default=5)
    schedulers.add_argument("--trials", type=int, default=1500)
    schedulers.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    if options.command == "clusters" and options.trials <= FEW:
        parser.error(f"clusters tells beginning and trials apart by more than {FEW} trials")
    if options.command == "cost":
        cost(options.trials, options.rounds, options.workers)
    elif options.command == "clusters":
        with tempfile.TemporaryDirectory() as folder:
            few, campaign = (mix(count, Path(folder)) for count in (FEW, options.trials))
            compare(few, campaign, Path(folder), options.only)
    elif options.command == "schedulers":
        with tempfile.TemporaryDirectory() as folder:
            campaign = short_campaign(Path(folder), options.trials)
            kill_schedulers(campaign, Path(folder), options.kills, options.seed)
    else:
        kills(options.kills, options.trials, options.seed)


if __name__ == "__main__":
    main()
