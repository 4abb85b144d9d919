"""A robot in space in one state, in numbers or in symbols; what a person hands in, checked."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import are_numbers, refusal
from heelstrike.compiler.mold import Mold
from heelstrike.dynamics.queries.evaluation import vector_over
from heelstrike.dynamics.spatial import equations, kinematics
from heelstrike.dynamics.spatial.algebra import Vector
from heelstrike.dynamics.spatial.workspace import SpatialWorkspace, TreeFactor
from heelstrike.errors import RobotError
from heelstrike.robot.coordinates import index_of
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.model import SpatialModel
from heelstrike.robot.spatial.robot import SpatialRobot, checked_position


class SpatialEvaluation:
    """A robot in space in one state, and what the kernels know of it.

    Parameters
    ----------
    robot : SpatialRobot
        The robot.
    q, v : (nq,) and (nv,) array
        State; at rest by default. Object arrays of CasADi symbols make everything symbolic.

    Raises
    ------
    RobotError
        If a vector has the wrong length, or a quaternion not length one.
    """

    def __init__(self, robot: SpatialRobot, q: ArrayLike, v: ArrayLike | None = None) -> None:
        if not isinstance(robot, SpatialRobot):
            raise RobotError(refusal("robot", robot, ("SpatialRobot",)))
        self.robot, self.model = robot, robot.model
        self.symbolic = isinstance(q, np.ndarray) and q.dtype == object
        self.q: Any = q if self.symbolic else position_vector(robot, "q", q)
        self.rests = v is None
        self.v: Any = self.zeros(robot.nv) if v is None else self.vector("v", v)

    @cached_property
    def work(self) -> SpatialWorkspace:
        """Kinematics and velocities of the state, for the kernels that follow."""
        if self.symbolic:
            made = SpatialWorkspace.allocate(self.model.extents, dtype=object)
        else:
            made = new_spatial_workspace(self.model)
        self.run(kinematics.forward_kinematics, self.model, self.q, made)
        if self.symbolic or not self.rests:  # what is new is at rest
            self.run(kinematics.link_velocities, self.model, self.v, made)
        return made

    def tree(self) -> TreeFactor:
        """Memory for a mass matrix and its factor."""
        return TreeFactor.allocate(
            self.model.extents, **({"dtype": object} if self.symbolic else {})
        )

    def run(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Run a kernel, over symbols as plain Python, and return what it returns."""
        if self.symbolic:
            from heelstrike.dynamics.spatial.queries.symbolic import traced

            kernel = traced(kernel)
        return kernel(*arguments)

    def zeros(self, *shape: int) -> Any:
        """Make an array of zeros of the right kind."""
        return np.zeros(shape, dtype=object if self.symbolic else np.float64)

    def filled(self, shape: tuple[int, ...], kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Return an array that a kernel has filled, its last argument."""
        result = self.zeros(*shape)
        self.run(kernel, *arguments, result)
        return result

    def number(self, kernel: Callable[..., Any], *arguments: Any) -> float:
        """Return the number that a kernel has written."""
        (result,) = self.filled((1,), kernel, *arguments).tolist()
        value: float = result
        return value

    def vector(self, name: str, value: ArrayLike) -> Any:
        """Check a vector over the velocities, or the actuators if it is "torque"; symbols pass."""
        return value if self.symbolic else velocity_vector(self.robot, name, value)

    def mass_matrix(self) -> Any:
        """Return the mass matrix."""
        size = self.model.nv
        return self.filled((size, size), equations.mass_matrix, self.model, self.work, self.tree())

    def point(self, link: int | str, local: ArrayLike) -> tuple[int, Vector]:
        """Return the index of a link and the world position of a point of it."""
        place, within = spatial_link(self.robot, link), space_vector("local", local)
        return place, self.run(kinematics.point_position, self.work, place, within)


def new_spatial_workspace(model: SpatialModel) -> SpatialWorkspace:
    """Return a workspace of zeros for a robot."""
    if model not in _MOLDS:
        _MOLDS[model] = Mold(SpatialWorkspace.allocate(model.extents))
    return _MOLDS[model].cast()


_MOLDS: WeakKeyDictionary[SpatialModel, Mold[SpatialWorkspace]] = WeakKeyDictionary()


def position_vector(robot: SpatialRobot, name: str, value: ArrayLike) -> Floats:
    """Return a position whose quaternions have length one; see :func:`checked_position`."""
    if not are_numbers(value):
        raise RobotError(refusal(name, value, ("ArrayLike",)))
    return checked_position(robot, np.array(value, dtype=np.float64))


def velocity_vector(robot: SpatialRobot, name: str, value: ArrayLike) -> Floats:
    """Return a vector over the velocities, or the actuators if it is "torque".

    Raises
    ------
    RobotError
        That names them, if it has another length.
    """
    entries = robot.actuator_names if name == "torque" else robot.velocity_names
    return vector_over(entries, robot.name, name, value)


def space_vector(name: str, value: ArrayLike) -> Vector:
    """Return a point or vector (x, y, z), or raise a `RobotError`."""
    vector = np.asarray(value if are_numbers(value) else (), dtype=np.float64)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise RobotError(f"{name} must be three finite numbers (x, y, z) in metres, got {value!r}")
    x, y, z = vector.tolist()
    return x, y, z


def spatial_link(robot: SpatialRobot, link: int | str) -> int:
    """Return the index of a link given by its index or by the name of its body.

    A body with several joints is a chain of links of one name; the last of them carries the body.
    """
    names = robot.link_names
    if link in names:
        return len(names) - 1 - names[::-1].index(str(link))
    return index_of(robot, "link", names, link)


def spatial_contacts(robot: SpatialRobot, contacts: Any) -> tuple[int, ...]:
    """Return indices of contact points given by index or name, in the order given; all of None."""
    names = robot.contact_names
    given: Any = range(robot.nc) if contacts is None else contacts
    given = (given,) if isinstance(given, str | int | np.integer) else given
    return tuple(dict.fromkeys(index_of(robot, "contact point", names, one) for one in given))
