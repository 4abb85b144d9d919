"""Friction of the ground, which shows where a foot slides: there |f_t| is μ f_n, not less."""

from __future__ import annotations

import math
from decimal import ROUND_FLOOR, Context
from statistics import NormalDist

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from heelstrike.experiments.identification.equations import Equations
from heelstrike.experiments.identification.standing import PRESSED
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.robot_log import RobotLog
from heelstrike.robot.model import Floats

AROUND, FEWEST_AROUND = 0.02, 3
"""Time (s) before and after a sample within which a slide must show, and least samples of that."""
SURELY = 4.0
"""Standard deviations of noise by which a point must move before a sample, and again after it, so
that it slides there: noise of that sample moves the two to opposite sides, never both beyond."""
SLOWEST = 0.02
"""Speed (m/s) below which nothing is taken for sliding: feet of files stand still to less."""
AGREES = 4.0
"""Standard deviations of a ratio of forces beyond which its sample is not of one that slides."""
AGAIN = 5
"""How often samples that do not agree are left out: one is left out or not after two."""
DOUBT = 0.05
"""Part of all recordings in which friction may be less than what forces are said to have used."""
ALL_BUT = 0.9
"""Part of its friction from which on a foot may slide: noise and slow sliding hide the rest."""


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
    at_least: float = math.nan
    """What it is at least, in 95 % of all recordings, by the forces that have used it; NaN where
    they were not measured."""

    def __str__(self) -> str:
        if not self.samples:
            least = Context(prec=2, rounding=ROUND_FLOOR).create_decimal_from_float(self.at_least)
            told = f"friction of the ground: not visible, {self.reason}"
            if least.is_nan():
                return told
            return f"{told}; it is {float(least):g} at least, which forces have used"
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
    noise = np.concatenate([np.full(log.trunk.shape[1], encoder.max()), encoder])
    tangent = equations.jacobians(q)[:, 1::2]
    spread = np.sqrt(2.0 * (tangent**2 @ noise**2))  # of the way from one sample to another
    ways = 0.5 * (tangent[1:] + tangent[:-1]) @ np.diff(q, axis=0)[:, :, None]
    path = np.vstack([np.zeros(tangent.shape[1]), np.cumsum(ways[:, :, 0], axis=0)])
    presses = log.force[:, :, 0] > PRESSED * force_noise
    found = np.zeros_like(path)
    for reach in range(1, min(around(log.time), (len(path) - 1) // 2) + 1):
        # The shortest time in which it shows: a slide may be over soon.
        here, sooner, later = slice(reach, -reach), slice(0, -2 * reach), slice(2 * reach, None)
        held = sliding_window_view(presses, 2 * reach + 1, axis=0).all(axis=-1)
        before, after = path[here] - path[sooner], path[later] - path[here]
        slides = held & (before * after > 0.0) & (found[here] == 0.0)
        for way, end in ((before, sooner), (after, later)):
            slowly = SLOWEST * np.abs(log.time[end] - log.time[here])[:, None]
            slides &= np.abs(way) > np.maximum(SURELY * spread[here], slowly)
        found[here] += slides * np.sign(after)
    return found


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
    if log.force is None:
        return _hidden("for forces of the contact points are not in the recording")
    scale = equations.robot.model.friction_scale
    least = at_least(log.force, scale, force_noise)
    if senses is None:
        return _hidden("for where the trunk is is not in the recording", least)
    rubs = (senses != 0.0) & (scale > 0.0)
    pressing = (scale * log.force[:, :, 0])[rubs]
    rubbing = -(senses * log.force[:, :, 1])[rubs]
    if not len(pressing):
        return _hidden("for no foot slides so far and so fast that it shows", least)
    value = float(np.median(rubbing / pressing))
    for _ in range(AGAIN):  # of a point that sticks meanwhile the force is less than friction
        noise = force_noise * np.hypot(1.0, scale.max() * value)
        agree = np.abs(rubbing - value * pressing) < AGREES * noise
        if 2 * np.count_nonzero(agree) < len(agree):
            return _hidden(
                "for forces of the points that slide do not agree on one coefficient", least
            )
        value = float(rubbing[agree].sum() / pressing[agree].sum())
    count, weight = int(np.count_nonzero(agree)), float(pressing[agree].sum())
    deviation = force_noise * math.sqrt(count * (1.0 + value**2)) / weight
    return GroundFriction(value, deviation, count, at_least=least)


def _hidden(reason: str, least: float = math.nan) -> GroundFriction:
    return GroundFriction(math.nan, math.nan, 0, reason, least)


def at_least(force: Floats, scale: Floats, force_noise: float) -> float:
    """Tell what friction of the ground is at least, as forces have used it.

    A force within the cone of friction is measured outside of it by noise alone: by more than z
    standard deviations, as far as the line f_t = μ f_n is away, in one of 1/Φ(−z) samples. Of all
    samples together, to either side, with z of Bonferroni, hardly ever. So μ is no less than where
    the line comes as near as that.

    Parameters
    ----------
    force : (n, nc, 2) array
        Forces of the contact points, normal and tangent (N).
    scale : (nc,) array
        By what friction at each point is multiplied.
    force_noise : float
        Standard deviation of their noise (N).

    Returns
    -------
    float
        A coefficient that is less than the ground's in all but a part `DOUBT` of recordings.
    """
    rubs = scale > 0.0
    normal, tangent = force[:, rubs, 0], np.abs(force[:, rubs, 1])
    if not normal.size:
        return 0.0
    away = -NormalDist().inv_cdf(DOUBT / (2.0 * normal.size)) * force_noise
    size = np.hypot(normal, tangent)
    angle = np.arctan2(tangent, normal) - np.arcsin(np.minimum(away / np.maximum(size, away), 1.0))
    used = np.tan(np.where(normal > 0.0, np.maximum(angle, 0.0), 0.0)) / scale[rubs]
    return float(used.max())


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
    near = around(log.time)  # slides begin before they surely show
    padded = np.pad(senses != 0.0, ((near, near), (0, 0)))
    found = np.asarray(sliding_window_view(padded, 2 * near + 1, axis=0).any(axis=-1))
    if friction.samples:
        for foot in equations.robot.feet:
            normal, tangent = np.moveaxis(log.force[:, list(foot.contacts)].sum(axis=1), 1, 0)
            found[:, list(foot.contacts)] |= (
                np.abs(tangent) > ALL_BUT * friction.value * normal
            )[:, None]  # fmt: skip
    return found


def around(time: Floats) -> int:
    """How many samples before and after one a slide is looked for in."""
    return max(round(AROUND / float(np.median(np.diff(time)))), FEWEST_AROUND)
