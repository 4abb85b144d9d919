"""Where points of a robot are and how they move.

A point is given by its link (index, or name of the body) and its place `local` (x, z) in the axes
of that link, in metres. Results are in world axes: x forward, z up, rotations about +y.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.dynamics import kernels
from heelstrike.dynamics.places import write_point_rows
from heelstrike.dynamics.queries.evaluation import Evaluation
from heelstrike.dynamics.queries.query import of_position, of_state
from heelstrike.robot.model import Floats

UP = np.array([0.0, 1.0])
"""Normal of level ground."""


@of_position("(2,) float: World position (x, z), in m; (3,) in space.")
def point_position(at: Evaluation, link: int | str, local: ArrayLike) -> Floats:
    """Where a point of a link is."""
    return at.point(link, local)[1]


@of_state("(3,) float: Along x and z in m/s, and about +y in rad/s; (6,) in space.")
def point_velocity(at: Evaluation, link: int | str, local: ArrayLike) -> Floats:
    """Velocity of a point and angular velocity of its link."""
    return at.filled((3,), kernels.point_velocity, at.work, *at.point(link, local))


@of_position("(3, nv) float: Rows x, z and rotation about +y, in m and 1; (6, nv) in space.")
def point_jacobian(at: Evaluation, link: int | str, local: ArrayLike) -> Floats:
    """Jacobian of a point of a link and of the link's rotation.

    Times v its rows give the velocity of the point and of its link's rotation; its transpose takes
    a force at the point and a moment about +y, (f_x, f_z, m), to the generalised force.
    """
    return at.jacobian(*at.point(link, local))


@of_state("(3,) float: Along x and z in m/s², and about +y in rad/s²; (6,) in space.")
def point_bias_acceleration(at: Evaluation, link: int | str, local: ArrayLike) -> Floats:
    """J̇v of :func:`point_jacobian`: the acceleration at v̇ = 0."""
    return at.bias_acceleration(*at.point(link, local))


@of_position("(k, 2) float: World positions (x, z), in m; (k, 3) in space.")
def contact_positions(at: Evaluation, contacts: Iterable[int | str] | None = None) -> Floats:
    """Where the centres of the contact discs are."""
    centers = [center for _, _, center in at.contact_centers(contacts)]
    return np.array(centers).reshape(-1, at.model.axes)


@of_position(
    "(k, 2, nv) float: Rows normal (up) and tangent (forward), in m and 1; (k, 3, nv) in space."
)
def contact_jacobian(at: Evaluation, contacts: Iterable[int | str] | None = None) -> Floats:
    """Jacobian of the contact points on level ground: of the lowest point of each contact disc."""
    found = at.contact_centers(contacts)
    result = at.zeros(len(found), at.model.axes, at.model.nv)
    for rows, (i, link, lowest) in zip(result, found, strict=True):
        lowest[-1] -= at.model.contact_radius[i]
        at.run(write_point_rows, at.model, at.work, link, lowest, UP, 0, rows)
    return result


@of_state("(k, 2) float: Normal (up) and tangential (forward), in m/s²; (k, 3) in space.")
def contact_bias_acceleration(
    at: Evaluation, contacts: Iterable[int | str] | None = None
) -> Floats:
    """J̇v of :func:`contact_jacobian`.

    It belongs to the gap and to the sliding velocity of each disc: a disc that rolls on the ground
    has neither, although the material point that touches is drawn towards the disc's centre.
    """
    found = at.contact_centers(contacts)
    result = at.zeros(len(found), at.model.axes)
    for row, (i, link, center) in zip(result, found, strict=True):
        x, z, turn = at.bias_acceleration(link, center)
        row[:] = z, x - at.model.contact_radius[i] * turn
    return result
