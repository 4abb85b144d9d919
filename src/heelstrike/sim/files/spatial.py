"""What files of runs in space hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from heelstrike.contact.spatial.ground import OF_A_BOX, SCALARS, SpatialGround
from heelstrike.robot.spatial.model import (
    BALL,
    FREE,
    HINGE,
    SPATIAL_NUMBERS,
    JointKind,
    SpatialModel,
)
from heelstrike.robot.spatial.robot import SpatialRobot, quaternion_places
from heelstrike.robot.spatial.solids import Solid
from heelstrike.sim.closed_sets import EventKind
from heelstrike.sim.files.layout import SPATIAL, Layout
from heelstrike.sim.files.logs import Extents
from heelstrike.sim.files.tree_variables import Bodies, TreeVariables
from heelstrike.sim.files.variables import DamageError, Stored, Variable
from heelstrike.sim.spatial.run import SpatialRun
from heelstrike.sim.spatial.space import SPACE, SpatialLook

if TYPE_CHECKING:
    import xarray

FOLLOWING = frozenset(
    ("first_position", "first_velocity", "velocity_joint", "last_velocity", "depth", "chain",
     "shared", "first_contact", "reach")
)  # fmt: skip
"""Numbers of a model that follow from the others."""

_DIMS: Extents = {
    "nl": "joint", "nj": "joint", "nq": "q", "nv": "v", "nc": "contact", "nu": "actuator",
    "axes": "axis", 4: "quaternion", 6: "tensor",
}  # fmt: skip
"""Dimensions of the robot's part of a file: every link has a joint."""
_SIZES = {"axis": 3, "quaternion": 4, "tensor": 6}
_TREE = TreeVariables(SPATIAL_NUMBERS, _DIMS, FOLLOWING)
_SOLIDS = Bodies("solid", "axis", Solid)


MANY_POINTS = 64
"""Contact points from which on files do not hold where they are: that follows from the positions,
and would be most of the file."""
PLACES = ("contact_point", "contact_normal", "gap")


