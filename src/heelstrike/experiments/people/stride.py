"""The mean step of a recording: directions of all segments as sums of sines over a stride.

Directions of trunk, thigh, shank and foot are angles about +y (rad), zero of a person who stands
upright with straight legs. Both legs are one leg half a stride apart: left and right are averaged,
and a leg that was not recorded does what the other one did.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.dynamics import contact_positions, link_poses
from heelstrike.errors import GaitError
from heelstrike.experiments.people.body import BodyMotion
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats

HARMONICS = 6
"""Most harmonics of a stride: above them there is nearly nothing (Winter 2009, chapter 3)."""
SAMPLES = 4
"""Samples of a stride for each of them, at least."""
SEGMENTS = ("trunk", "thigh", "shank", "foot")
"""Segments of a leg, and the trunk."""
TILTED = np.deg2rad(4.0)
"""Angle of a foot (rad) from which on it stands on its heel or its toes."""
MIDDLE = 0.25
"""Share of a stride after touchdown at which the foot stands flat."""
PROMINENT = 0.15
"""Share of the way of a heel by which it goes back on both sides of where it is farthest ahead."""
TRAVELS = 0.5
"""Share of the speed past the foot that stands from which on the hip itself travels."""
FINE = 400
"""Instants of a stride at which it is looked at."""


@dataclass(frozen=True, eq=False)
class Stride:
    """A mean stride, of two steps that are mirror images."""

    duration: float
    """Duration of a stride (s), from a touchdown of a foot to its next."""
    speed: float
    """Walking speed (m/s)."""
    leg: float
    """Length of a leg of the person from hip to sole (m)."""
    coefficients: Floats
    """(2 h + 1, 4) Of 1, cos, sin, cos 2, sin 2 … of the stride's phase, for the directions of
    trunk, thigh, shank and foot (rad) of a leg that comes down at phase 0."""
    flat: float
    """Share of the stride at which the foot is flat; 0 where it comes down flat."""
    raised: float
    """Share of the stride at which its heel is raised; 0.5 where it is not before the other foot
    comes down."""
    strides: int
    """How many strides were averaged."""

    @property
    def length(self) -> float:
        """Length of a stride (m), of two steps."""
        return self.speed * self.duration

    def directions(self, phase: Any, lib: Any = np, *, order: int = 0) -> list[Any]:
        """Directions of trunk, thigh, shank and foot at a phase, in rad, or a derivative by it.

        Parameters
        ----------
        phase : number or expression
            Share of the stride since the leg came down.
        lib : module
            What has cos and sin: numpy, or casadi for an expression.
        order : int
            Of the derivative: 0 or 2.
        """
        angle, terms = 2.0 * np.pi * phase, [0.0 if order else 1.0]
        for k in range(1, (len(self.coefficients) + 1) // 2):
            scale = -((2.0 * np.pi * k) ** 2) if order else 1.0
            terms += [scale * lib.cos(k * angle), scale * lib.sin(k * angle)]
        return [
            sum(float(c) * term for c, term in zip(column, terms, strict=True))
            for column in self.coefficients.T
        ]


def stride_of(motion: BodyMotion, *, speed: float | None = None) -> Stride:
    """Average the strides of a motion.

    A foot comes down where its heel is farthest ahead of the hip, and leaves where its toe is
    farthest behind (Zeni, Richards and Higginson 2008, Gait and Posture 27): on a treadmill, too.

    Parameters
    ----------
    motion : BodyMotion
        The motion.
    speed : float, optional
        Walking speed (m/s); by default that of the hip, or on a treadmill, and where joints were
        recorded, that at which it moves past the foot that stands.

    Returns
    -------
    Stride
        The mean stride.

    Raises
    ------
    GaitError
        If there is no whole stride.
    """
    robot = motion.robot
    poses = [link_poses(robot, q) for q in motion.q]
    contacts = np.array([contact_positions(robot, q) for q in motion.q])
    legs = {}
    for side in motion.sides:
        links = [robot.link_names.index(f"{side}_{name}") for name in SEGMENTS[1:]]
        foot = next(each for each in robot.feet if each.link == links[-1])
        hip = np.array([each.origin[links[0], 0] for each in poses])
        ahead = contacts[:, foot.contacts[0], 0] - hip
        legs[side] = (np.array([each.angle[links] for each in poses]), ahead)
    begins = {side: _touchdowns(motion.time, ahead) for side, (_, ahead) in legs.items()}
    side = max(begins, key=lambda each: len(begins[each]))
    if len(begins[side]) < 2:
        raise GaitError(
            "the recording has no whole stride: the same foot must come down twice. Record longer; "
            f"it lasts {motion.time[-1]:.3g} s."
        )
    downs = begins[side]
    inside = (motion.time >= downs[0]) & (motion.time <= downs[-1])
    phase = np.interp(motion.time[inside], downs, np.arange(len(downs), dtype=np.float64))
    duration = float(downs[-1] - downs[0]) / (len(downs) - 1)
    harmonics = min(HARMONICS, int(np.count_nonzero(inside) / (len(downs) - 1) / SAMPLES))
    rows, samples = [], []
    for other, (angles, _) in legs.items():
        rows.append(_terms(phase + (0.0 if other == side else 0.5), harmonics))
        samples.append(angles[inside])
    leg = np.linalg.lstsq(np.concatenate(rows), np.concatenate(samples), rcond=None)[0]
    trunk_terms = _terms(phase, harmonics)
    odd = np.repeat(np.arange(1, harmonics + 1), 2) % 2 == 1
    trunk_terms[:, 1:][:, odd] = 0.0  # it does in the second step what it did in the first
    trunk = np.linalg.lstsq(trunk_terms, motion.q[inside, 2], rcond=None)[0]
    found = Stride(
        duration, 1.0, _leg(motion), np.column_stack([trunk, leg]), 0.0, 0.5, len(downs) - 1
    )
    hip = np.interp(downs[[0, -1]], motion.time, motion.q[:, 0])
    return _timed(motion, found, speed, float(hip[1] - hip[0]) / (duration * found.strides))


def _touchdowns(time: Floats, ahead: Floats) -> Floats:
    """Times at which a heel is farthest ahead of the hip."""
    from scipy.signal import find_peaks

    peaks, _ = find_peaks(ahead, prominence=PROMINENT * float(np.ptp(ahead)))
    return np.asarray([_top(time, ahead, int(k)) for k in peaks], dtype=np.float64)


def _top(time: Floats, value: Floats, k: int) -> float:
    """Time of the top of the parabola through a largest value and its neighbours."""
    bend, slope, _ = np.polyfit(time[k - 1 : k + 2] - time[k], value[k - 1 : k + 2], 2)
    return float(time[k] - 0.5 * slope / bend) if bend < 0.0 else float(time[k])


def _terms(phase: Floats, harmonics: int) -> Floats:
    """1, cos, sin, cos 2, sin 2 … of phases, (n, 2 h + 1)."""
    order = np.arange(1, harmonics + 1)
    angles = 2.0 * np.pi * phase[:, None] * order
    waves = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(len(phase), -1)
    return np.column_stack([np.ones(len(phase)), waves])


def _leg(motion: BodyMotion) -> float:
    """Length from hip to sole of a straight leg (m)."""
    robot = motion.robot
    q = robot.reference_state().q
    hip = link_poses(robot, q).origin[robot.link_names.index(f"{motion.sides[0]}_thigh"), 1]
    return float(hip - contact_positions(robot, q)[:, 1].min())


def _timed(motion: BodyMotion, stride: Stride, speed: float | None, travelled: float) -> Stride:
    """Return a stride with its speed, and when the foot is flat and its heel raised."""
    robot, side = motion.robot, motion.sides[0]
    index = robot.joint_names.index
    phases = np.arange(FINE) / FINE
    foot = next(each for each in robot.feet if each.link == robot.link_names.index(f"{side}_foot"))
    ahead, tilt = np.zeros(FINE), np.zeros(FINE)  # of the heel against the hip
    for i, phase in enumerate(phases):
        trunk, thigh, shank, sole = stride.directions(phase)
        q = robot.reference_state().q.copy()
        q[2], q[index(f"{side}_hip")] = trunk, thigh - trunk
        q[index(f"{side}_knee")], q[index(f"{side}_ankle")] = shank - thigh, sole - shank
        hip = link_poses(robot, q).origin[robot.link_names.index(f"{side}_thigh"), 0]
        ahead[i] = contact_positions(robot, q)[foot.contacts[0], 0] - hip
        tilt[i] = sole
    stands = phases < 0.5
    before, after = stands & (phases < MIDDLE), stands & (phases >= MIDDLE)
    on_heel, on_toe = before & (tilt < -TILTED), after & (tilt > TILTED)
    flat = float(phases[on_heel][-1] + 1.0 / FINE) if on_heel.any() else 0.0
    raised = float(phases[on_toe][0]) if on_toe.any() else 0.5
    if speed is None:
        resting = (phases >= flat) & (phases <= raised)
        passed = float(np.ptp(ahead[resting])) / (stride.duration * np.ptp(phases[resting]))
        speed = travelled if travelled > TRAVELS * passed else passed
    if not speed > 0.0:
        raise GaitError(
            f"the person does not walk forwards: the hip moves past the foot that stands at "
            f"{speed:.3g} m/s. Say which axis is forward, or the speed."
        )
    values = {**vars(stride), "speed": speed, "flat": flat, "raised": raised}
    return Stride(**values)
