"""The Dormand-Prince method of order 8 with its dense output of order 7.

Twelve stages a step, error estimates of orders 5 and 3, and three further stages for the dense
output: Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I* (1993), section
II.10 and their program DOP853.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel

Floats = NDArray[np.float64]

STAGES = 12
"""Stages of a step; the slope at its end is number 12, those of the dense output follow."""

SLOPES = 16
DENSE_ROWS = 7

# SciPy has the same numbers, but its integrators take a third of a second to import.
_TABLE = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))

NODES: Floats = np.array(_TABLE["nodes"])

WEIGHTS: Floats = np.array(_TABLE["weights"])
"""Row 12 holds the weights of the result."""

ERROR: Floats = np.array(_TABLE["error"])

DENSE: Floats = np.array(_TABLE["dense"])


@kernel
def stage_point(stage: int, step: float, begin: Floats, slopes: Floats, point: Floats) -> None:
    """Write the point at which the slope of a stage is to be evaluated."""
    size = begin.shape[0]
    for i in range(size):
        point[i] = 0.0
    for j in range(stage):
        weight = WEIGHTS[stage, j]
        if weight != 0.0:
            for i in range(size):
                point[i] += weight * slopes[j, i]
    for i in range(size):
        point[i] = begin[i] + step * point[i]


@kernel
def error_norm(
    step: float, begin: Floats, end: Floats, slopes: Floats, relative: float, absolute: float
) -> float:
    """Estimated error of a step over its tolerance: the step is good up to 1."""
    size = begin.shape[0]
    fifth = 0.0
    third = 0.0
    for i in range(size):
        five = 0.0
        three = 0.0
        for j in range(STAGES + 1):
            five += ERROR[0, j] * slopes[j, i]
            three += ERROR[1, j] * slopes[j, i]
        scale = absolute + relative * max(abs(begin[i]), abs(end[i]))
        fifth += (five / scale) ** 2
        third += (three / scale) ** 2
    if fifth == 0.0 and third == 0.0:
        return 0.0
    return abs(step) * fifth / np.sqrt((fifth + 0.01 * third) * size)


@kernel
def fit_dense(step: float, begin: Floats, end: Floats, slopes: Floats, dense: Floats) -> None:
    """Turn the slopes of a finished step into the coefficients of its dense output."""
    for i in range(begin.shape[0]):
        rise = end[i] - begin[i]
        dense[0, i] = rise
        dense[1, i] = step * slopes[0, i] - rise
        dense[2, i] = 2.0 * rise - step * (slopes[STAGES, i] + slopes[0, i])
        for k in range(DENSE_ROWS - 3):
            total = 0.0
            for j in range(SLOPES):
                total += DENSE[k, j] * slopes[j, i]
            dense[3 + k, i] = step * total


@kernel
def interpolate(part: float, begin: Floats, dense: Floats, point: Floats) -> None:
    """State at the fraction `part` of a step."""
    for i in range(begin.shape[0]):
        value = 0.0
        for k in range(DENSE_ROWS - 1, -1, -1):
            value += dense[k, i]
            value *= part if k % 2 == 0 else 1.0 - part
        point[i] = begin[i] + value
