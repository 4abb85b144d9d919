"""Preview control of the zero moment point of a cart on a table.

A cart of constant height z runs on a massless table; its jerk decides where the zero moment point
p = x − (z/g) ẍ is. The servo of S. Kajita et al. (2003), *Biped walking pattern generation by using
preview control of zero-moment point*, IEEE International Conference on Robotics and Automation,
weighs the error of p against jerk and looks at the reference ahead of time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import positive
from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

REMAINDER = 1e-17
"""What may be left of the beginning: the slowest pole of the closed loop is near exp(−T √(g/z))."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PreviewControl:
    """Gains of u = −G_I Σ e − G_x x − Σⱼ G_d(j) p_ref(k + j)."""

    period: float
    """Time between two samples, in s."""
    height: float
    gravity: float
    """height, gravity: Height of the centre of mass above the ground (m), and gravity (m/s²)."""
    sum_gain: float
    """G_I, in 1/s³."""
    state_gain: Floats
    """(3,) G_x, of position, velocity and acceleration (1/s³, 1/s², 1/s)."""
    preview_gain: Floats
    """(horizon,) G_d(1), G_d(2), …, of the reference so many samples ahead, in 1/s³."""

    @property
    def closed_loop(self) -> Floats:
        """Matrix (4, 4) by which the summed error and the state go on from sample to sample."""
        system, control = _with_sum(*_cart(self.period, self.height, self.gravity))
        return system - control * np.concatenate(([self.sum_gain], self.state_gain))

    def follow(self, reference: ArrayLike) -> tuple[Floats, Floats]:
        """Let the cart follow a reference of the zero moment point from rest at its first value.

        Parameters
        ----------
        reference : (n,) array
            Zero moment point wanted at each sample (m); it stays at its last value.

        Returns
        -------
        (n, 3) float
            Position, velocity and acceleration of the cart (m, m/s, m/s²).
        (n,) float
            Its zero moment point (m).

        Raises
        ------
        ControllerError
            If the reference is no row of finite numbers.
        """
        wanted = np.asarray(reference, dtype=np.float64)
        if wanted.ndim != 1 or not len(wanted) or not np.all(np.isfinite(wanted)):
            raise ControllerError(
                "a reference of the zero moment point is a one-dimensional array of finite numbers"
            )
        # As seen from the beginning: the sums of the servo begin at rest there.
        away = wanted - wanted[0]
        states, _ = self._run(np.append(away, np.full(len(self.preview_gain) - 1, away[-1])))
        states[:, 0] += wanted[0]
        _, _, zero_moment = _cart(self.period, self.height, self.gravity)
        return states, states @ zero_moment

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
        horizon = len(self.preview_gain)
        rate = np.sqrt(self.gravity / self.height)
        steps = int(np.ceil(-np.log(REMAINDER) / (rate * self.period * count))) + 1
        several = np.arange(steps + horizon // count + 1)[:, None] * distance + wanted[:-1]
        states, jerks = self._run(several.ravel()[: steps * count + horizon])
        states[:, 0] -= (steps - 1) * distance
        return states[-count - 1 :], jerks[-count:]

    def _run(self, reference: Floats) -> tuple[Floats, Floats]:
        """States, and jerks between them, from rest at the first value until the preview ends."""
        transition, jerk, zero_moment = _cart(self.period, self.height, self.gravity)
        horizon = len(self.preview_gain)
        jerks = np.zeros(len(reference) - horizon)
        states = np.zeros((len(jerks) + 1, 3))
        states[0, 0] = reference[0]
        summed = 0.0
        for k, state in enumerate(states[:-1]):
            summed += zero_moment @ state - reference[k]
            seen = self.preview_gain @ reference[k + 1 : k + 1 + horizon]
            jerks[k] = -self.sum_gain * summed - self.state_gain @ state - seen
            states[k + 1] = transition @ state + jerk * jerks[k]
        return states, jerks


def preview_control(
    *,
    height: float,
    period: float = 0.005,
    horizon: int = 320,
    error_weight: float = 1.0,
    jerk_weight: float = 1e-6,
    gravity: float = 9.81,
) -> PreviewControl:
    """Return the servo that minimises Σ (error_weight e² + jerk_weight u²).

    Parameters
    ----------
    height : float
        Height of the centre of mass above the ground, in m.
    period : float
        Time between two samples, in s.
    horizon : int
        Samples of the reference that are looked at ahead of time.
    error_weight, jerk_weight : float
        Q_e (1/m²) and R (s⁶/m²); by default those of the paper.
    gravity : float
        In m/s².

    Returns
    -------
    PreviewControl
        Its gains.

    Raises
    ------
    ControllerError
        If a number is not positive.
    """
    from scipy.linalg import solve_discrete_are  # takes long to import

    given = {
        "height": height, "period": period, "error_weight": error_weight,
        "jerk_weight": jerk_weight, "gravity": gravity, "horizon": horizon,
    }  # fmt: skip
    for name, value in given.items():
        positive(name, value, ControllerError)
    system, control = _with_sum(*_cart(period, height, gravity))
    weight = np.diag([error_weight, 0.0, 0.0, 0.0])
    cost = solve_discrete_are(system, control, weight, np.array([[jerk_weight]]))
    scaled = control.T / (jerk_weight + control.T @ cost @ control)
    gains = (scaled @ cost @ system)[0]
    closed = system - np.outer(control, gains)
    weighed, preview = -closed.T @ cost[:, 0], [-gains[0]]
    for _ in range(horizon - 1):
        preview.append(scaled[0] @ weighed)
        weighed = closed.T @ weighed
    return PreviewControl(
        period=period, height=height, gravity=gravity, sum_gain=float(gains[0]),
        state_gain=gains[1:], preview_gain=np.array(preview),
    )  # fmt: skip


def _cart(period: float, height: float, gravity: float) -> tuple[Floats, Floats, Floats]:
    """Transition of (x, ẋ, ẍ) in a sample, what jerk adds, and the zero moment point's row."""
    t = period
    transition = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    jerk = np.array([t**3 / 6.0, 0.5 * t * t, t])
    return transition, jerk, np.array([1.0, 0.0, -height / gravity])


def _with_sum(transition: Floats, jerk: Floats, zero_moment: Floats) -> tuple[Floats, Floats]:
    """Transition of (Σ e, x, ẋ, ẍ), the reference at zero, and what jerk adds, (4, 1)."""
    system = np.zeros((4, 4))
    system[0, 0] = 1.0
    system[0, 1:] = zero_moment @ transition
    system[1:, 1:] = transition
    return system, np.append(zero_moment @ jerk, jerk)[:, None]
