"""Preview control of the zero moment point of a cart on a table.

S. Kajita, F. Kanehiro, K. Kaneko, K. Fujiwara, K. Harada, K. Yokoi, H. Hirukawa, *Biped walking
pattern generation by using preview control of zero-moment point*, ICRA 2003.
"""

from __future__ import annotations

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

ERROR_WEIGHT, JERK_WEIGHT = 1.0, 1e-6
"""Weights of the error of the zero moment point (1/m²) and of the jerk (s⁶/m²): those of the
paper."""
REMAINDER = 1e-17
"""What may be left of the beginning: the slowest pole of the closed loop is near exp(−T √(g/h))."""


@dataclass(frozen=True, eq=False)
class PreviewControl:
    """Gains of preview control: u = −G_I Σe − G_x x − Σ G_d(l) p(k + l)."""

    period: float
    """Time between two samples (s)."""
    height: float
    """Height of the cart (m)."""
    gravity: float
    """Gravity (m/s²)."""
    integral: float
    """G_I, of the sum of the errors (1/s³)."""
    state: Floats
    """(3,) G_x, of position, velocity and acceleration."""
    ahead: Floats
    """(N,) G_d, of the zero moment point that is wanted 1 … N samples ahead (1/s³)."""

    @classmethod
    def of(
        cls, height: float, gravity: float, period: float, preview: int,
        *, error_weight: float = ERROR_WEIGHT, jerk_weight: float = JERK_WEIGHT,
    ) -> PreviewControl:  # fmt: skip
        """Find the gains: a linear-quadratic regulator with an integral of the error.

        Parameters
        ----------
        height, gravity, period : float
            Height of the cart (m), gravity (m/s²), time between two samples (s).
        preview : int
            Samples that are looked ahead.
        error_weight, jerk_weight : float
            Weights of the squared error of the zero moment point and of the squared jerk.

        Returns
        -------
        PreviewControl
            The gains.
        """
        from scipy.linalg import solve_discrete_are  # takes long to import

        transition, jerk = cart(period)
        output = np.array([1.0, 0.0, -height / gravity])
        whole = np.zeros((4, 4))
        whole[0, 0] = 1.0
        whole[0, 1:], whole[1:, 1:] = output @ transition, transition
        input_ = np.append(output @ jerk, jerk)[:, None]
        weight = np.diag([error_weight, 0.0, 0.0, 0.0])
        riccati = solve_discrete_are(whole, input_, weight, np.array([[jerk_weight]]))
        scaled = input_.T / (jerk_weight + input_.T @ riccati @ input_)
        gains = (scaled @ riccati @ whole)[0]
        closed = whole - np.outer(input_, gains)
        costate, ahead = -closed.T @ riccati[:, 0], [-gains[0]]
        for _ in range(preview - 1):
            ahead.append(float(scaled[0] @ costate))
            costate = closed.T @ costate
        return cls(period, height, gravity, float(gains[0]), gains[1:], np.array(ahead))

    def repeated(self, wanted: Floats) -> tuple[Floats, Floats]:
        """Follow a zero moment point that moves on by the same distance in every step.

        Parameters
        ----------
        wanted : (n + 1,) array
            The zero moment point (m) at the samples of a step; its last is the first of the next
            step.

        Returns
        -------
        states : (n + 1, 3) array
            Position (m), velocity and acceleration of the cart at the samples, in the step in
            which its motion repeats, the zero moment point being as wanted there.
        jerks : (n,) array
            Jerk between the samples (m/s³).
        """
        count, distance = len(wanted) - 1, wanted[-1] - wanted[0]
        transition, jerk = cart(self.period)
        output = np.array([1.0, 0.0, -self.height / self.gravity])
        looked = len(self.ahead) // count + 2
        rate = np.sqrt(self.gravity / self.height)
        steps = int(np.ceil(-np.log(REMAINDER) / (rate * self.period * count))) + 1
        several = np.concatenate([wanted[:-1] + distance * k for k in range(steps + looked)])
        state, total = np.array([wanted[0], 0.0, 0.0]), 0.0
        states, jerks = np.zeros((count + 1, 3)), np.zeros(count)
        for k in range(steps * count):
            total += output @ state - several[k]
            seen = several[k + 1 : k + 1 + len(self.ahead)]
            u = -self.integral * total - self.state @ state - self.ahead @ seen
            place = k - (steps - 1) * count
            if place >= 0:
                states[place], jerks[place] = state, u
            state = transition @ state + jerk * u
        states[count] = state
        states[:, 0] -= (steps - 1) * distance
        return states, jerks


def cart(period: float) -> tuple[Floats, Floats]:
    """Position, velocity and acceleration after a period of constant jerk: matrices of both."""
    t = period
    transition = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    return transition, np.array([t**3 / 6.0, 0.5 * t * t, t])
