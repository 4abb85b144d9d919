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

POWERS = 5
"""Coefficients of the polynomial by which a joint follows another."""

SELDOM = ("loops", "couplings", "latches", "brakes")
"""Extents of what most robots have nothing of."""


@dataclass(frozen=True, kw_only=True)
class Number(Member):
    """What is known of a number of the robot.

    Attributes
    ----------
    unit : str
        Unit of a hinge, and of a slide if that is another.
    default : float, optional
        What a robot has of which nobody said it.
    least, most : float
        The least and the most that it may be.
    infinite : bool
        Whether it may be infinite, which stands for none.
    alike : bool
        Whether left and right share it as it is, whatever the senses of their joints.
    given : bool
        Whether it is one of :class:`JointProperties`, by itself.
    later : bool
        Whether there are run files that are older than it, and mean the default.
    called, label : str
        What the builder and messages call it, if not by its name.
    points : str
        The extent that an index counts.
    """

    unit: str = ""
    default: float | None = None
    least: float = -math.inf
    most: float = math.inf
    infinite: bool = False
    alike: bool = False
    given: bool = False
    later: bool = False
    called: str = ""
    label: str = ""
    points: str = ""


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
    loops, couplings, latches, brakes : int
        Number of closed loops, of coupled joints, of latches and of brakes.
    axes : int
        Dimension of space.
    parent : (nl,) int
        Index of the parent link, smaller than the link's own; -1 for the world.
    axis : (nj, 3) float
        Motion of the joint per unit of its coordinate, in the parent's axes: rotation about +y
        (rad), translation along x and z (m). ``(±1, 0, 0)`` is a hinge, ``(0, x, z)`` a slide.
    offset : (nj, axes) float
        Origin of the link frame in the parent's frame when ``q`` equals `reference`.
    reference : (nq,) float
        Coordinates at which all link frames are parallel to the world frame.
    mass, inertia : (nl,) float
        Mass (kg) and moment of inertia about the link's own centre of mass (kg m²).
    center_of_mass : (nl, axes) float
        Centre of mass in the link frame.
    armature, damping, stiffness : (nv,) float
        Rotor inertia (kg m²), viscous damping (N m s) and spring (N m).
    rest : (nq,) float
        Coordinate at which the spring is slack.
    dry_friction : (nv,) float
        Coulomb friction of the joint (N m; N of a slide): what it takes to move it at all, and what
        opposes it as it moves.
    lower, upper : (nq,) float
        Range of the coordinate; infinite where there is no stop.
    speed_limit : (nv,) float
        Greatest speed that the drive of the joint stands (rad/s, m/s), which gaits keep to;
        infinite where there is none.
    stall_torque : (nv,) float
        Torque of the motor (N m; N of a slide) at rest and full voltage, seen at the joint;
        infinite if unknown, and then nothing but `torque_lower` and `torque_upper` limits it.
    no_load_speed : (nv,) float
        Speed of the joint (rad/s, m/s) at which that torque is zero, falling along a straight line;
        infinite if unknown, and then it does not fall.
    winding_resistance : (nv,) float
        Electrical resistance of the motor (ohm); zero if unknown.
    gravity : (axes,) float
        Acceleration of free fall (m/s²), (0, -9.81) on earth.
    contact_link : (nc,) int
        Link that carries each contact point.
    contact_position : (nc, axes) float
        Centre of each contact disc in the link frame.
    contact_radius : (nc,) float
        Radius of each contact disc; zero for a point.
    friction_scale, restitution_scale : (nc,) float
        What friction and restitution of the ground are multiplied by under each contact point;
        restitution by one at most.
    actuator_joint : (nu,) int
        Coordinate that each actuator drives.
    torque_lower, torque_upper : (nu,) float
        Torque (N m) or force (N) limits at the joint; infinite where there is none.
    loop_link : (loops, 2) int
        The two links that each closed loop joins by a hinge, -1 for the world.
    loop_position : (loops, 2, axes) float
        Where the hinge is on each of them, in the frame of the link (m).
    coupling_joint : (couplings, 2) int
        Joint that follows another and the one that leads it, -1 if it is held where it is.
    coupling_polynomial : (couplings, 5) float
        How far from its `reference` the follower is (rad, m): coefficients c₀ … c₄ of the powers of
        how far the leader is from its own.
    latch_joint : (latches,) int
        Joint that each latch holds once it has reached an end of its range.
    latch_side : (latches,) int
        That end: 1 for the upper, -1 for the lower.
    latch_release : (latches,) int
        Link whose touchdown makes it let go; -1 if none does.
    brake_joint : (brakes,) int
        Joint that each brake holds wherever it is, while it is on.
    brake_limit : (brakes,) float
        Torque (N m) or force (N) beyond which it slips, and goes on rubbing with; infinite for one
        that does not slip.
    pivot : int
        Link whose origin serves as the reference point of spatial vectors, so that a robot far
        from the world origin loses no digits.
    """

    nl: int = extent()
    nj: int = extent()
    nq: int = extent()
    nv: int = extent()
    nc: int = extent()
    nu: int = extent()
    loops: int = extent()
    couplings: int = extent()
    latches: int = extent()
    brakes: int = extent()
    axes: int = extent()

    parent: Integers = of("nl", kind=int, points="nl", least=-1)
    axis: Floats = of("nj", 3, unit="rad, m")
    offset: Floats = of("nj", "axes", unit="m", alike=True, label="place")
    reference: Floats = of("nq", unit="rad, m", **_POSE)
    mass: Floats = of("nl", unit="kg", **_PART)
    center_of_mass: Floats = of("nl", "axes", unit="m", alike=True, label="centre of mass", **_POSE)
    inertia: Floats = of("nl", unit="kg m²", **_PART)
    armature: Floats = of("nv", unit="kg m², kg", **_PART)
    damping: Floats = of("nv", unit="N m s/rad, N s/m", **_PART)
    stiffness: Floats = of("nv", unit="N m/rad, N/m", **_PART)
    rest: Floats = of("nq", unit="rad, m", **_POSE)
    dry_friction: Floats = of("nv", unit="N m, N", later=True, **_PART)
    lower: Floats = of("nq", unit="rad, m", **_LIMIT)
    upper: Floats = of("nq", unit="rad, m", **_LIMIT)
    speed_limit: Floats = of(
        "nv",
        unit="rad/s, m/s",
        later=True,
        called="speed",
        **_LIMIT | _PART | _UNKNOWN,
    )
    stall_torque: Floats = of("nv", unit="N m, N", later=True, **_LIMIT | _PART | _UNKNOWN)
    no_load_speed: Floats = of("nv", unit="rad/s, m/s", later=True, **_LIMIT | _PART | _UNKNOWN)
    winding_resistance: Floats = of("nv", unit="ohm", later=True, **_PART)
    gravity: Floats = of("axes", unit="m/s²")
    contact_link: Integers = of("nc", kind=int, points="nl", least=0)
    contact_position: Floats = of("nc", "axes", unit="m")
    contact_radius: Floats = of("nc", unit="m", least=0.0)
    friction_scale: Floats = of("nc", **_SCALE)
    restitution_scale: Floats = of("nc", most=1.0, **_SCALE)
    actuator_joint: Integers = of("nu", kind=int, points="nv", least=0)
    torque_lower: Floats = of("nu", unit="N m, N", **_LIMIT)
    torque_upper: Floats = of("nu", unit="N m, N", **_LIMIT)
    loop_link: Integers = of("loops", 2, kind=int, points="nl", least=-1, **_LATER)
    loop_position: Floats = of("loops", 2, "axes", unit="m", **_LATER)
    coupling_joint: Integers = of("couplings", 2, kind=int, points="nv", least=-1, **_LATER)
    coupling_polynomial: Floats = of("couplings", POWERS, unit="rad, m", **_LATER)
    latch_joint: Integers = of("latches", kind=int, points="nv", least=0, **_LATER)
    latch_side: Integers = of("latches", kind=int, least=-1, **_LATER)
    latch_release: Integers = of("latches", kind=int, points="nl", least=-1, **_LATER)
    brake_joint: Integers = of("brakes", kind=int, points="nv", least=0, **_LATER)
    brake_limit: Floats = of("brakes", unit="N m, N", least=0.0, later=True, **_LIMIT | _UNKNOWN)
    pivot: int = of(kind=int, points="nl", least=0)

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
