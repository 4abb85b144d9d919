"""Constraints from outside: kinds of row of one's own.

A constraint holds a robot to the world, or its parts to each other, along one or two directions of
its motion. It says where its forces may lie (:class:`~heelstrike.contact.sets.ImpulseSet`), and has
a kernel that writes its rows: by how much it is open, its Jacobian J, and J̇ v. Everything else is
as with contact points, stops and loops: one contact problem, one certificate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from numba import types

from heelstrike.arguments import takes
from heelstrike.compiler.bundle import Bundle
from heelstrike.compiler.kernel_objects import KernelObject, numbers_of
from heelstrike.contact.sets import ImpulseSet
from heelstrike.dynamics.workspace import Workspace
from heelstrike.errors import SimulationError
from heelstrike.robot.model import Model
from heelstrike.robot.robot import Robot

COMPONENTS = 2
"""Most rows of a constraint: those of a cone in the plane, or of a pin."""


class Constraint(KernelObject):
    """A constraint of your own: a cable, a slider, a pin, a wall for a hand.

    A subclass is a frozen dataclass of settings. It says what its `set` is, how many `components`
    it has, and has one kernel, ``rows(self, model, tree, q, v, gap, jacobian, bias)``, which writes
    what its rows are in a state. The arrays are zero before::

        gap       (2,)      how far it is from what holds it (m, rad); for a line, by how much each
                            of its equations does not hold; of an interval nothing
        jacobian  (2, nv)   row by row: the rate of the gap is J v. Of a cone the normal comes
                            first, then the tangent; of an interval the only row is along which it
                            rubs
        bias      (2,)      J̇ v, what the rate of the gap's rate is at v̇ = 0

    ``model`` and ``tree`` are the robot's numbers and kinematics, for the kernels of
    `heelstrike.sim`: ``point_at``, ``point_velocity``, ``point_bias``, ``add_point_row``. Impulses
    act on the robot as Jᵀ λ. Kernels run unchecked: an index out of range is one in C.

    A robot is held by it in simulations: ``constrained(robot, Cable(...))``.
    """

    called = "constraint"
    asked: ClassVar[dict[str, str]] = {"rows": "self, model, tree, q, v, gap, jacobian, bias"}

    rows: ClassVar[Callable[..., Any]]
    """The kernel, made by :func:`heelstrike.sim.kernel`."""

    set: ClassVar[ImpulseSet] = ImpulseSet.LINE
    """Where its impulses may lie."""

    components: ClassVar[int] = 1
    """How many rows it has: 1, or 2 of a line or a cone, which has two always."""

    restitution: float = 0.0
    """Newton's coefficient, of a half-line or a cone. May be a field of the class."""

    friction: float = 0.0
    """Coefficient of a cone. May be a field."""

    bound: float = 0.0
    """Largest force of an interval (N, N m). May be a field."""

    def numbers(self, robot: Robot) -> Mapping[str, float | int]:  # noqa: ARG002
        """Return what ``self`` is in compiled code, for a robot.

        Parameters
        ----------
        robot : Robot
            The robot that it holds.

        Returns
        -------
        mapping of str to float or int
            By default the settings that are numbers. One that names a link gives its index.
        """
        kind: Any = self
        settings = {field.name: getattr(self, field.name) for field in fields(kind)}
        return {name: each for name, each in settings.items() if isinstance(each, int | float)}

    @classmethod
    def signature(cls) -> Any:
        """Of the address of its numbers, the robot, a state, and what it writes to."""
        vector, matrix = (types.Array(types.float64, n, "C") for n in (1, 2))
        model, tree = Model.compiled_type(), Workspace.compiled_type()
        return types.int64(types.int64, model, tree, vector, vector, vector, matrix, vector)

    @staticmethod
    def _entry(numbers_at: Any, rows: Any) -> Callable[..., int]:
        """Make what loops call."""

        def write(
            address: int, model: Any, tree: Any, q: Any, v: Any, gap: Any, jacobian: Any, bias: Any
        ) -> int:
            rows(numbers_at(address), model, tree, q, v, gap, jacobian, bias)
            return 0

        return write


@takes(SimulationError)
def constrained(robot: Robot, *constraints: Constraint) -> Robot:
    """Return a robot with additional constraints.

    They act in its simulations, under every method that knows their sets. Queries of its dynamics
    and gaits that are designed for it know nothing of them.

    Parameters
    ----------
    robot : Robot
        The robot, which stays as it is.
    *constraints : Constraint
        What holds it: half-lines let go, lines do not.

    Returns
    -------
    Robot
        The same with `constraints`.

    Raises
    ------
    SimulationError
        If one is none, or its kernel cannot be compiled.
    """
    held = replace(robot, constraints=(*robot.constraints, *constraints))
    for each in constraints:
        if not isinstance(each, Constraint):
            raise SimulationError(
                f"constraints must be objects of a class that derives from Constraint, got {each!r}"
            )
        each.check()
        name, expected = type(each).__name__, 2 if each.set is ImpulseSet.CONE else 1
        most = 2 if each.set in (ImpulseSet.CONE, ImpulseSet.LINE) else 1
        if not isinstance(each.set, ImpulseSet) or not expected <= each.components <= most:
            raise SimulationError(
                f"constraint {name} has set {each.set!r} and {each.components} components; a line "
                "has 1 or 2, a half-line or an interval 1, a cone 2"
            )
        for told, value, highest in (
            ("restitution", each.restitution, 1.0), ("friction", each.friction, np.inf),
            ("bound", each.bound, np.inf),
        ):  # fmt: skip
            if not (0.0 <= value <= highest and value < np.inf):
                raise SimulationError(f"the {told} of constraint {name} cannot be {value}")
        written_by(held, each)
    return held


def written_by(robot: Robot, constraint: Constraint) -> tuple[int, Bundle]:
    """Return the address of what writes the rows of a constraint, and its numbers for a robot."""
    known = _WRITTEN.setdefault(robot, {})
    if id(constraint) not in known:
        numbers = numbers_of(type(constraint), constraint.numbers(robot))
        known[id(constraint)] = constraint.code(numbers), numbers, constraint
    return known[id(constraint)][:2]


_WRITTEN: WeakKeyDictionary[Robot, dict[int, tuple[int, Bundle, Constraint]]] = WeakKeyDictionary()
"""What stays where it is as long as the robot is there: loops know it by its address."""


def constraint_names(robot: Robot) -> list[str]:
    """Return what constraints are called: by their class, and by number where there are several."""
    kinds = [type(each).__name__ for each in robot.constraints]
    return [
        kind if kinds.count(kind) == 1 else f"{kind} {kinds[: i + 1].count(kind)}"
        for i, kind in enumerate(kinds)
    ]


def is_line(constraint: Constraint) -> bool:
    """Whether a constraint never lets go, as loops do not."""
    return constraint.set is ImpulseSet.LINE


def line_rows(robot: Robot) -> int:
    """Return how many rows the constraints of a robot have that never let go."""
    return sum(each.components for each in robot.constraints if is_line(each))


def friction_of(constraint: Constraint) -> float:
    """Return the friction of a constraint in the contact problem, where an interval has 1."""
    told = {ImpulseSet.CONE: float(constraint.friction), ImpulseSet.INTERVAL: 1.0}
    return told.get(constraint.set, 0.0)
