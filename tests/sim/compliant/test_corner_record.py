"""Where the record of compliant ground says that forces in a corner act."""

from __future__ import annotations

import numpy as np

import heelstrike as hs
from heelstrike.compiler.compilation import uncompiled
from heelstrike.sim.compliant.corners import allocate_corners, tell_resultants


def test_no_force_in_a_corner_is_where_the_point_is() -> None:
    """Not where an earlier one was, nor at the origin of the world."""
    build = hs.RobotBuilder("disc")
    build.contact(build.floating_base("disc", mass=1.0, inertia=0.1), (0.0, 0.0), radius=0.05)
    robot = build.build()
    corners = allocate_corners(robot)
    corners.doubled = 1
    corners.joins[0] = 1
    corners.center[0] = 0.7, 0.2
    corners.frame[0] = -0.6, 0.8
    impulse, place = np.full((2, 2), np.nan), np.full((2, 2), 9.0)
    uncompiled(tell_resultants)(robot.model, corners, impulse, place)
    np.testing.assert_array_equal(impulse[0], 0.0)
    np.testing.assert_allclose(place[0], [0.73, 0.16], rtol=1e-12)
    # A force through the centre acts where it leaves the disc.
    corners.force[0] = 0.0, 2.0
    uncompiled(tell_resultants)(robot.model, corners, impulse, place)
    np.testing.assert_allclose(place[0], [0.7, 0.15], rtol=1e-12)
    np.testing.assert_allclose(impulse[0], [1.6, 1.2], rtol=1e-12)
