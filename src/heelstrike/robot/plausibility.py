"""Numbers that are possible and still not meant: degrees for radians, millimetres for metres."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterator, Sequence

import numpy as np

from heelstrike.field_texts import dataclass
from heelstrike.robot.model import Floats, Model

LARGEST_EXTENT = 100.0
"""Metres; no walking robot is larger."""

LARGEST_DENSITY = 1000.0
"""kg/m³ of the cube around a robot of several links; of people it is 13, of stout robots 200."""

LARGEST_GRAVITY = 50.0
"""m/s²; on Jupiter it is 25."""

FEW_TURNS = (4.0 * np.pi, 720.0)
"""Limits of a hinge that look like degrees where radians are meant."""


class FindingKind(enum.Enum):
    """What is wrong with a robot."""

    ASYMMETRY = "left and right differ"
    INERTIA = "impossible inertia"
    MASS = "mass missing"
    FRICTION = "feet of different friction"
    CONTACT = "contact points above the sole"
    FOOT = "feet"
    LIMIT = "limits"
    UNIT = "units"
    FILE = "said by the reader"


@dataclass(frozen=True)
class Finding:
    """A likely mistake in a robot."""

    kind: FindingKind
    """What it is about."""
    message: str
    """What was found, where, with the numbers."""

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.message}"


def is_possible(tensor: Floats) -> bool:
    """Whether a body can have a tensor of inertia (3, 3): no principal moment is more than two."""
    if not np.all(np.isfinite(tensor)):
        return False
    moments = np.linalg.eigvalsh(tensor)
    return bool(moments[0] >= 0.0 and moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9))


def unlikely_numbers(
    model: Model, origin: Floats, joint_names: Sequence[str], link_names: Sequence[str]
) -> Iterator[Finding]:
    """Find numbers that no robot is likely to have.

    Parameters
    ----------
    model : Model
        The robot's arrays.
    origin : (nv, 2) float
        World positions of its links in the reference configuration.
    joint_names, link_names : sequence of str
        Its names.
    """
    yield from _units(model, origin)
    yield from _inertias(model, origin, link_names)
    yield from _limits(model, joint_names)


def _extent(model: Model, origin: Floats) -> float:
    """Largest distance along x or z between joints, centres of mass and contact points, in m."""
    massive = model.mass > 0.0
    turning = model.axis[:, 0] != 0.0  # the frame of a slide may be anywhere
    points = np.concatenate(
        (
            origin[turning],
            (origin + model.center_of_mass)[massive],
            origin[model.contact_link] + model.contact_position,
        )
    )
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def _units(model: Model, origin: Floats) -> Iterator[Finding]:
    size = _extent(model, origin)
    mass = float(model.mass.sum())
    gravity = float(np.hypot(*model.gravity))
    if size > LARGEST_EXTENT:
        yield Finding(FindingKind.UNIT, f"the robot measures {size:.4g} m. Millimetres for metres?")
    # Links reach beyond their centres of mass, so that the robot may be twice as large.
    if np.count_nonzero(model.mass) > 2 and 0.0 < (2.0 * size) ** 3 * LARGEST_DENSITY < mass:
        yield Finding(
            FindingKind.UNIT,
            f"the robot weighs {mass:.4g} kg and measures {size:.3g} m, more than a cube of water "
            "of twice that size. Grams for kilograms?",
        )
    if gravity > LARGEST_GRAVITY:
        yield Finding(FindingKind.UNIT, f"gravity is {gravity:.4g} m/s². Which unit?")


def _inertias(model: Model, origin: Floats, link_names: Sequence[str]) -> Iterator[Finding]:
    size = _extent(model, origin)
    if size == 0.0:
        return
    for link in np.flatnonzero(model.mass > 0.0):
        gyration = math.sqrt(model.inertia[link] / model.mass[link])
        if gyration > 2.0 * size:
            yield Finding(
                FindingKind.INERTIA,
                f"link {link_names[int(link)]!r} has the radius of gyration {gyration:.3g} m, more "
                f"than twice the robot's extent of {size:.3g} m. Is its inertia in kg m²?",
            )


def _limits(model: Model, joint_names: Sequence[str]) -> Iterator[Finding]:
    for joint, name in enumerate(joint_names):
        farthest = max(
            (abs(end) for end in (model.lower[joint], model.upper[joint]) if np.isfinite(end)),
            default=0.0,
        )
        if model.axis[joint, 0] and FEW_TURNS[0] < farthest < FEW_TURNS[1]:
            yield Finding(
                FindingKind.LIMIT,
                f"{name} may turn {farthest / (2 * np.pi):.3g} times around. Degrees for radians?",
            )
