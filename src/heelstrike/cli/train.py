"""``heelstrike train``: learns to run on exact contact."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from heelstrike.cli.options import Afresh, AsJson
from heelstrike.cli.terminal import many, print_found, spoken, stage, tell, wrote
from heelstrike.cli.values import range_called, ranges_called
from heelstrike.errors import SimulationError

SPEEDS, GAIT = "0.2:0.6", "gait"
"""Speeds that a walker is commanded (m/s), and what it follows, if nobody says."""


class Learned(StrEnum):
    """What is learned."""

    RUN = "run"
    WALK = "walk"


@spoken
def train(
    *,
    robot: Annotated[
        str,
        typer.Argument(
            help="walker2d, hopper or halfcheetah, as Gymnasium has them; or a built-in robot or "
            "a file whose trunk moves freely."
        ),
    ],
    task: Annotated[
        Learned, typer.Option(help="To run as far as it can, or to walk at a commanded speed.")
    ] = Learned.RUN,
    speeds: Annotated[
        str | None,
        typer.Option(
            metavar="LOW:HIGH", help="Speeds in m/s that a walker is commanded.",
            show_default=SPEEDS,
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(
            metavar="gait|posture|FILE.json",
            help="What a walker follows: gaits that are designed over the speeds, the robot as it "
            "stands in its file, or a gait of yours.",
            show_default=GAIT,
        ),
    ] = None,
    randomise: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LOW:HIGH",
            help="What is drawn again for each episode of a walker: friction, mass (factor), push "
            "(N s), push_period (s), delay (s), slope (rad), roughness (m); repeat the option.",
        ),
    ] = None,
    decisions: Annotated[int, typer.Option(min=1, help="Decisions to learn from.")] = 1_000_000,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random numbers.")] = 0,
    lanes: Annotated[int, typer.Option(min=1, help="Robots simulated at the same time.")] = 64,
    threads: Annotated[int, typer.Option(min=1, help="Threads that move them.")] = 1,
    out: Annotated[
        Path | None,
        typer.Option(
            file_okay=False, help="Folder of the results; training resumes from it.",
            show_default="train-ROBOT",
        ),
    ] = None,
    film: Annotated[
        bool, typer.Option("--film/--no-film", help="Write film and page of a run, too.")
    ] = True,
    afresh: Afresh = False,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Learn to run, or to walk at a commanded speed, by proximal policy optimisation.

    The state is saved in training.npz from time to time. After Ctrl-C, or if the process is killed,
    the same command resumes, with the same result. Writes policy.npz, for hs.Policy; curve.csv and
    curve.svg; and run.mp4 and run.html of a run.
    """
    with stage("loading"):
        from heelstrike.experiments.learning.courses import named_task
        from heelstrike.experiments.learning.tasks import task_of
        from heelstrike.experiments.learning.training import WALKING, Recipe, Trainer
        from heelstrike.experiments.learning.writing import KEPT, write_all

        learned: Any = None
        recipe = WALKING if task is Learned.WALK else Recipe()
        if task is Learned.WALK:
            learned = named_task(
                "Walk", file=robot, reference=reference or GAIT,
                speeds=range_called(speeds or SPEEDS, "--speeds"),
                randomise=ranges_called(randomise),
            )  # fmt: skip
        elif needless := [
            name
            for name, given in (
                ("--randomise", randomise), ("--speeds", speeds), ("--reference", reference),
            )
            if given
        ]:  # fmt: skip
            verb = "is" if len(needless) == 1 else "are"
            raise SimulationError(
                f"{', '.join(needless)} {verb} for the task walk: add --task walk, or leave it out"
            )
        else:
            learned = task_of(robot)
        folder = out or Path(f"train-{Path(robot).stem}")
        folder.mkdir(parents=True, exist_ok=True)
        trainer = Trainer(
            learned, decisions, replace(recipe, seed=seed, lanes=lanes), threads=threads
        )
        kept = folder / KEPT
        if kept.exists() and not afresh:
            trainer.restore(kept)
    with many("learning") as show:

        def reached(trainer: Trainer) -> None:
            curve = trainer.curve
            told = f"return {curve.mean_return[-1]:.0f}, {curve.mean_length[-1]:.0f} decisions"
            show(trainer.round, trainer.rounds, {f"{told} an episode": 1.0})

        trainer.learn(kept, reached)
    with stage("writing") as doing:
        files, run = write_all(trainer, folder, film=film, doing=lambda what: doing.doing(what, 0))
    wrote(*files)
    curve = trainer.curve
    found = {
        "robot": run.robot.name, "decisions": curve.decisions[-1],
        "mean_return": curve.mean_return[-1], "mean_length": curve.mean_length[-1],
        "run": {"status": run.status.value, "time": float(run.time[-1]),
                "distance": float(run.position[-1, 0] - run.position[0, 0])},
    }  # fmt: skip
    said = (
        f"{run.robot.name}: return {curve.mean_return[-1]:.0f} over the last 100 episodes of "
        f"{curve.mean_length[-1]:.0f} decisions; the run of the policy: {run.message}, "
        f"{run.position[-1, 0] - run.position[0, 0]:.2f} m"
    )
    print_found(said, found, as_json=as_json)
    tell(f"in {folder}: {', '.join(each.name for each in files)}")
