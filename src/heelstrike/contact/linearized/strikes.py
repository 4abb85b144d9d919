"""What comes down in one instant, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heelstrike.contact.ground import Ground
from heelstrike.contact.linearized.motion import (
    ActiveContacts,
    ImpactLinearization,
    linearize_contact,
    linearize_impact,
    saltation_matrix,
)
from heelstrike.contact.workspace import Floats
from heelstrike.field_texts import dataclass
from heelstrike.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class Strike:
    """One of them."""

    gradient: Floats
    """(nq + nv,) Derivative of the gap that closes."""
    before: Floats
    after: Floats
    """before, after: (nq + nv,) Rates of the state: after those that came down before it, and after
    it."""
    impact: ImpactLinearization
    """Its impact."""

    def saltation(self, after: Floats | None = None) -> Floats:
        """Saltation matrix, under the rate after it or another."""
        rate = self.after if after is None else after
        return saltation_matrix(self.impact.reset, self.gradient, self.before, rate)

    @property
    def section(self) -> Floats:
        """The same where the undisturbed walk waits for the disturbed: errors at the event."""
        return self.saltation(np.zeros(len(self.before)))


def strikes(
    robot: Robot, q: Floats, v: Floats, rate: Floats, torque: Floats,
    order: Sequence[tuple[Floats, ActiveContacts]], ground: Ground | None = None,
    numbers: Sequence[str] = (), force: Floats | None = None,
) -> list[Strike]:  # fmt: skip
    """Let contact points, or joints at stops, come down in an order.

    Parameters
    ----------
    robot : Robot
        The robot.
    q, v : (nq,) and (nv,) float
        State just before.
    rate : (nq + nv,) float
        Its rate then.
    torque : (nu,) float
        Joint torques afterwards.
    order : sequence of ((nq + nv,) float, ActiveContacts)
        Of each the derivative of its gap, and what takes part in its impact and holds after it.
    ground, numbers
        As of :func:`~heelstrike.linearize_impact`.
    force : (nv,) float, optional
        Generalised force that acts besides.

    Returns
    -------
    list of Strike
        None of an order in which one would not come down after those before it.
    """
    found: list[Strike] = []
    for gradient, active in order:
        if found and gradient @ rate >= 0.0:
            return []
        impact = linearize_impact(robot, q, v, active, ground=ground, numbers=numbers)
        v, before = impact.velocity, rate
        rate = linearize_contact(robot, q, v, torque, active, ground=ground, force=force).rate
        found.append(Strike(gradient, before, rate, impact))
    return found
