"""Contact laws of compliant ground: force from penetration and speed, point by point.

A contact law is what the penalty methods of the paper's [13] put in the place of the contact
problem. It says how hard the ground pushes for a given penetration and speed, so that there is
nothing to solve; in exchange every foot sinks in. Both halves are passive: the normal laws and the
friction laws take energy out of the robot or store it, and never give back more than they stored.

Signs: `gap` is negative in the ground, ``penetration = −gap``; `speed` is the rate of the
gap, positive when leaving; forces act on the robot.
"""

from __future__ import annotations

from collections.abc import Callable
from math import acos, acosh, exp, log1p, sqrt

import numpy as np
from numpy.typing import NDArray

from heelstrike.arguments import check_fields
from heelstrike.compiler.compilation import kernel
from heelstrike.errors import SimulationError
from heelstrike.field_texts import dataclass
from heelstrike.sim.compliant.law import FrictionLaw, NormalLaw

Floats = NDArray[np.float64]
Derived = tuple[float, float, float, float]
Friction = tuple[Derived, Derived, bool]

# Standard gravity (m/s²): turns the weight on a contact point into the mass that hits the ground.
GRAVITY = 9.80665


class Elastic(NormalLaw):
    """A law that presses with k δⁿ at rest."""

    stiffness: float

    def sink(self, weight: float) -> float:
        """Penetration in metres of a contact point at rest under a load in newtons.

        Parameters
        ----------
        weight : float
            The load (N).

        Returns
        -------
        float
            Metres.
        """
        return float((weight / self.stiffness) ** (1.0 / self._power()))

    def stored_energy(self, gap: Floats) -> Floats:
        """Elastic energy in joules at the given gaps (m).

        Parameters
        ----------
        gap : float array
            Gaps (m), negative in the ground.

        Returns
        -------
        (nc,) float
            Joules.
        """
        depth, power = np.maximum(-np.asarray(gap, dtype=np.float64), 0.0), self._power() + 1.0
        energy: Floats = self.stiffness * depth**power / power
        return energy

    def _power(self) -> float:
        """Exponent n."""
        return 1.0