class _Space(Layout):
    dimension = SPACE
    axes = SPATIAL
    extents: ClassVar[Extents] = {
        "nl": "joint", "nj": "joint", "nq": "q", "nv": "v", "nu": "actuator", "nc": "contact",
        "axes": "axis", "components": "component", 2: "tangent",
    }  # fmt: skip
    ground: ClassVar[dict[str, Variable]] = {
        "ground_normal": Variable(("axis",), "1", "upward unit normal of the plane of the ground"),
        **{
            f"ground_box_{name}": Variable(
                ("box", "axis")[: 1 + len(shape)],
                {"center": "m", "size": "m", "yaw": "rad", "pitch": "rad"}.get(name, "1"),
                f"{name} of the boxes on the ground",
                allowed="anything",  # friction and restitution of the ground are NaN
            )
            for name, shape in OF_A_BOX.items()
        },
    }

    def left_out(self, robot: SpatialRobot) -> tuple[str, ...]:
        return PLACES if robot.nc > MANY_POINTS else ()

    def following(
        self, robot: SpatialRobot, ground: SpatialGround, rows: Mapping[str, Any]
    ) -> dict[str, Any]:
        look, count = SpatialLook(robot), len(rows["position"])
        found = {
            "contact_point": np.empty((count, robot.nc, 3)),
            "contact_normal": np.empty((count, robot.nc, 3)),
            "gap": np.empty((count, robot.nc)),
        }
        states = zip(rows["position"], rows["velocity"], strict=True)
        for row, (q, v) in enumerate(states):
            seen = look.in_state(ground, q, v)
            found["contact_point"][row] = seen.position
            found["contact_normal"][row] = seen.normal
            found["gap"][row] = seen.gap
        return found

    def labels(self, robot: SpatialRobot) -> dict[str, list[str]]:
        return {
            "q": list(robot.position_names),
            "v": list(robot.velocity_names),
            "joint": list(robot.joint_names),
            "actuator": list(robot.actuator_names),
            "contact": list(robot.contact_names),
            "axis": ["x", "y", "z"],
            "component": ["normal", "t1", "t2"],
            "tangent": ["t1", "t2"],
            "window": ["start", "duration"],
        }

    def attributes(self, run: SpatialRun) -> dict[str, Any]:
        ground = {f"ground_{name}": float(getattr(run.ground, name)) for name in SCALARS}
        return {"dimension": SPATIAL, **ground}

    def stored_ground(
        self,
        stored: Stored,
        sizes: dict[str, int],
        known: Mapping[str, type],
    ) -> SpatialGround:
        arrays = stored.arrays(self.ground, sizes)
        numbers = {name.removeprefix("ground_"): each for name, each in arrays.items()}
        scalars = {name: np.array(stored.number(f"ground_{name}")) for name in SCALARS}
        return SpatialGround.of_numbers(numbers | scalars)

    def places(self, kind: EventKind, robot: SpatialRobot) -> tuple[str, int, int]:
        if kind in (EventKind.UNCERTIFIED, EventKind.ENERGY_GAIN):
            return "place", -1, 1
        if kind in (EventKind.JOINT_SLIP, EventKind.JOINT_STICK):
            return "velocity", 0, robot.nv
        return ("joint", 0, robot.nj) if kind.of_joint else ("contact point", 0, robot.nc)

    def unit_of(self, robot: SpatialRobot, along: str, place: int, unit: str) -> str:
        quaternions = quaternion_places(robot.model)
        if along == "q" and any(first <= place < first + 4 for first in quaternions):
            return ""
        return super().unit_of(robot, along, place, unit)

    def turns(self, robot: SpatialRobot, along: str, place: int) -> bool | None:
        model = robot.model
        if along == "actuator":
            along, place = "v", int(model.actuator_velocity[place])
        if along not in ("q", "v"):
            return None
        firsts = model.first_position if along == "q" else model.first_velocity
        joint = int(np.searchsorted(firsts, place, side="right")) - 1
        kind, within = int(model.joint_kind[joint]), place - int(firsts[joint])
        if kind == FREE:
            return within > 2
        return kind in (BALL, HINGE)

    def robot_to_dataset(self, robot: SpatialRobot) -> xarray.Dataset:
        return _TREE.to_dataset(robot, _SOLIDS.variables, _SOLIDS.values(robot.solids, 3), {})

    def stored_robot(self, contents: Mapping[str, NDArray[Any]]) -> SpatialRobot:
        stored, sizes = Stored(contents), _SIZES.copy()
        numbers = stored.arrays(_TREE.numbers, sizes)
        model = _model(numbers, stored.count("pivot"), sizes)
        parts = _TREE.parts(stored, sizes)
        solids = _SOLIDS.stored(stored, sizes)
        links = [*(foot.link for foot in parts["feet"]), *(solid.link for solid in solids)]
        if any(not 0 <= link < model.nl for link in links):
            raise DamageError("a foot or a solid points outside the robot")
        return SpatialRobot(**parts, model=model, solids=solids)


def _model(numbers: dict[str, Any], pivot: int, sizes: Mapping[str, int]) -> SpatialModel:
    """Make a model of its numbers, or refuse those that would send kernels astray."""
    parent, kinds = numbers["parent"], numbers["joint_kind"]
    links = np.arange(len(parent))
    for name, values in (*numbers.items(), ("pivot", np.array(pivot))):
        number = SPATIAL_NUMBERS[name]
        if not np.all((values >= number.least) & (values <= number.most)):
            raise DamageError(f"{name} must be between {number.least:g} and {number.most:g}")
    if not len(links) or np.any(parent >= links):
        raise DamageError("parent points outside the robot")
    joints = [JointKind(int(kind)) for kind in kinds]
    for extent, count in (
        ("q", sum(each.positions for each in joints)),
        ("v", sum(each.velocities for each in joints)),
    ):
        if sizes[extent] != count:
            raise DamageError(f"its joints have {count} of {extent}, not {sizes[extent]}")
    for name, values, most in (
        ("contact_link", numbers["contact_link"], len(links)),
        ("actuator_velocity", numbers["actuator_velocity"], sizes["v"]),
        ("pivot", np.array(pivot), len(links)),
    ):
        if np.any(values >= most):
            raise DamageError(f"{name} points outside the robot")
    return SpatialModel.made(**numbers, pivot=pivot)


IN_SPACE = _Space()
