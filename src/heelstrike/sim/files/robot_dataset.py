"""A robot as a dataset: its numbers and names, enough to be the same robot again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.robot.mirror import Mirror
from heelstrike.robot.model import NUMBERS, Model
from heelstrike.robot.robot import Foot, Robot

if TYPE_CHECKING:
    import xarray

_DIMS: dict[str | int, str] = {
    "nl": "coordinate", "nj": "coordinate", "nq": "coordinate", "nv": "coordinate",
    "nc": "contact", "nu": "actuator", "axes": "xz", 3: "motion",
}  # fmt: skip
"""Dimensions of the file. In the plane links, joints and coordinates share one."""
_ARRAYS = {name: number for name, number in NUMBERS.items() if number.shape}
_DIMS_OF = {name: tuple(_DIMS[size] for size in one.shape) for name, one in _ARRAYS.items()}
_NAMES = {
    "joint_names": "coordinate",
    "link_names": "coordinate",
    "actuator_names": "actuator",
    "contact_names": "contact",
}
_MIRROR = {"joint": "coordinate", "sign": "coordinate", "contact": "contact", "foot": "foot"}


def robot_to_dataset(robot: Robot) -> xarray.Dataset:
    """Return the numbers and names of a robot as a dataset."""
    import xarray

    variables: dict[str, Any] = {
        name: (_DIMS_OF[name], getattr(robot.model, name), {"units": one.unit} if one.unit else {})
        for name, one in _ARRAYS.items()
    }
    for name, dim in _NAMES.items():
        variables[name] = ((dim,), np.array(getattr(robot, name), dtype=object))
    variables["foot_name"] = (("foot",), np.array([f.name for f in robot.feet], dtype=object))
    variables["foot_link"] = (("foot",), np.array([f.link for f in robot.feet], dtype=np.int64))
    foot_of = np.full(robot.nc, -1)
    for index, foot in enumerate(robot.feet):
        foot_of[list(foot.contacts)] = index
    variables["contact_foot"] = (("contact",), foot_of)
    if robot.contact_friction:
        variables["contact_friction"] = (("contact",), np.array(robot.contact_friction))
    if robot.mirror is not None:
        for name, dim in _MIRROR.items():
            variables[f"mirror_{name}"] = ((dim,), getattr(robot.mirror, name))
    # NetCDF has no lists of no text: names of nothing are left out.
    variables = {
        name: value
        for name, value in variables.items()
        if value[1].dtype.kind != "O" or len(value[1])
    }
    attributes = {
        "name": robot.name,
        "source": robot.source,
        "floating": int(robot.floating),
        "symmetric": int(robot.mirror is not None),
        "pivot": int(robot.model.pivot),
    }
    return xarray.Dataset(variables, attrs=attributes)


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

    def found(name: str) -> NDArray[Any]:
        if name not in contents:
            raise ValueError(f"{name.lstrip('@')} is missing")
        return contents[name]

    sizes = {
        "coordinate": found("parent").size,
        "contact": found("contact_link").size,
        "actuator": found("actuator_joint").size,
        "foot": found("foot_link").size,
        "motion": 3,
        "xz": 2,
    }

    def numbers(name: str, dims: tuple[str, ...], kind: type) -> Any:
        shape = tuple(sizes[dim] for dim in dims)
        if name in _ARRAYS and _ARRAYS[name].later and name not in contents:
            return np.full(shape, _ARRAYS[name].default)
        values = found(name)
        if values.shape != shape or values.dtype.kind not in "fi":
            raise ValueError(f"{name} is not an array of numbers of shape {shape}")
        if kind is np.int64 and values.dtype.kind != "i":
            raise ValueError(f"{name} does not hold whole numbers")
        return np.ascontiguousarray(values, dtype=kind)

    def texts(name: str, dim: str) -> tuple[str, ...]:
        if not sizes[dim]:
            return ()
        values = found(name)
        if values.shape != (sizes[dim],) or values.dtype.kind != "U":
            raise ValueError(f"{name} does not have {sizes[dim]} names")
        return tuple(values.tolist())

    def attribute(name: str, kind: str) -> Any:
        value = found(f"@{name}")
        if value.ndim or value.dtype.kind != kind:
            raise ValueError(f"{name} is not {'text' if kind == 'U' else 'a whole number'}")
        return value.item()

    model = Model(
        **{name: numbers(name, _DIMS_OF[name], one.dtype.type) for name, one in _ARRAYS.items()},
        pivot=attribute("pivot", "i"),
    )
    foot_link = numbers("foot_link", ("foot",), np.int64)
    contact_foot = numbers("contact_foot", ("contact",), np.int64)
    if np.any(contact_foot < -1) or np.any(contact_foot >= len(foot_link)):
        raise ValueError("contact_foot points outside the robot")
    feet = tuple(
        Foot(name, int(link), tuple(int(i) for i in np.flatnonzero(contact_foot == index)))
        for index, (name, link) in enumerate(
            zip(texts("foot_name", "foot"), foot_link, strict=True)
        )
    )
    mirror = None
    if attribute("symmetric", "i"):
        mirror = Mirror(
            **{
                name: numbers(f"mirror_{name}", (dim,), np.float64 if name == "sign" else np.int64)
                for name, dim in _MIRROR.items()
            }
        )
    friction: tuple[float, ...] = ()
    if "contact_friction" in contents:
        friction = tuple(numbers("contact_friction", ("contact",), np.float64).tolist())
    names: dict[str, Any] = {name: texts(name, dim) for name, dim in _NAMES.items()}
    robot = Robot(
        name=attribute("name", "U"),
        model=model,
        **names,
        feet=feet,
        mirror=mirror,
        floating=bool(attribute("floating", "i")),
        contact_friction=friction,
        source=attribute("source", "U"),
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
    }
    for name, number in NUMBERS.items():
        values = np.asarray(getattr(model, name))
        if number.points:
            high = model.extents[number.points]
            astray[name] = astray.get(name) or np.any((values < number.least) | (values >= high))
    for name, whether in astray.items():
        if whether:
            raise ValueError(f"{name} points outside the robot")
    for name, number in _ARRAYS.items():
        values = getattr(model, name)
        bad = np.isnan(values) if number.infinite else ~np.isfinite(values)
        if np.any(bad):
            raise ValueError(f"{name} is not finite")
    if not all(0.0 <= friction < math.inf for friction in robot.contact_friction):
        raise ValueError("contact_friction must be finite and not negative")
    if any(not foot.contacts for foot in robot.feet):
        raise ValueError("a foot has no contact points")
    if not math.isfinite(robot.total_mass) or np.any(model.mass < 0.0):
        raise ValueError("masses must be finite and not negative")
    if robot.mirror is not None:
        for name, size in (("joint", robot.nj), ("contact", robot.nc), ("foot", len(robot.feet))):
            if sorted(getattr(robot.mirror, name)) != list(range(size)):
                raise ValueError(f"mirror_{name} is not an exchange of left and right")
        if np.any(np.abs(robot.mirror.sign) != 1.0):
            raise ValueError("mirror_sign must be 1 or -1")
