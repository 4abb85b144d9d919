"""Scratch arrays of the dynamics kernels, made once for a robot and used for every state."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heelstrike.compiler.bundle import Bundle

Floats = NDArray[np.float64]


class Workspace(Bundle):
    """What the kernels know about one state of a robot.

    Spatial vectors are planar and ordered (rotation about +y, x, z), in world axes, taken at the
    point `pivot`: the motion of a link is its angular velocity and the velocity of the body point
    that passes through the pivot; a force is its moment about the pivot and its resultant.

    Attributes
    ----------
    angle, cosine, sine : (nv,) float
        Orientation of every link.
    origin : (nv, 2) float
        World position of every link frame.
    pivot : (2,) float
        World position of the reference point of spatial vectors.
    motion : (nv, 3) float
        Motion of the link per unit velocity of its joint.
    velocity : (nv, 3) float
        Spatial velocity of every link.
    bias_acceleration : (nv, 3) float
        Spatial acceleration of every link when all joint accelerations are zero, no gravity.
    acceleration, force : (nv, 3) float
        Scratch of the recursions.
    inertia : (nv, 4) float
        Mass, first moments (x, z) and second moment of every link about the pivot.
    composite : (nv, 4) float
        The same for the subtree of every link.
    zero : (nv,) float
        Zeros, never written.
    """

    angle: Floats
    cosine: Floats
    sine: Floats
    origin: Floats
    pivot: Floats
    motion: Floats
    velocity: Floats
    bias_acceleration: Floats
    acceleration: Floats
    force: Floats
    inertia: Floats
    composite: Floats
    zero: Floats


def workspace(nv: int, dtype: Any = np.float64) -> Workspace:
    """Make the scratch arrays for a robot of `nv` coordinates (dtype ``object`` for symbols)."""

    def zeros(*shape: int) -> Floats:
        return np.zeros(shape, dtype=dtype)

    return Workspace(
        angle=zeros(nv),
        cosine=zeros(nv),
        sine=zeros(nv),
        origin=zeros(nv, 2),
        pivot=zeros(2),
        motion=zeros(nv, 3),
        velocity=zeros(nv, 3),
        bias_acceleration=zeros(nv, 3),
        acceleration=zeros(nv, 3),
        force=zeros(nv, 3),
        inertia=zeros(nv, 4),
        composite=zeros(nv, 4),
        zero=zeros(nv),
    )
