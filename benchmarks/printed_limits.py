"""Which of the limits of printed gaits ours break, and which his own: an audit in his equations.

Run, from the top folder::

    python benchmarks/printed_limits.py [FOLDER]

A motion of `printed_optima.py` is put into the equations of the three point masses of M. P. Kelly's
TwoPhaseOptimalGait (2016). What his legs would have to exert follows from its coordinates alone.
Then come the cost of transport and, at `INSTANTS` instants of each phase, the largest share of each
limit that is used, and by how much all else is missed: shares above 1 are breaches. Further limits
are that legs stay within ±π/2, and that the feet of a run are not below the ground in flight and
move at no more than 4 m/s either way.

FOLDER is his program (github.com/MatthewPeterKelly), fetched by who wants it, of which three files
are read: ``GAIT_Run/DATA_Run.mat``, ``GAIT_Run/oldSoln_Run_CoT.mat`` and
``GAIT_Walk/oldSoln_Walk_CoT.mat``. Nothing is fetched here. They hold his solutions at five times
as many instants as those at which his equations and limits hold: so what he prints, the sum over
the latter, can be compared with the motion between them. It is audited like ours, but for rates,
which are those of the forces that he stored. These forces, straight between those instants, are
also integrated in the equations of the three masses from his first instant: what they cost, and by
how much the end misses the state in which the gait goes on.

At the ankle of ours the audit finds what his would have to exert between the instants at which our
equations of motion hold. In runs, where ours have none, only its largest torque says something; its
rate is that of this error.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from printed_optima import (
    FRICTION,
    GRAVITY,
    GROWS,
    PRINTED,
    SLOWEST,
    TURNS,
    WEIGHT,
    Biped,
    found,
)  # fmt: skip
from rich.console import Console
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline, CubicSpline, interp1d
from scipy.io import loadmat
from table import Table

import heelstrike as hs

DOWN = np.array([0.0, -GRAVITY])
INSTANTS = 1000
SWINGS = 0.5 * np.pi
"""Largest angle of a leg (rad)."""
FASTEST = 4.0
"""Largest speed of a foot in flight, along each axis (m/s)."""


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
    """What the legs of his biped exert at instants of a phase."""

    legs: tuple[Leg, Leg]
    """legs: Right and left."""
    axial: np.ndarray
    """(2, N) Forces along the legs that push feet away from the hip (N)."""
    moment: np.ndarray
    """(2, N) Moments of what acts on the feet about the hip, positive as the angles (N m)."""
    ground: np.ndarray
    """(2, N, 2) Forces on the feet that stand (N); zero on others."""
    lacking: np.ndarray
    """(N, 2) Force that the hip lacks in flight (N); zero otherwise."""

    @classmethod
    def by(cls, biped: Biped, moved: list[np.ndarray], stands: list[bool]) -> Exerted:
        """Return it of coordinates and their rates, (N, nv) each, and which feet stand.

        On both feet, legs have no moments: the hip and the ankles exert none.
        """
        legs = (Leg.of(biped, moved, 0), Leg.of(biped, moved, 1))
        gravity = np.array([0.0, GRAVITY])
        wanted = -biped.hip * (moved[2][:, :2] + gravity)  # what the legs exert on the feet
        needed = [biped.foot * (leg.acceleration + gravity) for leg in legs]
        force, lacking = list(needed), 0.0 * wanted
        if all(stands):
            ways = np.stack([leg.along for leg in legs], axis=2)
            shares = np.linalg.solve(ways, wanted[:, :, None])
            force = [shares[:, k] * leg.along for k, leg in enumerate(legs)]
        elif any(stands):
            one = stands.index(True)
            force[one] = wanted - needed[1 - one]
        else:
            lacking = wanted - sum(needed)
        ground = np.array([each - f for each, f in zip(needed, force, strict=True)])
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


def audit(biped: Biped, motion: hs.Motion | Stored) -> Audit:
    """Put a gait on points or flat feet into the equations of his three masses.

    Parameters
    ----------
    biped : Biped
        His, with its limits; that of the motion may have others, and a trunk.
    motion : Motion or Stored
        A motion that repeats mirrored, of which only the polynomials are taken.

    Returns
    -------
    Audit
        Its cost and limits.
    """
    spent, phases = 0.0, list[Any](motion.phases)
    used, missing = dict[str, float](), dict[str, float]()

    def most(found: dict[str, float], name: str, values: Any) -> None:
        found[name] = max(found.get(name, 0.0), float(np.max(values)))

    longest = biped.longest
    sizes = {"leg": biped.push, "hip": biped.turn * longest, "ankle": biped.ankle * longest}
    standing = [
        [any(side in name for name in phase.contacts) for side in ("right", "left")]
        for phase in phases
    ]
    standing.append(standing[0][::-1])  # as it goes on, mirrored
    first: list[np.ndarray] = []
    last: list[np.ndarray] = []
    for phase, stands, after in zip(phases, standing, standing[1:], strict=False):
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
            elif not stands[k]:
                ahead = (leg.place - legs[one].place)[:, 0] / motion.distance
                rise = 0.5 * biped.lifted * (1.0 + np.cos(np.pi * ahead))
                most(missing, "clearance", rise - leg.place[:, 1])
            else:
                along, away = now.ground[k].T / WEIGHT
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


FILES = {
    "run": "GAIT_Run/DATA_Run.mat",
    "run, the other": "GAIT_Run/oldSoln_Run_CoT.mat",
    "walk": "GAIT_Walk/oldSoln_Walk_CoT.mat",
}
STAND = {"F": (), "S": ("right_foot",), "D": ("right_foot", "left_foot")}
"""What stands in his phases. His first foot is our right one."""
EXACT = 1e-9
"""Tolerance of the integration."""


@dataclass(frozen=True)
class StoredPhase:
    """A phase of a solution of his, at instants between those of his collocation, too."""

    contacts: tuple[str, ...]
    times: np.ndarray
    """times: (N,) Instants (s)."""
    moved: tuple[np.ndarray, np.ndarray]
    """moved: (N, nv) Coordinates of our robot without ankles, and their rates."""
    forces: np.ndarray
    """(N, 4) Along the right leg and the left one, at the ankle and at the hip, as he has them."""

    @property
    def duration(self) -> float:
        """Duration (s)."""
        return float(self.times[-1])

    def coordinates(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Coordinates or their derivatives, by splines through velocities, (N, nv)."""
        if order == 0:
            return np.asarray(CubicHermiteSpline(self.times, *self.moved)(times))
        return np.asarray(CubicSpline(self.times, self.moved[1])(times, order - 1))


