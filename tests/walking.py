"""A gait and a walk of bravo7 that several tests look at, made once."""

from __future__ import annotations

from functools import cache

import heelstrike as hs
from heelstrike.sim import Scheme

STEP_LENGTH = 0.30
STEP_DURATION = 0.70
FRICTION = 0.75


@cache
def bravo7() -> hs.Robot:
    """Return the paper's robot."""
    return hs.load_robot("bravo7")


@cache
def gait() -> hs.Gait:
    """Return the reference gait, 0.30 m in 0.70 s."""
    return hs.optimize_gait(
        bravo7(), step_length=STEP_LENGTH, step_duration=STEP_DURATION, friction=FRICTION
    )


@cache
def walk(*, steps: int = 20, step: float = 1e-3, scheme: Scheme = Scheme.IMPACT_RESOLVED) -> hs.Run:
    """Walk the reference gait by computed torque."""
    return hs.simulate(
        bravo7(),
        hs.ComputedTorque(bravo7(), gait()),
        state=gait().initial_state,
        duration=steps * STEP_DURATION,
        method=hs.TimeStepping(step=step, scheme=scheme),
        ground=hs.Ground(friction=FRICTION),
    )
