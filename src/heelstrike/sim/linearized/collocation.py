"""Collocation: a polynomial whose rate is right at some nodes of a step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import Polynomial

from heelstrike.robot.model import Floats


def collocation(nodes: Floats) -> tuple[Floats, Floats, Floats]:
    """Return nodes in [0, 1], the matrix of the stages, (s, s), and weights of the end, (s,)."""
    stages = len(nodes)
    matrix, weights = np.zeros((stages, stages)), np.zeros(stages)
    for j in range(stages):
        others = np.delete(nodes, j)
        one = Polynomial.fromroots(others) / np.prod(nodes[j] - others)
        matrix[:, j] = one.integ()(nodes)
        weights[j] = one.integ()(1.0)
    return nodes, matrix, weights


def stage_equations(matrix: Floats, slopes: Sequence[Floats]) -> Floats:
    """Return the matrix of the linear equations of all stages' rates, (s n, s n).

    `matrix` (s, s) is that of the stages times the length of the step, `slopes` the derivative of
    the rate at each, (n, n).
    """
    stages, size = len(slopes), len(slopes[0])
    system = np.eye(stages * size)
    for i, j in np.ndindex(stages, stages):
        block = matrix[i, j] * slopes[i]
        system[i * size : (i + 1) * size, j * size : (j + 1) * size] -= block
    return system
