"""The robot as the kernels see it: a planar tree of links, as plain arrays.

Every number of a robot is declared here, once: whose it is, its unit, its bounds, what a robot has
of which nobody said it, and whether left and right share it. Builder, files, the mirror image,
inspection and documentation follow. One that a joint or link has is also a key of
:class:`JointProperties`, for type checkers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, Member, extent
from heelstrike.field_texts import dataclass

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Pair = Sequence[float]
Limits = float | Sequence[float]

AXES = 2
"""Dimension of space."""

POWERS = 5
"""Coefficients of the polynomial by which a joint follows another."""

SELDOM = ("loops", "couplings", "latches", "brakes")
"""Extents of what most robots have nothing of."""


@dataclass(frozen=True, kw_only=True)
class Number(Member):
    """What is known of a number of the robot."""

    unit: str = ""
    """Unit of a hinge, and of a slide if that is another."""
    default: float | None = None
    """What a robot has of which nobody said it."""
    least: float = -math.inf
    most: float = math.inf
    """least, most: The least and the most that it may be."""
    infinite: bool = False
    """Whether it may be infinite, which stands for none."""
    alike: bool = False
    """Whether left and right share it as it is, whatever the senses of their joints."""
    given: bool = False
    """Whether it is one of :class:`JointProperties`, by itself."""
    later: bool = False
    """Whether there are run files that are older than it, and mean the default."""
    called: str = ""
    label: str = ""
    """called, label: What the builder and messages call it, if not by its name."""
    points: str = ""
    """The extent that an index counts."""


def of(*shape: str | int, kind: type = float, **about: Any) -> Any:
    """Declare a number of the robot; see :class:`Number`."""
    return Number(role="array" if shape else "number", kind=kind, shape=shape, **about)


_POSE: dict[str, Any] = {"default": 0.0, "given": True}
_PART: dict[str, Any] = {"default": 0.0, "given": True, "least": 0.0, "alike": True}
_LIMIT: dict[str, Any] = {"infinite": True}
_UNKNOWN: dict[str, Any] = {"default": math.inf}
_SCALE: dict[str, Any] = {"default": 1.0, "least": 0.0, "later": True}
_LATER: dict[str, Any] = {"default": 0, "later": True}


class Model(Bundle):
    """A planar kinematic tree with inertia, contact points and actuators.

    Every link is attached to its parent by one joint of one degree of freedom. So link ``i`` and
    coordinate ``i`` belong together; a body with several joints becomes a chain of links of which
    all but the last are massless. All link frames are parallel to the world frame when ``q``
    equals `reference`; vectors are (x, z) pairs in link axes, lengths in metres.
    """

    nl: int = extent()
    nj: int = extent()
    nq: int = extent()
    nv: int = extent()
    """nl, nj, nq, nv: Number of links, of joints (one a link), of positions and of velocities. In
    the plane they are equal; each counts what it says."""
    nc: int = extent()
    nu: int = extent()
    """nc, nu: Number of contact points and of actuators."""
    loops: int = extent()
    couplings: int = extent()
    latches: int = extent()
    brakes: int = extent()
    """loops, couplings, latches, brakes: Number of closed loops, of coupled joints, of latches and
    of brakes."""
    axes: int = extent()
    """Dimension of space."""

    parent: Integers = of("nl", kind=int, points="nl", least=-1)
    """Index of the parent link, smaller than the link's own; -1 for the world."""
    axis: Floats = of("nj", 3, unit="rad, m")
    """Motion of the joint per unit of its coordinate, in the parent's axes: rotation about +y
    (rad), translation along x and z (m). ``(±1, 0, 0)`` is a hinge, ``(0, x, z)`` a slide."""
    offset: Floats = of("nj", "axes", unit="m", alike=True, label="place")
    """Origin of the link frame in the parent's frame when ``q`` equals `reference`."""
    reference: Floats = of("nq", unit="rad, m", **_POSE)
    """Coordinates at which all link frames are parallel to the world frame."""
    mass: Floats = of("nl", unit="kg", **_PART)
    """Mass of the link."""
    center_of_mass: Floats = of("nl", "axes", unit="m", alike=True, label="centre of mass", **_POSE)
    """In the link frame."""
    inertia: Floats = of("nl", unit="kg m²", **_PART)
    """Moment of inertia about the link's own centre of mass."""
    armature: Floats = of("nv", unit="kg m², kg", **_PART)
    """Inertia of the rotor."""
    damping: Floats = of("nv", unit="N m s/rad, N s/m", **_PART)
    """Viscous damping."""
    stiffness: Floats = of("nv", unit="N m/rad, N/m", **_PART)
    """Stiffness of the spring."""
    rest: Floats = of("nq", unit="rad, m", **_POSE)
    """Coordinate at which the spring is slack."""
    dry_friction: Floats = of("nv", unit="N m, N", later=True, **_PART)
    """Coulomb friction of the joint: what it takes to move it at all, and what
    opposes it as it moves."""
    lower: Floats = of("nq", unit="rad, m", **_LIMIT)
    upper: Floats = of("nq", unit="rad, m", **_LIMIT)
    """lower, upper: Range of the coordinate; infinite where there is no stop."""
    speed_limit: Floats = of(
        "nv",
        unit="rad/s, m/s",
        later=True,
        called="speed",
        **_LIMIT | _PART | _UNKNOWN,
    )
    """Greatest speed that the drive of the joint stands, which gaits keep to; infinite
    where there is none."""
    stall_torque: Floats = of("nv", unit="N m, N", later=True, **_LIMIT | _PART | _UNKNOWN)
    """Torque of the motor at rest and full voltage, seen at the joint; infinite
    if unknown, and then nothing but `torque_lower` and `torque_upper` limits it."""
    no_load_speed: Floats = of("nv", unit="rad/s, m/s", later=True, **_LIMIT | _PART | _UNKNOWN)
    """Speed of the joint at which that torque is zero, falling along a straight line;
    infinite if unknown, and then it does not fall."""
    winding_resistance: Floats = of("nv", unit="ohm", later=True, **_PART)
    """Electrical resistance of the motor; zero if unknown."""
    gravity: Floats = of("axes", unit="m/s²")
    """Acceleration of free fall, (0, -9.81) on earth."""
    contact_link: Integers = of("nc", kind=int, points="nl", least=0)
    """Link that carries each contact point."""
    contact_position: Floats = of("nc", "axes", unit="m")
    """Centre of each contact disc in the link frame."""
    contact_radius: Floats = of("nc", unit="m", least=0.0)
    """Radius of each contact disc; zero for a point."""
    friction_scale: Floats = of("nc", **_SCALE)
    restitution_scale: Floats = of("nc", most=1.0, **_SCALE)
    """friction_scale, restitution_scale: What friction and restitution of the ground are multiplied
    by under each contact point; restitution by one at most."""
    actuator_joint: Integers = of("nu", kind=int, points="nv", least=0)
    """Coordinate that each actuator drives."""
    torque_lower: Floats = of("nu", unit="N m, N", **_LIMIT)
    torque_upper: Floats = of("nu", unit="N m, N", **_LIMIT)
    """torque_lower, torque_upper: Limits of torque or force at the joint; infinite where there is
    none."""
    loop_link: Integers = of("loops", 2, kind=int, points="nl", least=-1, **_LATER)
    """The two links that each closed loop joins by a hinge, -1 for the world."""
    loop_position: Floats = of("loops", 2, "axes", unit="m", **_LATER)
    """Where the hinge is on each of them, in the frame of the link."""
    coupling_joint: Integers = of("couplings", 2, kind=int, points="nv", least=-1, **_LATER)
    """Joint that follows another and the one that leads it, -1 if it is held where it is."""
    coupling_polynomial: Floats = of("couplings", POWERS, unit="rad, m", **_LATER)
    """How far from its `reference` the follower is: coefficients c₀ … c₄ of the powers of
    how far the leader is from its own."""
    latch_joint: Integers = of("latches", kind=int, points="nv", least=0, **_LATER)
    """Joint that each latch holds once it has reached an end of its range."""
    latch_side: Integers = of("latches", kind=int, least=-1, **_LATER)
    """That end: 1 for the upper, -1 for the lower."""
    latch_release: Integers = of("latches", kind=int, points="nl", least=-1, **_LATER)
    """Link whose touchdown makes it let go; -1 if none does."""
    brake_joint: Integers = of("brakes", kind=int, points="nv", least=0, **_LATER)
    """Joint that each brake holds wherever it is, while it is on."""
    brake_limit: Floats = of("brakes", unit="N m, N", least=0.0, later=True, **_LIMIT | _UNKNOWN)
    """Torque or force beyond which it slips, and goes on rubbing with; infinite for one
    that does not slip."""
    pivot: int = of(kind=int, points="nl", least=0)
    """Link whose origin serves as the reference point of spatial vectors, so that a robot far from
    the world origin loses no digits."""

    @classmethod
    def made(cls, **members: Any) -> Model:
        """Make a model of anything array-like; lists may be empty.

        Parameters
        ----------
        **members : array
            Every member by its name; loops, couplings, latches and brakes only where there are any.

        Returns
        -------
        Model
            The model.
        """
        made = dict(members)
        for name, number in NUMBERS.items():
            if number.shape:
                rest = [AXES if size == "axes" else size for size in number.shape[1:]]
                given = members.get(name, ()) if number.shape[0] in SELDOM else members[name]
                values = np.array(given, dtype=number.dtype, order="C")
                made[name] = values.reshape(-1, *rest)
        return cls(**made)


