"""What is left of a training: the policy, its curve, and a run of it as film and page."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from heelstrike.contact.ground import Ground
from heelstrike.control.policy.law import Policy
from heelstrike.control.policy.network import Network
from heelstrike.experiments.learning.courses import LearningTask
from heelstrike.experiments.learning.training import Curve, Trainer
from heelstrike.experiments.learning.walk_task import WalkTask
from heelstrike.robot.state import State
from heelstrike.sim import Run, TimeStepping, simulate
from heelstrike.view.style import new_figure, save_figure, styled
from heelstrike.whole_file import write_whole

KEPT = "training.npz"
"""What is gone on from."""

SHOWN = 10.0
"""Seconds of the run that is shown."""


def run_of(network: Network, task: LearningTask, *, duration: float = SHOWN) -> Run:
    """Simulate a policy from the initial state of its task, without noise.

    Parameters
    ----------
    network : Network
        The policy.
    task : RunningTask or WalkTask
        Its task; a walker is commanded a speed in the middle.
    duration : float
        How long at most (s).

    Returns
    -------
    Run
        The run, up to a fall.
    """
    robot, state, speed = task.robot(), None, None
    if isinstance(task, WalkTask):
        reference = task.motion()
        middle = reference.speed.size // 2
        begin, speed = reference.motion[middle, 0], float(reference.speed[middle])
        state = State(begin[: robot.nq], begin[robot.nq : robot.nq + robot.nv])
    return simulate(
        robot, Policy(network, robot, speed=speed), duration=duration,
        state=robot.reference_state() if state is None else state,
        method=TimeStepping(step=task.step), ground=Ground(friction=task.friction),
    )  # fmt: skip


def write_curve(curve: Curve, folder: Path) -> list[Path]:
    """Write how learning went, as table and figure.

    Parameters
    ----------
    curve : Curve
        How it went.
    folder : Path
        Where to.

    Returns
    -------
    list of Path
        The files, ``curve.csv`` and ``curve.svg``.
    """
    columns = asdict(curve)
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    table = write_whole(folder / "curve.csv", text.getvalue().encode())
    with styled():
        figure = new_figure(6.0, 3.2)
        axes = figure.subplots()
        axes.plot([each / 1e6 for each in curve.decisions], curve.mean_return)
        axes.set_xlabel("decisions in millions")
        axes.set_ylabel("return, mean of 100 episodes")
    return [table, save_figure(figure, folder / "curve.svg")]


def write_all(
    trainer: Trainer, folder: Path, *, film: bool = True,
    doing: Callable[[str], None] = lambda _: None,
) -> tuple[list[Path], Run]:  # fmt: skip
    """Write everything that is left of a training.

    Parameters
    ----------
    trainer : Trainer
        It, finished or not.
    folder : Path
        Where to.
    film : bool
        Whether film and page are written, too.
    doing : callable
        Told what is being done.

    Returns
    -------
    files : list of Path
        ``policy.npz``, ``curve.csv``, ``curve.svg``, ``run.mp4`` and ``run.html``.
    run : Run
        A run of the policy.
    """
    network = trainer.network()
    files = [network.save(folder / "policy.npz"), *write_curve(trainer.curve, folder)]
    doing("simulating")
    run = run_of(network, trainer.task)
    if film:
        doing("filming")
        files += [run.animate(folder / "run.mp4"), run.save_html(folder / "run.html")]
    return files, run
