"""Walks of the minimal biped (Srinivasan and Ruina 2006) that `hs.optimize_motion` finds.

Run, from the top folder::

    python benchmarks/minimal_biped.py

A point mass on massless legs that grow and shrink, of length one at most, with gravity one. Speed V
and step D are given; what is least is the positive work of a step. The impulsive walk has a closed
form: the leg that stands keeps its length, θ̈ = sin θ between ±a, a = asin(D/2), in D/V. Just before
the other foot comes down, the leg pushes off by an impulse, and the other leg takes up one as
large. The rate ω at the end of the arc gives the work ½ (ω tan a)².

`hs.optimize_motion` knows no impulses of motors. Here the force of a leg is at most 1/ε weights; a
flight of at least ε lies between two stances. A stance has three phases: the leg yields under its
greatest force for a free time, stands for a free time, and pushes for a free time. The work C(ε)
tends to the closed form. With time counted in ε within the two pulses, the equations there are
l'' = 1 + ε (…), so that what they lead to is analytic in ε, impulses at ε = 0: C(ε) = C(0) + c₁ ε +
c₂ ε² + …, and polynomials in ε may be extrapolated to zero (Neville).

Beside it stands the same walk at finite ε, by shooting: half a step from the middle of the stance,
an arc of constant length, a pulse under the greatest force, half the flight. Five unknowns fulfil
five equations (half of the step and of its duration, no vertical velocity in the middle of the
flight, a leg of length one at the end of the pulse, the least flight). It need not be the
optimum at finite ε.

The robot has one leg, which is put down again and again, with a foot of next to no mass: its swing
costs work as the square of its mean speed, D/ε. The force of a leg changes by at most `STEADY`
weights in a unit of time within a phase; between Gauss points it would swing otherwise.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi
import numpy as np
from rich.console import Console
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, root
from table import Table

import heelstrike as hs
from heelstrike import ContactPhase as Phase

MASS = 1000.0
"""Mass (kg): tolerances of the optimiser are absolute, and less of the work the larger that is."""
FOOT = 1e-13
TRUNK = 1e-9
"""FOOT, TRUNK: Mass of the foot, moment of inertia of the trunk, in units of mass and leg."""
UPRIGHT = 0.05
"""Angle (rad) that the trunk keeps within."""
SHORTEST = 0.3
"""Of a leg; none gets near to it."""
FROM_STOPS = 1e-3
"""Distance that the design keeps from the ends of joint ranges: legs are given so much more."""
STEADY = 2.0
FRICTION = 20.0
"""None of the walks would slide on much less."""
LONGEST = 3.0
"""Duration that no phase has (s)."""
PULSE = (0.02, 3.0)
"""Least and greatest duration of a pulse, in ε."""
STANDS = 0.1
"""Least duration between pulses, in ε."""
CAPS = (0.1, 0.05, 0.025, 0.0125)
"""ε."""
PIECES = (4, 8)
"""Of the arc: the first walk is found on few and leads to that on many."""
EXACT = 1e-12
"""Of integrals and roots."""
CLOSED = 1e-10
"""What the equations of a walk may lack that was shot."""


def robot() -> hs.Robot:
    """Return the robot: one leg that is put down again and again."""
    build = hs.RobotBuilder("minimal", gravity=1.0)
    trunk = build.floating_base("trunk", (0.0, 1.0), mass=MASS, inertia=TRUNK * MASS)
    hip = build.hinge("hip", trunk, limits=(-1.5, 1.5), torque=MASS)
    leg = build.slide(
        "leg", hip, direction=(0.0, -1.0), mass=FOOT * MASS, center_of_mass=(0.0, -1.0),
        limits=(SHORTEST - 1.0, FROM_STOPS), torque=math.inf, link="foot",
    )  # fmt: skip
    build.contact(leg, (0.0, -1.0))
    return build.build()


def limits(cap: float) -> Callable[[hs.gait.Instant], Any]:
    """Return what holds: the trunk is upright; the force of the leg is limited and steady."""

    def held(now: hs.gait.Instant) -> Any:
        shares = casadi.vertcat(
            now.position[2] / UPRIGHT,
            now.torque[1] * cap / MASS,
            now.torque_rate[1] / (MASS * STEADY),
        )
        return casadi.vertcat(1.0 - shares, 1.0 + shares)

    return held


@dataclass(frozen=True)
class Asked:
    """A walk of given speed and step."""

    speed: float
    distance: float

    @cached_property
    def closed_form(self) -> float:
        """Positive work of a step with impulses, in units of mass, leg and gravity."""
        duration, angle = self.distance / self.speed, math.asin(0.5 * self.distance)

        def lasts(slowest: float) -> float:
            """How long an arc takes that is passed at this rate in the middle."""
            rate = lambda x: 1.0 / math.sqrt(slowest**2 + 2.0 * (1.0 - math.cos(x)))  # noqa: E731
            return 2.0 * float(quad(rate, 0.0, angle, epsabs=0.0, epsrel=EXACT)[0])

        slowest = brentq(lambda rate: lasts(rate) - duration, 1e-3, 10.0, xtol=EXACT)
        last = math.sqrt(slowest**2 + 2.0 * (1.0 - math.cos(angle)))
        return 0.5 * (last * math.tan(angle)) ** 2

    def shot(self, cap: float) -> float:
        """Positive work of a step with pulses under a force of 1/cap, by shooting."""

        def rates(_: float, y: Any, force: float) -> list[float]:
            length, stretch, angle, turn, _work = y
            return [
                stretch, length * turn**2 - math.cos(angle) + force, turn,
                (math.sin(angle) - 2.0 * stretch * turn) / length, force * stretch,
            ]  # fmt: skip

        def half(unknowns: Any) -> tuple[list[float], float]:
            length, turn, arc, pulse, rise = unknowns
            pendulum = solve_ivp(
                lambda _, y: [y[1], math.sin(y[0]) / length], (0.0, arc), (0.0, turn),
                method="DOP853", rtol=EXACT, atol=EXACT,
            ).y[:, -1]  # fmt: skip
            begin = (length, 0.0, *pendulum, 0.0)
            pushed = solve_ivp(
                rates, (0.0, cap * pulse), begin, args=(1.0 / cap,),
                method="DOP853", rtol=EXACT, atol=EXACT,
            ).y[:, -1]  # fmt: skip
            length, stretch, angle, turn, work = pushed
            ahead = stretch * math.sin(angle) + length * turn * math.cos(angle)
            up = stretch * math.cos(angle) - length * turn * math.sin(angle)
            lacks = [
                length * math.sin(angle) + ahead * rise - 0.5 * self.distance,
                arc + cap * pulse + rise - 0.5 * self.distance / self.speed,
                up - rise, length - 1.0, 2.0 * rise - cap,
            ]  # fmt: skip
            return lacks, work

        near = (1.0, self.speed, 0.5 * self.distance / self.speed, 0.2, 0.5 * cap)
        found = root(lambda unknowns: half(unknowns)[0], near, tol=EXACT)
        assert np.abs(found.fun).max() < CLOSED, found.message
        return half(found.x)[1]


ASKED = (Asked(0.4, 0.6), Asked(0.5, 0.4), Asked(0.3, 0.5))


def design(asked: Asked, cap: float, pieces: int, warm_start: hs.Motion | None = None) -> hs.Motion:
    """Find the walk of least work with forces up to 1/cap."""
    pulse = (PULSE[0] * cap, PULSE[1] * cap)
    phases = [
        Phase("foot", duration=pulse, pieces=1),
        Phase("foot", duration=(STANDS * cap, LONGEST), pieces=pieces),
        Phase("foot", duration=pulse, pieces=1),
        Phase(duration=(cap, LONGEST), pieces=1),
    ]
    return hs.optimize_motion(
        robot(), phases, distance=asked.distance, duration=asked.distance / asked.speed,
        friction=FRICTION, clearance=0.0, cost="mechanical_energy", constraint=limits(cap),
        repeat="same", starts=1, refine=False, warm_start=warm_start,
    )  # fmt: skip


def work(motion: hs.Motion) -> float:
    """Positive work: as much as the negative, since the motion repeats and nothing is lost."""
    return 0.5 * motion.spent / MASS


def extrapolated(caps: Sequence[float], values: Sequence[float]) -> float:
    """Value at zero of the polynomial through given ones (Neville)."""
    found = list(values)
    for order in range(1, len(values)):
        for k in range(len(values) - order):
            near, far = caps[k + order], caps[k]
            found[k] = (far * found[k + 1] - near * found[k]) / (far - near)
    return found[0]


def designs(asked: Asked) -> list[hs.Motion]:
    """Find walks under ever larger forces, each from the one before."""
    motion = design(asked, CAPS[0], PIECES[0])
    found = []
    for cap in CAPS:
        motion = design(asked, cap, PIECES[-1], motion)
        found.append(motion)
    return found


def table() -> Table:
    """Design all walks."""
    body = []
    for asked in ASKED:
        begin = time.process_time()
        motions = designs(asked)
        spent = time.process_time() - begin
        works = [work(motion) for motion in motions]
        exact = asked.closed_form
        orders = [
            math.log2((works[k] - exact) / (works[k + 1] - exact)) for k in range(len(works) - 1)
        ]
        shots = [value - asked.shot(cap) for cap, value in zip(CAPS, works, strict=True)]
        limit = extrapolated(CAPS, works)
        body.append(
            [
                f"{asked.speed}, {asked.distance}", f"{exact:.10f}",
                " ".join(f"{value:.8f}" for value in works),
                " ".join(f"{order:.2f}" for order in orders),
                " ".join(f"{value:+.0e}" for value in shots), f"{limit:.10f}",
                f"{limit - exact:+.1e}", "yes" if all(m.optimal for m in motions) else "no",
                f"{spent:.1f}",
            ]
        )  # fmt: skip
    head = [
        "V, D", "closed form", f"found at ε = {', '.join(map(str, CAPS))}", "order in ε",
        "more than by shooting", "extrapolated", "more than closed form", "optimal", "time (s)",
    ]  # fmt: skip
    return Table("positive work of a step, minimal biped", head, body)


if __name__ == "__main__":
    Console(width=220).print(table())