@dataclass(frozen=True)
class Stored:
    """A solution of his."""

    phases: list[StoredPhase]
    distance: float
    """distance: Length of the step (m)."""


def stored(file: Path, biped: Biped) -> Stored:
    """Read a solution of his."""
    told = loadmat(file, squeeze_me=True, struct_as_record=False)
    if "plotInfo" in told:
        data = told["plotInfo"].data
        step = float(data[0].step.distance)
        phases = []
        for each in data:
            values = {name: getattr(each.state, name) for name in each.state._fieldnames}
            forces = [getattr(each.control, name) for name in ("F1", "F2", "T1", "Thip")]
            phases.append(stored_phase(each.phase, each.time - each.time[0], values, forces, biped))
        return Stored(phases, step)
    result = told["outputPrev"].result
    step = float(result.solution.parameter)
    phases = []
    for name, each in zip(result.setup.auxdata.phase, result.interpsolution.phase, strict=True):
        columns, values, nothing = each.state.T, dict[str, np.ndarray](), 0.0 * each.time
        polar = ("th1", "th2", "L1", "L2", "dth1", "dth2", "dL1", "dL2")
        if name == "D":
            x, y, dx, dy, *forces = columns
            forces += [nothing, nothing]
            for k, foot in (("1", 0.0), ("2", -step)):
                length = np.hypot(foot - x, y)
                values[f"th{k}"], values[f"L{k}"] = np.arctan2(foot - x, y), length
                values[f"dth{k}"] = ((x - foot) * dy - y * dx) / length**2
                values[f"dL{k}"] = ((x - foot) * dx + y * dy) / length
        elif name == "S":
            values.update(zip(polar, columns, strict=False))
            forces = list(columns[8:])
        else:
            names = ("x1", "y1", *polar[:4], "dx1", "dy1", *polar[4:])
            values.update(zip(names, columns, strict=False))
            forces = [*columns[12:14], nothing, columns[14]]
        phases.append(stored_phase(name, each.time, values, forces, biped))
    return Stored(phases, step)


def stored_phase(
    name: str, times: np.ndarray, values: dict[str, np.ndarray], forces: list[np.ndarray],
    biped: Biped,
) -> StoredPhase:  # fmt: skip
    """Return a phase of his: the hip is where his first leg has it."""
    turn, length, turning, growth = (values[each] for each in ("th1", "L1", "dth1", "dL1"))
    sine, cosine, nothing = np.sin(turn), np.cos(turn), 0.0 * times
    place = [values.get(each, nothing) for each in ("x1", "y1", "dx1", "dy1")]
    q = [place[0] - length * sine, place[1] + length * cosine, nothing]
    v = [
        place[2] - growth * sine - length * turning * cosine,
        place[3] + growth * cosine - length * turning * sine,
        nothing,
    ]
    for k in ("1", "2"):
        q += [-values[f"th{k}"], values[f"L{k}"] - biped.longest]
        v += [-values[f"dth{k}"], values[f"dL{k}"]]
    return StoredPhase(
        STAND[name], times, (np.stack(q, axis=1), np.stack(v, axis=1)), np.stack(forces, axis=1)
    )


