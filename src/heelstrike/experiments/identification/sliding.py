"""Friction of the ground, which shows where a foot slides: there |f_t| is μ f_n, not less."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from heelstrike.errors import SimulationError
from heelstrike.experiments.identification.equations import Equations
from heelstrike.experiments.identification.standing import PRESSED
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.robot_log import RobotLog
from heelstrike.robot.model import Floats

AROUND, FEWEST_AROUND = 0.02, 3
"""Time (s) before and after a sample that its velocity is taken from, and least samples of that."""
SURELY = 6.0
"""Standard deviations of noise above which a point slides."""
ALL_BUT = 0.9
"""Part of its friction from which on a foot may slide: noise and slow sliding hide the rest."""
SLOWEST = 0.02
"""Speed (m/s) below which nothing is taken for sliding: feet of files stand still to less."""


@dataclass(frozen=True)
class GroundFriction:
    """What a motion tells of the friction of the ground."""

    value: float
    """The coefficient; NaN where no foot slides."""
    deviation: float
    """Its standard deviation."""
    samples: int
    """Samples of contact points that slide."""
    reason: str = ""
    """Why it is not visible."""

    def __str__(self) -> str:
        if not self.samples:
            return f"friction of the ground: not visible, {self.reason}"
        return (
            f"friction of the ground: {self.value:.4g} ± {1.96 * self.deviation:.2g}, from "
            f"{self.samples} samples of points that slide"
        )


def sliding(
    equations: Equations, log: RobotLog, encoder: Floats, force_noise: float
) -> Floats | None:
    """Tell which way each contact point slides, (n, nc): 1, −1, or 0 where it does not.

    Parameters
    ----------
    equations : Equations
        Of the robot.
    log : RobotLog
        Its motion.
    encoder : (k,) array
        Standard deviation of the noise of joints; that of the trunk is taken for the largest.
    force_noise : float
        That of forces (N).

    Returns
    -------
    (n, nc) array or None
        None if forces or the trunk were not measured.
    """
    if log.force is None or log.trunk is None:
        return None
    q = np.hstack([log.trunk, log.joints])
    v, spread = velocities(log.time, q)
    noise = np.concatenate([np.full(log.trunk.shape[1], encoder.max()), encoder])
    tangent = equations.jacobians(q)[:, 1::2]
    speed = (tangent @ np.nan_to_num(v)[:, :, None])[:, :, 0]  # none at the ends
    least = np.maximum(SURELY * spread * np.sqrt(tangent**2 @ noise**2), SLOWEST)
    presses = (log.force[:, :, 0] > PRESSED * force_noise).astype(np.float64)
    slides = (np.abs(speed) > least) & (_all_around(presses, around(log.time)) > 0.0)
    return np.where(slides, np.sign(speed), 0.0)


def ground_friction(
    equations: Equations, log: RobotLog, senses: Floats | None, force_noise: float
) -> GroundFriction:
    """Tell the friction of level ground from points that slide on it.

    Parameters
    ----------
    equations : Equations
        Of the robot.
    log : RobotLog
        Its motion.
    senses : (n, nc) array or None
        Which way each point slides, as :func:`sliding` tells.
    force_noise : float
        Standard deviation of the noise of forces (N).
    """
    if senses is None or log.force is None:
        missing = "forces of the contact points" if log.force is None else "where the trunk is"
        return GroundFriction(math.nan, math.nan, 0, f"for {missing} is not in the recording")
    surely = _all_around(senses, around(log.time) // 2)
    scale = equations.robot.model.friction_scale
    pressing = float(np.sum(np.abs(surely) * scale * log.force[:, :, 0]))
    count = int(np.count_nonzero(surely))
    if not count:
        return GroundFriction(math.nan, math.nan, 0, "for no foot slides for long")
    value = -float(np.sum(surely * log.force[:, :, 1])) / pressing
    deviation = force_noise * math.sqrt(count * (1.0 + value**2)) / pressing
    return GroundFriction(value, deviation, count)


def may_slide(
    equations: Equations, log: RobotLog, senses: Floats | None, friction: GroundFriction
) -> NDArray[np.bool_] | None:
    """Tell which contact points slide or may begin to: those of feet that use all their friction.

    Parameters
    ----------
    equations : Equations
        Of the robot.
    log : RobotLog
        Its motion.
    senses : (n, nc) array or None
        Which way each point slides, as :func:`sliding` tells.
    friction : GroundFriction
        What is told of the ground.

    Returns
    -------
    (n, nc) array or None
        None if nothing is known of sliding.
    """
    if senses is None or log.force is None:
        return None
    found: NDArray[np.bool_] = senses != 0.0
    if friction.samples:
        for foot in equations.robot.feet:
            normal, tangent = np.moveaxis(log.force[:, list(foot.contacts)].sum(axis=1), 1, 0)
            found[:, list(foot.contacts)] |= (
                np.abs(tangent) > ALL_BUT * friction.value * normal
            )[:, None]  # fmt: skip
    return found


def around(time: Floats) -> int:
    """How many samples before and after one its velocity is taken from."""
    return max(round(AROUND / float(np.median(np.diff(time)))), FEWEST_AROUND)


def velocities(time: Floats, q: Floats) -> tuple[Floats, float]:
    """Velocities (n, nq) by lines through the samples around each, and their noise for that of one.

    Those of the first and last samples are NaN.

    Raises
    ------
    SimulationError
        If samples are too few.
    """
    count = around(time)
    if len(time) <= 2 * count:
        raise SimulationError(f"more than {2 * count} samples are wanted, got {len(time)}")
    inner = slice(count, len(time) - count)
    near = np.lib.stride_tricks.sliding_window_view(time, 2 * count + 1)
    away = near - near.mean(axis=1, keepdims=True)
    weight = away / np.sum(away**2, axis=1, keepdims=True)
    found = np.full(q.shape, np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(q, 2 * count + 1, axis=0)
    found[inner] = np.einsum("iw,ijw->ij", weight, windows)
    return found, float(np.linalg.norm(weight, axis=1).max())


def _all_around(senses: Floats, count: int) -> Floats:
    """Keep what is the same at all samples around; elsewhere it is zero: none that only begins."""
    found = senses.copy()
    for shift in range(1, count + 1):
        for rolled in (np.roll(senses, shift, axis=0), np.roll(senses, -shift, axis=0)):
            found[rolled != senses] = 0.0
    return found
