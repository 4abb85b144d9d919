"""A robot in one state, in numbers or in symbols; what a person hands in, checked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from types import ModuleType
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import are_numbers, refusal
from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.mold import Mold
from heelstrike.dynamics import kernels as planar
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import RobotError
from heelstrike.robot.coordinates import index_of
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.named_tree import NamedTree
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot


class AnyEvaluation(ABC):
    """A robot in one state, and what the kernels know of it, in the plane or in space.

    Parameters
    ----------
    robot : Robot or SpatialRobot
        The robot.
    q, v : (nq,) and (nv,) array
        State; at rest by default. Object arrays of CasADi symbols make everything symbolic.

    Raises
    ------
    RobotError
        If a vector has the wrong length, or a quaternion not length one.
    """

    robots: ClassVar[type[Any]]
    """Class of its robots."""
    where: ClassVar[str]
    """Where they are, in words."""
    kernels: ClassVar[ModuleType]
    """Module of its kernels; those of both dimensions have the same names and arguments."""
    workspace: ClassVar[type[Bundle]]
    """Class of what kernels work with."""
    moments: ClassVar[int]
    """How many components a moment has."""

    def __init__(self, robot: Any, q: ArrayLike, v: ArrayLike | None = None) -> None:
        if not isinstance(robot, self.robots):
            raise RobotError(refusal("robot", robot, (self.robots.__name__,)))
        self.robot: Any = robot
        self.model: Any = self.robot.model
        self.symbolic = isinstance(q, np.ndarray) and q.dtype == object
        self.q: Any = self.position("q", q)
        self.rests = v is None
        self.v: Any = self.zeros(self.model.nv) if v is None else self.vector("v", v)

    @cached_property
    def work(self) -> Any:
        """Kinematics and velocities of the state, for the kernels that follow."""
        if self.symbolic:
            made = self.workspace.allocate(self.model.extents, dtype=object)
        else:
            made = new_workspace(self.model, self.workspace)
        self.run(self.kernels.forward_kinematics, self.model, self.q, made)
        if self.symbolic or not self.rests:  # what is new is at rest
            self.run(self.kernels.link_velocities, self.model, self.v, made)
        return made

    def run(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Run a kernel, over symbols as plain Python, and return what it returns."""
        if self.symbolic:
            from heelstrike.dynamics.queries.symbolic import traced

            kernel = traced(kernel)
        return kernel(*arguments)

    def zeros(self, *shape: int) -> Floats:
        """Make an array of zeros of the right kind."""
        return np.zeros(shape, dtype=object if self.symbolic else np.float64)

    def filled(self, shape: tuple[int, ...], kernel: Callable[..., Any], *arguments: Any) -> Floats:
        """Return an array that a kernel has filled, its last argument."""
        result = self.zeros(*shape)
        self.run(kernel, *arguments, result)
        return result

    def number(self, kernel: Callable[..., Any], *arguments: Any) -> float:
        """Return the number that a kernel has written."""
        (result,) = self.filled((1,), kernel, *arguments).tolist()
        value: float = result
        return value

    def vector(self, name: str, value: ArrayLike) -> Floats:
        """Check a vector over the velocities, or the actuators if it is "torque"; symbols pass."""
        symbolic: Any = value
        return symbolic if self.symbolic else joint_vector(self.robot, name, value)

    def position(self, name: str, value: ArrayLike) -> Floats:
        """Check a position; symbols pass."""
        symbolic: Any = value
        return symbolic if self.symbolic else self._position(name, value)

    @abstractmethod
    def _position(self, name: str, value: ArrayLike) -> Floats:
        """Check a position in numbers."""

    @abstractmethod
    def mass_matrix(self) -> Floats:
        """Return the mass matrix."""