@dataclass(frozen=True, kw_only=True)
class HuntCrossley(Elastic):
    """Nonlinear spring whose damping grows with the penetration (the paper's [13]).

    ``F = k δⁿ (1 + 3/2 α δ̇)``, never pulling, with penetration δ. The force begins and ends at
    zero, without the jump that a linear damper makes at the first touch.

    Raises
    ------
    SimulationError
        If a parameter is out of its range.

    Notes
    -----
    By default a 75 kg robot at rest on the two corners of one foot sinks in by 0.1 mm.

    Examples
    --------
    >>> law = HuntCrossley(stiffness=4e8, dissipation=0.5)
    >>> round(law.restitution(0.1), 3)
    0.952
    """

    stiffness: float = 4e8
    """k in N/mⁿ, for each contact point."""
    dissipation: float = 50.0
    """α in s/m. A mass that hits the ground at speed v leaves it at e v with e ≈ 1 − α v for small
    α v; :meth:`restitution` gives e in full."""
    exponent: float = 1.5
    """n ≥ 1; 3/2 is Hertz's theory of the sphere on a plane."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        _positive("Hunt-Crossley stiffness", self.stiffness, "N/mⁿ")
        _not_negative("Hunt-Crossley dissipation", self.dissipation, "s/m")
        if not 1.0 <= self.exponent < np.inf:
            raise SimulationError(f"the Hunt-Crossley exponent must be ≥ 1, got {self.exponent}")

    @classmethod
    def from_sink(
        cls,
        *,
        weight: float,
        sink: float,
        restitution: float,
        speed: float,
        exponent: float = 1.5,
    ) -> HuntCrossley:
        """Choose the law by what one can see of it.

        Parameters
        ----------
        weight : float
            Load of one contact point at rest, in newtons.
        sink : float
            Penetration under that load, in metres.
        restitution, speed : float
            Ratio of the speeds after and before an impact at `speed` (m/s), in (0, 1].
        exponent : float
            n of the law.

        Returns
        -------
        HuntCrossley
            The law.
        """
        _positive("weight", weight, "N")
        _positive("sink", sink, "m")
        _positive("speed", speed, "m/s")
        _restitution(restitution)
        scaled = 0.0
        if restitution < 1.0:
            # With c = 3/2 α: c v − ln(1 + c v) is the same before and after; see `restitution`.
            def defect(approach: float) -> float:
                leave = restitution * approach
                return approach - log1p(approach) + leave + log1p(-leave)

            highest = (1.0 - 1e-15) / restitution
            scaled = _root(defect, 1e-6 * highest, highest)
        return cls(
            stiffness=weight / sink**exponent,
            dissipation=scaled / (1.5 * speed),
            exponent=exponent,
        )

    def restitution(self, speed: float) -> float:
        """Ratio of the speeds after and before an impact of a free mass, whatever the mass.

        ``m v dv/dδ = −k δⁿ (1 + c v)``, c = 3/2 α, integrates to ``c v − ln(1 + c v)`` being the
        same when the mass leaves as when it came.

        Parameters
        ----------
        speed : float
            Speed before (m/s).

        Returns
        -------
        float
            From 0 to 1.
        """
        _positive("speed", speed, "m/s")
        approach = 1.5 * self.dissipation * speed
        if approach < 1e-7:
            return 1.0 - self.dissipation * speed
        level = approach - log1p(approach)
        leave = _root(lambda x: -x - log1p(-x) - level, 0.0, -np.expm1(-level - 1.0))
        return leave / approach

    def _power(self) -> float:
        return self.exponent

    @kernel
    def force(self, gap: float, speed: float) -> tuple[float, float, float]:
        """Force of a point in the ground, and its derivatives.

        Parameters
        ----------
        gap, speed : float
            Gap (m), negative, and its rate (m/s).

        Returns
        -------
        tuple of float
            Force (N), and its derivatives by gap and speed.
        """
        factor = 1.0 - 1.5 * self.dissipation * speed
        if factor <= 0.0:
            return 0.0, 0.0, 0.0
        spring = self.stiffness * (-gap) ** self.exponent
        by_gap = self.exponent * spring * factor / gap
        return spring * factor, by_gap, -1.5 * self.dissipation * spring


@dataclass(frozen=True, kw_only=True)
class KelvinVoigt(Elastic):
    """Linear spring and damper side by side: ``F = max(0, k δ + c δ̇)`` with penetration δ.

    Raises
    ------
    SimulationError
        If a parameter is out of its range.

    Notes
    -----
    By default a 75 kg robot at rest on the two corners of one foot sinks in by 0.07 mm.
    """

    stiffness: float = 5e6
    """k in N/m, for each contact point."""
    damping: float = 3e4
    """c in N s/m, for each contact point."""

    def __post_init__(self) -> None:
        check_fields(self, SimulationError)
        _positive("Kelvin-Voigt stiffness", self.stiffness, "N/m")
        _not_negative("Kelvin-Voigt damping", self.damping, "N s/m")

    @classmethod
    def from_sink(cls, *, weight: float, sink: float, restitution: float) -> KelvinVoigt:
        """Choose the law by what one can see of it.

        Parameters
        ----------
        weight : float
            Load of one contact point at rest, in newtons; the mass that it stands for is the mass
            that hits the ground.
        sink : float
            Penetration under that load, in metres.
        restitution : float
            Ratio of the speeds after and before an impact, in (0, 1], whatever the speed.

        Returns
        -------
        KelvinVoigt
            The law.
        """
        _positive("weight", weight, "N")
        _positive("sink", sink, "m")
        _restitution(restitution)
        stiffness = weight / sink
        ratio = 0.0
        if restitution < 1.0:
            ratio = _root(lambda z: _linear_restitution(z) - restitution, 0.0, 1e9)
        return cls(stiffness=stiffness, damping=2.0 * ratio * sqrt(stiffness * weight / GRAVITY))

    def damping_ratio(self, mass: float) -> float:
        """Damping of a mass (kg) on one contact point, relative to critical damping.

        Parameters
        ----------
        mass : float
            The mass (kg).

        Returns
        -------
        float
            1 is critical.
        """
        _positive("mass", mass, "kg")
        return self.damping / (2.0 * sqrt(self.stiffness * mass))

    def restitution(self, mass: float) -> float:
        """Ratio of the speeds after and before an impact of a free mass (kg).

        With damping ratio ζ: ``exp(−2 ζ acos ζ / √(1 − ζ²))``, since the force has fallen to zero
        after ``2 acos ζ / ω`` at the damped frequency ω. Beyond critical damping both the
        arc cosine and the root turn hyperbolic.

        Parameters
        ----------
        mass : float
            The mass (kg).

        Returns
        -------
        float
            From 0 to 1.
        """
        return _linear_restitution(self.damping_ratio(mass))

    def contact_time(self, mass: float) -> float:
        """Duration in seconds of an impact of a free mass (kg), without gravity.

        Parameters
        ----------
        mass : float
            The mass (kg).

        Returns
        -------
        float
            Seconds.
        """
        ratio = self.damping_ratio(mass)
        return 2.0 * _arc_over_root(ratio) * sqrt(mass / self.stiffness)

    @kernel
    def force(self, gap: float, speed: float) -> tuple[float, float, float]:
        """Force of a point in the ground, and its derivatives.

        Parameters
        ----------
        gap, speed : float
            Gap (m), negative, and its rate (m/s).

        Returns
        -------
        tuple of float
            Force (N), and its derivatives by gap and speed.
        """
        push = -self.stiffness * gap - self.damping * speed
        if push <= 0.0:
            return 0.0, 0.0, 0.0
        return push, -self.stiffness, -self.damping


@dataclass(frozen=True, kw_only=True)
class RegularisedFriction(FrictionLaw):
    """Coulomb friction smoothed around zero speed: ``F_t = −μ F_n v / √(v² + v_s²)``.

    It never holds: what should stick creeps, at ``v_s r / √(1 − r²)`` when it needs the fraction r
    of the friction there is.

    Raises
    ------
    SimulationError
        If the speed is not positive.
    """

    speed: float = 1e-4
    """v_s in m/s, at which 71 % of the friction is there."""

    def __post_init__(self) -> None:
        _positive("regularisation speed", self.speed, "m/s")

    def creep(self, use: float) -> float:
        """Speed (m/s) at which a contact creeps that needs the given fraction of the friction.

        Parameters
        ----------
        use : float
            Share of the friction, from 0 up to 1.

        Returns
        -------
        float
            m/s.

        Raises
        ------
        SimulationError
            If the share is not one that friction can give.
        """
        if not 0.0 <= use < 1.0:
            raise SimulationError(f"the use of friction must lie in [0, 1), got {use}")
        return self.speed * use / sqrt(1.0 - use * use)

    @property
    def joint_speed(self) -> float:
        """Speed around which dry friction of the joints is smoothed beside it (rad/s, m/s)."""
        return self.speed

    @kernel
    def force(self, friction: float, normal: float, speed: float, bend: float) -> Friction:  # noqa: ARG002
        """Force of a point, and its derivatives.

        Parameters
        ----------
        friction, normal, speed, bend : float
            Coefficient, normal force (N), sliding speed (m/s); the bend is not used.

        Returns
        -------
        tuple
            Force (N) and derivatives, the bend's rate, which is zero, and whether the point slides.
        """
        limit = friction * normal
        size = sqrt(speed * speed + self.speed * self.speed)
        share = speed / size
        rest = self.speed / size
        said = (-limit * share, -friction * share, -limit * rest * rest / size, 0.0)
        return said, (0.0, 0.0, 0.0, 0.0), abs(speed) > self.speed


@dataclass(frozen=True, kw_only=True)
class BristleFriction(FrictionLaw):
    """Coulomb friction with true stiction: a bristle that bends, and slides when bent too far.

    The bristle is a spring and damper between the contact point and an anchor on the ground. While
    ``|k s + c v| ≤ μ F_n`` the anchor holds and the bend s grows with the speed v of the point;
    beyond, the force is μ F_n against the motion and the anchor is dragged along. A point at rest
    stays at rest.

    Raises
    ------
    SimulationError
        If a parameter is not positive.
    """

    stiffness: float = 5e6
    """k in N/m, for each contact point."""
    damping: float = 1e4
    """c in N s/m, for each contact point; it must not be zero."""

    def __post_init__(self) -> None:
        _positive("bristle stiffness", self.stiffness, "N/m")
        _positive("bristle damping", self.damping, "N s/m")

    @kernel
    def force(self, friction: float, normal: float, speed: float, bend: float) -> Friction:
        """Force of a point, rate of its bend, and their derivatives.

        Parameters
        ----------
        friction, normal, speed, bend : float
            Coefficient, normal force (N), sliding speed (m/s) and bend (m).

        Returns
        -------
        tuple
            Force (N) and derivatives, the bend's rate (m/s) and derivatives, and whether the point
            slides.
        """
        limit = friction * normal
        spring = self.stiffness * bend
        wanted = spring + self.damping * speed
        if abs(wanted) <= limit:
            return (-wanted, 0.0, -self.damping, -self.stiffness), (speed, 0.0, 1.0, 0.0), False
        side = 1.0 if wanted > 0.0 else -1.0
        rate = (side * limit - spring) / self.damping
        return (
            (-side * limit, -side * friction, 0.0, 0.0),
            (rate, side * friction / self.damping, 0.0, -self.stiffness / self.damping),
            True,
        )


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    """Zero of a function between two numbers, to the last digits."""
    from scipy.optimize import brentq  # takes half a second to import

    return float(brentq(function, low, high, xtol=1e-15, rtol=1e-14))


def _positive(name: str, value: float, unit: str) -> None:
    if not 0.0 < value < np.inf:
        raise SimulationError(f"the {name} must be a positive number of {unit}, got {value}")


def _not_negative(name: str, value: float, unit: str) -> None:
    if not 0.0 <= value < np.inf:
        raise SimulationError(f"the {name} must be a number ≥ 0 of {unit}, got {value}")


def _restitution(value: float) -> None:
    if not 0.0 < value <= 1.0:
        raise SimulationError(
            f"the restitution of a compliant contact must be above 0, at most 1, got {value}: "
            f"damping never stops a point entirely"
        )


def _arc_over_root(ratio: float) -> float:
    """Return acos ζ / √(1 − ζ²), continued beyond ζ = 1."""
    if abs(ratio - 1.0) < 1e-8:
        return 1.0
    if ratio < 1.0:
        return acos(ratio) / sqrt(1.0 - ratio * ratio)
    return acosh(ratio) / sqrt(ratio * ratio - 1.0)


def _linear_restitution(ratio: float) -> float:
    return exp(-2.0 * ratio * _arc_over_root(ratio))
