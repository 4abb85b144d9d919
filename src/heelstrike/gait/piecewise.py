"""A periodic gait whose joints follow several polynomials a step, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.errors import GaitError
from heelstrike.gait.gait import Gait

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class PiecewiseGait(Gait):
    """A gait of piecewise polynomials, as direct collocation finds them for point feet.

    It has everything that :class:`Gait` has, with ``coefficients`` replaced by the following. On
    point feet the trunk's pitch has no motor; it moves as the dynamics demands when the joints
    follow their polynomials exactly.

    Attributes
    ----------
    breakpoints : (K + 1,) float
        Times between which one polynomial holds, from 0 to the step's duration, in s.
    pieces : (K, d + 1, nu) float
        Coefficients, lowest first, of the joints' polynomials in the time since the beginning of
        each piece, in the order of the actuators.
    pitch_pieces : (K, d + 1) float
        The same for the trunk's pitch.
    """

    breakpoints: Floats
    pieces: Floats
    pitch_pieces: Floats

    def __post_init__(self) -> None:
        super().__post_init__()
        nu = len(self.joint_names)
        for name in ("breakpoints", "pieces", "pitch_pieces"):
            value = np.array(getattr(self, name), dtype=np.float64)
            if not np.all(np.isfinite(value)):
                raise GaitError(f"gait: {name} must be finite")
            object.__setattr__(self, name, value)
        count = self.breakpoints.size - 1
        shape = self.pieces.shape
        if count < 1 or len(shape) != 3 or shape[0] != count or shape[2] != nu or shape[1] < 4:
            raise GaitError(
                f"gait: {count + 1} breakpoints and {nu} joints need pieces of shape "
                f"({count}, degree + 1, {nu}), got {shape}"
            )
        if self.pitch_pieces.shape != shape[:2]:
            raise GaitError(
                f"gait: pitch_pieces must have shape {shape[:2]}, got {self.pitch_pieces.shape}"
            )
        close = 1e-9 * self.step_duration
        ends = self.breakpoints[[0, -1]] - [0.0, self.step_duration]
        if np.any(np.diff(self.breakpoints) <= 0.0) or np.abs(ends).max() > close:
            raise GaitError("gait: breakpoints must rise from 0 to step_duration")

    @property
    def coefficients(self) -> Floats:
        """Raise a `GaitError`: there is more than one polynomial a joint, see `pieces`."""
        raise GaitError(
            "a gait of piecewise polynomials has no single set of coefficients; use its pieces, or "
            "position(), velocity() and acceleration()."
        )

    def mirrored_pieces(self) -> Floats:
        """Coefficients of the steps on the other foot, (K, d + 1, nu)."""
        mirrored: Floats = self.mirror_sign * self.pieces[:, :, self.mirror_joint]
        mirrored[:, 0] += self.mirror_offset
        return mirrored

    def in_step(self, t: ArrayLike, *, order: int = 0) -> Floats:
        """Joint motion at times of the first step, (..., nu), going on along the end pieces."""
        return self._evaluated(self.pieces, t, order)

    def pitch(self, t: ArrayLike, *, order: int = 0) -> Floats:
        """Pitch of the trunk (rad), or a derivative, at times of the first step, (...)."""
        return self._evaluated(self.pitch_pieces[..., None], t, order)[..., 0]

    def _evaluated(self, pieces: Floats, t: ArrayLike, order: int) -> Floats:
        time = np.asarray(t, dtype=np.float64)
        piece = np.searchsorted(self.breakpoints, time, side="right") - 1
        piece = np.clip(piece, 0, len(pieces) - 1)
        local = (time - self.breakpoints[piece])[..., None]
        value: Any = 0.0
        for power in range(pieces.shape[1] - 1, order - 1, -1):
            factor = float(np.prod(np.arange(power - order + 1, power + 1)))
            value = value * local + factor * pieces[piece, power]
        result: Floats = np.asarray(value)
        return result