class Evaluation(AnyEvaluation):
    """A robot of the plane in one state; see :class:`AnyEvaluation`."""

    robot: Robot
    model: Model
    work: Workspace
    robots = Robot
    where = "of the plane"
    kernels: ClassVar[ModuleType] = planar
    workspace = Workspace
    moments = 1

    def _position(self, name: str, value: ArrayLike) -> Floats:
        return joint_vector(self.robot, name, value)

    def mass_matrix(self) -> Floats:
        """Return the mass matrix."""
        size = self.model.nv
        return self.filled((size, size), planar.mass_matrix, self.model, self.work)

    def point(self, link: int | str, local: ArrayLike) -> tuple[int, Floats]:
        """Return the index of a link and the world position of a point of it."""
        place, within = link_index(self.robot, link), place_vector("local", local, "xz")
        shape = within.shape
        return place, self.filled(shape, planar.point_position, self.work, place, within)

    def jacobian(self, link: int, position: Floats) -> Floats:
        """Return rows (x, z, rotation) of the Jacobian of a point at a world position, (3, nv)."""
        shape = (3, self.model.nv)
        return self.filled(shape, planar.point_jacobian, self.model, self.work, link, position)

    def bias_acceleration(self, link: int, position: Floats) -> Floats:
        """Return J̇v of :meth:`jacobian`, (3,)."""
        return self.filled((3,), planar.point_bias_acceleration, self.work, link, position)

    def contact_centers(self, contacts: Any) -> list[tuple[int, int, Floats]]:
        """Return index, link and centre of contact points, of all if None are named."""
        model = self.model
        return [
            (i, *self.point(int(model.contact_link[i]), model.contact_position[i]))
            for i in contact_indices(self.robot, contacts)
        ]


def evaluation_of(robot: Any) -> type[AnyEvaluation]:
    """Return what evaluates a robot; space is loaded with the first of its robots."""
    return evaluation_in_space() if isinstance(robot, SpatialRobot) else Evaluation


def evaluation_in_space() -> type[AnyEvaluation]:
    """Return what evaluates robots in space."""
    from heelstrike.dynamics.spatial.queries.evaluation import SpatialEvaluation

    return SpatialEvaluation


def new_workspace(model: Any, kind: type[Bundle] = Workspace) -> Any:
    """Return a workspace of zeros for a robot."""
    if model not in _MOLDS:
        _MOLDS[model] = Mold(kind.allocate(model.extents))
    return _MOLDS[model].cast()


_MOLDS: WeakKeyDictionary[Any, Mold[Any]] = WeakKeyDictionary()


def joint_vector(robot: NamedTree, name: str, value: ArrayLike) -> Floats:
    """Return a vector over the velocities, or the actuators if it is "torque".

    Raises
    ------
    RobotError
        That names them, if it has another length.
    """
    entries = robot.actuator_names if name == "torque" else robot.velocity_names
    if not are_numbers(value):
        raise RobotError(refusal(name, value, ("ArrayLike",)))
    vector = np.ascontiguousarray(value, dtype=np.float64)
    if vector.shape != (len(entries),):
        raise RobotError(
            f"{name} of robot {robot.name!r} must have {len(entries)} entries "
            f"({', '.join(entries)}), got shape {vector.shape}"
        )
    return vector


_COUNTED = {2: "two", 3: "three"}


def place_vector(name: str, value: ArrayLike, axes: str) -> Floats:
    """Return a point or vector along some axes, or raise a `RobotError`."""
    vector = np.ascontiguousarray(value if are_numbers(value) else (), dtype=np.float64)
    if vector.shape != (len(axes),) or not np.all(np.isfinite(vector)):
        raise RobotError(
            f"{name} must be {_COUNTED[len(axes)]} finite numbers ({', '.join(axes)}) in metres, "
            f"got {value!r}"
        )
    return vector


def link_index(robot: NamedTree, link: int | str) -> int:
    """Return the index of a link given by its index or by the name of its body.

    A body with several joints is a chain of links of one name; the last of them carries the body.

    Raises
    ------
    RobotError
        If the robot has no such link.
    """
    names = robot.link_names
    if link in names:
        return len(names) - 1 - names[::-1].index(str(link))
    return index_of(robot, "link", names, link)


def contact_indices(robot: NamedTree, contacts: Any) -> tuple[int, ...]:
    """Return indices of contact points given by index or name, in the order given; all of None.

    Raises
    ------
    RobotError
        If the robot has no such contact point.
    """
    names = robot.contact_names
    given: Any = range(robot.nc) if contacts is None else contacts
    given = (given,) if isinstance(given, str | int | np.integer) else given
    return tuple(dict.fromkeys(index_of(robot, "contact point", names, one) for one in given))
