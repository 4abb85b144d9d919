"""When a robot stands on one flat foot, as its joints tell, and forces where they are measured."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.compilation import kernel
from heelstrike.dynamics.kernels import forward_kinematics, point_position
from heelstrike.dynamics.workspace import Workspace
from heelstrike.experiments.identification.equations import Equations
from heelstrike.experiments.people.splines import DEGREE
from heelstrike.field_texts import dataclass
from heelstrike.gait.recordings.robot_log import RobotLog
from heelstrike.robot.model import Floats, Model

LIFTED = 4e-3
"""Height (m) of the other foot above which a robot stands on one: soles of files are flat to a
tenth of that, and noise of encoders moves a foot by less."""
SHORTEST = 0.12
"""Shortest time (s) that is looked at in one piece."""
LONGEST = 1.0
"""About how long (s) a piece is at most: the work grows with the square of that."""
PRESSED = 5.0
"""Standard deviations of a measured force by which a contact point presses."""
LEAST_SAMPLES = 2 * DEGREE
"""Least samples of a piece: its splines have fewer coefficients then."""
EDGE = 0.01
"""Time (s) at either end of a piece that is left out: the ends of impacts."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Samples in a row within which nothing is hit and one foot, if any, stands flat."""

    foot: int | None
    """The foot; None of a robot that stands fixed."""
    first: int
    end: int
    """first, end: First sample, and that after the last."""


def pieces_of(
    equations: Equations, log: RobotLog, force_noise: float, slides: NDArray[np.bool_] | None = None
) -> tuple[Piece, ...]:
    """Find the pieces of a motion in which its equations are known.

    Parameters
    ----------
    equations : Equations
        The equations of the robot.
    log : RobotLog
        The motion.
    force_noise : float
        Standard deviation of measured forces (N).
    slides : (n, nc) array, optional
        Which contact points slide, if that is known.
    """
    if not equations.first:
        return tuple(_parted(log.time, Piece(None, 0, len(log.time))))
    found: list[Piece] = []
    for foot, own in enumerate(equations.soles):
        stands = _stands(equations, log, foot, force_noise)
        if slides is not None:
            stands &= ~slides[:, list(own.contacts)].any(axis=1)
        for piece in _runs(log.time, stands, foot):
            found += _parted(log.time, piece)
    return tuple(found)


def _parted(time: Floats, piece: Piece) -> list[Piece]:
    """Part a piece into some that are short enough; without those of too few samples."""
    lasts = float(time[piece.end - 1] - time[piece.first])
    ends = time[piece.first] + np.linspace(0.0, lasts, max(round(lasts / LONGEST), 1) + 1)
    rows = np.searchsorted(time[piece.first : piece.end], ends[1:-1]) + piece.first
    bounds = [piece.first, *rows.tolist(), piece.end]
    return [
        Piece(piece.foot, first, end)
        for first, end in pairwise(bounds)
        if end - first >= LEAST_SAMPLES
    ]


@kernel
def find_points_along(model: Model, q: Floats, work: Workspace, points: Floats) -> None:
    """Write centres (n, nc, 2) of the contact points at positions (n, nq)."""
    for i in range(q.shape[0]):
        forward_kinematics(model, q[i], work)
        for contact in range(model.nc):
            link, local = model.contact_link[contact], model.contact_position[contact]
            point_position(work, link, local, points[i, contact])


def heights(equations: Equations, joints: Floats, foot: int) -> Floats:
    """Heights (n, nc) of the contact points above the sole that one foot stands on, in m."""
    model = equations.robot.model
    constant, matrix = equations.turned(foot)
    points = np.zeros((len(joints), model.nc, 2))
    work = Workspace.allocate({**model.extents, "components": 2})
    find_points_along(model, constant + joints @ matrix.T, work, points)
    found = points[:, :, 1] - model.contact_radius
    lowest: Floats = found[:, list(equations.soles[foot].contacts)].min(axis=1)
    return found - lowest[:, None]


def _stands(
    equations: Equations, log: RobotLog, foot: int, force_noise: float
) -> NDArray[np.bool_]:
    """When the robot stands flat on one foot alone."""
    robot = equations.robot
    above = heights(equations, log.joints, foot)
    others = [i for i in range(robot.nc) if i not in equations.soles[foot].contacts]
    alone: NDArray[np.bool_] = above[:, others].min(axis=1) > LIFTED
    if log.force is not None:
        own = list(robot.feet[foot].contacts)
        least = PRESSED * force_noise
        normal = log.force[:, :, 0]
        ends = normal[:, [own[0], own[-1]]].min(axis=1)
        alone &= (ends > least) & (normal[:, others].max(axis=1) < least)
    return alone


def _runs(time: Floats, stands: NDArray[np.bool_], foot: int) -> Iterator[Piece]:
    """Yield pieces that are long enough, without their edges."""
    changes = np.flatnonzero(np.diff(stands.astype(int))) + 1
    for rows in np.split(np.arange(len(time)), changes):
        if stands[rows[0]] and time[rows[-1]] - time[rows[0]] >= SHORTEST:
            inner = (time[rows] >= time[rows[0]] + EDGE) & (time[rows] <= time[rows[-1]] - EDGE)
            yield Piece(foot, int(rows[inner][0]), int(rows[inner][-1]) + 1)
