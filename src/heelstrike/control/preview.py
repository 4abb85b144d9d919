"""Preview control of the zero moment point of a cart on a table.

A cart of constant height z runs on a massless table; its jerk decides where the zero moment point
p = x − (z/g) ẍ is. The servo of S. Kajita et al. (2003), *Biped walking pattern generation by using
preview control of zero-moment point*, IEEE International Conference on Robotics and Automation,
weighs the error of p against jerk and looks at the reference ahead of time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.errors import ControllerError
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats


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
        transition, jerk, zero_moment = _cart(self.period, self.height, self.gravity)
        gains = np.concatenate(([self.sum_gain], self.state_gain))
        return _with_sum(transition, zero_moment) - np.outer(
            np.concatenate(([zero_moment @ jerk], jerk)), gains
        )

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
        transition, jerk, zero_moment = _cart(self.period, self.height, self.gravity)
        # As seen from the beginning: the sums of the servo begin at rest there.
        away = wanted - wanted[0]
        ahead = np.concatenate((away, np.full(len(self.preview_gain), away[-1])))
        states = np.zeros((len(wanted), 3))
        summed = 0.0
        for k in range(len(wanted) - 1):
            summed += zero_moment @ states[k] - away[k]
            seen = self.preview_gain @ ahead[k + 1 : k + 1 + len(self.preview_gain)]
            command = -self.sum_gain * summed - self.state_gain @ states[k] - seen
            states[k + 1] = transition @ states[k] + jerk * command
        states[:, 0] += wanted[0]
        return states, states @ zero_moment


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
        Q_e (1/m²) and R (s⁶/m²).
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
    from scipy.linalg import solve_discrete_are

    given = {
        "height": height, "period": period, "error_weight": error_weight,
        "jerk_weight": jerk_weight, "gravity": gravity, "horizon": horizon,
    }  # fmt: skip
    for name, value in given.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ControllerError(f"{name} must be a positive number, got {value!r}")
    transition, jerk, zero_moment = _cart(period, height, gravity)
    system = _with_sum(transition, zero_moment)
    control = np.concatenate(([zero_moment @ jerk], jerk))[:, None]
    weight = np.diag([error_weight, 0.0, 0.0, 0.0])
    cost = solve_discrete_are(system, control, weight, np.array([[jerk_weight]]))
    inertia = float(jerk_weight + (control.T @ cost @ control)[0, 0])
    gains = (control.T @ cost @ system)[0] / inertia
    closed = system - control @ gains[None, :]
    preview = np.empty(horizon)
    preview[0] = -gains[0]
    weighed = -closed.T @ cost[:, 0]
    for sample in range(1, horizon):
        preview[sample] = (control[:, 0] @ weighed) / inertia
        weighed = closed.T @ weighed
    return PreviewControl(
        period=period, height=height, gravity=gravity, sum_gain=float(gains[0]),
        state_gain=gains[1:], preview_gain=preview,
    )  # fmt: skip


def _cart(period: float, height: float, gravity: float) -> tuple[Floats, Floats, Floats]:
    """Transition of (x, ẋ, ẍ) in a sample, what jerk adds, and the zero moment point's row."""
    transition = np.array([[1.0, period, 0.5 * period**2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
    jerk = np.array([period**3 / 6.0, 0.5 * period**2, period])
    return transition, jerk, np.array([1.0, 0.0, -height / gravity])


def _with_sum(transition: Floats, zero_moment: Floats) -> Floats:
    """Transition of (Σ e, x, ẋ, ẍ), the reference at zero."""
    system = np.zeros((4, 4))
    system[0, 0] = 1.0
    system[0, 1:] = zero_moment @ transition
    system[1:, 1:] = transition
    return system
