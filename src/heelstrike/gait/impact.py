"""The plastic impact at touchdown, in symbols (paper eq. 20-22 with restitution zero).

The landing foot comes to rest flat on the ground while the other foot leaves without an impulse.
With v⁺ prescribed by "the landing foot rests", eq. 22 becomes an inverse problem of the same form
as that of the forces in single support: the momentum A (v⁺ − v⁻) that no joint can supply is the
impulse of the ground, and what the joints would have to supply must vanish.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from heelstrike.gait.single_support import SingleSupport, Symbols, pinned, reaction
from heelstrike.gait.sole import Sole


class Impact:
    """Change of velocity when a foot lands flat.

    Parameters
    ----------
    before : SingleSupport
        The robot on its old stance foot at the instant of touchdown, moving.
    landing : Sole
        The foot that lands.
    velocity : (nv - 3,) object array
        Joint velocities after the impact, in the order of the coordinates.

    Attributes
    ----------
    v : (nv,) object array
        Velocity of all coordinates after the impact, with the landing foot at rest.
    impulse_x, impulse_z, impulse_moment : casadi.SX
        Impulse of the ground on the robot at the middle of the landing sole (N s, N m s); the
        moment is about +y.
    joint_impulse : (nv - 3,) object array
        Impulses that the joints would have to exert (N m s): all zero for the velocity that
        satisfies eq. 22.
    """

    def __init__(self, before: SingleSupport, landing: Sole, velocity: Symbols) -> None:
        jacobian = before.jacobian(landing.link, landing.point)
        self.v = pinned(jacobian, velocity, np.zeros(3))
        momentum = before.mass_matrix() @ (self.v - before.v)
        impulse = reaction(jacobian, momentum)
        self.impulse_x, self.impulse_z, self.impulse_moment = impulse
        wrench: Any = np.array(impulse, dtype=object)
        self.joint_impulse = momentum[3:] - jacobian[:, 3:].T @ wrench
