"""The gait as a reference for the whole body: what hip, trunk, swing foot and joints do a step.

All places are relative to the middle of the stance sole, on level ground, as functions of the
phase σ, which goes from 0 at one touchdown to 1 at the next.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, array, number
from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics import (
    center_of_mass,
    center_of_mass_velocity,
    inverse_dynamics,
    link_poses,
    passive_force,
    point_position,
)
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.held import HeldRobot, Place
from heelstrike.gait.gait import Gait
from heelstrike.gait.sole import Sole, leg, sole
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

PIECES = 48
"""Cubic pieces that a step is made of."""


class Reference(Bundle):
    """A step of a gait, in cubic pieces of the phase, lowest power first."""

    hip: Floats = array("pieces", 4)
    """Height of the stance leg's hip (m)."""
    pitch: Floats = array("pieces", 4)
    """Rotation of the trunk about +y (rad)."""
    swing_x: Floats = array("pieces", 4)
    swing_z: Floats = array("pieces", 4)
    swing_angle: Floats = array("pieces", 4)
    """swing_x, swing_z, swing_angle: Place of the middle of the swing sole (m), and how far it is
    from flat (rad)."""
    pressure: Floats = array("pieces", 4)
    """Centre of pressure along the stance sole (m)."""
    capture: Floats = array("pieces", 4)
    """Capture point x + ẋ/ω (m)."""
    joints: Floats = array(2, "pieces", "nu", 4)
    """The joints, for either stance foot (rad)."""
    length: float = number(float)
    duration: float = number(float)
    """length, duration: Of a step (m, s)."""
    rate: float = number(float)
    """ω = √(g/z) of the capture point (1/s)."""
    end: float = number(float)
    """Capture point at the end of the step (m)."""


@kernel
def piece_of(table: Floats, phase: float) -> tuple[int, float]:
    """Return the piece that holds at a phase, and how far in it that is, from 0 to 1."""
    pieces = table.shape[0]
    place = phase * pieces
    piece = min(max(int(place), 0), pieces - 1)
    return piece, place - piece


@kernel
def value_at(table: Floats, phase: float) -> float:
    """Value of a cubic of the reference."""
    i, s = piece_of(table, phase)
    return table[i, 0] + s * (table[i, 1] + s * (table[i, 2] + s * table[i, 3]))


@kernel
def slope_at(table: Floats, phase: float) -> float:
    """Its derivative by the phase."""
    i, s = piece_of(table, phase)
    return table.shape[0] * (table[i, 1] + s * (2.0 * table[i, 2] + s * 3.0 * table[i, 3]))


@kernel
def curvature_at(table: Floats, phase: float) -> float:
    """Its second derivative by the phase."""
    i, s = piece_of(table, phase)
    return table.shape[0] ** 2 * (2.0 * table[i, 2] + s * 6.0 * table[i, 3])


def reference_of(robot: Robot, gait: Gait) -> Reference:
    """Find the reference of a gait on flat feet."""
    feet = (sole(robot, gait.stance_foot), sole(robot, 1 - gait.stance_foot))
    phases = np.linspace(0.0, 1.0, PIECES + 1)
    rows = [_instant(robot, gait, feet, phase * gait.step_duration) for phase in phases]
    course = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    rate = sqrt(-robot.model.gravity[1] / float(course["height"].mean()))
    capture = course["x"] + course["speed"] / rate
    joints = gait.in_step(phases * gait.step_duration)
    either = [joints, gait.mirrored(joints)]
    if gait.stance_foot:
        either.reverse()
    tables: dict[str, Any] = {
        name: _cubics(phases, course[name])
        for name in ("hip", "pitch", "swing_x", "swing_z", "swing_angle", "pressure")
    }
    return Reference(
        **tables,
        capture=_cubics(phases, capture),
        joints=np.array([_cubics(phases, side) for side in either]),
        length=gait.step_length,
        duration=gait.step_duration,
        rate=rate,
        end=float(capture[-1]),
    )  # fmt: skip


def _cubics(phases: Floats, values: Floats) -> Floats:
    """Coefficients of a spline, (pieces, ..., 4), in the part of each piece that has gone by."""
    from scipy.interpolate import CubicSpline  # takes half a second to import

    spline = CubicSpline(phases, values)
    width = (phases[1] - phases[0]) ** np.arange(4)
    coefficients = np.moveaxis(spline.c[::-1], 0, -1) * width
    return np.ascontiguousarray(coefficients)


def _on(robot: Robot, q: Floats, v: Floats, stance: Sole) -> HeldRobot:
    """The robot with its stance sole held."""
    at = Evaluation(robot, q, v)
    link, position = at.point(stance.link, stance.point)
    return HeldRobot(at, [Place(link, position, position, 3)])


def _instant(robot: Robot, gait: Gait, feet: tuple[Sole, Sole], t: float) -> dict[str, float]:
    """What the gait does at a time of its first step."""
    stance, swing = feet
    joints = robot.model.actuator_joint
    q = robot.model.reference.copy()
    q[joints] = gait.in_step(t)
    sign = robot.model.axis[2, 0]
    q[2] += sign * (stance.angle - link_poses(robot, q).angle[stance.link])
    q[:2] -= point_position(robot, q, stance.link, stance.point)
    v, acceleration = np.zeros(robot.nv), np.zeros(robot.nv)
    v[joints] = gait.in_step(t, order=1)
    v = _on(robot, q, v, stance).velocity(v)
    acceleration[joints] = gait.in_step(t, order=2)
    on = _on(robot, q, v, stance)
    acceleration = on.acceleration(acceleration)
    force = inverse_dynamics(robot, q, v, acceleration) - passive_force(robot, q, v)
    wrench, _ = on.reaction(force)
    poses = link_poses(robot, q)
    x, height = center_of_mass(robot, q)
    foot = point_position(robot, q, swing.link, swing.point)
    return {
        "x": float(x),
        "height": float(height),
        "speed": float(center_of_mass_velocity(robot, q, v)[0]),
        "hip": float(poses.origin[leg(robot, stance)[-1], 1]),
        "pitch": float(poses.angle[2]),
        "swing_x": float(foot[0]),
        "swing_z": float(foot[1]),
        "swing_angle": float(poses.angle[swing.link] - swing.angle),
        "pressure": float(-wrench[2] / wrench[1]),
    }