def rates_stored(biped: Biped, motion: Stored) -> dict[str, float]:
    """Rates of his forces between the instants that he stored, as shares of the limits."""
    moment = WEIGHT * biped.longest
    sizes = [biped.push * WEIGHT] * 2 + [biped.ankle * moment, biped.turn * moment]
    shares = np.zeros(4)
    for phase in motion.phases:
        rates = np.diff(phase.forces, axis=0) / np.diff(phase.times)[:, None]
        shares = np.maximum(shares, np.abs(rates).max(axis=0) * SLOWEST / sizes)
    return {
        "rate of leg": float(shares[:2].max()), "rate of ankle": float(shares[2]),
        "rate of hip": float(shares[3]),
    }  # fmt: skip


def integrated(biped: Biped, motion: Stored) -> tuple[float, float]:
    """Integrate his forces in the equations of the three masses, from his first instant.

    Returns
    -------
    tuple of float
        By how much (m, m/s) the end misses the state in which the gait goes on, and the cost of
        transport on the way.
    """
    begin = motion.phases[0]
    legs = [
        Leg.of(biped, [*(each[:1] for each in begin.moved), begin.moved[1][:1]], k) for k in (0, 1)
    ]
    state = np.concatenate(
        [
            begin.moved[0][0, :2], *(leg.place[0] for leg in legs),
            begin.moved[1][0, :2], *(leg.velocity[0] for leg in legs), [0.0],
        ]
    )  # fmt: skip
    first = state.copy()
    for phase in motion.phases:
        stands = [any(side in name for name in phase.contacts) for side in ("right", "left")]
        exerted = interp1d(phase.times, phase.forces, axis=0)

        def rates(t: float, y: np.ndarray, exerted: Any = exerted, stands: Any = stands) -> Any:
            hip, *feet = y[:6].reshape(3, 2)
            speed, *speeds = y[6:12].reshape(3, 2)
            *axial, ankle, turn = exerted(t)
            pushed, spent, bends, turnings = np.zeros(2), 0.0, [], []
            for k, moment in enumerate((ankle - turn, turn)):
                away = feet[k] - hip
                length = np.hypot(*away)
                along = away / length
                across = np.array([-along[1], along[0]])
                force = axial[k] * along + moment / length * across
                pushed += force
                spent += abs(axial[k] * (along @ (speeds[k] - speed)))
                turnings.append(across @ (speeds[k] - speed) / length)
                bends.append(np.zeros(2) if stands[k] else force / biped.foot + DOWN)
            spent += abs(ankle * turnings[0]) + abs(turn * (turnings[1] - turnings[0]))
            return np.concatenate([y[6:12], DOWN - pushed / biped.hip, *bends, [spent]])

        for k in (0, 1):
            if stands[k]:
                state[8 + 2 * k : 10 + 2 * k] = 0.0
        ran = solve_ivp(
            rates,
            (0.0, phase.duration),
            state,
            rtol=EXACT,
            atol=EXACT,
            max_step=phase.duration / 50,
        )
        state = ran.y[:, -1]
    begun = first[:12].reshape(2, 3, 2)[:, [0, 2, 1]]
    begun[0, :, 0] += motion.distance
    ended = state[:12].reshape(2, 3, 2)
    own = [0, 1, 2] if not motion.phases[0].contacts else [0, 1]
    return float(np.abs(ended - begun)[:, own].max()), float(state[12]) / (WEIGHT * motion.distance)


def main() -> None:
    """Print a table for each gait."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    for name, printed in PRINTED.items():
        told = {"ours": audit(printed.biped, found(name))}
        body = [["printed", "", f"{printed.cost:.6f}"]]
        if folder is not None:
            his = stored(folder / FILES[name], printed.biped)
            told["his"] = audit(printed.biped, his)
            told["his"].used.update(rates_stored(printed.biped, his))
            missed, spent = integrated(printed.biped, his)
            body.append(["his forces, integrated", "", f"{spent:.6f}"])
            body.append(["these miss (m, m/s)", "", f"{missed:.1e}"])
        body.append(["cost of transport", *(f"{each.cost:.6f}" for each in told.values())])
        for part, form in (("used", ".4f"), ("missing", ".1e")):
            for what in getattr(told["ours"], part):
                values = (getattr(each, part)[what] for each in told.values())
                body.append([what, *(f"{value:{form}}" for value in values)])
        head = ["what", "ours", "his"]
        rows = [[*row, ""][: len(head)] for row in body]
        Console(width=100).print(Table(name, head, rows))


if __name__ == "__main__":
    main()
