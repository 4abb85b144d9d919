"""What a gait is to spend least of."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from heelstrike.errors import GaitError
from heelstrike.field_texts import dataclass


class Cost(enum.Enum):
    """Costs of a step. P = Γ ω is the mechanical power of a motor, Γ its torque, ω its speed.

    ``TORQUE`` is ∫ Σ Γ² dt, in N²m²s (paper eq. 40).

    ``MECHANICAL_ENERGY`` is ∫ Σ |P| dt, in J: braking costs as much as driving. Divided by weight
    and step length it is the cost of transport, and so a step of free length has the least cost of
    transport.

    ``ELECTRICAL_ENERGY`` is ∫ Σ max(P + Γ² ω₀/τ₀, 0) dt, in J: work and heat of motors with the
    stall torque τ₀ and the no-load speed ω₀, which give nothing back. (With the torque constant K
    and the resistance R of the winding, R i² = R Γ²/K², and K²/R = τ₀/ω₀.)
    """

    TORQUE = "torque"
    MECHANICAL_ENERGY = "mechanical_energy"
    ELECTRICAL_ENERGY = "electrical_energy"


@dataclass(frozen=True, eq=False)
class Instant:
    """What a cost may depend on: the robot at an instant of its step, in symbols of CasADi."""

    position: Any
    """(nq,) All coordinates."""
    velocity: Any
    """(nv,) Their rates."""
    torque: Any
    """(nu,) Torques of the motors, in the order of the actuators."""
    motor_velocity: Any
    """(nu,) Rates of the joints with motors, in the order of the actuators."""
    force: Any
    """(2,) Force of the ground on the robot along the ground and away from it (N)."""
    acceleration: Any = None
    """(nv,) Accelerations of all coordinates in a motion; None in gaits of one step, whose costs
    know none."""
    time: Any = None
    """Time since the beginning of a motion (s); None in gaits of one step, whose costs know no
    time."""

    points: Any = None
    """(nc, 2) Places of all contact points of a motion, along the ground and away from it, in m;
    None in gaits of one step."""
    point_force: Any = None
    """(nc, 2) Forces of the ground on all contact points of a motion, normal and tangential, as
    `Motion.forces` has them, in N; None in gaits of one step."""
    stands: Any = None
    """(nc,) 1 for each contact point that stands in a phase of a motion, 0 for the others; None in
    gaits of one step."""
    share: Any = None
    """Share of its phase of a motion that has gone by, from 0 to 1; None in gaits of one step."""
    torque_rate: Any = None
    """(nu,) Rates at which the torques of the motors change in a motion (N m/s; N/s of slides);
    None in gaits of one step. If a cost or a constraint depends on them, torques jump only where
    phases join."""


OwnCost = Callable[[Instant], Any]
"""A cost of one's own: of an instant, the rate as an expression of CasADi."""


OwnConstraint = Callable[[Instant], Any]
"""A constraint of one's own: of an instant, expressions of CasADi that are not to be negative."""


def costs_of(asked: Any) -> dict[Cost, float] | OwnCost:
    """Return costs with their weights, or a function of one's own, of what was asked.

    Raises
    ------
    GaitError
        If it is none.
    """
    if callable(asked):
        return asked
    try:
        named = list(asked.items()) if isinstance(asked, Mapping) else [(asked, 1.0)]
        weights = {Cost(name): float(weight) for name, weight in named}
    except (TypeError, ValueError):
        named, weights = [], {}
    if not weights or not all(np.isfinite(w) and w > 0.0 for w in weights.values()):
        names = ", ".join(repr(cost.value) for cost in Cost)
        raise GaitError(
            f"cost must be one of {names}, several of them with positive weights, as "
            f"{{'torque': 1.0, 'mechanical_energy': 10.0}}, or a function of an instant, "
            f"got {asked!r}"
        )
    if len(weights) < len(named):
        raise GaitError(f"cost names one cost twice: {asked!r}. Give one weight to each.")
    return weights
