"""Pushes on robots in space: forces with three components."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.errors import SimulationError
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.push import Push
from heelstrike.sim.spatial.memory import SpatialPushes


def spatial_pushes(robot: SpatialRobot, pushes: Sequence[Push]) -> SpatialPushes:
    """Return the arrays of some pushes on a robot in space.

    Raises
    ------
    SimulationError
        If a push acts on no link of the robot, or its force has not three components.
    """
    links, points, forces = [], [], []
    for push in pushes:
        if not isinstance(push, Push):
            raise SimulationError(f"pushes must be Push(...), got {push!r}")
        links.append(_link_of(robot, push))
        default = robot.model.center_of_mass[links[-1]]
        points.append(default if push.point is None else _three("point", push.point))
        forces.append(_three("force", push.force))
    count = len(links)
    return SpatialPushes.allocate(
        robot.model.extents,
        np=count,
        link=np.array(links, dtype=np.int64),
        point=np.array(points, dtype=np.float64).reshape(count, 3),
        force=np.array(forces, dtype=np.float64).reshape(count, 3),
        start=np.array([push.start for push in pushes], dtype=np.float64),
        end=np.array([push.end for push in pushes], dtype=np.float64),
    )


def _link_of(robot: SpatialRobot, push: Push) -> int:
    names = robot.link_names
    if isinstance(push.link, str):
        found = [place for place, name in enumerate(names) if name == push.link]
        if not found:
            raise SimulationError(
                f"a push acts on link {push.link!r}, which robot {robot.name!r} does not have; its "
                f"links are {', '.join(dict.fromkeys(names))}"
            )
        return found[-1]  # of a body with several joints the last link carries the mass
    if not 0 <= int(push.link) < len(names):
        raise SimulationError(
            f"a push acts on link {push.link}, but robot {robot.name!r} has links 0 to "
            f"{len(names) - 1}"
        )
    return int(push.link)


def _three(name: str, values: Sequence[float]) -> tuple[float, float, float]:
    if len(values) != 3:
        raise SimulationError(
            f"the {name} of a push on a robot in space has three numbers (x, y, z), got {values!r}"
        )
    x, y, z = values
    return x, y, z
