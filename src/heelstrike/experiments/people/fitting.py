"""Inverse kinematics over time: the smooth motion of a human nearest to recorded markers.

All coordinates are splines of degree 5; their coefficients are those of least squared distances
between the markers and their places on the human, over the whole recording at once (Gauss and
Newton's steps, with the exact Jacobians of the places).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.dynamics import point_jacobian, point_position
from heelstrike.errors import GaitError
from heelstrike.experiments.people.body import BodyMotion
from heelstrike.experiments.people.person import Person
from heelstrike.experiments.people.splines import Splines
from heelstrike.gait.recordings.markers import RecordedMarkers
from heelstrike.robot.model import Floats

MOST_STEPS = 30
"""Gauss-Newton steps that are tried."""
SMALL = 1e-10
"""Change of a coordinate (m, rad) below which the search ends."""
DAMPING = 1e-9
"""Weight of a change beside that of a marker, so that what no marker tells does not move."""


def fit_markers(person: Person, markers: RecordedMarkers) -> BodyMotion:
    """Find the motion of a human nearest to markers.

    Parameters
    ----------
    person : Person
        The human and where the markers are on it.
    markers : RecordedMarkers
        The markers.

    Returns
    -------
    BodyMotion
        The motion. Coordinates of a leg without markers rest.

    Raises
    ------
    GaitError
        If the search does not end.
    """
    from scipy.sparse import block_diag, eye, kron
    from scipy.sparse.linalg import spsolve

    robot, splines = person.robot, Splines(markers.time)
    names = [name for name in markers.names if name in person.places]
    target = np.stack([markers.of(name) for name in names], axis=1)
    seen = np.asarray(np.isfinite(target).all(axis=2))
    moving = _moving(person)
    coefficients = splines.fitted(_drawn(person, markers))
    basis = kron(splines.matrix, eye(len(moving)), format="csr")
    for _ in range(MOST_STEPS):
        q = splines.values(coefficients)
        rows, missing = _linearized(person, q, names, target, seen, moving)
        slopes: Any = block_diag(rows, format="csr") @ basis
        normal = slopes.T @ slopes + DAMPING * eye(slopes.shape[1])
        step = np.asarray(spsolve(normal.tocsc(), slopes.T @ missing.ravel()))
        coefficients[:, moving] += step.reshape(splines.size, len(moving))
        if np.abs(step).max() < SMALL:
            break
    else:
        raise GaitError(
            "no motion of the human was found that comes near the markers; is each of them what "
            "its name says?"
        )
    q = splines.values(coefficients)
    _, missing = _linearized(person, q, names, target, seen, moving)
    squares = (missing.reshape(len(q), len(names), 2) ** 2).sum(axis=2)
    residual = np.sqrt(squares.sum(axis=0) / np.maximum(seen.sum(axis=0), 1))
    v, acceleration = (splines.values(coefficients, order) for order in (1, 2))
    return BodyMotion(
        robot, markers.time, q, v, acceleration, person.sides,
        {name: float(each) for name, each in zip(names, residual, strict=True)}, markers.begin,
    )  # fmt: skip


def _moving(person: Person) -> list[int]:
    """Coordinates that markers tell of."""
    names = person.robot.joint_names
    return [k for k, name in enumerate(names) if k < 3 or name.startswith(person.sides)]


def _linearized(
    person: Person, q: Floats, names: list[str], target: Floats,
    seen: NDArray[np.bool_], moving: list[int],
) -> tuple[list[Floats], Floats]:  # fmt: skip
    """Jacobians of all places at every instant, and what is missing of the markers (n, 2 m)."""
    rows, missing = [], np.zeros((len(q), 2 * len(names)))
    for i, posture in enumerate(q):
        slopes = np.zeros((2 * len(names), len(moving)))
        for k, name in enumerate(names):
            if seen[i, k]:
                link, local = person.places[name]
                at = slice(2 * k, 2 * k + 2)
                slopes[at] = point_jacobian(person.robot, posture, link, local)[:2, moving]
                missing[i, at] = target[i, k] - point_position(person.robot, posture, link, local)
        rows.append(slopes)
    return rows, missing


def _drawn(person: Person, markers: RecordedMarkers) -> Floats:
    """Positions to begin with, (n, nq), from the directions of lines between markers."""
    robot, index = person.robot, person.robot.joint_names.index
    q = np.tile(robot.reference_state().q, (len(markers.time), 1))
    q[:, :2] = _filled(markers.of(f"{person.sides[0]}_hip"), markers.time)
    above = next(name for name in person.places if name.startswith(("trunk", "right_s", "left_s")))
    lean = _filled(markers.of(above), markers.time) - q[:, :2]
    q[:, 2] = np.arctan2(lean[:, 0], lean[:, 1])
    for side in person.sides:
        points = [
            _filled(markers.of(f"{side}_{name}"), markers.time)
            for name in ("hip", "knee", "ankle", "heel", "toe")
        ]
        hip, knee, ankle, heel, toe = points
        thigh, shank = (
            np.unwrap(np.arctan2(-along[:, 0], -along[:, 1]))
            for along in (knee - hip, ankle - knee)
        )
        flat = person.places[f"{side}_toe"][1] - person.places[f"{side}_heel"][1]
        sole = toe - heel
        foot = np.arctan2(flat[1], flat[0]) - np.unwrap(np.arctan2(sole[:, 1], sole[:, 0]))
        q[:, index(f"{side}_hip")] = thigh - q[:, 2]
        q[:, index(f"{side}_knee")] = shank - thigh
        q[:, index(f"{side}_ankle")] = foot - shank
    return q


def _filled(places: Floats, time: Floats) -> Floats:
    """Places with those that were not seen drawn between the others."""
    seen = np.isfinite(places).all(axis=1)
    return np.column_stack([np.interp(time, time[seen], each[seen]) for each in places.T])
