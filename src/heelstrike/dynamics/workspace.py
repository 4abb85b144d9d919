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

    Attributes
    ----------
    angle, cosine, sine : (nl,) float
        Orientation of every link.
    origin : (nl, axes) float
        World position of every link frame.
    pivot : (axes,) float
        World position of the reference point of spatial vectors.
    motion : (nv, 3) float
        Motion of the joint's link per unit of every velocity.
    velocity : (nl, 3) float
        Spatial velocity of every link.
    bias_acceleration : (nl, 3) float
        Spatial acceleration of every link when all joint accelerations are zero, no gravity.
    acceleration, force : (nl, 3) float
        Scratch of the recursions.
    inertia : (nl, 4) float
        Mass, first moments (x, z) and second moment of every link about the pivot.
    composite : (nl, 4) float
        The same for the subtree of every link.
    zero : (nv,) float
        Zeros, never written.
    """

    angle: Floats = array("nl")
    cosine: Floats = array("nl")
    sine: Floats = array("nl")
    origin: Floats = array("nl", "axes")
    pivot: Floats = array("axes")
    motion: Floats = array("nv", 3)
    velocity: Floats = array("nl", 3)
    bias_acceleration: Floats = array("nl", 3)
    acceleration: Floats = array("nl", 3)
    force: Floats = array("nl", 3)
    inertia: Floats = array("nl", 4)
    composite: Floats = array("nl", 4)
    zero: Floats = array("nv")
