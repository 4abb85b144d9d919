"""Coordinates of the states in which a robot stands as it does in one of them.

Feet on the ground obey equations: points that touch it have no gap, those that stand have no
velocity, and where along the ground they are does not matter; closed loops hold, and joints are
where latches have them. A :class:`Chart` numbers what these leave free.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.contact.linearized.slopes import along_the_ground, contact_slopes
from heelstrike.contact.queries.kinematics import contact_kinematics
from heelstrike.contact.workspace import Floats
from heelstrike.dynamics import loop_displacement, loop_jacobian
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Integers
from heelstrike.robot.robot import Robot

RANK_TOLERANCE = 1e-7
"""Two directions are one when the sine of the angle between them is below this."""

FIRST = 1e-6
"""Of two coordinates that are as free the first leads, by this much."""

NEAREST, MOST = 1e-15, 20
"""Corrections (m, rad, m/s, rad/s) back to the equations, until they are this small."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Equations of a robot that stands."""

    robot: Robot
    ground: Ground
    """Level or sloping."""
    touching: NDArray[np.bool_]
    """(nc,) Which points are on the ground."""
    at_rest: NDArray[np.bool_]
    """(nc, 2) Along which directions (normal, tangent) they are at rest."""
    foothold: int
    """The point that keeps its place."""
    held: Integers
    """(k,) Joints that latches hold."""

    def equations(self, x: Floats) -> Floats:
        """What errors of a state (q, v) do not change, (k,)."""
        q, v = x[: self.robot.nq], x[self.robot.nq :]
        seen = contact_kinematics(self.robot, q, v, self.ground)
        place = seen.position @ along_the_ground(self.ground)
        loops = loop_displacement(self.robot, q), loop_jacobian(self.robot, q) @ v
        foothold = place[self.foothold : self.foothold + 1]
        held = q[self.held], v[self.held]
        return np.concatenate(
            (foothold, seen.gap[self.touching], seen.velocity[self.at_rest], *loops, *held)
        )

    def gradient(self, x: Floats) -> Floats:
        """Their derivative by the state, (k, nq + nv)."""
        nq, size = self.robot.nq, len(x)
        slopes = contact_slopes(self.robot, x[:nq], x[nq:], self.ground)
        foothold = slopes.place[self.foothold : self.foothold + 1]
        held = np.eye(size)[np.concatenate((self.held, self.held + nq))]
        return np.vstack(
            (
                foothold, slopes.gap[self.touching], slopes.velocity[self.at_rest], slopes.loop,
                slopes.loop_velocity, held,
            )
        )  # fmt: skip


class Chart:
    """Coordinates of the states near one of them in which the robot stands as it does there.

    Parameters
    ----------
    standing : Standing
    origin : (nq + nv,) float
        The state (q, v) that has the coordinates zero.
    scale : (nq + nv,) float, optional
        How much errors of the state's numbers count; one by default.

    Attributes
    ----------
    directions : (nq + nv, m) float
        Errors of the state by the coordinates, orthonormal as they count, and near to errors of
        single numbers of the state: differences of a walk whose map has a kink depend on them.
    """

    def __init__(self, standing: Standing, origin: Floats, scale: Floats | None = None) -> None:
        from scipy.linalg import qr  # not needed to simulate

        self._standing, self._origin = standing, origin
        scale = np.ones(len(origin)) if scale is None else scale
        gradient = standing.gradient(origin) / scale
        _, singular, rows = np.linalg.svd(gradient)
        rank = int(np.sum(singular > RANK_TOLERANCE * singular[0]))
        # Of dependent rows rounding decides what the last of these are; not what they span.
        across = rows[rank:].T @ rows[rank:] * (1.0 - FIRST * np.arange(len(origin)))
        basis, leading, _ = qr(across, pivoting=True)
        forward = basis * np.sign(np.diag(leading))
        self.directions = forward[:, : len(origin) - rank] / scale[:, None]
        self._back = np.linalg.pinv(gradient, rcond=RANK_TOLERANCE) / scale[:, None]

    def moved(self, coordinates: Floats, origin: Floats | None = None) -> Floats:
        """Return the state with some coordinates, as seen from the origin or from near it."""
        begin = self._origin if origin is None else origin
        level = self._standing.equations(begin)
        x: Floats = begin + self.directions @ coordinates
        for _ in range(MOST):
            change = self._back @ (self._standing.equations(x) - level)
            x = x - change
            if np.abs(change).max(initial=0.0) <= NEAREST:
                break
        return x

    def off(self, x: Floats) -> float:
        """How far (m, m/s) a state is from those that stand as the origin does."""
        apart = self._standing.equations(x) - self._standing.equations(self._origin)
        return float(np.abs(apart).max(initial=0.0))

    def coordinates(self, x: Floats) -> Floats:
        """Coordinates of a state that stands as the origin does, of a chart without scale."""
        found: Floats = (x - self._origin) @ self.directions
        return found
