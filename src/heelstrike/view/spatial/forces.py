"""Which contact forces of a robot in space a picture shows: of each point, or of each link.

Feet of meshes have dozens of points, whose arrows would hide the robot. Of such a robot a picture
shows the force on each link, at its centre of pressure.
"""

from __future__ import annotations

import numpy as np

from heelstrike.analysis.intervals import mean_between
from heelstrike.analysis.support import on_ground
from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Integers
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.spatial.run import SpatialRun

MOST_ARROWS = 24
"""Contact points that a robot may have for each to have an arrow."""


@dataclass(frozen=True, eq=False)
class ShownForces:
    """Mean forces from each row shown to the next, of groups of contact points."""

    place: Floats
    """(n, ng, 3) Where each acts: the centre of pressure of the group, in m."""
    force: Floats
    """(n, ng, 3) Force on the robot in world axes, in N."""
    normal: Floats
    """(n, ng) Its part along the normals of the ground, in N."""


def force_groups(robot: SpatialRobot) -> list[Integers]:
    """Contact points whose forces are shown by one arrow, group by group."""
    if robot.nc <= MOST_ARROWS:
        return [np.array([contact]) for contact in range(robot.nc)]
    links = robot.model.contact_link
    return [np.flatnonzero(links == link) for link in np.unique(links)]


def group_names(robot: SpatialRobot) -> list[str]:
    """Names of these groups."""
    if robot.nc <= MOST_ARROWS:
        return list(robot.contact_names)
    return [robot.link_names[link] for link in np.unique(robot.model.contact_link).tolist()]


def shown_forces(run: SpatialRun, rows: Integers, *, since: bool = False) -> ShownForces:
    """Take the mean forces of each group over the time from each row to the next.

    What pushes for one step between two rows is seen with its impulse. A row that has the time of
    the next, and the last, has its own force.

    Parameters
    ----------
    run : SpatialRun
        The run.
    rows : (n,) int
        Rows in the order of time.
    since : bool
        Whether the means are those since the row before instead.
    """
    groups = force_groups(run.robot)
    count = len(run.time)
    force, places, pressed = run.world_force, on_ground(run), run.contact_force[..., 0]
    acting = np.zeros((count, len(groups), 7))
    middle = np.zeros((len(rows), len(groups), 3))
    for g, group in enumerate(groups):
        acting[:, g, :3] = force[:, group].sum(axis=1)
        acting[:, g, 3] = pressed[:, group].sum(axis=1)
        acting[:, g, 4:] = np.einsum("tc,tck->tk", pressed[:, group], places[:, group])
        middle[:, g] = places[rows][:, group].mean(axis=1)
    gained = acting[:-1] * np.diff(run.time)[:, None, None]
    mean = mean_between(run.time, gained, rows, acting[rows], since=since)
    floor = 1e-6 * max(run.robot.weight, 1e-300)
    loaded = mean[..., 3] > floor
    place = np.where(
        loaded[..., None], mean[..., 4:] / np.where(loaded, mean[..., 3], 1.0)[..., None], middle
    )
    return ShownForces(place, mean[..., :3], mean[..., 3])


def middle_of_pressure(forces: ShownForces, weight: float) -> Floats:
    """Zero moment point of mean forces on flat ground, (n, 3), in m; NaN where nothing pushes."""
    total = forces.normal.sum(axis=1, keepdims=True)
    share = forces.normal / np.where(total > 1e-6 * weight, total, np.nan)
    return np.einsum("ng,ngk->nk", share, forces.place)
