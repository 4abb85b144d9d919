"""The robot in space as the kernels see it: a tree of links with joints of any kind, as arrays.

Positions and velocities are counted apart. Every joint says where its own begin; a free joint has
seven positions and six velocities, a ball joint four and three, hinges and slides one of each.
"""

from __future__ import annotations

import enum
from typing import Any

import numpy as np

from heelstrike.compiler.bundle import Bundle, extent
from heelstrike.robot.model import Floats, Integers, Number, of

AXES = 3
"""Dimension of space."""


class JointKind(enum.IntEnum):
    """How a joint lets its link move, numbered as in MuJoCo."""

    FREE = 0
    BALL = 1
    SLIDE = 2
    HINGE = 3

    @property
    def positions(self) -> int:
        """How many positions it has."""
        return (7, 4, 1, 1)[self]

    @property
    def velocities(self) -> int:
        """How many velocities it has."""
        return (6, 3, 1, 1)[self]


FREE, BALL, SLIDE, HINGE = map(int, JointKind)
"""The same as plain numbers, for kernels: those up to BALL turn by a quaternion."""

NO_VELOCITY = -1
"""What comes before the first velocity of a chain."""

_LIMIT: dict[str, Any] = {"infinite": True}
_PART: dict[str, Any] = {"default": 0.0, "least": 0.0}


