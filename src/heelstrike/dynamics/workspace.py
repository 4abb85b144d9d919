"""Scratch arrays of the dynamics kernels, made once for a robot and used for every state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle, array

Floats = NDArray[np.float64]


class Workspace(Bundle):
    """What the kernels know about one state of a robot.

    Spatial vectors are planar and ordered (rotation about +y, x, z), in world axes, taken at the
    point `pivot`: the motion of a link is its angular velocity and the velocity of the body point
    that passes through the pivot; a force is its moment about the pivot and its resultant.
    """

    angle: Floats = array("nl")
    cosine: Floats = array("nl")
    sine: Floats = array("nl")
    """angle, cosine, sine: Orientation of every link."""
    origin: Floats = array("nl", "axes")
    """World position of every link frame."""
    pivot: Floats = array("axes")
    """World position of the reference point of spatial vectors."""
    motion: Floats = array("nv", 3)
    """Motion of the joint's link per unit of every velocity."""
    velocity: Floats = array("nl", 3)
    """Spatial velocity of every link."""
    bias_acceleration: Floats = array("nl", 3)
    """Spatial acceleration of every link when all joint accelerations are zero, no gravity."""
    acceleration: Floats = array("nl", 3)
    force: Floats = array("nl", 3)
    """acceleration, force: Scratch of the recursions."""
    inertia: Floats = array("nl", 4)
    """Mass, first moments (x, z) and second moment of every link about the pivot."""
    composite: Floats = array("nl", 4)
    """The same for the subtree of every link."""
    zero: Floats = array("nv")
    """Zeros, never written."""
