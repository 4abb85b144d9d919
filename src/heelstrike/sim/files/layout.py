"""What files of runs hold that differs between the plane and space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.ground import Ground
from heelstrike.robot.model import SELDOM
from heelstrike.robot.robot import Robot
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.contacts.constraint import constraint_names
from heelstrike.sim.dimension import Dimension
from heelstrike.sim.files.logs import Extents
from heelstrike.sim.files.robot_dataset import robot_to_dataset, stored_robot
from heelstrike.sim.files.settings import constraint_settings, held, shape_settings, shaped
from heelstrike.sim.files.variables import DamageError, Stored, Variable
from heelstrike.sim.plane import PLANE
from heelstrike.sim.run import AnyRun, Run

if TYPE_CHECKING:
    import xarray

PLANAR, SPATIAL = 2, 3
"""What files say of the dimension of their robot; those that do not say are planar."""

DIMENSIONS: Extents = {
    "nl": "coordinate", "nq": "coordinate", "nv": "coordinate", "nu": "actuator", "nc": "contact",
    "axes": "axis", "components": "component", "conditions": "condition",
    "loops": "loop", "couplings": "coupling", "brakes": "brake",
    "constraints": "constraint",
}  # fmt: skip
"""What datasets call the extents of a row in the plane, where links and coordinates share one."""


OF_HINGES = ("rad", "rad/s", "N m")
"""Units of joints that turn, where a quantity has one for those and one for slides."""


class Layout(ABC):
    """What files hold, of runs in the plane or in space."""

    dimension: ClassVar[Dimension]
    axes: ClassVar[int]
    """dimension, axes: The dimension, and what files say of it."""
    extents: ClassVar[Extents]
    """What datasets call the extents of a row."""
    ground: ClassVar[dict[str, Variable]]
    """Arrays of the ground."""

    def rows(self) -> dict[str, Variable]:
        """Return what is recorded as files hold it."""
        return {
            name: Variable(
                ("time", *(self.extents[extent] for extent in each.shape)),
                each.unit,
                each.label,
                default=0.0 if each.later else None,
            )
            for name, each in self.dimension.quantities.items()
        }

    def is_seldom(self, name: str) -> bool:  # noqa: ARG002 - some have nothing of it
        """Whether a quantity is one of what most robots have nothing of, and not told then."""
        return False

    def left_out(self, robot: Any) -> tuple[str, ...]:
        """Quantities that files of a robot do not hold, because they follow from others."""
        del robot
        return ()

    def following(self, robot: Any, ground: Any, rows: Mapping[str, Any]) -> dict[str, Any]:
        """Return those of all rows."""
        del robot, ground, rows
        return {}

    @abstractmethod
    def labels(self, robot: Any) -> dict[str, list[str]]:
        """Return what counts along the dimensions of a dataset."""

    @abstractmethod
    def attributes(self, run: Any) -> dict[str, Any]:
        """Return what is told of robot and ground as attributes."""

    @abstractmethod
    def robot_to_dataset(self, robot: Any) -> xarray.Dataset:
        """Return numbers and names of a robot as a dataset."""

    @abstractmethod
    def stored_robot(self, contents: Mapping[str, NDArray[Any]]) -> Any:
        """Build the robot that :meth:`robot_to_dataset` described."""

    @abstractmethod
    def stored_ground(
        self, stored: Stored, sizes: dict[str, int], known: Mapping[str, type]
    ) -> Any:
        """Make the ground of a file, perhaps with a shape of a known class."""

    def held(self, robot: Any, stored: Stored, known: Mapping[str, type]) -> Any:
        """Return a robot with the constraints of its run, of known classes."""
        del stored, known
        return robot

    @abstractmethod
    def places(self, kind: EventKind, robot: Any) -> tuple[str, int, int]:
        """Where an event may happen: what that is called, the first index and how many."""

    def unit_of(self, robot: Any, along: str, place: int, unit: str) -> str:
        """Unit of a number of a joint, where hinges and slides have their own: ``m or rad``."""
        turns = self.turns(robot, along, place) if " or " in unit else None
        if turns is None:
            return unit
        return next(one for one in unit.split(" or ") if (one in OF_HINGES) is turns)

    def unit_along(self, robot: Any, along: str, count: int, unit: str) -> str:
        """Unit of all numbers along a dimension of a dataset; both where they differ."""
        units = {self.unit_of(robot, along, place, unit) for place in range(count)}
        return units.pop() if len(units) == 1 else unit

    @abstractmethod
    def turns(self, robot: Any, along: str, place: int) -> bool | None:
        """Whether what counts along a dimension of a dataset turns; None if it does neither."""


class _Plane(Layout):
    dimension = PLANE
    axes = PLANAR
    extents = DIMENSIONS
    ground: ClassVar[dict[str, Variable]] = {
        "ground_corner": Variable(
            ("corner", "axis"), "m", "corners of the ground; its end segments go on forever"
        ),
        "ground_friction": Variable(
            ("segment",), "1", "friction coefficient of the segments of the ground"
        ),
        "ground_restitution": Variable(
            ("segment",), "1", "restitution of the segments of the ground"
        ),
    }

    def is_seldom(self, name: str) -> bool:
        shape = self.dimension.quantities[name].shape
        return any(extent in (*SELDOM, "constraints") for extent in shape)

    def labels(self, robot: Robot) -> dict[str, list[str]]:
        return {
            "coordinate": list(robot.joint_names),
            "actuator": list(robot.actuator_names),
            "contact": list(robot.contact_names),
            "loop": list(robot.loop_names),
            "coupling": list(robot.coupling_names),
            "brake": list(robot.brake_names),
            "constraint": constraint_names(robot),
            "axis": ["x", "z"],
            "component": ["normal", "tangent"],
            "condition": ["complementarity", "cone", "non-penetration"],
            "window": ["start", "duration"],
        }

    def attributes(self, run: Run) -> dict[str, Any]:
        return {
            "ground_slope": float(run.ground.slope),
            "ground_has_profile": int(run.ground.profile is not None),
            **shape_settings(run.ground),
            **constraint_settings(run.robot),
        }

    def robot_to_dataset(self, robot: Robot) -> xarray.Dataset:
        return robot_to_dataset(robot)

    def stored_robot(self, contents: Mapping[str, NDArray[Any]]) -> Robot:
        return stored_robot(contents)

    def stored_ground(
        self, stored: Stored, sizes: dict[str, int], known: Mapping[str, type]
    ) -> Ground:
        arrays = stored.arrays(self.ground, sizes)
        if sizes["segment"] != sizes["corner"] - 1:
            raise DamageError("'ground_friction' does not have one number a segment")
        ground = Ground.of_numbers(
            {
                **{name[len("ground_") :]: each for name, each in arrays.items()},
                "slope": np.array(stored.number("ground_slope")),
                "has_profile": np.array(stored.count("ground_has_profile")),
            }
        )
        return shaped(ground, stored, known)

    def held(self, robot: Robot, stored: Stored, known: Mapping[str, type]) -> Robot:
        return robot if robot.constraints else held(robot, stored, known)

    def places(self, kind: EventKind, robot: Robot) -> tuple[str, int, int]:
        if kind.of_constraint:
            return "constraint", 0, len(robot.constraints)
        # A bridge is one of the whole robot, but every robot has a joint.
        if kind.of_joint or kind is EventKind.BRIDGE:
            return "joint", 0, robot.nv
        return "contact point", 0, robot.nc

    def turns(self, robot: Robot, along: str, place: int) -> bool | None:
        model = robot.model
        joints: dict[str, Sequence[int]] = {
            "coordinate": range(robot.nj),
            "actuator": model.actuator_joint.tolist(),
            "coupling": model.coupling_joint[:, 0].tolist(),
            "brake": model.brake_joint.tolist(),
        }
        return bool(model.axis[joints[along][place], 0]) if along in joints else None


IN_THE_PLANE = _Plane()


def layout_named(axes: int) -> Layout:
    """Return the layout of the files of a dimension.

    Raises
    ------
    DamageError
        If there is none.
    """
    if axes == SPATIAL:
        from heelstrike.sim.files.spatial import IN_SPACE

        return IN_SPACE
    if axes != PLANAR:
        raise DamageError(f"its robot is one of {axes} dimensions")
    return IN_THE_PLANE


def layout_of(run: AnyRun) -> Layout:
    """Return the layout of the file of a run."""
    return layout_named(SPATIAL if isinstance(run.robot, SpatialRobot) else PLANAR)