class SpatialModel(Bundle):
    """A kinematic tree in space with inertia, contact points and actuators.

    Every link is attached to its parent by one joint; a body with several joints becomes a chain of
    links of which all but the last are massless. The frame of a link on a hinge or a slide is
    parallel to its parent's when ``q`` equals `reference`; that of a free link, or of one on a ball
    joint, is the frame that the file gives its body. Vectors are (x, y, z) in link axes, lengths in
    metres.

    The velocities on the way from a link to the world are its *chain*. Rows of a Jacobian, of the
    mass matrix and of its factor are kept along chains: entry ``a`` of a row is that of velocity
    ``chain[k, a]``, where ``k`` is the last velocity of the chain.
    """

    nl: int = extent()
    nj: int = extent()
    nq: int = extent()
    nv: int = extent()
    """nl, nj, nq, nv: Number of links, of joints (one a link), of positions and of velocities."""
    nc: int = extent()
    nu: int = extent()
    """nc, nu: Number of contact points and of actuators."""
    longest: int = extent()
    """Number of velocities on the longest chain."""
    axes: int = extent()
    """Dimension of space."""

    parent: Integers = of("nl", kind=int, points="nl", least=-1)
    """Index of the parent link, smaller than the link's own; -1 for the world."""
    joint_kind: Integers = of("nj", kind=int, least=0, most=3)
    """How each joint moves its link, by :class:`JointKind`."""
    first_position: Integers = of("nj", kind=int, points="nq", least=0)
    first_velocity: Integers = of("nj", kind=int, points="nv", least=0)
    """first_position, first_velocity: Where the positions and velocities of each joint begin."""
    axis: Floats = of("nj", "axes")
    """Unit axis of a hinge or slide, in the axes of the parent; zero of other joints."""
    offset: Floats = of("nj", "axes", unit="m", label="place")
    """Origin of the link frame in the parent's frame when ``q`` equals `reference`; zero of a free
    joint, whose position tells it."""
    turn: Floats = of("nj", 4)
    """Unit quaternion of the frame of a link on a ball joint in the parent's frame, where the joint
    has not turned; (1, 0, 0, 0) of other joints."""
    reference: Floats = of("nq", unit="rad, m")
    """Positions in which the robot stands as it is described."""
    mass: Floats = of("nl", unit="kg", **_PART)
    """Mass of the link."""
    center_of_mass: Floats = of("nl", "axes", unit="m", label="centre of mass")
    """In the link frame."""
    inertia: Floats = of("nl", 6, unit="kg m²")
    """Tensor of inertia about the link's own centre of mass, in link axes: xx, yy, zz, xy, xz,
    yz."""
    armature: Floats = of("nv", unit="kg m², kg", **_PART)
    """Inertia of the rotor."""
    damping: Floats = of("nv", unit="N m s/rad, N s/m", **_PART)
    """Viscous damping."""
    stiffness: Floats = of("nj", unit="N m/rad, N/m", **_PART)
    """Stiffness of the spring. That of a ball joint turns it back, that of a free one pulls its
    link back, too."""
    rest: Floats = of("nq", unit="rad, m")
    """Positions at which the springs are slack."""
    dry_friction: Floats = of("nv", unit="N m, N", **_PART)
    """Coulomb friction of the joint: what it takes to move it at all, and what opposes it as it
    moves."""
    lower: Floats = of("nj", unit="rad, m", **_LIMIT)
    upper: Floats = of("nj", unit="rad, m", **_LIMIT)
    """lower, upper: Range of a hinge or slide; infinite where there is no stop. A ball joint turns
    by no more than `upper` from where it has not turned."""
    speed_limit: Floats = of("nv", unit="rad/s, m/s", infinite=True, **_PART)
    """Greatest speed that the drive of the joint stands; infinite where there is none."""
    stall_torque: Floats = of("nv", unit="N m, N", infinite=True, **_PART)
    """Torque of the motor at rest and full voltage, seen at the joint; infinite if unknown."""
    no_load_speed: Floats = of("nv", unit="rad/s, m/s", infinite=True, **_PART)
    """Speed of the joint at which that torque is zero, falling along a straight line; infinite if
    unknown."""
    winding_resistance: Floats = of("nv", unit="ohm", **_PART)
    """Electrical resistance of the motor; zero if unknown."""
    gravity: Floats = of("axes", unit="m/s²")
    """Acceleration of free fall, (0, 0, -9.81) on earth."""
    contact_link: Integers = of("nc", kind=int, points="nl", least=0)
    """Link that carries each contact point."""
    contact_position: Floats = of("nc", "axes", unit="m")
    """Centre of each contact sphere, or of each rim, in the link frame."""
    contact_radius: Floats = of("nc", unit="m", least=0.0)
    """Radius of each contact sphere; zero for a point, or of a rim what it is thick."""
    contact_axis: Floats = of("nc", "axes")
    """Unit axis of a rim in the link frame, zero of a sphere."""
    contact_rim: Floats = of("nc", unit="m", least=0.0)
    """Radius of the circle that a rim is; zero of a sphere. The point of a rim that meets the
    ground is its lowest."""
    friction_scale: Floats = of("nc", default=1.0, least=0.0)
    restitution_scale: Floats = of("nc", default=1.0, least=0.0, most=1.0)
    """friction_scale, restitution_scale: What friction and restitution of the ground are multiplied
    by under each contact point; restitution by one at most."""
    actuator_velocity: Integers = of("nu", kind=int, points="nv", least=0)
    """Velocity that each actuator drives."""
    torque_lower: Floats = of("nu", unit="N m, N", **_LIMIT)
    torque_upper: Floats = of("nu", unit="N m, N", **_LIMIT)
    """torque_lower, torque_upper: Limits of torque or force at the joint; infinite where there is
    none."""
    velocity_joint: Integers = of("nv", kind=int, points="nj", least=0)
    """Joint, and so link, of each velocity."""
    last_velocity: Integers = of("nl", kind=int, points="nv", least=0)
    """Last velocity of the chain of each link."""
    depth: Integers = of("nv", kind=int, least=0)
    """How many velocities come before each on its chain."""
    chain: Integers = of("nv", "longest", kind=int, points="nv", least=-1)
    """Velocities of the chain of each velocity, from the world outwards, itself the last; -1 behind
    it."""
    shared: Integers = of("nv", "nv", kind=int, least=0)
    """How many velocities the chains of two velocities share."""
    first_contact: Integers = of("nl + 1", kind=int, least=0)
    """First contact point of each link, which has all before that of the next; nc behind the
    last."""
    reach: Floats = of("nl", unit="m", least=0.0)
    """How far from the origin of each link its contact points reach; zero where it has none."""
    pivot: int = of(kind=int, points="nl", least=0)
    """Link whose origin serves as the reference point of spatial vectors, so that a robot far from
    the world origin loses no digits."""

    @classmethod
    def made(cls, **members: Any) -> SpatialModel:
        """Make a model of anything array-like; what follows from the tree need not be given.

        Parameters
        ----------
        **members : array
            Members by name, contact points in the order of their links; but for `first_position`,
            `first_velocity`, `velocity_joint`, `last_velocity`, `depth`, `chain`, `shared`,
            `first_contact` and `reach`, which follow.

        Returns
        -------
        SpatialModel
            The model.
        """
        parent = np.array(members["parent"], dtype=np.int64).reshape(-1)
        kinds = [JointKind(int(kind)) for kind in np.ravel(members["joint_kind"])]
        given = members | _tree(parent, kinds) | _contacts(len(parent), members)
        made: dict[str, Any] = dict(given)
        for name, number in SPATIAL_NUMBERS.items():
            if number.shape:
                sizes = [AXES if size == "axes" else size for size in number.shape[1:]]
                longest = given["chain"].shape[1]
                whole = {"longest": longest, "nv": len(given["depth"])}
                rest = [whole.get(str(size), size) for size in sizes]
                values = np.array(given[name], dtype=number.dtype, order="C")
                made[name] = values.reshape(-1, *rest)
        return cls(**made)


