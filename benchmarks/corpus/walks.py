"""Published robots that have two feet and motors: a gait found, and 20 steps of it walked.

    python -m corpus.walks CLONES --scratch DIR [--only TEXT] [--page corpus/walks.md]

in the folder `benchmarks`; CLONES as for `python -m corpus`. Each file of `robots.csv` is loaded as
there, a trunk let loose where the file holds it, left and right averaged where they are no mirror
images. Its gait is that of `heelstrike walk`, of a smaller step where there is none, and is
followed by computed torque under time stepping at 1 ms. A row says how far it came, or why not.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import multiprocessing
import sys
import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from corpus.clones import Published, extracted, published, row
from heelstrike.errors import GaitError, HeelstrikeError
from heelstrike.experiments.walk import design, steps_taken, typical_step, walk, why_unstable
from heelstrike.gait import Gait
from heelstrike.robot import Robot, load_robot
from heelstrike.sim import TimeStepping

STEPS = 20
SMALLER = (1.0, 0.6, 0.3)
"""Sizes of a step, as shares of the usual one, in the order in which they are tried."""

LONGEST = 400.0
"""Time in s after which a robot is given up."""


@dataclass(frozen=True)
class Walk:
    """How far a robot came.

    Attributes
    ----------
    robot : Published
        Its file.
    machine : str
        The robot in words.
    gait : str
        Its gait in words; empty if there is none.
    steps : int
        Steps that it walked.
    reason : str
        Why it did not walk all, or what had to be changed.
    seconds : float
        Time that it took, in s.
    """

    robot: Published
    machine: str = ""
    gait: str = ""
    steps: int = 0
    reason: str = ""
    seconds: float = 0.0


def attempt(robot: Published, clones: Path, scratch: Path) -> Walk | None:
    """Load a robot, find a gait of it and walk it; None if it has not two feet and motors."""
    start = time.perf_counter()
    result = Walk(robot)
    try:
        machine, changed = _loaded(extracted(robot, clones, scratch / "files"), robot.how())
    except HeelstrikeError:
        return None
    if not (machine.nu and len(machine.feet) == 2):
        return None
    words = f"{machine.nv} coordinates, {machine.nu} motors, {machine.nc} contact points"
    result = replace(result, machine=f"{words}, {machine.total_mass:.4g} kg", reason=changed)
    try:
        gait = _gait(machine)
        words = f"{gait.step_length:.3g} m in {gait.step_duration:.3g} s"
        run = walk(machine, gait, steps=STEPS, method=TimeStepping(step=1e-3))
    except HeelstrikeError as error:
        return replace(result, reason=f"{changed}no gait: {_first(error)}")
    steps = steps_taken(run, gait)
    reason = changed
    if not run.completed or steps < STEPS:
        reason += "point feet: the gait is unstable" if why_unstable(gait) else run.message
    seconds = time.perf_counter() - start
    return replace(result, gait=words, steps=min(steps, STEPS), reason=reason, seconds=seconds)


def _loaded(path: Path, options: dict[str, Any]) -> tuple[Robot, str]:
    """Load a file with a trunk that is free and a mirror image, and say what that needed."""
    robot, changed = load_robot(path, **options), ""
    wishes = {
        "trunk let loose; ": ({"floating": True}, lambda: robot.floating),
        "left and right averaged; ": ({"mirror": "average"}, lambda: robot.mirror is not None),
    }
    for words, (more, fulfilled) in wishes.items():
        if not fulfilled():
            try:
                robot = load_robot(path, **options, **more)
            except HeelstrikeError:
                continue  # the gait is then refused, in words
            options, changed = options | more, changed + words
    return robot, changed


def _gait(robot: Robot) -> Gait:
    """Return the usual gait of a robot, or that of smaller steps."""
    usual, refused = typical_step(robot), None
    for share in SMALLER:
        size = replace(usual, length=share * usual.length, duration=share**0.5 * usual.duration)
        try:
            return design(robot, size)
        except GaitError as error:
            refused = refused or error
    assert refused is not None
    raise refused


def _first(error: Exception) -> str:
    return " ".join(str(error).split())[:300]


def _quietly(robot: Published, clones: Path, scratch: Path) -> Walk | None:
    warnings.simplefilter("ignore")
    return attempt(robot, clones, scratch)


def bounded(robot: Published, clones: Path, scratch: Path) -> Walk | None:
    """Attempt a robot in a process of its own, which is ended after `LONGEST`."""
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(1, mp_context=context) as pool:
        future = pool.submit(_quietly, robot, clones, scratch)
        try:
            return future.result(timeout=LONGEST)
        except concurrent.futures.TimeoutError:
            for process in list(multiprocessing.active_children()):
                process.kill()
            return Walk(robot, reason=f"given up after {LONGEST:g} s")
        except concurrent.futures.process.BrokenProcessPool:
            return Walk(robot, reason="the process died")


def page(walks: list[Walk]) -> str:
    """Return a page with all walks."""
    able = [each for each in walks if each.gait]
    far = [each for each in able if each.steps >= STEPS]
    lines = [
        "# Published robots that walk",
        "",
        "Written by `python -m corpus.walks` in `benchmarks`, of all robots of the corpus with two",
        "feet and motors.",
        "",
        f"{len(walks)} robots; a gait is found for {len(able)}, and {len(far)} walk {STEPS} steps.",
        "",
        "| file | robot | gait | steps | what was changed, or why not |",
        "|---|---|---|---|---|",
    ]
    for each in walks:
        steps = str(each.steps) if each.gait else ""
        lines.append(row(each.robot.link, each.machine, each.gait, steps, each.reason))
    return "\n".join([*lines, ""])


def main() -> int:
    """Walk the corpus."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clones", type=Path)
    parser.add_argument("--scratch", type=Path, required=True)
    parser.add_argument("--only", default="")
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    given.scratch.mkdir(parents=True, exist_ok=True)
    walks = []
    for robot in published():
        if given.only not in f"{robot.repository}/{robot.path}":
            continue
        one = bounded(robot, given.clones, given.scratch)
        if one is None:
            continue
        print(
            f"{one.steps:2d} {one.seconds:5.0f}s {robot.repository} {robot.path}: {one.machine}; "
            f"{one.gait} {one.reason}", flush=True,
        )  # fmt: skip
        walks.append(one)
        if given.page:
            given.page.write_text(page(walks), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
