"""Curves over time, fitted to samples by least squares: smooth, with exact derivatives."""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.robot.model import Floats

DEGREE = 5
"""Degree of the splines: accelerations are smooth."""
KNOTS = 0.05
"""Time between two knots (s): what changes faster than some 10 Hz is taken for noise."""
SAMPLES = 2.0
"""Samples between two knots, at least."""


class Splines:
    """A basis of splines on evenly spaced knots.

    Parameters
    ----------
    time : (n,) array
        When there are samples (s), rising from 0.
    apart : float
        Time between two knots (s), if there are samples enough.
    """

    def __init__(self, time: Floats, apart: float = KNOTS) -> None:
        from scipy.interpolate import BSpline  # takes long to import

        self.time = time
        duration = float(time[-1])
        apart = max(apart, SAMPLES * duration / (len(time) - 1))
        pieces = max(int(duration / apart), 1)
        inner = np.linspace(0.0, duration, pieces + 1)
        ends = np.full(DEGREE, 1.0)
        self._knots = np.concatenate([0.0 * ends, inner, duration * ends])
        self._spline = BSpline
        self.size = pieces + DEGREE
        self.matrix: Any = self._at(time)
        """(n, size) Values of the basis at the samples, sparse."""

    def _at(self, time: Floats) -> Any:
        inside = np.clip(time, 0.0, self.time[-1])
        return self._spline.design_matrix(inside, self._knots, DEGREE).tocsr()

    def basis(self, time: Floats, order: int) -> Floats:
        """Return a derivative of the basis at other times within, (m, size).

        Parameters
        ----------
        time : (m,) array
            When (s).
        order : int
            Order of the derivative; 0 is the basis itself.
        """
        each = self._spline(self._knots, np.eye(self.size), DEGREE)
        found: Floats = (each.derivative(order) if order else each)(time)
        return found

    def values(self, coefficients: Floats, order: int = 0) -> Floats:
        """Return curves, or a derivative, at the samples, (n, k).

        Parameters
        ----------
        coefficients : (size, k) array
            Of the basis.
        order : int
            Order of the derivative.
        """
        curve = self._spline(self._knots, coefficients, DEGREE)
        found: Floats = (curve.derivative(order) if order else curve)(self.time)
        return found

    def fitted(self, samples: Floats) -> Floats:
        """Return coefficients of the curves nearest to samples (n, k), (size, k)."""
        from scipy.sparse.linalg import spsolve

        normal = (self.matrix.T @ self.matrix).tocsc()
        found = spsolve(normal, self.matrix.T @ samples)
        return np.asarray(found, dtype=np.float64).reshape(self.size, -1)
