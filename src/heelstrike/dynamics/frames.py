"""The frame of a contact: its normal, then the tangents that complete it.

In the plane the tangent of the normal (x, z) is (z, −x), forward on level ground.
"""

from __future__ import annotations

from heelstrike.compiler.compilation import kernel
from heelstrike.robot.model import Floats

Vector = tuple[float, float]


@kernel
def into_frame(normal: Floats, vector: Vector) -> Vector:
    """Return the components (normal, tangent) of a vector in world axes."""
    x, z = vector
    return normal[0] * x + normal[1] * z, normal[1] * x - normal[0] * z


@kernel
def out_of_frame(normal: Floats, components: Vector) -> Vector:
    """Return the vector in world axes that has the components (normal, tangent)."""
    along, across = components
    return normal[0] * along + normal[1] * across, normal[1] * along - normal[0] * across
