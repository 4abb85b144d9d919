"""The robot as the kernels see it: a planar tree of links, as plain arrays.

Every number of a robot is declared here, once: whose it is, its unit, its bounds, what a robot has
of which nobody said it, and whether left and right share it. Builder, files, the mirror image,
inspection and documentation follow. One that a joint or link has is also a key of
:class:`JointProperties`, for type checkers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, Member, extent

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Pair = Sequence[float]
Limits = float | Sequence[float]

AXES = 2
"""Dimension of space."""


@dataclass(frozen=True, kw_only=True)
class Number(Member):
    """What is known of a number of the robot.

    Attributes
    ----------
    doc, unit : str
        What it is, and in what unit: that of a hinge, that of a slide.
    default : float, optional
        What a robot has of which nobody said it.
    least : float
        The least that it may be.
    infinite : bool
        Whether it may be infinite, which stands for none.
    alike : bool
        Whether left and right share it as it is, whatever the senses of their joints.
    later : bool
        Whether there are run files that are older, and mean the default.
    given, label : str
        What the builder and messages call it, if not by its name.
    points : str
        The extent that an index counts.
    """

    doc: str = ""
    unit: str = ""
    default: float | None = None
    least: float = -math.inf
    infinite: bool = False
    alike: bool = False
    later: bool = False
    given: str = ""
    label: str = ""
    points: str = ""


def of(*shape: str | int, kind: type = float, **about: Any) -> Any:
    """Declare a number of the robot; see :class:`Number`."""
    return Number(role="array" if shape else "number", kind=kind, shape=shape, **about)


class Model(Bundle):
    """A planar kinematic tree with inertia, contact points and actuators.

    Every link hangs on its parent by one joint of one degree of freedom, so that link ``i`` and
    coordinate ``i`` belong together; a body with several joints becomes a chain of links of which
    all but the last are massless. All link frames are parallel to the world frame when ``q``
    equals `reference`; vectors are (x, z) pairs in link axes, lengths in metres.

    Attributes
    ----------
    nl, nj, nq, nv : int
        Number of links, of joints (one a link), of positions and of velocities. In the plane they
        are equal; each counts what it says.
    nc, nu : int
        Number of contact points and of actuators.
    axes : int
        Dimension of space.
    """

    nl: int = extent()
    nj: int = extent()
    nq: int = extent()
    nv: int = extent()
    nc: int = extent()
    nu: int = extent()
    axes: int = extent()

    parent: Integers = of(
        "nl", kind=int, points="nl", least=-1,
        doc="Index of the parent link, smaller than the link's own; -1 for the world.",
    )  # fmt: skip
    axis: Floats = of(
        "nj", 3, unit="1",
        doc="Motion of the joint per unit of its coordinate, in the parent's axes: rotation about "
        "+y (rad), translation along x and z (m). (±1, 0, 0) is a hinge, (0, x, z) a slide.",
    )  # fmt: skip
    offset: Floats = of(
        "nj", "axes", unit="m", alike=True, label="place",
        doc="Origin of the link frame in the parent's frame when q equals reference",
    )  # fmt: skip
    reference: Floats = of(
        "nq", unit="rad, m", default=0.0, given="reference",
        doc="Coordinate at which the robot stands as it is described, all link frames parallel to "
        "the world frame",
    )  # fmt: skip
    mass: Floats = of("nl", unit="kg", default=0.0, least=0.0, alike=True, given="mass", doc="Mass")
    center_of_mass: Floats = of(
        "nl", "axes", unit="m", default=0.0, alike=True, given="center_of_mass",
        label="centre of mass", doc="Centre of mass (x, z) in the link frame",
    )  # fmt: skip
    inertia: Floats = of(
        "nl", unit="kg m²", default=0.0, least=0.0, alike=True, given="inertia",
        doc="Moment of inertia about the link's own centre of mass",
    )  # fmt: skip
    armature: Floats = of(
        "nv", unit="kg m², kg", default=0.0, least=0.0, alike=True, given="armature",
        doc="Rotor inertia as the joint feels it",
    )  # fmt: skip
    damping: Floats = of(
        "nv", unit="N m s/rad, N s/m", default=0.0, least=0.0, alike=True, given="damping",
        doc="Viscous damping",
    )  # fmt: skip
    stiffness: Floats = of(
        "nv", unit="N m/rad, N/m", default=0.0, least=0.0, alike=True, given="stiffness",
        doc="Stiffness of the joint's spring",
    )  # fmt: skip
    rest: Floats = of(
        "nq", unit="rad, m", default=0.0, given="rest",
        doc="Coordinate at which the spring is slack",
    )  # fmt: skip
    dry_friction: Floats = of(
        "nv", unit="N m, N", default=0.0, least=0.0, alike=True, later=True, given="dry_friction",
        doc="Coulomb friction: what it takes to move the joint at all, and what opposes it as it "
        "moves",
    )  # fmt: skip
    lower: Floats = of(
        "nq", unit="rad, m", default=-math.inf, infinite=True,
        doc="Least coordinate, a stop; infinite where there is none",
    )  # fmt: skip
    upper: Floats = of(
        "nq", unit="rad, m", default=math.inf, infinite=True,
        doc="Greatest coordinate, likewise",
    )  # fmt: skip
    speed_limit: Floats = of(
        "nv", unit="rad/s, m/s", default=math.inf, least=0.0, infinite=True, alike=True,
        later=True, given="speed",
        doc="Greatest speed that the drive stands, which gaits keep to; infinite where there is "
        "none",
    )  # fmt: skip
    gravity: Floats = of("axes", unit="m/s²", doc="Acceleration of free fall")
    contact_link: Integers = of(
        "nc", kind=int, points="nl", least=0, doc="Link that carries each contact point."
    )
    contact_position: Floats = of(
        "nc", "axes", unit="m", doc="Centre of each contact disc in the link frame"
    )
    contact_radius: Floats = of(
        "nc", unit="m", default=0.0, least=0.0, doc="Radius of each disc; zero for a point"
    )
    actuator_joint: Integers = of(
        "nu", kind=int, points="nv", least=0, doc="Coordinate that each actuator drives."
    )
    torque_lower: Floats = of(
        "nu", unit="N m, N", default=-math.inf, infinite=True,
        doc="Least torque at the joint; infinite where there is no limit",
    )  # fmt: skip
    torque_upper: Floats = of(
        "nu", unit="N m, N", default=math.inf, infinite=True,
        doc="Greatest torque at the joint, likewise",
    )  # fmt: skip
    pivot: int = of(
        kind=int, points="nl", least=0,
        doc="Link whose origin serves as the reference point of spatial vectors, so that a robot "
        "far from the world origin loses no digits.",
    )  # fmt: skip

    @classmethod
    def made(cls, **members: Any) -> Model:
        """Make a model of anything array-like; lists may be empty."""
        made = dict(members)
        for name, number in NUMBERS.items():
            if number.shape:
                rest = [AXES if size == "axes" else size for size in number.shape[1:]]
                values = np.array(members[name], dtype=number.dtype, order="C")
                made[name] = values.reshape(-1, *rest)
        return cls(**made)


class JointProperties(TypedDict, total=False):
    """What a link and the joint that moves it may have; nothing is required.

    Attributes
    ----------
    limits : (2,) float
        Range of the coordinate (rad, m); unlimited by default.
    torque : float or (2,) float
        Greatest torque of the motor at the joint (N m, N) either way, or its two limits; infinity
        for a motor without limits. A joint without it has no motor.
    gear, motor_inertia : float
        Ratio of the gear, and the inertia of the motor before it: they add
        ``gear**2 * motor_inertia`` to the armature. Torque and speed are those at the joint.
    """

    mass: float
    inertia: float
    center_of_mass: Pair
    reference: float
    limits: Pair
    damping: float
    stiffness: float
    rest: float
    dry_friction: float
    armature: float
    torque: Limits
    speed: float
    gear: float
    motor_inertia: float


NUMBERS: dict[str, Number] = {
    name: member for name, member in Model.declared.items() if isinstance(member, Number)
}
"""All that a model consists of."""

PROPERTIES = {name: number for name, number in NUMBERS.items() if number.given}
"""Numbers of a link and its joint that a user gives, each by itself."""


def label(name: str) -> str:
    """Return what messages call a number."""
    return NUMBERS[name].label or name.replace("_", " ")


def _described(name: str, number: Number, shape: tuple[str | int, ...]) -> str:
    size = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)}) " if shape else ""
    unit = f" ({number.unit})." if number.unit else ""
    return f"    {name} : {size}{number.kind.__name__}\n        {number.doc}{unit}\n"


Model.__doc__ = f"{Model.__doc__}" + "".join(
    _described(name, number, number.shape) for name, number in NUMBERS.items()
)
JointProperties.__doc__ = f"{JointProperties.__doc__}" + "".join(
    _described(number.given, number, number.shape[1:]) for number in PROPERTIES.values()
)
