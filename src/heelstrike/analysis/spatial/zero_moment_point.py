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
from heelstrike.analysis.spatial.support import carrying, plane_of, support_polygon
from heelstrike.analysis.support import NOTHING
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


def spatial_zero_moment_point(run: SpatialRun) -> SpatialZeroMomentPoint:
    """Locate the zero moment points of a run in space; see :func:`zero_moment_point`."""
    rows, feet = len(run.time), run.robot.feet
    foot = np.full((rows, len(feet), 3), np.nan)
    total, capture = np.full((rows, 3), np.nan), np.full((rows, 3), np.nan)
    margin = np.full(rows, np.nan)
    force, least = run.world_force, NOTHING * run.robot.weight
    motion = centroidal_motion(run)
    velocity = motion.momentum[:, :3] / run.robot.total_mass
    gravity = float(np.linalg.norm(run.robot.model.gravity))
    for row, touching in enumerate(carrying(run)):
        if not touching.any():
            continue
        origin, axes = plane_of(run, row, touching)
        every = np.arange(run.robot.nc)
        total[row] = _place(run, row, every, force, origin, axes[0], least)
        margin[row] = support_polygon(run, row).margin(total[row])
        capture[row] = _capture(motion.center_of_mass[row], velocity[row], gravity, origin, axes[0])
        for i, each in enumerate(feet):
            own = np.array(each.contacts)
            if touching[own].any():
                foot[row, i] = _place(run, row, own, force, origin, axes[0], least)
    return SpatialZeroMomentPoint(foot, total, margin, capture)


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
