"""The disturbances of the zoo: how each is laid on a walk, and how large it may be.

Sizes go with the robot: pushes with its weight and the root of its height, heights with its height,
so that each is searched over the same range of what its body feels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from heelstrike.analysis import torque_cost
from heelstrike.analysis.stability.largest import (
    Largest,
    largest,
    largest_ground_step,
    largest_push,
    largest_roughness,
    largest_slope,
)
from heelstrike.analysis.stability.trial import FAR, Trial
from heelstrike.contact.ground import Ground
from heelstrike.experiments.laws import BRAVO7_STEP, BRAVO7_WEIGHT
from heelstrike.experiments.walk import typical_step
from heelstrike.field_texts import dataclass
from heelstrike.robot import Robot

PUSH, SLOPE, STEP, ROUGH, MASS = 150.0, 15.0, 0.10, 0.05, 50.0
"""Largest sizes tried: N s, degrees, m and m of bravo7; per cent."""

LEAST_FRICTION = 0.05
"""Slipperiest patch tried."""

PATCH = 2.0
"""Length of a slippery patch in steps: two feet come to stand on it."""


@dataclass(frozen=True)
class Effort:
    """How finely sizes are searched."""

    strides: int = 10
    halvings: int = 3
    """strides, halvings: As of :func:`heelstrike.analysis.stability.largest.largest`."""


@dataclass(frozen=True)
class Chance:
    """The random choices of one trial."""

    phase: float
    """When in a step a push begins, from 0 to 1."""
    seed: int
    """Of rough ground."""


@dataclass(frozen=True)
class Disturbance:
    """A disturbance of the zoo."""

    name: str
    """What it is called."""
    heading: str
    """The same in a table."""
    unit: str
    """Of its sizes."""
    told: str
    """What it is, in a line."""
    measure: Callable[[Trial, Chance, Effort], Largest]
    """Finds how large it may be in a trial."""
    by_chance: bool = False
    """Whether chance has a part in it; if not, one trial says all."""
    standing: bool = False
    """Whether a robot that stands meets it, too."""
    less: bool = False
    """Whether less of it is better."""


def _push(sign: float, trial: Trial, chance: Chance, effort: Effort) -> Largest:
    robot = trial.robot
    most = PUSH * robot.total_mass / BRAVO7_WEIGHT * np.sqrt(_size(trial))
    return largest_push(
        trial, phase=chance.phase, direction=(sign, 0.0), link=int(robot.model.pivot),
        most=float(most), **vars(effort),
    )  # fmt: skip


def _slope(uphill: bool, trial: Trial, _: Chance, effort: Effort) -> Largest:
    return largest_slope(trial, uphill=uphill, most=SLOPE, **vars(effort))


def _ground_step(up: bool, trial: Trial, _: Chance, effort: Effort) -> Largest:
    found = largest_ground_step(trial, up=up, most=STEP * _size(trial), **vars(effort))
    return _scaled(found, 1000.0, "mm")


def _roughness(trial: Trial, chance: Chance, effort: Effort) -> Largest:
    size = _size(trial)
    found = largest_roughness(
        trial, seed=chance.seed, spacing=0.1 * size, most=ROUGH * size, **vars(effort)
    )
    return _scaled(found, 1000.0, "mm")


def _friction(trial: Trial, _: Chance, effort: Effort) -> Largest:
    """Find the least friction of a patch: how much less it may be, taken from what there is."""
    friction = float(trial.ground.model().friction[0])
    begin, end = trial.edge, trial.edge + PATCH * trial.step_length

    def recovers(less: float) -> bool:
        corners = [(begin - FAR, 0.0), (begin, 0.0), (end, 0.0), (end + FAR, 0.0)]
        ground = Ground(friction=[friction, friction - less, friction], profile=np.array(corners))
        run = trial.run(trial.begins, ground=ground)
        return bool(trial.recovered(run, (trial.begins, trial.begins), same_speed=False))

    found = largest(recovers, most=friction - LEAST_FRICTION, **vars(effort))
    failed = friction - found.failed if np.isfinite(found.failed) else np.inf
    return replace(found, recovered=friction - found.recovered, failed=failed, unit="μ")


def _trunk_mass(trial: Trial, _: Chance, effort: Effort) -> Largest:
    """Find how wrong the controller may be about the mass of the trunk, too little and too much."""

    def recovers(percent: float) -> bool:
        for factor in {1.0 + 0.01 * percent, 1.0 - 0.01 * percent}:
            wrong = replace(trial, robot=_with_trunk(trial, factor))
            run = wrong.run(wrong.begins)
            if not wrong.recovered(run, (wrong.begins, wrong.begins)):
                return False
        return True

    return largest(recovers, most=MASS, **vars(effort), unit="%")


def _price(trial: Trial, _: Chance, __: Effort) -> Largest:
    """Measure the mean over time of the sum of squared torques, undisturbed, over whole steps."""
    run = trial.run(trial.begins, record_every=1)
    end = trial.begins + int(trial.settling / trial.step_duration) * trial.step_duration
    mean = torque_cost(run, start=trial.begins, end=end) / (end - trial.begins)
    return Largest(recovered=mean, failed=mean, trials=1, unit="N²m²")


DISTURBANCES: tuple[Disturbance, ...] = (
    Disturbance(
        "push-forwards", "push →", "N s", "a push forwards of 0.1 s on the trunk",
        partial(_push, 1.0), by_chance=True, standing=True,
    ),
    Disturbance(
        "push-backwards", "push ←", "N s", "the same push backwards",
        partial(_push, -1.0), by_chance=True, standing=True,
    ),
    Disturbance(
        "slope-up", "slope ↑", "°", "level ground turns into a climbing slope",
        partial(_slope, True),
    ),
    Disturbance(
        "slope-down", "slope ↓", "°", "level ground turns into a descending slope",
        partial(_slope, False),
    ),
    Disturbance(
        "step-up", "step ↑", "mm", "one step up in the ground", partial(_ground_step, True)
    ),
    Disturbance(
        "step-down", "step ↓", "mm", "one step down in the ground", partial(_ground_step, False)
    ),
    Disturbance(
        "roughness", "rough ±", "mm", "corners of the ground at random heights", _roughness,
        by_chance=True,
    ),
    Disturbance(
        "friction", "least", "μ",
        "friction of the slipperiest patch withstood, two steps long, on ground of μ = 0.75",
        _friction, less=True,
    ),
    Disturbance(
        "trunk-mass", "mass ±", "%", "a trunk heavier, and lighter, than the controller knows",
        _trunk_mass, standing=True,
    ),
    Disturbance(
        "price", "price", "N²m²", "mean over time of the sum of squared torques, undisturbed",
        _price, less=True,
    ),
)  # fmt: skip
"""Disturbances, in the order of the table."""


def chances(seed: int, count: int) -> list[Chance]:
    """Return what chance decides, the same for every controller and robot.

    Phases are spread: one lies somewhere in each of equal parts of a step.
    """
    within = np.random.default_rng(seed).random(count)
    return [Chance((i + float(within[i])) / count, seed + i) for i in range(count)]


def _size(trial: Trial) -> float:
    return typical_step(trial.robot).length / BRAVO7_STEP


def _scaled(found: Largest, factor: float, unit: str) -> Largest:
    return replace(
        found, recovered=factor * found.recovered, failed=factor * found.failed, unit=unit
    )


def _with_trunk(trial: Trial, factor: float) -> Robot:
    robot, trunk = trial.robot, int(trial.robot.model.pivot)
    mass, inertia = robot.model.mass.copy(), robot.model.inertia.copy()
    mass[trunk] *= factor
    inertia[trunk] *= factor
    return replace(robot, model=robot.model.replaced(mass=mass, inertia=inertia))
