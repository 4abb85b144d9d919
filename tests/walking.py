"""Gaits of bravo7 and rabbit, and a walk, that several tests look at, made once."""

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


@cache
def rabbit() -> hs.Robot:
    """Return a robot on point feet."""
    return hs.load_robot("rabbit")


@cache
def rabbit_gait() -> hs.Gait:
    """Return a walk of it, 0.21 m in 0.58 s."""
    return hs.optimize_gait(
        rabbit(), step_length=0.21, step_duration=0.58, clearance=0.02, friction=0.6, starts=1
    )


@cache
def rabbit_phased() -> hs.PhasedGait:
    """Return the same walk over its phase."""
    return hs.PhasedGait.from_gait(rabbit(), rabbit_gait())
