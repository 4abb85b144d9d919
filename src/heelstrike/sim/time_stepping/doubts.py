"""What makes steps of time stepping doubtful: springs too stiff for them, links too easy to turn.

Where a scheme takes springs and dampers as at the beginning of a step, a spring ω and a damper c
(per mass) make energy unless ``h² ω² / 4 + h c / 2 ≤ 1``. Of a robot that is the largest eigenvalue
of A⁻¹ (h² K / 4 + h D / 2), as it moves freely: what the ground or loops hold can only swing more
slowly (Rayleigh).

Contact impulses are found from G = J A⁻¹ Jᵀ. Where a point is so many times easier to move than the
whole robot, because its link has next to no inertia, so many digits of what it takes to stop the
robot are lost in G, and no solver can certify what is not there.
"""

from __future__ import annotations

import numpy as np

from heelstrike.dynamics import contact_jacobian, mass_matrix
from heelstrike.robot.model import Floats
from heelstrike.robot.robot import Robot

# How many times easier to move than the whole robot a contact point may be: certificates ask for
# nine digits of sixteen.
EASIEST = 3e7


class SimulationWarning(UserWarning):
    """A simulation begins, but what comes out of it may mean little."""


def stiffest(robot: Robot, q: Floats, step: float) -> tuple[float, str]:
    """Return how stiff the springs and dampers are for a step, and the joint that swings most.

    Beyond one a link that is free to swing on them gains energy in each step.
    """
    model = robot.model
    pull = 0.25 * step**2 * model.stiffness + 0.5 * step * model.damping
    # A is more than what motors and reductions add to it.
    if not np.any(pull > model.armature) or not np.all(np.isfinite(q)):
        return 0.0, ""
    value, mode = np.linalg.eig(np.linalg.solve(mass_matrix(robot, q), np.diag(pull)))
    worst = int(np.argmax(value.real))
    joint = int(np.argmax(pull * np.abs(mode[:, worst]) ** 2))
    return float(value[worst].real), robot.joint_names[joint]


def too_stiff(robot: Robot, q: Floats, step: float) -> str:
    """Say what is too stiff for a step and what to do about it; nothing if nothing is."""
    value, joint = stiffest(robot, q, step)
    if value <= 1.0:
        return ""
    shorter = step
    while stiffest(robot, q, shorter)[0] > 0.25:
        shorter *= 0.5
    return (
        f"the spring or damper of joint {joint!r} is too stiff for a step of {step:g} s: a link "
        f"that is free to swing on it gains energy in each step. Use Scheme.LINEARLY_IMPLICIT, a "
        f"step of at most {shorter:.2g} s, or EventDriven()"
    )


def too_light(robot: Robot, q: Floats) -> str:
    """Say which link turns too easily under contact forces, and what to do about it."""
    model = robot.model
    if not robot.nc or not np.all(np.isfinite(q)):
        return ""
    jacobian = contact_jacobian(robot, q).reshape(-1, robot.nv)
    moved = np.linalg.lstsq(mass_matrix(robot, q), jacobian.T, rcond=None)[0]
    ease = np.einsum("ij,ji->i", jacobian, moved) * model.mass.sum()
    worst = int(np.argmax(ease))
    if ease[worst] <= EASIEST:
        return ""
    link = model.contact_link[worst // 2]
    name, inertia = robot.link_names[link], model.inertia[link]
    enough = inertia * ease[worst] / (0.1 * EASIEST)
    cure = f"an inertia of {enough:.2g} kg m²" if enough > 0.0 else "some inertia"
    return (
        f"link {name!r} has so little inertia ({inertia:.3g} kg m²) that a contact point on it is "
        f"{ease[worst]:.1g} times easier to move than the robot: contact impulses lose as many "
        f"digits, and may not be certified. Use EventDriven(), or {cure}"
    )
