"""What every robot has, as variables of a file: numbers, names, feet and friction."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from heelstrike.robot.model import SELDOM, Number
from heelstrike.robot.named_tree import Foot, NamedTree
from heelstrike.sim.files.variables import DamageError, Stored, Variable

if TYPE_CHECKING:
    import xarray

_FEET = {
    "foot_link": Variable(("foot",), kind=int),
    "foot_name": Variable(("foot",), kind=str),
    "contact_foot": Variable(("contact",), kind=int),
}
_FRICTION = {"contact_friction": Variable(("contact",))}


class TreeVariables:
    """What every robot of a dimension has, as variables of a file.

    Parameters
    ----------
    numbers : mapping of str to Number
        Declarations of its model.
    dims : mapping
        What the file calls the extents of their arrays.
    following : collection of str
        Numbers that follow from the others.
    """

    def __init__(
        self, numbers: Mapping[str, Number], dims: Mapping[str | int, str],
        following: Collection[str] = (),
    ) -> None:  # fmt: skip
        self.numbers = {
            name: Variable(
                tuple(dims[size] for size in number.shape),
                number.unit,
                kind=number.kind,
                allowed="infinite" if number.infinite else "",
                default=number.default if number.later else None,
            )
            for name, number in numbers.items()
            if number.shape and name not in following
        }
        self._seldom = {name for name in self.numbers if numbers[name].shape[0] in SELDOM}
        self._names = {
            f"{part}_names": Variable((dims[extent],), kind=str)
            for part, extent in (
                ("joint", "nj"), ("link", "nl"), ("actuator", "nu"), ("contact", "nc")
            )
        }  # fmt: skip

    def to_dataset(
        self, robot: Any, more: Mapping[str, Variable], values: Mapping[str, Any],
        attributes: Mapping[str, int],
    ) -> xarray.Dataset:  # fmt: skip
        """Return a robot as a dataset, with variables and attributes of its own dimension."""
        import xarray

        told: dict[str, Any] = {
            name: each
            for name in self.numbers
            if (each := getattr(robot.model, name)).size or name not in self._seldom
        }
        told |= {name: getattr(robot, name) for name in self._names} | _told_feet(robot)
        if robot.contact_friction:
            told["contact_friction"] = robot.contact_friction
        declared = self.numbers | self._names | _FEET | _FRICTION | dict(more)
        # NetCDF has no lists of no text: names of nothing are left out.
        variables = {
            name: declared[name].written(each)
            for name, each in (told | dict(values)).items()
            if declared[name].kind is not str or len(each)
        }
        named = {"name": robot.name, "source": robot.source}
        attrs = named | dict(attributes) | {"pivot": int(robot.model.pivot)}
        return xarray.Dataset(variables, attrs=attrs)

    def parts(self, stored: Stored, sizes: dict[str, int]) -> dict[str, Any]:
        """Return all of a stored robot but its model, as fields that every robot has.

        Raises
        ------
        DamageError
            If anything is missing, or a contact point is of no foot that is there.
        """
        names = stored.arrays(self._names, sizes)
        feet = _feet_of(stored, sizes)
        friction: list[float] = []
        if "contact_friction" in stored.contents:
            friction = stored.arrays(_FRICTION, sizes)["contact_friction"].tolist()
        if any(each < 0.0 for each in friction):
            raise DamageError("contact_friction must not be negative")
        return {
            "name": stored.text("name"),
            **{name: tuple(each.tolist()) for name, each in names.items()},
            "feet": feet,
            "contact_friction": tuple(friction),
            "source": stored.text("source"),
        }


def _told_feet(robot: NamedTree) -> dict[str, Any]:
    """Return the feet of a robot as columns."""
    foot_of = np.full(robot.nc, -1)
    for index, foot in enumerate(robot.feet):
        foot_of[list(foot.contacts)] = index
    return {
        "foot_link": [foot.link for foot in robot.feet],
        "foot_name": [foot.name for foot in robot.feet],
        "contact_foot": foot_of,
    }


def _feet_of(stored: Stored, sizes: dict[str, int]) -> tuple[Foot, ...]:
    foot_link, foot_name, contact_foot = stored.arrays(_FEET, sizes).values()
    if np.any(contact_foot < -1) or np.any(contact_foot >= len(foot_link)):
        raise DamageError("contact_foot points outside the robot")
    return tuple(
        Foot(name, link, tuple(np.flatnonzero(contact_foot == index).tolist()))
        for index, (name, link) in enumerate(
            zip(foot_name.tolist(), foot_link.tolist(), strict=True)
        )
    )


class Bodies:
    """Convex bodies on links, such as outlines and solids, as variables of a file.

    Parameters
    ----------
    name : str
        What one of them is called.
    along : str
        Dimension of the file along which the coordinates of a corner are.
    kind : type
        Their class, of link, corners and radius.
    """

    def __init__(self, name: str, along: str, kind: Callable[..., Any]) -> None:
        self._name, self._kind = name, kind
        self.variables = {
            f"{name}_link": Variable((name,), kind=int),
            f"{name}_radius": Variable((name,), "m"),
            f"{name}_corners": Variable((name,), kind=int),
            f"{name}_corner": Variable(("corner", along), "m"),
        }

    def values(self, bodies: Sequence[Any], axes: int) -> dict[str, Any]:
        """Return bodies in a space of so many axes as values of the variables."""
        columns = (
            [each.link for each in bodies],
            [each.radius for each in bodies],
            [len(each.corners) for each in bodies],
            np.concatenate([np.zeros((0, axes)), *(each.corners for each in bodies)]),
        )
        return dict(zip(self.variables, columns, strict=True))

    def stored(self, stored: Stored, sizes: dict[str, int]) -> tuple[Any, ...]:
        """Make the bodies of a file."""
        link, radius, corners, corner = stored.arrays(self.variables, sizes).values()
        if np.any(corners < 1) or corners.sum() != len(corner) or np.any(radius < 0.0):
            raise DamageError(f"{self._name}s must have corners, and radii that are not negative")
        parts = np.split(corner, np.cumsum(corners)[:-1])[: len(link)]  # of nothing one is left
        return tuple(map(self._kind, link.tolist(), parts, radius.tolist()))
