"""Which of the limits of printed runs ours break: an audit in the equations of their author.

Run, from the top folder::

    python benchmarks/printed_limits.py

M. P. Kelly's TwoPhaseOptimalGait (2016) asks more of a run than `printed_optima.py` does
(`GAIT_Run/Trajectory_Run.m`, `Continuous_Run.m` and `Endpoint_Run.m`): no force or torque goes from
zero to its largest value in less than 0.8 s; they jump only where phases join. Legs turn by at most
2π rad/s, within ±π/2, and grow by at most all that they can in 0.3 s. The foot in the air keeps
above ½h (1 + cos(π x / step)) in stance, h being 2 cm and x how far it is ahead of the one that
stands, and above the ground in flight, at no more than 4 m/s either way. A foot that leaves the
ground is no longer pressed on it.

A motion is put into the equations of his three point masses. What his legs would have to exert
follows from its coordinates alone. Then come the cost of transport and, at `INSTANTS` instants of
each phase, the largest share of each limit that is used, and by how much all else is missed. One
row for each limit; shares above 1 are breaches.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from printed_optima import GRAVITY, PRINTED, RUNNER, WEIGHT, Biped, found
from rich.console import Console
from table import Table

import heelstrike as hs

FRICTION = 0.8
INSTANTS = 1000
SLOWEST = 0.8
"""Time (s) in which forces and torques may go from zero to their largest."""
GROWS = 0.3
"""Time (s) in which a leg may grow from its shortest to its longest."""
TURNS = 2.0 * np.pi
"""Largest rate of the angle of a leg (rad/s)."""
SWINGS = 0.5 * np.pi
"""Largest angle of a leg (rad)."""
FASTEST = 4.0
"""Largest speed of a foot in flight, along each axis (m/s)."""
LIFTED = 0.02
"""Greatest height asked of the foot in the air (m)."""


@dataclass(frozen=True)
class Audit:
    """A motion in his problem."""

    cost: float
    """Cost of transport."""
    used: dict[str, float]
    """Largest forces, torques, speeds and their rates, as shares of the limits."""
    missing: dict[str, float]
    """By how much (m, m/s, weights, weights · m) equations and all other limits are missed."""


@dataclass(frozen=True)
class Leg:
    """A leg at instants of a phase."""

    length: np.ndarray
    growth: np.ndarray
    """length, growth: (N,) Length (m) and its rate."""
    angle: np.ndarray
    turning: np.ndarray
    """angle, turning: (N,) Angle from the vertical, positive forwards (rad), and its rate."""
    along: np.ndarray
    across: np.ndarray
    """along, across: (N, 2) Directions from the hip to the foot, and a quarter turn on."""
    place: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    """place, velocity, acceleration: (N, 2) Of the foot."""

    @classmethod
    def of(cls, biped: Biped, moved: list[np.ndarray], side: int) -> Leg:
        """Return a leg of coordinates and their rates, (N, nv) each: 0 is the right one."""
        first = 3 + side * (moved[0].shape[1] - 3) // 2
        angle, turning, bend = (-each[:, 2] - each[:, first] for each in moved)
        length, growth, push = (each[:, first + 1] for each in moved)
        length = biped.longest + length
        along = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
        across = np.stack([np.cos(angle), np.sin(angle)], axis=1)

        def vector(axial: np.ndarray, sideways: np.ndarray) -> np.ndarray:
            return np.asarray(axial[:, None] * along + sideways[:, None] * across)

        hip = [each[:, :2] for each in moved]
        return cls(
            length, growth, angle, turning, along, across,
            hip[0] + vector(length, 0.0 * length),
            hip[1] + vector(growth, length * turning),
            hip[2]
            + vector(push - length * turning**2, 2.0 * growth * turning + length * bend),
        )  # fmt: skip


@dataclass(frozen=True)
class Exerted:
    """What the legs of his biped exert at instants of a phase, one of two feet on the ground."""

    legs: tuple[Leg, Leg]
    """legs: Right and left."""
    axial: np.ndarray
    """(2, N) Forces along the legs that push feet away from the hip (N)."""
    moment: np.ndarray
    """(2, N) Moments of what acts on the feet about the hip, positive as the angles (N m)."""
    ground: np.ndarray
    """(N, 2) Force on the foot that stands (N); zero in flight."""
    lacking: np.ndarray
    """(N, 2) Force that the hip lacks in flight (N); zero in stance."""

    @classmethod
    def by(cls, biped: Biped, moved: list[np.ndarray], stands: list[bool]) -> Exerted:
        """Return it of coordinates and their rates, (N, nv) each, and which feet stand."""
        legs = (Leg.of(biped, moved, 0), Leg.of(biped, moved, 1))
        gravity = np.array([0.0, GRAVITY])
        wanted = -biped.hip * (moved[2][:, :2] + gravity)  # what the legs exert on the feet
        needed = [biped.foot * (leg.acceleration + gravity) for leg in legs]
        force, ground, lacking = list(needed), 0.0 * wanted, wanted - sum(needed)
        if any(stands):
            one = stands.index(True)
            force[one] = wanted - needed[1 - one]
            ground, lacking = needed[one] - force[one], 0.0 * wanted
        axial = np.array(
            [np.sum(f * leg.along, axis=1) for f, leg in zip(force, legs, strict=True)]
        )
        moment = np.array(
            [
                leg.length * np.sum(f * leg.across, axis=1)
                for f, leg in zip(force, legs, strict=True)
            ]
        )
        return cls(legs, axial, moment, ground, lacking)


def audit(biped: Biped, motion: hs.Motion) -> Audit:
    """Put a run of points on the ground, one at a time, into the equations of his three masses.

    Parameters
    ----------
    biped : Biped
        His, with its limits; that of the motion may have others, and a trunk.
    motion : Motion
        A motion that repeats mirrored, of which only the polynomials are taken.

    Returns
    -------
    Audit
        Its cost and limits.
    """
    spent = 0.0
    used, missing = dict[str, float](), dict[str, float]()

    def most(found: dict[str, float], name: str, values: Any) -> None:
        found[name] = max(found.get(name, 0.0), float(np.max(values)))

    longest = biped.longest
    sizes = {"leg": biped.push, "hip": biped.turn * longest, "ankle": biped.ankle * longest}
    standing = [
        [any(side in name for name in phase.contacts) for side in ("right", "left")]
        for phase in motion.phases
    ]
    standing.append(standing[0][::-1])  # as it goes on, mirrored
    first: list[np.ndarray] = []
    last: list[np.ndarray] = []
    for phase, stands, after in zip(motion.phases, standing, standing[1:], strict=False):
        times = np.linspace(0.0, phase.duration, INSTANTS + 1)
        moved = [phase.coordinates(times, order=order) for order in range(3)]
        now = Exerted.by(biped, moved, stands)
        legs = now.legs
        velocities = np.stack([*(leg.velocity for leg in legs), moved[1][:, :2]], axis=1)
        first.append(velocities[0])
        last.append(velocities[-1])
        one = stands.index(True) if any(stands) else 0
        other = 1 - one
        acting = [
            ("leg", now.axial[0], legs[0].growth), ("leg", now.axial[1], legs[1].growth),
            ("hip", now.moment[other], legs[other].turning - legs[one].turning),
        ]  # fmt: skip
        whole = now.moment.sum(axis=0)
        if any(stands):
            acting.append(("ankle", whole, legs[one].turning))
        else:
            most(missing, "hip in flight", np.abs(now.lacking) / WEIGHT)
            most(missing, "moment in flight", np.abs(whole) / WEIGHT)
        for name, force, speed in acting:
            size = sizes[name] * WEIGHT
            spent += float(np.trapezoid(np.abs(force * speed), times))
            most(used, name, np.abs(force) / size)
            most(used, f"rate of {name}", np.abs(np.diff(force) / np.diff(times)) * SLOWEST / size)
        for k, leg in enumerate(legs):
            most(missing, "length", leg.length - longest)
            most(missing, "length", biped.shortest - leg.length)
            most(used, "growth", np.abs(leg.growth) * GROWS / (longest - biped.shortest))
            most(used, "turning", np.abs(leg.turning) / TURNS)
            most(used, "angle", np.abs(leg.angle) / SWINGS)
            if not any(stands):
                most(used, "speed of feet", np.abs(leg.velocity) / FASTEST)
                most(missing, "clearance", -leg.place[:, 1])
            elif k != one:
                ahead = (leg.place - legs[one].place)[:, 0] / motion.distance
                rise = 0.5 * LIFTED * (1.0 + np.cos(np.pi * ahead))
                most(missing, "clearance", rise - leg.place[:, 1])
            else:
                along, away = now.ground.T / WEIGHT
                most(missing, "foot at rest", np.abs(leg.velocity))
                most(missing, "pulled", -away)
                most(missing, "friction", np.abs(along) - FRICTION * away)
                if not after[k]:
                    most(missing, "pressed when it leaves", np.abs(away[-1]))
    first.append(first[0][[1, 0, 2]])
    for before, begun, here, there in zip(
        last, first[1:], standing[:-1], standing[1:], strict=True
    ):
        same = [k for k in (0, 1) if here[k] or not there[k]]  # what lands, stops
        most(missing, "joined", np.abs(begun - before)[[*same, 2]])
    return Audit(spent / (WEIGHT * motion.distance), used, missing)


HIS = {
    "run": replace(RUNNER, ankle=0.05),
    "run, the other": replace(RUNNER, ankle=0.2, push=5.0, turn=1.0),
}
"""His biped: the second run is stored with other limits than the program of his that prints the
first."""


def main() -> None:
    """Print a table for each run."""
    for name in sys.argv[1:] or HIS:
        motion = found(name)
        told = audit(HIS[name], motion)
        body = [["cost of transport", f"{told.cost:.6f}", f"{PRINTED[name].cost} printed"]]
        body += [[what, f"{share:.4f}", "of the limit"] for what, share in told.used.items()]
        body += [[what, f"{away:.1e}", "missing"] for what, away in told.missing.items()]
        Console(width=100).print(Table(name, ["what", "how much", ""], body))


if __name__ == "__main__":
    main()
