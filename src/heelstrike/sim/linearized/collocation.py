"""Collocation: a polynomial whose rate is right at some nodes of a step."""

from __future__ import annotations

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
