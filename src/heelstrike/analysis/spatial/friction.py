"""How much of their friction contact points in space use, on the faces that they stand on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.sim.spatial.space import SpatialLook


def face_friction(run: SpatialRun, rows: Integers | None = None) -> Floats:
    """Find the coefficient of friction of the face under each contact point.

    Parameters
    ----------
    run : SpatialRun
        The run.
    rows : (n,) int, optional
        Rows of it; all by default.

    Returns
    -------
    (n, nc) float
        That of the plane or of a box, as the point has it; NaN of a point that is at a wall too,
        whose force is a sum of two.
    """
    chosen = np.arange(len(run.time)) if rows is None else rows
    robot, ground = run.robot, run.ground
    if not ground.boxes:
        same = ground.friction * robot.model.friction_scale
        return np.broadcast_to(same, (len(chosen), robot.nc))
    look = SpatialLook(robot)
    after = np.minimum(chosen + 1, len(run.time) - 1)
    seen = {
        row: look.friction(ground, run.position[row], run.velocity[row])
        for row in np.union1d(chosen, after).tolist()
    }
    # The force of a row acts until the next: a point that is at a wall by then may have met it.
    here, later = ([seen[row] for row in which.tolist()] for which in (chosen, after))
    return np.where(np.isnan(later), np.nan, here).reshape(len(chosen), robot.nc)


def friction_used(
    normal: Floats, sideways: Floats, friction: Floats, least: float
) -> tuple[Floats, Floats]:
    """Return what share of their friction some contact points use together, and its coefficient.

    Parameters
    ----------
    normal : (n, k) float
        Normal forces, in N.
    sideways : (n, k, d) float
        Forces along the ground, in N.
    friction : (n, k) float
        Coefficients.
    least : float
        Friction (N) from which on they are pressed.

    Returns
    -------
    share, coefficient : (n,) float
        NaN where nothing presses, or a point that does is at a wall. The coefficient is the mean,
        by normal forces.
    """
    allowed = np.where(normal > 0.0, normal * friction, 0.0).sum(axis=1)
    pressed = allowed > least
    total = np.where(pressed, allowed, np.nan)
    share = np.linalg.norm(sideways.sum(axis=1), axis=-1) / total
    with np.errstate(divide="ignore", invalid="ignore"):
        return share, total / normal.sum(axis=1)


def foot_friction(
    run: SpatialRun, friction: Floats, contacts: Sequence[int]
) -> tuple[Floats, Floats]:
    """Share and coefficient (nt,) of the friction of some points; see :func:`friction_used`.

    Parameters
    ----------
    run : SpatialRun
        The run.
    friction : (nt, nc) float
        Coefficients, of :func:`face_friction`.
    contacts : sequence of int
        The points.

    Returns
    -------
    share, coefficient : (nt,) float
        NaN in the air, and at walls.
    """
    own = list(contacts)
    force = run.contact_force[:, own]
    return friction_used(force[..., 0], force[..., 1:], friction[:, own], 1e-6 * run.robot.weight)
