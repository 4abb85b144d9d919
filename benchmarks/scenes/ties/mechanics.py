"""Rows of loops and couplings, by the mechanics of this package alone.

A loop says φ = p₁ − p₂ = 0 of two places, a coupling φ = q_f − c(q_l) = 0 of two joints. With
J = ∂φ/∂q a force λ along them acts as Jᵀλ.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from scenes.mechanics import Metric, Poses

Array = NDArray[Any]

RANK = 1e-9
"""Rows that add less than this to what others say, in kinetic size, say the same."""


class Tied:
    """Loops and couplings of a robot at T states.

    Parameters
    ----------
    model : heelstrike.robot.Model
        Numbers of the robot.
    poses : Poses
        Of the states.
    q : (T, n) float
        Their coordinates.
    v : (T, n) float, optional
        Velocities, for the bias.

    Attributes
    ----------
    displacement : (T, rows) float
        φ, in m and rad: x and z of each loop, then the couplings.
    jacobian : (T, rows, n) float
        J.
    bias : (T, rows) float
        J̇ v.
    """

    def __init__(self, model: Any, poses: Poses, q: Array, v: Array | None = None) -> None:
        v = np.zeros_like(q) if v is None else v
        count, n = q.shape
        rows = 2 * len(model.loop_link) + len(model.coupling_joint)
        self.displacement = np.zeros((count, rows))
        self.jacobian = np.zeros((count, rows, n))
        self.bias = np.zeros((count, rows))
        for loop, (links, places) in enumerate(
            zip(model.loop_link, model.loop_position, strict=True)
        ):
            both = slice(2 * loop, 2 * loop + 2)
            for sign, link, place in zip((1.0, -1.0), links, places, strict=True):
                if link < 0:
                    self.displacement[:, both] += sign * place
                    continue
                one = np.array([link])
                point = poses.points(one, place[None])
                self.displacement[:, both] += sign * point[:, 0]
                self.jacobian[:, both] += sign * poses.jacobian(one, point)[:, 0]
                self.bias[:, both] += sign * poses.bias_acceleration(v, one, point)[:, 0]
        for i, (follower, leader) in enumerate(model.coupling_joint):
            row, factors = 2 * len(model.loop_link) + i, model.coupling_polynomial[i]
            away = q - model.reference
            self.displacement[:, row] = away[:, follower]
            self.jacobian[:, row, follower] = 1.0
            led = away[:, leader] if leader >= 0 else np.zeros(count)
            self.displacement[:, row] -= polynomial.polyval(led, factors)
            if leader >= 0:
                slope, bend = (polynomial.polyder(factors, order) for order in (1, 2))
                self.jacobian[:, row, leader] = -polynomial.polyval(led, slope)
                self.bias[:, row] = -polynomial.polyval(led, bend) * v[:, leader] ** 2

    def torn(self, metric: Metric, v: Array, along: Array | None = None) -> Array:
        """Part (T, n) of velocities that has to go for J v to be `along` (T, rows), or zero."""
        return torn(self.jacobian, metric, v, along)

    def untorn(self, metric: Metric, v: Array) -> Array:
        """Velocities (T, n) nearest to given ones that tear at nothing."""
        return v - self.torn(metric, v)


def torn(jacobian: Array, metric: Metric, v: Array, along: Array | None = None) -> Array:
    """Smallest part (T, n) of velocities, in kinetic size, without which J v is `along` or zero."""
    if jacobian.shape[1] == 0:
        return np.zeros_like(v)
    # With M = L Lᵀ and u = Lᵀ v the rows are J L⁻ᵀ, and the smallest is that of least norm.
    rows = np.swapaxes(np.linalg.solve(metric.root, np.swapaxes(jacobian, 1, 2)), 1, 2)
    excess = np.einsum("trn,tn->tr", jacobian, v) - (0.0 if along is None else along)
    inverse = np.linalg.pinv(rows, rcond=RANK)
    part = np.einsum("tnr,tr->tn", inverse, excess)
    root = np.swapaxes(metric.root, 1, 2)
    out: Array = np.linalg.solve(root, part[..., None])[..., 0]
    return out
