"""A robot in space in one state, in numbers or in symbols; what a person hands in, checked."""

from __future__ import annotations

from types import ModuleType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import are_numbers, refusal
from heelstrike.dynamics.queries.evaluation import AnyEvaluation, link_index, place_vector
from heelstrike.dynamics.spatial import kernels as in_space
from heelstrike.dynamics.spatial.algebra import Vector
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.errors import RobotError
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot, checked_position


class SpatialEvaluation(AnyEvaluation):
    """A robot in space in one state; see :class:`AnyEvaluation`."""

    robot: SpatialRobot
    model: SpatialModel
    work: SpatialWorkspace
    robots = SpatialRobot
    where = "of space"
    kernels: ClassVar[ModuleType] = in_space
    workspace = SpatialWorkspace
    moments = 3

    def _position(self, name: str, value: ArrayLike) -> Floats:
        return position_vector(self.robot, name, value)

    def tree(self) -> TreeFactor:
        """Memory for a mass matrix and its factor."""
        return TreeFactor.allocate(
            self.model.extents, **({"dtype": object} if self.symbolic else {})
        )

    def mass_matrix(self) -> Floats:
        """Return the mass matrix."""
        size = self.model.nv
        return self.filled((size, size), in_space.mass_matrix, self.model, self.work, self.tree())

    def point(self, link: int | str, local: ArrayLike) -> tuple[int, Vector]:
        """Return the index of a link and the world position of a point of it."""
        place = link_index(self.robot, link)
        x, y, z = place_vector("local", local, "xyz").tolist()
        position: Any = self.run(in_space.point_position, self.work, place, (x, y, z))
        return place, position


def position_vector(robot: SpatialRobot, name: str, value: ArrayLike) -> Floats:
    """Return a position whose quaternions have length one; see :func:`checked_position`."""
    if not are_numbers(value):
        raise RobotError(refusal(name, value, ("ArrayLike",)))
    return checked_position(robot, np.array(value, dtype=np.float64))
