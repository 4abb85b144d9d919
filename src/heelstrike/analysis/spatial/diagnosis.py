"""Why a robot in space fell, and how close it came to its limits, in the words of the plane."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.diagnosis.falls import SUNK, Fall, fall_of
from heelstrike.analysis.diagnosis.limits import (
    Limit,
    limit_of_friction,
    limit_of_pressure,
    limit_of_range,
    of_motors,
    ordered,
)
from heelstrike.analysis.diagnosis.symptoms import (
    BRIEF,
    HELD_UNSEEN,
    ROLLING,
    SLID,
    SLOW,
    STEP_OF_HEIGHT,
    Cause,
    Symptom,
    full_torque,
    spells,
)
from heelstrike.analysis.spatial.friction import face_friction, foot_friction
from heelstrike.analysis.spatial.links import link_motion
from heelstrike.analysis.spatial.zero_moment_point import (
    SpatialZeroMomentPoint,
    spatial_zero_moment_point,
)
from heelstrike.analysis.support import pushing
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.model import HINGE, SLIDE
from heelstrike.sim.closed_sets import RunStatus
from heelstrike.sim.spatial.run import SpatialRun

Rows = NDArray[np.bool_]

LOOKED_AT = 600
"""Rows of a run in which the zero moment point is looked for: more in a long run."""
AT_THE_EDGE = 2e-3
"""Distance of the zero moment point from the edge of the support polygon at which a robot tips, in
heights of the centre of mass."""


def spatial_limits(run: SpatialRun, *, until: float = math.inf) -> tuple[Limit, ...]:
    """List the limits of a run in space; see :func:`heelstrike.analysis.diagnosis.limits.limits`.

    Parameters
    ----------
    run : SpatialRun
        The run.
    until : float
        Rows after this time (s) are left out, such as those of a fall.

    Returns
    -------
    tuple of Limit
        Friction of each foot, the zero moment point in the support polygon, torque and speed of
        each motor, and the range of each joint that has ends.
    """
    shown = run.time <= until
    return ordered(_limits(run, shown) if shown.any() else ())


def _limits(run: SpatialRun, shown: Rows) -> Iterator[Limit]:
    time, robot, model = run.time, run.robot, run.robot.model
    friction = face_friction(run)
    for foot in robot.feet:
        share, coefficient = foot_friction(run, friction, foot.contacts)
        yield from limit_of_friction(time, foot.name, share, coefficient, shown)
    rows, zmp = _looked_at(run)
    room = np.array([_room(polygon) for polygon in zmp.polygon])
    yield from limit_of_pressure(
        time[rows], "", zmp.margin, room, shown[rows], edge="the edge of the support polygon"
    )
    yield from of_motors(run, shown)
    for joint, kind in enumerate(model.joint_kind.tolist()):
        if kind in (HINGE, SLIDE):
            angle = run.position[:, int(model.first_position[joint])]
            span = float(model.lower[joint]), float(model.upper[joint])
            name = robot.joint_names[joint]
            yield from limit_of_range(time, name, angle, span, shown, hinge=kind == HINGE)


def _looked_at(run: SpatialRun) -> tuple[Integers, SpatialZeroMomentPoint]:
    """Rows in which the zero moment point is looked for, evenly spread, and where it is."""
    lasts = float(run.time[-1] - run.time[0])
    most = max(LOOKED_AT, int(lasts / (0.5 * BRIEF)))  # no further apart than a tip is looked for
    every = max(1, -(-len(run.time) // most))
    rows = np.arange(0, len(run.time), every)
    return rows, spatial_zero_moment_point(run, rows)


def _room(polygon: Floats) -> float:
    """Distance of the middle of a polygon's corners from its nearest edge, in m."""
    if len(polygon) < 3:
        return 0.0
    edge = np.roll(polygon, -1, axis=0) - polygon
    away = polygon.mean(axis=0) - polygon
    length = np.linalg.norm(edge, axis=1)
    apart = np.linalg.norm(np.cross(edge, away), axis=1) / np.where(length > 0.0, length, np.inf)
    return float(apart[length > 0.0].min())


def first_cause_in_space(run: SpatialRun) -> Fall | None:
    """Say why a robot in space fell; see :func:`~heelstrike.analysis.diagnosis.falls.first_cause`.

    Parameters
    ----------
    run : SpatialRun
        The run.

    Returns
    -------
    Fall or None
        Nothing if the run lasted as long as it was asked to and the robot is still up.
    """
    if not len(run.time) or run.status is RunStatus.INTERRUPTED:
        return None
    height, center = _heights(run)
    pace = float(np.sqrt(height[0] / max(np.linalg.norm(run.robot.model.gravity), 1e-9)))
    step = STEP_OF_HEIGHT * pace
    late = run.time >= run.time[-1] - step
    stands = run.robot.floating and bool(run.robot.feet)
    if run.completed and not (stands and height[late].min() < SUNK * height[0]):
        return None
    found = sorted(_symptoms(run, float(height[0]), pace, center), key=lambda each: each.time)
    if any(each.cause is not Cause.JOINT_STOP for each in found):
        found = [each for each in found if each.cause is not Cause.JOINT_STOP]
    return fall_of(run, tuple(found), step)


