"""Zero moment point in space: where the ground's forces have no moment along the ground.

With F the sum of the contact forces and M their moment about a point O of the ground whose normal
is n, the zero moment point is

    p = O + (n × M) / (n · F),

about which the moment of the forces is along n alone. As long as the ground is a plane and only
pushes, it is the centre of pressure, and inside the support polygon.
"""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.spatial.motion import centroidal_motion
from heelstrike.analysis.spatial.support import plane_of, polygon_of
from heelstrike.analysis.support import NOTHING, carrying
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.sim.spatial.run import SpatialRun


@dataclass(frozen=True, eq=False)
class SpatialZeroMomentPoint:
    """Zero moment point of every foot and of a whole robot in space, row by row.

    Every number is NaN in rows where nothing pushes, per foot or in all.
    """

    foot: Floats
    """(nt, nf, 3) Zero moment point of each foot, in the world (m)."""
    total: Floats
    """(nt, 3) Zero moment point of all contact forces, in the world (m). It takes the ground for
    the plane under the point that is pressed hardest."""
    margin: Floats
    """(nt,) Distance from it to the nearest edge of the support polygon, positive inside (m)."""
    capture_point: Floats
    """(nt, 3) Where the robot, as a pendulum of the length that its centre of mass is above the
    ground, would have to step to come to rest, on that plane (m)."""
    polygon: tuple[Floats, ...]
    """(k, 3) Corners of the support polygon of each row, in the world (m); of one or two points
    these, of none nothing."""


def spatial_zero_moment_point(
    run: SpatialRun, rows: Integers | None = None
) -> SpatialZeroMomentPoint:
    """Locate the zero moment points of a run in space, or of some of its rows.

    See :func:`~heelstrike.analysis.zero_moment_point`.
    """
    chosen = np.arange(len(run.time)) if rows is None else rows
    count, feet = len(chosen), run.robot.feet
    foot = np.full((count, len(feet), 3), np.nan)
    total, capture = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    margin = np.full(count, np.nan)
    force, least = run.world_force, NOTHING * run.robot.weight
    motion = centroidal_motion(run)
    velocity = motion.momentum[:, :3] / run.robot.total_mass
    gravity = float(np.linalg.norm(run.robot.model.gravity))
    polygons: list[Floats] = [np.zeros((0, 3))] * count
    carried = carrying(run)
    for at, row in enumerate(chosen.tolist()):
        touching = carried[row]
        if not touching.any():
            continue
        origin, axes = plane_of(run, row, touching)
        every = np.arange(run.robot.nc)
        total[at] = _place(run, row, every, force, origin, axes[0], least)
        polygon = polygon_of(run, row, touching)
        polygons[at], margin[at] = polygon.world, polygon.margin(total[at])
        capture[at] = _capture(motion.center_of_mass[row], velocity[row], gravity, origin, axes[0])
        for i, each in enumerate(feet):
            own = np.array(each.contacts)
            if touching[own].any():
                foot[at, i] = _place(run, row, own, force, origin, axes[0], least)
    return SpatialZeroMomentPoint(foot, total, margin, capture, tuple(polygons))


def _place(
    run: SpatialRun, row: int, contacts: Integers, force: Floats, origin: Floats, normal: Floats,
    least: float,
) -> Floats:  # fmt: skip
    """Zero moment point of some contact forces on the plane of an origin and a normal."""
    own = force[row, contacts]
    pressing = float(own.sum(axis=0) @ normal)
    if not pressing > least:
        return np.full(3, np.nan)
    arm = run.contact_point[row, contacts] - origin
    moment = np.cross(arm, own).sum(axis=0)
    return np.asarray(origin + np.cross(normal, moment) / pressing)


def _capture(
    center: Floats, velocity: Floats, gravity: float, origin: Floats, normal: Floats
) -> Floats:
    """Capture point of the linear inverted pendulum, on the plane of an origin and a normal."""
    height = float((center - origin) @ normal)
    if not (height > 0.0 and gravity > 0.0):
        return np.full(3, np.nan)
    ahead = velocity - (velocity @ normal) * normal
    return np.asarray(center - height * normal + ahead * np.sqrt(height / gravity))
