"""Zero moment point: where the ground's forces on a foot have no moment (paper eq. 44, 45).

With m_y the moment of the contact forces about +y and about a reference point on the ground, and
f_n their normal component, the zero moment point lies

    p = −m_y / f_n

ahead of that reference point. The paper's m_z turns the other way, counter-clockwise in its
drawing: m_z = −m_y, so that its p_x = m_z / f_y is the same point. Tangential forces act in the
plane of the ground and have no moment about points of it, so that p is the centre of pressure: it
cannot leave the support polygon as long as the ground only pushes, and reaches its edge when the
foot begins to tip.

An impact is a large force over one step, and counts like any other force.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import NDArray

from heelstrike.analysis.motion import Motion
from heelstrike.analysis.support import NOTHING, carrying, single_support
from heelstrike.analysis.wrenches import sole_points
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot
from heelstrike.robot.sole import soles
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.run import Run

if TYPE_CHECKING:
    from heelstrike.analysis.spatial.zero_moment_point import SpatialZeroMomentPoint
    from heelstrike.sim.spatial.run import SpatialRun


@dataclass(frozen=True, eq=False)
class ZeroMomentPoint:
    """Zero moment point of every foot and of the whole robot, row by row.

    Every number is NaN in rows where nothing pushes, per foot or in all. Distances are along the
    ground, positive forward.
    """

    foot: Floats
    """(nt, nf) Zero moment point of each foot, ahead of the foot's reference point: the ankle
    projected onto the sole, and from there onto the ground (m)."""
    foot_margin: Floats
    """(nt, nf) Distance from it to the nearer end of the foot's touching contact points; positive
    inside (m)."""
    total: Floats
    """(nt, 2) Zero moment point of all contact forces, in the world (m). It takes the ground for
    flat under the points that push."""
    margin: Floats
    """(nt,) Distance from it to the nearer end of the support polygon, all touching contact points;
    positive inside (m)."""
    single_support: NDArray[np.bool_]
    """(nt,) Rows in which exactly one foot and nothing else pushes; see
    :func:`heelstrike.analysis.support.single_support`."""

    @property
    def stance(self) -> Floats:
        """Zero moment point of the stance foot in its frame, (nt,); NaN but in single support."""
        alone = np.where(self.single_support[:, None], self.foot, np.nan)
        return np.asarray(np.fmax.reduce(alone, axis=1, initial=np.nan))


@overload
def zero_moment_point(run: Run, *, motion: Motion | None = None) -> ZeroMomentPoint: ...


@overload
def zero_moment_point(run: SpatialRun) -> SpatialZeroMomentPoint: ...


def zero_moment_point(
    run: Run | SpatialRun, *, motion: Motion | None = None
) -> ZeroMomentPoint | SpatialZeroMomentPoint:
    """Locate the zero moment points of a run (paper eq. 44, 45).

    Parameters
    ----------
    run : Run or SpatialRun
        The run.
    motion : Motion, optional
        Its motion, if already at hand; of the plane.

    Returns
    -------
    ZeroMomentPoint or SpatialZeroMomentPoint
        Of each foot and of the whole robot, row by row.
    """
    if isinstance(run.robot, SpatialRobot):
        from heelstrike.analysis.spatial.zero_moment_point import spatial_zero_moment_point

        return spatial_zero_moment_point(run)
    robot, rows = run.robot, len(run.time)
    reference = sole_points(run, motion=motion)
    foot = np.full((rows, len(robot.feet)), np.nan)
    foot_margin = np.full((rows, len(robot.feet)), np.nan)
    for i, each in enumerate(robot.feet):
        pressure = _pressure(run, list(each.contacts), reference[:, i])
        foot[:, i], foot_margin[:, i] = pressure.place, pressure.margin
    total = np.full((rows, 2), np.nan)
    margin = np.full(rows, np.nan)
    if robot.nc:
        pressure = _pressure(run, list(range(robot.nc)), run.contact_point.mean(axis=1))
        total = pressure.origin + pressure.place[:, None] * pressure.tangent
        margin = pressure.margin
    return ZeroMomentPoint(foot, foot_margin, total, margin, single_support(run))


def zero_moment_point_limits(robot: Robot) -> tuple[float, float]:
    """Ends of the sole in the frame of the foot, heel and toe, in m; the tightest of all feet.

    For the paper's robot these are ∓ l_f / 2 = ∓0.1 m (eq. 45). NaN for a robot without feet.

    Parameters
    ----------
    robot : Robot
        The robot.

    Returns
    -------
    tuple of float
        Heel and toe (m).
    """
    if not robot.feet:
        return float("nan"), float("nan")
    each = soles(robot)
    return max(sole.heel for sole in each), min(sole.toe for sole in each)


@dataclass(frozen=True, eq=False)
class _Pressure:
    """Zero moment point ahead of an origin on the ground, its margin, and the ground's tangent."""

    origin: Floats
    tangent: Floats
    place: Floats
    margin: Floats


def _pressure(run: Run, contacts: list[int], reference: Floats) -> _Pressure:
    """Zero moment point of some contact points, from a reference point projected onto the ground.

    The ground is taken for the plane under the contact point that is pressed hardest.
    """
    row = np.arange(len(run.time))
    force = run.world_force[:, contacts]
    points = run.contact_point[:, contacts]
    hardest = run.contact_force[:, contacts, 0].argmax(axis=1)
    normal = run.contact_normal[:, contacts][row, hardest]
    tangent = np.stack((normal[:, 1], -normal[:, 0]), axis=-1)
    height = ((reference - points[row, hardest]) * normal).sum(axis=1)
    height += run.gap[:, contacts][row, hardest]
    origin = reference - height[:, None] * normal
    arm = points - run.gap[:, contacts, None] * normal[:, None] - origin[:, None]
    moment = (arm[..., 1] * force[..., 0] - arm[..., 0] * force[..., 1]).sum(axis=1)
    pressing = np.einsum("tck,tk->t", force, normal)
    loaded = pressing > NOTHING * run.robot.weight
    place = np.full(len(row), np.nan)
    place[loaded] = -moment[loaded] / pressing[loaded]
    along = np.einsum("tck,tk->tc", arm, tangent)
    touching = carrying(run)[:, contacts]
    heel = np.where(touching, along, np.inf).min(axis=1)
    toe = np.where(touching, along, -np.inf).max(axis=1)
    return _Pressure(origin, tangent, place, np.minimum(place - heel, toe - place))
