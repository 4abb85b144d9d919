"""Walks of bravo7 that fall for a known reason, and the same walk without it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache

import numpy as np
import walking

import heelstrike as hs
from heelstrike.analysis.diagnosis.symptoms import Cause
from heelstrike.experiments.laws import Entry
from heelstrike.experiments.laws import walking as walking_law
from heelstrike.experiments.what_if import Case
from heelstrike.sim.controller.interface import Contacts

STEPS = 7
SINCE = 1.0
"""When disturbances and faults begin, in s: in the second step, the left foot on the ground."""
EDGE = 1.0
"""Where the ground changes, in m: under the swing of the fourth step, which begins at 2.1 s."""


def profile(*corners: tuple[float, float]) -> hs.Ground:
    """Return level ground up to `EDGE`, and corners beyond."""
    return hs.Ground(
        friction=walking.FRICTION, profile=np.array([(-9.0, 0.0), (EDGE, 0.0), *corners])
    )


class Faulty:
    """Computed torque, of which one torque is made another from `SINCE` on."""

    def __init__(self, joint: str, fault: Callable[[float], float]) -> None:
        self.law = hs.ComputedTorque(walking.bravo7(), walking.gait())
        self.actuator = walking.bravo7().actuator_names.index(joint)
        self.fault = fault

    def torque(self, t: float, state: hs.State, contacts: Contacts) -> np.ndarray:
        torque = np.array(self.law.torque(t, state, contacts))
        if t >= SINCE:
            torque[self.actuator] = self.fault(torque[self.actuator])
        return torque


def walk(**others: object) -> Case:
    """Return the reference walk under computed torque, with something other."""
    given: dict[str, object] = {"robot": walking.bravo7(), "gait": walking.gait(), "steps": STEPS,
                                "ground": hs.Ground(friction=walking.FRICTION)}  # fmt: skip
    return Case(**(given | others))  # type: ignore[arg-type]


def pushed(newtons: float, **others: object) -> Case:
    """Return the walk with a push of 0.1 s on the trunk."""
    return walk(
        pushes=[hs.Push("trunk", force=(newtons, 0.0), start=SINCE, duration=0.1)], **others
    )


def faulty_law(joint: str, fault: Callable[[float], float]) -> Entry:
    """Return computed torque with a fault from `SINCE` on."""
    return walking_law("Faulty", lambda _, __: Faulty(joint, fault))


def faulty(joint: str, fault: Callable[[float], float]) -> Case:
    """Return the walk under a controller that has a fault from `SINCE` on."""
    return walk(law=faulty_law(joint, fault))


def weak(newton_metres: float) -> Case:
    """Return the walk on motors that give no more than so much."""
    robot, limit = walking.bravo7(), np.full(6, newton_metres)
    model = robot.model.replaced(torque_lower=-limit, torque_upper=limit)
    return walk(robot=dataclasses.replace(robot, model=model))


@dataclasses.dataclass(frozen=True)
class Known:
    """A fall whose cause is known: what, where, and from when to when it began (s)."""

    case: Callable[[], Case]
    cause: Cause
    where: str
    time: tuple[float, float]


KNOWN = {
    "ice": Known(
        lambda: walk(ground=hs.Ground(friction=0.06)), Cause.SLIPPED, "right_foot", (0.0, 0.7)
    ),
    "pushed forwards": Known(lambda: pushed(300.0), Cause.TIPPED_FORWARD, "left_foot", (1.0, 1.05)),
    "pushed backwards": Known(lambda: pushed(-300.0), Cause.TIPPED_BACK, "left_foot", (1.0, 1.05)),
    "bar": Known(
        lambda: walk(
            ground=profile((EDGE, 0.045), (EDGE + 0.02, 0.045), (EDGE + 0.02, 0.0), (99.0, 0.0))
        ),
        Cause.SCUFFED, "right_foot", (2.4, 2.7),
    ),
    "step up": Known(
        lambda: walk(ground=profile((EDGE, 0.04), (99, 0.04))),
        Cause.SCUFFED, "right_foot", (2.4, 2.7),
    ),
    "step down": Known(
        lambda: walk(ground=profile((EDGE, -0.05), (99, -0.05))),
        Cause.LATE_TOUCHDOWN, "right_foot", (2.79, 2.81),
    ),
    "weak motors": Known(lambda: weak(9.0), Cause.TORQUE_LIMIT, "right_hip", (0.0, 0.1)),
    "wrong sign": Known(
        lambda: faulty("left_hip", lambda torque: -torque),
        Cause.CONTROLLER, "left_hip", (1.0, 1.03),
    ),
    "no torque": Known(
        lambda: faulty("right_knee", lambda _: 0.0), Cause.CONTROLLER, "right_knee", (1.0, 1.05)
    ),
    "not a number": Known(
        lambda: faulty("right_knee", lambda _: np.nan), Cause.CONTROLLER, "", (0.99, 1.01)
    ),
}  # fmt: skip


@cache
def run_of(name: str) -> hs.Run:
    """Return the run of a known fall, made once."""
    return KNOWN[name].case().run()
