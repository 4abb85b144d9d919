"""What becomes of disturbances across a walk, from step to step, and the best that motors can do.

Disturbances are looked at where the phase is that of the walk: z = Π δx, with Π = I − f cᵀ/(cᵀf),
f = ẋ along the walk and cᵀ the derivative of the phase. c is constant, so that z = E w with columns
E that span what cᵀ takes to zero, and

    dw/dt = Eᵀ Π (A E w + B δτ),

the transverse linearisation (I. R. Manchester 2011, *Transverse dynamics and regions of stability
for nonlinear hybrid limit cycles*, IFAC World Congress). At a touchdown the disturbed walk goes on
to where its swing foot is on the ground, suffers the impact, and is looked at again where the phase
is that of the beginning:

    w⁺ = Eᵀ Π₀ DΔ (I − f ∇h/(∇h f)) E w⁻.

The regulator minimises ∫ zᵀQz + δτᵀR δτ dt over all steps to come: a Riccati equation whose
solution the jump takes from the beginning of a step to the end of the one before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact import ActiveContacts, linearize_contact
from heelstrike.contact.linearized.slopes import both, contact_slopes, exchanged, following
from heelstrike.contact.linearized.strikes import strikes
from heelstrike.control.gait_lqr.orbit import Orbit, contacts_of
from heelstrike.control.gait_lqr.riccati import over_all_steps
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

STEPS, FINE = 256, 2048
"""Steps of the classical Runge-Kutta method a period: for gains, and for what comes of them."""


@dataclass(frozen=True, eq=False)
class Transverse:
    """The linear equations across a walk, at the ends and the middles of even steps."""

    theta: Floats
    """(2 steps + 1,) Phases, evenly spaced (rad)."""
    basis: Floats
    """(2 p, 2 p - 1) float. E."""
    A: Floats
    B: Floats
    """A, B: (2 steps + 1, ...) dw/dθ = A w + B δτ."""
    pace: Floats
    """(2 steps + 1,) dt/dθ."""
    jump: Floats
    """(2 p - 1, 2 p - 1) float. w⁺ = jump w⁻."""

    @classmethod
    def of(cls, orbit: Orbit, steps: int = STEPS) -> Transverse:
        """Find them at so many steps."""
        from scipy.linalg import null_space

        first, last = orbit.q.first, orbit.q.last
        theta = np.linspace(first, last, 2 * steps + 1)
        size = orbit.gait.robot.nv - 2
        phase = np.concatenate([orbit.gait.phase[2:], np.zeros(size)])
        basis = null_space(phase[None, :])
        rate, flow = orbit.rate(theta), orbit.flow(theta)
        across = np.eye(2 * size) - flow[:, :, None] * phase / rate[:, None, None]
        pace = 1.0 / rate
        slopes = basis.T @ across @ orbit.A(theta) @ basis * pace[:, None, None]
        pushes = basis.T @ across @ orbit.B(theta) * pace[:, None, None]
        jump = basis.T @ across[0] @ _touchdown(orbit) @ basis
        return cls(theta, basis, slopes, pushes, pace, jump)

    def regulator(self, cost: Floats, effort: Floats) -> CubicSpline:
        """Gains (nu, 2 p) of the least cost over the phase."""
        from scipy.interpolate import CubicSpline

        cheap = np.linalg.inv(effort)
        costs = self.pace[:, None, None] * (self.basis.T @ cost @ self.basis)
        pushes = self.B @ cheap @ np.moveaxis(self.B, 1, 2) / self.pace[:, None, None]
        width = 2.0 * (self.theta[1] - self.theta[0])

        def slope(k: int, value: Floats) -> Floats:
            drift = self.A[k].T @ value
            return drift + drift.T - value @ pushes[k] @ value + costs[k]

        def sweep(last: Floats) -> tuple[Floats, Floats]:
            values = [last]
            for k in range(len(self.theta) - 3, -1, -2):
                end = values[-1]
                one = slope(k + 2, end)
                two = slope(k + 1, end + 0.5 * width * one)
                three = slope(k + 1, end + 0.5 * width * two)
                four = slope(k, end + width * three)
                values.append(end + width / 6.0 * (one + 2.0 * (two + three) + four))
            return values[-1], np.array(values[::-1])

        gains = cheap @ np.moveaxis(self.B[::2], 1, 2) @ over_all_steps(self.jump, sweep)
        return CubicSpline(self.theta[::2], gains / self.pace[::2, None, None] @ self.basis.T)

    def over_a_step(self, gains: Floats) -> Floats:
        """What a step makes of w with gains (…, nu, 2 p − 1), impact included."""
        closed = self.A - self.B @ gains
        width = 2.0 * (self.theta[1] - self.theta[0])
        moved = np.eye(len(self.jump))
        for step in range(len(self.theta) // 2):
            k = 2 * step
            one = closed[k] @ moved
            two = closed[k + 1] @ (moved + 0.5 * width * one)
            three = closed[k + 1] @ (moved + 0.5 * width * two)
            four = closed[k + 2] @ (moved + width * three)
            moved = moved + width / 6.0 * (one + 2.0 * (two + three) + four)
        return np.asarray(self.jump @ moved)


def multipliers_of(step: Floats) -> NDArray[np.complex128]:
    """Eigenvalues of what a step makes of disturbances, the largest first."""
    found = np.linalg.eigvals(step).astype(np.complex128)
    return found[np.argsort(-np.abs(found))]


def _touchdown(orbit: Orbit) -> Floats:
    """Errors (δp, δṗ) just after the touchdown, legs exchanged, by those just before.

    A plastic impact of the swing foot, on the section that it is: errors at touchdown, whenever
    that is. They are looked at where the phase is that of the beginning, and it does not matter
    how late.
    """
    gait, last = orbit.gait, orbit.q.last
    robot, (stance, swing) = gait.robot, contacts_of(gait)
    q, v, torque = orbit.q(last), orbit.v(last), orbit.torque(last)
    rate = linearize_contact(robot, q, v, torque, ActiveContacts(resting=(stance,))).rate
    gap, struck = contact_slopes(robot, q, v).gap[swing], ActiveContacts(resting=(swing,))
    (strike,) = strikes(robot, q, v, rate, torque, [(gap, struck)])
    joints = range(2, robot.nv)
    errors = strike.section @ following(robot, q, v, [stance], joints)
    return exchanged(robot, errors)[both(robot, joints)]
