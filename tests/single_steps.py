"""Single steps of Dormand and Prince's method, of equations whose solution is known."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from heelstrike.compiler.compilation import uncompiled
from heelstrike.sim.event_driven import dormand_prince as dp

stage_point = uncompiled(dp.stage_point)
fit_dense = uncompiled(dp.fit_dense)


def one_step(
    slope: Callable[[float, np.ndarray], np.ndarray], begin: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slopes, end and dense output of a step from time 0."""
    slopes = np.zeros((dp.SLOPES, len(begin)))
    point, end = np.zeros(len(begin)), np.zeros(len(begin))
    for stage in range(dp.SLOPES):
        stage_point(stage, h, begin, slopes, point)
        if stage == dp.STAGES:
            end[:] = point
        slopes[stage] = slope(dp.NODES[stage] * h, point)
    dense = np.zeros((dp.DENSE_ROWS, len(begin)))
    fit_dense(h, begin, end, slopes, dense)
    return slopes, end, dense


def swinging(t: float, y: np.ndarray) -> np.ndarray:
    """Return y' of y = (exp sin t, 1/(1 + t), sin 2t, cos 2t)."""
    return np.array([y[0] * math.cos(t), -(y[1] ** 2), 2.0 * y[3], -2.0 * y[2]])


def exact(t: float) -> np.ndarray:
    return np.array([math.exp(math.sin(t)), 1.0 / (1.0 + t), math.sin(2.0 * t), math.cos(2.0 * t)])
