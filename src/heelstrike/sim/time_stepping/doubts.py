"""What makes steps of time stepping doubtful: springs too stiff for them, links too easy to turn.

Where a scheme takes springs and dampers as at the beginning of a step, a spring ω and a damper c
(per mass) make energy unless ``h² ω² / 4 + h c / 2 ≤ 1``. Of a robot that is the largest eigenvalue
of A⁻¹ (h² K / 4 + h D / 2), as it moves freely: what the ground or loops hold can only swing more
slowly (Rayleigh).

Below that a spring makes no energy forever, but the step swings with the energy of another one::

    v²/2 + ω² q²/2 − h ω² q v/2    stays, so that the true energy is up to (1 + s) / (1 − s) times
                                   what it was, with s = h ω / 2

Whoever takes energy in or out on the way, as a stop does, keeps what it is off by.

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


TOLD_WRONG = 2.0
"""How many times the energy of a spring a step may tell of without being in doubt: where h ω is
2/3, a tenth of a period."""


class SimulationWarning(UserWarning):
    """A simulation starts, but its results may be unreliable."""


def stiffest(robot: Robot, q: Floats, step: float, *, dampers: bool = True) -> tuple[float, str]:
    """Return how stiff the springs and dampers are for a step, and the joint that swings most.

    Beyond one a link that is free to swing on them gains energy in each step. Of springs alone it
    is the square of half the step times the highest frequency.
    """
    model = robot.model
    pull = 0.25 * step**2 * model.stiffness + (0.5 * step * model.damping if dampers else 0.0)
    # A is more than what motors and reductions add to it.
    if not np.any(pull > model.armature) or not np.all(np.isfinite(q)):
        return 0.0, ""
    value, joint = largest_pull(mass_matrix(robot, q), pull)
    return value, robot.joint_names[joint]


def largest_pull(mass: Floats, pull: Floats) -> tuple[float, int]:
    """Return the largest eigenvalue of A⁻¹ diag(pull), and the velocity that takes most part."""
    value, mode = np.linalg.eig(np.linalg.solve(mass, np.diag(pull)))
    worst = int(np.argmax(value.real))
    return float(value[worst].real), int(np.argmax(pull * np.abs(mode[:, worst]) ** 2))


def too_stiff(robot: Robot, q: Floats, step: float) -> str:
    """Say what is too stiff for a step and what to do about it; nothing if nothing is."""
    value, joint = stiffest(robot, q, step)
    if value <= 1.0:
        return ""
    return (
        f"the spring or damper of joint {joint!r} is too stiff for a step of {step:g} s: a link "
        f"that is free to swing on it gains energy in each step. {_cures(robot, q, step)}"
    )


def hardly_told(robot: Robot, q: Floats, step: float) -> str:
    """Say which spring swings too fast for a step to tell its energy; nothing if none does."""
    squared, joint = stiffest(robot, q, step, dampers=False)
    share = float(np.sqrt(squared))
    times = (1.0 + share) / (1.0 - share) if share < 1.0 else 0.0
    if times <= TOLD_WRONG:
        return ""
    return (
        f"on the spring of joint {joint!r} a link may swing so fast that a step of {step:g} s "
        f"tells up to {times:.2g} times its energy. {_cures(robot, q, step)}"
    )


def _cures(robot: Robot, q: Floats, step: float) -> str:
    shorter, share = step, (TOLD_WRONG - 1.0) / (TOLD_WRONG + 1.0)
    while stiffest(robot, q, shorter)[0] > share**2:
        shorter *= 0.5
    return f"Use Scheme.LINEARLY_IMPLICIT, a step of at most {shorter:.2g} s, or EventDriven()"


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