SPATIAL_NUMBERS: dict[str, Number] = {
    name: member for name, member in SpatialModel.declared.items() if isinstance(member, Number)
}
"""All that a model in space consists of."""


def _contacts(links: int, members: dict[str, Any]) -> dict[str, Any]:
    """Which contact points each link has, and how far from its origin they reach."""
    link = np.array(members["contact_link"], dtype=np.int64).reshape(-1)
    if np.any(np.diff(link) < 0):
        raise ValueError("contact points are in the order of their links")
    place = np.array(members["contact_position"], dtype=np.float64).reshape(-1, AXES)
    extent = np.ravel(members["contact_radius"]) + np.ravel(members["contact_rim"])
    reach = np.zeros(links)
    np.maximum.at(reach, link, np.linalg.norm(place, axis=1) + extent)
    return {"first_contact": np.searchsorted(link, np.arange(links + 1)), "reach": reach}


def _tree(parent: Integers, kinds: list[JointKind]) -> dict[str, Any]:
    """What follows from the parents of links and the kinds of their joints."""
    positions = np.cumsum([0, *(kind.positions for kind in kinds)])
    velocities = np.cumsum([0, *(kind.velocities for kind in kinds)])
    joint = np.repeat(np.arange(len(kinds)), np.diff(velocities))
    last = velocities[1:] - 1
    chains: list[list[int]] = []
    for k, own in enumerate(joint.tolist()):
        first = k == velocities[own]
        before = (int(last[parent[own]]) if parent[own] >= 0 else NO_VELOCITY) if first else k - 1
        chains.append([*(chains[before] if before >= 0 else ()), k])
    longest = max(map(len, chains), default=0)
    chain = np.full((len(chains), longest), NO_VELOCITY, dtype=np.int64)
    for k, own_chain in enumerate(chains):
        chain[k, : len(own_chain)] = own_chain
    same = (chain[:, None, :] == chain[None, :, :]) & (chain[:, None, :] >= 0)
    return {
        "first_position": positions[:-1],
        "first_velocity": velocities[:-1],
        "velocity_joint": joint,
        "last_velocity": last,
        "depth": np.array([len(each) - 1 for each in chains], dtype=np.int64),
        "chain": chain,
        "shared": same.sum(axis=2),
    }