def _heights(run: SpatialRun) -> tuple[Floats, Floats]:
    """Height (nt,) of the centre of mass over the plane of the ground, and its place (nt, 3)."""
    center = link_motion(run).center_of_mass
    normal = np.asarray(run.ground.normal)
    height = center @ normal - normal[2] * run.ground.height
    return np.maximum(height, 1e-3), center


def _symptoms(run: SpatialRun, height: float, pace: float, center: Floats) -> Iterator[Symptom]:
    time = run.time
    end = float(time[-1])
    if run.status in (RunStatus.SOLVER_FAILED, RunStatus.DIVERGED):
        yield Symptom(Cause.NUMERICAL, end, end)
    if run.status is RunStatus.CONTROLLER_FAILED:
        yield Symptom(Cause.CONTROLLER, end, end)
    yield from _slips(run, height, pace)
    yield from _tips(run, height, center)
    model = run.robot.model
    full, bound, by_speed = full_torque(run)
    for i, name in enumerate(run.robot.actuator_names):
        for a, b in _lasting(time, full[:, i], HELD_UNSEEN):
            cause = Cause.SPEED_LIMIT if by_speed[a, i] else Cause.TORQUE_LIMIT
            told = {"limit_Nm": float(bound[a, i]), "missed_rad": 0.0}
            yield Symptom(cause, float(time[a]), float(time[b]), name, told)
    for joint, name in enumerate(run.robot.joint_names):
        pressed = (run.stop_torque[:, model.velocity_joint == joint] != 0.0).any(axis=1)
        for a, b in _lasting(time, pressed, HELD_UNSEEN):
            yield Symptom(Cause.JOINT_STOP, float(time[a]), float(time[b]), name)


def _slips(run: SpatialRun, height: float, pace: float) -> Iterator[Symptom]:
    """Feet that slide while they press."""
    pressed = pushing(run)
    speed = np.where(pressed, np.linalg.norm(run.slip, axis=-1), 0.0)
    held = np.diff(run.time, append=run.time[-1:])
    friction = face_friction(run)
    for foot in run.robot.feet:
        fastest = speed[:, list(foot.contacts)].max(axis=1)
        for a, b in _lasting(run.time, fastest > SLOW * height / pace, 0.0):
            slid = float((fastest[a : b + 1] * held[a : b + 1]).sum())
            if slid >= SLID * height:
                _, coefficient = foot_friction(run, friction, foot.contacts)
                known = np.isfinite(coefficient[a])
                told = {"distance_m": slid} | ({"friction": float(coefficient[a])} if known else {})
                yield Symptom(
                    Cause.SLIPPED, float(run.time[a]), float(run.time[b]), foot.name, told
                )


def _tips(run: SpatialRun, height: float, center: Floats) -> Iterator[Symptom]:
    """Stretches in which the zero moment point stays at the edge of the support polygon."""
    rows, zmp = _looked_at(run)
    time = run.time[rows]
    with np.errstate(invalid="ignore"):
        edge = zmp.margin < AT_THE_EDGE * height
    for a, b in _lasting(time, edge, ROLLING):
        moved = center[rows[b]] - zmp.polygon[a].mean(axis=0)
        heading = _heading(run, int(rows[a]))
        ahead = moved[0] * heading[0] + moved[1] * heading[1]
        aside = moved[1] * heading[0] - moved[0] * heading[1]
        if abs(aside) > abs(ahead):
            cause = Cause.TIPPED_SIDEWAYS
        else:
            cause = Cause.TIPPED_FORWARD if ahead > 0.0 else Cause.TIPPED_BACK
        yield Symptom(cause, float(time[a]), float(time[b]), "", {"left_m": float(aside)})


def _heading(run: SpatialRun, row: int) -> Floats:
    """Where a robot looks along the ground: the x axis of a floating base, or x."""
    if not run.robot.floating:
        return np.array([1.0, 0.0])
    w, x, y, z = run.position[row, 3:7]
    ahead = np.array([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)])
    size = float(np.linalg.norm(ahead))
    return ahead / size if size > 0.0 else np.array([1.0, 0.0])


def _lasting(time: Floats, holds: Rows, least: float) -> list[tuple[int, int]]:
    """First and last rows of the stretches in which something holds so long (s)."""
    return [(a, b) for a, b in spells(time, holds) if time[b] - time[a] >= least]
