"""Tune gains and gait of bravo7 with Optuna, so that it withstands pushes, delays and poor ground.

    pip install optuna
    python benchmarks/tuning.py --trials 60 --study tuning.sqlite

Each trial of the study takes gains of computed torque, a step time and a clearance; designs the
gait, and walks a campaign of it: pushes, friction and delays drawn from one seed, the same for all,
so that differences are those of what is tuned. What is made larger is the share that walks on. A
gait that does not exist prunes its trial.

The study is kept in a file: ended in whatever way, the same command goes on with it until there are
as many finished trials as asked for.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import uniform

import heelstrike as hs

STEP_LENGTH, FRICTION = 0.30, 0.75
PARAMETERS: dict[str, Any] = {
    "push.impulse": uniform(-40.0, 80.0), "ground.friction": uniform(0.4, 0.5),
    "actuators.delay": [0.0, 1e-3, 2e-3],
}  # fmt: skip
"""What differs among the walks of a campaign."""
SECONDS = 4.2
"""How long each walk lasts."""
SEED = 1
"""Of the campaigns, and of what Optuna tries first."""


def tuned(robot: hs.Robot, numbers: dict[str, float]) -> hs.Trial:
    """Return the walk of some gains and a gait.

    Parameters
    ----------
    robot : Robot
        The robot.
    numbers : dict
        Natural frequency (1/s) and damping ratio of the joints, step duration (s), clearance (m).

    Raises
    ------
    GaitError
        If there is no such gait.
    """
    gait = hs.optimize_gait(
        robot, step_length=STEP_LENGTH, step_duration=numbers["step_duration"],
        clearance=numbers["clearance"], friction=FRICTION,
    )  # fmt: skip
    frequency = numbers["frequency"]
    law = hs.ComputedTorque(
        robot, gait, kp=frequency**2, kd=2.0 * numbers["damping_ratio"] * frequency
    )
    return hs.Trial(
        robot=robot, controller=law, state=gait.initial_state, step_length=gait.step_length,
        step_duration=gait.step_duration, ground=hs.Ground(friction=FRICTION),
    )  # fmt: skip


def share(robot: hs.Robot, numbers: dict[str, float], walks: int) -> float:
    """Return the share of a campaign's walks that go on to the end."""
    campaign = hs.Campaign(tuned(robot, numbers), PARAMETERS, walks, SEED, duration=SECONDS)
    return float(np.mean(campaign.run().success))


def suggested(trial: Any) -> dict[str, float]:
    """Return what a trial of a study tries."""
    return {
        "frequency": trial.suggest_float("frequency", 8.0, 60.0, log=True),
        "damping_ratio": trial.suggest_float("damping_ratio", 0.3, 1.5),
        "step_duration": trial.suggest_float("step_duration", 0.5, 0.9),
        "clearance": trial.suggest_float("clearance", 0.01, 0.05),
    }


def objective(trial: Any, robot: hs.Robot, walks: int) -> float:
    """Return what a trial of a study comes to; prune it if there is no gait."""
    import optuna

    try:
        return share(robot, suggested(trial), walks)
    except hs.GaitError as error:
        raise optuna.TrialPruned(str(error)) from error


def main() -> None:
    """Go on with a study, and print the best."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=60, help="finished trials of the study")
    parser.add_argument("--walks", type=int, default=64, help="walks of a campaign")
    parser.add_argument("--study", type=Path, default=Path("tuning.sqlite"), help="its file")
    options = parser.parse_args()
    try:
        import optuna
    except ImportError:
        raise SystemExit("this example needs Optuna: pip install optuna") from None
    robot = hs.load_robot("bravo7")
    study = optuna.create_study(
        study_name="bravo7", storage=f"sqlite:///{options.study}", load_if_exists=True,
        direction="maximize",
    )  # fmt: skip
    # Another seed at each start: by the same one it would try the same points again.
    study.sampler = optuna.samplers.TPESampler(seed=SEED + len(study.trials))
    ended = (optuna.trial.TrialState.COMPLETE, optuna.trial.TrialState.PRUNED)
    left = options.trials - len(study.get_trials(deepcopy=False, states=ended))
    study.optimize(lambda trial: objective(trial, robot, options.walks), n_trials=max(left, 0))
    complete = study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,))
    if not complete:
        raise SystemExit("no trial has a gait; ask for more trials")
    print(f"{study.best_value:.0%} of the walks go on, trial {study.best_trial.number}")
    for name, value in study.best_params.items():
        print(f"  {name} {value:.4g}")


if __name__ == "__main__":
    main()
