"""Scratch arrays of the kernels of space, made once for a robot and used for every state."""

from __future__ import annotations

from heelstrike.compiler.bundle import Bundle, array
from heelstrike.robot.model import Floats


class SpatialWorkspace(Bundle):
    """What the kernels know about one state of a robot in space.

    Spatial vectors are in world axes and taken at the point `pivot`; see
    :mod:`heelstrike.dynamics.spatial.algebra`.
    """

    rotation: Floats = array("nl", 9)
    """Matrix of every link, from its axes into those of the world, row by row."""
    origin: Floats = array("nl", "axes")
    """World position of every link frame."""
    pivot: Floats = array("axes")
    """World position of the reference point of spatial vectors."""
    motion: Floats = array("nv", 6)
    """Motion of the joint's link per unit of every velocity."""
    velocity: Floats = array("nl", 6)
    """Spatial velocity of every link."""
    bias_acceleration: Floats = array("nl", 6)
    """Spatial acceleration of every link when all velocities stay as they are, no gravity."""
    acceleration: Floats = array("nl", 6)
    force: Floats = array("nl", 6)
    """acceleration, force: Scratch of the recursions."""
    inertia: Floats = array("nl", 10)
    """Mass, first moments and second moments of every link about the pivot."""
    composite: Floats = array("nl", 10)
    """The same for the subtree of every link."""
    zero: Floats = array("nv")
    """Zeros, never written."""


class TreeFactor(Bundle):
    """A mass matrix and its factor, each row along the chain of its velocity.

    M = Lᵀ D L with L unit lower triangular (Featherstone 2008, section 6.5): entry ``a`` of row
    ``k`` is that of velocity ``chain[k, a]``, of which there are ``depth[k]`` before its own.
    """

    matrix: Floats = array("nv", "longest")
    """The mass matrix."""
    factor: Floats = array("nv", "longest")
    """L, and in its own place of every row, ``depth[k]``, the inverse of D."""
    root: Floats = array("nv")
    """Roots of the inverse of D."""
