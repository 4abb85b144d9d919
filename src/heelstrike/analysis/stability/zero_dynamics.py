"""Hybrid zero dynamics of a gait over its phase, in closed form but for a quadrature.

Where virtual constraints hold, a robot on a point has one degree of freedom left: θ, and the
angular momentum σ about the stance foot, with θ̇ = κ₁(θ) σ and σ̇ = κ₂(θ), the moment of gravity.
Then d(σ²/2)/dθ = κ₂/κ₁ whatever the speed, an impact multiplies σ by δ, and the return map of
ζ = σ²/2 just before touchdown is the line ζ → δ² ζ + ∫ κ₂/κ₁ dθ (Westervelt, Grizzle and
Koditschek 2003, *Hybrid zero dynamics of planar biped walkers*, IEEE Transactions on Automatic
Control 48(1), section V).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from heelstrike.arguments import takes
from heelstrike.contact.ground import Ground
from heelstrike.errors import GaitError, LimitCycleError
from heelstrike.field_texts import dataclass
from heelstrike.gait.phased.phased_gait import PhasedGait
from heelstrike.gait.phased.surface import Surface, Touchdown
from heelstrike.gait.polynomials import gauss
from heelstrike.robot.state import State

# Phases at which the least momentum is looked for, and of the quadrature of the period.
GRID = 2001
POINTS = 64


@dataclass(frozen=True, eq=False, kw_only=True)
class ZeroDynamics:
    """The motion that a gait over its phase leaves free when the joints obey it."""

    gait: PhasedGait
    """The gait."""
    ground: Ground
    """Level or sloping ground."""
    touchdown: Touchdown
    """Where its steps end, and what the impact does."""
    contraction: float
    """δ²_zero, the nontrivial Floquet multiplier of a walk that obeys the gait: below 1, speed
    comes back."""
    gain: float
    """What gravity adds to ζ = σ²/2 over a step, in (kg m²/s)²."""
    barrier: float
    """ζ⁺ that a step needs to come over its highest point, in (kg m²/s)²."""
    position_defect: float
    velocity_defect: float
    """position_defect, velocity_defect: Invariance under the impact: largest difference between the
    joints after touchdown and the gait there (rad), and between their rates, as a part of that of
    the phase."""

    @property
    def invariant(self) -> bool:
        """Whether an impact leads from the constraints to the constraints, to 1e-8."""
        return self.position_defect <= 1e-8 and self.velocity_defect <= 1e-8

    @property
    def fixed_point(self) -> float:
        """ζ = σ²/2 just before touchdown of the walk that repeats, in (kg m²/s)².

        Raises
        ------
        LimitCycleError
            If there is none: gravity takes more than the impact leaves, or the robot falls back.
        """
        needed = self.gain > 0.0 if self.contraction < 1.0 else self.gain < 0.0
        if not needed:
            raise LimitCycleError(
                f"no walk over this phase repeats: an impact multiplies σ² by "
                f"{self.contraction:.6g} and gravity adds {2.0 * self.gain:.6g} (kg m²/s)² a step"
            )
        found = self.gain / (1.0 - self.contraction)
        if self.contraction * found <= self.barrier:
            raise LimitCycleError(
                "the walk over this phase that would repeat does not come over its highest point: "
                f"σ² after the impact is {2.0 * self.contraction * found:.6g}, "
                f"{2.0 * self.barrier:.6g} (kg m²/s)² are needed"
            )
        return found

    @property
    def stable(self) -> bool:
        """Whether speeds come back to that of the walk that repeats."""
        return self.contraction < 1.0

    @cached_property
    def _surface(self) -> Surface:
        return Surface(self.gait, self.ground)

    @property
    def rate(self) -> float:
        """Rate θ̇ just after touchdown of the walk that repeats, in rad/s."""
        momentum = np.sqrt(2.0 * self.fixed_point)
        return float(self.touchdown.rate * momentum / self._surface.inertia(self.touchdown.before))

    @property
    def initial_state(self) -> State:
        """State just after touchdown of the walk that repeats, the stance foot at the origin."""
        v = self.touchdown.velocity * (self.rate / self.touchdown.rate)
        return State(self.touchdown.position.copy(), v)

    @property
    def step_length(self) -> float:
        """Distance between the feet at touchdown, in m."""
        ends = self._surface.feet(self.touchdown.position)
        return float(np.hypot(*(ends[0] - ends[1])))

    @property
    def period(self) -> float:
        """Duration of a step of the walk that repeats, in s."""
        inertia, added = self._surface.motion(self.touchdown)
        nodes, weights = gauss(POINTS)
        width = self.touchdown.before - self.touchdown.after
        theta = self.touchdown.after + width * nodes
        momentum = np.sqrt(2.0 * (self.contraction * self.fixed_point + added(theta)))
        return float(width * weights @ (inertia(theta) / momentum))

    @property
    def landing_friction(self) -> float:
        """Friction that the landing foot needs not to slip."""
        normal, tangential = self.touchdown.impulse
        return float(abs(tangential) / normal)

    def __repr__(self) -> str:
        kind = "invariant" if self.invariant else "not invariant"
        return f"ZeroDynamics({self.gait.robot.name!r}: contraction {self.contraction:.9g}, {kind})"


@takes(GaitError)
def zero_dynamics(gait: PhasedGait, ground: Ground | None = None) -> ZeroDynamics:
    """Find the hybrid zero dynamics of a gait over its phase.

    Parameters
    ----------
    gait : PhasedGait
        The gait.
    ground : Ground, optional
        Level or sloping ground; ``Ground()`` by default. The impact is taken to stick.

    Returns
    -------
    ZeroDynamics

    Raises
    ------
    GaitError
        If the swing foot does not come down near the end of the gait, or its impact turns the
        phase back.
    """
    ground = Ground() if ground is None else ground
    surface = Surface(gait, ground)
    end = surface.touchdown()
    _, added = surface.motion(end)
    driven = gait.robot.model.actuator_joint
    place = gait.joints(end.after) - end.position[driven]
    speed = gait.joints(end.after, order=1) - end.velocity[driven] / end.rate
    return ZeroDynamics(
        gait=gait,
        ground=ground,
        touchdown=end,
        contraction=end.momentum**2,
        gain=float(added(end.before)),
        barrier=float(max(0.0, -added(np.linspace(end.after, end.before, GRID)).min())),
        position_defect=float(np.abs(place).max()),
        velocity_defect=float(np.abs(speed).max()),
    )
