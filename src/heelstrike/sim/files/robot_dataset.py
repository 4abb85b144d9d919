"""A robot as a dataset: its numbers and names, enough to be the same robot again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.robot.model import NUMBERS, SCALES, Model, bounds
from heelstrike.robot.robot import Robot
from heelstrike.robot.shapes.outlines import Outline
from heelstrike.robot.sides.mirror import Mirror
from heelstrike.sim.files.tree_variables import Bodies, TreeVariables
from heelstrike.sim.files.variables import DamageError, Stored, Variable

if TYPE_CHECKING:
    import xarray

_DIMS: dict[str | int, str] = {
    "nl": "coordinate", "nj": "coordinate", "nq": "coordinate", "nv": "coordinate",
    "nc": "contact", "nu": "actuator", "axes": "xz", 3: "motion",
    "loops": "loop", "couplings": "coupling", "latches": "latch", "brakes": "brake",
    2: "end", 5: "power",
}  # fmt: skip
"""Dimensions of the file. In the plane links, joints and coordinates share one."""
_SIZES = {"xz": 2, "motion": 3, "end": 2, "power": 5}
_TREE = TreeVariables(NUMBERS, _DIMS)
_MIRROR = {
    "mirror_joint": Variable(("coordinate",), kind=int),
    "mirror_sign": Variable(("coordinate",)),
    "mirror_contact": Variable(("contact",), kind=int),
    "mirror_foot": Variable(("foot",), kind=int),
}
_OUTLINES = Bodies("outline", "xz", Outline)


def robot_to_dataset(robot: Robot) -> xarray.Dataset:
    """Return the numbers and names of a robot as a dataset."""
    values: dict[str, Any] = {}
    if robot.mirror is not None:
        values |= {name: getattr(robot.mirror, name.removeprefix("mirror_")) for name in _MIRROR}
    if robot.outlines:
        values |= _OUTLINES.values(robot.outlines, 2)
    attributes = {"floating": int(robot.floating), "symmetric": int(robot.mirror is not None)}
    return _TREE.to_dataset(robot, _OUTLINES.variables | _MIRROR, values, attributes)


def stored_robot(contents: Mapping[str, NDArray[Any]]) -> Robot:
    """Build the robot that :func:`robot_to_dataset` described.

    Parameters
    ----------
    contents : mapping
        Its variables by name, numbers or texts; its attributes, without dimensions, by their name
        after an @.

    Raises
    ------
    ValueError
        If anything is missing, of the wrong shape, or points outside the robot.
    """
    stored, sizes = Stored(contents), _SIZES.copy()
    model = Model(**stored.arrays(_TREE.numbers, sizes), pivot=stored.count("pivot"))
    parts = _TREE.parts(stored, sizes)
    mirror = None
    if stored.count("symmetric"):
        arrays = stored.arrays(_MIRROR, sizes)
        mirror = Mirror(**{name.removeprefix("mirror_"): each for name, each in arrays.items()})
    robot = Robot(
        **parts,
        model=model,
        mirror=mirror,
        floating=bool(stored.count("floating")),
        outlines=_OUTLINES.stored(stored, sizes) if "outline_link" in contents else (),
    )
    _check(robot)
    return robot


def _check(robot: Robot) -> None:
    """Refuse numbers that would send the compiled kernels outside their arrays, or astray."""
    model = robot.model
    feet = np.array([foot.link for foot in robot.feet])
    astray: dict[str, Any] = {
        "parent": np.any(model.parent >= np.arange(robot.nl)),
        "foot_link": np.any((feet < 0) | (feet >= robot.nl)),
        "outline_link": any(not 0 <= each.link < robot.nl for each in robot.outlines),
    }
    for name, number in NUMBERS.items():
        values = np.asarray(getattr(model, name))
        if name in (*SCALES, "brake_limit") and not np.all(
            (values >= number.least) & (values <= number.most)
        ):
            raise DamageError(f"{name} must be {bounds(name)}")
        if number.points:
            high = model.extents[number.points]
            astray[name] = astray.get(name) or np.any((values < number.least) | (values >= high))
    for name, whether in astray.items():
        if whether:
            raise DamageError(f"{name} points outside the robot")
    if any(not foot.contacts for foot in robot.feet):
        raise DamageError("a foot has no contact points")
    if not math.isfinite(robot.total_mass) or np.any(model.mass < 0.0):
        raise DamageError("masses must be finite and not negative")
    if robot.mirror is not None:
        for name, size in (("joint", robot.nj), ("contact", robot.nc), ("foot", len(robot.feet))):
            if sorted(getattr(robot.mirror, name)) != list(range(size)):
                raise DamageError(f"mirror_{name} is not an exchange of left and right")
        if np.any(np.abs(robot.mirror.sign) != 1.0):
            raise DamageError("mirror_sign must be 1 or -1")
