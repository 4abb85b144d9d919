"""The robot as the kernels see it: a planar tree of links, as plain arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array, extent, number

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


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
    armature, damping, stiffness, rest : (nv,) float
        Rotor inertia (kg m²), viscous damping (N m s), spring (N m) and its rest coordinate.
    dry_friction : (nv,) float
        Coulomb friction of the joint (N m; N of a slide): what it takes to move it at all, and what
        opposes it as it moves.
    lower, upper : (nq,) float
        Range of the coordinate; infinite where there is no stop.
    speed_limit : (nv,) float
        Greatest speed that the drive of the joint stands (rad/s, m/s), which gaits keep to;
        infinite where there is none.
    gravity : (axes,) float
        Acceleration of free fall, (0, -9.81) on earth.
    contact_link : (nc,) int
        Link that carries each contact point.
    contact_position : (nc, axes) float
        Centre of each contact disc in the link frame.
    contact_radius : (nc,) float
        Radius of each contact disc; zero for a point.
    actuator_joint : (nu,) int
        Coordinate that each actuator drives.
    torque_lower, torque_upper : (nu,) float
        Torque (N m) or force (N) limits at the joint; infinite where there is none.
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
    axes: int = extent()

    parent: Integers = array("nl", of=int)
    axis: Floats = array("nj", 3)
    offset: Floats = array("nj", "axes")
    reference: Floats = array("nq")
    mass: Floats = array("nl")
    center_of_mass: Floats = array("nl", "axes")
    inertia: Floats = array("nl")
    armature: Floats = array("nv")
    damping: Floats = array("nv")
    stiffness: Floats = array("nv")
    rest: Floats = array("nq")
    dry_friction: Floats = array("nv")
    lower: Floats = array("nq")
    upper: Floats = array("nq")
    speed_limit: Floats = array("nv")
    gravity: Floats = array("axes")
    contact_link: Integers = array("nc", of=int)
    contact_position: Floats = array("nc", "axes")
    contact_radius: Floats = array("nc")
    actuator_joint: Integers = array("nu", of=int)
    torque_lower: Floats = array("nu")
    torque_upper: Floats = array("nu")
    pivot: int = number(int)