class JointProperties(TypedDict, total=False):
    """What a link and the joint that moves it may have; nothing is required.

    Attributes
    ----------
    mass, inertia : float
        Mass (kg) and moment of inertia about the link's own centre of mass (kg m²), zero by
        default.
    center_of_mass : (2,) float
        Centre of mass (x, z) in the link frame (m).
    reference : float
        Coordinate at which the robot stands as it is described, zero by default.
    limits : (2,) float
        Range of the coordinate (rad, m); unlimited by default.
    damping : float
        Viscous damping (N m s/rad, N s/m).
    stiffness, rest : float
        Spring (N m/rad, N/m) and the coordinate at which it is slack.
    dry_friction : float
        Coulomb friction (N m, N).
    armature : float
        Rotor inertia as the joint feels it (kg m², kg).
    torque : float or (2,) float
        Greatest torque of the motor at the joint (N m, N) either way, or its two limits; infinity
        for a motor without limits. A joint without it has no motor.
    speed : float
        Greatest speed that the drive stands (rad/s, m/s).
    stall_torque, no_load_speed : float
        The motor's straight line from its torque at rest (N m, N) to its speed without load (rad/s,
        m/s), both at full voltage and seen at the joint. No torque exceeds it, whatever `torque`
        allows; without a stall torque there is no line.
    winding_resistance : float
        Electrical resistance of the motor (ohm), which tells the volts of the full voltage.
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
    stall_torque: float
    no_load_speed: float
    winding_resistance: float
    gear: float
    motor_inertia: float


NUMBERS: dict[str, Number] = {
    name: member for name, member in Model.declared.items() if isinstance(member, Number)
}
"""All that a model consists of."""

PROPERTIES = {name: number for name, number in NUMBERS.items() if number.given}
"""Numbers of a link and its joint that a user gives, each by itself."""

SCALES = ("friction_scale", "restitution_scale")
"""Numbers of a contact point that tell it from others on the same ground."""


def label(name: str) -> str:
    """Return what messages call a number."""
    return NUMBERS[name].label or name.replace("_", " ")


def bounds(name: str) -> str:
    """Return what messages say that a number may be."""
    least, most = NUMBERS[name].least, NUMBERS[name].most
    return f"between {least:g} and {most:g}" if math.isfinite(most) else f"{least:g} or more"
