"""Gains of laws in space that are too high for how long their torques are held.

Torques u = −kp q − kd v, found once, act over n steps h of v⁺ = v + h (u − d v) / I, q⁺ = q + h v⁺.
From call to call that is a linear map, and what it does to its worst motion is its spectral radius.
Of one joint without a damper d, with T = n h, it is below one where

    T² kp / n + 2 T kd < 4 I    and    T kp (1 − 1/n) < 2 kd.
"""

from __future__ import annotations

import numpy as np

from heelstrike.dynamics import spatial
from heelstrike.robot.model import Floats
from heelstrike.robot.spatial.robot import SpatialRobot
from heelstrike.sim.controller.law import Law

GROWS_FROM_CALL_TO_CALL = 1e-6
"""Part by which a motion must grow between two calls to be told of. Rounding makes 1e-8 of what
nothing holds, whose eigenvalue is one twice."""


def too_high(robot: SpatialRobot, law: Law | None, q: Floats, step: float, steps: int) -> str:
    """Say which gains of a law are too high for torques held over steps; nothing if none are.

    Of links that nothing else holds: what stands on the ground bears more.
    """
    if law is None or law.stiffness is None or law.damping is None or not np.all(np.isfinite(q)):
        return ""
    pull = 0.25 * step**2 * law.stiffness + 0.5 * step * law.damping
    driven = robot.model.actuator_velocity
    if steps == 1 and not np.any(pull > robot.model.armature[driven]):
        return ""  # all inertias are more than that
    ease = np.linalg.inv(spatial.mass_matrix(robot, q))[np.ix_(driven, driven)]
    gains = np.hstack([np.diag(law.stiffness), np.diag(law.damping)])
    grows, motion = np.linalg.eig(
        _from_call_to_call(ease, robot.model.damping[driven], gains, step, steps)
    )
    mode = int(np.argmax(np.abs(grows)))
    most = float(np.abs(grows[mode]))
    if most <= 1.0 + GROWS_FROM_CALL_TO_CALL:
        return ""
    power = np.abs(gains @ motion[:, mode]) * np.abs(motion[len(driven) :, mode])
    joint = robot.joint_names[robot.model.velocity_joint[driven[np.argmax(power)]]]
    return (
        f"the gains of controller {law.function.name!r} on joint {joint!r} are too high for "
        f"torques that are held over {steps * step:g} s: a link that is free to swing on them "
        f"chatters, {most:.3g} times as far from call to call. Use lower ones there, or a smaller "
        "step or control_period; torques that are held over several steps need damping, too"
    )


def _from_call_to_call(
    ease: Floats, damper: Floats, gains: Floats, step: float, steps: int
) -> Floats:
    """Return the matrix that takes positions and velocities at a call to those at the next."""
    n = len(ease)
    one, none = np.eye(n), np.zeros((n, n))
    slowed, pushed = one - step * ease * damper, step * ease
    within = np.block(
        [[one, step * slowed, step * pushed], [none, slowed, pushed], [none, none, one]]
    )
    held = np.linalg.matrix_power(within, steps)
    return held[: 2 * n, : 2 * n] - held[: 2 * n, 2 * n :] @ gains
