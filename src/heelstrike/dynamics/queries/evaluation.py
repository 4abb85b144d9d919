"""A robot in one state, in numbers or in symbols; what a person hands in, checked."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from heelstrike.arguments import are_numbers, refusal
from heelstrike.compiler.mold import Mold
from heelstrike.dynamics import kernels
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import RobotError
from heelstrike.robot.coordinates import index_of
from heelstrike.robot.model import Floats, Model
from heelstrike.robot.robot import Robot


class Evaluation:
    """A robot in one state, and what the kernels know of it.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) array
        State; at rest by default. Object arrays of CasADi symbols make everything symbolic.

    Raises
    ------
    RobotError
        If a vector has the wrong length.
    """

    def __init__(self, robot: Robot, q: ArrayLike, v: ArrayLike | None = None) -> None:
        if not isinstance(robot, Robot):
            raise RobotError(refusal("robot", robot, ("Robot",)))
        self.robot, self.model = robot, robot.model
        self.symbolic = isinstance(q, np.ndarray) and q.dtype == object
        self.q = self.vector("q", q)
        self.rests = v is None
        self.v = self.zeros(robot.nv) if v is None else self.vector("v", v)

    @cached_property
    def work(self) -> Workspace:
        """Kinematics and velocities of the state, for the kernels that follow."""
        if self.symbolic:
            made = Workspace.allocate(self.model.extents, dtype=object)
        else:
            made = new_workspace(self.model)
        self.run(kernels.forward_kinematics, self.model, self.q, made)
        if self.symbolic or not self.rests:  # what is new is at rest
            self.run(kernels.link_velocities, self.model, self.v, made)
        return made

    def run(self, kernel: Callable[..., Any], *arguments: Any) -> None:
        """Run a kernel, over symbols as plain Python."""
        if self.symbolic:
            from heelstrike.dynamics.queries.symbolic import traced

            kernel = traced(kernel)
        kernel(*arguments)

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
        """Check a vector over the coordinates, or the actuators if it is "torque"; symbols pass."""
        symbolic: Any = value
        return symbolic if self.symbolic else joint_vector(self.robot, name, value)

    def point(self, link: int | str, local: ArrayLike) -> tuple[int, Floats]:
        """Return the index of a link and the world position of a point of it."""
        place, within = link_index(self.robot, link), plane_vector("local", local)
        return place, self.filled(within.shape, kernels.point_position, self.work, place, within)

    def jacobian(self, link: int, position: Floats) -> Floats:
        """Return rows (x, z, rotation) of the Jacobian of a point at a world position, (3, nv)."""
        shape = (3, self.model.nv)
        return self.filled(shape, kernels.point_jacobian, self.model, self.work, link, position)

    def bias_acceleration(self, link: int, position: Floats) -> Floats:
        """Return J̇v of :meth:`jacobian`, (3,)."""
        return self.filled((3,), kernels.point_bias_acceleration, self.work, link, position)

    def contact_centers(self, contacts: Any) -> list[tuple[int, int, Floats]]:
        """Return index, link and centre of contact points, of all if None are named."""
        model = self.model
        return [
            (i, *self.point(int(model.contact_link[i]), model.contact_position[i]))
            for i in contact_indices(self.robot, contacts)
        ]


def new_workspace(model: Model) -> Workspace:
    """Return a workspace of zeros for a robot."""
    if model not in _MOLDS:
        _MOLDS[model] = Mold(Workspace.allocate(model.extents))
    return _MOLDS[model].cast()


_MOLDS: WeakKeyDictionary[Model, Mold[Workspace]] = WeakKeyDictionary()


def joint_vector(robot: Robot, name: str, value: ArrayLike) -> Floats:
    """Return a vector over the coordinates, or the actuators if it is "torque".

    Raises
    ------
    RobotError
        That names them, if it has another length.
    """
    entries = robot.actuator_names if name == "torque" else robot.joint_names
    return vector_over(entries, robot.name, name, value)


def vector_over(entries: tuple[str, ...], robot: str, name: str, value: ArrayLike) -> Floats:
    """Return a vector of one number an entry, or raise a `RobotError` that names them."""
    if not are_numbers(value):
        raise RobotError(refusal(name, value, ("ArrayLike",)))
    vector = np.ascontiguousarray(value, dtype=np.float64)
    if vector.shape != (len(entries),):
        raise RobotError(
            f"{name} of robot {robot!r} must have {len(entries)} entries "
            f"({', '.join(entries)}), got shape {vector.shape}"
        )
    return vector


def plane_vector(name: str, value: ArrayLike) -> Floats:
    """Return a point or vector (x, z) of the plane, (2,), or raise a `RobotError`."""
    vector = np.ascontiguousarray(value if are_numbers(value) else (), dtype=np.float64)
    if vector.shape != (2,) or not np.all(np.isfinite(vector)):
        raise RobotError(f"{name} must be two finite numbers (x, z) in metres, got {value!r}")
    return vector


def link_index(robot: Robot, link: int | str) -> int:
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


def contact_indices(robot: Robot, contacts: Any) -> tuple[int, ...]:
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
